#include "cutting/surface/nose_cut.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include "cutting/surface/nose_sweep.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

NoseEdge::NoseEdge(const Nose& nose) : nose_(nose) {
  double max_slope = 0.0;
  for (const NoseWave& wave : nose.waves) {
    if (!std::isfinite(wave.amplitude) || !std::isfinite(wave.phase)) {
      throw std::invalid_argument("nose wave: expected finite amplitude and phase");
    }
    wave_sum_ += std::abs(wave.amplitude);
    max_slope += std::abs(double(wave.order) * wave.amplitude);
  }
  if (!std::isfinite(nose.radius) || nose.radius <= wave_sum_) {
    throw std::invalid_argument("nose: expected a radius larger than the sum of its waves");
  }
  if (nose.profile && !nose.waves.empty())
    throw std::invalid_argument(
        "nose: expected waves on a round edge only, seen waves on an insert");
  lipschitz_ = 1.0 + max_slope / (nose.radius - wave_sum_);
}

double NoseEdge::signed_distance(const Vector2d& point) const {
  if (nose_.profile) return distance_bound(point);
  double edge = nose_.radius;
  if (!nose_.waves.empty()) {
    const double psi = std::atan2(point.y(), point.x());
    for (const NoseWave& wave : nose_.waves) {
      edge += wave.amplitude * std::cos(wave.order * psi + wave.phase);
    }
  }
  return point.norm() - edge;
}

std::optional<double> NoseEdge::entry(const Vector2d& point, const Vector2d& step,
                                      double from) const {
  const double squared_step = step.squaredNorm();
  if (squared_step < 1e-24) {  // the line degenerates to a point in this plane
    return contains(point) ? std::optional(from) : std::nullopt;
  }
  if (nose_.profile) {
    const std::optional<Chord> inside = chord(*nose_.profile, point, step);
    if (!inside || inside->end < from) return std::nullopt;
    return std::max(from, inside->begin);
  }
  const double closest = -point.dot(step) / squared_step;
  // The cross product does not cancel as b^2 - ac does.
  const double distance = (point.x() * step.y() - point.y() * step.x()) / std::sqrt(squared_step);
  const double radius = outer_radius();
  const double squared_half_chord = (radius - distance) * (radius + distance);
  if (squared_half_chord < 0.0) return std::nullopt;
  const double half_chord = std::sqrt(squared_half_chord / squared_step);
  const double begin = std::max(from, closest - half_chord);
  if (begin > closest + half_chord) return std::nullopt;
  if (nose_.waves.empty()) return begin;
  return waved_entry(point, step, begin, closest + half_chord);
}

double NoseEdge::nearest_s(const Vector2d& point, const Vector2d& step, double from) const {
  const double squared_step = step.squaredNorm();
  if (!nose_.profile) return -point.dot(step) / squared_step;
  if (chord(*nose_.profile, point, step)) return from;
  const Vector2d line_normal(-step.y(), step.x());
  // The origin is inside, so the nearest extreme point is on the side of the line opposite to it.
  const Vector2d direction =
      line_normal.dot(point) > 0.0 ? Vector2d(line_normal) : Vector2d(-line_normal);
  const double s = (extreme_point(*nose_.profile, direction) - point).dot(step) / squared_step;
  return std::max(from, s);
}

std::optional<double> NoseEdge::waved_entry(const Vector2d& point, const Vector2d& step,
                                            double begin, double end) const {
  const double speed = step.norm();
  double outside_s = begin;
  double outside_distance = signed_distance(point + begin * step);
  if (outside_distance <= 0.0) return begin;
  // Steps limited by the Lipschitz constant cannot pass over a crossing. The minimum step of 1e-6
  // mm ends the slow approach to a crossing; then the bracket is refined.
  double inside_s = begin;
  double inside_distance = outside_distance;
  while (inside_distance > 0.0) {
    if (inside_s >= end) return std::nullopt;
    outside_s = inside_s;
    outside_distance = inside_distance;
    inside_s = std::min(end, outside_s + std::max(outside_distance / lipschitz_, 1e-6) / speed);
    inside_distance = signed_distance(point + inside_s * step);
  }
  // Every third step bisects, so that the bracket shrinks even if the secant is one-sided.
  for (int i = 0; i < 60 && (inside_s - outside_s) * speed > 1e-13; ++i) {
    const double secant = outside_s + (inside_s - outside_s) * outside_distance /
                                          (outside_distance - inside_distance);
    const double middle = 0.5 * (outside_s + inside_s);
    const double trial = i % 3 == 2 || !(secant > outside_s && secant < inside_s) ? middle : secant;
    const double f = signed_distance(point + trial * step);
    (f > 0.0 ? outside_s : inside_s) = trial;
    (f > 0.0 ? outside_distance : inside_distance) = f;
    if (f == 0.0) break;
  }
  return inside_s;
}

