#include "cutting/stock/swept_cutter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cutting/surface/cutter_entry.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr double no_travel = 1e-12;  // mm, a shorter displacement is treated as none
// mm, margin by which the search for a form cutter begins outside the flat end around it
constexpr double outside_of_form = 1e-3;
constexpr double along_axis = 1e-13;  // component of a direction below which a line is parallel
                                      // to a plane

/// An interval of the position s along a line, clipped by conditions on s; empty if lo > hi.
struct Stretch {
  double lo = -infinity;
  double hi = infinity;

  bool is_empty() const { return !(lo <= hi); }
  void forbid() { lo = infinity, hi = -infinity; }
  /// Keeps c0 + c1 s >= 0.
  void positive(double c0, double c1) {
    if (std::abs(c1) < along_axis) {
      if (c0 < 0.0) forbid();
    } else if (c1 > 0.0) {
      lo = std::max(lo, -c0 / c1);
    } else {
      hi = std::min(hi, -c0 / c1);
    }
  }
  /// Keeps 0 <= c0 + c1 s <= top.
  void between(double c0, double c1, double top) {
    positive(c0, c1);
    positive(top - c0, -c1);
  }
  /// Keeps a s^2 + 2 b s + c <= 0.
  void within(double a, double b, double c) {
    if (a < along_axis * along_axis) {
      if (c > 0.0) forbid();
      return;
    }
    const double square = b * b - a * c;
    if (square < 0.0) return forbid();
    const double root = std::sqrt(square);
    lo = std::max(lo, (-b - root) / a);
    hi = std::min(hi, (-b + root) / a);
  }
};

}  // namespace

/// A line parameterised from the point nearest to the cutter: from a distant point the quadratic
/// equations would lose digits by cancellation.
struct CutterSweep::Line {
  Vector3d point, direction;
  double shift;  ///< position of that point in the original parameter

  Line(const Vector3d& p, const Vector3d& d, double height) : direction(d) {
    shift = -(p.dot(d) - height * d.z()) / d.squaredNorm();
    point = p + shift * d;
  }
};

/// The union of the intervals in the pieces of which the sweep consists. The sweep is convex, so
/// they leave no gap and the smallest and largest end suffice.
struct CutterSweep::Sum {
  SweepInterval result;

