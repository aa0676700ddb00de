#include "cutting/stock/swept_cutter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cutting/surface/cutter_entry.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr double min_travel = 1e-12;  // mm; a shorter displacement counts as none
// mm outside the enclosing flat end, where the search for a form cutter begins
constexpr double form_margin = 1e-3;
constexpr double parallel_tolerance = 1e-13;  // component of a direction; below it a line is
                                              // parallel to a plane

/// An interval of the position s along a line, clipped by conditions on s; empty if lo > hi.
struct LineSegment {
  double lo = -infinity;
  double hi = infinity;

  bool is_empty() const { return !(lo <= hi); }
  void make_empty() { lo = infinity, hi = -infinity; }
  /// Keeps c0 + c1 s >= 0.
  void keep_positive(double c0, double c1) {
    if (std::abs(c1) < parallel_tolerance) {
      if (c0 < 0.0) make_empty();
    } else if (c1 > 0.0) {
      lo = std::max(lo, -c0 / c1);
    } else {
      hi = std::min(hi, -c0 / c1);
    }
  }
  /// Keeps 0 <= c0 + c1 s <= top.
  void keep_between(double c0, double c1, double top) {
    keep_positive(c0, c1);
    keep_positive(top - c0, -c1);
  }
  /// Keeps a s^2 + 2 b s + c <= 0.
  void keep_inside_quadratic(double a, double b, double c) {
    if (a < parallel_tolerance * parallel_tolerance) {
      if (c > 0.0) make_empty();
      return;
    }
    const double discriminant = b * b - a * c;
    if (discriminant < 0.0) return make_empty();
    const double root = std::sqrt(discriminant);
    lo = std::max(lo, (-b - root) / a);
    hi = std::min(hi, (-b + root) / a);
  }
};

}  // namespace

/// A line whose parameter starts at the point nearest to the cutter. From a distant point the
/// quadratic equations would lose digits by cancellation.
struct CutterSweep::Line {
  Vector3d point, direction;
  double shift;  ///< original parameter of that point

  Line(const Vector3d& p, const Vector3d& d, double height) : direction(d) {
    shift = -(p.dot(d) - height * d.z()) / d.squaredNorm();
    point = p + shift * d;
  }
};

/// The union of the intervals inside the components of the sweep. The sweep is convex, so the union
/// has no gaps and its smallest and largest ends suffice.
struct CutterSweep::IntervalUnion {
  SweepInterval result;

  /// Adds the interval inside a component that touches the point at s at instant t0 + t1 s.
  void add(const LineSegment& segment, double t0, double t1 = 0.0) {
    if (segment.is_empty()) return;
    const auto instant = [&](double s) {
      return t1 == 0.0 ? std::clamp(t0, 0.0, 1.0) : std::clamp(t0 + t1 * s, 0.0, 1.0);
    };
    if (segment.lo < result.in) {
      result.in = segment.lo;
      result.t_in = instant(segment.lo);
    }
    if (segment.hi > result.out) {
      result.out = segment.hi;
      result.t_out = instant(segment.hi);
    }
  }
};

CutterSweep::CutterSweep(const Cutter& cutter, const Vector3d& travel)
    : cutter_(cutter),
      radius_(cutter.radius),
      corner_(cutter.corner_radius),
      ring_(cutter.radius - cutter.corner_radius),
      travel_(travel),
      lateral_(std::hypot(travel.x(), travel.y())),
      length_(travel.norm()) {
  const bool has_lateral_travel = lateral_ > min_travel;
  x_ = has_lateral_travel ? travel.x() / lateral_ : 1.0;
  y_ = has_lateral_travel ? travel.y() / lateral_ : 0.0;
  slope_ = has_lateral_travel ? travel.z() / lateral_ : 0.0;
  if (!has_lateral_travel) lateral_ = 0.0;
  unit_ = length_ > min_travel ? Vector3d(travel / length_) : Vector3d::UnitZ();
  if (length_ <= min_travel) length_ = 0.0;
}

/// Adds the cylinders at start and end of the move and the region between them, above the track of
/// the base. `line` is relative to the centre of the base at the start.
void CutterSweep::add_cylinders(const Line& line, double radius, IntervalUnion& intervals) const {
  const Vector3d& p = line.point;
  const Vector3d& d = line.direction;
  const double a = d.x() * d.x() + d.y() * d.y();
  const double b = p.x() * d.x() + p.y() * d.y();
  const double c = p.x() * p.x() + p.y() * p.y() - radius * radius;
  LineSegment first;
  first.keep_inside_quadratic(a, b, c);
  // In a plunge the lower end bounds the only cylinder.
  first.keep_positive(p.z() - (lateral_ > 0.0 ? 0.0 : std::min(0.0, travel_.z())), d.z());
  intervals.add(first, lateral_ > 0.0 || travel_.z() >= 0.0 ? 0.0 : 1.0);
  if (lateral_ == 0.0) return;

  const double along_travel = p.x() * x_ + p.y() * y_, d_along_travel = d.x() * x_ + d.y() * y_;
  const double across_travel = p.y() * x_ - p.x() * y_, d_across_travel = d.y() * x_ - d.x() * y_;
  LineSegment last;
  last.keep_inside_quadratic(a, b - lateral_ * d_along_travel,
                             c - lateral_ * (2.0 * along_travel - lateral_));
  last.keep_positive(p.z() - travel_.z(), d.z());
  intervals.add(last, 1.0);

  LineSegment middle;
  middle.keep_between(radius + across_travel, d_across_travel, 2.0 * radius);
  middle.keep_between(along_travel, d_along_travel, lateral_);
  middle.keep_positive(p.z() - slope_ * along_travel, d.z() - slope_ * d_along_travel);
  intervals.add(middle, along_travel / lateral_, d_along_travel / lateral_);
}

