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
  if (const auto own = control.control_of_h.find(tool); own != control.control_of_h.end())
    return &own->second;
  return control.control ? &*control.control : nullptr;
}

AxisVector measured_offset(const program::Canon& canon, const Chain& chain,
                           const program::Cause& cause) {
  auto shift = program::tip_shift(chain);
  if (!shift) canon.refuse(cause, "slides at right angles beside the offset of a turning tool");
  // The canon adds the origin of the work offsets to every tool shift, so it is subtracted here.
  const Eigen::Vector3d more = canon.shift_correction();
  for (int k = 0; k < 3; ++k)
    if (const int j = canon.joint_of("XYZ"[k]); j >= 0) (*shift)[j] -= more[k];
  return *shift;
}

AxisVector nose_offset(const program::Canon& canon, int tip, std::optional<double> radius) {
  struct Direction {
    int x, z;
  };
  // Signs of the direction from the centre to the imaginary tip, by tip number.
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

constexpr double same_place = 1e-9;  // mm, rounding of a position
// mm by which a trimmed segment may run backwards because its intersection is rounded
constexpr double free_length = 1e-6;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

Vector2d left_of(const Vector2d& d) { return {-d.y(), d.x()}; }

/// A line by a point and a unit direction, or a circle by its centre `point` and radius.
struct Curve {
  bool round = false;
  Vector2d point, direction;
  double radius = 0.0;
};

std::vector<Vector2d> line_and_circle(const Curve& line, const Curve& circle) {
  const Vector2d from = line.point - circle.point;
  const double along = -from.dot(line.direction);
  const Vector2d nearest = line.point + along * line.direction;
  const double rest = circle.radius * circle.radius - (nearest - circle.point).squaredNorm();
  if (rest < 0) return {};
  const Vector2d half = std::sqrt(rest) * line.direction;
  return {nearest - half, nearest + half};
}

/// Returns the intersections of two lines or circles.
std::vector<Vector2d> shared(const Curve& a, const Curve& b) {
  if (!a.round && !b.round) {
    const double sine = cross(a.direction, b.direction);
    if (sine == 0.0) return {};
    return {a.point + cross(b.point - a.point, b.direction) / sine * a.direction};
  }
  if (!a.round) return line_and_circle(a, b);
  if (!b.round) return line_and_circle(b, a);
  const Vector2d between = b.point - a.point;
  const double d = between.norm();
  if (d == 0.0) return {};
  // Distance from the centre of a to the line through both intersections.
  const double along = (d * d + a.radius * a.radius - b.radius * b.radius) / (2 * d);
  const double rest = a.radius * a.radius - along * along;
  if (rest < 0) return {};
  const Vector2d unit = between / d, middle = a.point + along * unit;
  const Vector2d half = std::sqrt(rest) * left_of(unit);
  return {middle - half, middle + half};
}

}  // namespace

void Compensation::begin(bool left, double radius, std::array<int, 2> plane,
                         CompensationRules manner) {
  manner_ = manner;
  on_ = true;
  // As on controls, a negative radius compensates on the other side.
  left_ = radius >= 0 ? left : !left;
  radius_ = std::abs(radius);
  plane_ = plane;
  // After `end` the tool is still beside the path, so the position of the axes is not the
  // programmed one.
  if (!leaving_) programmed_ = canon_.position();
  leaving_ = entered_ = false;
}

void Compensation::begin_at_offset(bool left, double radius, std::array<int, 2> plane,
                                   AxisVector programmed) {
  begin(left, radius, plane);
  programmed_ = std::move(programmed);
  entered_ = true;
}

void Compensation::end() {
  emit_waiting_move();
  leaving_ = on_ && entered_;
  on_ = entered_ = false;
}

const AxisVector& Compensation::programmed() const { return programmed_; }

AxisVector Compensation::end_of(const Target& target) const {
  return canon_.end_from(programmed_, target, false);
}

Vector2d Compensation::centre_of(const ArcMove& move) const {
  if (!move.radius)
    return move.placed_centre.size() > 0 ? in_plane(move.placed_centre) : move.centre;
  const program::ArcGeometry ends{in_plane(programmed_), in_plane(move.end), {}, move.clockwise};
  return program::centre_by_radius(ends, *move.radius, canon_.place(), move.named);
}

Vector2d Compensation::beside(const Vector2d& direction) const {
  return (left_ ? radius_ : -radius_) * left_of(direction);
}

// In inverse time an inserted arc would have no defined duration.
void Compensation::check_feed(const Cause& cause) const {
  if (canon_.feed_mode() == FeedMode::InverseTime)
    canon_.refuse(cause, "G94 beside G41 and G42: an outside corner has no time of its own");
}

