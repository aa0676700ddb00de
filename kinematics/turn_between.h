#pragma once

#include <Eigen/Geometry>

namespace abbe::kinematics {

/// The least turn that takes the direction of one vector to that of the other; between opposite
/// ones the axis is arbitrary.
Eigen::Quaterniond turn_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Angle between the directions of two vectors, 0 .. pi; 0 where one has no length. To rounding
/// also near 0 and pi.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Part of the way from one unit vector to another along their great circle; `from` where they
/// agree or are opposite.
Eigen::Vector3d on_great_circle(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                double part);

}  // namespace abbe::kinematics
