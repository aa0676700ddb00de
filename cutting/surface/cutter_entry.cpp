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

/// The first entry of a ray into a moving cutter is the minimum of a function of time that is
/// convex except for a bounded concavity. Branch and bound finds the minimum.
namespace abbe::cutting {

using Eigen::Vector3d;

/// A value of the function with its slope, and a bound of the concavity nearby.
struct Sample {
  double t;
  bool is_defined;  ///< the function is +infinity where it is not defined
  double value;
  double slope;
  double concavity;   ///< curvature >= -concavity; 0 where the function is convex
  double decay_rate;  ///< valid range of `concavity`: time differences well below 1 / decay_rate
  Eigen::Vector3d outward;  ///< normal of the cutter, used by a `plane_bound`
  double cosine;            ///< -outward * normal of the ray
  double error_bound = 0;   ///< the value may be too large by this much, from rounding

  // Returns the concavity valid over a time difference w: the cosine falls by a fraction of up to
  // decay_rate w, and the concavity contains its inverse square.
  double concavity_over(double w) const {
    return concavity / ((1 - decay_rate * w) * (1 - decay_rate * w));
  }
};

inline Sample undefined_at(double t) {
  return {t, false, std::numeric_limits<double>::infinity(), 0, 0, 0, Eigen::Vector3d::Zero(), 1};
}

// Accuracy and stopping conditions of a search.
struct SearchGoal {
  double tolerance;
  /// Larger values need not be found.
  double limit = std::numeric_limits<double>::infinity();
  /// A value as small as this ends the search.
  double target = -std::numeric_limits<double>::infinity();
  int max_samples = 5000;  ///< 3 to 12 are needed; hundreds for a disc of zero height that a ray
                           ///< grazes
};

// An interval of time between two samples, with the number of divisions that led to it.
struct TimeInterval {
  Sample a, b;
  int level;
};

/// A lower bound of the function over an interval, and the time at which it is attained.
struct IntervalBound {
  double value;
  double t;
};

/// A linear function over an interval, given by its values at the ends.
struct Line {
  double value_a, value_b;
};

/// Returns the minimum, and its time, of the upper envelope of two lines over an interval.
inline IntervalBound envelope_minimum(const TimeInterval& interval, const Line& first,
                                      const Line& second) {
  const auto upper_envelope = [&](double x) {
    return std::max(first.value_a + x * (first.value_b - first.value_a),
                    second.value_a + x * (second.value_b - second.value_a));
  };
  const double difference_a = first.value_a - second.value_a;
  const double difference_b = first.value_b - second.value_b;
  double x = upper_envelope(0.0) <= upper_envelope(1.0) ? 0.0 : 1.0;
  if (difference_a * difference_b < 0) {
    const double crossing = difference_a / (difference_a - difference_b);
    if (upper_envelope(crossing) < upper_envelope(x)) x = crossing;
  }
  const double width = interval.b.t - interval.a.t;
  return {upper_envelope(x), interval.a.t + (x == 0.0 || x == 1.0 ? 0.5 : x) * width};
}

/// Returns a lower bound over an interval. f + concavity (t - a)^2 / 2 is convex, so it lies above
/// its tangents at both ends. If the concavity is not valid over the whole interval, returns
/// `plane_bound(interval)`.
template <class PlaneBound>
IntervalBound interval_lower_bound(const TimeInterval& interval, double tolerance,
                                   const PlaneBound& plane_bound) {
  const auto& [a, b, level] = interval;
  const double width = b.t - a.t;
  const double middle = a.t + 0.5 * width;
  const bool is_valid = std::max(a.decay_rate, b.decay_rate) * width < 0.5;
  if (!a.is_defined || !b.is_defined) {
    if (!is_valid) return plane_bound(interval);
    const Sample& known_end = a.is_defined ? a : b;
    const double far_value = known_end.value + (a.is_defined ? 1 : -1) * known_end.slope * width -
                             0.5 * known_end.concavity_over(width) * width * width;
    return {std::min(known_end.value, far_value) - known_end.error_bound, middle};
  }
  if (!is_valid) return plane_bound(interval);
  const double concavity = std::max(a.concavity_over(width), b.concavity_over(width));
  const double value_a = a.value - a.error_bound;
  const double value_b = b.value - b.error_bound + 0.5 * concavity * width * width;
  const double slope_b = b.slope + concavity * width;
  const double gap_at_b = value_b - value_a - a.slope * width;
  const double gap_at_a = value_a - value_b + slope_b * width;
  const double slack = tolerance + a.error_bound + b.error_bound;
  // The samples contradict the concavity by more than rounding, so it cannot be used.
  if (gap_at_b < -slack || gap_at_a < -slack) return plane_bound(interval);
  // More samples would not remove the rounding at the lower end of a monotonic interval, so its
  // value is returned as it is.
  if (a.slope >= 0.5 * concavity * width) return {a.value, a.t};
  if (b.slope <= -0.5 * concavity * width) return {b.value, b.t};
  const double slope_change = slope_b - a.slope;
  const double x = slope_change > 0 ? std::clamp(gap_at_a / slope_change, 0.0, width) : 0.5 * width;
  const double inner_value = value_a + a.slope * x - 0.5 * concavity * x * x;
  return {std::min({value_a, b.value - b.error_bound, inner_value}), a.t + x};
}

// Returns the time of the next sample in an interval.
inline double next_sample(const TimeInterval& interval, const IntervalBound& bound) {
  const auto& [a, b, level] = interval;
  const double width = b.t - a.t;
  if (!a.is_defined || !b.is_defined || bound.value == -std::numeric_limits<double>::infinity())
    return bound.t;
  if (a.slope < 0 && b.slope > 0) {
    const double secant = a.t + width * a.slope / (a.slope - b.slope);
    // For a parabola the tangents meet in the middle and the secant of the slopes gives its
    // minimum; for a kink the tangents meet at the kink. Every fourth step halves the interval,
    // which also handles functions that are neither.
    if (level % 4 == 3) return a.t + 0.5 * width;
    const bool is_smooth = std::abs(bound.t - a.t - 0.5 * width) < 0.1 * width;
    return std::clamp(is_smooth ? secant : bound.t, a.t + 1e-4 * width, b.t - 1e-4 * width);
  }
  // The minimum lies near the lower end. Intervals split off grow by a factor of 16 with their
  // distance from that end, so few samples are spent far away.
  return a.value <= b.value ? a.t + width / 16 : b.t - width / 16;
}

/// Search for the minimum with a stack of the intervals that may contain a value below the best
/// sample so far.
template <class Function, class PlaneBound>
class BranchAndBound {
 public:
  BranchAndBound(const Function& f, const PlaneBound& plane_bound, const SearchGoal& goal,
                 const Sample& best)
      : f_(f), plane_bound_(plane_bound), goal_(goal), best_(best) {}

