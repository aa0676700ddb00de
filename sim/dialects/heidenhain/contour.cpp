#include "sim/dialects/heidenhain/contour.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"

namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;
using kinematics::AxisVector;
using program::Cause;

namespace {

constexpr double same_point = 1e-9;  // mm
constexpr double rounding = 1e-6;    // mm by which a corner may exceed a move
// Bounds memory between RL and the first move in the plane.
constexpr std::size_t max_waiting = 100;

/// Returns the element with a cause that remains valid after the text of its block is gone.
Element lasting(Element element) {
  element.cause.text = element.round ? "an arc" : "a straight move";
  return element;
}

double cross_of(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

void Contour::put(Element element, const std::array<int, 2>& plane, bool before_corner) {
  // The plane must not change while compensation is in force.
  if (!beside_.is_on()) plane_ = plane;
  element.line = canon_.line();
  element.file = canon_.file();
  element.feed = canon_.feed();
  const AxisVector from = position(), end = element.end;
  std::optional<AxisVector> after_corner;
  if (corner_)
    after_corner = cut_corner(element);
  else if (held_)
    pass(*std::exchange(held_, std::nullopt));  // RND or CHF had an error
  if (before_corner) {
    held_from_ = after_corner ? *after_corner : from;
    held_ = lasting(std::move(element));
  } else {
    pass(std::move(element));
  }
  moved_ = held_ || !entry_.empty() || beside_.is_on();
  at_ = end;
}

// The corner is cut when the move behind it is known.
void Contour::corner(bool round, double size, std::optional<program::Feed> feed,
                     const Cause& cause) {
  if (!held_) canon_.refuse(cause, "a straight move before RND and CHF", "none");
  if (!(size > 0)) canon_.refuse(cause, "a radius or length above zero");
  corner_ = Corner{round,         size,         feed, {cause.column, round ? "RND" : "CHF"},
                   canon_.line(), canon_.file()};
}

/// Makes the corner between the held straight move and the next one. Returns where the corner ends.
AxisVector Contour::cut_corner(const Element& next) {
  const Corner corner = *std::exchange(corner_, std::nullopt);
  Element before = *std::exchange(held_, std::nullopt);
  const AxisVector corner_end = before.end;
  // On an error the held move is still made, so that the following moves start where they are
  // programmed.
  const auto fail = [&](std::string expected, std::string seen) -> AxisVector {
    pass(std::move(before));
    canon_.set_line(corner.line, corner.file);
    canon_.refuse(corner.cause, std::move(expected), std::move(seen));
  };
  if (before.round || next.round)
    return fail("straight moves on both sides of RND and CHF", "an arc");
  const Vector2d from = in_plane(held_from_), at = in_plane(before.end), to = in_plane(next.end);
  // Both moves must be in the working plane: otherwise the corner would have no plane.
  const auto flat = [&](AxisVector way) {
    for (const int j : plane_) way[j] = 0.0;
    return way.cwiseAbs().maxCoeff() < same_point;
  };
  const double in = (at - from).norm(), out = (to - at).norm();
  if (in < same_point || out < same_point || !flat(before.end - held_from_) ||
      !flat(next.end - before.end))
    return fail("moves in the working plane on both sides of RND and CHF", "others");
  const Vector2d a = (at - from) / in, b = (to - at) / out;
  const double turn = std::atan2(cross_of(a, b), a.dot(b));
  const double half = std::abs(turn) / 2;
  if (half < 1e-9) {  // rad: no corner
    pass(std::move(before));
    return corner_end;
  }
  if (half > pi / 2 - 1e-6) return fail("a corner that is no way straight back", "one");
  // Length cut off each side: R tan(turn/2) for an arc; for a bevel of length L, L / (2
  // cos(turn/2)).
  const double cut =
      corner.round ? corner.size * std::tan(half) : corner.size / (2 * std::cos(half));
  if (cut > in + rounding || cut > out + rounding)
    return fail(fmt::format("moves as long as the corner takes, {:.6g} mm", cut),
                fmt::format("{:.6g} and {:.6g} mm", in, out));
  Element piece = next;
  piece.rapid = false;
  piece.round = corner.round;
  piece.first = plane_[0];
  piece.second = plane_[1];
  piece.clockwise = turn < 0;
  // Without an F of its own the corner has the feed of the move before it.
  piece.feed = corner.feed ? corner.feed : before.feed;
  piece.line = corner.line;
  piece.file = corner.file;
  piece.end = piece.centre = before.end;
  const Vector2d begin = at - cut * a, end = at + cut * b;
  // The centre of the arc lies on the inner side of the corner.
  const Vector2d side = turn > 0 ? Vector2d(-a.y(), a.x()) : Vector2d(a.y(), -a.x());
  for (int k = 0; k < 2; ++k) {
    const int j = plane_[std::size_t(k)];
    before.end[j] = begin[k];
    piece.end[j] = end[k];
    piece.centre[j] = begin[k] + corner.size * side[k];
  }
  pass(std::move(before));
  AxisVector behind = piece.end;
  pass(std::move(piece));
  return behind;
}

void Contour::set_side(std::optional<bool> left, double radius, const Cause& cause) {
  if (left == side_) return;
  // A direct change of side would leave the offset point of the transition undefined.
  if (left && side_) canon_.refuse(cause, "R0 between RL and RR");
  if (left) {
    side_ = left;
    radius_ = radius;
    return;
  }
  emit_entry_moves();
  if (beside_.is_on()) beside_.end();
  side_.reset();
}

void Contour::after(std::function<void()> action) {
  if (beside_.is_on())
    beside_.run_after_move(std::move(action));
  else
    action();
}

// Moves that were waiting for a contour that never came, at their programmed positions.
void Contour::emit_entry_moves() {
  for (const Element& element : std::exchange(entry_, {})) make(element);
}

void Contour::finish() {
  corner_.reset();
  if (held_) pass(*std::exchange(held_, std::nullopt));
  emit_entry_moves();
  if (beside_.is_on()) beside_.end();
  side_.reset();
  moved_ = false;
}

// Without compensation a move is made at once; with it, the first move waits for the direction of
// the contour.
void Contour::pass(Element element) {
  if (!side_) return make(element);
  if (beside_.is_on()) return go_beside(element);
  if (entry_.empty()) {
    if (element.round)
      canon_.refuse(element.cause, "a straight move as the first one under RL and RR");
    entry_.push_back(lasting(std::move(element)));
    return;
  }
  // Moves of other axes between RL and the contour wait as well.
  if (!element.round && (in_plane(element.end) - in_plane(entry_.back().end)).norm() < same_point) {
    if (entry_.size() == max_waiting)
      canon_.refuse(element.cause,
                    "at most 100 moves of other axes behind that which begins RL or RR", "more");
    entry_.push_back(lasting(std::move(element)));
    return;
  }
  enter(element);
  go_beside(element);
}

/// Returns the unit direction in which an element leaves its start.
Vector2d Contour::leaves(const Element& element, const AxisVector& start) const {
  const Vector2d from = in_plane(start);
  if (!element.round) return (in_plane(element.end) - from).normalized();
  program::ArcGeometry words{from, in_plane(element.end), {}, element.clockwise};
  words.centre = element.radius ? program::centre_by_radius(words, *element.radius, canon_.place(),
                                                            element.cause)
                                : in_plane(element.centre);
  const Vector2d out = (from - words.centre).normalized();
  return element.clockwise ? Vector2d(out.y(), -out.x()) : Vector2d(-out.y(), out.x());
}

/// Moves to the point perpendicular to the beginning of the next move, one radius from it.
void Contour::enter(const Element& next) {
  const AxisVector begin = entry_.back().end;
  const Vector2d d = leaves(next, begin);
  const Vector2d side = *side_ ? Vector2d(-d.y(), d.x()) : Vector2d(d.y(), -d.x());
  const Vector2d place = in_plane(begin) + radius_ * side;
  const auto feed = canon_.feed();
  // All waiting moves end beside the contour.
  for (Element element : std::exchange(entry_, {})) {
    for (int k = 0; k < 2; ++k) element.end[plane_[std::size_t(k)]] = place[k];
    make(element);
  }
  canon_.set_feed(feed);
  beside_.begin_at_offset(*side_, radius_, plane_, begin);
}

// Feed and line are those of the element's own block, not of the current one.
void Contour::go_beside(const Element& element) {
  const auto feed = canon_.feed();
  canon_.set_feed(element.feed);
  if (!element.round) {
    beside_.straight({.end = element.end, .cause = element.cause}, element.rapid);
  } else {
    program::ArcMove arc{.first = element.first,
                         .second = element.second,
                         .end = element.end,
                         .centre = {0, 0},
                         .placed_centre = element.centre,
                         .radius = element.radius,
                         .clockwise = element.clockwise,
                         .turns = element.turns,
                         .cause = element.cause,
                         .named = element.cause};
    beside_.arc(std::move(arc));
  }
  canon_.set_feed(feed);
}

void Contour::make(const Element& element) {
  const auto feed = canon_.feed();
  const int line = canon_.line(), file = canon_.file();
  canon_.set_feed(element.feed);
  canon_.set_line(element.line, element.file);
  if (element.round)
    canon_.arc({.first = element.first,
                .second = element.second,
                .end = element.end,
                .centre = {0, 0},
                .placed_centre = element.centre,
                .radius = element.radius,
                .clockwise = element.clockwise,
                .turns = element.turns,
                .cause = element.cause,
                .named = element.cause,
                .stated = element.stated});
  else if (element.rapid)
    canon_.traverse({.end = element.end, .cause = element.cause, .stated = element.stated});
  else
    canon_.straight_feed({.end = element.end, .cause = element.cause, .stated = element.stated});
  canon_.set_feed(feed);
  canon_.set_line(line, file);
}

}  // namespace abbe::sim::dialects::heidenhain
