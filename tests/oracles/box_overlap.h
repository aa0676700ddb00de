#pragma once

#include <cmath>

#include <Eigen/Geometry>

namespace abbe::oracles {

/// A box about the origin of its pose.
struct PlacedBox {
  Eigen::Vector3d size;
  Eigen::Isometry3d T;
};

/// Whether two boxes overlap when each is `more` thicker on every side: no axis parts them
/// (separating axes of two boxes: the faces of each and the products of their edges).
inline bool boxes_overlap(const PlacedBox& a, const PlacedBox& b, double more = 0.0) {
  const Eigen::Vector3d from_a_to_b = b.T.translation() - a.T.translation();
  const auto parts = [&](const Eigen::Vector3d& axis) {
    const double length = axis.norm();
    if (length < 1e-9) return false;
    const auto half = [&](const PlacedBox& box) {
      return (box.T.linear().transpose() * axis)
          .cwiseAbs()
          .dot(0.5 * box.size.array().matrix() + more * Eigen::Vector3d::Ones());
    };
    return std::abs(from_a_to_b.dot(axis)) > half(a) + half(b);
  };
  for (int i = 0; i < 3; ++i) {
    if (parts(a.T.linear().col(i)) || parts(b.T.linear().col(i))) return false;
    for (int j = 0; j < 3; ++j)
      if (parts(a.T.linear().col(i).cross(b.T.linear().col(j)))) return false;
  }
  return true;
}

}  // namespace abbe::oracles
