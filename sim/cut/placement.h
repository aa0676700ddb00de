#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"
#include "sim/cut/job.h"

/// Check of the position of the program relative to the part, before anything is cut.
namespace abbe::sim {

/// Largest angle between the direction of a touch and the surface normal, rad: 40 degrees. A ball
/// that slides along a steeper face reads another component than the one it is moved in.
inline constexpr double max_touch_angle = 0.6981317007977318;

/// Returns the input error of the first touch of a datum that meets nothing, with its location in
/// the scene. A touch must have, within the search band of its point, a surface of the design, the
/// blank, a fixture, or a body on the carriage under the part, against whose outward normal the
/// probe moves.
std::optional<BadInput> touch_error(const Job& job);

/// Fraction of the judged area within reach of the program below which a warning is given.
inline constexpr double min_reachable_fraction = 0.99;

/// Result of comparing where a program cuts on the error-free machine with the position of the
/// part.
struct Placement {
  std::optional<BadInput> fault;  ///< set if nothing of the part can be cut: the line that comes
                                  ///< nearest, its distance, and the offset with which it would
                                  ///< touch
  std::vector<std::string>
      warnings;  ///< if less than `min_reachable_fraction` can be cut, or most of
                 ///< what is reached is gouged; judged at some 2000 vertices
};
/// Compares where the program cuts with where the part is.
Placement placement(const Job& job);

/// Returns the job with the warnings of `placement`, before anything is searched.
/// @throws BadInput if nothing can be cut, or a datum touches nothing
Job placed(Job job);

/// Throws BadInput if nothing of a map is cut or gouged; the message says where the program cuts
/// instead.
void check_cuts_part(const Job& job, const Cut& cut);

}  // namespace abbe::sim
