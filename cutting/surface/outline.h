#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

/// Outlines of tools of revolution in the half plane through the axis: x is the distance from the
/// axis, y the height above the tip, both in mm. An outline is convex, or hollow and then the union
/// of convex ones (`profile_from_points` in tool.h).
namespace abbe::cutting {

/// Error of a point that an outline or an edge cannot have. what() reads "outline: expected ...,
/// seen ...".
struct OutlineError : std::invalid_argument {
  /// The number of the point that is wrong: one of its two coordinates, or the radius of the arc to
  /// it.
  enum class Number { First, Second, Radius };

  OutlineError(const std::string& what, const Eigen::Vector2d& point, Number of = Number::First)
      : std::invalid_argument(what), at(point), number(of) {}

  Eigen::Vector2d at;  ///< mm, the point
  Number number;       ///< the number that is wrong
};

/// Error of a point at which an outline that must be convex bends inwards.
struct InwardBend : OutlineError {
  using OutlineError::OutlineError;
};

// Lines, arcs and outlines.

/// A line, or an arc that bulges outwards, traversed with the tool on the left. A sharp corner is
/// an arc of radius 0.
struct OutlinePiece {
  bool is_arc;
  Eigen::Vector2d from, to;
  Eigen::Vector2d normal_from, normal_to;  ///< unit, outward, at the two ends
  double radius = 0.0;                     ///< mm, of an arc

  bool operator==(const OutlinePiece&) const = default;
};

/// An outline from the axis at the bottom to the axis at the top, closed. Immutable once
/// constructed. The bottom is at the tip, except for a part of a hollow outline, which may begin
/// above it.
struct ToolOutline {
  std::vector<OutlinePiece> pieces;
  double radius = 0.0;                  ///< mm, the largest
  double height = 0.0;                  ///< mm, of the top
  bool is_sharp = false;                ///< true if it has sharp corners below the top
  std::vector<ToolOutline> parts = {};  ///< convex; a hollow outline is their union; empty: convex