  /// Adds the interval inside a piece, whose point s is touched at instant t0 + t1 s.
  void add(const Stretch& piece, double t0, double t1 = 0.0) {
    if (piece.is_empty()) return;
    const auto instant = [&](double s) {
      return t1 == 0.0 ? std::clamp(t0, 0.0, 1.0) : std::clamp(t0 + t1 * s, 0.0, 1.0);
    };
    if (piece.lo < result.in) {
      result.in = piece.lo;
      result.t_in = instant(piece.lo);
    }
    if (piece.hi > result.out) {
      result.out = piece.hi;
      result.t_out = instant(piece.hi);
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
  const bool moves = lateral_ > no_travel;
  x_ = moves ? travel.x() / lateral_ : 1.0;
  y_ = moves ? travel.y() / lateral_ : 0.0;
  slope_ = moves ? travel.z() / lateral_ : 0.0;
  if (!moves) lateral_ = 0.0;
  unit_ = length_ > no_travel ? Vector3d(travel / length_) : Vector3d::UnitZ();
  if (length_ <= no_travel) length_ = 0.0;
}

/// Adds the cylinders at start and end of the move and the region between them, above the track of
/// the base. `line` is relative to the centre of the base at the start.
void CutterSweep::add_cylinders(const Line& line, double radius, Sum& sum) const {
  const Vector3d& p = line.point;
  const Vector3d& d = line.direction;
  const double a = d.x() * d.x() + d.y() * d.y();
  const double b = p.x() * d.x() + p.y() * d.y();
  const double c = p.x() * p.x() + p.y() * p.y() - radius * radius;
  Stretch first;
  first.within(a, b, c);
  // In a plunge the lower of both ends bounds the only cylinder.
  first.positive(p.z() - (lateral_ > 0.0 ? 0.0 : std::min(0.0, travel_.z())), d.z());
  sum.add(first, lateral_ > 0.0 || travel_.z() >= 0.0 ? 0.0 : 1.0);
  if (lateral_ == 0.0) return;

  const double along = p.x() * x_ + p.y() * y_, d_along = d.x() * x_ + d.y() * y_;
  const double across = p.y() * x_ - p.x() * y_, d_across = d.y() * x_ - d.x() * y_;
  Stretch last;
  last.within(a, b - lateral_ * d_along, c - lateral_ * (2.0 * along - lateral_));
  last.positive(p.z() - travel_.z(), d.z());
  sum.add(last, 1.0);

  Stretch middle;
  middle.between(radius + across, d_across, 2.0 * radius);
  middle.between(along, d_along, lateral_);
  middle.positive(p.z() - slope_ * along, d.z() - slope_ * d_along);
  sum.add(middle, along / lateral_, d_along / lateral_);
}

SweepInterval CutterSweep::along_flat(const Line& line, double radius) const {
  Sum sum;
  add_cylinders(line, radius, sum);
  const SweepInterval disc = disc_sweep_interval(radius, 0.0, travel_, line.point, line.direction);
  if (lateral_ > 0.0 && !disc.is_empty()) {
    sum.add({disc.in, disc.in}, disc.t_in);
    sum.add({disc.out, disc.out}, disc.t_out);
  }
  return sum.result;
}

SweepInterval CutterSweep::along_ball(const Line& line) const {
  Line from_centre = line;
  from_centre.point.z() -= radius_;
  const Vector3d& p = from_centre.point;
  const Vector3d& d = from_centre.direction;
  Sum sum;
  add_cylinders(from_centre, radius_, sum);
  const double a = d.squaredNorm();
  const double b = p.dot(d);
  const double c = p.squaredNorm() - radius_ * radius_;
  Stretch first;
  first.within(a, b, c);
  sum.add(first, 0.0);
  if (length_ == 0.0) return sum.result;
  const double along = p.dot(unit_), d_along = d.dot(unit_);
  Stretch last;
  last.within(a, b - length_ * d_along, c - length_ * (2.0 * along - length_));
  sum.add(last, 1.0);
  Stretch middle;
  middle.within(a - d_along * d_along, b - along * d_along, c - along * along);
  middle.between(along, d_along, length_);
  sum.add(middle, along / length_, d_along / length_);
  return sum.result;
}

/// The point of the core's sweep that is nearest to a given point. The core is the flat cylinder
/// inside the corner: at each instant the cutter is what lies within the corner radius of it.
struct CutterSweep::Nearest {
  double distance;
  Vector3d away;  ///< unit, from the core to the given point
  double t;       ///< instant at which the core is there
};

CutterSweep::Nearest CutterSweep::nearest(const Vector3d& point, double t) const {
  double low = 0.0, high = 1.0;
  Nearest found{0.0, Vector3d::Zero(), t};
  // The squared distance is convex in t: Newton's method, with bisection if it leaves the bracket.
  for (int i = 0; i < 60; ++i) {
    const double x = point.x() - t * travel_.x(), y = point.y() - t * travel_.y();
    const double rho = std::sqrt(x * x + y * y);
    const double out = std::max(0.0, rho - ring_);
    const double below = std::max(0.0, corner_ - point.z() + t * travel_.z());
    found.distance = std::sqrt(out * out + below * below);
    found.t = t;
    if (found.distance == 0.0) return found;
    const double ux = rho > 0.0 ? x / rho : 1.0, uy = rho > 0.0 ? y / rho : 0.0;
    found.away = Vector3d(out * ux, out * uy, -below) / found.distance;
    // Half the derivative of the squared distance with respect to t.
    const double closing = -(ux * travel_.x() + uy * travel_.y());
    const double slope = out * closing + below * travel_.z();
    if (slope == 0.0) break;
    (slope > 0.0 ? high : low) = t;
    double bend = below > 0.0 ? travel_.z() * travel_.z() : 0.0;
    if (out > 0.0)
      bend += closing * closing + out / rho * (lateral_ * lateral_ - closing * closing);
    double next = bend > 0.0 ? t - slope / bend : 0.5 * (low + high);
    if (next <= low && low == 0.0)
      next = 0.0;
    else if (next >= high && high == 1.0)
      next = 1.0;
    else if (!(next > low && next < high))
      next = 0.5 * (low + high);
    if (std::abs(next - t) * length_ < 1e-11) break;
    t = next;
  }
  return found;
}

/// Returns the position along the line where the distance from the core equals the corner radius,
/// by Newton's method from a position outside; infinity if there is none. The distance is convex
/// along the line, so no step overshoots.
/// @param sense  +1 or -1, direction of the search
/// @param t      instant of the nearest point: first a guess, then the result
double CutterSweep::settled(const Line& line, double from, double sense, double& t) const {
  double s = from;
  for (int i = 0; i < 60; ++i) {
    const Nearest at = nearest(line.point + s * line.direction, t);
    t = at.t;
    const double excess = at.distance - corner_;
    if (excess <= 1e-12) return s;
    const double closing = -sense * at.away.dot(line.direction);
    if (closing <= 1e-12) return infinity;
    const double step = excess / closing;
    s += sense * step;
    if (step < 1e-11) return s;
  }
  return s;
}

SweepInterval CutterSweep::along_bull(const Line& line) const {
  SweepInterval bracket = along_flat(line, radius_);
  if (bracket.is_empty()) return bracket;
  if (std::isfinite(bracket.in)) {
    bracket.in = settled(line, bracket.in, 1.0, bracket.t_in);
    if (!std::isfinite(bracket.in)) return {};
  }
  if (std::isfinite(bracket.out)) {
    bracket.out = settled(line, bracket.out, -1.0, bracket.t_out);
    if (!std::isfinite(bracket.out)) return {};
  }
  return bracket;
}

/// Bounds the interval by a flat end mill that encloses the form cutter and searches inwards from
/// both of its ends.
SweepInterval CutterSweep::along_form(const Line& line) const {
  const SweepInterval around = along_flat(line, radius_);
  Stretch within{around.in, around.out};
  const double lowest = std::min(0.0, travel_.z()), highest = std::max(0.0, travel_.z());
  within.between(line.point.z() - lowest, line.direction.z(),
                 cutter_.flank_length + highest - lowest);
  if (within.is_empty() || !std::isfinite(within.lo) || !std::isfinite(within.hi)) return {};
  const double length = line.direction.norm(), middle = 0.5 * (within.lo + within.hi);
  const double half = 0.5 * (within.hi - within.lo) * length + outside_of_form;
  const Move move{Vector3d::Zero(), travel_, Vector3d::UnitZ(), Vector3d::UnitX()};
  Ray ray{line.point + middle * line.direction, line.direction / length, half};
  const auto in = first_entry(cutter_, move, ray, half);
  if (!in) return {};
  ray.normal = -ray.normal;
  const auto out = first_entry(cutter_, move, ray, half);
  if (!out) return {};
  return {middle + in->s / length, middle - out->s / length, in->t, out->t};
}

SweepInterval CutterSweep::along(const Vector3d& point, const Vector3d& direction) const {
  const Line line(point, direction, corner_);
  SweepInterval found = cutter_.outline      ? along_form(line)
                        : corner_ == 0.0     ? along_flat(line, radius_)
                        : corner_ == radius_ ? along_ball(line)
                                             : along_bull(line);
  found.in += line.shift;
  found.out += line.shift;
  return found;
}

SweepInterval disc_sweep_interval(double radius, double height, const Vector3d& travel,
                                  const Vector3d& point, const Vector3d& direction) {
  const double rise = travel.z(), climb = direction.z();
  SweepInterval result;
  if (std::max(std::abs(rise), std::abs(climb)) < no_travel) return result;
  // For each instant t the line is at the height of the disc at one position s, and vice versa. The
  // relation is solved for the variable that avoids a division by a small rate.
  const bool by_instant = std::abs(climb) >= std::abs(rise);
  const double first = by_instant ? (height - point.z()) / climb : (point.z() - height) / rise;
  const double slope = by_instant ? rise / climb : climb / rise;
  const Vector3d p =
      by_instant ? Vector3d(point + first * direction) : Vector3d(point - first * travel);
  const Vector3d d =
      by_instant ? Vector3d(slope * direction - travel) : Vector3d(direction - slope * travel);
  Stretch stretch;
  if (by_instant)
    stretch.between(0.0, 1.0, 1.0);
  else
    stretch.between(first, slope, 1.0);
  if (stretch.is_empty()) return result;
  stretch.within(d.x() * d.x() + d.y() * d.y(), p.x() * d.x() + p.y() * d.y(),
                 p.x() * p.x() + p.y() * p.y() - radius * radius);
  if (stretch.is_empty()) return result;
  const auto other = [&](double x) { return first + slope * x; };
  if (!by_instant)
    return {stretch.lo, stretch.hi, std::clamp(other(stretch.lo), 0.0, 1.0),
            std::clamp(other(stretch.hi), 0.0, 1.0)};
  result = {other(stretch.lo), other(stretch.hi), stretch.lo, stretch.hi};
  if (slope < 0.0) {
    std::swap(result.in, result.out);
    std::swap(result.t_in, result.t_out);
  }
  return result;
}

}  // namespace abbe::cutting
