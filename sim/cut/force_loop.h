#pragma once

#include <functional>

#include "cutting/force.h"
#include "sim/cut/process.h"
#include "sim/scene/cutting_description.h"

namespace abbe::sim {

/// Where the tool is at a sample when the cut loads it so.
using PoseUnderLoad = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

/// What one look at the cut gives.
struct Look {
  cutting::CuttingLoad cut;
  errors::Load load;
  double engaged = 0.0;      ///< mm of edge
  double chip = 0.0;         ///< mm
  double beyond_edge = 0.0;  ///< mm, by which it goes beyond the edges of an insert
};

/// The load of one step, brought to agree with the deflection that it makes to the tolerance of the
/// description (with a contraction c of repetition the rest is c / (1 - c) of the last change).
/// Plain repetition first, the secant of the last two where that is slow; where both fail, the load
/// between none and that of the rigid tool is bracketed, so a soft machine closes too.
/// @param force  what the cut does to a tool that stands at a pose
/// @return without time, line, power and removed volume
ProcessStep closed_step(const CuttingDescription& description, const PoseUnderLoad& pose,
                        std::size_t sample,
                        const std::function<Look(const kinematics::Pose&)>& force,
                        const errors::Load& guess);

}  // namespace abbe::sim
