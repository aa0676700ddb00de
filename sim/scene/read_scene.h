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

/// What a scene names beside itself: nothing of it is run, and nothing is judged.
struct NamedFiles {
  std::vector<std::filesystem::path> files;  ///< itself, sub-files, data, programs, the scenes of
                                             ///< training parts; absolute, each once
  std::vector<NamedProgram> programs;        ///< compensators, in the order found, each place once
};

/// @param tree  of a scene with its sub-files read in and every change made; the changes of its
///              variants are made here
/// @param file  of the scene
NamedFiles collect_named_files(const Node& tree, const std::filesystem::path& file);

/// The program that a text in the place of a case names; none if it is no plug-in's file.
std::optional<NamedProgram> named_program(const Node& text);

/// Reads a scene strictly: unknown keys are refused with the nearest known one, types and units are
/// checked, and all faults are found before any is reported.
/// @param overrides  applied to the text before it is checked; a path that names nothing known is
/// refused
/// @throws BadScene with every fault
Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// The scene of a tree with values changed, as `read_scene` makes it of a file; only what overrides
/// name is read from disk.
/// @param faults  found before
/// @throws BadScene
Scene build_scene(const Node& as_written, const std::filesystem::path& file,
                  const std::vector<Override>& overrides, InputErrors input_errors = {});

}  // namespace abbe::sim
