#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/part/compensated_sum.h"
#include "cutting/stock/engagement.h"
#include "cutting/surface/nose_cut.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// 400 MB for the radii alone.
constexpr double max_nodes = 50e6;

double frustum_volume(double a, double b, double height) {
  return std::numbers::pi / 3.0 * height * (a * a + a * b + b * b);
}

/// Returns the volume between nodes from and to, mm^3.
double volume(const TurnedStock& stock, Index from, Index to) {
  CompensatedSum sum;
  for (Index i = from; i < to; ++i)
    sum.add(frustum_volume(stock.radius[i], stock.radius[i + 1], stock.spacing));
  return sum.value();
}

double end_position(const TurnedStock& stock) {
  return stock.first + stock.spacing * double(stock.radius.size() - 1);
}

/// Returns the radius at a position within the stock.
double radius_at(const TurnedStock& stock, double x) {
  const double u = (x - stock.first) / stock.spacing;
  const Index i = std::clamp<Index>(Index(u), 0, std::max<Index>(0, stock.radius.size() - 2));
  const Index next = std::min(i + 1, stock.radius.size() - 1);
  return stock.radius[i] + (u - double(i)) * (stock.radius[next] - stock.radius[i]);
}

void check(const Eigen::Isometry3d& T_without_spindle) {
  if (!T_without_spindle.matrix().allFinite())
    throw std::invalid_argument("turned stock: expected a finite pose");
}

double edge_radius(const Nose& nose, double psi) {
  double radius = nose.radius;
  for (const NoseWave& wave : nose.waves)
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
  return radius;
}

/// The meridian half-plane of a turned stock for one pose of the tool: converts points of the rake
/// plane to (position along the spindle line, radius).
class Meridian {
 public:
  Meridian(const TurnedStock& stock, const Eigen::Isometry3d& T_without_spindle)
      : stock_(stock),
        T_(T_without_spindle),
        centre_(T_without_spindle.translation() - stock.point_w) {}

  /// Returns (position, radius) of a point (x, z) of frame t.
  Vector2d to_meridian(const Vector2d& point_t) const {
    const Vector3d p = centre_ + T_.linear() * Vector3d(point_t.x(), 0.0, point_t.y());
    const double position = p.dot(stock_.direction_w);
    return {position, (p - position * stock_.direction_w).norm()};
  }

  /// Returns the depth of a point below the profile or behind the nearer end; negative outside.
  double signed_depth(const Vector2d& point) const {
    const double last = end_position(stock_);
    const double x = std::clamp(point.x(), stock_.first, last);
    return std::min({radius_at(stock_, x) - point.y(), point.x() - stock_.first, last - point.x()});
  }

  /// Returns the length of material, mm, on the path from a point of the edge to a target that is
  /// `max_length` away in the tool, up to the first exit.
  double material_length(const Vector2d& edge, const Vector2d& target, double max_length) const {
    if (!(signed_depth(edge) > 0.0)) return 0.0;
    const Vector2d direction = (target - edge) / max_length;
    // Node by node, because the profile is linear between nodes.
    double length = 0.0;
    for (double s = 0.0; s < max_length;) {
      const double next = std::min(max_length, next_node_length(edge, direction, s));
      if (const double end_depth = signed_depth(edge + next * direction); end_depth <= 0.0)
        return exit_length(edge, direction, s, next);
      length = next;
      s = next;
    }
    return length;
  }

 private:
  /// Returns the length at which the path reaches the next node of the stock after s.
  double next_node_length(const Vector2d& edge, const Vector2d& direction, double s) const {
    const double h = stock_.spacing;
    if (std::abs(direction.x()) < 1e-12) return infinity;
    const double u = (edge.x() + s * direction.x() - stock_.first) / h;
    const double node =
        direction.x() > 0.0 ? std::floor(u + 1e-9) + 1.0 : std::ceil(u - 1e-9) - 1.0;
    return (stock_.first + node * h - edge.x()) / direction.x();
  }

  /// Returns the length at which the path leaves the material. The profile is straight between
  /// nodes, so the depth is linear except at the ends of the stock, and usually the first secant is
  /// exact.
  double exit_length(const Vector2d& edge, const Vector2d& direction, double inside,
                     double outside) const {
    for (int i = 0; i < 60 && outside - inside > 1e-13; ++i) {
      const double a = signed_depth(edge + inside * direction);
      const double b = signed_depth(edge + outside * direction);
      double next = a > b ? inside + (outside - inside) * a / (a - b) : 0.5 * (inside + outside);
      if (i % 3 == 2 || !(next > inside && next < outside)) next = 0.5 * (inside + outside);
      const double depth = signed_depth(edge + next * direction);
      if (depth == 0.0) return next;
      (depth > 0.0 ? inside : outside) = next;
    }
    return outside;
  }