void Compensation::straight(Straight move, bool rapid) {
  if (!rapid) check_feed(move.cause);
  const Vector2d from = in_plane(programmed_), to = in_plane(move.end);
  const double length = (to - from).norm();
  if (length < same_place) {
    // Only other axes move. Their position in the plane is known once the waiting move has been
    // made.
    programmed_ = move.end;
    after([this, end = move.end, cause = Cause{move.cause.column, {}}, rapid] {
      AxisVector here = end;
      for (const int j : plane_) here[j] = canon_.position()[j];
      if (rapid)
        canon_.traverse({.end = here, .cause = cause});
      else
        canon_.straight_feed({.end = here, .cause = cause});
    });
    return;
  }
  Piece piece;
  piece.rapid = rapid;
  piece.leaves = piece.arrives = (to - from) / length;
  piece.start = from + beside(piece.leaves);
  piece.end = to + beside(piece.leaves);
  piece.entry = !entered_;
  // A rule of LinuxCNC; other controls accept shorter entries.
  if (piece.entry && !manner_.perpendicular_entry && length < radius_)
    canon_.refuse(move.cause,
                  fmt::format("an entry move of at least the radius of the tool, {} mm", radius_),
                  fmt::format("{} mm", length));
  piece.to = std::move(move.end);
  piece.cause = move.cause;
  join(std::move(piece));
}

void Compensation::arc(ArcMove move) {
  check_feed(move.cause);
  if (move.first != plane_[0] || move.second != plane_[1])
    canon_.refuse(move.cause, "an arc in the plane of the cutter compensation");
  move.centre = centre_of(move);
  const program::ArcGeometry words{in_plane(programmed_), in_plane(move.end), move.centre,
                                   move.clockwise};
  const program::Arc arc = program::checked_arc(words, move.turns, canon_.place(), move.named);
  // With the tool on the side of the centre the offset arc is smaller by the tool radius.
  const bool inside = left_ != move.clockwise;
  Piece piece;
  piece.round = true;
  piece.clockwise = move.clockwise;
  piece.turns = move.turns;
  piece.centre = move.centre;
  piece.radius = arc.radius + (inside ? -radius_ : radius_);
  if (inside && piece.radius < same_place)
    canon_.refuse(move.named,
                  fmt::format("an arc of more than the radius of the tool, {} mm", radius_),
                  fmt::format("{} mm", arc.radius));
  const Vector2d out = (words.start - move.centre).normalized();
  const Vector2d in = (words.end - move.centre).normalized();
  piece.start = move.centre + piece.radius * out;
  // Radii that differ between the ends, within the tolerance for arcs, keep their difference.
  piece.end = move.centre + (piece.radius + arc.growth) * in;
  piece.entry = !entered_;
  if (piece.entry) enter_by_arc(piece, in, move.cause);
  piece.leaves = move.clockwise ? Vector2d(-left_of(out)) : left_of(out);
  piece.arrives = move.clockwise ? Vector2d(-left_of(in)) : left_of(in);
  piece.to = std::move(move.end);
  piece.cause = move.cause;
  join(std::move(piece));
}

/// Enters by an arc as LinuxCNC does: from the current position to the offset end, where it arrives
/// in the programmed direction. Its centre is therefore on the programmed radius through the end.
void Compensation::enter_by_arc(Piece& piece, const Vector2d& outwards, const Cause& cause) const {
  const Vector2d from = in_plane(programmed_) - piece.end;
  const double along = from.dot(outwards);
  if (from.norm() < radius_ || !(along < 0))
    canon_.refuse(cause, fmt::format("an entry arc that a tool of {} mm of radius can go", radius_),
                  "one too small");
  piece.radius = -from.squaredNorm() / (2 * along);
  piece.centre = piece.end - piece.radius * outwards;
  piece.start = in_plane(programmed_);
}

/// Makes the corner between the waiting segment and the next one, which then waits.
void Compensation::join(Piece piece) {
  const Vector2d corner = in_plane(programmed_);
  piece.feed = canon_.feed();
  piece.line = canon_.line();
  piece.file = canon_.file();
  programmed_ = piece.to;
  entered_ = true;
  // A perpendicular entry ends at the offset start of the segment after it.
  if (waits_ && waits_->entry && manner_.perpendicular_entry) {
    waits_->end = piece.start;
    emit_waiting_move();
  } else if (waits_) {
    const double no_corner = manner_.min_corner;
    const double turn =
        std::atan2(cross(waits_->arrives, piece.leaves), waits_->arrives.dot(piece.leaves));
    const double outwards = left_ ? -turn : turn;
    // A reversal of a line, to within the tolerance of a corner, counts as an outside corner.
    const bool round = waits_->round || piece.round;
    if (outwards < -no_corner && (round || outwards > no_corner - pi)) {
      concave(piece, corner);
      emit_waiting_move();
    } else if (std::abs(outwards) > no_corner) {
      round_corner(piece, corner);
    } else {
      emit_waiting_move();
    }
  }
  waits_ = std::move(piece);
}

