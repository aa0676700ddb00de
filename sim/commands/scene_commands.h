#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/commands/command.h"
#include "sim/scene/document.h"

/// What the library has to begin with, for `abbe new --list` and the documents.
namespace abbe::sim {

/// A kind of `abbe new`.
struct KindEntry {
  std::string name, summary;
  std::string machine;  ///< of the library
};

/// Travel of an axis of a machine, mm or degrees.
struct AxisEntry {
  char name = 'X';
  bool turns = false;
  bool ends = false;  ///< there are limits worth the name: a turn of 10 000 degrees has none
  double min = 0.0, max = 0.0;
};

/// A machine of the library.
struct MachineEntry {
  std::string name, summary;
  std::string code;             ///< structural
  std::vector<AxisEntry> axes;  ///< without spindles
};

struct LibraryList {
  std::vector<KindEntry> kinds;
  std::vector<MachineEntry> machines;  ///< by name
};

/// @param kinds  of `abbe new`
/// @throws BadInput without a library, BadScene for a machine that cannot be read
LibraryList library_list(const std::vector<std::string>& kinds);

/// "X 400, Y 200, Z 240 mm; B -50 .. 100, C any deg": of a slide how far, of a turn from where to
/// where.
std::string travel_text(const MachineEntry& machine);

std::string to_text(const LibraryList& list);
nlohmann::ordered_json to_json(const LibraryList& list);

/// Kinds of machine for which the library has a scene to begin with, `new/KIND.toml`.
const std::vector<std::string>& new_kinds();

/// Writes such a scene with files of its own into a new or empty folder.
/// @throws BadInput without a library, BadScene, OutputFailure
std::vector<CopiedFile> new_scene(const std::string& kind, const std::filesystem::path& folder);

/// `abbe new`.
Command new_command(CommonOptions& common);

/// `abbe check`: says how a scene was understood, and cuts nothing.
Command check_command(CommonOptions& common);

/// `abbe pose`: one of `--at`, `--at-file` and `--grid`. Warnings go to standard error, and into
/// JSON where that is what is written.
Command pose_command(CommonOptions& common);

}  // namespace abbe::sim
