#pragma once

#include <Eigen/Geometry>

namespace abbe::kinematics {

/// Rigid transform. `T_bt` is the pose of frame t in frame b: p_b = T_bt * p_t. In a product the
/// adjacent letters cancel: T_wt = T_wb * T_bt; w workpiece, b bed, s spindle nose, t tool tip.
using Pose = Eigen::Isometry3d;

/// Small rigid displacement, actual minus nominal: [EX EY EZ | EA EB EC], mm and rad. The last
/// three are a rotation vector, so no order of rotations is implied.
using Deviation = Eigen::Matrix<double, 6, 1>;

/// Force and moment [FX FY FZ | MX MY MZ], N and N mm, in the order of a Deviation.
using Wrench = Eigen::Matrix<double, 6, 1>;

/// Returns the matrix K with K u = v x u.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// Returns the exact rotation matrix of a rotation vector (rad), to 5e-16 per element up to half a
/// turn and to 2e-16 times the angle beyond.
Eigen::Matrix3d rotation(const Eigen::Vector3d& rotation_vector);

/// Returns the rotation vector of a rotation matrix, length in [0, pi], to 2e-15 rad everywhere;
/// for half a turn the sign of the axis is arbitrary.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation);

/// Returns the exact rigid motion of a deviation stated at `point`: x -> point + R (x - point) + d.
/// A first-order approximation would move a point at distance L by at most |E|^2 L / 2 (100 urad, 1
/// m: 5 nm).
Pose motion(const Deviation& deviation, const Eigen::Vector3d& point);

/// Returns the smallest rotation from the direction of one vector to that of another; for opposite
/// vectors the axis is arbitrary.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Returns the angle between two vectors, 0 .. pi; 0 if one has no length. Accurate to rounding
/// also near 0 and pi.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Returns the unit vector at a fraction of the great circle from one unit vector to another;
/// `from` if they are equal or opposite.
Eigen::Vector3d great_circle_point(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                   double fraction);

/// A motion at a constant rate about and along one line: the motion of a single joint, and that of
/// two joints together to second order. Its velocity is constant in the moving frame.
struct Screw {
  Pose start = Pose::Identity();                       ///< at u = 0
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, rotation vector of the whole motion
  Eigen::Vector3d travel = Eigen::Vector3d::Zero();    ///< mm, velocity of the origin at u = 0 per
                                                       ///< unit of u
};

/// Returns the screw from one pose at u = 0 to another at u = 1, by at most half a turn.
Screw screw_between(const Pose& from, const Pose& to);

/// Returns the pose at u, which may be outside 0 to 1. Accurate to 1e-14 of the distance between
/// the poses.
Pose pose_at(const Screw& screw, double u);

/// Returns the maximum speed, mm per unit of u, of any point within `radius` of `centre`, both in
/// the moving frame.
double max_speed(const Screw& screw, const Eigen::Vector3d& centre, double radius);

}  // namespace abbe::kinematics
