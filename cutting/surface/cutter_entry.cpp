#include "cutting/surface/cutter_entry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/surface/ball_entry.h"
#include "cutting/surface/entry_bounds.h"
#include "kinematics/units.h"

/// The first entry of a ray into a moving cutter is the least value of a function of time that is
/// convex except for a bounded dip. It is found by branch and bound.
namespace abbe::cutting {

using Eigen::Vector3d;

/// A value with its slope, and a bound of how far below zero its curvature may fall nearby.
struct Sample {
  double t;
  bool defined;  ///< the function is +infinity where it is not defined
  double value;
  double slope;
  double dip;               ///< curvature >= -dip; 0 where the function is convex
  double fade;              ///< dip is valid for time differences well below 1 / fade
  Eigen::Vector3d outward;  ///< normal of the cutter, used by a `floor`
  double facing;            ///< -outward * normal of the ray
  double doubt = 0;         ///< the value may be too large by this much, from rounding

  // Returns the dip valid over a time difference w: the facing falls by a fraction of up to fade w,
  // and the dip contains its inverse square.
  double dip_over(double w) const { return dip / ((1 - fade * w) * (1 - fade * w)); }
};

inline Sample undefined_at(double t) {
  return {t, false, std::numeric_limits<double>::infinity(), 0, 0, 0, Eigen::Vector3d::Zero(), 1};
}

// Accuracy and stopping conditions of a search.
struct Goal {
  double tolerance;
  /// Larger values need not be found.
  double limit = std::numeric_limits<double>::infinity();
  /// A value as small as this ends the search.
  double enough = -std::numeric_limits<double>::infinity();
  int max_samples = 5000;  ///< 3 to 12 are needed; hundreds for a disc of zero height that a ray
                           ///< grazes
};

// An interval of time between two samples.
struct Piece {
  Sample a, b;
  int depth;
};

/// A lower bound over a piece, and the time at which it is attained.
struct PieceBound {
  double value;
  double t;
};

/// A straight line over a piece, given by its values at the ends.
struct Line {
  double at_a, at_b;
};

/// Returns the least value, and its time, of the upper envelope of two lines over a piece.
inline PieceBound min_above(const Piece& piece, const Line& first, const Line& second) {
  const auto higher = [&](double x) {
    return std::max(first.at_a + x * (first.at_b - first.at_a),
                    second.at_a + x * (second.at_b - second.at_a));
  };
  const double apart_a = first.at_a - second.at_a;
  const double apart_b = first.at_b - second.at_b;
  double x = higher(0.0) <= higher(1.0) ? 0.0 : 1.0;
  if (apart_a * apart_b < 0) {
    const double crossing = apart_a / (apart_a - apart_b);
    if (higher(crossing) < higher(x)) x = crossing;
  }
  const double width = piece.b.t - piece.a.t;
  return {higher(x), piece.a.t + (x == 0.0 || x == 1.0 ? 0.5 : x) * width};
}

/// Returns a lower bound over a piece. f + dip (t - a)^2 / 2 is convex, so it lies above its
/// tangents at both ends. Where the dip is not valid over the piece, the bound is `floor(piece)`.
template <class Floor>
PieceBound promise(const Piece& piece, double tolerance, const Floor& floor) {
  const auto& [a, b, depth] = piece;
  const double w = b.t - a.t;
  const double middle = a.t + 0.5 * w;
  const bool trusted = std::max(a.fade, b.fade) * w < 0.5;
  if (!a.defined || !b.defined) {
    if (!trusted) return floor(piece);
    const Sample& end = a.defined ? a : b;
    const double far =
        end.value + (a.defined ? 1 : -1) * end.slope * w - 0.5 * end.dip_over(w) * w * w;
    return {std::min(end.value, far) - end.doubt, middle};
  }
  if (!trusted) return floor(piece);
  const double dip = std::max(a.dip_over(w), b.dip_over(w));
  const double value_a = a.value - a.doubt;
  const double value_b = b.value - b.doubt + 0.5 * dip * w * w;
  const double slope_b = b.slope + dip * w;
  const double below_a = value_b - value_a - a.slope * w;
  const double below_b = value_a - value_b + slope_b * w;
  const double slack = tolerance + a.doubt + b.doubt;
  // The samples contradict the dip by more than rounding, so it cannot be used.
  if (below_a < -slack || below_b < -slack) return floor(piece);
  // More samples would not remove the rounding at the lower end of a monotonic piece, so its value
  // there is taken as it is.
  if (a.slope >= 0.5 * dip * w) return {a.value, a.t};
  if (b.slope <= -0.5 * dip * w) return {b.value, b.t};
  const double turn = slope_b - a.slope;
  const double x = turn > 0 ? std::clamp(below_b / turn, 0.0, w) : 0.5 * w;
  const double inner = value_a + a.slope * x - 0.5 * dip * x * x;
  return {std::min({value_a, b.value - b.doubt, inner}), a.t + x};
}

// Returns the time of the next sample in a piece.
inline double next_sample(const Piece& piece, const PieceBound& low) {
  const auto& [a, b, depth] = piece;
  const double w = b.t - a.t;
  if (!a.defined || !b.defined || low.value == -std::numeric_limits<double>::infinity())
    return low.t;
  if (a.slope < 0 && b.slope > 0) {
    const double secant = a.t + w * a.slope / (a.slope - b.slope);
    // For a parabola the tangents meet in the middle and the secant of the slopes gives its
    // minimum; for a kink the tangents meet at the kink. Every fourth step halves the piece, which
    // also handles functions that are neither.
    if (depth % 4 == 3) return a.t + 0.5 * w;
    const bool smooth = std::abs(low.t - a.t - 0.5 * w) < 0.1 * w;
    return std::clamp(smooth ? secant : low.t, a.t + 1e-4 * w, b.t - 1e-4 * w);
  }
  // The minimum lies beside the lower end. The pieces split off grow by 16 with the distance from
  // it, so few samples are spent far away.
  return a.value <= b.value ? a.t + w / 16 : b.t - w / 16;
}

/// The pieces that may contain less than the best sample so far, on a stack.
template <class Function, class Floor>
class BranchAndBound {
 public:
  BranchAndBound(const Function& f, const Floor& floor, const Goal& goal, const Sample& best)
      : f_(f), floor_(floor), goal_(goal), best_(best) {}

