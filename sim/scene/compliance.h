#pragma once

#include <vector>

#include "errors/compliance.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

struct Key;
template <typename T>
class Fields;

/// Returns the fields of the compliance from the spindle nose to the tip.
const Fields<errors::Compliance>& tool_compliance_fields();

/// Reads and writes `[compliance]`: joints, tool, fixture, workpiece and masses.
errors::ComplianceErrors read_compliance(const Node& table, const MachineDescription& machine,
                                         InputErrors& input_errors);
Node::Table compliance_to_table(const errors::ComplianceErrors& errors,
                                const MachineDescription& machine);
std::vector<Key> compliance_keys();

}  // namespace abbe::sim
