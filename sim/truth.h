#pragma once

#include "errors/geometric.h"
#include "sim/machine.h"

namespace abbe::sim {

/// What the machine really does: the one place where the injected errors act. Read by the loop and
/// by the virtual instruments, never by a compensator.
struct Truth {
  kinematics::Chain actual;
  errors::GeometricModel geometric;
};

/// @throws BadInput naming the scene if an element does not fit the machine
Truth truth_of(const Scene& scene, const Machine& machine);

/// The truth without its random parts: what a `perfect` belief may know.
Truth without_random(const Truth& truth);

/// Where the tool really is in the part, T_wt.
/// @throws std::out_of_range where a table that refuses is left
kinematics::Pose tool_in_workpiece(const Truth& truth, const kinematics::AxisState& state);

}  // namespace abbe::sim
