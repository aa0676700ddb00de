#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Core>

#include "cutting/nose_stretch.h"
#include "cutting/nose_sweep.h"

/// What a node of a nose's sweep rules out; inline, for it is asked of every node that a ray
/// visits.
namespace abbe::cutting {

/// Whether the rake plane of any piece below can contain a point of the ray, by angle alone. The
/// two sides of the axis are one plane, so angles count modulo pi.
inline bool may_face(const NoseNode& node, const NoseStretch& ray) {
  const double lift = node.height + node.tilt * ray.x_max;
  const double sine = lift < 1e-12 ? 0.0 : lift / ray.radius_min;
  if (!(sine < 1.0)) return true;
  const double slack = ray.azimuth_spread + std::asin(sine) + 1e-6;
  const double width = node.angle_high - node.angle_low + 2.0 * slack;
  if (width >= std::numbers::pi) return true;
  const double from = ray.azimuth - 0.5 * std::numbers::pi - (node.angle_low - slack);
  return from - std::numbers::pi * std::floor(from / std::numbers::pi) <= width;
}

/// Smallest s of the stretch at which the ray's line in the meridian half-plane comes within the
/// nose's reach of the box of nose centres. No point turned about the axis comes nearer than its
/// meridian.
inline double rounded_box_entry(const NoseNode& node, const NoseStretch& ray, double outer_radius) {
  constexpr double nowhere = std::numeric_limits<double>::infinity();
  const double reach = outer_radius + ray.sag;
  double enter = ray.from;
  double leave = ray.to;
  const std::array<double, 2> at{ray.q.x(), ray.radius0}, step{ray.n.x(), ray.radius_step};
  const std::array<double, 2> low{node.x_low, node.r_low}, high{node.x_high, node.r_high};
  for (int i = 0; i < 2; ++i) {
    if (std::abs(step[i]) < 1e-14) {
      if (at[i] < low[i] - reach - 1e-9 || at[i] > high[i] + reach + 1e-9) return nowhere;
      continue;
    }
    const double s0 = (low[i] - reach - at[i]) / step[i];
    const double s1 = (high[i] + reach - at[i]) / step[i];
    enter = std::max(enter, std::min(s0, s1));
    leave = std::min(leave, std::max(s0, s1));
  }
  if (enter > leave) return nowhere;
  const Eigen::Vector2d p(at[0] + enter * step[0], at[1] + enter * step[1]);
  const Eigen::Vector2d corner(std::clamp(p.x(), low[0], high[0]),
                               std::clamp(p.y(), low[1], high[1]));
  if (corner.x() == p.x() || corner.y() == p.y()) return enter;
  // It came in at a corner of the widened box: it is within reach only past that corner's circle.
  const Eigen::Vector2d d(step[0], step[1]);
  const Eigen::Vector2d v = p - corner;
  const double c = v.squaredNorm() - reach * reach;
  if (c <= 0.0) return enter;
  const double b = v.dot(d);
  const double root = b * b - d.squaredNorm() * c;
  if (root < 0.0 || b >= 0.0) return nowhere;
  const double s = enter + c / (-b + std::sqrt(root));
  return s > ray.to ? nowhere : s;
}

/// Below the smallest s at which a piece below the node can meet the ray; infinity if none can.
inline double first_reach(const NoseNode& node, const NoseStretch& ray, double outer_radius) {
  return may_face(node, ray) ? rounded_box_entry(node, ray, outer_radius) - 1e-9
                             : std::numeric_limits<double>::infinity();
}

}  // namespace abbe::cutting
