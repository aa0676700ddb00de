#include "kinematics/turn_between.h"

#include <cmath>

namespace abbe::kinematics {

// Opposite vectors take a decomposition, so this is costly to compile.
Eigen::Quaterniond turn_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

Eigen::Vector3d on_great_circle(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                double part) {
  const Eigen::Vector3d across = to - from.dot(to) * from;
  const double sine = across.norm();
  if (sine < 1e-14) return from;
  const double angle = part * std::atan2(sine, from.dot(to));
  return std::cos(angle) * from + std::sin(angle) * (across / sine);
}

}  // namespace abbe::kinematics
