#include "cutting/surface/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

constexpr double same_normal = 1e-7;  // rad, by which a normal may turn back: rounding of input

}  // namespace

ToolOutline closed_outline(const std::vector<OutlinePiece>& pieces) {
  ToolOutline outline{with_corners(pieces, {0, -1})};
  for (const OutlinePiece& piece : outline.pieces) {
    if (!(piece.normal_from.x() >= -same_normal && piece.normal_to.x() >= -same_normal))
      throw OutlineError(
          fmt::format("outline: expected it to go on up to its top, seen that it turns back at "
                      "({:g}, {:g}) mm",
                      piece.to.x(), piece.to.y()),
          piece.to, OutlineError::Number::Second);
    outline.radius = std::max({outline.radius, piece.from.x(), piece.to.x()});
    // An arc may reach farther between its ends.
    if (sine_between(piece.normal_from, Vector2d::UnitX()) > 0.0 &&
        sine_between(Vector2d::UnitX(), piece.normal_to) > 0.0)
      outline.radius =
          std::max(outline.radius, piece.from.x() + piece.radius * (1.0 - piece.normal_from.x()));
    outline.height = std::max(outline.height, piece.to.y());
  }
  for (const OutlinePiece& piece : outline.pieces)
    outline.is_sharp |=
        piece.is_arc && piece.radius == 0.0 && piece.from.y() < outline.height - same_place;
  return outline;
}

ToolOutline outline_from_points(const std::vector<OutlinePoint>& points) {
  return closed_outline(pieces_from_points(points));
}

AptCutter with_tangent_corner(AptCutter cutter) {
  // Outward normals of bottom and flank: the centre lies the corner radius inside both lines.
  const Vector2d off_bottom(std::sin(cutter.bottom), -std::cos(cutter.bottom));
  const Vector2d off_flank(std::cos(cutter.flank), -std::sin(cutter.flank));
  const Vector2d meet(0.5 * cutter.diameter, 0.5 * cutter.diameter * std::tan(cutter.bottom));
  Eigen::Matrix2d normals;
  normals << off_bottom.transpose(), off_flank.transpose();
  const Vector2d middle = meet - cutter.corner * normals.inverse() * Vector2d::Ones();
  cutter.radial = middle.x();
  cutter.axial = middle.y();
  return cutter;
}

AptCutter with_ball_corner(AptCutter cutter) {
  const double middle = cutter.corner / std::cos(cutter.bottom);
  cutter.diameter = 2.0 * (cutter.corner - middle * std::sin(cutter.flank)) /
                    (std::cos(cutter.flank) - std::sin(cutter.flank) * std::tan(cutter.bottom));
  cutter.radial = 0.0;
  cutter.axial = middle;
  return cutter;
}

