#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/commands/command.h"
#include "sim/scene/document.h"

/// Contents of the library for `abbe new --list` and the documents.
namespace abbe::sim {

/// A kind of scene for `abbe new`.
struct KindEntry {
  std::string name, summary;
  std::string machine;  ///< name of its machine in the library
};

/// Travel of an axis, mm or degrees.
struct AxisEntry {
  char name = 'X';
  bool turns = false;
  bool ends = false;  ///< has meaningful limits; a rotary axis of 10 000 degrees has none
  double min = 0.0, max = 0.0;
};

/// A machine of the library.
struct MachineEntry {
  std::string name, summary;
  std::string code;             ///< structural code
  std::vector<AxisEntry> axes;  ///< without spindles
};

/// Kinds of scenes and machines of the library.
struct LibraryList {
  std::vector<KindEntry> kinds;
  std::vector<MachineEntry> machines;  ///< sorted by name
};

/// Returns the contents of the library.
/// @param kinds  of `abbe new`
/// @throws BadInput without a library, BadScene for a machine that cannot be read
LibraryList library_list(const std::vector<std::string>& kinds);

/// Returns "X 400, Y 200, Z 240 mm; B -50 .. 100, C any deg": the length of linear travel, the
/// limits of rotary travel.
std::string travel_text(const MachineEntry& machine);

std::string to_text(const LibraryList& list);
nlohmann::ordered_json to_json(const LibraryList& list);

/// Returns the kinds of machine for which the library has a first scene, `new/KIND.toml`.
const std::vector<std::string>& new_kinds();

/// Writes such a scene with its own files into a new or empty folder.
/// @throws BadInput without a library, BadScene, OutputFailure
std::vector<CopiedFile> new_scene(const std::string& kind, const std::filesystem::path& folder);

/// Returns the command `abbe new`.
Command new_command(CommonOptions& common);

/// Returns the command `abbe check`, which describes a scene as it was understood, and cuts
/// nothing.
Command check_command(CommonOptions& common);

/// Returns the command `abbe pose` with one of `--at`, `--at-file` and `--grid`. Warnings go to
/// standard error, or into the output if it is JSON.
Command pose_command(CommonOptions& common);

}  // namespace abbe::sim
