#include "cutting/surface/nose_sweep.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kinematics/bad_input.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

using std::numbers::pi;

// About 240 bytes each (a segment of 80 and two nodes of 80), i.e. 4.8 GB in total.
constexpr double max_revolutions = 20e6;

void check(const NoseMotion& motion) {
  const auto n = Eigen::Index(motion.T_without_spindle.size());
  require(motion.spindle.size() == n && motion.time_s.size() == n &&
              Eigen::Index(motion.line.size()) == n,
          "nose motion: expected one spindle angle, time and line per pose");
  require(
      motion.spindle.allFinite() && motion.time_s.allFinite() && motion.spindle_point.allFinite(),
      "nose motion: expected finite numbers");
  require(std::abs(motion.spindle_direction.norm() - 1.0) <= 1e-9,
          "nose motion: expected a unit spindle direction");
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Isometry3d& T = motion.T_without_spindle[std::size_t(i)];
    require(T.matrix().allFinite(), "nose motion: expected finite poses");
    require((T.linear().transpose() * T.linear() - Matrix3d::Identity()).norm() <= 1e-9 &&
                T.linear().determinant() > 0.0,
            "nose motion: expected rotation matrices");
    require(i == 0 || motion.time_s[i] > motion.time_s[i - 1],
            "nose motion: expected strictly increasing times");
  }
  double total_angle = 0.0;
  for (Eigen::Index i = 1; i < n; ++i) {
    total_angle += std::abs(motion.spindle[i] - motion.spindle[i - 1]);
  }
  require(total_angle <= max_revolutions * 2.0 * pi,
          "nose motion: expected at most 20e6 revolutions");
}

