#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/compensation/control_files.h"
#include "sim/files/output.h"
#include "sim/loop/compensate.h"

/// The commands `abbe program`, `abbe rewrite` and `abbe export`.
namespace abbe::sim {

/// Returns the command `abbe program FILE`.
Command program_command(CommonOptions& common);

/// Options of `abbe rewrite`.
struct ProgramRewriteOptions {
  std::vector<Override> overrides;
  /// belief-strategy-program, or the file of a plug-in with the channel program; empty: the first
  /// such case of the scene.
  std::string case_name;
  /// File; empty: `rewritten` in out/SCENE, with the extension of the original program.
  std::filesystem::path out;
  Permissions permissions;
};

/// Size of the correction in a rewritten program: the difference between the pose to which it would
/// bring the tool of a machine without errors and the intended pose.
struct ProgramChange {
  Spread tip;        ///< mm
  Spread direction;  ///< rad
};
/// Computes the size of the correction over all samples.
ProgramChange program_change(const Job& job, const Commands& commands);

/// Result of rewriting a program.
struct RewriteOutcome {
  std::filesystem::path file;
  std::string case_name;
  std::size_t blocks_before = 0, blocks_after = 0, bytes = 0;
  ProgramChange correction;
  double path_tolerance = 0.0;  ///< mm
  struct Words {
    double mm = 0.0, deg = 0.0;
  };
  std::optional<Words> words;              ///< resolution of the NC words; empty for PVT
  double remaining_point_error = 0.0;      ///< mm, largest error that the corrections do not remove
  double remaining_direction_error = 0.0;  ///< rad
  std::vector<std::string> warnings;
};

/// Writes the compensated program of a scene in the dialect of the original. Cuts a part only if
/// the belief requires it.
/// @throws BadScene, BadInput (a case through another channel, a scene without one), OutputFailure
RewriteOutcome rewrite(const std::filesystem::path& scene, const ProgramRewriteOptions& options);

/// Returns the command `abbe rewrite`.
Command rewrite_command(CommonOptions& common);

/// Options of `abbe export`.
struct ExportOptions {
  std::vector<Override> overrides;
  std::string case_name = "identified-position-table";  ///< case from which the tables are made
  std::optional<compensation::ControlFormat> format;  ///< empty: the scene's format, else LinuxCNC
  std::filesystem::path folder;
  Permissions permissions;
};

/// The files that were written, and notes on parts of the correction that the format cannot hold.
struct ExportOutcome {
  std::string scene, case_name;
  compensation::ControlFormat format{};
  std::vector<std::filesystem::path> files;
  std::vector<std::string> omissions, notes;
};

/// Writes the tables of a compensator of the scene in the layout of a control. The channel `table`
/// with the same format simulates a control with these files.
/// @throws BadScene, BadInput, OutputFailure
ExportOutcome export_tables(const std::filesystem::path& scene, const ExportOptions& options);

/// Returns the command `abbe export`.
Command export_command(CommonOptions& common);

}  // namespace abbe::sim
