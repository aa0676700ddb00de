#pragma once

#include <vector>

#include <Eigen/Core>

/// Tools of revolution by their outline in the half plane through the axis: x from the axis, y
/// above the tip, both in mm. Convex, or hollow and then the union of convex ones
/// (`hollow_outline.h`).
namespace abbe::cutting {

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
ToolOutline outline_through(const std::vector<OutlinePoint>& points);

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
struct InnerOutline {
  ToolOutline outline;
  double raised = 0.0;  ///< mm, of its tip
};
/// @param outline  convex
/// @throws std::invalid_argument where nothing is left
InnerOutline inside(const ToolOutline& outline, double margin);

/// mm, by which one of the two reaches farther in any direction, on 1 deg of directions; if one is
/// hollow also how far a corner of one is off the other.
double farthest_apart(const ToolOutline& a, const ToolOutline& b);

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
Eigen::Vector2d foremost(const std::vector<OutlinePiece>& pieces, const Eigen::Vector2d& direction);

}  // namespace abbe::cutting