  const TurnedStock& stock_;
  const Eigen::Isometry3d& T_;
  Vector3d centre_;
};

/// The edge of a nose in a stock, parameterised by the angle psi.
class EdgeInStock {
 public:
  EdgeInStock(const TurnedStock& stock, const Nose& nose,
              const Eigen::Isometry3d& T_without_spindle)
      : nose_(nose), meridian_(stock, T_without_spindle) {}

  double signed_depth(double psi) const { return meridian_.signed_depth(point(psi)); }

  /// Returns the chip thickness: the length of material from the edge towards the centre of the
  /// nose, at most to the centre.
  double chip(double psi) const {
    const double max_chip = edge_radius(nose_, psi);
    return meridian_.material_length(point(psi), meridian_.to_meridian(Vector2d::Zero()), max_chip);
  }

 private:
  Vector2d point(double psi) const {
    return meridian_.to_meridian(edge_radius(nose_, psi) * Vector2d(std::cos(psi), std::sin(psi)));
  }

  const Nose& nose_;
  Meridian meridian_;
};

/// A segment of an insert's edge in a stock, parameterised by the fraction of its length.
class SegmentInStock {
 public:
  SegmentInStock(const TurnedStock& stock, const EdgeProfile& profile,
                 const OutlineSegment& segment, const Eigen::Isometry3d& T_without_spindle)
      : profile_(profile),
        segment_(segment),
        angle_(std::acos(std::clamp(segment.normal_from.dot(segment.normal_to), -1.0, 1.0))),
        meridian_(stock, T_without_spindle) {}

  double length() const {
    return segment_.is_arc ? segment_.radius * angle_ : (segment_.to - segment_.from).norm();
  }
  Vector2d point(double fraction) const {
    if (!segment_.is_arc) return segment_.from + fraction * (segment_.to - segment_.from);
    return segment_.from + segment_.radius * (normal(fraction) - segment_.normal_from);
  }
  double signed_depth(double fraction) const {
    return meridian_.signed_depth(meridian_.to_meridian(point(fraction)));
  }

  /// Returns the chip thickness: the length of material normal to the edge, at most to the other
  /// side of the insert.
  double chip(double fraction) const {
    const Vector2d edge_point = point(fraction), inward = -normal(fraction);
    const std::optional<Chord> chord_inside = chord(profile_, edge_point, inward);
    if (!chord_inside || !(chord_inside->end > 0.0)) return 0.0;
    return meridian_.material_length(meridian_.to_meridian(edge_point),
                                     meridian_.to_meridian(edge_point + chord_inside->end * inward),
                                     chord_inside->end);
  }

 private:
  Vector2d normal(double fraction) const {
    return Eigen::Rotation2Dd(fraction * angle_) * segment_.normal_from;
  }

  const EdgeProfile& profile_;
  const OutlineSegment& segment_;
  double angle_;  // rad, of an arc
  Meridian meridian_;
};

/// Returns the parameter, between one outside and one inside the material, at which the edge
/// crosses the profile.
template <class Edge>
double profile_crossing(const Edge& edge, double outside, double inside) {
  for (int i = 0; i < 60 && std::abs(inside - outside) > 1e-13; ++i) {
    const double middle_parameter = 0.5 * (outside + inside);
    (edge.signed_depth(middle_parameter) > 0.0 ? inside : outside) = middle_parameter;
  }
  return inside;
}

/// Appends the engaged parts of a segment. A part is two nodes of the stock long, or longer if
/// there would be more than `max_parts`.
void append_engaged(const SegmentInStock& segment, double spacing, int max_parts,
                    std::vector<EngagedEdge>& engaged) {
  // A short arc still gets eight parts, so that the normal varies little within one.
  constexpr int min_parts = 8;
  const double length = segment.length();
  if (!(length > 0.0)) return;
  const int parts = int(std::clamp(std::ceil(0.5 * length / spacing), 1.0 * min_parts,
                                   1.0 * std::max(min_parts, max_parts)));
  double depth_before = segment.signed_depth(0.0);
  for (int i = 0; i < parts; ++i) {
    double begin = double(i) / parts, end = double(i + 1) / parts;
    const double depth_after = segment.signed_depth(end);
    if (depth_before > 0.0 || depth_after > 0.0) {
      if (depth_before <= 0.0) begin = profile_crossing(segment, begin, end);
      if (depth_after <= 0.0) end = profile_crossing(segment, end, begin);
      const double middle_fraction = 0.5 * (begin + end);
      const Vector2d point = segment.point(middle_fraction);
      if (end > begin)
        engaged.push_back({std::atan2(point.y(), point.x()), (end - begin) * length,
                           segment.chip(middle_fraction)});
    }
    depth_before = depth_after;
  }
}

