#pragma once

#include <span>
#include <string>
#include <vector>

#include "sim/program/path.h"
#include "sim/scene/tool_description.h"

namespace abbe::sim {

/// Comments of a CAM system whose cutter is not the scene's: "line 3 says "T1 D=12. CR=0. - FLAT
/// END MILL": 12 mm in diameter, the scene's T1 has 10 mm". A comment is of the tool whose number
/// it gives, else of the one that is called next. Tools that do not cut, and turning tools, are not
/// compared. @param tools  of the scene; one without a number is every tool
std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools);

}  // namespace abbe::sim
