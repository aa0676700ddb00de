#include "cutting/outline_pieces.h"

#include <cmath>

#include <fmt/format.h>

#include "cutting/outline_fault.h"
#include "kinematics/require.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

/// An arc beyond a right angle as two.
void add_short(std::vector<OutlinePiece>& pieces, const OutlinePiece& piece) {
  const Vector2d& n = piece.normal_from;
  if (!piece.is_arc || n.dot(piece.normal_to) >= 0.0) {
    pieces.push_back(piece);
    return;
  }
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
    throw OutlineFault(
        fmt::format(
            "outline: expected an arc of radius {:g} mm at least to ({:g}, {:g}), seen {:g}", half,
            to.x(), to.y(), radius),
        to, OutlineFault::Number::Radius);
  const Vector2d inward = Vector2d(-chord.y(), chord.x()).normalized();
  return arc_piece_about(from, to, radius,
                         0.5 * (from + to) + std::sqrt(radius * radius - half * half) * inward);
}

std::vector<OutlinePiece> pieces_through(const std::vector<OutlinePoint>& points) {
  require(!points.empty(), "outline: expected a point and more, seen none");
  std::vector<OutlinePiece> pieces;
  Vector2d last = Vector2d::Zero();
  const auto add = [&](const OutlinePoint& point) {
    const bool has_radius = std::isfinite(point.radius) && point.radius >= 0.0;
    if (!has_radius || !point.at.allFinite() || point.at.x() < 0.0)
      throw OutlineFault(
          fmt::format("outline: expected finite numbers of 0 and more, seen ({:g}, {:g}) mm, "
                      "radius {:g}",
                      point.at.x(), point.at.y(), point.radius),
          point.at, has_radius ? OutlineFault::Number::First : OutlineFault::Number::Radius);
    if ((point.at - last).norm() > same_place)
      pieces.push_back(point.radius > 0.0 ? arc_piece(last, point.at, point.radius)
                                          : line_piece(last, point.at));
    last = point.at;
  };
  if (!(std::abs(points.front().at.y()) <= same_place))
    throw OutlineFault(fmt::format("outline: expected it to begin at height 0, seen {:g} mm",
                                   points.front().at.y()),
                       points.front().at, OutlineFault::Number::Second);
  for (const OutlinePoint& point : points) add(point);
  if (!(last.x() > same_place && last.y() > same_place))
    throw OutlineFault(
        fmt::format("outline: expected it to end above the tip and beside the axis, seen "
                    "({:g}, {:g}) mm",
                    last.x(), last.y()),
        last, last.x() > same_place ? OutlineFault::Number::Second : OutlineFault::Number::First);
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
    const bool turns_back = last.dot(piece.normal_from) < 0.0;
    if (!(bend > -least_bend) || (turns_back && bend <= least_bend))
      throw InwardBend(
          fmt::format("outline: expected a convex one, seen that it bends inwards by {:.3g} deg at "
                      "({:g}, {:g}) mm",
                      std::atan2(-bend, last.dot(piece.normal_from)) / units::deg, piece.from.x(),
                      piece.from.y()),
          piece.from);
    if (bend > least_bend) add_short(all, {true, piece.from, piece.from, last, piece.normal_from});
    add_short(all, piece);
  }
  return all;
}

}  // namespace abbe::cutting
