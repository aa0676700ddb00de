#pragma once

#include <Eigen/Geometry>

namespace abbe::kinematics {

/// Rigid transform. `T_bt` is the pose of frame t in frame b: p_b = T_bt * p_t. Names chain by
/// matching letters, T_wt = T_wb * T_bt; w workpiece, b bed, s spindle nose, t tool tip.
using Pose = Eigen::Isometry3d;

/// Small rigid displacement, actual minus nominal: [EX EY EZ | EA EB EC], mm and rad. The last
/// three are a rotation vector, so no order of rotations is implied.
using Deviation = Eigen::Matrix<double, 6, 1>;

/// Force and moment [FX FY FZ | MX MY MZ], N and N mm, in the order of a Deviation.
using Wrench = Eigen::Matrix<double, 6, 1>;

/// Exact rotation matrix of a rotation vector (rad), to 4e-16 per element at any size.
Eigen::Matrix3d rotation(const Eigen::Vector3d& rotation_vector);

/// Rotation vector of a rotation matrix, length in [0, pi]. Error below 1e-15 rad up to 1 rad,
/// 1e-8 rad at pi, where the axis itself is ambiguous.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation);

/// Exact rigid motion of a deviation stated at `point`: x -> point + R (x - point) + d.
/// Dropping all but first order moves a point at distance L by at most |E|^2 L / 2
/// (100 urad, 1 m: 5 nm).
Pose motion(const Deviation& deviation, const Eigen::Vector3d& point);

}  // namespace abbe::kinematics