  bool is_over() const { return best_.value <= goal_.enough; }
  void take(const Sample& sample) {
    if (sample.defined && sample.value < best_.value) best_ = sample;
  }
  Sample sample(double t) {
    const Sample sample = f_(t);
    take(sample);
    return sample;
  }
  bool is_ruled_out(const Piece& piece) const { return is_ruled_out(piece, promised(piece)); }
  /// Weaker test without the cost of a floor.
  bool is_clearly_ruled_out(const Piece& piece) const { return !is_small(promised(piece).value); }
  void add(const Piece& piece) { open_[count_++] = piece; }

  Sample least() {
    for (int samples = 0; count_ > 0 && samples < goal_.max_samples && !is_over();) {
      const Piece piece = open_[--count_];
      const PieceBound low = promised(piece);
      if (is_ruled_out(piece, low)) continue;
      // 1e-13 of a move is the rounding of time; a full stack means the same
      if (piece.b.t - piece.a.t < 1e-13 || count_ + 2 > open_.size()) continue;
      const Sample c = sample(next_sample(piece, low));
      ++samples;
      if (c.defined || piece.a.defined) add({piece.a, c, piece.depth + 1});
      if (c.defined || piece.b.defined) add({c, piece.b, piece.depth + 1});
    }
    return best_;
  }

 private:
  PieceBound promised(const Piece& piece) const { return promise(piece, goal_.tolerance, floor_); }
  bool is_small(double value) const {
    return !(value >= std::min(best_.value - goal_.tolerance, goal_.limit));
  }
  /// The dip rules out cheaply; where it does not, the bound by planes is tighter but costs more.
  bool is_ruled_out(const Piece& piece, const PieceBound& low) const {
    if (!is_small(low.value)) return true;
    return std::max(piece.a.dip, piece.b.dip) > 0 && !is_small(floor_(piece).value);
  }