namespace {

using Eigen::Vector3d;
using std::numbers::pi;

// rad; with 1 mm of travel per radian across the feed the error of the surface is 1e-10 mm.
constexpr double angle_tolerance = 1e-10;
// rad; a cut nearer to the join of two intervals belongs to both.
constexpr double join_angle = 1e-9;
// mm; nearer to the spindle line the azimuth of a point changes too fast for Newton's method.
constexpr double min_axis_distance = 1e-3;
// mm; a rake plane nearer to a point on the spindle line contains it.
constexpr double axis_plane_tolerance = 2e-8;
// mm along the ray; largest motion of a contact between two adjacent instants.
constexpr double max_contact_step = 1e-9;

/// Returns the position of the minimum of f between low and high by golden section search.
template <class Function>
double golden_section_minimum(const Function& f, double low, double high) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = high - golden * (high - low);
  double b = low + golden * (high - low);
  double f_a = f(a);
  double f_b = f(b);
  for (int i = 0; i < 45; ++i) {  // 4e-10 of the width; the value at a smooth minimum is accurate
                                  // to the square
    if (f_a <= f_b) {
      high = b;
      b = a;
      f_b = f_a;
      a = high - golden * (high - low);
      f_a = f(a);
    } else {
      low = a;
      a = b;
      f_a = f_b;
      b = low + golden * (high - low);
      f_b = f(b);
    }
  }
  return f_a <= f_b ? a : b;
}

/// The first cut recorded so far. Of equal distances the earlier instant counts, so the result does
/// not depend on the order of the traversal.
struct FirstCutCollector {
  NoseCut cut{.s = infinity, .time_s = infinity};

  double limit() const { return cut.s; }
  // At the start of the ray the instant does not matter.
  bool is_complete(double from) const { return cut.s <= from; }
  void record(const NoseCut& other) {
    if (other.s > cut.s || (other.s == cut.s && other.time_s >= cut.time_s)) return;
    cut = other;
  }
};

/// All recorded cuts up to a limit (mm).
struct CutCollector {
  double max_s;
  std::vector<NoseCut> cuts;

  double limit() const { return max_s; }
  bool is_complete(double) const { return false; }
  void record(const NoseCut& cut) {
    if (cut.s <= max_s) cuts.push_back(cut);
  }
};

/// A sweep with its edge and its bounds.
struct BoundedSweep {
  const NoseSweep& sweep;
  const NoseEdge& edge;
  const ProfileBound* bound;  // null for a round edge
};

/// The search of one ray in one sweep; a `Collector` records the cuts.
template <class Collector>
class RaySearch {
 public:
  RaySearch(const BoundedSweep& bounded_sweep, const NoseRaySegment& ray, Collector& collector)
      : sweep_(bounded_sweep.sweep),
        edge_(bounded_sweep.edge),
        bound_(bounded_sweep.bound),
        ray_(ray),
        collector_(collector) {}

  void search() {
    if (sweep_.nodes.empty() || collector_.limit() < ray_.from) return;
    visit_node(0, bound(0));
    for (const NoseSweep::DiscInstant& face : sweep_.disc_instants) search_face(face);
  }

  void search_segment(const NoseSegment& segment, double s_start);
  void search_face(const NoseSweep::DiscInstant& face);

 private:
  double bound(int index) const {
    const NoseNode& node = sweep_.nodes[std::size_t(index)];
    return bound_ ? bound_->entry_bound(index, node, ray_)
                  : entry_bound(node, ray_, edge_.outer_radius());
  }
  void visit_node(int index, double node_bound);
  bool refine_instant(const NoseSegment& segment, double u);
  void search_densely(const NoseSegment& segment);
  void record(const NoseSegment& segment, double u, double s);

  enum class End { Entry, Exit };
  struct Contact {
    double s, y;
    bool is_on_axis;  // the ray lies on the spindle line there
  };
  std::optional<Contact> contact(const NoseSegment& segment, double u, End end) const;
  void bisect(const NoseSegment& segment, double u0, double u1, End end);
  void search_on_axis(const NoseSegment& segment, double u0, double u1);
  double disc_crossing(const NoseSegment& segment, double u) const;
  void search_disc(const NoseSegment& segment, double u, double step);

