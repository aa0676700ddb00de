#include "render/sharp_edges.h"

#include <algorithm>
#include <map>

namespace abbe::render {

std::vector<std::array<int, 2>> sharp_edges(const cutting::Points& points,
                                            const cutting::Triangles& triangles) {
  using Eigen::Vector3d;
  constexpr double facet = 0.9;  // cosine of the angle between facets of one face
  std::map<std::array<int, 2>, Vector3d> open;
  std::vector<std::array<int, 2>> sharp;
  for (const auto& t : triangles.rowwise()) {
    const Vector3d a = points.row(t[0]), b = points.row(t[1]), c = points.row(t[2]);
    const Vector3d normal = (b - a).cross(c - a).normalized();
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax({t[k], t[(k + 1) % 3]});
      const auto [seen, first] = open.try_emplace({low, high}, normal);
      if (first) continue;
      if (seen->second.dot(normal) < facet) sharp.push_back({low, high});
      open.erase(seen);
    }
  }
  for (const auto& [edge, normal] : open) sharp.push_back(edge);
  return sharp;
}

}  // namespace abbe::render
