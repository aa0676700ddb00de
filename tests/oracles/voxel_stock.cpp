#include "tests/oracles/voxel_stock.h"

#include <algorithm>
#include <cmath>

namespace abbe::oracles {

using Eigen::Vector3d;

namespace {

VoxelPose between(const VoxelPose& from, const VoxelPose& to, double t) {
  const double angle = 2.0 * std::asin(0.5 * (to.axis - from.axis).norm());
  VoxelPose pose{from.tip + t * (to.tip - from.tip), from.axis};
  if (angle > 1e-14)
    pose.axis =
        (std::sin((1 - t) * angle) * from.axis + std::sin(t * angle) * to.axis) / std::sin(angle);
  return pose;
}

}  // namespace

double distance(const VoxelCutter& cutter, const VoxelPose& pose, const Vector3d& point) {
  const Vector3d p = point - pose.tip;
  const double height = p.dot(pose.axis);
  const double rho = (p - height * pose.axis).norm();
  const double out = rho - (cutter.radius - cutter.corner_radius);
  const double below = cutter.corner_radius - height;
  if (out > 0.0 && below > 0.0) return std::hypot(out, below) - cutter.corner_radius;
  return std::max(out, below) - cutter.corner_radius;
}

double sweep_distance(const VoxelCutter& cutter, const VoxelPose& from, const VoxelPose& to,
                      const Vector3d& point, int instants) {
  double least = 1e300, at = 0.0, width = 1.0;
  for (double low = 0.0, high = 1.0; width > 1e-9;
       low = std::max(0.0, at - width), high = std::min(1.0, at + width)) {
    for (int i = 0; i <= instants; ++i) {
      const double t = low + (high - low) * i / instants;
      const double d = distance(cutter, between(from, to, t), point);
      if (d < least) {
        least = d;
        at = t;
      }
    }
    width = (high - low) / instants;
  }
  return least;
}

VoxelStock::VoxelStock(const Vector3d& lower, const Vector3d& upper, double spacing)
    : lower_(lower), spacing_(spacing) {
  std::size_t count = 1;
  for (int k = 0; k < 3; ++k) {
    nodes_[k] = int(std::lround((upper[k] - lower[k]) / spacing));
    count *= std::size_t(nodes_[k]);
  }
  material_.assign(count, 1);
}

double VoxelStock::remove(const VoxelCutter& cutter, const VoxelPose& from, const VoxelPose& to,
                          int instants) {
  std::vector<VoxelPose> poses;
  for (int i = 0; i <= instants; ++i) poses.push_back(between(from, to, double(i) / instants));
  std::size_t taken = 0, index = 0;
  for (int k = 0; k < nodes_[2]; ++k)
    for (int j = 0; j < nodes_[1]; ++j)
      for (int i = 0; i < nodes_[0]; ++i, ++index) {
        if (material_[index] == 0) continue;
        const Vector3d point = lower_ + spacing_ * Vector3d(i + 0.5, j + 0.5, k + 0.5);
        const bool cut = std::any_of(poses.begin(), poses.end(), [&](const VoxelPose& pose) {
          return distance(cutter, pose, point) <= 0.0;
        });
        if (!cut) continue;
        material_[index] = 0;
        ++taken;
      }
  return double(taken) * spacing_ * spacing_ * spacing_;
}

double VoxelStock::volume() const {
  return double(std::count(material_.begin(), material_.end(), 1)) * spacing_ * spacing_ * spacing_;
}

}  // namespace abbe::oracles
