#pragma once

#include <vector>

#include "sim/scene/scene.h"

namespace abbe::sim {

/// Every tool of a scene, in the order in which it describes them.
std::vector<ToolDescription> tools_of(const Scene& scene);

/// Length from the nose to the tip as the control has it, mm: of its tool table, else of its own
/// section, else that of the scene.
double believed_length(const Scene& scene, const ToolDescription& tool);

/// Where the control's tool table and the true tools of the scene part by more than 1 nm, with
/// figures, and tools that it has not.
std::vector<std::string> tool_table_warnings(const Scene& scene);

/// The scene with the tool of that number as its only one.
/// @throws std::out_of_range if it describes none
Scene with_tool(Scene scene, int number);

}  // namespace abbe::sim
