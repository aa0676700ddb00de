#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/edge_profile.h"
#include "cutting/surface/surface.h"

namespace abbe::cutting {

// The sweep of a turning tool as a bounding volume hierarchy over its revolutions. All coordinates
// are in spindle axes: origin on the spindle line, x along it. The slow pose is the tool's pose in
// the workpiece without the spindle's rotation (see `NoseMotion`). Frame t is the tool frame.

/// The motion between two samples, for u in [0, 1].
struct NoseInterval {
  Eigen::Vector3d centre;       ///< mm, origin of frame t in the slow pose at u = 0
  Eigen::Vector3d centre_step;  ///< mm per u
  Eigen::Matrix3d R;            ///< slow rotation at u = 0
  Eigen::Vector3d slow_axis;    ///< unit, in frame t
  double slow_angle;            ///< rad per u about slow_axis; 0 if it is below 1e-15
  double angle;                 ///< rad, spindle angle at u = 0
  double angle_step;            ///< rad per u
  double time_s;                ///< at u = 0
  double time_step;             ///< s per u
  int line;                     ///< program line of the move
};

/// A segment of an interval, in which the spindle turns by at most one revolution. The rake plane
/// contains the point (x, r, azimuth) if azimuth = angle +- acos((height - tilt x) / r).
struct NoseSegment {
  int interval;               ///< index in `NoseSweep::intervals`
  double u0, u1;              ///< range of u in the interval
  double angle0, angle1;      ///< rad, azimuth of the rake plane's normal at both ends, unwrapped
  double height0, height1;    ///< mm
  double tilt0, tilt1;        ///< tangent of the normal's elevation above the plane of revolution
  bool has_undefined_angles;  ///< true if the normal leans towards the spindle line by more than 60
                              ///< deg, so that the angles are undefined
};

/// Bounds of the nose centres in the meridian half-plane (x, r) and of the rake planes of
/// consecutive segments.
struct NoseNode {
  double x_low, x_high, r_low, r_high;  ///< mm
  double angle_low, angle_high;         ///< rad
  double height, tilt;                  ///< largest magnitudes, mm and tangent
  int first, count;                     ///< range of segments
  int second_child;  ///< index of the second child; the first child is the next node
};

/// The sweep of a nose. Memory is linear in samples plus revolutions.
struct NoseSweep {
  Eigen::Matrix3d R_ws;  ///< rotation from spindle axes to the workpiece
  Eigen::Vector3d p_ws;  ///< mm, origin of the spindle axes in the workpiece
  std::vector<NoseInterval> intervals;
  std::vector<NoseSegment> segments;
  /// binary tree over the segments in time order, root first; may be empty
  std::vector<NoseNode> nodes;
  /// An instant at which the whole disc inside the edge is part of the sweep's skin.
  struct DiscInstant {
    int interval;
    double u;
  };
  std::vector<DiscInstant> disc_instants;  ///< instants at which the sweep begins, ends or reverses
};

/// Builds the sweep of a motion.
/// @throws std::invalid_argument if sizes differ, a number is not finite, time does not increase,
///         the spindle direction is not unit to 1e-9, a slow pose is not a rotation to 1e-9, or
///         the spindle makes more than 20 million revolutions
NoseSweep nose_sweep(const NoseMotion& motion);

/// A ray q + s n in frame t at one instant. x_t, z_t, y_t and the rate at which the spindle moves
/// the point through the rake plane are linear in s.
struct RayInTool {
  Eigen::Vector2d point, step;  ///< (x_t, z_t)
  double y, y_step;
  double y_rate, y_rate_step;  ///< d y_t / d spindle angle
};
/// Transforms a ray from spindle axes into frame t at instant u of an interval.
RayInTool ray_in_tool(const NoseInterval& interval, double u, const Eigen::Vector3d& q,
                      const Eigen::Vector3d& n);

/// A segment of a vertex's ray, in spindle axes, that does not pass the spindle line. In the
/// meridian half-plane x is linear in s, and the radius lies at most `sag` below a line in s.
struct NoseRaySegment {
  Eigen::Vector3d q, n;
  double from, to;                   // range of s
  double radius0, radius_step, sag;  // mm, mm per s, mm
  double radius_min;                 // smallest radius, mm
  double azimuth;                    // rad, at `from`
  double azimuth_spread;             // rad, from there to the other end
  double x_max;                      // largest |x|, mm

  Eigen::Vector3d at(double s) const { return q + s * n; }
};

/// Returns the distance from the spindle line, mm.
inline double radius(const Eigen::Vector3d& p) { return std::hypot(p.y(), p.z()); }
/// Returns the azimuth about the spindle line, rad.
inline double azimuth(const Eigen::Vector3d& p) { return std::atan2(p.z(), p.y()); }

/// Returns the angle between the azimuths of two points, rad, 0 .. pi.
inline double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::abs(std::atan2(a.y() * b.z() - a.z() * b.y(), a.y() * b.y() + a.z() * b.z()));
}

/// Distance from the spindle line, mm, below which a point counts as lying on it. Such a point is
/// in the rake plane at every instant if the plane passes equally close to the line.
inline constexpr double axis_tolerance = 1e-8;

/// Returns the segment of the ray q + s n for s from `from` to `to`, where `from` < `to`.
NoseRaySegment make_ray_segment(const Eigen::Vector3d& q, const Eigen::Vector3d& n, double from,
                                double to);