  const NoseInterval& interval(const NoseSegment& segment) const {
    return sweep_.intervals[std::size_t(segment.interval)];
  }

  const NoseSweep& sweep_;
  const NoseEdge& edge_;
  const ProfileBound* bound_;
  const NoseRaySegment& ray_;
  Collector& collector_;
};

template <class Collector>
void RaySearch<Collector>::visit_node(int index, double node_bound) {
  if (node_bound > collector_.limit() || node_bound == infinity) return;
  if (collector_.is_complete(ray_.from)) return;
  const NoseNode& node = sweep_.nodes[std::size_t(index)];
  if (node.count == 1) {
    search_segment(sweep_.segments[std::size_t(node.first)], node_bound);
    return;
  }
  // The nearer child comes first, since its cut may rule out the other.
  const double first_bound = bound(index + 1);
  const double second_bound = bound(node.second_child);
  if (first_bound <= second_bound) visit_node(index + 1, first_bound);
  visit_node(node.second_child, second_bound);
  if (first_bound > second_bound) visit_node(index + 1, first_bound);
}

template <class Collector>
void RaySearch<Collector>::record(const NoseSegment& segment, double u, double s) {
  const NoseInterval& i = interval(segment);
  const double clamped_u = std::clamp(u, 0.0, 1.0);
  if (s > ray_.to) return;
  collector_.record({s, i.time_s + clamped_u * i.time_step, segment.interval, clamped_u, i.line});
}

/// Finds every instant of a segment at which the rake plane contains the point where the ray meets
/// the edge.
template <class Collector>
void RaySearch<Collector>::search_segment(const NoseSegment& segment, double s_start) {
  const Vector3d p = ray_.at(s_start);
  const double r = radius(p);
  const double turn = segment.angle1 - segment.angle0;
  // Without a usable azimuth (rake plane along the spindle line, ray close to it, spindle turning
  // by less than 1e-4 rad) the segment is searched densely.
  if (segment.has_undefined_angles || r < min_axis_distance || std::abs(turn) < 1e-4)
    return search_densely(segment);
  const double k0 = (segment.height0 - segment.tilt0 * p.x()) / r;
  const double k1 = (segment.height1 - segment.tilt1 * p.x()) / r;
  const double side0 = std::acos(std::clamp(k0, -1.0, 1.0));
  const double side1 = std::acos(std::clamp(k1, -1.0, 1.0));
  // Largest deviation, rad, of a cut from the linear interpolation of the rake plane's azimuth: due
  // to the slow rotation, the height of the nose, and the extent of the ray.
  const double slack = 1e-3 + 10.0 * interval(segment).slow_angle + std::abs(k0) + std::abs(k1) +
                       angle_between(p, ray_.at(ray_.to));
  if (slack > 0.7)
    return search_densely(segment);  // Newton's method on a sine needs a better start
  const double azimuth_p = azimuth(p);
  for (const double side : {-1.0, 1.0}) {
    const double from = segment.angle0 + side * side0 - azimuth_p;
    const double to = segment.angle1 + side * side1 - azimuth_p;
    const double low = std::ceil((std::min(from, to) - slack) / (2.0 * pi));
    const double high = std::floor((std::max(from, to) + slack) / (2.0 * pi));
    for (double m = low; m <= high; ++m) {
      const double fraction =
          (2.0 * pi * m - from) / (std::abs(to - from) > 1e-6 ? to - from : turn);
      if (!refine_instant(segment, segment.u0 + fraction * (segment.u1 - segment.u0)))
        return search_densely(segment);
    }
  }
}

