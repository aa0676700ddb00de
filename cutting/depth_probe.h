#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Geometry>

#include "cutting/stock.h"

namespace abbe::cutting {

/// `depth` of many points given in a frame of their own, while the stock stays as it is; those
/// beside each other share the nodes of a cell. For one thread.
class DepthProbe {
 public:
  /// @param stock  outlives the probe
  /// @param T_wa   the frame in which points are given
  DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa);

  double depth(const Eigen::Vector3d& point_a);

 private:
  /// The eight nodes of a cell, by the bits of their x, y, z.
  using Nodes = std::array<float, 8>;
  struct Known {
    std::int64_t cell = -1;
    Nodes depths;
  };
  double along_one(const Eigen::Vector3d& place, const int* cell) const;
  double along_three(const Eigen::Vector3d& place, const int* cell);
  const Nodes& depths_of(const int* cell);
  Nodes looked_up(const int* cell) const;

  const Stock& stock_;
  std::array<Known, 512> known_;
  Eigen::Isometry3d T_ga_;  // to the grid, in spacings from its first node
};

}  // namespace abbe::cutting
