#pragma once

#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/mesh.h"

namespace abbe::cutting {

/// Triangles sorted into boxes within boxes, for the nearest one to a place and the first that a
/// ray meets. Immutable; about 50 bytes a triangle and 24 a vertex. Built by all threads, the same
/// for any number of them.
class TriangleTree {
 public:
  TriangleTree(Points vertices, Triangles triangles);

  /// The place of a triangle that is nearest to another place.
  struct Nearest {
    int triangle = -1;  ///< -1 where there is none
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< of the corners, summing to one
    double squared = 0.0;                               ///< mm^2, of the distance
  };
  /// Of equally near triangles the one of least number, whatever the guess.
  /// @param guess  a triangle that may be near, which makes it faster; -1: none
  /// @param most   mm, triangles further off are not found
  Nearest nearest(const Eigen::Vector3d& place, int guess = -1,
                  double most = std::numeric_limits<double>::infinity()) const;
  /// All triangles that come as near as `distance`, by their numbers.
  std::vector<Nearest> within(const Eigen::Vector3d& place, double distance) const;
  /// From which side a ray comes upon a triangle.
  enum class Side { Outer, Inner };
  struct Met {
    double along = 0.0;  ///< mm
    int triangle = -1;
  };
  /// The first triangle that a ray meets from that side; none within `most`. Triangles in whose
  /// plane the start lies, to 1e-9 mm, do not count.
  /// @param direction  unit
  std::optional<Met> first_met(const Eigen::Vector3d& start, const Eigen::Vector3d& direction,
                               Side side,
                               double most = std::numeric_limits<double>::infinity()) const;

  const Points& vertices() const { return vertices_; }
  const Triangles& triangles() const { return corners_; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0;
    int count = 0;   ///< of a leaf's triangles; 0 else
    int second = 0;  ///< the other child, the first is the next node
  };
  void fill_node(int node, int first, int last, const Points& middles);
  Nearest nearest_of(int triangle, const Eigen::Vector3d& place) const;
  std::optional<double> met(int triangle, const Eigen::Vector3d& start,
                            const Eigen::Vector3d& direction, Side side) const;

  Points vertices_;
  Triangles corners_;
  std::vector<int> order_;  ///< triangles, so that every node has a run of them
  std::vector<Node> nodes_;
};

}  // namespace abbe::cutting
