#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/compensation/control_files.h"
#include "sim/files/permissions.h"

namespace abbe::sim {

struct ExportOptions {
  std::vector<Override> overrides;
  std::string case_name = "identified-position-table";  ///< what the tables are made from
  std::optional<compensation::ControlFormat> format;    ///< none: the scene's, else LinuxCNC
  std::filesystem::path folder;
  Permissions permissions;
};

/// What was written, and what the format cannot hold.
struct Exported {
  std::string scene, case_name;
  compensation::ControlFormat format{};
  std::vector<std::filesystem::path> files;
  std::vector<std::string> left_out, notes;
};

/// Writes the tables that a compensator of the scene amounts to in the layout of a control. The
/// channel `table` with the same format runs what these files make a control do.
/// @throws BadScene, BadInput, OutputFailure
Exported export_tables(const std::filesystem::path& scene, const ExportOptions& options);

/// `abbe export`.
Command export_command(Common& common);

}  // namespace abbe::sim
