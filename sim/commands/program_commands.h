#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/compensation/control_files.h"
#include "sim/files/output.h"
#include "sim/loop/compensate.h"

namespace abbe::sim {

/// `abbe program FILE`
Command program_command(CommonOptions& common);

struct ProgramRewriteOptions {
  std::vector<Override> overrides;
  std::string case_name;  ///< belief-strategy-program, or a plug-in's file whose channel is
                          ///< program; empty: the first such case of the scene
  std::filesystem::path
      out;  ///< file; empty: `rewritten` in out/SCENE, its ending as the program's
  Permissions permissions;
};

/// What the words of a rewritten program change: where it would bring the tip and the tool axis of
/// a machine without errors, less where they should be.
struct ProgramChange {
  Spread tip;        ///< mm
  Spread direction;  ///< rad
};
ProgramChange program_change(const Job& job, const Commands& commands);

/// What was written.
struct RewriteOutcome {
  std::filesystem::path file;
  std::string case_name;
  std::size_t blocks_before = 0, blocks_after = 0, bytes = 0;
  ProgramChange correction;
  double path_tolerance = 0.0;  ///< mm
  struct Words {
    double mm = 0.0, deg = 0.0;
  };
  std::optional<Words> words;   ///< resolution of the words; none in PVT
  double point_left = 0.0;      ///< mm, what the corrections leave
  double direction_left = 0.0;  ///< rad
  std::vector<std::string> warnings;
};

/// Writes the compensated program of a scene, of the dialect of the original, and cuts nothing that
/// the belief does not ask for.
/// @throws BadScene, BadInput (a case through another channel, a scene without one), OutputFailure
RewriteOutcome rewrite(const std::filesystem::path& scene, const ProgramRewriteOptions& options);

/// `abbe rewrite`.
Command rewrite_command(CommonOptions& common);

struct ExportOptions {
  std::vector<Override> overrides;
  std::string case_name = "identified-position-table";  ///< what the tables are made from
  std::optional<compensation::ControlFormat> format;    ///< none: the scene's, else LinuxCNC
  std::filesystem::path folder;
  Permissions permissions;
};

/// What was written, and what the format cannot hold.
struct ExportOutcome {
  std::string scene, case_name;
  compensation::ControlFormat format{};
  std::vector<std::filesystem::path> files;
  std::vector<std::string> left_out, notes;
};

/// Writes the tables that a compensator of the scene amounts to in the layout of a control. The
/// channel `table` with the same format runs what these files make a control do.
/// @throws BadScene, BadInput, OutputFailure
ExportOutcome export_tables(const std::filesystem::path& scene, const ExportOptions& options);

/// `abbe export`.
Command export_command(CommonOptions& common);

}  // namespace abbe::sim
