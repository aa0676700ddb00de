#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sim/program/generate.h"
#include "sim/program/milling_text.h"

namespace abbe::sim::program {
namespace {

/// A line of the design above a line of the part's x-y plane.
struct Section {
  const ContactField& design;
  int axis = 0;        ///< 0 runs along x, 1 along y
  double other = 0.0;  ///< mm, the coordinate that stays

  std::optional<cutting::Contact> at(double a) const {
    return axis == 0 ? design(a, other) : design(other, a);
  }
  /// Coordinate gained per arc length; 1 where there is no design.
  double rate(double a) const {
    const auto contact = at(a);
    if (!contact) return 1.0;
    const double across = contact->normal[axis], up = contact->normal.z();
    return up / std::sqrt(across * across + up * up);
  }
  /// Coordinate after an arc length, by Runge-Kutta's fourth-order rule: with steps of h on a
  /// radius rho it errs by less than (h/rho)^4 of the length.
  double advance(double from, double length, int steps) const {
    const double h = length / steps;
    double a = from;
    for (int i = 0; i < steps; ++i) {
      const double k1 = rate(a), k2 = rate(a + 0.5 * h * k1), k3 = rate(a + 0.5 * h * k2),
                   k4 = rate(a + h * k3);
      a += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return a;
  }
  /// Last coordinate with design on the way from `inside` to `outside`.
  double rim(double inside, double outside) const {
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (inside + outside);
      (at(middle) ? inside : outside) = middle;
    }
    return inside;
  }
};

/// Coordinates of the passes across y, equally spaced on the design from the middle outwards.
std::vector<double> pass_positions(const Raster& raster, const Section& section, double lower,
                                   double upper) {
  constexpr int steps = 8;
  const double middle = 0.5 * (lower + upper);
  std::vector<double> y{middle};
  for (const double sign : {1.0, -1.0}) {
    double at = middle;
    while (true) {
      const double next = section.advance(at, sign * raster.step_over, steps);
      const bool stuck =
          std::abs(next - at) < 1e-6 * raster.step_over;  // the design stands upright
      if (stuck || next > upper + 1e-9 || next < lower - 1e-9) break;
      y.push_back(at = next);
    }
  }
  std::sort(y.begin(), y.end());
  return y;
}

struct Interval {
  double from = 0.0, to = 0.0;
};

/// Where the section runs over the design; a gap narrower than `step` may be missed.
std::vector<Interval> stretches(const Section& section, double lower, double upper, double step) {
  std::vector<Interval> found;
  const int n = std::max(1, int(std::ceil((upper - lower) / step)));
  bool inside = false;
  double begin = lower, last = lower;
  for (int i = 0; i <= n; ++i) {
    const double a = i == n ? upper : lower + (upper - lower) * i / n;
    const bool here = section.at(a).has_value();
    if (here && !inside) begin = i == 0 ? a : section.rim(a, last);
    if (!here && inside) found.push_back({begin, section.rim(last, a)});
    inside = here;
    last = a;
  }
  if (inside) found.push_back({begin, upper});
  return found;
}

std::vector<double> points_along(const Section& section, const Interval& stretch, double step) {
  std::vector<double> x{stretch.from};
  while (true) {
    const double next = section.advance(x.back(), step, 2);
    if (!(next < stretch.to) || next - x.back() < 1e-6 * step) break;
    x.push_back(next);
  }
  if (stretch.to - x.back() > 1e-6 * step) x.push_back(stretch.to);
  return x;
}

/// The cutter put on a contact: its axis leans from the normal by `lead` towards the feed and by
/// `tilt` about it.
Posture posture(const Raster& raster, const cutting::Cutter& cutter,
                const cutting::Contact& contact, const Eigen::Vector3d& feed,
                const std::optional<Eigen::Vector3d>& fixed_axis) {
  const Eigen::Vector3d& n = contact.normal;
  Eigen::Vector3d u = std::cos(raster.lead) * n + std::sin(raster.lead) * feed;
  u = Eigen::AngleAxisd(raster.tilt, feed) * u;
  if (fixed_axis) u = *fixed_axis;
  u.normalize();
  const Eigen::Vector3d inward = n - n.dot(u) * u;
  const double sine = inward.norm();
  if (cutter.outline) {
    const Eigen::Vector2d touching = cutting::support_point(*cutter.outline, -n.dot(u), sine);
    Eigen::Vector3d tip = contact.point - touching.y() * u;
    if (sine > 1e-12) tip += touching.x() * (inward / sine);
    return {tip, u, u};
  }
  const double r = cutter.corner_radius;
  Eigen::Vector3d tip = contact.point + r * (n - u);
  // With the flat on the surface any point of it touches; the tip is taken.
  if (sine > 1e-12) tip += (cutter.radius - r) * (inward / sine);
  return {tip, u, u};
}

Pass pass_along(const Raster& raster, const cutting::Cutter& cutter, const Section& section,
                std::vector<double> x, const std::optional<Eigen::Vector3d>& fixed_axis,
                bool backwards) {
  if (backwards) std::reverse(x.begin(), x.end());
  Pass pass;
  for (const double a : x) {
    const auto contact = section.at(a);
    if (!contact) continue;
    const Eigen::Vector3d& n = contact->normal;
    const Eigen::Vector3d along = Eigen::Vector3d(n.z(), 0.0, -n.x()).normalized();
    pass.push_back(
        posture(raster, cutter, *contact, backwards ? Eigen::Vector3d(-along) : along, fixed_axis));
  }
  return pass;
}

void check(const Raster& raster, const cutting::Cutter& cutter, const GenerateContext& context) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw std::invalid_argument(fmt::format("expected {} above 0", name));
  };
  positive(raster.step_over, "step_over");
  positive(raster.step, "step");
  positive(raster.feed, "feed");
  positive(raster.clearance, "clearance");
  positive(cutter.radius, "the radius of the cutter");
  if (!(std::abs(raster.lead) < 1.6) || !(std::abs(raster.tilt) < 1.6))
    throw std::invalid_argument("expected lead and tilt below 90 deg");
  const Eigen::Vector2d range = context.upper - context.lower;
  if (!(range.minCoeff() >= 0.0) || !range.allFinite())
    throw std::invalid_argument("expected a range with its lower corner below the upper");
  if ((range.x() / raster.step + 1) * (range.y() / raster.step_over + 1) > most_points)
    throw std::invalid_argument("expected at most 2e7 points in a program");
  if (!has_rotary_axes(context.control) && (raster.lead != 0.0 || raster.tilt != 0.0))
    throw std::invalid_argument("expected lead = tilt = 0 on a machine without rotary axes");
}

}  // namespace

