#include "sim/dialects/tool_compensation.h"

#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_options.h"

namespace abbe::sim::dialects {

using Eigen::Vector2d;
using kinematics::AxisVector;
using kinematics::Chain;
using program::ArcMove;
using program::Cause;
using program::FeedMode;
using program::Straight;
using program::Target;

const Chain* chain_to_tip(const program::NcOptions& control, int tool) {
  if (const auto tool_chain = control.control_by_h.find(tool);
      tool_chain != control.control_by_h.end())
    return &tool_chain->second;
  return control.control ? &*control.control : nullptr;
}

AxisVector measured_offset(const program::Canon& canon, const Chain& chain,
                           const program::Cause& cause) {
  auto shift = program::tip_shift(chain);
  if (!shift)
    canon.throw_input_error(cause, "perpendicular linear axes with the offset of a turning tool");
  // Subtracted because the canon adds the origin of the work offsets to every tool shift.
  const Eigen::Vector3d origin = canon.shift_correction();
  for (int k = 0; k < 3; ++k)
    if (const int j = canon.joint_of("XYZ"[k]); j >= 0) (*shift)[j] -= origin[k];
  return *shift;
}

AxisVector nose_offset(const program::Canon& canon, int tip, std::optional<double> radius) {
  struct Direction {
    int x, z;
  };
  // Signs of the direction from the centre of the nose to the imaginary tip, by tip number.
  constexpr std::array<Direction, 10> tips = {
      {{0, 0}, {1, 1}, {1, -1}, {-1, -1}, {-1, 1}, {0, 1}, {1, 0}, {0, -1}, {-1, 0}, {0, 0}}};
  AxisVector displacement = AxisVector::Zero(canon.position().size());
  if (!radius) return displacement;
  const auto [x, z] = tips.at(std::size_t(tip));
  if (const int j = canon.joint_of('X'); j >= 0) displacement[j] = -x * *radius;
  if (const int j = canon.joint_of('Z'); j >= 0) displacement[j] = -z * *radius;
  return displacement;
}

namespace {

constexpr double position_tolerance = 1e-9;  // mm, rounding of a position
// mm; a trimmed segment may run backwards by this much because its intersection is rounded
constexpr double trim_tolerance = 1e-6;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

Vector2d left_of(const Vector2d& d) { return {-d.y(), d.x()}; }

/// A line by a point and a unit direction, or a circle by its centre `point` and radius.
struct Curve {
  bool is_circle = false;
  Vector2d point, direction;
  double radius = 0.0;
};

std::vector<Vector2d> intersect_line_circle(const Curve& line, const Curve& circle) {
  const Vector2d from_centre = line.point - circle.point;
  const double along = -from_centre.dot(line.direction);
  const Vector2d nearest = line.point + along * line.direction;
  const double squared_half_chord =
      circle.radius * circle.radius - (nearest - circle.point).squaredNorm();
  if (squared_half_chord < 0) return {};
  const Vector2d half_chord = std::sqrt(squared_half_chord) * line.direction;
  return {nearest - half_chord, nearest + half_chord};
}

/// Returns the intersections of two lines or circles.
std::vector<Vector2d> intersections(const Curve& a, const Curve& b) {
  if (!a.is_circle && !b.is_circle) {
    const double sine = cross(a.direction, b.direction);
    if (sine == 0.0) return {};
    return {a.point + cross(b.point - a.point, b.direction) / sine * a.direction};
  }
  if (!a.is_circle) return intersect_line_circle(a, b);
  if (!b.is_circle) return intersect_line_circle(b, a);
  const Vector2d between = b.point - a.point;
  const double d = between.norm();
  if (d == 0.0) return {};
  // Distance from the centre of a to the common chord.
  const double along = (d * d + a.radius * a.radius - b.radius * b.radius) / (2 * d);
  const double squared_half_chord = a.radius * a.radius - along * along;
  if (squared_half_chord < 0) return {};
  const Vector2d unit = between / d, middle = a.point + along * unit;
  const Vector2d half_chord = std::sqrt(squared_half_chord) * left_of(unit);
  return {middle - half_chord, middle + half_chord};
}

}  // namespace

void CutterCompensation::begin(bool left, double radius, std::array<int, 2> plane,
                               CompensationRules rules) {
  rules_ = rules;
  is_on_ = true;
  // Controls compensate a negative radius on the other side.
  is_left_ = radius >= 0 ? left : !left;
  radius_ = std::abs(radius);
  plane_ = plane;
  // After `end` the tool is still offset, so the axes are not at the programmed position.
  if (!is_leaving_) programmed_ = canon_.position();
  is_leaving_ = has_entered_ = false;
}

void CutterCompensation::begin_at_offset(bool left, double radius, std::array<int, 2> plane,
                                         AxisVector programmed) {
  begin(left, radius, plane);
  programmed_ = std::move(programmed);
  has_entered_ = true;
}

void CutterCompensation::end() {
  make_waiting_move();
  is_leaving_ = is_on_ && has_entered_;
  is_on_ = has_entered_ = false;
}

AxisVector CutterCompensation::end_of(const Target& target) const {
  return canon_.target_position_from(programmed_, target, false);
}

Vector2d CutterCompensation::arc_centre(const ArcMove& move) const {
  if (!move.radius)
    return move.centre_with_offsets.size() > 0 ? in_plane(move.centre_with_offsets) : move.centre;
  const program::ArcGeometry ends{in_plane(programmed_), in_plane(move.end), {}, move.clockwise};
  return program::centre_by_radius(ends, *move.radius, canon_.place(), move.named);
}

Vector2d CutterCompensation::offset_vector(const Vector2d& direction) const {
  return (is_left_ ? radius_ : -radius_) * left_of(direction);
}

// Under inverse time the arc inserted at an outside corner would have no defined duration.
void CutterCompensation::check_feed(const Cause& cause) const {
  if (canon_.feed_mode() == FeedMode::InverseTime)
    canon_.throw_input_error(cause,
                             "G94 with G41 and G42: an outside corner has no time of its own");
}

void CutterCompensation::straight(Straight move, bool rapid) {
  if (!rapid) check_feed(move.cause);
  const Vector2d from = in_plane(programmed_), to = in_plane(move.end);
  const double length = (to - from).norm();
  if (length < position_tolerance) {
    // Only other axes move. The position in the plane is known once the waiting move is made.
    programmed_ = move.end;
    run_after_move([this, end = move.end, cause = Cause{move.cause.column, {}}, rapid] {
      AxisVector offset_end = end;
      for (const int j : plane_) offset_end[j] = canon_.position()[j];
      if (rapid)
        canon_.traverse({.end = offset_end, .cause = cause});
      else
        canon_.straight_feed({.end = offset_end, .cause = cause});
    });
    return;
  }
  OffsetSegment segment;
  segment.is_rapid = rapid;
  segment.start_direction = segment.end_direction = (to - from) / length;
  segment.start = from + offset_vector(segment.start_direction);
  segment.end = to + offset_vector(segment.start_direction);
  segment.is_entry = !has_entered_;
  // A rule of LinuxCNC; other controls accept shorter entries.
  if (segment.is_entry && !rules_.perpendicular_entry && length < radius_)
    canon_.throw_input_error(
        move.cause, fmt::format("an entry move of at least the tool radius, {} mm", radius_),
        fmt::format("{} mm", length));
  segment.programmed_end = std::move(move.end);
  segment.cause = move.cause;
  join_segment(std::move(segment));
}

void CutterCompensation::arc(ArcMove move) {
  check_feed(move.cause);
  if (move.first != plane_[0] || move.second != plane_[1])
    canon_.throw_input_error(move.cause, "an arc in the plane of the cutter compensation");
  move.centre = arc_centre(move);
  const program::ArcGeometry programmed_ends{in_plane(programmed_), in_plane(move.end), move.centre,
                                             move.clockwise};
  const program::Arc arc =
      program::validated_arc(programmed_ends, move.turns, canon_.place(), move.named);
  // With the tool on the side of the centre the offset arc is smaller by the tool radius.
  const bool is_inside = is_left_ != move.clockwise;
  OffsetSegment segment;
  segment.is_arc = true;
  segment.is_clockwise = move.clockwise;
  segment.turn_count = move.turns;
  segment.centre = move.centre;
  segment.radius = arc.radius + (is_inside ? -radius_ : radius_);
  if (is_inside && segment.radius < position_tolerance)
    canon_.throw_input_error(
        move.named,
        fmt::format("an arc with a radius greater than the tool radius, {} mm", radius_),
        fmt::format("{} mm", arc.radius));
  const Vector2d start_normal = (programmed_ends.start - move.centre).normalized();
  const Vector2d end_normal = (programmed_ends.end - move.centre).normalized();
  segment.start = move.centre + segment.radius * start_normal;
  // Radii that differ between the ends, within the tolerance for arcs, keep their difference.
  segment.end = move.centre + (segment.radius + arc.growth) * end_normal;
  segment.is_entry = !has_entered_;
  if (segment.is_entry) enter_by_arc(segment, end_normal, move.cause);
  segment.start_direction =
      move.clockwise ? Vector2d(-left_of(start_normal)) : left_of(start_normal);
  segment.end_direction = move.clockwise ? Vector2d(-left_of(end_normal)) : left_of(end_normal);
  segment.programmed_end = std::move(move.end);
  segment.cause = move.cause;
  join_segment(std::move(segment));
}

/// Makes an arc the entry move as LinuxCNC does: it leads from the current position to the offset
/// end and arrives there in the programmed direction. Its centre is therefore on the programmed
/// radius through the end.
void CutterCompensation::enter_by_arc(OffsetSegment& segment, const Vector2d& outwards,
                                      const Cause& cause) const {
  const Vector2d from = in_plane(programmed_) - segment.end;
  const double along = from.dot(outwards);
  if (from.norm() < radius_ || !(along < 0))
    canon_.throw_input_error(cause,
                             fmt::format("an entry arc that fits a tool radius of {} mm", radius_),
                             "a smaller arc");
  segment.radius = -from.squaredNorm() / (2 * along);
  segment.centre = segment.end - segment.radius * outwards;
  segment.start = in_plane(programmed_);
}

/// Makes the corner between the waiting segment and `segment`, which then waits.
void CutterCompensation::join_segment(OffsetSegment segment) {
  const Vector2d corner = in_plane(programmed_);
  segment.feed = canon_.feed();
  segment.line = canon_.line();
  segment.file = canon_.file();
  programmed_ = segment.programmed_end;
  has_entered_ = true;
  // A perpendicular entry ends at the offset start of the segment after it.
  if (waiting_segment_ && waiting_segment_->is_entry && rules_.perpendicular_entry) {
    waiting_segment_->end = segment.start;
    make_waiting_move();
  } else if (waiting_segment_) {
    const double min_corner = rules_.min_corner;
    const double turn = std::atan2(cross(waiting_segment_->end_direction, segment.start_direction),
                                   waiting_segment_->end_direction.dot(segment.start_direction));
    const double outwards = is_left_ ? -turn : turn;
    // The reversal of a line, to within the tolerance of a corner, counts as an outside corner.
    const bool has_arc = waiting_segment_->is_arc || segment.is_arc;
    if (outwards < -min_corner && (has_arc || outwards > min_corner - pi)) {
      trim_inside_corner(segment, corner);
      make_waiting_move();
    } else if (std::abs(outwards) > min_corner) {
      round_outside_corner(segment, corner);
    } else {
      make_waiting_move();
    }
  }
  waiting_segment_ = std::move(segment);
}

/// Returns true if the part of a segment from one point to another runs forwards and, on an arc, is
/// not longer than the segment.
bool CutterCompensation::is_passable(const OffsetSegment& segment, const Vector2d& from,
                                     const Vector2d& to) {
  if (!segment.is_arc)
    return segment.is_entry || (to - from).dot(segment.end_direction) >= -trim_tolerance;
  const auto sweep = [&](const Vector2d& a, const Vector2d& b) {
    const Vector2d p = a - segment.centre, q = b - segment.centre;
    double turn = std::atan2(cross(p, q), p.dot(q));
    if (segment.is_clockwise) turn = -turn;
    // An angle below the tolerance is zero up to rounding or backwards: the arc then goes around
    // the whole circle.
    return turn * segment.radius > trim_tolerance ? turn : turn + 2 * pi;
  };
  return segment.turn_count > 1 ||
         sweep(from, to) * segment.radius <=
             sweep(segment.start, segment.end) * segment.radius + trim_tolerance;
}

void CutterCompensation::trim_inside_corner(OffsetSegment& next, const Vector2d& corner) {
  const auto curve = [](const OffsetSegment& segment) {
    return segment.is_arc ? Curve{true, segment.centre, {}, segment.radius}
                          : Curve{false, segment.end, segment.end_direction, 0.0};
  };
  const Vector2d* intersection = nullptr;
  const std::vector<Vector2d> points = intersections(curve(*waiting_segment_), curve(next));
  // The control takes the intersection nearer to the programmed corner.
  for (const Vector2d& point : points)
    if (intersection == nullptr || (point - corner).norm() < (*intersection - corner).norm())
      intersection = &point;
  const bool is_reachable =
      intersection != nullptr &&
      is_passable(*waiting_segment_, waiting_segment_->start, *intersection) &&
      is_passable(next, *intersection, next.end);
  if (is_reachable) {
    waiting_segment_->end = *intersection;
    next.start = *intersection;
  } else {
    canon_.throw_input_error(
        next.cause, fmt::format("an inside corner that a tool radius of {} mm can reach", radius_),
        "a narrower corner");
  }
}

// A rapid passes an outside corner on a straight line, a feed move on an arc about the corner.
void CutterCompensation::round_outside_corner(const OffsetSegment& next, const Vector2d& corner) {
  make_waiting_move();
  if (next.is_rapid) {
    AxisVector offset_vector = canon_.position();
    for (int k = 0; k < 2; ++k) offset_vector[plane_[std::size_t(k)]] = next.start[k];
    return canon_.traverse({.end = std::move(offset_vector), .cause = next.cause});
  }
  const AxisVector at_corner = canon_.position();
  ArcMove corner_arc{.first = plane_[0],
                     .second = plane_[1],
                     .end = at_corner,
                     .centre = corner,
                     .clockwise = is_left_,
                     .cause = next.cause,
                     .named = next.cause};
  for (int k = 0; k < 2; ++k) corner_arc.end[plane_[std::size_t(k)]] = next.start[k];
  canon_.arc(std::move(corner_arc));
}

/// Makes the waiting move with the feed and the line of its own block, then the postponed actions.
void CutterCompensation::make_waiting_move() {
  const auto feed = canon_.feed();
  const int line = canon_.line(), file = canon_.file();
  if (waiting_segment_) {
    const OffsetSegment segment = *std::exchange(waiting_segment_, std::nullopt);
    canon_.set_feed(segment.feed);
    canon_.set_line(segment.line, segment.file);
    AxisVector end = segment.programmed_end;
    for (int k = 0; k < 2; ++k) end[plane_[std::size_t(k)]] = segment.end[k];
    // Without text, so that messages state only the column: the offset move is not the move of the
    // block.
    const Cause cause{segment.cause.column, {}};
    if (segment.is_arc)
      canon_.arc({.first = plane_[0],
                  .second = plane_[1],
                  .end = std::move(end),
                  .centre = segment.centre,
                  .clockwise = segment.is_clockwise,
                  .turns = segment.turn_count,
                  .cause = cause,
                  .named = cause});
    else if (segment.is_rapid)
      canon_.traverse({.end = std::move(end), .cause = cause});
    else
      canon_.straight_feed({.end = std::move(end), .cause = cause});
  }
  // Actions postponed until after the move, such as a tool change.
  for (const PostponedAction& postponed : std::exchange(postponed_actions_, {})) {
    canon_.set_feed(postponed.feed);
    canon_.set_line(postponed.line, postponed.file);
    postponed.action();
  }
  canon_.set_feed(feed);
  canon_.set_line(line, file);
}

void CutterCompensation::run_after_move(std::function<void()> action) {
  if (waiting_segment_)
    postponed_actions_.push_back({std::move(action), canon_.feed(), canon_.line(), canon_.file()});
  else
    action();
}

}  // namespace abbe::sim::dialects