Matrix3d spindle_axes(const Vector3d& direction) {
  // Any axis that is not nearly parallel to the direction.
  const Vector3d helper = std::abs(direction.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
  Matrix3d R;
  R.col(0) = direction.normalized();
  R.col(1) = (helper - helper.dot(R.col(0)) * R.col(0)).normalized();
  R.col(2) = R.col(0).cross(R.col(1));
  return R;
}

Matrix3d slow_rotation(const NoseInterval& interval, double u) {
  if (interval.slow_angle == 0.0) return interval.R;
  return interval.R *
         Eigen::AngleAxisd(u * interval.slow_angle, interval.slow_axis).toRotationMatrix();
}

NoseInterval interval_between(const NoseMotion& motion, std::size_t i, const NoseSweep& sweep) {
  const Eigen::Isometry3d& T0 = motion.T_without_spindle[i];
  const Eigen::Isometry3d& T1 = motion.T_without_spindle[i + 1];
  const auto k = Eigen::Index(i);
  NoseInterval interval;
  interval.centre = sweep.R_ws.transpose() * (T0.translation() - sweep.p_ws);
  interval.centre_step = sweep.R_ws.transpose() * (T1.translation() - T0.translation());
  interval.R = sweep.R_ws.transpose() * T0.linear();
  const Vector3d rotation = kinematics::rotation_vector(T0.linear().transpose() * T1.linear());
  interval.slow_angle = rotation.norm() < 1e-15 ? 0.0 : rotation.norm();
  interval.slow_axis =
      interval.slow_angle == 0.0 ? Vector3d::UnitX() : Vector3d(rotation / interval.slow_angle);
  interval.angle = motion.spindle[k];
  interval.angle_step = motion.spindle[k + 1] - motion.spindle[k];
  interval.time_s = motion.time_s[k];
  interval.time_step = motion.time_s[k + 1] - motion.time_s[k];
  interval.line = motion.line[i + 1];
  return interval;
}

/// The rake plane at one instant; its members are those of NoseSegment.
struct RakePlane {
  double angle, height, tilt;
  bool has_undefined_angles;
};

RakePlane rake_plane(const NoseInterval& interval, double u, double previous_angle) {
  const Vector3d normal = slow_rotation(interval, u).col(1);
  const double across = std::hypot(normal.y(), normal.z());
  // If the normal leans by over 60 deg, its azimuth is ill-conditioned.
  if (across < 0.5) return {previous_angle, 0.0, 0.0, true};
  const double angle =
      std::atan2(normal.z(), normal.y()) + interval.angle + u * interval.angle_step;
  // The angle is continuous over a segment that turns by at most a revolution and hardly tilts, so
  // of its values modulo 2 pi the one nearest to the spindle's own rotation is taken.
  const double unwrapped = angle + 2.0 * pi * std::round((previous_angle - angle) / (2.0 * pi));
  const double height = normal.dot(interval.centre + u * interval.centre_step);
  return {unwrapped, height / across, normal.x() / across, false};
}

void append_segments(NoseSweep& sweep, int index, double& angle) {
  const NoseInterval& interval = sweep.intervals[std::size_t(index)];
  // 1e-9, so that rounding does not add a segment to an interval of whole revolutions.
  const int segment_count =
      std::max(1, int(std::ceil(std::abs(interval.angle_step) / (2.0 * pi) - 1e-9)));
  RakePlane start = rake_plane(interval, 0.0, angle);
  for (int i = 0; i < segment_count; ++i) {
    const double u0 = double(i) / segment_count;
    const double u1 = double(i + 1) / segment_count;
    const RakePlane end =
        rake_plane(interval, u1, start.angle + interval.angle_step / segment_count);
    sweep.segments.push_back({index, u0, u1, start.angle, end.angle, start.height, end.height,
                              start.tilt, end.tilt,
                              start.has_undefined_angles || end.has_undefined_angles});
    start = end;
  }
  angle = start.angle;
}

NoseNode bounds(const NoseSweep& sweep, int first) {
  const NoseSegment& segment = sweep.segments[std::size_t(first)];
  const NoseInterval& interval = sweep.intervals[std::size_t(segment.interval)];
  const Vector3d a = interval.centre + segment.u0 * interval.centre_step;
  const Vector3d b = interval.centre + segment.u1 * interval.centre_step;
  const Vector2d a_r = a.tail<2>();
  const Vector2d step_r = b.tail<2>() - a_r;
  const double nearest_u = step_r.squaredNorm() > 0.0
                               ? std::clamp(-a_r.dot(step_r) / step_r.squaredNorm(), 0.0, 1.0)
                               : 0.0;
  // Between its ends the rake plane departs from the linear interpolation of angle, height and tilt
  // by less than its slow rotation; the factor covers the magnification of a leaning plane.
  const double slow_turn = 10.0 * interval.slow_angle * (segment.u1 - segment.u0);
  const double max_distance = std::max(a.norm(), b.norm());
  NoseNode node;
  node.x_low = std::min(a.x(), b.x());
  node.x_high = std::max(a.x(), b.x());
  node.r_low = (a_r + nearest_u * step_r).norm();
  node.r_high = std::max(a_r.norm(), b.tail<2>().norm());
  node.angle_low = std::min(segment.angle0, segment.angle1) - slow_turn;
  node.angle_high = std::max(segment.angle0, segment.angle1) + slow_turn +
                    (segment.has_undefined_angles ? 2.0 * pi : 0.0);
  node.height = std::max(std::abs(segment.height0), std::abs(segment.height1)) +
                slow_turn * ((b - a).norm() + max_distance);
  node.tilt = std::max(std::abs(segment.tilt0), std::abs(segment.tilt1)) + slow_turn;
  node.first = first;
  node.count = 1;
  node.second_child = 0;
  return node;
}

int append_nodes(NoseSweep& sweep, int first, int count) {
  const int index = int(sweep.nodes.size());
  if (count == 1) {
    sweep.nodes.push_back(bounds(sweep, first));
    return index;
  }
  sweep.nodes.emplace_back();
  append_nodes(sweep, first, count / 2);
  const int second_child = append_nodes(sweep, first + count / 2, count - count / 2);
  const NoseNode& a = sweep.nodes[std::size_t(index) + 1];
  const NoseNode& b = sweep.nodes[std::size_t(second_child)];
  sweep.nodes[std::size_t(index)] = {std::min(a.x_low, b.x_low),
                                     std::max(a.x_high, b.x_high),
                                     std::min(a.r_low, b.r_low),
                                     std::max(a.r_high, b.r_high),
                                     std::min(a.angle_low, b.angle_low),
                                     std::max(a.angle_high, b.angle_high),
                                     std::max(a.height, b.height),
                                     std::max(a.tilt, b.tilt),
                                     first,
                                     count,
                                     second_child};
  return index;
}

/// Appends the faces: the whole disc cuts where the sweep begins or ends and where the spindle
/// reverses.
void append_faces(NoseSweep& sweep) {
  const int n = int(sweep.intervals.size());
  double sense = 0.0;
  sweep.disc_instants.push_back({0, 0.0});
  for (int i = 0; i < n; ++i) {
    const double step = sweep.intervals[std::size_t(i)].angle_step;
    if (step * sense < 0.0) sweep.disc_instants.push_back({i, 0.0});
    if (step != 0.0) sense = step;
  }
  sweep.disc_instants.push_back({n - 1, 1.0});
}

}  // namespace

