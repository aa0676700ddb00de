#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/outline.h"

/// Edges of turning inserts: convex regions of lines and arcs in the rake plane, x and z of frame t
/// in mm. The part lies below, at -z, and the feed goes to -x: on the XZ platform and on the lathe
/// of `scenes/machines` these are the faces and cylinders that the tool's x and z look away from.
/// An insert that feeds to +x has its two angles and lengths exchanged.
namespace abbe::cutting {

/// The region inside of an edge, the origin of frame t in it; immutable once made.
struct EdgeProfile {
  std::vector<OutlinePiece> pieces;  ///< counter-clockwise from x to z, closed, with sharp corners
  double radius = 0.0;               ///< mm, of the nose; of a free edge of the largest circle
                                     ///< about the origin in it
  double outer_radius = 0.0;         ///< mm, of the circle about the origin that holds it
};

/// A nose and its two straight edges, tangent to it; behind them the body is a parallelogram.
/// ISO 3002-1 and ISO 1832; the included angle is pi - major - minor.
struct Insert {
  double radius = 0.8;        ///< mm, of the nose about the origin, > 0
  double major = 0.0;         ///< rad, tool cutting edge angle kappa_r: from the feed -x to the
                              ///< edge ahead, which runs from the nose along (-cos, sin)
  double minor = 0.0;         ///< rad, kappa_r': from +x to the edge behind, along (cos, sin)
  double major_length = 5.0;  ///< mm, from where it leaves the nose
  double minor_length = 5.0;  ///< mm, from where it leaves nose or wiper
  double wiper = 0.0;         ///< mm, b_s: a flat along the feed, from below the origin towards +x,
                              ///< so long that the minor edge passes the nose; 0: none
};
/// @throws std::invalid_argument naming the number, or where the body does not hold the circle of
/// the nose
EdgeProfile insert_profile(const Insert& insert);

/// @param points  (x, z), around the region counter-clockwise; each is reached from the one before,
///                the first from the last
/// @throws std::invalid_argument for what is not convex, with the point and how far it is off, goes
///         around more than once or the other way, or does not hold the origin
EdgeProfile edge_profile_from_points(const std::vector<OutlinePoint>& points);

/// What the region covers as it is drawn away from the part: a stock that is one radius at every
/// place along the spindle has an edge that overhangs cut as one along `away`.
/// @param away  unit
EdgeProfile without_overhang(const EdgeProfile& profile, const Eigen::Vector2d& away);

/// mm along `away` from the place nearest to the part: the end of the highest edge on one side, of
/// those that overhang by 15 deg at most.
/// @param side  unit, across `away`
double edge_height(const EdgeProfile& profile, const Eigen::Vector2d& away,
                   const Eigen::Vector2d& side);

/// Where the line point + s step is inside, to 1e-12 mm across an edge.
struct Chord {
  double begin, end;  ///< of s
};
std::optional<Chord> chord(const EdgeProfile& profile, const Eigen::Vector2d& point,
                           const Eigen::Vector2d& step);

/// The point that lies farthest in a direction of any length.
Eigen::Vector2d extreme_point(const EdgeProfile& profile, const Eigen::Vector2d& direction);

/// mm, the most by which one of two reaches farther than the other in any direction; to 1e-3 of
/// itself.
double max_separation(const EdgeProfile& a, const EdgeProfile& b);

/// A point of the edge, and the outward normal there.
struct EdgePoint {
  Eigen::Vector2d at;
  Eigen::Vector2d outward;  ///< unit
};
/// @param psi  rad, about the origin from x to z
EdgePoint edge_point(const EdgeProfile& profile, double psi);

}  // namespace abbe::cutting
