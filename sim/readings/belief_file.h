#pragma once

#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

/// Text of an identified belief, as a scene reads it.
namespace abbe::sim {

/// Returns the text of an errors file, as `errors = "..."` of a scene reads it: every element with
/// its curves in um and urad, and the covariance if there is one (scenes/README.md). Numbers read
/// back within one ulp.
/// @param comments  lines written above, each after "# "
/// @throws std::invalid_argument for a random curve, which a belief cannot hold
std::string to_errors_file(const errors::GeometricErrors& belief,
                           const std::vector<kinematics::Joint>& joints,
                           const std::vector<std::string>& comments = {});

}  // namespace abbe::sim