NoseSweep nose_sweep(const NoseMotion& motion) {
  check(motion);
  NoseSweep sweep;
  sweep.R_ws = spindle_axes(motion.spindle_direction);
  sweep.p_ws = motion.spindle_point;
  if (motion.T_without_spindle.size() < 2) return sweep;
  for (std::size_t i = 0; i + 1 < motion.T_without_spindle.size(); ++i) {
    sweep.intervals.push_back(interval_between(motion, i, sweep));
  }
  double angle = sweep.intervals.front().angle;
  for (int i = 0; i < int(sweep.intervals.size()); ++i) append_segments(sweep, i, angle);
  sweep.nodes.reserve(2 * sweep.segments.size());
  append_nodes(sweep, 0, int(sweep.segments.size()));
  append_faces(sweep);
  return sweep;
}

RayInTool ray_in_tool(const NoseInterval& interval, double u, const Vector3d& q,
                      const Vector3d& n) {
  const double angle = interval.angle + u * interval.angle_step;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const auto rotate_back = [&](const Vector3d& v) {
    return Vector3d(v.x(), c * v.y() + s * v.z(), c * v.z() - s * v.y());
  };
  const Vector3d p = rotate_back(q);
  const Vector3d d = rotate_back(n);
  const Vector3d v = p - (interval.centre + u * interval.centre_step);
  const Matrix3d R = slow_rotation(interval, u);
  const Vector3d y = R.col(1);
  return {
      {R.col(0).dot(v), R.col(2).dot(v)}, {R.col(0).dot(d), R.col(2).dot(d)}, y.dot(v), y.dot(d),
      y.y() * p.z() - y.z() * p.y(),      y.y() * d.z() - y.z() * d.y()};
}

NoseRaySegment make_ray_segment(const Vector3d& q, const Vector3d& n, double from, double to) {
  NoseRaySegment segment;
  segment.q = q;
  segment.n = n;
  segment.from = from;
  segment.to = to;
  const double r_from = radius(segment.at(from));
  const double r_to = radius(segment.at(to));
  segment.radius_step = (r_to - r_from) / (to - from);
  segment.radius0 = r_from - from * segment.radius_step;
  segment.radius_min = std::min(r_from, r_to);
  // r^2 = a + 2 b s + c s^2 is convex in s, and r lies below its chord by at most the sag, which it
  // reaches where the slopes are equal.
  const double a = q.y() * q.y() + q.z() * q.z();
  const double b = q.y() * n.y() + q.z() * n.z();
  const double c = n.y() * n.y() + n.z() * n.z();
  const double m = segment.radius_step;
  segment.sag = 1e-9;
  const double excess = c - m * m;
  if (excess > 0.0) {
    const double w = std::copysign(std::sqrt(m * m * std::max(0.0, a * c - b * b) / excess), m);
    const double s = std::clamp((w - b) / c, from, to);
    segment.sag += std::max(0.0, segment.radius0 + s * m - radius(segment.at(s)));
  }
  // An end on the spindle line has no azimuth; the other end then gives that of the whole segment.
  const bool starts_on_axis = r_from < axis_tolerance;
  segment.azimuth = azimuth(segment.at(starts_on_axis ? to : from));
  segment.azimuth_spread =
      segment.radius_min < axis_tolerance ? 0.0 : angle_between(segment.at(from), segment.at(to));
  segment.x_max = std::max(std::abs(segment.at(from).x()), std::abs(segment.at(to).x()));
  return segment;
}

std::optional<double> nearest_to_axis(const Vector3d& q, const Vector3d& n, double band) {
  const double c = n.y() * n.y() + n.z() * n.z();
  const double s = -(q.y() * n.y() + q.z() * n.z());
  // Below 1e-20 the ray is parallel to the spindle line.
  if (c < 1e-20 || std::abs(s) >= band * c) return std::nullopt;
  return s / c;
}

namespace {

constexpr double rounding = 1e-9;  // mm

/// Returns the unit direction normal to the spindle line, in the rake plane and towards the tool.
Vector3d up_direction(const Matrix3d& R, const Vector3d& centre) {
  const Vector3d across = Vector3d::UnitX().cross(R.col(1));
  if (across.norm() < 0.5) return Vector3d::UnitY();  // the bound is then loose but valid
  return (across.dot(centre) < 0.0 ? -1.0 : 1.0) * across.normalized();
}

}  // namespace

