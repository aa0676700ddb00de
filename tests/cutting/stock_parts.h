#pragma once

#include "cutting/stock/stock.h"
#include "kinematics/pose.h"

/// Poses and blocks for the tests of a stock.
namespace abbe::cutting {

inline Eigen::Isometry3d pose(const Eigen::Vector3d& tip,
                              const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ()) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = tip;
  T.linear() = kinematics::rotation_between(Eigen::Vector3d::UnitZ(), axis).toRotationMatrix();
  return T;
}

inline Stock box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper, double spacing,
                 bool three = true) {
  return make_stock(BoxBlank{lower, upper}, Eigen::Isometry3d::Identity(), {spacing, three});
}

}  // namespace abbe::cutting
