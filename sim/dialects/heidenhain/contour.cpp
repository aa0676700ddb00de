#include "sim/dialects/heidenhain/heidenhain.h"

namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;

namespace {

constexpr double point_tolerance = 1e-9;   // mm
constexpr double corner_tolerance = 1e-6;  // mm by which a corner may exceed a move
// Bounds memory between RL and the first move in the plane.
constexpr std::size_t max_entry_elements = 100;

/// Returns the element with a cause that does not refer to the text of its block, which may be gone
/// when the element is made.
ContourElement with_lasting_cause(ContourElement element) {
  element.cause.text = element.is_arc ? "an arc" : "a straight move";
  return element;
}

double planar_cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

void Contour::add(ContourElement element, const std::array<int, 2>& plane, bool before_corner) {
  // The plane stays the same while compensation is in force.
  if (!compensation_.is_on()) plane_ = plane;
  element.line = canon_.line();
  element.file = canon_.file();
  element.feed = canon_.feed();
  const AxisVector from = position(), end = element.end;
  std::optional<AxisVector> corner_end;
  if (waiting_corner_)
    corner_end = make_corner(element);
  else if (waiting_element_)
    // The block of RND or CHF had an error.
    process(*std::exchange(waiting_element_, std::nullopt));
  if (before_corner) {
    waiting_start_ = corner_end ? *corner_end : from;
    waiting_element_ = with_lasting_cause(std::move(element));
  } else {
    process(std::move(element));
  }
  is_ahead_ = waiting_element_ || !entry_elements_.empty() || compensation_.is_on();
  position_ = end;
}

// `make_corner` makes the corner when the move after it is known.
void Contour::add_corner(bool is_round, double size, std::optional<program::Feed> feed,
                         const Cause& cause) {
  if (!waiting_element_)
    canon_.throw_input_error(cause, "a straight move before RND and CHF", "none");
  if (!(size > 0)) canon_.throw_input_error(cause, "a radius or length greater than zero");
  waiting_corner_ = Corner{
      is_round, size, feed, {cause.column, is_round ? "RND" : "CHF"}, canon_.line(), canon_.file()};
}

/// Makes the corner between the waiting line and the next one. Returns the end of the corner.
AxisVector Contour::make_corner(const ContourElement& next) {
  const Corner corner = *std::exchange(waiting_corner_, std::nullopt);
  ContourElement previous = *std::exchange(waiting_element_, std::nullopt);
  const AxisVector corner_position = previous.end;
  // On an error the waiting line is still made, so that later moves begin at their programmed
  // start.
  const auto fail = [&](std::string expected, std::string seen) -> AxisVector {
    process(std::move(previous));
    canon_.set_line(corner.line, corner.file);
    canon_.throw_input_error(corner.cause, std::move(expected), std::move(seen));
  };
  if (previous.is_arc || next.is_arc)
    return fail("straight moves before and after RND and CHF", "an arc");
  const Vector2d from = in_plane(waiting_start_), at = in_plane(previous.end),
                 to = in_plane(next.end);
  // Both moves must be in the working plane, or the corner would have no plane.
  const auto is_in_plane = [&](AxisVector displacement) {
    for (const int j : plane_) displacement[j] = 0.0;
    return displacement.cwiseAbs().maxCoeff() < point_tolerance;
  };
  const double length_before = (at - from).norm(), length_after = (to - at).norm();
  if (length_before < point_tolerance || length_after < point_tolerance ||
      !is_in_plane(previous.end - waiting_start_) || !is_in_plane(next.end - previous.end))
    return fail("moves in the working plane before and after RND and CHF", "other moves");
  const Vector2d a = (at - from) / length_before, b = (to - at) / length_after;
  const double turn = std::atan2(planar_cross(a, b), a.dot(b));
  const double half_angle = std::abs(turn) / 2;
  if (half_angle < 1e-9) {  // rad, below it there is no corner
    process(std::move(previous));
    return corner_position;
  }
  if (half_angle > pi / 2 - 1e-6)
    return fail("a corner that does not reverse the direction", "one");
  // Length cut off each side: R tan(turn/2) for an arc of radius R, L / (2 cos(turn/2)) for a bevel
  // of length L.
  const double cut = corner.is_round ? corner.size * std::tan(half_angle)
                                     : corner.size / (2 * std::cos(half_angle));
  if (cut > length_before + corner_tolerance || cut > length_after + corner_tolerance)
    return fail(fmt::format("moves at least as long as the corner requires, {:.6g} mm", cut),
                fmt::format("{:.6g} and {:.6g} mm", length_before, length_after));
  ContourElement corner_element = next;
  corner_element.is_rapid = false;
  corner_element.is_arc = corner.is_round;
  corner_element.first = plane_[0];
  corner_element.second = plane_[1];
  corner_element.is_clockwise = turn < 0;
  // Without F the corner has the feed of the move before it.
  corner_element.feed = corner.feed ? corner.feed : previous.feed;
  corner_element.line = corner.line;
  corner_element.file = corner.file;
  corner_element.end = corner_element.centre = previous.end;
  const Vector2d begin = at - cut * a, end = at + cut * b;
  // The centre of the arc is on the inner side of the corner.
  const Vector2d normal = turn > 0 ? Vector2d(-a.y(), a.x()) : Vector2d(a.y(), -a.x());
  for (int k = 0; k < 2; ++k) {
    const int j = plane_[std::size_t(k)];
    previous.end[j] = begin[k];
    corner_element.end[j] = end[k];
    corner_element.centre[j] = begin[k] + corner.size * normal[k];
  }
  process(std::move(previous));
  AxisVector corner_end = corner_element.end;
  process(std::move(corner_element));
  return corner_end;
}

void Contour::set_side(std::optional<bool> left, double radius, const Cause& cause) {
  if (left == is_left_) return;
  // The offset point of a direct change of side would be undefined.
  if (left && is_left_) canon_.throw_input_error(cause, "R0 between RL and RR");
  if (left) {
    is_left_ = left;
    radius_ = radius;
    return;
  }
  issue_entry_moves();
  if (compensation_.is_on()) compensation_.end();
  is_left_.reset();
}

void Contour::run_after_move(std::function<void()> action) {
  if (compensation_.is_on())
    compensation_.run_after_move(std::move(action));
  else
    action();
}

// No contour followed the entry elements, so they are made at their programmed ends.
void Contour::issue_entry_moves() {
  for (const ContourElement& element : std::exchange(entry_elements_, {})) issue(element);
}

void Contour::finish() {
  waiting_corner_.reset();
  if (waiting_element_) process(*std::exchange(waiting_element_, std::nullopt));
  issue_entry_moves();
  if (compensation_.is_on()) compensation_.end();
  is_left_.reset();
  is_ahead_ = false;
}

// Under compensation the first move waits for the direction of the contour.
void Contour::process(ContourElement element) {
  if (!is_left_) return issue(element);
  if (compensation_.is_on()) return compensate(element);
  if (entry_elements_.empty()) {
    if (element.is_arc)
      canon_.throw_input_error(element.cause, "a straight move as the first one under RL and RR");
    entry_elements_.push_back(with_lasting_cause(std::move(element)));
    return;
  }
  // Moves of other axes between RL and the contour wait too.
  if (!element.is_arc &&
      (in_plane(element.end) - in_plane(entry_elements_.back().end)).norm() < point_tolerance) {
    if (entry_elements_.size() == max_entry_elements)
      canon_.throw_input_error(
          element.cause, "at most 100 moves of other axes after the move that starts RL or RR",
          "more");
    entry_elements_.push_back(with_lasting_cause(std::move(element)));
    return;
  }
  enter_contour(element);
  compensate(element);
}

/// Returns the unit direction of an element at its start.
Vector2d Contour::start_direction(const ContourElement& element, const AxisVector& start) const {
  const Vector2d from = in_plane(start);
  if (!element.is_arc) return (in_plane(element.end) - from).normalized();
  program::ArcGeometry geometry{from, in_plane(element.end), {}, element.is_clockwise};
  geometry.centre = element.radius ? program::centre_by_radius(geometry, *element.radius,
                                                               canon_.place(), element.cause)
                                   : in_plane(element.centre);
  const Vector2d radial = (from - geometry.centre).normalized();
  return element.is_clockwise ? Vector2d(radial.y(), -radial.x())
                              : Vector2d(-radial.y(), radial.x());
}

/// Moves to the point perpendicular to the beginning of the next move, one radius from it.
void Contour::enter_contour(const ContourElement& next) {
  const AxisVector begin = entry_elements_.back().end;
  const Vector2d d = start_direction(next, begin);
  const Vector2d normal = *is_left_ ? Vector2d(-d.y(), d.x()) : Vector2d(d.y(), -d.x());
  const Vector2d offset_point = in_plane(begin) + radius_ * normal;
  const auto feed = canon_.feed();
  // All entry elements end at the offset point.
  for (ContourElement element : std::exchange(entry_elements_, {})) {
    for (int k = 0; k < 2; ++k) element.end[plane_[std::size_t(k)]] = offset_point[k];
    issue(element);
  }
  canon_.set_feed(feed);
  compensation_.begin_at_offset(*is_left_, radius_, plane_, begin);
}

namespace {

ArcMove arc_move(const ContourElement& element) {
  return {.first = element.first,
          .second = element.second,
          .end = element.end,
          .centre = {0, 0},
          .centre_with_offsets = element.centre,
          .radius = element.radius,
          .clockwise = element.is_clockwise,
          .turns = element.turn_count,
          .cause = element.cause,
          .named = element.cause,
          .stated = element.stated};
}

}  // namespace

// The element has the feed of its own block, not of the current one.
void Contour::compensate(const ContourElement& element) {
  const auto feed = canon_.feed();
  canon_.set_feed(element.feed);
  if (element.is_arc)
    compensation_.arc(arc_move(element));
  else
    compensation_.straight({.end = element.end, .cause = element.cause}, element.is_rapid);
  canon_.set_feed(feed);
}

void Contour::issue(const ContourElement& element) {
  const auto feed = canon_.feed();
  const int line = canon_.line(), file = canon_.file();
  canon_.set_feed(element.feed);
  canon_.set_line(element.line, element.file);
  if (element.is_arc)
    canon_.arc(arc_move(element));
  else
    canon_.straight({.end = element.end, .cause = element.cause, .stated = element.stated},
                    element.is_rapid);
  canon_.set_feed(feed);
  canon_.set_line(line, file);
}

}  // namespace abbe::sim::dialects::heidenhain
