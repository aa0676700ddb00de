#include "kinematics/turn_between.h"

namespace abbe::kinematics {

// Opposite vectors take a decomposition, so this is costly to compile.
Eigen::Quaterniond turn_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace abbe::kinematics