  const Function& f_;
  const Floor& floor_;
  const Goal& goal_;
  Sample best_;
  std::array<Piece, 64> open_;
  std::size_t count_ = 0;
};

/// Returns the smallest value of f between two samples.
template <class Function, class Floor>
Sample minimum(const Function& f, const Floor& floor, const Sample& first, const Sample& last,
               const Goal& goal) {
  const bool last_is_less = last.defined && (!first.defined || last.value < first.value);
  BranchAndBound search(f, floor, goal, last_is_less ? last : first);
  search.add({first, last, 0});
  return search.least();
}

/// Returns the smallest value of f from `from` to `to` if it is known to be attained near `about`;
/// an undefined sample if f is undefined there. Usually takes three samples: at `about` and on
/// either side.
/// @param beyond  returns the least value between two times for a goal; called for the far side of
///                a gap in f that is not ruled out
template <class Function, class Floor, class Beyond>
Sample minimum_about(const Function& f, const Floor& floor, const Beyond& beyond, double from,
                     double about, double to, const Goal& goal) {
  const Sample c = f(about);
  BranchAndBound search(f, floor, goal, c);
  if (!c.defined || search.is_over()) return c;
  const auto piece = [](const Sample& one, const Sample& other) {
    return one.t < other.t ? Piece{one, other, 0} : Piece{other, one, 0};
  };
  for (const double end : {from, to}) {
    if (search.is_over()) break;
    if (end == about || search.is_clearly_ruled_out(piece(c, undefined_at(end)))) continue;
    const double sense = end < about ? -1.0 : 1.0;
    double aside = (std::abs(c.slope) < c.dip ? 4e-3 : 3e-4) * (to - from);
    Sample last = c;
    do {
      const double next = std::clamp(last.t + sense * aside, from, to);
      const Sample beside = search.sample(next);
      search.add(piece(last, beside));
      if (!beside.defined) {
        if (next != end && !search.is_ruled_out(piece(last, undefined_at(end))))
          search.take(beyond(std::min(next, end), std::max(next, end), goal));
        break;
      }
      // At least eight times as far, and half as far again as the zero of the extrapolated slope.
      const double bend = (beside.slope - last.slope) / (beside.t - last.t);
      aside = std::max(8.0 * aside, bend > 0 ? 1.5 * std::abs(beside.slope) / bend : 0.0);
      last = beside;
    } while (last.t != end && !search.is_ruled_out(piece(last, undefined_at(end))));
  }
  return search.least();
}

namespace {

constexpr double straight_tolerance = 1e-9;  // mm, if the axis does not turn and the search is
                                             // convex
constexpr double turning_tolerance = 2e-8;   // mm, if the axis turns
constexpr double depth_tolerance = 1e-10;    // mm, depth of a touch that may be missed
constexpr double min_sine = 1e-15;           // below it the sine between ray and skin is rounding

// The cutter at one instant.

/// The point at which a ray enters the cutter, and the outward normal of the cutter there.
struct Hit {
  double s;
  Vector3d outward;
};

/// A ray in the frame of the cutter, split into components along and across its axis.
struct LocalRay {
  Vector3d axis;
  double h, dh;  // mm, height above the tip, and its derivative with respect to s
  Vector3d lateral, dlateral;

