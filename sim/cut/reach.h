#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"

namespace abbe::sim {

/// Below this share of the judged area within reach of the program it is warned of.
inline constexpr double least_within_reach = 0.99;

/// Where a program cuts on the error-free machine, held against where the part is.
struct Placement {
  std::optional<BadInput> fault;  ///< nothing of the part can be cut: the line that comes nearest,
                                  ///< how far away it runs, and with which offset it would touch
  std::vector<std::string> warnings;  ///< less than `least_within_reach` can, or most of what it
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