/// Finds the instant near u at which the rake plane contains the edge's contact on the ray.
/// Newton's method, with a secant slope as soon as two points give one that includes the slow
/// motion. While the trace of the ray misses the edge, the trace's nearest point replaces the
/// contact. Returns false if the iteration does not converge; the segment is then searched densely.
template <class Collector>
bool RaySearch<Collector>::refine_instant(const NoseSegment& segment, double u) {
  const NoseInterval& i = interval(segment);
  double previous_u = 0.0, previous_y = 0.0;
  for (int step = 0; step < 12; ++step) {
    const RayInTool ray = ray_in_tool(i, u, ray_.q, ray_.n);
    const std::optional<double> hit = edge_.entry(ray.point, ray.step, ray_.from);
    const double squared_step = ray.step.squaredNorm();
    if (!hit && squared_step < 1e-12) return false;
    const double s = hit ? *hit : edge_.nearest_s(ray.point, ray.step, ray_.from);
    const double y = ray.y + s * ray.y_step;
    const double y_rate = ray.y_rate + s * ray.y_rate_step;
    // If the work passes the plane too slowly, Newton's step is unbounded.
    if (std::abs(y_rate) < min_axis_distance) return false;
    double slope = y_rate * i.angle_step;
    if (step > 0 && u != previous_u) {
      const double secant = (y - previous_y) / (u - previous_u);
      if (secant / slope > 0.5 && secant / slope < 2.0) slope = secant;
    }
    previous_u = u;
    previous_y = y;
    u -= y / slope;
    const double angle_error = std::abs(u - previous_u) * std::abs(i.angle_step);
    if (!(angle_error < 1.0)) return false;
    if (!hit) {
      // Bound of the trace's motion until the true instant: second order in the angle due to the
      // rotation, first order due to the slow motion.
      const double nearest_s = std::max(s, ray_.from);
      const double r = std::max(radius(ray_.at(s)), radius(ray_.at(nearest_s)));
      const double slow_speed =
          i.centre_step.norm() + i.slow_angle * (i.centre.norm() + i.centre_step.norm());
      const double max_motion =
          std::abs(u - previous_u) * slow_speed + angle_error * angle_error * r;
      const double distance = edge_.distance_bound(ray.point + nearest_s * ray.step);
      if (distance > 4.0 * max_motion + 1e-9) return true;
    }
    if (angle_error > angle_tolerance) continue;
    const double before = (segment.u0 - u) * std::abs(i.angle_step);
    const double after = (u - segment.u1) * std::abs(i.angle_step);
    if (hit && before <= join_angle && after <= join_angle) record(segment, u, s);
    return true;
  }
  return false;
}

template <class Collector>
std::optional<typename RaySearch<Collector>::Contact> RaySearch<Collector>::contact(
    const NoseSegment& segment, double u, End end) const {
  const RayInTool ray = ray_in_tool(interval(segment), u, ray_.q, ray_.n);
  std::optional<double> s = edge_.entry(ray.point, ray.step, ray_.from);
  if (!s) return std::nullopt;
  if (end == End::Exit) {
    s = edge_.entry(ray.point, -ray.step, ray_.from);
    if (!s) return std::nullopt;
    s = -*s;
    if (*s < ray_.from) return std::nullopt;
  }
  return Contact{*s, ray.y + *s * ray.y_step, radius(ray_.at(*s)) <= axis_tolerance};
}

/// Searches a segment densely. Needed for the few rays so near the spindle line, or a spindle that
/// turns so little, that the azimuth does not give the instant.
template <class Collector>
void RaySearch<Collector>::search_densely(const NoseSegment& segment) {
  const double turn = std::abs(interval(segment).angle_step) * (segment.u1 - segment.u0);
  // 128 steps per revolution, 2.8 deg each; y is assumed to change sign at most once in a step.
  const int steps = std::max(4, int(std::ceil(128.0 * turn / (2.0 * pi))));
  for (const End end : {End::Entry, End::Exit}) {
    double u0 = segment.u0;
    for (int i = 1; i <= steps; ++i) {
      const double u1 = i == steps
                            ? segment.u1
                            : segment.u0 + (segment.u1 - segment.u0) * double(i) / double(steps);
      bisect(segment, u0, u1, end);
      u0 = u1;
    }
  }
  const double step = (segment.u1 - segment.u0) / steps;
  for (int i = 0; i <= steps; ++i) search_disc(segment, segment.u0 + i * step, step);
}

/// Returns the s at which the ray crosses the disc inside the edge at instant u; infinity if not on
/// this part of the ray.
template <class Collector>
double RaySearch<Collector>::disc_crossing(const NoseSegment& segment, double u) const {
  const RayInTool ray = ray_in_tool(interval(segment), u, ray_.q, ray_.n);
  const double s = -ray.y / ray.y_step;
  if (!(s >= ray_.from && s <= ray_.to)) return infinity;
  return edge_.contains(ray.point + s * ray.step) ? s : infinity;
}