  bool is_finished() const { return best_.value <= goal_.target; }
  void update(const Sample& sample) {
    if (sample.is_defined && sample.value < best_.value) best_ = sample;
  }
  Sample sample(double t) {
    const Sample sample = f_(t);
    update(sample);
    return sample;
  }
  bool is_ruled_out(const TimeInterval& interval) const {
    return is_ruled_out(interval, lower_bound(interval));
  }
  /// Weaker test without the cost of the bound by planes.
  bool is_clearly_ruled_out(const TimeInterval& interval) const {
    return !can_improve(lower_bound(interval).value);
  }
  void push(const TimeInterval& interval) { stack_[count_++] = interval; }

  Sample run() {
    for (int samples = 0; count_ > 0 && samples < goal_.max_samples && !is_finished();) {
      const TimeInterval interval = stack_[--count_];
      const IntervalBound bound = lower_bound(interval);
      if (is_ruled_out(interval, bound)) continue;
      // 1e-13 of a move is the rounding of time. A full stack means that this width is reached,
      // too.
      if (interval.b.t - interval.a.t < 1e-13 || count_ + 2 > stack_.size()) continue;
      const Sample middle = sample(next_sample(interval, bound));
      ++samples;
      if (middle.is_defined || interval.a.is_defined)
        push({interval.a, middle, interval.level + 1});
      if (middle.is_defined || interval.b.is_defined)
        push({middle, interval.b, interval.level + 1});
    }
    return best_;
  }

