#include "cutting/outline_pieces.h"

#include <cmath>

#include <fmt/format.h>

#include "cutting/outline_fault.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

constexpr double least_bend = 1e-7;  // rad, by which a joint may bend inwards: rounding of input

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

std::vector<OutlinePiece> with_corners(const std::vector<OutlinePiece>& pieces,
                                       const Vector2d& before) {
  std::vector<OutlinePiece> all;
  for (const OutlinePiece& piece : pieces) {
    const Vector2d last = all.empty() ? before : all.back().normal_to;
    const double bend = sine_between(last, piece.normal_from);
    const bool turns_back = last.dot(piece.normal_from) < 0.0;
    if (!(bend > -least_bend) || (turns_back && bend <= least_bend))
      throw OutlineFault(
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
