#include "render/view.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "render/label.h"

namespace abbe::render {
namespace {

using Eigen::Vector3d;

/// Part of `up` across the line of sight, or of the first axis that is not along it.
Vector3d upward(const Vector3d& toward, const Vector3d& up) {
  for (const Vector3d& wanted : {up, Vector3d(Vector3d::UnitY()), Vector3d(Vector3d::UnitX())}) {
    const Vector3d across = wanted - wanted.dot(toward) * toward;
    if (across.norm() > 1e-6 * std::max(wanted.norm(), 1e-300)) return across.normalized();
  }
  return Vector3d::UnitZ();
}

}  // namespace

View fitted_view(const cutting::Points& points, const Vector3d& from, const Vector3d& up,
                 const Rectangle& area) {
  View view;
  view.area = area;
  view.toward = from.norm() > 0.0 ? Vector3d(from.normalized()) : Vector3d(Vector3d::UnitZ());
  view.up = upward(view.toward, up);
  view.right = view.up.cross(view.toward);
  if (points.rows() == 0) return view;

  Eigen::Matrix3d to_view;
  to_view << view.right.transpose(), view.up.transpose(), view.toward.transpose();
  const cutting::Points seen = points * to_view.transpose();
  const Vector3d lower = seen.colwise().minCoeff();
  const Vector3d upper = seen.colwise().maxCoeff();
  const Vector3d size = upper - lower;
  view.centre = to_view.transpose() * (0.5 * (lower + upper));
  constexpr double rim_px = 6.0;  // left free for the lines along the rim
  view.mm_per_px = std::max(size.x() / std::max(area.width - rim_px, 1.0),
                            size.y() / std::max(area.height - rim_px, 1.0));
  if (!(view.mm_per_px > 0.0)) view.mm_per_px = 1.0;
  view.depth = size.norm() + view.mm_per_px;
  return view;
}

double aspect(const cutting::Points& points, const Vector3d& from, const Vector3d& up) {
  // the scale that fits a width, and the one that fits a height, of one pixel
  const double width = fitted_view(points, from, up, {0, 0, 1.0, 1e12}).mm_per_px;
  const double height = fitted_view(points, from, up, {0, 0, 1e12, 1.0}).mm_per_px;
  return height / width;
}

Eigen::Vector2d projected(const View& view, const Vector3d& p) {
  const Vector3d d = (p - view.centre) / view.mm_per_px;
  return {view.area.x + 0.5 * view.area.width + d.dot(view.right),
          view.area.y + 0.5 * view.area.height + d.dot(view.up)};
}

std::string view_name(const View& view) {
  constexpr std::array<const char*, 3> positive{"+X", "+Y", "+Z"};
  constexpr std::array<const char*, 3> negative{"−X", "−Y", "−Z"};
  for (int i = 0; i < 3; ++i) {
    if (std::abs(view.toward[i]) > 1.0 - 1e-9) {
      return std::string("from ") + (view.toward[i] > 0.0 ? positive[i] : negative[i]);
    }
  }
  return "from (" + fixed(view.toward.x(), 2) + ", " + fixed(view.toward.y(), 2) + ", " +
         fixed(view.toward.z(), 2) + ")";
}

}  // namespace abbe::render
