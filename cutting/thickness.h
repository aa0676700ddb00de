#pragma once

#include <optional>

#include <Eigen/Core>

#include "cutting/triangle_tree.h"

namespace abbe::cutting {

/// A part as places see it: how thick it is behind them, whether it comes near. Immutable.
class Thickness {
 public:
  explicit Thickness(const Design& design);

  /// mm from a place against its outward normal to the first triangle through which that line
  /// leaves the part; none within `most`, as behind an open surface. Triangles in whose plane
  /// the place lies, to 1e-9 mm, do not count.
  std::optional<double> behind(const Eigen::Vector3d& place, const Eigen::Vector3d& normal,
                               double most) const;

  /// mm from a place to the nearest triangle; `most` where none is nearer.
  double nearest(const Eigen::Vector3d& place, double most) const;

  /// Whether a triangle comes as near to a place as `distance` mm.
  bool comes_within(const Eigen::Vector3d& place, double distance) const;

 private:
  TriangleTree tree_;
};

}  // namespace abbe::cutting