 private:
  IntervalBound lower_bound(const TimeInterval& interval) const {
    return interval_lower_bound(interval, goal_.tolerance, plane_bound_);
  }
  bool can_improve(double value) const {
    return !(value >= std::min(best_.value - goal_.tolerance, goal_.limit));
  }
  /// The bound by concavity is cheap; the bound by planes is tighter but costs more, so it comes
  /// second.
  bool is_ruled_out(const TimeInterval& interval, const IntervalBound& bound) const {
    if (!can_improve(bound.value)) return true;
    return std::max(interval.a.concavity, interval.b.concavity) > 0 &&
           !can_improve(plane_bound_(interval).value);
  }

  const Function& f_;
  const PlaneBound& plane_bound_;
  const SearchGoal& goal_;
  Sample best_;
  std::array<TimeInterval, 64> stack_;
  std::size_t count_ = 0;
};

/// Returns the smallest value of f between two samples.
template <class Function, class PlaneBound>
Sample minimum(const Function& f, const PlaneBound& plane_bound, const Sample& first,
               const Sample& last, const SearchGoal& goal) {
  const bool is_last_smaller = last.is_defined && (!first.is_defined || last.value < first.value);
  BranchAndBound search(f, plane_bound, goal, is_last_smaller ? last : first);
  search.push({first, last, 0});
  return search.run();
}

/// Returns the minimum of f from `from` to `to`, which must be known to lie near `expected_time`;
/// returns an undefined sample if f is undefined at that time. Usually takes three samples: at
/// `expected_time` and on either side.
/// @param search_gap  returns the minimum between two times for a goal; called for the far side of
/// a
///                    gap in f that is not ruled out
template <class Function, class PlaneBound, class GapSearch>
Sample minimum_near(const Function& f, const PlaneBound& plane_bound, const GapSearch& search_gap,
                    double from, double expected_time, double to, const SearchGoal& goal) {
  const Sample centre = f(expected_time);
  BranchAndBound search(f, plane_bound, goal, centre);
  if (!centre.is_defined || search.is_finished()) return centre;
  const auto interval = [](const Sample& first, const Sample& second) {
    return first.t < second.t ? TimeInterval{first, second, 0} : TimeInterval{second, first, 0};
  };
  for (const double end : {from, to}) {
    if (search.is_finished()) break;
    if (end == expected_time || search.is_clearly_ruled_out(interval(centre, undefined_at(end))))
      continue;
    const double direction = end < expected_time ? -1.0 : 1.0;
    double step = (std::abs(centre.slope) < centre.concavity ? 4e-3 : 3e-4) * (to - from);
    Sample previous = centre;
    do {
      const double time = std::clamp(previous.t + direction * step, from, to);
      const Sample neighbour = search.sample(time);
      search.push(interval(previous, neighbour));
      if (!neighbour.is_defined) {
        if (time != end && !search.is_ruled_out(interval(previous, undefined_at(end))))
          search.update(search_gap(std::min(time, end), std::max(time, end), goal));
        break;
      }
      // The next step is at least eight times as long, and 1.5 times the distance to the zero of
      // the extrapolated slope.
      const double curvature = (neighbour.slope - previous.slope) / (neighbour.t - previous.t);
      step =
          std::max(8.0 * step, curvature > 0 ? 1.5 * std::abs(neighbour.slope) / curvature : 0.0);
      previous = neighbour;
    } while (previous.t != end && !search.is_ruled_out(interval(previous, undefined_at(end))));
  }
  return search.run();
}

namespace {

constexpr double straight_tolerance = 1e-9;  // mm, if the axis does not turn and the search is
                                             // convex
constexpr double turning_tolerance = 2e-8;   // mm, if the axis turns
constexpr double depth_tolerance = 1e-10;    // mm, depth of a touch that may be missed
constexpr double min_sine = 1e-15;           // a smaller sine between ray and skin is rounding

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

