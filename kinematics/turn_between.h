#pragma once

#include <Eigen/Geometry>

namespace abbe::kinematics {

/// The least turn that takes the direction of one vector to that of the other; between opposite
/// ones the axis is arbitrary.
Eigen::Quaterniond turn_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace abbe::kinematics