SweepInterval CutterSweep::flat_interval(const Line& line, double radius) const {
  IntervalUnion intervals;
  add_cylinders(line, radius, intervals);
  const SweepInterval disc = disc_sweep_interval(radius, 0.0, travel_, line.point, line.direction);
  if (lateral_ > 0.0 && !disc.is_empty()) {
    intervals.add({disc.in, disc.in}, disc.t_in);
    intervals.add({disc.out, disc.out}, disc.t_out);
  }
  return intervals.result;
}

SweepInterval CutterSweep::ball_interval(const Line& line) const {
  Line centred = line;
  centred.point.z() -= radius_;
  const Vector3d& p = centred.point;
  const Vector3d& d = centred.direction;
  IntervalUnion intervals;
  add_cylinders(centred, radius_, intervals);
  const double a = d.squaredNorm();
  const double b = p.dot(d);
  const double c = p.squaredNorm() - radius_ * radius_;
  LineSegment first;
  first.keep_inside_quadratic(a, b, c);
  intervals.add(first, 0.0);
  if (length_ == 0.0) return intervals.result;
  const double along_travel = p.dot(unit_), d_along_travel = d.dot(unit_);
  LineSegment last;
  last.keep_inside_quadratic(a, b - length_ * d_along_travel,
                             c - length_ * (2.0 * along_travel - length_));
  intervals.add(last, 1.0);
  LineSegment middle;
  middle.keep_inside_quadratic(a - d_along_travel * d_along_travel,
                               b - along_travel * d_along_travel, c - along_travel * along_travel);
  middle.keep_between(along_travel, d_along_travel, length_);
  intervals.add(middle, along_travel / length_, d_along_travel / length_);
  return intervals.result;
}

/// The point of the core's sweep nearest to a given point. The core is the flat cylinder inside the
/// corner; the cutter is the set of points within the corner radius of the core.
struct CutterSweep::NearestCorePoint {
  double distance;
  Vector3d away;  ///< unit, from the core to the given point
  double t;       ///< instant at which the core is there
};

CutterSweep::NearestCorePoint CutterSweep::nearest_core_point(const Vector3d& point,
                                                              double t) const {
  double low = 0.0, high = 1.0;
  NearestCorePoint result{0.0, Vector3d::Zero(), t};
  // The squared distance is convex in t: Newton's method, with bisection if it leaves the bracket.
  for (int i = 0; i < 60; ++i) {
    const double x = point.x() - t * travel_.x(), y = point.y() - t * travel_.y();
    const double rho = std::sqrt(x * x + y * y);
    const double radial_gap = std::max(0.0, rho - ring_);
    const double axial_gap = std::max(0.0, corner_ - point.z() + t * travel_.z());
    result.distance = std::sqrt(radial_gap * radial_gap + axial_gap * axial_gap);
    result.t = t;
    if (result.distance == 0.0) return result;
    const double ux = rho > 0.0 ? x / rho : 1.0, uy = rho > 0.0 ? y / rho : 0.0;
    result.away = Vector3d(radial_gap * ux, radial_gap * uy, -axial_gap) / result.distance;
    // Half the derivative of the squared distance with respect to t.
    const double approach_rate = -(ux * travel_.x() + uy * travel_.y());
    const double slope = radial_gap * approach_rate + axial_gap * travel_.z();
    if (slope == 0.0) break;
    (slope > 0.0 ? high : low) = t;
    double curvature = axial_gap > 0.0 ? travel_.z() * travel_.z() : 0.0;
    if (radial_gap > 0.0)
      curvature += approach_rate * approach_rate +
                   radial_gap / rho * (lateral_ * lateral_ - approach_rate * approach_rate);
    double next_t = curvature > 0.0 ? t - slope / curvature : 0.5 * (low + high);
    if (next_t <= low && low == 0.0)
      next_t = 0.0;
    else if (next_t >= high && high == 1.0)
      next_t = 1.0;
    else if (!(next_t > low && next_t < high))
      next_t = 0.5 * (low + high);
    if (std::abs(next_t - t) * length_ < 1e-11) break;
    t = next_t;
  }
  return result;
}

