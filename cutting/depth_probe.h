#pragma once

#include <Eigen/Geometry>

#include "cutting/stock.h"

namespace abbe::cutting {

/// `depth` of many points given in a frame of their own.
class DepthProbe {
 public:
  /// @param stock  outlives the probe
  /// @param T_wa   the frame in which points are given
  DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa);

  double depth(const Eigen::Vector3d& point_a) const;

 private:
  double along_one(const Eigen::Vector3d& place, const int* cell) const;
  double along_three(const Eigen::Vector3d& place, const int* cell) const;

  const Stock& stock_;
  Eigen::Isometry3d T_ga_;  // to the grid, in spacings from its first node
};

}  // namespace abbe::cutting