/// Searches the wall of the pip left by a nose that is not at centre height. The rake plane
/// envelops this wall, so the ray is cut first inside the disc and not at the edge.
template <class Collector>
void RaySearch<Collector>::search_disc(const NoseSegment& segment, double u, double step) {
  const double s = disc_crossing(segment, u);
  double low = std::max(segment.u0, u - step);
  double high = std::min(segment.u1, u + step);
  if (s == infinity || disc_crossing(segment, low) < s || disc_crossing(segment, high) < s) return;
  const double lowest_u = golden_section_minimum(
      [&](double instant) { return disc_crossing(segment, instant); }, low, high);
  for (const double instant : {u, lowest_u}) {
    if (const double s_at_instant = disc_crossing(segment, instant); s_at_instant < infinity)
      record(segment, instant, s_at_instant);
  }
}

/// Finds a contact in the rake plane between two near instants by bisection on the sign of y. If
/// the ray's trace misses the edge at one end, first moves that end inwards.
template <class Collector>
void RaySearch<Collector>::bisect(const NoseSegment& segment, double u0, double u1, End end) {
  std::optional<Contact> c0 = contact(segment, u0, end);
  std::optional<Contact> c1 = contact(segment, u1, end);
  if (!c0 && !c1) return;
  if (c0 && c1 && c0->is_on_axis && c1->is_on_axis) return search_on_axis(segment, u0, u1);
  if (!c0 || !c1) {
    double missing_u = c0 ? u1 : u0;
    double hitting_u = c0 ? u0 : u1;
    // 60 halvings reach the last bit of u.
    for (int i = 0; i < 60 && hitting_u != missing_u; ++i) {
      const double middle = 0.5 * (hitting_u + missing_u);
      if (middle == hitting_u || middle == missing_u) break;
      (contact(segment, middle, end) ? hitting_u : missing_u) = middle;
    }
    (c0 ? u1 : u0) = hitting_u;
    (c0 ? c1 : c0) = contact(segment, hitting_u, end);
  }
  if (c0->y == 0.0) record(segment, u0, c0->s);
  if (c1->y == 0.0) record(segment, u1, c1->s);
  if (!(c0->y * c1->y < 0.0)) return;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (u0 + u1);
    if (middle == u0 || middle == u1) break;
    const std::optional<Contact> c = contact(segment, middle, end);
    if (!c) return;
    const bool has_same_sign = c->y * c0->y > 0.0;
    (has_same_sign ? u0 : u1) = middle;
    (has_same_sign ? c0 : c1) = c;
  }
  // Along a straight edge the contact jumps from one end of the edge to the
  // other; the point in the plane lies between.
  if (edge_.has_profile() && std::abs(c1->s - c0->s) > max_contact_step && c0->y != c1->y)
    return record(segment, u0, c0->s + (c1->s - c0->s) * c0->y / (c0->y - c1->y));
  record(segment, u0, c0->s);
  record(segment, u1, c1->s);
}

/// Finds the first contact between two instants on the spindle line. There every instant whose rake
/// plane contains the line is a solution, and the contact is convex over a short time.
template <class Collector>
void RaySearch<Collector>::search_on_axis(const NoseSegment& segment, double u0, double u1) {
  const auto s_at = [&](double u) {
    const std::optional<Contact> c = contact(segment, u, End::Entry);
    return c && std::abs(c->y) <= axis_plane_tolerance ? c->s : infinity;
  };
  const auto record_at = [&](double u) {
    if (const double s = s_at(u); s < infinity) record(segment, u, s);
  };
  for (const double u : {u0, u1, golden_section_minimum(s_at, u0, u1)}) record_at(u);
}

/// Finds the cut by the whole disc, which is part of the sweep's skin where the sweep begins, ends
/// or reverses.
template <class Collector>
void RaySearch<Collector>::search_face(const NoseSweep::DiscInstant& face) {
  const NoseInterval& i = sweep_.intervals[std::size_t(face.interval)];
  const RayInTool ray = ray_in_tool(i, face.u, ray_.q, ray_.n);
  if (std::abs(ray.y_step) < 1e-9) return;  // the ray lies in the plane: its contact is at the edge
  const double s = -ray.y / ray.y_step;
  if (!(s >= ray_.from && s <= ray_.to) || !edge_.contains(ray.point + s * ray.step)) return;
  record({face.interval, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, false}, face.u, s);
}

}  // namespace