/// Returns the position along the line where the distance from the core equals the corner radius,
/// by Newton's method from a start outside; infinity if there is none. The distance is convex along
/// the line, so no step overshoots.
/// @param sense  +1 or -1, direction of the search
/// @param t      instant of the nearest point; on input an estimate
double CutterSweep::surface_crossing(const Line& line, double start, double sense,
                                     double& t) const {
  double s = start;
  for (int i = 0; i < 60; ++i) {
    const NearestCorePoint core = nearest_core_point(line.point + s * line.direction, t);
    t = core.t;
    const double excess = core.distance - corner_;
    if (excess <= 1e-12) return s;
    const double approach_rate = -sense * core.away.dot(line.direction);
    if (approach_rate <= 1e-12) return infinity;
    const double step = excess / approach_rate;
    s += sense * step;
    if (step < 1e-11) return s;
  }
  return s;
}

SweepInterval CutterSweep::bull_interval(const Line& line) const {
  SweepInterval bracket = flat_interval(line, radius_);
  if (bracket.is_empty()) return bracket;
  if (std::isfinite(bracket.in)) {
    bracket.in = surface_crossing(line, bracket.in, 1.0, bracket.t_in);
    if (!std::isfinite(bracket.in)) return {};
  }
  if (std::isfinite(bracket.out)) {
    bracket.out = surface_crossing(line, bracket.out, -1.0, bracket.t_out);
    if (!std::isfinite(bracket.out)) return {};
  }
  return bracket;
}

/// Returns the interval of a form cutter: that of the enclosing flat end mill, searched inwards
/// from both ends.
SweepInterval CutterSweep::form_interval(const Line& line) const {
  const SweepInterval outer = flat_interval(line, radius_);
  LineSegment segment{outer.in, outer.out};
  const double lowest = std::min(0.0, travel_.z()), highest = std::max(0.0, travel_.z());
  segment.keep_between(line.point.z() - lowest, line.direction.z(),
                       cutter_.flank_length + highest - lowest);
  if (segment.is_empty() || !std::isfinite(segment.lo) || !std::isfinite(segment.hi)) return {};
  const double length = line.direction.norm(), middle_s = 0.5 * (segment.lo + segment.hi);
  const double half_length = 0.5 * (segment.hi - segment.lo) * length + form_margin;
  const Move move{Vector3d::Zero(), travel_, Vector3d::UnitZ(), Vector3d::UnitX()};
  Ray ray{line.point + middle_s * line.direction, line.direction / length, half_length};
  const auto in = first_entry(cutter_, move, ray, half_length);
  if (!in) return {};
  ray.normal = -ray.normal;
  const auto out = first_entry(cutter_, move, ray, half_length);
  if (!out) return {};
  return {middle_s + in->s / length, middle_s - out->s / length, in->t, out->t};
}

SweepInterval CutterSweep::interval(const Vector3d& point, const Vector3d& direction) const {
  const Line line(point, direction, corner_);
  SweepInterval result = cutter_.outline      ? form_interval(line)
                         : corner_ == 0.0     ? flat_interval(line, radius_)
                         : corner_ == radius_ ? ball_interval(line)
                                              : bull_interval(line);
  result.in += line.shift;
  result.out += line.shift;
  return result;
}

SweepInterval disc_sweep_interval(double radius, double height, const Vector3d& travel,
                                  const Vector3d& point, const Vector3d& direction) {
  const double travel_rise = travel.z(), line_rise = direction.z();
  SweepInterval result;
  if (std::max(std::abs(travel_rise), std::abs(line_rise)) < min_travel) return result;
  // Each instant t has one position s at which the line is at the height of the disc, and vice
  // versa. The relation is solved for the variable that avoids the division by a small rate.
  const bool by_instant = std::abs(line_rise) >= std::abs(travel_rise);
  const double offset =
      by_instant ? (height - point.z()) / line_rise : (point.z() - height) / travel_rise;
  const double slope = by_instant ? travel_rise / line_rise : line_rise / travel_rise;
  const Vector3d p =
      by_instant ? Vector3d(point + offset * direction) : Vector3d(point - offset * travel);
  const Vector3d d =
      by_instant ? Vector3d(slope * direction - travel) : Vector3d(direction - slope * travel);
  LineSegment segment;
  if (by_instant)
    segment.keep_between(0.0, 1.0, 1.0);
  else
    segment.keep_between(offset, slope, 1.0);
  if (segment.is_empty()) return result;
  segment.keep_inside_quadratic(d.x() * d.x() + d.y() * d.y(), p.x() * d.x() + p.y() * d.y(),
                                p.x() * p.x() + p.y() * p.y() - radius * radius);
  if (segment.is_empty()) return result;
  const auto dependent_value = [&](double x) { return offset + slope * x; };
  if (!by_instant)
    return {segment.lo, segment.hi, std::clamp(dependent_value(segment.lo), 0.0, 1.0),
            std::clamp(dependent_value(segment.hi), 0.0, 1.0)};
  result = {dependent_value(segment.lo), dependent_value(segment.hi), segment.lo, segment.hi};
  if (slope < 0.0) {
    std::swap(result.in, result.out);
    std::swap(result.t_in, result.t_out);
  }
  return result;
}

}  // namespace abbe::cutting