std::vector<EngagedEdge> profile_engagement(const TurnedStock& stock, const EdgeProfile& profile,
                                            const Eigen::Isometry3d& T_without_spindle,
                                            int segments) {
  std::vector<EngagedEdge> engaged;
  for (const OutlineSegment& segment : profile.segments)
    append_engaged({stock, profile, segment, T_without_spindle}, stock.spacing, segments, engaged);
  return engaged;
}

void check_profile(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile, double spacing) {
  if (!(std::isfinite(spacing) && spacing > 0.0))
    throw std::invalid_argument(
        fmt::format("turned stock: expected a spacing above 0 mm, seen {}", spacing));
  if (profile.rows() < 2 || !profile.allFinite())
    throw std::invalid_argument("turned stock: expected at least two finite corners");
  for (Index i = 0; i < profile.rows(); ++i) {
    if (profile(i, 1) < 0.0)
      throw std::invalid_argument(
          fmt::format("turned stock: expected radii of at least 0 mm, seen {}", profile(i, 1)));
    if (i > 0 && profile(i, 0) < profile(i - 1, 0))
      throw std::invalid_argument(
          fmt::format("turned stock: expected corners in increasing order, seen {} after {}",
                      profile(i, 0), profile(i - 1, 0)));
  }
  const double length = profile(profile.rows() - 1, 0) - profile(0, 0);
  if (!(length > 0.0)) throw std::invalid_argument("turned stock: expected a length above 0 mm");
  if (length / spacing > max_nodes)
    throw std::length_error(fmt::format(
        "turned stock of {:.0f} nodes would take {:.0f} MiB, more than the {:.0f} allowed",
        length / spacing, length / spacing * sizeof(double) / 1048576.0,
        max_nodes * sizeof(double) / 1048576.0));
}

}  // namespace

double volume(const TurnedStock& stock) {
  return volume(stock, 0, std::max<Index>(0, stock.radius.size() - 1));
}

TurnedStock make_turned_stock(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_mm,
                              double spacing, const Vector3d& point_w,
                              const Vector3d& direction_w) {
  check_profile(profile_mm, spacing);
  if (!point_w.allFinite() || std::abs(direction_w.norm() - 1.0) > 1e-9)
    throw std::invalid_argument("turned stock: expected a finite point and a unit direction");
  const Index corners = profile_mm.rows();
  const double length = profile_mm(corners - 1, 0) - profile_mm(0, 0);
  const Index intervals = std::max<Index>(1, Index(std::ceil(length / spacing - 1e-9)));
  TurnedStock stock{
      point_w, direction_w.normalized(), profile_mm(0, 0), length / double(intervals), {}, {}};
  stock.radius.resize(intervals + 1);
  stock.line.assign(std::size_t(intervals) + 1, 0);
  Index corner = 0;
  for (Index i = 0; i <= intervals; ++i) {
    const double x = stock.first + stock.spacing * double(i);
    while (corner + 2 < corners && profile_mm(corner + 1, 0) < x) ++corner;
    const double begin = profile_mm(corner, 0), end = profile_mm(corner + 1, 0);
    const double fraction = end > begin ? std::clamp((x - begin) / (end - begin), 0.0, 1.0) : 1.0;
    stock.radius[i] =
        profile_mm(corner, 1) + fraction * (profile_mm(corner + 1, 1) - profile_mm(corner, 1));
  }
  return stock;
}

