#pragma once

#include <optional>

#include "kinematics/bad_input.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// Most that the direction of a touch may lean from the surface's normal, rad: 40 degrees. A ball
/// that slides along a steeper face reads another component than the one that it is moved in.
inline constexpr double most_touch_lean = 0.6981317007977318;

/// Returns the input error of the first touch of a datum that meets nothing, with its place in the
/// scene: none of the design, the blank, a fixture or what the carriage under the part carries is
/// within the search band of its point, with an outward normal against which the probe moves.
std::optional<BadInput> touch_error(const Job& job);

}  // namespace abbe::sim