  bool operator==(const ToolOutline&) const = default;
};

inline bool is_hollow(const ToolOutline& outline) { return !outline.parts.empty(); }

/// Returns the height of the bottom above the tip, mm: 0 except for a part of a hollow outline.
inline double bottom(const ToolOutline& outline) {
  const double height = outline.pieces.front().from.y();
  return height > 1e-9 ? height : 0.0;  // 1e-9 mm: the start of an arc may miss the tip by rounding
}

/// A point of an outline, and the line or arc by which it is reached from the point before.
struct OutlinePoint {
  Eigen::Vector2d at;
  double radius = 0.0;  ///< mm, of an arc that bulges outwards, less than half a circle; 0: a line;
                        ///< below 0, only in `profile_from_points` (tool.h): an arc that bulges
                        ///< inwards
};

/// Returns the convex outline through points.
/// @param points  from the tip, whose height is 0, upwards; the bottom below the first and the top
///                above the last are flat
/// @throws std::invalid_argument if the outline is not convex, with the point and by how much
ToolOutline outline_from_points(const std::vector<OutlinePoint>& points);

/// Returns the convex outline of these lines and arcs, from the axis at its bottom to the axis at
/// its top; inserts the sharp corners between them.
/// @throws std::invalid_argument as outline_from_points
ToolOutline closed_outline(const std::vector<OutlinePiece>& pieces);

/// The APT cutter, defined by seven parameters.
struct AptCutter {
  double diameter = 10.0;  ///< mm, D: twice the radius at which the lines of bottom and flank meet
  double corner = 0.0;     ///< mm, R: radius of the corner
  double radial = 5.0;     ///< mm, E: distance of the corner's centre from the axis
  double axial = 0.0;      ///< mm, F: height of the corner's centre above the tip
  double bottom = 0.0;     ///< rad, alpha: rise of the bottom from the tip outwards
  double flank = 0.0;      ///< rad, beta: lean of the flank outwards from the axis
  double height = 20.0;    ///< mm, H: height of the cutting edge above the tip
};
/// Returns the cutter with its corner moved so that it is tangent to bottom and flank.
AptCutter with_tangent_corner(AptCutter cutter);

/// Returns the cutter with the diameter at which the tangent corner is centred on the axis: a ball
/// on a taper.
AptCutter with_ball_corner(AptCutter cutter);

/// Returns the outline of an APT cutter.
/// @throws std::invalid_argument if corner, bottom and flank do not meet in a convex outline
ToolOutline apt_outline(const AptCutter& cutter);

/// Returns how far the outline reaches from the tip along the direction with component `rise` along
/// the axis and `across` >= 0 normal to it, mm times the direction's length.
double support(const ToolOutline& outline, double rise, double across);

/// Returns the point where that reach is attained: the point touched by a plane with this outward
/// normal.
Eigen::Vector2d support_point(const ToolOutline& outline, double rise, double across);

/// Returns the radius of the flat at the top, mm.
double top_radius(const ToolOutline& outline);

/// Returns the height above the tip of the centre of the lowest arc whose centre lies between tip
/// and top, mm; 0 if there is none.
double corner_height(const ToolOutline& outline);

/// The interior of an outline that is at least a margin away from it, with arcs replaced by
/// polygons: nowhere less than the margin away, nor more than the margin plus 0.04 % of an arc's
/// radius.
struct InsetOutline {
  ToolOutline outline;
  double raised = 0.0;  ///< mm, height of its tip above that of the outline
};
/// Returns the interior of an outline at a margin, mm.
/// @param outline  convex
/// @throws std::invalid_argument if nothing is left
InsetOutline inside(const ToolOutline& outline, double margin);

/// Returns the largest difference between the reach of the two outlines, mm, over directions in
/// steps of 1 deg; if one is hollow, also the largest distance of a corner of one from the other.
double max_separation(const ToolOutline& a, const ToolOutline& b);

/// Signed distance of a point in the half plane, negative inside, with its unit gradient. Inside it
/// is a convex function that takes the nearest tangent. For a hollow outline it is that of the
/// nearest part.
struct OutlineDistance {
  double value;
  Eigen::Vector2d gradient;
};
/// Returns the signed distance of a point.
OutlineDistance distance(const ToolOutline& outline, const Eigen::Vector2d& place);
/// Overload for pieces that go around a convex region.
OutlineDistance distance(const std::vector<OutlinePiece>& pieces, const Eigen::Vector2d& place);

/// Returns the point of their hull that lies farthest in a direction of any length.
Eigen::Vector2d extreme_point(const std::vector<OutlinePiece>& pieces,
                              const Eigen::Vector2d& direction);

/// Returns the sine of the angle from a to b, times their lengths.
inline double sine_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Returns the line from one point to another.
OutlinePiece line_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

/// Returns the arc that bulges outwards, half a circle or less.
/// @throws std::invalid_argument if the radius is below half the chord
OutlinePiece arc_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius);

/// Returns the arc about a given centre.
OutlinePiece arc_piece_about(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius,
                             const Eigen::Vector2d& centre);

/// Returns the lines and arcs from the tip through the points to the axis at the top, without sharp
/// corners.
/// @throws std::invalid_argument if a number is negative or not finite, if the outline does not
///         start at height 0 or does not end above the tip and off the axis, or if an arc is too
///         small for its chord
std::vector<OutlinePiece> pieces_from_points(const std::vector<OutlinePoint>& points);

/// mm; points nearer to each other than this are the same point.
inline constexpr double same_place = 1e-9;

/// rad; a joint may bend inwards by this much, which is rounding of input.
inline constexpr double min_bend = 1e-7;

/// Returns the sine of the angle by which an outline bends inwards at the beginning of a piece; 0
/// or less if it does not.
double inward_bend(const OutlinePiece& before, const OutlinePiece& piece);

/// Returns consecutive pieces with the sharp corners inserted between them; splits arcs beyond a
/// right angle in two.
/// @param before  outward normal at the end of the piece that the first one follows
/// @throws std::invalid_argument if a joint bends inwards, with the point and by how much
std::vector<OutlinePiece> with_corners(const std::vector<OutlinePiece>& pieces,
                                       const Eigen::Vector2d& before);

}  // namespace abbe::cutting
