#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::cutting {

/// A point that an outline or an edge cannot have. what(): "outline: expected ..., seen ..."
struct OutlineError : std::invalid_argument {
  /// Of a point the two coordinates, or the radius of the arc to it.
  enum class Number { First, Second, Radius };

  OutlineError(const std::string& what, const Eigen::Vector2d& point, Number of = Number::First)
      : std::invalid_argument(what), at(point), number(of) {}

  Eigen::Vector2d at;  ///< mm, the point
  Number number;       ///< by which it is wrong
};

/// A point at which an outline that is to be convex bends inwards.
struct InwardBend : OutlineError {
  using OutlineError::OutlineError;
};

// Tools of revolution by their outline in the half plane through the axis: x from the axis, y
// above the tip, both in mm. Convex, or hollow and then the union of convex ones
// (`hollow_outline.h`).

/// A line, or an arc that bulges outwards, run through with the tool on the left. A sharp corner is
/// an arc of no radius.
struct OutlinePiece {
  bool is_arc;
  Eigen::Vector2d from, to;
  Eigen::Vector2d normal_from, normal_to;  ///< unit, outward, at its ends
  double radius = 0.0;                     ///< mm, of an arc

  bool operator==(const OutlinePiece&) const = default;
};

/// From the axis at the bottom to the axis at the top, closed; immutable once made. The bottom is
/// at the tip, but of a part of a hollow outline, which may begin above it.
struct ToolOutline {
  std::vector<OutlinePiece> pieces;
  double radius = 0.0;                  ///< mm, the largest
  double height = 0.0;                  ///< mm, of the top
  bool is_sharp = false;                ///< it has sharp corners below the top
  std::vector<ToolOutline> parts = {};  ///< convex, whose union it is if it is hollow; none: convex

  bool operator==(const ToolOutline&) const = default;
};

inline bool is_hollow(const ToolOutline& outline) { return !outline.parts.empty(); }

/// mm above the tip, of the bottom: 0 but of a part of a hollow outline.
inline double bottom(const ToolOutline& outline) {
  const double height = outline.pieces.front().from.y();
  return height > 1e-9 ? height : 0.0;  // an arc may begin at the tip to rounding
}

/// A point of an outline, and how it is reached from the one before.
struct OutlinePoint {
  Eigen::Vector2d at;
  double radius = 0.0;  ///< mm, of an arc that bulges outwards, less than half a circle; 0: a line;
                        ///< below 0, of a profile (`hollow_outline.h`) alone: inwards
};

/// @param points  from the tip, whose height is 0, upwards; the bottom below the first and the top
///                above the last are flat
/// @throws std::invalid_argument for what is not convex, with the point and how far it is off
ToolOutline outline_from_points(const std::vector<OutlinePoint>& points);

/// The convex outline of these lines and arcs, from the axis at its bottom to the axis at its top,
/// between which the sharp corners are put in.
/// @throws std::invalid_argument as outline_through
ToolOutline closed_outline(const std::vector<OutlinePiece>& pieces);

/// The cutter of APT, by seven parameters.
struct AptCutter {
  double diameter = 10.0;  ///< mm, D: where the lines of bottom and flank meet
  double corner = 0.0;     ///< mm, R: radius of the corner
  double radial = 5.0;     ///< mm, E: of the middle of the corner from the axis
  double axial = 0.0;      ///< mm, F: of the same above the tip
  double bottom = 0.0;     ///< rad, alpha: by which the bottom rises from the tip outwards
  double flank = 0.0;      ///< rad, beta: by which the flank leans outwards from the axis
  double height = 20.0;    ///< mm, H: of the cutting edge above the tip
};
/// The same with its corner tangent to bottom and flank.
AptCutter with_tangent_corner(AptCutter cutter);

/// The same of the diameter that has that corner's middle on the axis: a ball on a taper.
AptCutter with_ball_corner(AptCutter cutter);

/// @throws std::invalid_argument where corner, bottom and flank do not meet in a convex outline
ToolOutline apt_outline(const AptCutter& cutter);

/// How far it reaches from the tip along a direction that goes by `rise` along the axis and by
/// `across` >= 0 across it.
double support(const ToolOutline& outline, double rise, double across);

/// Where that is reached: the place touched by a plane with this outward normal.
Eigen::Vector2d support_point(const ToolOutline& outline, double rise, double across);

/// mm, of the flat at the top.
double top_radius(const ToolOutline& outline);

/// mm above the tip, of the middle of the lowest arc between tip and top; 0 without one.
double corner_height(const ToolOutline& outline);

/// What lies inside of an outline by a margin and more, with arcs as polygons: nowhere less than
/// the margin, nor more than it by over 0.04 % of an arc's radius.
struct InsetOutline {
  ToolOutline outline;
  double raised = 0.0;  ///< mm, of its tip
};
/// @param outline  convex
/// @throws std::invalid_argument where nothing is left
InsetOutline inside(const ToolOutline& outline, double margin);

/// mm, by which one of the two reaches farther in any direction, on 1 deg of directions; if one is
/// hollow also how far a corner of one is off the other.
double max_separation(const ToolOutline& a, const ToolOutline& b);

/// Signed distance of a place in the half plane, negative inside, where it is a convex function
/// that counts the nearest tangent; with its unit gradient. Of a hollow outline that of its nearest
/// part.
struct OutlineDistance {
  double value;
  Eigen::Vector2d gradient;
};
OutlineDistance distance(const ToolOutline& outline, const Eigen::Vector2d& place);
/// The same of pieces that go around a convex region.
OutlineDistance distance(const std::vector<OutlinePiece>& pieces, const Eigen::Vector2d& place);

/// The point of their hull that lies farthest in a direction of any length.
Eigen::Vector2d extreme_point(const std::vector<OutlinePiece>& pieces,
                              const Eigen::Vector2d& direction);

/// Of the angle from a to b, times their lengths.
inline double sine_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

OutlinePiece line_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

/// Less than half a circle, or half of one.
/// @throws std::invalid_argument for a radius below half the chord
OutlinePiece arc_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius);

OutlinePiece arc_piece_about(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius,
                             const Eigen::Vector2d& centre);

/// Lines and arcs from the tip through the points to the axis at the top, without sharp corners.
/// @throws std::invalid_argument for numbers below 0 or not finite, for other beginnings and ends,
///         and for arcs too small for their chords
std::vector<OutlinePiece> pieces_from_points(const std::vector<OutlinePoint>& points);

/// mm; points that are nearer to each other are one.
inline constexpr double same_place = 1e-9;

/// rad, by which a joint may bend inwards: rounding of input.
inline constexpr double min_bend = 1e-7;

/// The sine by which an outline bends inwards at the beginning of a piece; 0 and less: it does not.
double inward_bend(const OutlinePiece& before, const OutlinePiece& piece);

/// Pieces that follow each other, with the sharp corners between them; arcs beyond a right angle as
/// two.
/// @param before  outward normal at the end of what the first follows
/// @throws std::invalid_argument for what bends inwards, with the point and by how much
std::vector<OutlinePiece> with_corners(const std::vector<OutlinePiece>& pieces,
                                       const Eigen::Vector2d& before);

}  // namespace abbe::cutting
