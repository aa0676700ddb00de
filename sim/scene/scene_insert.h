#pragma once

#include <string>

#include "sim/scene/fields.h"
#include "sim/scene/tool_description.h"

/// Turning tools whose edge has a profile, by kind: "insert", a nose with two straight edges, and
/// "edge", free lines and arcs.
namespace abbe::sim {

/// Sets `edge` and the nominal tool. What cannot be is refused where the table stands.
Fields<ToolDescription> nominal_edge_fields(const std::string& kind);

/// Sets `actual_edge` and the actual tool, from what they are.
Fields<ToolDescription> actual_edge_fields(const std::string& kind);

}  // namespace abbe::sim
