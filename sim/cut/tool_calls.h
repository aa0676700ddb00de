#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene.h"

namespace abbe::sim {

/// What is to be said of the tools that a program calls: a scene has one, and cuts with it whatever
/// T and M6 say. A call counts if a block of feed follows it before the next; T alone is a call
/// where no M6 is in the program. @return warnings, of the tool and of feed before its first call
/// @throws BadInput on the line of a call of a second tool, or of another than `tool.number`
std::vector<std::string> tool_call_warnings(const program::Path& path, const ToolDescription& tool);

}  // namespace abbe::sim
