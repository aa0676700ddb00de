#include "cutting/facet_miss.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace abbe::cutting {

Eigen::VectorXd facet_miss(const Design& design) {
  using Eigen::Vector3d;
  constexpr double opposite = -0.8;  // cosine between two edges that go on in one another
  const auto n = std::size_t(design.vertices.rows());
  std::vector<std::vector<int>> ends(n);
  for (const auto& t : design.triangles.rowwise())
    if (design.face.empty() || design.face[std::size_t(t[0])] < 0)
      for (int k = 0; k < 3; ++k) ends[std::size_t(t[k])].push_back(t[(k + 1) % 3]);
  struct Edge {
    Vector3d direction;
    double length, curvature;
  };
  Eigen::VectorXd miss = Eigen::VectorXd::Zero(design.vertices.rows());
  for (std::size_t v = 0; v < n; ++v) {
    std::vector<Edge> edges;
    for (const int end : ends[v]) {
      const Vector3d way = design.vertices.row(end) - design.vertices.row(Eigen::Index(v));
      const Vector3d turn = design.normals.row(end) - design.normals.row(Eigen::Index(v));
      const double length = way.norm();
      edges.push_back({way / length, length, turn.dot(way) / (length * length)});
    }
    double& most = miss[Eigen::Index(v)];
    for (const Edge& one : edges)
      for (const Edge& other : edges)
        if (one.direction.dot(other.direction) < opposite)
          most = std::max(
              most, std::abs(one.curvature - other.curvature) * one.length * other.length / 8.0);
  }
  return miss;
}

}  // namespace abbe::cutting
