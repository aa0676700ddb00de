#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/outline.h"

/// Cutting edges of turning inserts: convex regions of lines and arcs in the rake plane, with x and
/// z of frame t in mm. The part lies below, at -z, and the feed goes to -x: on the XZ platform and
/// on the lathe of `scenes/machines` these are the faces and cylinders that the tool's x and z
/// point away from. An insert that feeds to +x has its two angles and its two lengths exchanged.
namespace abbe::cutting {

/// The region inside an edge; it contains the origin of frame t. Immutable once constructed.
struct EdgeProfile {
  std::vector<OutlineSegment>
      segments;  ///< counter-clockwise from x to z, closed, with sharp corners
  /// mm, of the nose; for a free edge, of the largest circle about the origin inside it
  double radius = 0.0;
  double outer_radius = 0.0;  ///< mm, of the circle about the origin that contains it
};

/// An insert: a nose with two straight edges tangent to it; the body behind them is a
/// parallelogram. ISO 3002-1 and ISO 1832; the included angle is pi - major - minor.
struct Insert {
  double radius = 0.8;  ///< mm, of the nose, which is centred at the origin, > 0
  double major = 0.0;   ///< rad, tool cutting edge angle kappa_r: from the feed direction -x to the
                        ///< leading edge, which runs from the nose along (-cos, sin)
  double minor = 0.0;   ///< rad, kappa_r': from +x to the trailing edge, along (cos, sin)
  double major_length = 5.0;  ///< mm, from the end of the nose
  double minor_length = 5.0;  ///< mm, from the end of the nose or of the wiper
  double wiper = 0.0;  ///< mm, b_s: a flat along the feed, from below the origin towards +x, so
                       ///< long that the minor edge clears the nose; 0: none
};
/// Builds the profile of an insert.
/// @throws std::invalid_argument naming the parameter that is out of range, or if the body does not
///         contain the circle of the nose
EdgeProfile insert_profile(const Insert& insert);

/// Builds the profile of a free edge.
/// @param points  (x, z), counter-clockwise around the region; each is reached from the one before,
///                the first from the last
/// @throws std::invalid_argument if the edge is not convex (with the point and by how much), goes
///         around more than once, is clockwise, or does not contain the origin
EdgeProfile edge_profile_from_points(const std::vector<OutlinePoint>& points);

/// Returns the region that the profile sweeps when it is retracted from the part along `away`. In a
/// stock with one radius at every position along the spindle an overhanging edge cuts like an edge
/// along `away`.
/// @param away  unit
EdgeProfile without_overhang(const EdgeProfile& profile, const Eigen::Vector2d& away);

/// Returns the height, mm along `away`, of the highest edge on one side above the point nearest to
/// the part. Edges that overhang by more than 15 deg are not counted.
/// @param side  unit, normal to `away`
double edge_height(const EdgeProfile& profile, const Eigen::Vector2d& away,
                   const Eigen::Vector2d& side);

/// The range of s for which the line point + s step is inside a profile, to 1e-12 mm across an
/// edge.
struct Chord {
  double begin, end;  ///< values of s
};
/// Returns the range of s inside the profile, or nothing if the line misses it.
std::optional<Chord> chord(const EdgeProfile& profile, const Eigen::Vector2d& point,
                           const Eigen::Vector2d& step);

/// Returns the point that lies farthest in a direction of any length.
Eigen::Vector2d extreme_point(const EdgeProfile& profile, const Eigen::Vector2d& direction);

/// Returns the maximum difference between the reaches of two profiles over all directions, mm, with
/// a relative error of 1e-3.
double max_separation(const EdgeProfile& a, const EdgeProfile& b);

/// A point of the edge, mm, with its outward normal.
struct EdgePoint {
  Eigen::Vector2d at;
  Eigen::Vector2d outward;  ///< unit
};
/// Returns the point of the edge at polar angle `psi`.
/// @param psi  rad, about the origin from x to z
EdgePoint edge_point(const EdgeProfile& profile, double psi);

}  // namespace abbe::cutting
