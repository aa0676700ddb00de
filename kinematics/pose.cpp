#include "kinematics/pose.h"

#include <cmath>

namespace abbe::kinematics {

Eigen::Matrix3d rotation(const Eigen::Vector3d& v) {
  const double angle2 = v.squaredNorm();
  if (angle2 == 0.0) return Eigen::Matrix3d::Identity();
  const double angle = std::sqrt(angle2);
  // sin(a)/a and (1 - cos a)/a^2 in forms that lose nothing at small angles
  const double half = std::sin(0.5 * angle) / (0.5 * angle);
  const double s = std::sin(angle) / angle;
  const double c = 0.5 * half * half;
  Eigen::Matrix3d K;
  K << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return Eigen::Matrix3d::Identity() + s * K + c * (K * K);
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  const Eigen::Vector3d w(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  const double sine = 0.5 * w.norm();
  const double cosine = 0.5 * (R.trace() - 1.0);
  const double angle = std::atan2(sine, cosine);
  if (sine > 1e-6 || cosine > 0.0)
    return sine == 0.0 ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(w * (angle / (2.0 * sine)));
  // near a half turn the antisymmetric part vanishes: the axis is the column of R + 1
  const Eigen::Matrix3d S = 0.5 * (R + R.transpose()) + Eigen::Matrix3d::Identity();
  int column = 0;
  S.colwise().norm().maxCoeff(&column);
  Eigen::Vector3d axis = S.col(column).normalized();
  if (axis.dot(w) < 0.0) axis = -axis;
  return axis * angle;
}

Pose motion(const Deviation& deviation, const Eigen::Vector3d& point) {
  Pose T = Pose::Identity();
  const Eigen::Vector3d angles = deviation.tail<3>();
  T.linear() = rotation(angles);
  T.translation() = deviation.head<3>() + (point - T.linear() * point);
  return T;
}

}  // namespace abbe::kinematics
