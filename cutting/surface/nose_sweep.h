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

// The sweep of a turning tool as a tree of bounds over its revolutions. All coordinates are in
// spindle axes: origin on the spindle line, x along it.

/// The motion between two samples, for u in [0, 1].
struct NoseInterval {
  Eigen::Vector3d centre;       ///< mm, origin of frame t in the slow pose at u = 0
  Eigen::Vector3d centre_step;  ///< mm per u
  Eigen::Matrix3d R;            ///< slow rotation at u = 0
  Eigen::Vector3d turn_axis;    ///< unit, in frame t
  double turn;                  ///< rad per u about turn_axis; 0 if it is below 1e-15
  double angle;                 ///< rad, spindle angle at u = 0
  double angle_step;            ///< rad per u
  double time_s;
  double time_step;
  int line;
};

/// A part of an interval in which the spindle turns by at most one revolution. The rake plane
/// contains the point (x, r, azimuth) if azimuth = angle +- acos((height - tilt x) / r).
struct NosePiece {
  int interval;
  double u0, u1;
  double angle0, angle1;    ///< rad, azimuth of the rake plane's normal at both ends, unwrapped
  double height0, height1;  ///< mm
  double tilt0, tilt1;      ///< tangent of the normal's elevation above the plane of revolution
  bool free;  ///< true if the normal leans towards the spindle line by over 60 degrees: the angles
              ///< are undefined
};

/// Bounds of consecutive pieces: their nose centres in the meridian half-plane (x, r) and their
/// rake planes.
struct NoseNode {
  double x_low, x_high, r_low, r_high;  ///< mm
  double angle_low, angle_high;         ///< rad
  double height, tilt;                  ///< largest magnitudes, mm and tangent
  int first, count;                     ///< range of pieces
  int right;  ///< index of the second child; the first child is the next node
};

/// The sweep of a nose. Memory is linear in samples plus revolutions.
struct NoseSweep {
  Eigen::Matrix3d R_ws;  ///< rotation from spindle axes to the workpiece
  Eigen::Vector3d p_ws;  ///< mm, origin of the spindle axes in the workpiece
  std::vector<NoseInterval> intervals;
  std::vector<NosePiece> pieces;
  /// binary tree over the pieces in the order of time, root first; may be empty
  std::vector<NoseNode> nodes;
  /// An instant at which the whole disc inside the edge is part of the sweep's skin.
  struct Face {
    int interval;
    double u;
  };
  std::vector<Face> faces;  ///< instants at which the sweep begins, ends or reverses
};

/// Builds the sweep of a motion.
/// @throws std::invalid_argument if sizes differ, a number is not finite, time does not increase,
///         the spindle direction is not unit to 1e-9, a slow pose is not a rotation to 1e-9, or
///         the spindle makes more than 20 million revolutions
NoseSweep nose_sweep(const NoseMotion& motion);

/// A ray q + s n in frame t at one instant: x_t, z_t and y_t are linear in s, and so is the rate at
/// which the spindle carries the point through the rake plane.
struct RayInTool {
  Eigen::Vector2d point, step;  ///< (x_t, z_t)
  double y, y_step;
  double swing, swing_step;  ///< d y_t / d spindle angle
};
/// Transforms a ray from spindle axes into frame t at instant u of an interval.
RayInTool ray_in_tool(const NoseInterval& interval, double u, const Eigen::Vector3d& q,
                      const Eigen::Vector3d& n);