  LocalRay(const Position& at, const Vector3d& point, const Vector3d& normal) : axis(at.axis) {
    const Vector3d p = point - at.tip;
    h = p.dot(axis);
    dh = normal.dot(axis);
    lateral = p - h * axis;
    dlateral = normal - dh * axis;
  }
  double height(double s) const { return h + s * dh; }
  Vector3d across(double s) const { return lateral + s * dlateral; }
};

struct Interval {
  double in = -infinity;
  double out = infinity;
};

// The range of s inside an infinite cylinder. Below 1e-30 the ray is parallel to its axis.
Interval within_cylinder(const LocalRay& ray, double radius) {
  const double a = ray.dlateral.squaredNorm();
  const double b = ray.lateral.dot(ray.dlateral);
  const double c = ray.lateral.squaredNorm() - radius * radius;
  if (a < 1e-30) return c <= 0 ? Interval{} : Interval{infinity, -infinity};
  const double nearest = -b / a;
  const double half2 = (radius * radius - ray.across(nearest).squaredNorm()) / a;
  if (half2 < 0) return {infinity, -infinity};
  const double half = std::sqrt(half2);
  return {nearest - half, nearest + half};
}

Interval within_slab(const LocalRay& ray, double top) {
  if (ray.dh == 0) return ray.h >= 0 && ray.h <= top ? Interval{} : Interval{infinity, -infinity};
  const double at_bottom = -ray.h / ray.dh;
  const double at_top = (top - ray.h) / ray.dh;
  return {std::min(at_bottom, at_top), std::max(at_bottom, at_top)};
}

/// Returns the entry through the torus corner from a point s outside it, below the flank and within
/// the outer cylinder. Each step replaces the ring by its tangent line; the tube about that line
/// contains the torus, so the steps approach from outside and never pass the root.
std::optional<Hit> corner_entry(const Cutter& cutter, const LocalRay& ray, double s, double out) {
  const double r = cutter.corner_radius;
  const double ring = cutter.radius - r;
  // The last iterate is accepted: it approaches from outside and never passes the root.
  constexpr int last = 39;
  for (int i = 0; i <= last; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const double drho = rho > 0 ? across.dot(ray.dlateral) / rho : ray.dlateral.norm();
    const double a = rho - ring;
    const double b = r - ray.height(s);
    const double A = drho * drho + ray.dh * ray.dh;
    const double B = a * drho - b * ray.dh;
    const double C = a * a + b * b - r * r;
    const double D = B * B - A * C;
    if (D < 0 || (B >= 0 && C > 0)) return std::nullopt;
    const double advance = C <= 0 ? 0.0 : C / (std::sqrt(D) - B);
    s += advance;
    if (s > out) return std::nullopt;
    // Convergence is quadratic, so after a step below 1e-9 the next one would be about 1e-18. A
    // grazing ray converges more slowly and is iterated to rounding.
    const bool grazes = D < 1e-4 * B * B;
    if (advance < (grazes ? 1e-14 * (1 + std::abs(s)) : 1e-9) || i == last) {
      const double sideways = rho > 0 ? std::max(a, 0.0) / rho : 0.0;
      return Hit{s, (sideways * across - b * ray.axis).normalized()};
    }
  }
  return std::nullopt;
}

/// Returns the entry through an outline from a point s outside it. The distance to an outline is
/// convex along the ray, so no step of Newton's method passes the root.
std::optional<Hit> outline_entry(const ToolOutline& outline, const LocalRay& ray, double s) {
  for (int i = 0; i < 100; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const Vector3d radial = rho > 0 ? Vector3d(across / rho) : Vector3d::Zero();
    const OutlineDistance at = distance(outline, {rho, ray.height(s)});
    const double drho = rho > 0 ? radial.dot(ray.dlateral) : ray.dlateral.norm();
    const double slope = at.gradient.x() * drho + at.gradient.y() * ray.dh;
    const double advance = at.value <= 0 ? 0.0 : at.value / -slope;
    if (at.value > 0 && !(slope < 0)) return std::nullopt;
    s += advance;
    if (advance <= 1e-15 * (1 + std::abs(s))) {
      const Vector3d outward = at.gradient.x() * radial + at.gradient.y() * ray.axis;
      return slope < 0 ? std::optional(Hit{s, outward.normalized()}) : std::nullopt;
    }
  }
  return std::nullopt;
}

/// Returns the entry of the whole line of the ray into the cutter.
/// @param least  lower bound of the entry, from which the iteration starts
std::optional<Hit> entry_at(const Cutter& cutter, const Position& at, const Vector3d& point,
                            const Vector3d& normal, double least) {
  const LocalRay ray(at, point, normal);
  const Interval cylinder = within_cylinder(ray, cutter.radius);
  const Interval slab = within_slab(ray, cutter.flank_length);
  const double s = std::max(cylinder.in, slab.in);
  const double out = std::min(cylinder.out, slab.out);
  if (!(s <= out)) return std::nullopt;
  if (cutter.outline) return outline_entry(*cutter.outline, ray, std::max(s, least));
  const bool through_end = slab.in >= cylinder.in;
  if (through_end && ray.dh < 0) return Hit{s, at.axis};
  const double ring = cutter.radius - cutter.corner_radius;
  if (through_end && std::isfinite(s) && ray.across(s).squaredNorm() <= ring * ring)
    return Hit{s, -at.axis};
  if (cutter.corner_radius == 0 || ray.height(s) >= cutter.corner_radius) {
    if (through_end) return Hit{s, -at.axis};
    return Hit{s, ray.across(s).normalized()};
  }
  if (ring == 0) {  // a ball: the torus is a sphere
    const Vector3d w = point - at.tip - cutter.radius * at.axis;
    const double wn = w.dot(normal);
    const double D = cutter.radius * cutter.radius - (w - wn * normal).squaredNorm();
    if (D < 0) return std::nullopt;
    const double in = -wn - std::sqrt(D);
    if (in > out) return std::nullopt;
    return Hit{in, (w + in * normal) / cutter.radius};
  }
  return corner_entry(cutter, ray, std::max(s, least), out);
}

/// A convex function of the position: the distance from the cutter, or less beside sharp edges;
/// negative inside.
struct SignedDistance {
  double value;
  Vector3d gradient;
};

SignedDistance signed_distance(const Cutter& cutter, const Position& at, const Vector3d& point) {
  const Vector3d p = point - at.tip;
  const double h = p.dot(at.axis);
  const Vector3d lateral = p - h * at.axis;
  const double rho = lateral.norm();
  const Vector3d radial = rho > 0 ? Vector3d(lateral / rho) : Vector3d::Zero();
  if (cutter.outline) {
    const OutlineDistance found = distance(*cutter.outline, {rho, h});
    return {found.value, found.gradient.x() * radial + found.gradient.y() * at.axis};
  }
  const double a = rho - (cutter.radius - cutter.corner_radius);
  const double b = cutter.corner_radius - h;
  SignedDistance body;
  if (a > 0 && b > 0) {
    const double length = std::hypot(a, b);
    body = {length - cutter.corner_radius, (a * radial - b * at.axis) / length};
  } else if (a > b) {
    body = {a - cutter.corner_radius, radial};
  } else {
    body = {b - cutter.corner_radius, -at.axis};
  }
  const double above = h - cutter.flank_length;
  const double beside = rho - cutter.radius;
  if (above > 0 && beside > 0) {
    const double length = std::hypot(beside, above);
    return {length, (beside * radial + above * at.axis) / length};
  }
  return above > body.value ? SignedDistance{above, at.axis} : body;
}

// The cutter over a move.

// The entry of one ray into a cutter as a function of time, with the bounds that the search needs.
class Sweep {
 public:
  /// @param least  lower bound of the entry at every instant
  Sweep(const Cutter& cutter, const Move& move, const Ray& ray, double least = -infinity)
      : cutter_(cutter),
        move_(move),
        ray_(ray),
        min_(least),
        omega_(move.angle * move.axis.cross(move.side)) {
    const double place =
        std::max({ray.point.lpNorm<Eigen::Infinity>(), move.tip.lpNorm<Eigen::Infinity>(),
                  move.step.lpNorm<Eigen::Infinity>(), ray.band});
    // 4e-16: two roundings of the largest coordinate that is subtracted
    rounding_ = 4e-16 * (place + cutter.radius + cutter.flank_length);
  }

