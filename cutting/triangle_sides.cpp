#include "cutting/triangle_sides.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>

namespace abbe::cutting {

std::vector<TriangleSide> sides_of(const Triangles& triangles) {
  if (triangles.rows() == 0) return {};
  const auto side = [&](int t, int k) -> TriangleSide {
    const auto [low, high] = std::minmax(triangles(t, k), triangles(t, (k + 1) % 3));
    return {low, high, t, k};
  };
  std::vector<std::ptrdiff_t> from(std::size_t(triangles.maxCoeff()) + 2, 0);
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) ++from[std::size_t(side(t, k).low) + 1];
  std::partial_sum(from.begin(), from.end(), from.begin());
  std::vector<TriangleSide> sides(3 * std::size_t(triangles.rows()));
  std::vector<std::ptrdiff_t> next = from;
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      const TriangleSide one = side(t, k);
      sides[std::size_t(next[std::size_t(one.low)]++)] = one;
    }
  for (std::size_t v = 0; v + 1 < from.size(); ++v)
    std::sort(sides.begin() + from[v], sides.begin() + from[v + 1],
              [](const TriangleSide& a, const TriangleSide& b) {
                return std::tie(a.high, a.triangle, a.corner) <
                       std::tie(b.high, b.triangle, b.corner);
              });
  return sides;
}

}  // namespace abbe::cutting
