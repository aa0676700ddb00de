#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/commands/command.h"
#include "sim/scene/document.h"

/// Commands for scenes and machines, and the contents of the library for `abbe new --list` and the
/// documentation.
namespace abbe::sim {

/// A kind of scene that `abbe new` can write.
struct KindEntry {
  std::string name, summary;
  std::string machine;  ///< name of its machine in the library
};

/// Travel of an axis, mm or degrees.
struct AxisTravel {
  char name = 'X';
  bool is_rotary = false;
  bool has_limits = false;  ///< false for a rotary axis with 10 000 degrees of travel or more
  double min = 0.0, max = 0.0;
};

/// A machine of the library.
struct MachineEntry {
  std::string name, summary;
  std::string structural_code;
  std::vector<AxisTravel> axes;  ///< without spindles
};

/// Kinds of scenes and machines of the library.
struct LibraryContents {
  std::vector<KindEntry> kinds;
  std::vector<MachineEntry> machines;  ///< sorted by name
};

/// Returns the contents of the library.
/// @param kinds  of `abbe new`
/// @throws BadInput without a library, BadScene for a machine that cannot be read
LibraryContents library_contents(const std::vector<std::string>& kinds);

/// Returns the travel of a machine as text, such as "X 400, Y 200, Z 240 mm; B -50 .. 100, C any
/// deg", with the length of linear and the limits of rotary travel.
std::string travel_text(const MachineEntry& machine);

/// Returns the output of `abbe new --list`.
std::string to_text(const LibraryContents& library);
/// Returns the output of `abbe new --list --json`.
nlohmann::ordered_json to_json(const LibraryContents& library);

/// Returns the kinds for which the library has a starter scene, `new/KIND.toml`.
const std::vector<std::string>& scene_kinds();

/// Writes the starter scene of a kind with all its files into a new or empty folder.
/// @throws BadInput without a library, BadScene, OutputFailure
std::vector<CopiedFile> write_new_scene(const std::string& kind,
                                        const std::filesystem::path& folder);

/// Returns the command `abbe new`.
Command new_command(CommonOptions& common);

/// Returns the command `abbe check`, which describes how a scene was understood, and cuts nothing.
Command check_command(CommonOptions& common);

/// Returns the command `abbe pose`, which needs one of `--at`, `--at-file` and `--grid`. Warnings
/// are printed to standard error; JSON output contains them too.
Command pose_command(CommonOptions& common);

}  // namespace abbe::sim
