#pragma once

#include <filesystem>
#include <vector>

#include "sim/scene/part_description.h"

namespace abbe::sim {

/// The libraries of materials that say which colours the faces of a part have: those that its OBJ
/// names, if a region asks for a colour. No key of a scene names them.
/// @throws BadInput if the OBJ cannot be read
std::vector<std::filesystem::path> material_files(const PartDescription& part);

}  // namespace abbe::sim
