#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/cases.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// The files and programs that a scene names.
struct NamedFiles {
  std::vector<std::filesystem::path> files;  ///< the scene itself, section files, data, programs
                                             ///< and the scenes of training parts; absolute,
                                             ///< without duplicates
  std::vector<ProgramReference> programs;    ///< compensators in the order of their positions,
                                             ///< without duplicates
};

/// Returns the files and programs that a scene names. Programs are neither run nor checked.
/// @param tree  the scene with its section files and all changes, except those of its variants
/// @param file  the scene file
NamedFiles collect_named_files(const Node& tree, const std::filesystem::path& file);

/// Returns the program that the name of a case denotes; none if the name is not a plug-in file.
std::optional<ProgramReference> named_program(const Node& text);

/// Reads a scene. Unknown keys are input errors, and types, units and ranges are checked.
/// @param overrides  changes of values, applied before the scene is checked
/// @throws BadScene with all input errors
Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// Returns the scene of a tree as `read_scene` does for a file. Only files that the overrides name
/// are read from disk.
/// @param input_errors  errors found while the tree was read
/// @throws BadScene with all input errors
Scene scene_from_tree(const Node& as_written, const std::filesystem::path& file,
                      const std::vector<Override>& overrides, InputErrors input_errors = {});

}  // namespace abbe::sim
