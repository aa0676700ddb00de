#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"
#include "sim/cut/job.h"

/// Check of the position of the program relative to the part, before anything is cut.
namespace abbe::sim {

/// Returns the input error, with its location in the scene, for the first touch of a datum that
/// meets no surface; none if every touch does. A touch needs, within the search band of its point,
/// a surface of the design, the blank, a fixture, or a body on the carriage under the part, and
/// must move against the outward normal of it.
std::optional<BadInput> touch_error(const Job& job);

/// The fit of the cut of a program on the error-free machine to the position of the part.
struct Placement {
  std::optional<BadInput> fault;      ///< if nothing of the part can be cut: the line that comes
                                      ///< nearest, its distance, and the offset for contact
  std::vector<std::string> warnings;  ///< if less than `min_reachable_fraction` can be cut, or most
                                      ///< of the reached area is gouged, at some 2000 vertices
};
/// Compares the position of the cut with that of the part.
Placement placement(const Job& job);

/// Checks the placement of a job and returns the job with the warnings.
/// @throws BadInput if nothing can be cut, or a datum touches nothing
Job check_placement(Job job);

/// Throws BadInput if nothing of a map is cut or gouged; the message states where the program cuts.
void check_cuts_part(const Job& job, const Cut& cut);

}  // namespace abbe::sim
