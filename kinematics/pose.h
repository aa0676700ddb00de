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

/// Matrix K of a vector with K u = v x u.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// Exact rotation matrix of a rotation vector (rad), to 5e-16 per element up to half a turn and to
/// 2e-16 times the angle beyond.
Eigen::Matrix3d rotation(const Eigen::Vector3d& rotation_vector);

/// Rotation vector of a rotation matrix, length in [0, pi], to 2e-15 rad everywhere; of a half turn
/// the sign of the axis is arbitrary.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation);

/// Exact rigid motion of a deviation stated at `point`: x -> point + R (x - point) + d.
/// Dropping all but first order moves a point at distance L by at most |E|^2 L / 2
/// (100 urad, 1 m: 5 nm).
Pose motion(const Deviation& deviation, const Eigen::Vector3d& point);

}  // namespace abbe::kinematics
