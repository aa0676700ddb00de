#include "kinematics/pose.h"

#include <cmath>

namespace abbe::kinematics {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d K;
  K << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return K;
}

Eigen::Matrix3d rotation(const Eigen::Vector3d& v) {
  const double squared_angle = v.squaredNorm();
  if (squared_angle == 0.0) return Eigen::Matrix3d::Identity();
  const double angle = std::sqrt(squared_angle);
  // Forms of sin(a)/a and (1 - cos a)/a^2 that lose no digits at small angles.
  const double half = std::sin(0.5 * angle) / (0.5 * angle);
  const double s = std::sin(angle) / angle;
  const double c = 0.5 * half * half;
  const Eigen::Matrix3d K = cross_matrix(v);
  return Eigen::Matrix3d::Identity() + s * K + c * (K * K);
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  // Via the quaternion, which Eigen computes from its largest component: no digits are lost near
  // half a turn, where the antisymmetric part of R vanishes.
  const Eigen::Quaterniond quaternion(R);
  const Eigen::Vector3d axis = quaternion.vec();
  const double sine = axis.norm();
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  const double sign = quaternion.w() < 0.0 ? -1.0 : 1.0;
  return axis * (sign * 2.0 * std::atan2(sine, std::abs(quaternion.w())) / sine);
}

Pose motion(const Deviation& deviation, const Eigen::Vector3d& point) {
  Pose T = Pose::Identity();
  const Eigen::Vector3d angles = deviation.tail<3>();
  T.linear() = rotation(angles);
  T.translation() = deviation.head<3>() + (point - T.linear() * point);
  return T;
}

// The case of opposite vectors uses a decomposition, which is costly to compile; hence this
// wrapper.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

Eigen::Vector3d great_circle_point(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                   double fraction) {
  const Eigen::Vector3d across = to - from.dot(to) * from;
  const double sine = across.norm();
  // 1e-14: sine of nearly equal or opposite vectors, whose plane is only rounding.
  if (sine < 1e-14) return from;
  const double angle = fraction * std::atan2(sine, from.dot(to));
  return std::cos(angle) * from + std::sin(angle) * (across / sine);
}

namespace {

using Eigen::Vector3d;

constexpr double min_direct_angle = 1e-2;  // rad; for smaller angles the quotients lose digits, and
                                           // three terms of the series are exact to 1e-15

/// Returns (angle - sin angle) / angle^3.
double third_order_coefficient(double angle) {
  const double squared_angle = angle * angle;
  if (angle < min_direct_angle)
    return 1.0 / 6 - squared_angle / 120 + squared_angle * squared_angle / 5040;
  return (angle - std::sin(angle)) / (squared_angle * angle);
}

/// Returns (1 - angle/2 cot(angle/2)) / angle^2.
double inverse_coefficient(double angle) {
  const double squared_angle = angle * angle;
  if (angle < min_direct_angle)
    return 1.0 / 12 + squared_angle / 720 + squared_angle * squared_angle / 30240;
  return (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / squared_angle;
}

}  // namespace

Screw screw_between(const Pose& from, const Pose& to) {
  const Pose step = from.inverse() * to;
  const Vector3d turn = rotation_vector(step.linear()), p = step.translation();
  const Vector3d across = turn.cross(p);
  return {from, turn, p - 0.5 * across + inverse_coefficient(turn.norm()) * turn.cross(across)};
}

Pose pose_at(const Screw& screw, double u) {
  const Vector3d turn = u * screw.rotation, travel = u * screw.travel;
  const double angle = turn.norm();
  if (angle == 0.0) return screw.start * Eigen::Translation3d(travel);
  const double half = std::sin(0.5 * angle) / angle;
  const Vector3d across = turn.cross(travel);
  const Vector3d p =
      travel + 2.0 * half * half * across + third_order_coefficient(angle) * turn.cross(across);
  return screw.start * Eigen::Translation3d(p) * Pose(rotation(turn));
}

double max_speed(const Screw& screw, const Vector3d& centre, double radius) {
  return (screw.travel + screw.rotation.cross(centre)).norm() + screw.rotation.norm() * radius;
}

}  // namespace abbe::kinematics
