#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// What a scene names beside itself: nothing of it is run, and nothing is judged.
struct Named {
  std::vector<std::filesystem::path> files;  ///< itself, sub-files, data, programs, the scenes of
                                             ///< training parts; absolute, each once
  std::vector<NamedProgram> programs;        ///< compensators, in the order found, each place once
};

/// @param tree  of a scene with its sub-files read in and every change made; the changes of its
///              variants are made here
/// @param file  of the scene
Named named_by(const Node& tree, const std::filesystem::path& file);

/// The program that a text in the place of a case names; none if it is no plug-in's file.
std::optional<NamedProgram> program_named(const Node& text);

}  // namespace abbe::sim
