#include "kinematics/pose.h"

#include <cmath>

namespace abbe::kinematics {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d K;
  K << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return K;
}

Eigen::Matrix3d rotation(const Eigen::Vector3d& v) {
  const double angle2 = v.squaredNorm();
  if (angle2 == 0.0) return Eigen::Matrix3d::Identity();
  const double angle = std::sqrt(angle2);
  // sin(a)/a and (1 - cos a)/a^2 in forms that lose nothing at small angles
  const double half = std::sin(0.5 * angle) / (0.5 * angle);
  const double s = std::sin(angle) / angle;
  const double c = 0.5 * half * half;
  const Eigen::Matrix3d K = cross_matrix(v);
  return Eigen::Matrix3d::Identity() + s * K + c * (K * K);
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  // The quaternion is taken from the largest of its components, so nothing is lost near a half
  // turn, where the antisymmetric part of R vanishes.
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

}  // namespace abbe::kinematics