  /// Returns the entry at instant t. A ray that starts inside the cutter enters at -band; a ray
  /// that leaves the cutter before it starts does not meet it.
  Sample entry(double t) const {
    Sample sample = undefined_at(t);
    const Position at = position(move_, t);
    const std::optional<Hit> hit = entry_at(cutter_, at, ray_.point, ray_.normal, min_);
    if (!hit) return sample;
    if (hit->s <= -ray_.band) {
      sample.defined =
          signed_distance(cutter_, at, ray_.point - ray_.band * ray_.normal).value <= 0;
      sample.value = sample.defined ? -ray_.band : infinity;
      return sample;
    }
    sample.defined = true;
    sample.value = hit->s;
    const double facing = std::max(-hit->outward.dot(ray_.normal), min_sine);
    const Vector3d arm = ray_.point + hit->s * ray_.normal - at.tip;
    sample.slope = -hit->outward.dot(velocity(arm)) / facing;
    sample.dip = dip(hit->outward, arm, sample.slope * ray_.normal) / facing;
    sample.fade = move_.angle / facing;
    sample.outward = hit->outward;
    sample.facing = facing;
    sample.doubt = (rounding_ + 4e-16 * std::abs(hit->s)) / facing;
    return sample;
  }

  /// Returns the smallest signed distance that the ray reaches at instant t within its band: <= 0
  /// if it meets the cutter.
  Sample depth_reached(double t) const {
    const Position at = position(move_, t);
    const Nearest nearest = nearest_on_ray(at);
    const Vector3d arm = ray_.point + nearest.s * ray_.normal - at.tip;
    return {t, true,     nearest.depth,   -nearest.outward.dot(velocity(arm)),
            0, infinity, nearest.outward, 1};
  }

