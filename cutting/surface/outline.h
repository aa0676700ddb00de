#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

/// Outlines of tools of revolution in the half plane through the axis: x is the distance from the
/// axis, y the height above the tip, both in mm. An outline is convex, or hollow and then the union
/// of convex ones (`profile_from_points` in tool.h).
namespace abbe::cutting {

/// Error about an invalid point of an outline or an edge. what() reads "outline: expected ..., seen
/// ...".
struct OutlineError : std::invalid_argument {
  /// Numbers of a point: its two coordinates and the radius of the arc that leads to it.
  enum class Number { First, Second, Radius };

  OutlineError(const std::string& message, const Eigen::Vector2d& point,
               Number wrong_number = Number::First)
      : std::invalid_argument(message), at(point), number(wrong_number) {}

  Eigen::Vector2d at;  ///< mm, the point
  Number number;       ///< the number that is wrong
};

/// Error about a point at which an outline that must be convex bends inwards.
struct InwardBendError : OutlineError {
  using OutlineError::OutlineError;
};

// Lines, arcs and outlines.

/// A line, or an arc that bulges outwards; the tool is on the left of its direction. A sharp corner
/// is an arc of radius 0.
struct OutlineSegment {
  bool is_arc;
  Eigen::Vector2d from, to;
  Eigen::Vector2d normal_from, normal_to;  ///< unit, outward, at the two ends
  double radius = 0.0;                     ///< mm, of an arc

  bool operator==(const OutlineSegment&) const = default;
};

/// An outline from the axis at the bottom to the axis at the top, closed. Immutable once
/// constructed. The bottom is at the tip, except for a part of a hollow outline, which may begin
/// above it.
struct ToolOutline {
  std::vector<OutlineSegment> segments;
  double radius = 0.0;                  ///< mm, the largest
  double height = 0.0;                  ///< mm, of the top
  bool is_sharp = false;                ///< true if it has sharp corners below the top
  std::vector<ToolOutline> parts = {};  ///< convex; a hollow outline is their union; empty: convex

  bool operator==(const ToolOutline&) const = default;
};

inline bool is_hollow(const ToolOutline& outline) { return !outline.parts.empty(); }

/// Returns the height of the bottom above the tip, mm: 0 except for a part of a hollow outline.
inline double bottom(const ToolOutline& outline) {
  const double height = outline.segments.front().from.y();
  return height > 1e-9 ? height : 0.0;  // 1e-9 mm: the start of an arc may miss the tip by rounding
}

/// A point of an outline, with the line or arc that leads to it from the previous point.
struct OutlinePoint {
  Eigen::Vector2d at;
  double radius = 0.0;  ///< mm, of an arc that bulges outwards, less than half a circle; 0: a line;
                        ///< below 0, only in `profile_from_points` (tool.h): an arc that bulges
                        ///< inwards
};

/// Returns the convex outline through points.
/// @param points  from the tip, whose height is 0, upwards; the bottom below the first and the top
///                above the last are flat
/// @throws std::invalid_argument if the outline is not convex; the message gives the point and the
///         angle
ToolOutline outline_from_points(const std::vector<OutlinePoint>& points);

/// Returns the convex outline of lines and arcs from the axis at the bottom to the axis at the top.
/// Inserts the sharp corners between them.
/// @throws std::invalid_argument as outline_from_points
ToolOutline closed_outline(const std::vector<OutlineSegment>& segments);

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

/// Returns the point that reaches farthest in the direction of `support`: a plane with this outward
/// normal touches it.
Eigen::Vector2d support_point(const ToolOutline& outline, double rise, double across);

/// Returns the radius of the flat at the top, mm.
double top_radius(const ToolOutline& outline);

/// Returns the height above the tip of the centre of the lowest arc whose centre lies between tip
/// and top, mm; 0 if there is none.
double corner_height(const ToolOutline& outline);

/// The interior of an outline at a margin, with arcs replaced by polygons. Its distance from the
/// outline is at least the margin and at most the margin plus 0.04 % of an arc's radius.
struct InsetOutline {
  ToolOutline outline;
  double raised = 0.0;  ///< mm, height of the tip above the tip of the original outline
};
/// Returns the interior of a convex outline at a margin, mm.
/// @throws std::invalid_argument if nothing is left
InsetOutline inset_convex(const ToolOutline& outline, double margin);

/// Returns the maximum difference between the reaches of two outlines, mm, over directions in steps
/// of 1 deg. If an outline is hollow, the distances of the corners of each outline from the other
/// one are included in the maximum.
double max_separation(const ToolOutline& a, const ToolOutline& b);

/// Signed distance of a point in the half plane, negative inside, with its unit gradient. Inside a
/// convex outline it is the distance to the nearest tangent, which is a convex function. For a
/// hollow outline it is the distance from the nearest part.
struct OutlineDistance {
  double value;
  Eigen::Vector2d gradient;
};
/// Returns the signed distance of a point from an outline.
OutlineDistance distance(const ToolOutline& outline, const Eigen::Vector2d& point);
/// Overload for the boundary of a convex region.
OutlineDistance distance(const std::vector<OutlineSegment>& segments, const Eigen::Vector2d& point);

/// Returns the point of the segments' hull that lies farthest in a direction, which may have any
/// length.
Eigen::Vector2d extreme_point(const std::vector<OutlineSegment>& segments,
                              const Eigen::Vector2d& direction);

/// Returns the cross product: the lengths of the vectors times the sine of the angle from a to b.
inline double cross2d(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Returns the line from one point to another.
OutlineSegment line_segment(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

/// Returns the arc that bulges outwards, half a circle or less.
/// @throws std::invalid_argument if the radius is below half the chord
OutlineSegment arc_segment(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius);

/// Returns the arc about a given centre.
OutlineSegment arc_segment_about(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                                 double radius, const Eigen::Vector2d& centre);

/// Returns the lines and arcs from the tip through the points to the axis at the top, without sharp
/// corners.
/// @throws std::invalid_argument if a number is negative or not finite, if the outline does not
///         start at height 0 or does not end above the tip and off the axis, or if an arc is too
///         small for its chord
std::vector<OutlineSegment> segments_from_points(const std::vector<OutlinePoint>& points);

/// Points nearer to each other than this are the same point, mm.
inline constexpr double coincidence_tolerance = 1e-9;

/// Inward bend that a joint may have through rounding of the input, rad.
inline constexpr double bend_tolerance = 1e-7;

/// Returns the sine of the angle by which an outline bends inwards at the start of a segment; not
/// positive if it does not bend inwards.
double inward_bend(const OutlineSegment& previous, const OutlineSegment& segment);

/// Returns consecutive segments with the sharp corners inserted between them. Splits arcs of more
/// than a right angle in two.
/// @param normal_before  outward normal at the end of the segment before the first one
/// @throws std::invalid_argument if a joint bends inwards; the message gives the point and the
/// angle
std::vector<OutlineSegment> with_corners(const std::vector<OutlineSegment>& segments,
                                         const Eigen::Vector2d& normal_before);

}  // namespace abbe::cutting