  LocalRay(const CutterPose& pose, const Vector3d& point, const Vector3d& normal)
      : axis(pose.axis) {
    const Vector3d p = point - pose.tip;
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

// Returns the range of s inside an infinite cylinder. A ray whose squared lateral component is
// below 1e-30 is parallel to the axis.
Interval within_cylinder(const LocalRay& ray, double radius) {
  const double a = ray.dlateral.squaredNorm();
  const double b = ray.lateral.dot(ray.dlateral);
  const double c = ray.lateral.squaredNorm() - radius * radius;
  if (a < 1e-30) return c <= 0 ? Interval{} : Interval{infinity, -infinity};
  const double nearest = -b / a;
  const double squared_half_length = (radius * radius - ray.across(nearest).squaredNorm()) / a;
  if (squared_half_length < 0) return {infinity, -infinity};
  const double half_length = std::sqrt(squared_half_length);
  return {nearest - half_length, nearest + half_length};
}

Interval within_slab(const LocalRay& ray, double top) {
  if (ray.dh == 0) return ray.h >= 0 && ray.h <= top ? Interval{} : Interval{infinity, -infinity};
  const double at_bottom = -ray.h / ray.dh;
  const double at_top = (top - ray.h) / ray.dh;
  return {std::min(at_bottom, at_top), std::max(at_bottom, at_top)};
}

/// Returns the entry into the torus corner, from a start s outside it, below the flank and within
/// the outer cylinder. Each step replaces the ring by its tangent line; the tube about that line
/// contains the torus, so the steps approach from outside and never pass the root.
std::optional<Hit> corner_entry(const Cutter& cutter, const LocalRay& ray, double s, double out) {
  const double r = cutter.corner_radius;
  const double ring_radius = cutter.radius - r;
  // The last iterate is accepted: it approaches from outside and never passes the root.
  constexpr int last_iteration = 39;
  for (int i = 0; i <= last_iteration; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const double drho = rho > 0 ? across.dot(ray.dlateral) / rho : ray.dlateral.norm();
    const double a = rho - ring_radius;
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
    const bool is_grazing = D < 1e-4 * B * B;
    if (advance < (is_grazing ? 1e-14 * (1 + std::abs(s)) : 1e-9) || i == last_iteration) {
      const double radial_weight = rho > 0 ? std::max(a, 0.0) / rho : 0.0;
      return Hit{s, (radial_weight * across - b * ray.axis).normalized()};
    }
  }
  return std::nullopt;
}

/// Returns the entry into an outline from a start s outside it. The distance from an outline is
/// convex along the ray, so no step of Newton's method passes the root.
std::optional<Hit> outline_entry(const ToolOutline& outline, const LocalRay& ray, double s) {
  for (int i = 0; i < 100; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const Vector3d radial = rho > 0 ? Vector3d(across / rho) : Vector3d::Zero();
    const OutlineDistance skin_distance = distance(outline, {rho, ray.height(s)});
    const double drho = rho > 0 ? radial.dot(ray.dlateral) : ray.dlateral.norm();
    const double slope = skin_distance.gradient.x() * drho + skin_distance.gradient.y() * ray.dh;
    const double advance = skin_distance.value <= 0 ? 0.0 : skin_distance.value / -slope;
    if (skin_distance.value > 0 && !(slope < 0)) return std::nullopt;
    s += advance;
    if (advance <= 1e-15 * (1 + std::abs(s))) {
      const Vector3d outward =
          skin_distance.gradient.x() * radial + skin_distance.gradient.y() * ray.axis;
      return slope < 0 ? std::optional(Hit{s, outward.normalized()}) : std::nullopt;
    }
  }
  return std::nullopt;
}

/// Returns the entry of the whole line of the ray into the cutter.
/// @param least  lower bound of the entry, from which the iteration starts
std::optional<Hit> ray_entry(const Cutter& cutter, const CutterPose& pose, const Vector3d& point,
                             const Vector3d& normal, double min_s) {
  const LocalRay ray(pose, point, normal);
  const Interval cylinder = within_cylinder(ray, cutter.radius);
  const Interval slab = within_slab(ray, cutter.flank_length);
  const double s = std::max(cylinder.in, slab.in);
  const double out = std::min(cylinder.out, slab.out);
  if (!(s <= out)) return std::nullopt;
  if (cutter.outline) return outline_entry(*cutter.outline, ray, std::max(s, min_s));
  const bool enters_through_end = slab.in >= cylinder.in;
  if (enters_through_end && ray.dh < 0) return Hit{s, pose.axis};
  const double ring_radius = cutter.radius - cutter.corner_radius;
  if (enters_through_end && std::isfinite(s) &&
      ray.across(s).squaredNorm() <= ring_radius * ring_radius)
    return Hit{s, -pose.axis};
  if (cutter.corner_radius == 0 || ray.height(s) >= cutter.corner_radius) {
    if (enters_through_end) return Hit{s, -pose.axis};
    return Hit{s, ray.across(s).normalized()};
  }
  if (ring_radius == 0) {  // a ball: the torus is a sphere
    const Vector3d w = point - pose.tip - cutter.radius * pose.axis;
    const double wn = w.dot(normal);
    const double D = cutter.radius * cutter.radius - (w - wn * normal).squaredNorm();
    if (D < 0) return std::nullopt;
    const double sphere_entry = -wn - std::sqrt(D);
    if (sphere_entry > out) return std::nullopt;
    return Hit{sphere_entry, (w + sphere_entry * normal) / cutter.radius};
  }
  return corner_entry(cutter, ray, std::max(s, min_s), out);
}

/// A convex function of position: the distance from the cutter, or less beside sharp edges,
/// negative inside; with its gradient.
struct SignedDistance {
  double value;
  Vector3d gradient;
};

SignedDistance signed_distance(const Cutter& cutter, const CutterPose& pose,
                               const Vector3d& point) {
  const Vector3d p = point - pose.tip;
  const double h = p.dot(pose.axis);
  const Vector3d lateral = p - h * pose.axis;
  const double rho = lateral.norm();
  const Vector3d radial = rho > 0 ? Vector3d(lateral / rho) : Vector3d::Zero();
  if (cutter.outline) {
    const OutlineDistance skin_distance = distance(*cutter.outline, {rho, h});
    return {skin_distance.value,
            skin_distance.gradient.x() * radial + skin_distance.gradient.y() * pose.axis};
  }
  const double a = rho - (cutter.radius - cutter.corner_radius);
  const double b = cutter.corner_radius - h;
  SignedDistance body;
  if (a > 0 && b > 0) {
    const double length = std::hypot(a, b);
    body = {length - cutter.corner_radius, (a * radial - b * pose.axis) / length};
  } else if (a > b) {
    body = {a - cutter.corner_radius, radial};
  } else {
    body = {b - cutter.corner_radius, -pose.axis};
  }
  const double above_top = h - cutter.flank_length;
  const double beside_flank = rho - cutter.radius;
  if (above_top > 0 && beside_flank > 0) {
    const double length = std::hypot(beside_flank, above_top);
    return {length, (beside_flank * radial + above_top * pose.axis) / length};
  }
  return above_top > body.value ? SignedDistance{above_top, pose.axis} : body;
}

// The cutter over a move.

// The entry of one ray into a cutter as a function of time, with the bounds required by the search.
class EntryFunction {
 public:
  /// @param least  lower bound of the entry at every instant
  EntryFunction(const Cutter& cutter, const Move& move, const Ray& ray, double min_s = -infinity)
      : cutter_(cutter),
        move_(move),
        ray_(ray),
        min_(min_s),
        omega_(move.angle * move.axis.cross(move.side)) {
    const double max_coordinate =
        std::max({ray.point.lpNorm<Eigen::Infinity>(), move.tip.lpNorm<Eigen::Infinity>(),
                  move.step.lpNorm<Eigen::Infinity>(), ray.band});
    // 4e-16 is two roundings of the largest coordinate in a difference.
    rounding_ = 4e-16 * (max_coordinate + cutter.radius + cutter.flank_length);
  }

  /// Returns the entry at instant t. A ray that starts inside the cutter enters at -band. A ray
  /// whose line leaves the cutter before the ray starts has no entry.
  Sample entry(double t) const {
    Sample sample = undefined_at(t);
    const CutterPose pose = cutter_pose(move_, t);
    const std::optional<Hit> hit = ray_entry(cutter_, pose, ray_.point, ray_.normal, min_);
    if (!hit) return sample;
    if (hit->s <= -ray_.band) {
      sample.is_defined =
          signed_distance(cutter_, pose, ray_.point - ray_.band * ray_.normal).value <= 0;
      sample.value = sample.is_defined ? -ray_.band : infinity;
      return sample;
    }
    sample.is_defined = true;
    sample.value = hit->s;
    const double cosine = std::max(-hit->outward.dot(ray_.normal), min_sine);
    const Vector3d from_tip = ray_.point + hit->s * ray_.normal - pose.tip;
    sample.slope = -hit->outward.dot(velocity(from_tip)) / cosine;
    sample.concavity = concavity(hit->outward, from_tip, sample.slope * ray_.normal) / cosine;
    sample.decay_rate = move_.angle / cosine;
    sample.outward = hit->outward;
    sample.cosine = cosine;
    sample.error_bound = (rounding_ + 4e-16 * std::abs(hit->s)) / cosine;
    return sample;
  }

  /// Returns the minimum signed distance between the ray within its band and the cutter at instant
  /// t; not positive if the ray meets the cutter.
  Sample min_distance(double t) const {
    const CutterPose pose = cutter_pose(move_, t);
    const NearestPoint nearest = nearest_point(pose);
    const Vector3d from_tip = ray_.point + nearest.s * ray_.normal - pose.tip;
    return {t, true,     nearest.depth,   -nearest.outward.dot(velocity(from_tip)),
            0, infinity, nearest.outward, 1};
  }

  /// Returns the smallest entry over the move, which is probably near `expected_time`.
  Sample smallest_entry(double limit, double expected_time) const {
    const double tolerance = move_.angle > 0 ? turning_tolerance : straight_tolerance;
    const SearchGoal goal{tolerance, limit, -ray_.band};
    // A cutter that moves without turning sweeps a convex body, which a ray enters only once.
    const auto search_gap = [this](double from, double to, const SearchGoal& gap_goal) {
      return move_.angle > 0 ? min_between(from, to, gap_goal) : undefined_at(from);
    };
    const auto entry_function = [this](double t) { return entry(t); };
    const auto plane_bound = [this](const TimeInterval& interval) {
      return entry_plane_bound(interval);
    };
    const Sample result = minimum_near(entry_function, plane_bound, search_gap, move_.from,
                                       expected_time, move_.to, goal);
    return result.is_defined ? result : min_between(move_.from, move_.to, goal);
  }

 private:
  /// The point of the ray within its band nearest to the cutter at an instant, or a point inside
  /// the cutter.
  struct NearestPoint {
    double s;
    double depth;
    /// Unit; the normal of a plane that touches the cutter and separates it from the ray.
    Vector3d outward;
  };

  /// Returns the nearest point. The distance is convex along the ray, so the tangents on both sides
  /// of its minimum bound it. The weighted mean of their normals that is perpendicular to the ray
  /// is the normal of a plane at the same distance. The normal at a single point may lean along the
  /// ray, which would weaken a bound by `band` times the lean.
  NearestPoint nearest_point(const CutterPose& pose) const {
    struct RayPoint {
      double s, depth, slope;
      Vector3d outward;
    };
    const auto evaluate = [&](double s) {
      const SignedDistance d = signed_distance(cutter_, pose, ray_.point + s * ray_.normal);
      return RayPoint{s, d.value, d.gradient.dot(ray_.normal), d.gradient};
    };
    RayPoint a = evaluate(-ray_.band);
    if (a.slope >= 0 || a.depth <= -depth_tolerance) return {a.s, a.depth, a.outward};
    RayPoint b = evaluate(ray_.band);
    if (b.slope <= 0 || b.depth <= -depth_tolerance) return {b.s, b.depth, b.outward};
    for (int i = 0; i < 200; ++i) {
      const double w = b.s - a.s;
      const double slope_change = b.slope - a.slope;
      const double crossing = (a.depth - b.depth + b.slope * w) / slope_change;
      const double tangent_minimum = a.depth + a.slope * crossing;
      if (tangent_minimum >= std::min(a.depth, b.depth) - 0.1 * depth_tolerance || w < 1e-13) break;
      const bool is_smooth = std::abs(crossing - 0.5 * w) < 0.1 * w;
      // As in next_sample: the secant for a smooth minimum, the crossing of the tangents for a
      // kink.
      const double offset = i % 4 == 3  ? 0.5 * w
                            : is_smooth ? -w * a.slope / slope_change
                                        : crossing;
      const RayPoint middle = evaluate(a.s + std::clamp(offset, 1e-4 * w, (1 - 1e-4) * w));
      if (middle.slope == 0 || middle.depth <= -depth_tolerance)
        return {middle.s, middle.depth, middle.outward};
      (middle.slope < 0 ? a : b) = middle;
    }
    const RayPoint& best = a.depth <= b.depth ? a : b;
    return {best.s, best.depth, (b.slope * a.outward - a.slope * b.outward).normalized()};
  }

  /// Returns the smallest entry between two instants, without an estimate of its time. If the ray
  /// misses the cutter at both instants, first minimises the distance to find an instant at which
  /// they meet.
  Sample min_between(double from, double to, const SearchGoal& goal) const {
    const auto entry_function = [this](double t) { return entry(t); };
    const auto plane_bound = [this](const TimeInterval& interval) {
      return entry_plane_bound(interval);
    };
    const Sample a = entry(from);
    const Sample b = entry(to);
    if (a.is_defined || b.is_defined) return minimum(entry_function, plane_bound, a, b, goal);
    const auto distance_function = [this](double t) { return min_distance(t); };
    const auto distance_bound = [this](const TimeInterval& interval) {
      return distance_plane_bound(interval);
    };
    const Sample deepest =
        minimum(distance_function, distance_bound, distance_function(from), distance_function(to),
                {.tolerance = depth_tolerance, .limit = 0.0, .target = 0.0});
    if (deepest.value > 0) return a;
    const Sample middle = entry(deepest.t);
    if (!middle.is_defined) return middle;
    const Sample before = minimum(entry_function, plane_bound, a, middle, goal);
    const Sample after = minimum(entry_function, plane_bound, middle, b, goal);
    return after.value < before.value ? after : before;
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
    const CutterPose pose = cutter_pose(move_, t);
    const Vector3d p = ray_.point - pose.tip;
    const double rise = m.dot(pose.axis);
    const double max_length = std::max(cutter_.radius + cutter_.flank_length, p.lpNorm<1>());
    return {m.dot(p) - support(cutter_, rise, m.cross(pose.axis).norm()) - 4e-15 * max_length -
                rounding_,
            rise};
  }

  /// Returns a line below that clearance over an interval, where m is the cutter's normal at the
  /// end `touching`. Between the ends, the point of the cutter that is foremost along m departs
  /// from its chord by arm turn^2 / 2 times x (1 - x). The arm is the point's component along m: R
  /// if m points down the axis, R + flank at most. Because x (1 - x) <= x, a line that falls from
  /// the touching end is a bound.
  Line clearance(const Vector3d& m, const TimeInterval& interval, const Sample& touching) const {
    const double turn = move_.angle * (interval.b.t - interval.a.t);
    const Clearance a = clearance(m, interval.a.t);
    const Clearance b = clearance(m, interval.b.t);
    const double arm =
        cutter_.radius + (std::max(a.rise, b.rise) > -turn ? cutter_.flank_length : 0.0);
    // 0.51 instead of 0.5 covers the rounding.
    const double allowance = 0.51 * arm * turn * turn;
    return &touching == &interval.a ? Line{a.value, b.value - allowance}
                                    : Line{a.value - allowance, b.value};
  }

  /// Returns a lower bound of the entry over an interval, from the planes that touch the cutter at
  /// its ends. The rounding of `cosine` acts over the whole band, hence the allowance.
  IntervalBound entry_plane_bound(const TimeInterval& interval) const {
    const auto line = [&](const Sample& end) {
      if (end.cosine <= min_sine) return Line{-1e300, -1e300};
      const Line clearance_line = clearance(end.outward, interval, end);
      const double allowance = 4e-16 * ray_.band;
      return Line{(clearance_line.value_a - allowance) / end.cosine,
                  (clearance_line.value_b - allowance) / end.cosine};
    };
    const Line first = line(interval.a.is_defined ? interval.a : interval.b);
    const bool has_both = interval.a.is_defined && interval.b.is_defined;
    return envelope_minimum(interval, first, has_both ? line(interval.b) : first);
  }
  /// Returns the corresponding lower bound of the distance.
  IntervalBound distance_plane_bound(const TimeInterval& interval) const {
    const auto line = [&](const Sample& end) {
      const Line clearance_line = clearance(end.outward, interval, end);
      const double half_span = ray_.band * std::abs(end.outward.dot(ray_.normal));
      return Line{clearance_line.value_a - half_span, clearance_line.value_b - half_span};
    };
    return envelope_minimum(interval, line(interval.a), line(interval.b));
  }

  /// Returns the velocity per unit t of the cutter's material at `from_tip` from the tip.
  Vector3d velocity(const Vector3d& from_tip) const { return move_.step + omega_.cross(from_tip); }

  /// Returns a bound of the concavity that the frame's rotation causes in the entry: the
  /// acceleration against the normal, in the frame of the cutter, of a point that moves at `v`. A
  /// quarter of its magnitude is added because the normal varies within the move.
  double concavity(const Vector3d& outward, const Vector3d& from_tip, const Vector3d& v) const {
    if (move_.angle == 0) return 0.0;
    const Vector3d acceleration =
        omega_.cross(omega_.cross(from_tip)) - 2.0 * omega_.cross(v - move_.step);
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

std::optional<double> instant_entry(const Cutter& cutter, const Move& move, double t,
                                    const Ray& ray, float min_s) {
  const Sample sample = EntryFunction(cutter, move, ray, double(min_s)).entry(t);
  return sample.is_defined ? std::optional(sample.value) : std::nullopt;
}

double depth(const Cutter& cutter, const Move& move, double t, const Vector3d& point) {
  return -signed_distance(cutter, cutter_pose(move, t), point).value;
}

Move move_after(const CutterMotion& motion, int index) {
  const int next = std::min<int>(index + 1, int(motion.tip.rows()) - 1);
  Move move;
  move.tip = motion.tip.row(index);
  move.step = motion.tip.row(next).transpose() - move.tip;
  move.axis = motion.axis.row(index);
  const Vector3d target = motion.axis.row(next);
  const Vector3d turn_direction = target - target.dot(move.axis) * move.axis;
  const double sine = turn_direction.norm();
  if (sine < 1e-15) {  // rounding of a direction that stands still
    move.side = move.axis.unitOrthogonal();
    return move;
  }
  move.side = turn_direction / sine;
  const double cosine = target.dot(move.axis);
  if (sine < 0.05 && cosine > 0) {  // the truncated series of the arc sine is exact to rounding
                                    // here
    const double y = sine * sine;
    const double higher_terms = 3.0 / 40 + y * (15.0 / 336 + y * 105.0 / 3456);
    move.angle = sine * (1 + y * (1.0 / 6 + y * higher_terms));
  } else {
    move.angle = std::atan2(sine, cosine);
  }
  return move;
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit) {
  if (cutter.corner_radius == cutter.radius) {
    const BallEntry ball = ball_entry(cutter, move, ray, limit);
    if (ball.is_decided) return ball.entry && ball.entry->s <= limit ? ball.entry : std::nullopt;
  }
  // A single ray uses the eight-lane bounds too, so that its search starts from the same values,
  // and ends with the same bits, as a search of eight rays.
  const MoveEndpoints ends = move_endpoints(move);
  Move8 moves;
  for (int lane = 0; lane < Move8::width; ++lane) moves.set_lane(lane, cutter, ends);
  EntryBounds bound;
  entry_bounds(cutter, moves, {&ray, 1}, {&bound, 1});
  if (double(bound.min_s[0]) > limit) return std::nullopt;
  const Vector3d m(bound.m[0][0], bound.m[1][0], bound.m[2][0]);
  if (min_entry(cutter, ends, ray, m) > limit) return std::nullopt;
  return first_entry(cutter, move, ray, limit, bound.fraction[0], bound.min_s[0]);
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit, float fraction, float min_s) {
  const double about = instant(move, fraction);
  const Sample sample =
      EntryFunction(cutter, move, ray, double(min_s)).smallest_entry(limit, about);
  if (!sample.is_defined || sample.value > limit) return std::nullopt;
  return Entry{sample.value, sample.t};
}

}  // namespace abbe::cutting