std::vector<EngagedEdge> engagement(const TurnedStock& stock, const Nose& nose,
                                    const Eigen::Isometry3d& T_without_spindle, int segments) {
  check(T_without_spindle);
  const NoseEdge validated_edge(nose);
  if (segments < 3) throw std::invalid_argument("nose edge: expected at least 3 segments");
  std::vector<EngagedEdge> result;
  if (stock.radius.size() < 2) return result;
  if (nose.profile) return profile_engagement(stock, *nose.profile, T_without_spindle, segments);
  const EdgeInStock edge(stock, nose, T_without_spindle);
  const double step = 2.0 * std::numbers::pi / segments;
  double depth_before = edge.signed_depth(0.0);
  for (int i = 0; i < segments; ++i) {
    double begin = i * step, end = (i + 1) * step;
    const double depth_after = edge.signed_depth(i + 1 < segments ? end : 0.0);
    if (depth_before > 0.0 || depth_after > 0.0) {
      if (depth_before <= 0.0) begin = profile_crossing(edge, begin, end);
      if (depth_after <= 0.0) end = profile_crossing(edge, end, begin);
      const double psi = 0.5 * (begin + end);
      const double length = (end - begin) * edge_radius(nose, psi);
      if (length > 0.0) result.push_back({psi, length, edge.chip(psi)});
    }
    depth_before = depth_after;
  }
  return result;
}

namespace {

/// The motion of an edge between two slow poses, and its minimum radius at a position of the stock.
class Revolution {
 public:
  Revolution(const TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from,
             const Eigen::Isometry3d& to)
      : stock_(stock),
        edge_(nose),
        start_(from.translation() - stock.point_w),
        step_(to.translation() - from.translation()),
        from_(from.linear()),
        to_(to.linear()),
        is_translation_((from.linear() - to.linear()).norm() < 1e-12),
        x_(from.linear().col(0)),
        z_(from.linear().col(2)),
        forward_reach_(max_reach(stock.direction_w)),
        backward_reach_(max_reach(-stock.direction_w)) {
    if (!is_translation_ || !edge_.has_profile()) return;
    const Vector3d radial = start_ - start_.dot(stock.direction_w) * stock.direction_w;
    if (!(radial.norm() > edge_.outer_radius() + step_.norm())) return;
    const Vector3d inward = -radial.normalized();
    const Vector2d tip = extreme_point(edge_.profile(), {x_.dot(inward), z_.dot(inward)});
    tip_position_ = (tip.x() * x_ + tip.y() * z_).dot(stock.direction_w);
  }

  /// Returns the range along the spindle line that the nose passes, mm.
  std::pair<double, double> extent() const {
    const double a = start_.dot(stock_.direction_w), b = a + step_.dot(stock_.direction_w);
    return {std::min(a, b) - backward_reach_, std::max(a, b) + forward_reach_};
  }

  /// Returns true if the edge certainly stays above a radius at a position. A convex edge is lowest
  /// there when its tip is nearest, except for the descent of the whole edge during the motion.
  bool is_certainly_above(double radius, double x) const {
    if (!tip_position_) return false;
    const double speed = step_.dot(stock_.direction_w);
    const double offset = x - start_.dot(stock_.direction_w) - *tip_position_;
    const double nearest_t = std::abs(speed) > 1e-12 ? std::clamp(offset / speed, 0.0, 1.0) : 0.0;
    return min_radius(x, nearest_t) - step_.norm() > radius;
  }

  /// Returns the minimum radius at a position over the revolution; infinity if the edge does not
  /// reach the position. The lowest point of a convex edge falls, then rises with time, so a golden
  /// section search finds the minimum.
  double min_radius(double x) const {
    const double speed = step_.dot(stock_.direction_w);
    const double offset = x - start_.dot(stock_.direction_w);
    double a = 0.0, b = 1.0;
    if (std::abs(speed) > 1e-12) {
      const double t0 = (offset - forward_reach_) / speed;
      const double t1 = (offset + backward_reach_) / speed;
      a = std::max(a, std::min(t0, t1));
      b = std::min(b, std::max(t0, t1));
    }
    if (a > b) return infinity;
    return minimized_radius(x, a, b);
  }

 private:
  /// Returns the reach of the edge from its centre along the spindle line at any time, mm.
  double max_reach(const Vector3d& direction) const {
    const double reach = edge_.reach({x_.dot(direction), z_.dot(direction)});
    if (is_translation_ || !edge_.has_profile()) return reach;
    return reach + (to_ - from_).norm() * edge_.outer_radius();
  }