NoseCutSearch::NoseCutSearch(const Nose& nose, const NoseMotion& motion)
    : edge_(nose), sweep_(nose_sweep(motion)) {
  if (edge_.has_profile()) bound_.emplace(edge_.profile(), sweep_);
  double travel = 0.0;
  for (const NoseInterval& interval : sweep_.intervals) {
    spindle_travel_.push_back(travel);
    travel += std::abs(interval.angle_step);
  }
}

/// Visits the ray, divided at the point nearest to the spindle line into two segments on which the
/// radius is nearly linear and the azimuth nearly constant.
template <class Visitor>
void NoseCutSearch::for_each_segment(const Ray& ray_w, const Visitor& visit) const {
  const Vector3d q = sweep_.R_ws.transpose() * (ray_w.point - sweep_.p_ws);
  const Vector3d n = sweep_.R_ws.transpose() * ray_w.normal;
  const double band = ray_w.band;
  const std::optional<double> nearest_s = nearest_to_axis(q, n, band);
  if (!nearest_s) return visit(make_ray_segment(q, n, -band, band));
  visit(make_ray_segment(q, n, -band, *nearest_s));
  visit(make_ray_segment(q, n, *nearest_s, band));
}

std::optional<NoseCut> NoseCutSearch::first(const Ray& ray_w) const {
  const BoundedSweep bounded_sweep{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  FirstCutCollector first_cut;
  for_each_segment(ray_w, [&](const NoseRaySegment& segment) {
    RaySearch(bounded_sweep, segment, first_cut).search();
  });
  if (first_cut.cut.s == infinity) return std::nullopt;
  return first_cut.cut;
}

std::vector<NoseCut> NoseCutSearch::within(const Ray& ray_w, double limit) const {
  const BoundedSweep bounded_sweep{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  CutCollector collector{limit, {}};
  for_each_segment(ray_w, [&](const NoseRaySegment& segment) {
    RaySearch(bounded_sweep, segment, collector).search();
  });
  std::sort(collector.cuts.begin(), collector.cuts.end(), [](const NoseCut& a, const NoseCut& b) {
    return std::tie(a.time_s, a.s) < std::tie(b.time_s, b.s);
  });
  return std::move(collector.cuts);
}

double NoseCutSearch::spindle_travel(const NoseCut& cut) const {
  const auto i = std::size_t(cut.interval);
  return spindle_travel_[i] + cut.u * std::abs(sweep_.intervals[i].angle_step);
}

int NoseCutSearch::segment_index(const NoseCut& cut) const {
  const auto next =
      std::upper_bound(sweep_.segments.begin(), sweep_.segments.end(), cut,
                       [](const NoseCut& c, const NoseSegment& p) {
                         return std::tie(c.interval, c.u) < std::tie(p.interval, p.u0);
                       });
  return std::max(0, int(next - sweep_.segments.begin()) - 1);
}

std::optional<NoseCut> NoseCutSearch::first_in_window(const Ray& ray_w, const NoseCut& other,
                                                      double window) const {
  const double centre = spindle_travel(other);
  const auto angle_offset = [&](int interval, double u) {
    return spindle_travel({.interval = interval, .u = u}) - centre;
  };
  const int start = segment_index(other);
  int begin = start;
  int end = start + 1;
  const auto segment = [&](int i) -> const NoseSegment& { return sweep_.segments[std::size_t(i)]; };
  while (begin > 0 && angle_offset(segment(begin).interval, segment(begin).u0) > -window) --begin;
  while (end < int(sweep_.segments.size()) &&
         angle_offset(segment(end).interval, segment(end).u0) < window)
    ++end;
  const BoundedSweep bounded_sweep{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  CutCollector collector{infinity, {}};
  for_each_segment(ray_w, [&](const NoseRaySegment& ray_segment) {
    RaySearch search(bounded_sweep, ray_segment, collector);
    const double s = std::clamp(other.s, ray_segment.from, ray_segment.to);
    for (int i = begin; i < end; ++i) search.search_segment(segment(i), s);
    for (const NoseSweep::DiscInstant& face : sweep_.disc_instants)
      if (std::abs(angle_offset(face.interval, face.u)) <= window) search.search_face(face);
  });
  FirstCutCollector first_cut;
  for (const NoseCut& cut : collector.cuts)
    if (std::abs(spindle_travel(cut) - centre) <= window) first_cut.record(cut);
  if (first_cut.cut.s == infinity) return std::nullopt;
  return first_cut.cut;
}

}  // namespace abbe::cutting
