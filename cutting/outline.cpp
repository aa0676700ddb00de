#include "cutting/outline.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cutting/outline_pieces.h"
#include "kinematics/require.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

constexpr double same_place = 1e-9;   // mm
constexpr double same_normal = 1e-7;  // rad, by which it may turn back: rounding of input

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

ToolOutline closed(const std::vector<OutlinePiece>& pieces) {
  ToolOutline outline{with_corners(pieces, {0, -1})};
  for (const OutlinePiece& piece : outline.pieces) {
    require(piece.normal_from.x() >= -same_normal && piece.normal_to.x() >= -same_normal,
            fmt::format("outline: expected it to go on up to its top, seen that it turns back at "
                        "({:g}, {:g}) mm",
                        piece.to.x(), piece.to.y()));
    outline.radius = std::max({outline.radius, piece.from.x(), piece.to.x()});
    // an arc may reach farther between its ends
    if (cross(piece.normal_from, Vector2d::UnitX()) > 0.0 &&
        cross(Vector2d::UnitX(), piece.normal_to) > 0.0)
      outline.radius =
          std::max(outline.radius, piece.from.x() + piece.radius * (1.0 - piece.normal_from.x()));
    outline.height = std::max(outline.height, piece.to.y());
  }
  for (const OutlinePiece& piece : outline.pieces)
    outline.is_sharp |=
        piece.is_arc && piece.radius == 0.0 && piece.from.y() < outline.height - same_place;
  return outline;
}

}  // namespace

ToolOutline outline_through(const std::vector<OutlinePoint>& points) {
  require(!points.empty(), "outline: expected a point and more, seen none");
  std::vector<OutlinePiece> pieces;
  Vector2d last = Vector2d::Zero();
  const auto add = [&](const OutlinePoint& point) {
    require(point.at.allFinite() && std::isfinite(point.radius) && point.radius >= 0.0 &&
                point.at.x() >= 0.0,
            fmt::format("outline: expected finite numbers of 0 and more, seen ({:g}, {:g}) mm",
                        point.at.x(), point.at.y()));
    if ((point.at - last).norm() > same_place)
      pieces.push_back(point.radius > 0.0 ? arc_piece(last, point.at, point.radius)
                                          : line_piece(last, point.at));
    last = point.at;
  };
  require(std::abs(points.front().at.y()) <= same_place,
          fmt::format("outline: expected it to begin at height 0, seen {:g} mm",
                      points.front().at.y()));
  for (const OutlinePoint& point : points) add(point);
  require(last.x() > same_place && last.y() > same_place,
          "outline: expected it to end above the tip and beside the axis");
  add({{0.0, last.y()}});
  return closed(pieces);
}

ToolOutline apt_outline(const AptCutter& cutter) {
  const auto& [diameter, corner, radial, axial, bottom, flank, height] = cutter;
  constexpr double quarter = 0.5 * pi;
  require(diameter > 0.0 && corner >= 0.0 && height > 0.0 && bottom >= 0.0 && bottom < quarter &&
              std::abs(flank) < quarter && bottom + std::max(flank, 0.0) < quarter,
          "APT cutter: expected a diameter and a height above 0, a corner of 0 and more, a bottom "
          "from 0 and a flank within 90 deg, together below it");
  const Vector2d outwards(std::cos(bottom), std::sin(bottom)), up(std::sin(flank), std::cos(flank));
  const Vector2d meet = 0.5 * diameter / outwards.x() * outwards;
  const auto at_height = [&](double y) -> Vector2d { return meet + (y - meet.y()) / up.y() * up; };
  require(at_height(height).x() > 0.0 && height > meet.y(),
          "APT cutter: expected a flank that ends above the corner and beside the axis");
  if (corner == 0.0) return outline_through({{{0, 0}}, {meet}, {at_height(height)}});
  const Vector2d centre(radial, axial);
  // half of the chord that a line through `point` cuts out of the corner's circle
  const auto foot = [&](const Vector2d& point, const Vector2d& along, const char* what) {
    const double off = std::abs(cross(along, centre - point));
    require(
        off <= corner + 1e-6,
        fmt::format("APT cutter: expected the {} to meet the corner of {:g} mm, seen it {:g} mm "
                    "from its middle",
                    what, corner, off));
    const double half = std::sqrt(std::max(0.0, corner * corner - off * off));
    return std::pair(Vector2d(point + along.dot(centre - point) * along), half);
  };
  const auto [below, half_below] = foot({0, 0}, outwards, "bottom");
  const auto [beside, half_beside] = foot(meet, up, "flank");
  const Vector2d start = below + half_below * outwards, end = beside - half_beside * up;
  require(start.x() > -same_place && end.y() < height,
          "APT cutter: expected the corner between the axis and the top");
  std::vector<OutlinePiece> pieces;
  if (start.norm() > same_place) pieces.push_back(line_piece({0, 0}, start));
  pieces.push_back(arc_piece_about(start, end, corner, centre));
  pieces.push_back(line_piece(end, at_height(height)));
  pieces.push_back(line_piece(at_height(height), {0, height}));
  return closed(pieces);
}

// What an arc adds to its first point is counted from there, so that large radii cost no digits.

double support(const ToolOutline& outline, double rise, double across) {
  const Vector2d direction(across, rise);
  double most = 0.0;  // the tip
  for (const OutlinePiece& piece : outline.pieces) {
    most = std::max(most, direction.dot(piece.to));
    const double beyond = cross(piece.normal_from, direction);
    if (piece.is_arc && beyond > 0.0 && cross(direction, piece.normal_to) > 0.0)
      most = std::max(most, direction.dot(piece.from) +
                                piece.radius * beyond * beyond /
                                    (direction.norm() + piece.normal_from.dot(direction)));
  }
  return most;
}

OutlineDistance distance(const ToolOutline& outline, const Vector2d& place) {
  return distance(outline.pieces, place);
}

OutlineDistance distance(const std::vector<OutlinePiece>& pieces, const Vector2d& place) {
  OutlineDistance most{-1e300, {0, -1}};
  const auto take = [&](double value, const Vector2d& gradient) {
    if (value > most.value) most = {value, gradient};
  };
  for (const OutlinePiece& piece : pieces) {
    const Vector2d v = place - piece.from, w = place - piece.to;
    const double off = piece.normal_from.dot(v);
    if (piece.is_arc && cross(piece.normal_from, v) >= 0.0 && cross(w, piece.normal_to) >= 0.0) {
      const Vector2d from_centre = v + piece.radius * piece.normal_from;
      const double far = from_centre.norm();
      if (far > 0.0)
        take((v.squaredNorm() + 2.0 * piece.radius * off) / (far + piece.radius),
             from_centre / far);
    } else {
      take(off, piece.normal_from);
      if (piece.is_arc) take(piece.normal_to.dot(w), piece.normal_to);
    }
  }
  return most;
}

}  // namespace abbe::cutting
