#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/cursor.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// Reads cutter locations: APT statements as posted by CAM systems, or a CSV of x y z i j k feed.
/// Points are the tip in the workpiece (plus the work offset), vectors the tool axis from the tip
/// to the spindle. Rotary axes are solved by `kinematics::inverse` with the least rotary travel
/// first. Between points the tip moves straight while the rotary axes move in proportion.
void read_cl(std::string_view text, ProgramRun& run);

/// Returns the words of cutter locations.
std::span<const WordTableEntry> cl_words();

/// Reads programs of Fanuc controls (Series 16i to 30i), including custom macro B: of milling
/// controls, or with `run.turning()` of turning controls with G-code system A.
void read_fanuc(std::string_view text, ProgramRun& run);

/// Return the words of milling controls and of turning controls.
std::span<const WordTableEntry> fanuc_words();
std::span<const WordTableEntry> fanuc_lathe_words();

/// Reads RS274/NGC as LinuxCNC does, and G43.4 of abbe's own programs.
void read_linuxcnc(std::string_view text, ProgramRun& run);

/// Returns the words of LinuxCNC.
std::span<const WordTableEntry> linuxcnc_words();

/// Reads programs of Siemens 840D.
void read_siemens(std::string_view text, ProgramRun& run);

/// Returns the words of Siemens 840D.
std::span<const WordTableEntry> siemens_words();

/// The front end of a dialect: the reader that issues canonical moves, and its words.
struct FrontEnd {
  Dialect dialect;
  std::string_view title;  ///< for people, "LinuxCNC (RS274/NGC)"
  void (*read)(std::string_view text, ProgramRun& run);
  std::span<const WordTableEntry> (*words)();
  /// Words of its turning controls if these differ; null: the same words.
  std::span<const WordTableEntry> (*turning_words)() = nullptr;
  std::string_view turning_title = {};
};

/// Returns the front ends in the order of the README. Any other dialect is an input error that
/// names it.
std::span<const FrontEnd> front_ends();

}  // namespace abbe::sim::dialects
