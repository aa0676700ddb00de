#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// Most that the direction of a touch may lean from the surface's normal, rad: 40 degrees. A ball
/// that slides along a steeper face reads another component than the one that it is moved in.
inline constexpr double max_touch_lean = 0.6981317007977318;

/// Returns the input error of the first touch of a datum that meets nothing, with its place in the
/// scene: none of the design, the blank, a fixture or what the carriage under the part carries is
/// within the search band of its point, with an outward normal against which the probe moves.
std::optional<BadInput> touch_error(const Job& job);

/// Below this share of the judged area within reach of the program it is warned of.
inline constexpr double min_within_reach = 0.99;

/// Where a program cuts on the error-free machine, held against where the part is.
struct Placement {
  std::optional<BadInput> fault;  ///< nothing of the part can be cut: the line that comes nearest,
                                  ///< how far away it runs, and with which offset it would touch
  std::vector<std::string> warnings;  ///< less than `min_within_reach` can, or most of what it
                                      ///< reaches is gouged; of some 2000 vertices
};
Placement placement(const Job& job);

/// The job with the warnings of `placement` among its own, before anything is searched.
/// @throws BadInput, its fault, or that of a datum that touches nothing
Job placed(Job job);

/// Refuses a map on which nothing is cut or gouged, saying where the program cuts instead.
/// @throws BadInput
void check_cuts_part(const Job& job, const Cut& cut);

}  // namespace abbe::sim
