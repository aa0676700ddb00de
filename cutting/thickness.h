#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/mesh.h"

namespace abbe::cutting {

/// A part as places see it: how thick it is behind them, whether it comes near. Immutable; about 50
/// bytes a triangle and 24 a vertex.
class Thickness {
 public:
  explicit Thickness(const Design& design);

  /// mm from a place against its outward normal to the first triangle through which that line
  /// leaves the part; none within `most`, as behind an open surface. Triangles in whose plane
  /// the place lies, to 1e-9 mm, do not count.
  std::optional<double> behind(const Eigen::Vector3d& place, const Eigen::Vector3d& normal,
                               double most) const;

  /// Whether a triangle comes as near to a place as `distance` mm.
  bool comes_within(const Eigen::Vector3d& place, double distance) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0;
    int count = 0;   ///< of a leaf's triangles; 0 else
    int second = 0;  ///< the other child, the first is the next node
  };
  Eigen::AlignedBox3d box_of(int triangle) const;
  void add_node(int first, int last, const Points& middles);
  double distance_to(int triangle, const Eigen::Vector3d& place) const;
  std::optional<double> leaves_through(int triangle, const Eigen::Vector3d& place,
                                       const Eigen::Vector3d& direction) const;

  Points vertices_;
  Triangles corners_;
  std::vector<int> triangles_;  ///< sorted so that every node has a run of them
  std::vector<Node> nodes_;
};

}  // namespace abbe::cutting