ToolOutline apt_outline(const AptCutter& cutter) {
  const auto& [diameter, corner, radial, axial, bottom, flank, height] = cutter;
  // bottom and flank must meet: together they leave less than a right angle
  constexpr double quarter = 0.5 * pi;
  require(
      diameter > 0.0 && corner >= 0.0 && height > 0.0 && bottom >= 0.0 && bottom < quarter &&
          std::abs(flank) < quarter && bottom + std::max(flank, 0.0) < quarter,
      fmt::format("APT cutter: expected a diameter and a height above 0, a corner of 0 and more, "
                  "a bottom from 0 and a flank within 90 deg, together below it, seen {:g}, {:g} "
                  "and {:g} mm, {:g} and {:g} deg",
                  diameter, height, corner, bottom / units::deg, flank / units::deg));
  const Vector2d outwards(std::cos(bottom), std::sin(bottom)), up(std::sin(flank), std::cos(flank));
  const Vector2d meet = 0.5 * diameter / outwards.x() * outwards;
  const auto at_height = [&](double y) -> Vector2d { return meet + (y - meet.y()) / up.y() * up; };
  require(at_height(height).x() > 0.0 && height > meet.y(),
          fmt::format("APT cutter: expected a flank that ends above its lower end and beside the "
                      "axis, seen it from {:g} to {:g} mm above the tip, at a radius of {:g} mm",
                      meet.y(), height, at_height(height).x()));
  if (corner == 0.0) return outline_from_points({{{0, 0}}, {meet}, {at_height(height)}});
  const Vector2d centre(radial, axial);
  // Returns the foot of the corner's centre on a line through `point`, and half of the chord that
  // the line cuts out of the corner's circle. 1e-6 mm permits parameters rounded for a tangent
  // corner.
  const auto foot = [&](const Vector2d& point, const Vector2d& along, const char* what) {
    const double off = std::abs(sine_between(along, centre - point));
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
  require(
      start.x() > -same_place && end.y() < height,
      fmt::format("APT cutter: expected the corner between the axis and the top, {:g} mm above the "
                  "tip, seen it from a radius of {:g} mm to {:g} mm above the tip",
                  height, start.x(), end.y()));
  std::vector<OutlinePiece> pieces;
  if (start.norm() > same_place) pieces.push_back(line_piece({0, 0}, start));
  pieces.push_back(arc_piece_about(start, end, corner, centre));
  pieces.push_back(line_piece(end, at_height(height)));
  pieces.push_back(line_piece(at_height(height), {0, height}));
  return closed_outline(pieces);
}

// Positions on an arc are computed relative to its first point, so that large radii cost no digits.

double support(const ToolOutline& outline, double rise, double across) {
  const Vector2d direction(across, rise);
  double most = rise * bottom(outline);
  for (const OutlinePiece& piece : outline.pieces) {
    most = std::max(most, direction.dot(piece.to));
    const double beyond = sine_between(piece.normal_from, direction);
    if (piece.is_arc && beyond > 0.0 && sine_between(direction, piece.normal_to) > 0.0)
      most = std::max(most, direction.dot(piece.from) +
                                piece.radius * beyond * beyond /
                                    (direction.norm() + piece.normal_from.dot(direction)));
  }
  return most;
}

// The extreme point is a corner, or the point of an arc whose normal is the direction.
Vector2d extreme_point(const std::vector<OutlinePiece>& pieces, const Vector2d& direction) {
  Vector2d best = pieces.front().from;
  const auto take = [&](const Vector2d& place) {
    if (direction.dot(place) > direction.dot(best)) best = place;
  };
  for (const OutlinePiece& piece : pieces) {
    take(piece.to);
    if (piece.is_arc && sine_between(piece.normal_from, direction) > 0.0 &&
        sine_between(direction, piece.normal_to) > 0.0)
      take(piece.from + piece.radius * (direction.normalized() - piece.normal_from));
  }
  return best;
}

Vector2d support_point(const ToolOutline& outline, double rise, double across) {
  return extreme_point(outline.pieces, {across, rise});
}

double top_radius(const ToolOutline& outline) { return outline.pieces.back().from.x(); }

double corner_height(const ToolOutline& outline) {
  for (const OutlinePiece& piece : outline.pieces) {
    const double middle = piece.from.y() - piece.radius * piece.normal_from.y();
    if (piece.radius > 0.0 && middle >= 0.0 && middle <= outline.height) return middle;
  }
  return 0.0;
}

// Intersects the bounding rectangle with the half planes inside all lines and tangents, moved
// inwards by the margin.
InsetOutline inside(const ToolOutline& outline, double margin) {
  require(!is_hollow(outline), "outline: expected a convex one to go inside of, seen a hollow one");
  std::vector<Vector2d> corners{
      {0.0, 0.0}, {outline.radius, 0.0}, {outline.radius, outline.height}, {0.0, outline.height}};
  const auto cut_off = [&](const Vector2d& normal, const Vector2d& touched) {
    const double most = normal.dot(touched) - margin;
    std::vector<Vector2d> left;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
      const double beyond_a = normal.dot(a) - most, beyond_b = normal.dot(b) - most;
      if (beyond_a <= 0.0) left.push_back(a);
      if ((beyond_a < 0.0 && beyond_b > 0.0) || (beyond_a > 0.0 && beyond_b < 0.0))
        left.push_back(a + beyond_a / (beyond_a - beyond_b) * (b - a));
    }
    corners = std::move(left);
  };
  for (const OutlinePiece& piece : outline.pieces) {
    if (!piece.is_arc) cut_off(piece.normal_from, piece.from);
    if (piece.radius == 0.0) continue;
    const double turn = std::atan2(sine_between(piece.normal_from, piece.normal_to),
                                   piece.normal_from.dot(piece.normal_to));
    // 3 deg between tangents: the corners of the polygon would stand out by 0.034 % of the radius,
    // so the tangents are moved inwards by that
    const int tangents = 1 + int(std::ceil(turn / (3.0 * units::deg)));
    const double inwards = piece.radius * (1.0 - std::cos(0.5 * turn / (tangents - 1)));
    for (int i = 0; i < tangents; ++i) {
      const Vector2d normal = Eigen::Rotation2Dd(i * turn / (tangents - 1)) * piece.normal_from;
      cut_off(normal, piece.from + piece.radius * (normal - piece.normal_from) - inwards * normal);
    }
  }
  const auto on_axis = [](const Vector2d& corner) { return corner.x() <= 0.0; };
  const auto lowest =
      std::ranges::min_element(corners, {}, [](const Vector2d& corner) { return corner.y(); });
  require(std::ranges::count_if(corners, on_axis) >= 2,
          fmt::format("outline: expected one wider than {:g} mm at both sides", margin));
  InsetOutline inner;
  inner.raised = lowest->y();
  std::ranges::rotate(corners, std::ranges::find_if(corners, [&](const Vector2d& corner) {
                        return on_axis(corner) && corner.y() <= inner.raised + same_place;
                      }));
  std::vector<OutlinePoint> points;
  for (const Vector2d& corner : corners)
    if (points.empty() || !on_axis(corner))
      points.push_back({corner - Vector2d(0.0, inner.raised)});
  points.front().at.y() = 0.0;
  inner.outline = outline_from_points(points);
  return inner;
}