  /// Returns the smallest entry over the move, which is expected near `about`.
  Sample first(double limit, double about) const {
    const double tolerance = move_.angle > 0 ? turning_tolerance : straight_tolerance;
    const Goal goal{tolerance, limit, -ray_.band};
    // A cutter that moves without turning sweeps a convex body, which a ray enters only once.
    const auto beyond_gap = [this](double from, double to, const Goal& towards) {
      return move_.angle > 0 ? min_between(from, to, towards) : undefined_at(from);
    };
    const auto f = [this](double t) { return entry(t); };
    const auto floor = [this](const Piece& piece) { return entry_floor(piece); };
    const Sample found = minimum_about(f, floor, beyond_gap, move_.from, about, move_.to, goal);
    return found.defined ? found : min_between(move_.from, move_.to, goal);
  }

 private:
  /// The point of the ray within its band that is nearest to the standing cutter, or a point inside
  /// it.
  struct Nearest {
    double s;
    double depth;
    /// Unit; the normal of a plane that touches the cutter and separates it from the ray.
    Vector3d outward;
  };

  /// The distance is convex along the ray, so the tangents on both sides of its minimum bound it.
  /// The weighted mean of their normals that is perpendicular to the ray is the normal of a plane
  /// at the same distance. The normal at a single point may lean along the ray, which would weaken
  /// a bound by `band` times the lean.
  Nearest nearest_on_ray(const Position& at) const {
    struct Along {
      double s, depth, slope;
      Vector3d outward;
    };
    const auto along = [&](double s) {
      const SignedDistance d = signed_distance(cutter_, at, ray_.point + s * ray_.normal);
      return Along{s, d.value, d.gradient.dot(ray_.normal), d.gradient};
    };
    Along a = along(-ray_.band);
    if (a.slope >= 0 || a.depth <= -depth_tolerance) return {a.s, a.depth, a.outward};
    Along b = along(ray_.band);
    if (b.slope <= 0 || b.depth <= -depth_tolerance) return {b.s, b.depth, b.outward};
    for (int i = 0; i < 200; ++i) {
      const double w = b.s - a.s;
      const double turn = b.slope - a.slope;
      const double crossing = (a.depth - b.depth + b.slope * w) / turn;
      const double low = a.depth + a.slope * crossing;
      if (low >= std::min(a.depth, b.depth) - 0.1 * depth_tolerance || w < 1e-13) break;
      const bool smooth = std::abs(crossing - 0.5 * w) < 0.1 * w;
      // As in next_sample: the secant for a smooth minimum, the crossing of the tangents for a
      // kink.
      const double inner = i % 4 == 3 ? 0.5 * w : smooth ? -w * a.slope / turn : crossing;
      const Along c = along(a.s + std::clamp(inner, 1e-4 * w, (1 - 1e-4) * w));
      if (c.slope == 0 || c.depth <= -depth_tolerance) return {c.s, c.depth, c.outward};
      (c.slope < 0 ? a : b) = c;
    }
    const Along& best = a.depth <= b.depth ? a : b;
    return {best.s, best.depth, (b.slope * a.outward - a.slope * b.outward).normalized()};
  }

