#pragma once

#include <vector>

#include "sim/scene/scene_sections.h"

namespace abbe::sim {

/// Tables of errors as one, each times its scale. Elements of one name become one; they stand in
/// the order of the machine, whatever that of the tables is. What one table knows is not correlated
/// with what another knows.
errors::GeometricErrors joined(std::vector<ErrorsSection> tables,
                               const MachineDescription& machine);

}  // namespace abbe::sim
