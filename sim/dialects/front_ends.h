#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/cursor.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// Reads cutter locations: APT statements as CAM systems post them, or a CSV of x y z i j k feed.
/// Points are the tip in the workpiece (plus the work offset), vectors the tool axis from the tip
/// to the spindle; rotary axes are those of `kinematics::inverse` with the least rotary travel
/// first, and between points the tip goes straight while the rotary axes turn in proportion.
void read_cl(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordTableEntry> cl_words();

/// Reads programs of Fanuc's controls (Series 16i to 30i), custom macro B among them: of milling
/// controls, or of turning controls with G-code system A, as `run.turning()` says.
void read_fanuc(std::string_view text, ProgramRun& run);

/// Words of milling controls, and of turning controls.
std::span<const WordTableEntry> fanuc_words();
std::span<const WordTableEntry> fanuc_lathe_words();

/// Reads RS274/NGC as LinuxCNC does, and G43.4 of abbe's own programs.
void read_linuxcnc(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordTableEntry> linuxcnc_words();

/// Reads programs of Siemens 840D.
void read_siemens(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordTableEntry> siemens_words();

/// A dialect that is read: what turns its text into canonical moves, and its words.
struct FrontEnd {
  Dialect dialect;
  std::string_view title;  ///< for people, "LinuxCNC (RS274/NGC)"
  void (*read)(std::string_view text, ProgramRun& run);
  std::span<const WordTableEntry> (*words)();
  /// Words of its turning controls, where these are others; null: they are the same.
  std::span<const WordTableEntry> (*turning_words)() = nullptr;
  std::string_view turning_title = {};
};

/// The dialects in the order of the README. A dialect that is not among them is refused by name.
std::span<const FrontEnd> front_ends();

}  // namespace abbe::sim::dialects