  /// Returns the smallest entry between two instants, without an estimate of its time. If the ray
  /// misses the cutter at both ends, the depth is minimised first to find an instant at which it is
  /// met.
  Sample min_between(double from, double to, const Goal& goal) const {
    const auto f = [this](double t) { return entry(t); };
    const auto floor = [this](const Piece& piece) { return entry_floor(piece); };
    const Sample a = entry(from);
    const Sample b = entry(to);
    if (a.defined || b.defined) return minimum(f, floor, a, b, goal);
    const auto g = [this](double t) { return depth_reached(t); };
    const auto g_floor = [this](const Piece& piece) { return depth_floor(piece); };
    const Sample inside = minimum(g, g_floor, g(from), g(to),
                                  {.tolerance = depth_tolerance, .limit = 0.0, .enough = 0.0});
    if (inside.value > 0) return a;
    const Sample c = entry(inside.t);
    if (!c.defined) return c;
    const Sample left = minimum(f, floor, a, c, goal);
    const Sample right = minimum(f, floor, c, b, goal);
    return right.value < left.value ? right : left;
  }

  /// Lower bound of the distance from the cutter to the ray's point along m at instant t. Rounding:
  /// with e = 2^-53 and D the larger of the distances of the ray's point and of the cutter's
  /// farthest point from the tip, the products contribute 8 e D, and |m x axis|, as the norm of a
  /// cross product, 7 e R; a difference of squares would lose up to 1e-8 R.
  struct Clearance {
    double value;
    double rise;  // component of m along the axis
  };
  Clearance clearance(const Vector3d& m, double t) const {
    const Position at = position(move_, t);
    const Vector3d p = ray_.point - at.tip;
    const double rise = m.dot(at.axis);
    const double far = std::max(cutter_.radius + cutter_.flank_length, p.lpNorm<1>());
    return {m.dot(p) - support(cutter_, rise, m.cross(at.axis).norm()) - 4e-15 * far - rounding_,
            rise};
  }

  /// Returns a line below that clearance over a piece, where m is the cutter's normal at its end
  /// `touching`. Between the ends, the point of the cutter that is foremost along m departs from
  /// its chord by arm turn^2 / 2 times x (1 - x). The arm is its component along m: R if m points
  /// down the axis, R + flank at most. Because x (1 - x) <= x, a line that falls from the touching
  /// end is a bound.
  Line clearance(const Vector3d& m, const Piece& piece, const Sample& touching) const {
    const double turn = move_.angle * (piece.b.t - piece.a.t);
    const Clearance a = clearance(m, piece.a.t);
    const Clearance b = clearance(m, piece.b.t);
    const double arm =
        cutter_.radius + (std::max(a.rise, b.rise) > -turn ? cutter_.flank_length : 0.0);
    // 0.51 instead of 0.5 covers the rounding
    const double lower = 0.51 * arm * turn * turn;
    return &touching == &piece.a ? Line{a.value, b.value - lower} : Line{a.value - lower, b.value};
  }

  /// Returns a lower bound of the entry over a piece, from the planes that touch the cutter at its
  /// ends. The rounding of `facing` has its effect up to the end of the band.
  PieceBound entry_floor(const Piece& piece) const {
    const auto line = [&](const Sample& end) {
      if (end.facing <= min_sine) return Line{-1e300, -1e300};
      const Line clear = clearance(end.outward, piece, end);
      const double lower = 4e-16 * ray_.band;
      return Line{(clear.at_a - lower) / end.facing, (clear.at_b - lower) / end.facing};
    };
    const Line first = line(piece.a.defined ? piece.a : piece.b);
    const bool both = piece.a.defined && piece.b.defined;
    return min_above(piece, first, both ? line(piece.b) : first);
  }
  // Returns the corresponding lower bound of the depth.
  PieceBound depth_floor(const Piece& piece) const {
    const auto line = [&](const Sample& end) {
      const Line clear = clearance(end.outward, piece, end);
      const double along = ray_.band * std::abs(end.outward.dot(ray_.normal));
      return Line{clear.at_a - along, clear.at_b - along};
    };
    return min_above(piece, line(piece.a), line(piece.b));
  }