/// A segment of a vertex's ray, in spindle axes, that does not pass the spindle line, and its path
/// in the meridian half-plane: x is linear in s, the radius lies within `sag` below a line in s.
struct NoseRaySegment {
  Eigen::Vector3d q, n;
  double from, to;  // range of s
  double radius0, radius_step, sag;
  double radius_min;
  double azimuth;         // rad, at `from`
  double azimuth_spread;  // rad, from there to the other end
  double x_max;           // largest |x|, mm

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

/// Distance from the spindle line, mm, below which a point counts as lying in the rake plane at
/// every instant, provided that the plane passes as near.
inline constexpr double on_axis = 1e-8;

/// Returns the segment of the ray q + s n between two values of s, `from` < `to`.
NoseRaySegment stretch_of(const Eigen::Vector3d& q, const Eigen::Vector3d& n, double from,
                          double to);

/// Returns the s at which a ray comes nearest to the spindle line, or nothing if that is beyond the
/// band.
std::optional<double> nearest_to_axis(const Eigen::Vector3d& q, const Eigen::Vector3d& n,
                                      double band);

// The tests of one node are inline, because every node that a ray visits is tested.

/// Returns true if the rake plane of any piece below the node can contain a point of the ray,
/// judged by angle alone. Angles count modulo pi, because the two sides of the spindle line belong
/// to one plane.
inline bool can_face(const NoseNode& node, const NoseRaySegment& ray) {
  const double lift = node.height + node.tilt * ray.x_max;
  // 1e-12 mm: a plane through the spindle line, whatever the radius; avoids 0 / 0 on the line
  const double sine = lift < 1e-12 ? 0.0 : lift / ray.radius_min;
  if (!(sine < 1.0)) return true;
  // 1e-6 rad covers the rounding of the angles; a wider range only costs time
  const double slack = ray.azimuth_spread + std::asin(sine) + 1e-6;
  const double width = node.angle_high - node.angle_low + 2.0 * slack;
  if (width >= std::numbers::pi) return true;
  const double from = ray.azimuth - 0.5 * std::numbers::pi - (node.angle_low - slack);
  return from - std::numbers::pi * std::floor(from / std::numbers::pi) <= width;
}

/// Returns the smallest s of the segment at which the ray's line in the meridian half-plane comes
/// within the nose's reach of the box of nose centres, or infinity. It is a bound because a point
/// that is turned about the spindle line comes no nearer than its meridian does.
inline double rounded_box_entry(const NoseNode& node, const NoseRaySegment& ray,
                                double outer_radius) {
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
  // The ray entered at a corner of the widened box: it is within reach only past that corner's
  // circle.
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

/// Returns a lower bound of s at which a piece below the node can meet the ray; infinity if none
/// can.
inline double first_reach(const NoseNode& node, const NoseRaySegment& ray, double outer_radius) {
  // 1e-9 mm: more than the rounding of the box test
  return can_face(node, ray) ? rounded_box_entry(node, ray, outer_radius) - 1e-9
                             : std::numeric_limits<double>::infinity();
}

/// Bounds for the sweep of an edge with a profile. In the meridian half-plane of a ray the tools of
/// a node lie between straight sides parallel to those of the profile; these follow long edges
/// closely, where a circle about them would be far away. Memory is linear in the nodes.
class ProfileBound {
 public:
  ProfileBound(const EdgeProfile& profile, const NoseSweep& sweep);

  /// Returns a lower bound of s at which a piece below the node can meet the ray; infinity if none
  /// can.
  double first_reach(int index, const NoseNode& node, const NoseRaySegment& ray) const;

 private:
  /// Extent of the centres and tools below a node, mm.
  struct Extent {
    double up_low, up_high;  ///< of centres, normal to the spindle line in the first rake plane
    double off;     ///< largest displacement of a tool point by the turning since the first pose
    double beside;  ///< largest distance from the first rake plane
  };
  /// A side of the profile in the first pose: normal . (x, up) <= reach from its centre.
  struct Side {
    Eigen::Vector2d normal;
    double reach;
  };

  Extent extent_of(const NoseSweep& sweep, const NosePiece& piece) const;

  Eigen::Matrix3d R_;            // of the first pose
  Eigen::Vector3d up_, beside_;  // unit, normal to the spindle line
  // mm: of the profile, its reach downwards, and its reach along `beside`
  double outer_radius_, down_, wide_;
  std::vector<Side> sides_;
  std::vector<Extent> extents_;  // one per node
};

}  // namespace abbe::cutting
