#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/scene/scene_copy.h"

namespace abbe::sim {

/// Kinds of machine for which the library has a scene to begin with, `new/KIND.toml`.
const std::vector<std::string>& new_kinds();

/// Writes such a scene with files of its own into a new or empty folder.
/// @throws BadInput without a library, BadScene, OutputFailure
std::vector<CopiedFile> new_scene(const std::string& kind, const std::filesystem::path& folder);

/// `abbe new`.
Command new_command(Common& common);

}  // namespace abbe::sim
