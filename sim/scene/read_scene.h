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

/// Files and programs that a scene names; they are neither run nor judged.
struct Named {
  std::vector<std::filesystem::path> files;  ///< the scene itself, section files, data, programs
                                             ///< and the scenes of training parts; absolute,
                                             ///< without repetition
  std::vector<NamedProgram> programs;        ///< compensators in the order of appearance, each
                                             ///< position once
};

/// Returns the files that a scene names.
/// @param tree  of a scene with its section files read in and all changes applied; the changes of
///              its variants are applied here
/// @param file  of the scene
Named collect_named_files(const Node& tree, const std::filesystem::path& file);

/// Returns the program that the text of a case names; none if it is not the file of a plug-in.
std::optional<NamedProgram> named_program(const Node& text);

/// Reads a scene strictly. Unknown keys are rejected with the nearest known one, types and units
/// are checked, and all errors are collected before any is reported.
/// @param overrides  applied to the text before it is checked; a path without a known target is
///                   rejected
/// @throws BadScene with every error
Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// Returns the scene of a tree with changed values, as `read_scene` does for a file; only the files
/// named by overrides are read from disk.
/// @param input_errors  errors found before
/// @throws BadScene
Scene scene_from_tree(const Node& as_written, const std::filesystem::path& file,
                      const std::vector<Override>& overrides, InputErrors input_errors = {});

}  // namespace abbe::sim