ProfileBound::ProfileBound(const EdgeProfile& profile, const NoseSweep& sweep)
    : R_(sweep.intervals.empty() ? Matrix3d(Matrix3d::Identity()) : sweep.intervals.front().R),
      up_(up_direction(R_, sweep.intervals.empty() ? Vector3d(Vector3d::Zero())
                                                   : sweep.intervals.front().centre)),
      lateral_(Vector3d::UnitX().cross(up_)),
      outer_radius_(profile.outer_radius) {
  // Maps a point (x, z) of the profile to the meridian half-plane.
  Eigen::Matrix2d meridian;
  meridian << R_(0, 0), R_(0, 2), up_.dot(R_.col(0)), up_.dot(R_.col(2));
  const auto reach = [&](const Vector2d& direction_t) {
    return direction_t.dot(extreme_point(profile, direction_t));
  };
  const auto add_side = [&](const Vector2d& normal_t) {
    const Vector2d normal = (meridian * normal_t).normalized();
    sides_.push_back({normal, reach(meridian.transpose() * normal)});
  };
  // rad; the tangents of an arc then depart from it by 1 % of its radius.
  constexpr double tangent_spacing = 0.25;
  for (const OutlineSegment& segment : profile.segments) {
    if (!segment.is_arc) add_side(segment.normal_from);
    if (!segment.is_arc || segment.radius == 0.0) continue;
    const double angle =
        std::acos(std::clamp(segment.normal_from.dot(segment.normal_to), -1.0, 1.0));
    const int steps = int(std::ceil(angle / tangent_spacing));
    for (int i = 0; i <= steps; ++i)
      add_side(Eigen::Rotation2Dd(angle * i / std::max(steps, 1)) * segment.normal_from);
  }
  downward_reach_ = reach(meridian.transpose() * Vector2d(0, -1));
  const Vector2d lateral_direction(lateral_.dot(R_.col(0)), lateral_.dot(R_.col(2)));
  lateral_reach_ = std::max(reach(lateral_direction), reach(-lateral_direction));

  extents_.resize(sweep.nodes.size());
  for (std::size_t i = sweep.nodes.size(); i-- > 0;) {  // children come after their parents
    const NoseNode& node = sweep.nodes[i];
    if (node.count == 1) {
      extents_[i] = segment_extent(sweep, sweep.segments[std::size_t(node.first)]);
      continue;
    }
    const Extent &a = extents_[i + 1], &b = extents_[std::size_t(node.second_child)];
    extents_[i] = {std::min(a.up_low, b.up_low), std::max(a.up_high, b.up_high),
                   std::max(a.displacement, b.displacement), std::max(a.lateral, b.lateral)};
  }
}

ProfileBound::Extent ProfileBound::segment_extent(const NoseSweep& sweep,
                                                  const NoseSegment& segment) const {
  const NoseInterval& interval = sweep.intervals[std::size_t(segment.interval)];
  Extent extent{infinity, -infinity, 0.0, 0.0};
  for (const double u : {segment.u0, segment.u1}) {
    const Vector3d centre = interval.centre + u * interval.centre_step;
    extent.up_low = std::min(extent.up_low, up_.dot(centre));
    extent.up_high = std::max(extent.up_high, up_.dot(centre));
    extent.lateral = std::max(extent.lateral, std::abs(lateral_.dot(centre)));
    extent.displacement = std::max(extent.displacement, (slow_rotation(interval, u) - R_).norm());
  }
  extent.displacement =
      outer_radius_ * (extent.displacement + interval.slow_angle * (segment.u1 - segment.u0));
  extent.lateral += lateral_reach_ + extent.displacement;
  return extent;
}

// A point of a tool at (x, up, beside) turns to the radius hypot(up, beside) in the meridian: not
// below `up`, and not above it by more than `lateral` plus twice the tool's reach beyond the
// spindle line.
double ProfileBound::entry_bound(int index, const NoseNode& node, const NoseRaySegment& ray) const {
  if (!may_contain_by_angle(node, ray)) return infinity;
  const Extent& extent = extents_[std::size_t(index)];
  const double overreach = std::max(0.0, downward_reach_ + extent.displacement - extent.up_low);
  const double max_rise = 2.0 * overreach + extent.lateral + ray.sag;
  double entry = ray.from, exit = ray.to;
  for (const Side& side : sides_) {
    const Vector2d& n = side.normal;
    const double limit = side.reach + extent.displacement + rounding +
                         n.x() * (n.x() > 0.0 ? node.x_high : node.x_low) +
                         n.y() * (n.y() > 0.0 ? extent.up_high : extent.up_low) +
                         std::max(0.0, n.y()) * max_rise;
    const double offset = n.x() * ray.q.x() + n.y() * ray.radius0 - limit;
    const double slope = n.x() * ray.n.x() + n.y() * ray.radius_step;
    if (std::abs(slope) < 1e-14) {
      if (offset > 0.0) return infinity;
    } else if (slope > 0.0) {
      exit = std::min(exit, -offset / slope);
    } else {
      entry = std::max(entry, -offset / slope);
    }
  }
  return entry > exit ? infinity : entry - rounding;
}

}  // namespace abbe::cutting