  double minimized_radius(double x, double a, double b) const {
    const double golden_ratio = 0.5 * (std::sqrt(5.0) - 1.0);
    const double speed = step_.dot(stock_.direction_w);
    // The position of the centre when half of the edge has passed x.
    const double centre_position = x - 0.5 * (forward_reach_ - backward_reach_);
    const double fallback_t =
        (centre_position - start_.dot(stock_.direction_w)) / (speed != 0.0 ? speed : 1.0);
    double best = std::min(min_radius(x, a), min_radius(x, b));
    double c = b - golden_ratio * (b - a), d = a + golden_ratio * (b - a);
    double radius_c = min_radius(x, c), radius_d = min_radius(x, d);
    // At the bottom of a round edge the radius is stationary: a motion of 2e-5 of the nose radius
    // changes it by 2e-10 of the nose radius. At corners it is not.
    const double tolerance = (edge_.has_profile() ? 1e-10 : 2e-5) * edge_.outer_radius();
    for (int i = 0; i < 60 && (b - a) * step_.norm() > tolerance; ++i) {
      best = std::min({best, radius_c, radius_d});
      const bool both_miss = radius_c == infinity && radius_d == infinity;
      if (both_miss ? fallback_t < 0.5 * (a + b) : radius_c <= radius_d) {
        b = d;
        d = c;
        radius_d = radius_c;
        c = b - golden_ratio * (b - a);
        radius_c = min_radius(x, c);
      } else {
        a = c;
        c = d;
        radius_c = radius_d;
        d = a + golden_ratio * (b - a);
        radius_d = min_radius(x, d);
      }
    }
    return std::min({best, radius_c, radius_d});
  }

  double min_radius(double x, double t) const {
    if (is_translation_) return min_radius(x, start_ + t * step_, x_, z_);
    const Eigen::Matrix3d R = Eigen::Quaterniond(from_).slerp(t, Eigen::Quaterniond(to_)).matrix();
    return min_radius(x, start_ + t * step_, R.col(0), R.col(2));
  }

  /// Returns the minimum radius inside the edge on the line in which the rake plane meets the plane
  /// normal to the spindle line at x.
  double min_radius(double x, const Vector3d& centre, const Vector3d& ex,
                    const Vector3d& ez) const {
    const Vector3d& along = stock_.direction_w;
    const Vector2d rise(ex.dot(along), ez.dot(along));  // of x over the rake plane
    const double squared_slope = rise.squaredNorm();
    if (squared_slope < 1e-12) return infinity;  // the rake plane is normal to the spindle line
    const Vector2d point = (x - centre.dot(along)) / squared_slope * rise;
    const Vector2d direction = Vector2d(-rise.y(), rise.x()) / std::sqrt(squared_slope);
    const Vector3d p = centre + point.x() * ex + point.y() * ez;
    const Vector3d radial = p - p.dot(along) * along;
    const Vector3d d = direction.x() * ex + direction.y() * ez;
    const double reach =
        std::sqrt(std::max(0.0, edge_.outer_radius() * edge_.outer_radius() - point.squaredNorm()));
    const auto entry = edge_.entry(point, direction, -reach);
    const auto exit = edge_.entry(point, -direction, -reach);
    if (!entry || !exit || *entry > -*exit) return infinity;
    const double s = std::clamp(-radial.dot(d), *entry, -*exit);
    return (radial + s * d).norm();
  }

  const TurnedStock& stock_;
  NoseEdge edge_;
  Vector3d start_, step_;
  Eigen::Matrix3d from_, to_;
  bool is_translation_;
  Vector3d x_, z_;
  double forward_reach_, backward_reach_;  // mm, reach along the spindle line and against it
  // mm along the spindle line, of the lowest point of an insert on one side of the line
  std::optional<double> tip_position_;
};

}  // namespace

double remove(TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from_T_slow,
              const Eigen::Isometry3d& to_T_slow, std::int32_t line) {
  check(from_T_slow);
  check(to_T_slow);
  if (stock.radius.size() < 2) return 0.0;
  const Revolution revolution(stock, nose, from_T_slow, to_T_slow);
  const auto [low, high] = revolution.extent();
  const double last = double(stock.radius.size() - 1);
  const double first_node = std::max(0.0, std::ceil((low - stock.first) / stock.spacing));
  const double last_node = std::min(last, std::floor((high - stock.first) / stock.spacing));
  if (first_node > last_node) return 0.0;
  const Index from = Index(first_node), to = Index(last_node);
  const Index begin = std::max<Index>(0, from - 1), end = std::min<Index>(Index(last), to + 1);
  const double volume_before = volume(stock, begin, end);
  for (Index i = from; i <= to; ++i) {
    const double x = stock.first + stock.spacing * double(i);
    if (revolution.is_certainly_above(stock.radius[i], x)) continue;
    const double min_radius = revolution.min_radius(x);
    if (!(min_radius < stock.radius[i])) continue;
    stock.radius[i] = min_radius;
    stock.line[std::size_t(i)] = line;
  }
  return volume_before - volume(stock, begin, end);
}

}  // namespace abbe::cutting