double max_separation(const ToolOutline& a, const ToolOutline& b) {
  double most = 0.0;
  // Steps of 1 deg, as stated in the header.
  for (int degree = -90; degree <= 90; ++degree) {
    const double angle = degree * units::deg;
    const double rise = std::sin(angle), across = std::max(0.0, std::cos(angle));
    most = std::max(most, std::abs(support(a, rise, across) - support(b, rise, across)));
  }
  if (!is_hollow(a) && !is_hollow(b)) return most;
  for (const auto& [one, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (const OutlinePiece& piece : one->pieces)
      most = std::max(most, std::abs(distance(*other, piece.to).value));
  return most;
}

OutlineDistance distance(const ToolOutline& outline, const Vector2d& place) {
  if (!is_hollow(outline)) return distance(outline.pieces, place);
  OutlineDistance nearest{std::numeric_limits<double>::infinity(), Vector2d::Zero()};
  for (const ToolOutline& part : outline.parts) {
    const OutlineDistance one = distance(part, place);
    if (one.value < nearest.value) nearest = one;
  }
  return nearest;
}

// The largest of the distances to the tangents, which is convex.
OutlineDistance distance(const std::vector<OutlinePiece>& pieces, const Vector2d& place) {
  OutlineDistance most{-1e300, {0, -1}};
  const auto take = [&](double value, const Vector2d& gradient) {
    if (value > most.value) most = {value, gradient};
  };
  for (const OutlinePiece& piece : pieces) {
    const Vector2d v = place - piece.from, w = place - piece.to;
    const double off = piece.normal_from.dot(v);
    if (piece.is_arc && sine_between(piece.normal_from, v) >= 0.0 &&
        sine_between(w, piece.normal_to) >= 0.0) {
      const Vector2d from_centre = v + piece.radius * piece.normal_from;
      const double far = from_centre.norm();
      if (far > 0.0)
        // Equal to far - radius without its cancellation for large radii.
        take((v.squaredNorm() + 2.0 * piece.radius * off) / (far + piece.radius),
             from_centre / far);
    } else {
      take(off, piece.normal_from);
      if (piece.is_arc) take(piece.normal_to.dot(w), piece.normal_to);
    }
  }
  return most;
}

namespace {

/// Appends a piece; splits an arc beyond a right angle in two, since the tests of an arc's range by
/// the sine need less than half a turn.
void add_short(std::vector<OutlinePiece>& pieces, const OutlinePiece& piece) {
  const Vector2d& n = piece.normal_from;
  if (!piece.is_arc || n.dot(piece.normal_to) >= 0.0) {
    pieces.push_back(piece);
    return;
  }
  // The 1e-9 decides the side for half a circle, whose normals cancel.
  const Vector2d middle = (n + piece.normal_to + 1e-9 * Vector2d(-n.y(), n.x())).normalized();
  const Vector2d at = piece.from + piece.radius * (middle - n);
  pieces.push_back({true, piece.from, at, n, middle, piece.radius});
  pieces.push_back({true, at, piece.to, middle, piece.normal_to, piece.radius});
}

}  // namespace

OutlinePiece line_piece(const Vector2d& from, const Vector2d& to) {
  const Vector2d along = (to - from).normalized();
  const Vector2d normal(along.y(), -along.x());
  return {false, from, to, normal, normal};
}

OutlinePiece arc_piece_about(const Vector2d& from, const Vector2d& to, double radius,
                             const Vector2d& centre) {
  return {true, from, to, (from - centre).normalized(), (to - centre).normalized(), radius};
}

OutlinePiece arc_piece(const Vector2d& from, const Vector2d& to, double radius) {
  const Vector2d chord = to - from;
  const double half = 0.5 * chord.norm();
  if (!(radius >= half))
    throw OutlineError(
        fmt::format(
            "outline: expected an arc of radius {:g} mm at least to ({:g}, {:g}), seen {:g}", half,
            to.x(), to.y(), radius),
        to, OutlineError::Number::Radius);
  const Vector2d inward = Vector2d(-chord.y(), chord.x()).normalized();
  return arc_piece_about(from, to, radius,
                         0.5 * (from + to) + std::sqrt(radius * radius - half * half) * inward);
}

std::vector<OutlinePiece> pieces_from_points(const std::vector<OutlinePoint>& points) {
  require(!points.empty(), "outline: expected a point and more, seen none");
  std::vector<OutlinePiece> pieces;
  Vector2d last = Vector2d::Zero();
  const auto add = [&](const OutlinePoint& point) {
    const bool has_radius = std::isfinite(point.radius) && point.radius >= 0.0;
    if (!has_radius || !point.at.allFinite() || point.at.x() < 0.0)
      throw OutlineError(
          fmt::format("outline: expected finite numbers of 0 and more, seen ({:g}, {:g}) mm, "
                      "radius {:g}",
                      point.at.x(), point.at.y(), point.radius),
          point.at, has_radius ? OutlineError::Number::First : OutlineError::Number::Radius);
    if ((point.at - last).norm() > same_place)
      pieces.push_back(point.radius > 0.0 ? arc_piece(last, point.at, point.radius)
                                          : line_piece(last, point.at));
    last = point.at;
  };
  if (!(std::abs(points.front().at.y()) <= same_place))
    throw OutlineError(fmt::format("outline: expected it to begin at height 0, seen {:g} mm",
                                   points.front().at.y()),
                       points.front().at, OutlineError::Number::Second);
  for (const OutlinePoint& point : points) add(point);
  if (!(last.x() > same_place && last.y() > same_place))
    throw OutlineError(
        fmt::format("outline: expected it to end above the tip and beside the axis, seen "
                    "({:g}, {:g}) mm",
                    last.x(), last.y()),
        last, last.x() > same_place ? OutlineError::Number::Second : OutlineError::Number::First);
  add({{0.0, last.y()}});
  return pieces;
}

double inward_bend(const OutlinePiece& before, const OutlinePiece& piece) {
  return -sine_between(before.normal_to, piece.normal_from);
}

std::vector<OutlinePiece> with_corners(const std::vector<OutlinePiece>& pieces,
                                       const Vector2d& before) {
  std::vector<OutlinePiece> all;
  for (const OutlinePiece& piece : pieces) {
    const Vector2d last = all.empty() ? before : all.back().normal_to;
    const double bend = sine_between(last, piece.normal_from);
    // The sine of half a turn is near 0, so the cosine decides there.
    const bool turns_back = last.dot(piece.normal_from) < 0.0;
    if (!(bend > -min_bend) || (turns_back && bend <= min_bend))
      throw InwardBend(
          fmt::format("outline: expected a convex one, seen that it bends inwards by {:.3g} deg at "
                      "({:g}, {:g}) mm",
                      std::atan2(-bend, last.dot(piece.normal_from)) / units::deg, piece.from.x(),
                      piece.from.y()),
          piece.from);
    if (bend > min_bend) add_short(all, {true, piece.from, piece.from, last, piece.normal_from});
    add_short(all, piece);
  }
  return all;
}

}  // namespace abbe::cutting