/// Returns the s at which a ray is nearest to the spindle line; empty if the ray is parallel to the
/// line or |s| >= `band` (mm).
std::optional<double> nearest_to_axis(const Eigen::Vector3d& q, const Eigen::Vector3d& n,
                                      double band);

// The tests of a node are inline, because they run for every node that a ray visits.

/// Returns true if, by angle alone, the rake plane of a segment below the node can contain a point
/// of the ray. Angles count modulo pi, because the two sides of the spindle line belong to one
/// plane.
inline bool may_contain_by_angle(const NoseNode& node, const NoseRaySegment& ray) {
  const double offset = node.height + node.tilt * ray.x_max;
  // Below 1e-12 mm the plane counts as passing through the spindle line, which avoids 0 / 0 there.
  const double sine = offset < 1e-12 ? 0.0 : offset / ray.radius_min;
  if (!(sine < 1.0)) return true;
  // 1e-6 rad covers the rounding of the angles; a wider range only costs time.
  const double slack = ray.azimuth_spread + std::asin(sine) + 1e-6;
  const double width = node.angle_high - node.angle_low + 2.0 * slack;
  if (width >= std::numbers::pi) return true;
  const double from = ray.azimuth - 0.5 * std::numbers::pi - (node.angle_low - slack);
  return from - std::numbers::pi * std::floor(from / std::numbers::pi) <= width;
}

/// Returns the smallest s of the segment at which the ray's line in the meridian half-plane is
/// within the nose's reach of the box of nose centres, or infinity. This is a lower bound: two
/// points are never closer in space than after both are rotated into the same meridian half-plane.
inline double rounded_box_entry(const NoseNode& node, const NoseRaySegment& ray,
                                double outer_radius) {
  constexpr double no_entry = std::numeric_limits<double>::infinity();
  const double reach = outer_radius + ray.sag;
  double entry = ray.from;
  double exit = ray.to;
  const std::array<double, 2> start{ray.q.x(), ray.radius0}, step{ray.n.x(), ray.radius_step};
  const std::array<double, 2> low{node.x_low, node.r_low}, high{node.x_high, node.r_high};
  for (int i = 0; i < 2; ++i) {
    if (std::abs(step[i]) < 1e-14) {
      if (start[i] < low[i] - reach - 1e-9 || start[i] > high[i] + reach + 1e-9) return no_entry;
      continue;
    }
    const double s0 = (low[i] - reach - start[i]) / step[i];
    const double s1 = (high[i] + reach - start[i]) / step[i];
    entry = std::max(entry, std::min(s0, s1));
    exit = std::min(exit, std::max(s0, s1));
  }
  if (entry > exit) return no_entry;
  const Eigen::Vector2d p(start[0] + entry * step[0], start[1] + entry * step[1]);
  const Eigen::Vector2d corner(std::clamp(p.x(), low[0], high[0]),
                               std::clamp(p.y(), low[1], high[1]));
  if (corner.x() == p.x() || corner.y() == p.y()) return entry;
  // The ray enters at a corner of the widened box, so the nose reaches it only inside the circle
  // about that corner.
  const Eigen::Vector2d d(step[0], step[1]);
  const Eigen::Vector2d v = p - corner;
  const double c = v.squaredNorm() - reach * reach;
  if (c <= 0.0) return entry;
  const double b = v.dot(d);
  const double root = b * b - d.squaredNorm() * c;
  if (root < 0.0 || b >= 0.0) return no_entry;
  const double s = entry + c / (-b + std::sqrt(root));
  return s > ray.to ? no_entry : s;
}

/// Returns a lower bound of the s at which segments below the node meet the ray; infinity if none
/// can.
inline double entry_bound(const NoseNode& node, const NoseRaySegment& ray, double outer_radius) {
  // 1e-9 mm is more than the rounding of the box test.
  return may_contain_by_angle(node, ray) ? rounded_box_entry(node, ray, outer_radius) - 1e-9
                                         : std::numeric_limits<double>::infinity();
}

/// Bounds for the sweep of an edge with a profile. In a ray's meridian half-plane, all tool
/// positions below a node lie inside a polygon whose sides are parallel to those of the profile.
/// The sides follow long edges closely, unlike a circle around them. Memory is linear in the nodes.
class ProfileBound {
 public:
  ProfileBound(const EdgeProfile& profile, const NoseSweep& sweep);

  /// Returns a lower bound of the s at which segments below the node meet the ray; infinity if none
  /// can.
  double entry_bound(int index, const NoseNode& node, const NoseRaySegment& ray) const;

 private:
  /// Extent of the centres and tools below a node, mm.
  struct Extent {
    double up_low, up_high;  ///< of centres, normal to the spindle line in the first rake plane
    double displacement;     ///< largest displacement of a tool point due to the rotation since the
                             ///< first pose
    double lateral;          ///< largest distance from the first rake plane
  };
  /// A side of the profile in the first pose: normal . (x, up) <= reach from its centre.
  struct Side {
    Eigen::Vector2d normal;
    double reach;
  };

  Extent segment_extent(const NoseSweep& sweep, const NoseSegment& segment) const;

  Eigen::Matrix3d R_;             // of the first pose
  Eigen::Vector3d up_, lateral_;  // unit, normal to the spindle line
  // mm: of the profile, its reach downwards, and its reach along `lateral_`
  double outer_radius_, downward_reach_, lateral_reach_;
  std::vector<Side> sides_;
  std::vector<Extent> extents_;  // one per node
};

}  // namespace abbe::cutting