/// Returns true if the part of a segment from one point to another runs forwards and, on an arc, is
/// not longer than the segment.
bool Compensation::has_length_left(const Piece& piece, const Vector2d& from, const Vector2d& to) {
  if (!piece.round) return piece.entry || (to - from).dot(piece.arrives) >= -free_length;
  const auto sweep = [&](const Vector2d& a, const Vector2d& b) {
    const Vector2d p = a - piece.centre, q = b - piece.centre;
    double turn = std::atan2(cross(p, q), p.dot(q));
    if (piece.clockwise) turn = -turn;
    // Below free_length (zero up to rounding, or backwards) it is taken as the way around the
    // circle.
    return turn * piece.radius > free_length ? turn : turn + 2 * pi;
  };
  return piece.turns > 1 || sweep(from, to) * piece.radius <=
                                sweep(piece.start, piece.end) * piece.radius + free_length;
}

void Compensation::concave(Piece& next, const Vector2d& corner) {
  const auto curve = [](const Piece& piece) {
    return piece.round ? Curve{true, piece.centre, {}, piece.radius}
                       : Curve{false, piece.end, piece.arrives, 0.0};
  };
  const Vector2d* meet = nullptr;
  const std::vector<Vector2d> points = shared(curve(*waits_), curve(next));
  // The control means that of the two intersections which is nearer to the programmed corner.
  for (const Vector2d& point : points)
    if (meet == nullptr || (point - corner).norm() < (*meet - corner).norm()) meet = &point;
  const bool reached = meet != nullptr && has_length_left(*waits_, waits_->start, *meet) &&
                       has_length_left(next, *meet, next.end);
  if (reached) {
    waits_->end = *meet;
    next.start = *meet;
  } else {
    canon_.refuse(next.cause,
                  fmt::format("an inside corner that a tool of {} mm of radius reaches", radius_),
                  "one too narrow");
  }
}

// A rapid goes straight around an outside corner, a feed move on an arc about it.
void Compensation::round_corner(const Piece& next, const Vector2d& corner) {
  emit_waiting_move();
  if (next.rapid) {
    AxisVector beside = canon_.position();
    for (int k = 0; k < 2; ++k) beside[plane_[std::size_t(k)]] = next.start[k];
    return canon_.traverse({.end = std::move(beside), .cause = next.cause});
  }
  const AxisVector at_corner = canon_.position();
  ArcMove around{.first = plane_[0],
                 .second = plane_[1],
                 .end = at_corner,
                 .centre = corner,
                 .clockwise = left_,
                 .cause = next.cause,
                 .named = next.cause};
  for (int k = 0; k < 2; ++k) around.end[plane_[std::size_t(k)]] = next.start[k];
  canon_.arc(std::move(around));
}

/// Makes the waiting move with the feed and the line of its own block, then the postponed actions.
void Compensation::emit_waiting_move() {
  if (waits_) {
    const Piece piece = *std::exchange(waits_, std::nullopt);
    const auto feed = canon_.feed();
    const int line = canon_.line(), file = canon_.file();
    canon_.set_feed(piece.feed);
    canon_.set_line(piece.line, piece.file);
    AxisVector end = piece.to;
    for (int k = 0; k < 2; ++k) end[plane_[std::size_t(k)]] = piece.end[k];
    // Without text: the offset move is not what the block says, so messages state only the column.
    const Cause cause{piece.cause.column, {}};
    if (piece.round)
      canon_.arc({.first = plane_[0],
                  .second = plane_[1],
                  .end = std::move(end),
                  .centre = piece.centre,
                  .clockwise = piece.clockwise,
                  .turns = piece.turns,
                  .cause = cause,
                  .named = cause});
    else if (piece.rapid)
      canon_.traverse({.end = std::move(end), .cause = cause});
    else
      canon_.straight_feed({.end = std::move(end), .cause = cause});
    canon_.set_feed(feed);
    canon_.set_line(line, file);
  }
  // Actions postponed until after the move, such as a tool change, in their order.
  const auto feed = canon_.feed();
  const int line = canon_.line(), file = canon_.file();
  for (const Later& later : std::exchange(after_, {})) {
    canon_.set_feed(later.feed);
    canon_.set_line(later.line, later.file);
    later.action();
  }
  canon_.set_feed(feed);
  canon_.set_line(line, file);
}

void Compensation::after(std::function<void()> action) {
  if (waits_)
    after_.push_back({std::move(action), canon_.feed(), canon_.line(), canon_.file()});
  else
    action();
}

}  // namespace abbe::sim::dialects
