#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

/// Stock and swept cutters by brute force, from the definition alone: a point is cut away if it is
/// inside the cutter at some instant. Nothing is shared with the module, no line is intersected, no
/// move is treated as anything but many standing tools.
namespace abbe::oracles {

/// A milling cutter: flat bottom, torus corner, cylinder without an upper end; mm.
struct VoxelCutter {
  double radius, corner_radius;
};
struct VoxelPose {
  Eigen::Vector3d tip;   ///< mm
  Eigen::Vector3d axis;  ///< unit, to the spindle
};

/// Signed distance from a point to the standing cutter, mm; exact outside, negative inside.
double distance(const VoxelCutter& cutter, const VoxelPose& pose, const Eigen::Vector3d& point);

/// The least of those distances over a move, its tip on a line, its axis on a great circle: looked
/// at at so many instants, then closer and closer around the least.
double sweep_distance(const VoxelCutter& cutter, const VoxelPose& from, const VoxelPose& to,
                      const Eigen::Vector3d& point, int instants = 400);

/// A box of points.
class VoxelStock {
 public:
  VoxelStock(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper, double spacing);

  /// Takes away all points within the move. @return mm^3
  double remove(const VoxelCutter& cutter, const VoxelPose& from, const VoxelPose& to,
                int instants = 400);
  double volume() const;

 private:
  Eigen::Vector3d lower_;
  double spacing_;
  int nodes_[3];
  std::vector<char> material_;
};

}  // namespace abbe::oracles