MillingProgram generate_raster(const Raster& raster, const ContactField& design,
                               const cutting::Cutter& cutter, const GenerateContext& context) {
  check(raster, cutter, context);
  std::optional<Eigen::Vector3d> fixed_axis;  // in the part frame
  if (!has_rotary_axes(context.control)) {
    const auto zero = kinematics::AxisVector(kinematics::AxisVector::Zero(context.control.size()));
    fixed_axis =
        context.T_wm.linear().transpose() * context.control.tool_in_workpiece(zero).linear().col(2);
  }
  const double x_section = std::clamp(0.0, context.lower.x(), context.upper.x());
  const std::vector<double> y =
      pass_positions(raster, {design, 1, x_section}, context.lower.y(), context.upper.y());
  std::vector<Pass> passes;
  bool backwards = false;
  for (const double at : y) {
    const Section section{design, 0, at};
    std::vector<Interval> parts =
        stretches(section, context.lower.x(), context.upper.x(), raster.step);
    if (backwards) std::reverse(parts.begin(), parts.end());
    for (const Interval& part : parts) {
      Pass pass = pass_along(raster, cutter, section, points_along(section, part, raster.step),
                             fixed_axis, backwards);
      for (Posture& p : pass) {
        p.tip_w = context.T_wm * p.tip_w;
        p.direction_w = context.T_wm.linear() * p.direction_w;
        p.retreat_w = context.T_wm.linear() * p.retreat_w;
      }
      if (!pass.empty()) passes.push_back(std::move(pass));
    }
    if (raster.zigzag) backwards = !backwards;
  }
  if (passes.empty())
    throw std::invalid_argument("expected some of the design within the range of the raster");
  return milling_text(passes,
                      {.title = "raster finishing",
                       .feed = raster.feed,
                       .clearance = raster.clearance,
                       .speed_rpm = raster.speed_rpm,
                       .cutter_radius = cutter.radius,
                       .neighbour = raster.zigzag ? 4 * raster.step_over : 0.0,
                       .whole = false,
                       .format = raster.format},
                      context);
}

}  // namespace abbe::sim::program
