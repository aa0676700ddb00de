#include "tests/oracles/form_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Geometry>

namespace abbe::oracles {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Where the perpendicular bisectors of ab and cd meet.
std::optional<Vector2d> meeting(const Vector2d& a, const Vector2d& b, const Vector2d& c,
                                const Vector2d& d) {
  const Vector2d u = b - a, v = d - c;
  const double area = u.x() * v.y() - u.y() * v.x();
  if (std::abs(area) < 1e-14 * u.norm() * v.norm()) return std::nullopt;
  const double p = 0.5 * (b.squaredNorm() - a.squaredNorm());
  const double q = 0.5 * (d.squaredNorm() - c.squaredNorm());
  return Vector2d((p * v.y() - q * u.y()) / area, (u.x() * q - v.x() * p) / area);
}

}  // namespace

double brute_circularity(const Eigen::MatrixX2d& points, double reach) {
  const Vector2d mean = points.colwise().mean();
  const Index n = points.rows();
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < i; ++j)
      for (Index k = 0; k <= i; ++k)
        for (Index l = 0; l < k; ++l) {
          const auto centre = meeting(points.row(i), points.row(j), points.row(k), points.row(l));
          if (!centre || (*centre - mean).norm() > reach) continue;
          const auto d = (points.rowwise() - centre->transpose()).rowwise().norm().eval();
          least = std::min(least, d.maxCoeff() - d.minCoeff());
        }
  return least;
}

double brute_flatness(const Eigen::MatrixX3d& points) {
  const Index n = points.rows();
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < i; ++j)
      for (Index k = 0; k <= i; ++k)
        for (Index l = 0; l < k; ++l) {
          const Vector3d a = points.row(i) - points.row(j), b = points.row(k) - points.row(l);
          const Vector3d normal = a.cross(b);
          if (normal.norm() < 1e-12 * a.norm() * b.norm()) continue;
          const auto h = (points * normal.normalized()).eval();
          least = std::min(least, h.maxCoeff() - h.minCoeff());
        }
  return least;
}

}  // namespace abbe::oracles
