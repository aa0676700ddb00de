#pragma once

#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

/// Text of an identified belief in the form that a scene reads.
namespace abbe::sim {

/// Returns the text of an errors file, to which `errors = "..."` of a scene can refer: every
/// element with its curves in um and urad, and the covariance if there is one (scenes/README.md).
/// Numbers read back within one ulp.
/// @param joints    joints of the machine, for the units of positions
/// @param comments  lines at the top of the file, each after "# "
/// @throws std::invalid_argument for a random curve, which a belief cannot hold
std::string errors_file_text(const errors::GeometricErrors& belief,
                             const std::vector<kinematics::Joint>& joints,
                             const std::vector<std::string>& comments = {});

}  // namespace abbe::sim
