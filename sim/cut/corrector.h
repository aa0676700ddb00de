#pragma once

#include <functional>
#include <vector>

#include "kinematics/axis.h"
#include "kinematics/chain.h"

namespace abbe::sim {

/// Commands with a correction in them, and what its maker knew that it could not reach.
struct Corrected {
  std::vector<kinematics::AxisState> states;
  double point_left = 0.0;      ///< mm
  double direction_left = 0.0;  ///< rad
  std::size_t not_converged = 0;
};

/// Corrects commands that should bring the tool to T_wt_nominal, both (samples) in the order of
/// time.
using Corrector = std::function<Corrected(const std::vector<kinematics::AxisState>& commanded,
                                          const std::vector<kinematics::Pose>& T_wt_nominal)>;

}  // namespace abbe::sim
