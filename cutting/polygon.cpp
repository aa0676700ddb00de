#include "cutting/polygon.h"

#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Geometry>

namespace abbe::cutting {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Twice the area vector of a polygon.
Vector3d twice_area(const std::vector<Vector3d>& corners) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    sum += (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
  return sum;
}

double turn(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

struct Outline {
  std::vector<Vector2d> at;  ///< of every corner, seen along the mean normal
  std::vector<int> left;     ///< corners not cut off yet, in order
  double least_turn;

  int next(std::size_t i, std::size_t by) const { return left[(i + by) % left.size()]; }

  /// Whether the corner between two others can be cut off.
  bool is_ear(std::size_t i) const {
    const int a = next(i, left.size() - 1), b = left[i], c = next(i, 1);
    const Vector2d &pa = at[std::size_t(a)], &pb = at[std::size_t(b)], &pc = at[std::size_t(c)];
    if (!(turn(pa, pb, pc) > least_turn)) return false;
    for (const int other : left) {
      if (other == a || other == b || other == c) continue;
      const Vector2d& p = at[std::size_t(other)];
      if (turn(pa, pb, p) >= -least_turn && turn(pb, pc, p) >= -least_turn &&
          turn(pc, pa, p) >= -least_turn)
        return false;
    }
    return true;
  }
};

}  // namespace

std::vector<std::array<int, 3>> triangulated(const std::vector<Vector3d>& corners) {
  const Vector3d area = twice_area(corners);
  const double size = area.norm();
  if (!(size > 0.0) || !std::isfinite(size)) return {};
  const Vector3d normal = area / size, across = normal.unitOrthogonal();
  Outline outline{{}, std::vector<int>(corners.size()), 1e-9 * size};
  for (const Vector3d& p : corners)
    outline.at.emplace_back((p - corners[0]).dot(across),
                            (p - corners[0]).dot(normal.cross(across)));
  std::iota(outline.left.begin(), outline.left.end(), 0);
  std::vector<std::array<int, 3>> triangles;
  while (outline.left.size() >= 3) {
    const std::size_t n = outline.left.size();
    std::size_t best = n;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const double cut =
          (corners[std::size_t(outline.next(i, n - 1))] - corners[std::size_t(outline.next(i, 1))])
              .norm();
      if (cut >= shortest || !outline.is_ear(i)) continue;
      best = i;
      shortest = cut;
    }
    if (best == n) return {};
    triangles.push_back({outline.next(best, n - 1), outline.left[best], outline.next(best, 1)});
    if (n == 3) return triangles;
    outline.left.erase(outline.left.begin() + std::ptrdiff_t(best));
  }
  return {};
}

}  // namespace abbe::cutting
