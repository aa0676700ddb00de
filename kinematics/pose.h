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

/// The least turn that takes the direction of one vector to that of the other; between opposite
/// ones the axis is arbitrary.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Angle between the directions of two vectors, 0 .. pi; 0 where one has no length. To rounding
/// also near 0 and pi.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Part of the way from one unit vector to another along their great circle; `from` where they
/// agree or are opposite.
Eigen::Vector3d great_circle_point(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                   double part);

/// A motion at a constant rate about and along one line: what a joint alone does, and what two
/// joints do together to second order. Its velocity is constant in the frame that moves.
struct Screw {
  Pose start = Pose::Identity();                     ///< at u = 0
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();    ///< rad, rotation vector of the whole motion
  Eigen::Vector3d travel = Eigen::Vector3d::Zero();  ///< mm, of the origin, at its rate at u = 0
};

/// The screw from one pose at u = 0 to another at u = 1, by at most half a turn.
Screw screw_between(const Pose& from, const Pose& to);

/// Where the frame is; u need not be within 0 to 1. To 1e-14 of
/// the distances that the poses have.
Pose pose_at(const Screw& screw, double u);

/// mm per unit of u: as fast as a point can be that lies within `radius` of `centre`, both in the
/// frame that moves.
double fastest(const Screw& screw, const Eigen::Vector3d& centre, double radius);

}  // namespace abbe::kinematics