  /// Returns the velocity per unit t of the cutter's material at `arm` from the tip.
  Vector3d velocity(const Vector3d& arm) const { return move_.step + omega_.cross(arm); }

  /// Returns a bound of how strongly the turning of the frame bends the entry downwards: the
  /// acceleration, in the frame of the cutter, of a point that moves at `v`, against the normal. A
  /// quarter of its magnitude is added because the normal varies within the move.
  double dip(const Vector3d& outward, const Vector3d& arm, const Vector3d& v) const {
    if (move_.angle == 0) return 0.0;
    const Vector3d acceleration =
        omega_.cross(omega_.cross(arm)) - 2.0 * omega_.cross(v - move_.step);
    return std::max(0.0, -outward.dot(acceleration)) + 0.25 * acceleration.norm();
  }

  const Cutter& cutter_;
  const Move& move_;
  const Ray& ray_;
  double min_;       // mm along the ray, lower bound of the entry
  Vector3d omega_;   // rad per unit t
  double rounding_;  // mm, of a point relative to the tip: an ulp or two of the coordinates
};

}  // namespace

std::optional<double> standing_entry(const Cutter& cutter, const Move& move, double t,
                                     const Ray& ray, float least) {
  const Sample sample = Sweep(cutter, move, ray, double(least)).entry(t);
  return sample.defined ? std::optional(sample.value) : std::nullopt;
}

double depth(const Cutter& cutter, const Move& move, double t, const Vector3d& place) {
  return -signed_distance(cutter, position(move, t), place).value;
}

Move move_after(const CutterMotion& motion, int index) {
  const int next = std::min<int>(index + 1, int(motion.tip.rows()) - 1);
  Move move;
  move.tip = motion.tip.row(index);
  move.step = motion.tip.row(next).transpose() - move.tip;
  move.axis = motion.axis.row(index);
  const Vector3d target = motion.axis.row(next);
  const Vector3d across = target - target.dot(move.axis) * move.axis;
  const double sine = across.norm();
  if (sine < 1e-15) {  // rounding of a direction that stands still
    move.side = move.axis.unitOrthogonal();
    return move;
  }
  move.side = across / sine;
  const double cosine = target.dot(move.axis);
  if (sine < 0.05 && cosine > 0) {  // the truncated series of the arc sine is exact to rounding
                                    // here
    const double y = sine * sine;
    const double more = 3.0 / 40 + y * (15.0 / 336 + y * 105.0 / 3456);
    move.angle = sine * (1 + y * (1.0 / 6 + y * more));
  } else {
    move.angle = std::atan2(sine, cosine);
  }
  return move;
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit) {
  if (cutter.corner_radius == cutter.radius) {
    const BallEntry answer = ball_entry(cutter, move, ray, limit);
    if (answer.decided)
      return answer.entry && answer.entry->s <= limit ? answer.entry : std::nullopt;
  }
  // Single rays use the eight-lane bounds too, so that the search starts from the same values, and
  // ends with the same bits, as in a joint search.
  const MoveEndpoints ends = ends_of(move);
  Move8 eight;
  for (int lane = 0; lane < Move8::width; ++lane) eight.put(lane, cutter, ends);
  EntryBounds bound;
  entry_bounds(cutter, eight, {&ray, 1}, {&bound, 1});
  if (double(bound.least[0]) > limit) return std::nullopt;
  const Vector3d m(bound.m[0][0], bound.m[1][0], bound.m[2][0]);
  if (min_entry(cutter, ends, ray, m) > limit) return std::nullopt;
  return first_entry(cutter, move, ray, limit, bound.part[0], bound.least[0]);
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit, float part, float least) {
  const double about = instant(move, part);
  const Sample sample = Sweep(cutter, move, ray, double(least)).first(limit, about);
  if (!sample.defined || sample.value > limit) return std::nullopt;
  return Entry{sample.value, sample.t};
}

}  // namespace abbe::cutting
