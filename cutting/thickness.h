#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/mesh.h"

namespace abbe::cutting {

/// How thick the part is behind the vertices of its design. Immutable; about 60 bytes a triangle.
class Thickness {
 public:
  /// @param design  outlives it
  explicit Thickness(const Design& design);

  /// mm from a vertex against its normal to the first triangle through which that line leaves the
  /// part; none within `most`, as behind an open surface. Triangles at the vertex do not count.
  std::optional<double> behind(Eigen::Index vertex, double most) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0;
    int count = 0;   ///< of a leaf's triangles; 0 else
    int second = 0;  ///< the other child, the first is the next node
  };
  Eigen::AlignedBox3d box_of(int triangle) const;
  void add_node(int first, int last);
  std::optional<double> leaves_through(int triangle, Eigen::Index vertex) const;

  const Design& design_;
  std::vector<int> triangles_;  ///< sorted so that every node has a run of them
  std::vector<Node> nodes_;
};

}  // namespace abbe::cutting
