#pragma once

#include <vector>

#include "sim/scene/scene.h"

namespace abbe::sim {

/// Every tool of a scene, in the order in which it describes them.
std::vector<ToolDescription> tools_of(const Scene& scene);

/// The scene with the tool of that number as its only one.
/// @throws std::out_of_range if it describes none
Scene with_tool(Scene scene, int number);

}  // namespace abbe::sim
