#pragma once

#include "kinematics/chain.h"

namespace abbe::sim {

/// Line about which the workpiece turns, seen from the workpiece of a chain.
struct SpindleLine {
  Eigen::Vector3d point_w;
  Eigen::Vector3d direction_w;
};
SpindleLine spindle_line(const kinematics::Chain& chain, int joint);

/// The tool turned back by the spindle, so that only slow motion is left to interpolate.
kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt);

}  // namespace abbe::sim
