#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens/machine.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Vector3d;
using kinematics::AxisVector;
using program::ArcMove;
using program::Coordinates;
using program::Feed;
using program::FeedMode;
using program::Straight;

namespace {

constexpr std::pair<Address, char> axes_of_words[] = {
    {Address::X, 'X'}, {Address::Y, 'Y'}, {Address::Z, 'Z'}, {Address::A, 'A'}, {Address::B, 'B'},
    {Address::C, 'C'}, {Address::U, 'U'}, {Address::V, 'V'}, {Address::W, 'W'}};

/// Returns the angle to which an axis at `now` moves for a programmed angle, rad.
double turned_to(double wanted, double now, Measure measure) {
  const double round = std::remainder(wanted - now, 2 * pi);  // -pi .. pi
  constexpr double there = 1e-9;  // rad, below it the axis is already there
  switch (measure) {
    case Measure::Shortest:
      return now + round;
    case Measure::Upwards:
      return now + (round < -there ? round + 2 * pi : round);
    case Measure::Downwards:
      return now + (round > there ? round - 2 * pi : round);
    default:
      return wanted;
  }
}

}  // namespace

void Machine::put_word(Target& target, int j, const Value& word, bool machine) const {
  const bool linear = canon_.is_linear(j);
  const bool step =
      word.measure == Measure::Step || (word.measure == Measure::Modal && incremental_);
  // Incremental X of DIAM90 is a radius, absolute X a diameter.
  const double radius = j == joint(0) ? radius_of_x(!step) : 1.0;
  const double value = word.value * (linear ? unit() * radius : units::deg);
  const bool turns = word.measure == Measure::Shortest || word.measure == Measure::Upwards ||
                     word.measure == Measure::Downwards;
  if (turns && linear) refuse(word, "a rotary axis with DC, ACP and ACN");
  if (turns) {
    const double now = machine ? canon_.position()[j] : programmed_here()[j];
    // A direction decided here must not be changed by the roll-over rule of the axis.
    return target.turn_to(j, turned_to(value, now, word.measure), word);
  }
  if (step && machine) refuse(word, "an absolute position beside SUPA and G53");
  if (step)
    target.by(j, value, word);
  else
    target.to(j, value, word);
}

Target Machine::block_target(const Block& block, bool machine) const {
  Target target;
  for (const auto& [address, letter] : axes_of_words)
    if (const Value& word = block[address])
      put_word(target, canon_.joint_of(letter), word, machine);
  return target;
}

/// Sets the pole of polar coordinates, in program coordinates of the plane.
void Machine::set_pole(const Block& block) {
  const Code& code = block[Group::Pole];
  const Plane in = plane(code.cause);
  const AxisVector p = canon_.programmed();
  // G110 counts from the current position, G111 from the zero of the workpiece, G112 from the last
  // pole.
  const Eigen::Vector2d from = code.word == "G110"   ? Eigen::Vector2d(p[in.first], p[in.second])
                               : code.word == "G111" ? Eigen::Vector2d(0, 0)
                                                     : pole_.at;
  Eigen::Vector2d by(0, 0);
  const Value &radius = block[Address::RP], &angle = block[Address::AP];
  if (radius || angle)
    by = radius.value * unit() *
         Eigen::Vector2d(std::cos(angle.value * units::deg), std::sin(angle.value * units::deg));
  for (int k = 0; k < 2; ++k) {
    const Address address = Address(in.letters[std::size_t(k)] - 'X');
    if (const Value& word = block[address]) {
      // It is not documented whether X is a diameter here.
      if (address == Address::X) refuse_diameters(word);
      by[k] = word.value * unit();
    }
  }
  pole_ = {from + by};
}

// RP and AP stay until they are programmed again.
void Machine::put_polar(Target& target, const Block& block) {
  const Value &radius = block[Address::RP], &angle = block[Address::AP];
  if (!radius && !angle) return;
  const Cause cause = radius ? radius.cause : angle.cause;
  const Plane in = plane(cause);
  if (target.has(in.first) || target.has(in.second))
    refuse(cause, fmt::format("either {} {} or AP= RP=", in.letters[0], in.letters[1]));
  if (radius) {
    if (radius.value < 0) refuse(radius, "RP that is not below zero");
    pole_.radius = radius.value * unit() + (radius.measure == Measure::Step ? pole_.radius : 0.0);
  }
  if (angle)
    pole_.angle_deg = angle.value + (angle.measure == Measure::Step ? pole_.angle_deg : 0.0);
  const double a = pole_.angle_deg * units::deg;
  target.to(in.first, pole_.at.x() + pole_.radius * std::cos(a), cause);
  target.to(in.second, pole_.at.y() + pole_.radius * std::sin(a), cause);
}

/// Throws BadInput if moves in workpiece coordinates are not possible.
void Machine::check_motion(const Block& block) const {
  const Cause cause = cause_of(block);
  // In tip mode the chain contains the length of the tool; D0 would take it off.
  if (tip_mode() && !length_counts_)
    refuse(cause, "D1 before a move of the tip: the length of the tool counts in it");
  if (swivel_ && !swivel_->turned && !traori_ &&
      (swivel_->frame.rotation.col(2) - Eigen::Vector3d::UnitZ()).norm() > 1e-12)
    refuse(cause,
           "TRAORI, or CYCLE800 with _DIR, before a move in a plane that is not swivelled to");
  if (swivel_ && swivel_->turned && !traori_)
    for (const Address address : {Address::A, Address::B, Address::C})
      if (block[address]) refuse(block[address], "TRAORI or CYCLE800() before a rotary axis turns");
  // On a machine with rotary axes the length of the scene's tool is part of the coordinates, so
  // that the missing length matters with D0; on others with D1.
  const bool length_matters = orientation_.is_possible() ? !length_counts_ : length_counts_;
  if (length_matters && !knows_tool() && joint(2) >= 0 && !canon_.options().tool_length.empty() &&
      motion_ != "G0")
    refuse(cause, "a tool (T) before a feed: those of the scene differ in length");
  // With one tool there is no doubt which one is meant.
  if (tool_ < 0 && motion_ != "G0" && length_counts_ && has_single_length())
    run_.assume_only_tool(cause, "no tool called");
}

void Machine::put_straight(Straight move, bool rapid) {
  if (compensation_.is_on()) return compensation_.straight(std::move(move), rapid);
  compensation_.clear_leaving();
  canon_.straight(std::move(move), rapid);
}

void Machine::point_tool(const Block& block, AxisVector& end) const {
  const Value &a = block[Address::A3], &b = block[Address::B3], &c = block[Address::C3];
  if (!a && !b && !c) return;
  const Cause cause = a ? a.cause : b ? b.cause : c.cause;
  for (const Address address : {Address::A, Address::B, Address::C})
    if (block[address]) refuse(block[address], "either rotary axes or A3= B3= C3=");
  // A3 B3 C3 need not have length 1 on this control.
  const Eigen::Vector3d direction(a.value, b.value, c.value);
  if (!(direction.norm() > 1e-6)) refuse(cause, "a direction of the tool that is not zero");
  // The direction is programmed in the frames in force.
  const auto all = orientation_.positions(total_rotation() * direction.normalized(), end);
  if (all.empty())
    refuse(cause, "a direction that the rotary axes reach",
           fmt::format("({:.6g}, {:.6g}, {:.6g})", a.value, b.value, c.value));
  // The nearest solution comes first.
  end = all.front();
}

void Machine::great_circle(Straight move) {
  const bool ruled = on_great_circle_.has_value();
  // The rule depends on machine data that a program does not show, so it is reported.
  if (!ruled && workpiece_frame_)
    run_.warn_once(
        "lines turn the tool on great circles, as ORIWKS does where a machine has no other rule: "
        "ORIAXES or ORIMKS moves its rotary axes in proportion");
  const auto pieces =
      great_circle_segments(orientation_, canon_.position(), move.end, great_circle_tolerance);
  if (pieces.empty())
    refuse(move.cause, "ORIAXES before a turn of the tool that is no great circle of these axes");
  feed_along_segments(canon_, orientation_, pieces, move);
}

/// G53, G153, SUPA: machine coordinates. A tool length in force lies between Z and the tip.
void Machine::to_machine(const Block& block) {
  const Code& code = block[Group::WithoutOffset];
  const Value* axis = first_axis_word(block);
  if (axis == nullptr) return;
  if (motion_ != "G0" && motion_ != "G1")
    refuse(code.cause, "G0 or G1 beside " + shown(code.cause.text));
  // With TRAORI machine coordinates are not those of X Y Z words.
  if (traori_) refuse(code.cause, "TRAFOOF before " + shown(code.cause.text));
  if (tip_mode() && length_counts_)
    refuse(code.cause, "D0 beside " + shown(code.cause.text) + " in a swivelled plane");
  canon_.go_to(Coordinates::Axis, code.cause);
  Target target = block_target(block, true);
  // On a turning control the length in force has X and Z.
  if (const AxisVector shift = active_tool_shift(); run_.is_turning() && shift.size() > 0) {
    for (const Address address : {Address::X, Address::Y, Address::Z})
      if (const Value& word = block[address]) {
        const int j = joint(int(address) - int(Address::X));
        target.to(j, target.value(j) + shift[j], word);
      }
  } else if (const Value& z = block[Address::Z]; z && length_counts_ && knows_tool())
    target.to(joint(2), target.value(joint(2)) + active_tool_length(z), z);
  AxisVector end = canon_.end_of(target, true);
  put_straight({std::move(end), code.cause, true, target.stated()}, motion_ == "G0");
  if (tip_mode()) canon_.go_to(Coordinates::Tip, code.cause);
}

/// A line at a feed per spindle turn, whatever F is (G33).
void Machine::thread(const Block& block, AxisVector end) {
  const Cause cause = cause_of(block);
  const AxisVector way = end - canon_.position();
  // The pitch is that of the axis with the longest path, as on the control.
  int longest = 0;
  for (int k = 1; k < 3; ++k)
    if (joint(k) >= 0 &&
        (joint(longest) < 0 || std::abs(way[joint(k)]) > std::abs(way[joint(longest)])))
      longest = k;
  const Value& pitch = block[Address(int(Address::I) + longest)];
  if (!pitch || pitch.value == 0)
    refuse(cause, fmt::format("{}, the pitch along {}, beside G33", "IJK"[longest], "XYZ"[longest]),
           "none");
  double squares = 0.0;
  for (int k = 0; k < 3; ++k)
    if (joint(k) >= 0) squares += way[joint(k)] * way[joint(k)];
  const double along = std::abs(way[joint(longest)]);
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  // The feed along the path is larger than the pitch by the slope.
  const double slant = along > 0 ? std::sqrt(squares) / along : 1.0;
  canon_.set_feed(Feed{std::abs(pitch.value) * slant, unit()});
  // F and its mode are restored on errors too, or every later block would get the wrong time.
  const auto again = [&] {
    canon_.set_feed_mode(mode);
    canon_.set_feed(feed);
  };
  try {
    put_straight({.end = std::move(end), .cause = cause}, false);
  } catch (const BadInput&) {
    again();
    throw;
  }
  again();
}

/// Executes the motion of a block. Returns true if the block had words of motion.
bool Machine::move(const Block& block) {
  if (block[Group::WithoutOffset]) {
    to_machine(block);
    return first_axis_word(block) != nullptr;
  }
  // A3 B3 C3 alone rotate the tool about its tip; I J K or CR alone make a full circle.
  const bool points = block[Address::A3] || block[Address::B3] || block[Address::C3];
  const bool polar = block[Address::AP] || block[Address::RP];
  const bool round = motion_ == "G2" || motion_ == "G3" || motion_ == "CIP";
  const bool centre = block[Address::I] || block[Address::J] || block[Address::K] ||
                      block[Address::CR] || block[Address::AR];
  if (first_axis_word(block) == nullptr && !points && !polar && !(round && centre)) return false;
  check_motion(block);
  Target target = block_target(block, false);
  put_polar(target, block);
  if (motion_ == "CIP") {
    arc_through(block, target);
    return true;
  }
  if (round) {
    arc(block, target);
    return true;
  }
  AxisVector end = canon_.end_from(here(), target, false);
  if (motion_ == "G33") {
    thread(block, std::move(end));
    return true;
  }
  point_tool(block, end);
  Straight move{std::move(end), cause_of(block), false, target.stated()};
  bool turns = false;
  // Great circles apply to G1 only; rapids move the rotary axes in proportion.
  for (const int j : orientation_.rotary_joints()) turns = turns || move.end[j] != canon_.position()[j];
  if (traori_ && turns && motion_ == "G1" && on_great_circle_.value_or(workpiece_frame_))
    great_circle(std::move(move));
  else
    put_straight(std::move(move), motion_ == "G0");
  return true;
}

Machine::Plane Machine::plane(const Cause& cause) const {
  using enum Address;
  Plane in = plane_ == 17   ? Plane{"XYZ", {I, J, K}}
             : plane_ == 18 ? Plane{"ZXY", {K, I, J}}
                            : Plane{"YZX", {J, K, I}};
  in.first = canon_.joint_of(in.letters[0]);
  in.second = canon_.joint_of(in.letters[1]);
  in.across = canon_.joint_of(in.letters[2]);
  if (in.first < 0 || in.second < 0)
    refuse(cause,
           fmt::format("a machine with the axes {} {} of the plane", in.letters[0], in.letters[1]));
  return in;
}

/// Returns the centre by I J K, in program coordinates.
AxisVector Machine::centre_of(const Block& block, const Plane& in, const Cause& cause) const {
  const Value &first = block[in.centre[0]], &second = block[in.centre[1]];
  if (const Value& across = block[in.centre[2]])
    refuse(across, fmt::format("the centre in the plane {} {}", in.letters[0], in.letters[1]));
  if (!first && !second)
    refuse(cause, "I J K, CR=, AR= or a pole beside " + std::string(motion_), "none");
  AxisVector p = programmed_here();
  const auto put = [&](int j, const Value& word) {
    if (!word) return;
    const bool absolute = word.measure == Measure::Absolute;
    // An incremental I is a radius even with DIAMON.
    const double radius = absolute && j == joint(0) ? radius_of_x(true) : 1.0;
    const double value = word.value * unit() * radius;
    p[j] = absolute ? value : p[j] + value;
  };
  put(in.first, first);
  put(in.second, second);
  return p;
}

void Machine::arc(const Block& block, const Target& words) {
  const Cause cause = cause_of(block);
  const Plane in = plane(cause);
  const Value &radius = block[Address::CR], &angle = block[Address::AR],
              &more = block[Address::TURN];
  const bool polar = block[Address::AP] || block[Address::RP];
  const bool centre = block[Address::I] || block[Address::J] || block[Address::K];
  // The ways to program an arc exclude each other.
  if (radius && (angle || centre || polar)) refuse(radius, "one of CR=, AR=, I J K and a pole");
  if (polar && (angle || centre)) refuse(cause, "one of CR=, AR=, I J K and a pole");
  Target target = words;
  ArcMove move{.first = in.first,
               .second = in.second,
               .end = {},
               .clockwise = motion_ == "G2",
               .cause = cause,
               .named = radius  ? radius.cause
                        : angle ? angle.cause
                                : cause};
  // AR=360 would have no end that defines it.
  if (angle && !(angle.value > 0 && angle.value < 360))
    refuse(angle, "AR of more than 0 to less than 360 degrees");
  const double turn = angle.value * units::deg;
  AxisVector p;
  if (polar) {
    p = programmed_here();
    p[in.first] = pole_.at.x();
    p[in.second] = pole_.at.y();
  } else if (centre || (!radius && !angle)) {
    p = centre_of(block, in, cause);
  }
  // AR with the centre: the end is the start rotated about the centre.
  if (angle && centre) {
    if (target.has(in.first) || target.has(in.second))
      refuse(angle, "AR= beside either the centre or the end");
    const AxisVector start = programmed_here();
    const Eigen::Rotation2Dd rotated(move.clockwise ? -turn : turn);
    const Eigen::Vector2d end =
        Eigen::Vector2d(p[in.first], p[in.second]) +
        rotated * Eigen::Vector2d(start[in.first] - p[in.first], start[in.second] - p[in.second]);
    target.to(in.first, end.x(), angle);
    target.to(in.second, end.y(), angle);
  }
  move.end = canon_.end_from(here(), target, false);
  if (p.size() > 0) {
    move.placed_centre = canon_.placed(std::move(p));
  } else if (radius) {
    move.radius = radius.value * unit();
  } else {
    const AxisVector from = programmed_here(), to = canon_.unplaced(move.end);
    const double chord = std::hypot(to[in.first] - from[in.first], to[in.second] - from[in.second]);
    // AR with the end: the radius follows from the chord; more than half a turn is the arc of
    // negative radius.
    const double r = chord / (2 * std::sin(0.5 * turn));
    move.radius = turn > pi ? -r : r;
  }
  if (more && (more.value < 0 || more.value > 999 || more.value != std::floor(more.value)))
    refuse(more, "whole turns of 0 to 999 after TURN");
  move.turns = 1 + int(more.value);
  move.stated = target.stated();
  put_arc(block, std::move(move));
}

void Machine::put_arc(const Block& block, ArcMove move) {
  // Compensation begins and ends with a line, whose direction defines the entry.
  if (compensation_.is_leaving()) refuse(move.cause, "a line as the first move after G40");
  if (compensation_.is_on()) {
    if (!compensation_.has_entered()) refuse(move.cause, "a line as the first move after G41 and G42");
    return compensation_.arc(std::move(move));
  }
  const AxisVector start = canon_.position();
  point_tool(block, move.end);
  for (const int j : orientation_.rotary_joints())
    // An arc on which the tool turns on a great circle is not defined by its plane alone.
    if (traori_ && move.end[j] != start[j] && on_great_circle_.value_or(workpiece_frame_))
      refuse(move.cause, "ORIAXES before an arc that turns the tool");
  canon_.arc(std::move(move));
}

namespace {

/// Circle through three points along which it is counter-clockwise.
struct Circle {
  Vector3d centre, normal;
};

std::optional<Circle> circle_through(const Vector3d& start, const Vector3d& between,
                                     const Vector3d& end) {
  const Vector3d a = between - start, b = end - start, n = a.cross(b);
  // Relative 1e-9: the points lie on a line within rounding.
  if (!(n.norm() > 1e-9 * a.norm() * b.norm()) || !(n.norm() > 1e-12)) return std::nullopt;
  const Vector3d to_centre =
      (a.squaredNorm() * b - b.squaredNorm() * a).cross(n) / (2 * n.squaredNorm());
  return Circle{start + to_centre, n.normalized()};
}

}  // namespace

/// CIP: the circle through an intermediate point, in the plane of the three points.
void Machine::arc_through(const Block& block, const Target& target) {
  const Cause cause = cause_of(block);
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cause, "a machine with X Y Z beside CIP");
  AxisVector between = canon_.programmed();
  for (int k = 0; k < 3; ++k) {
    const Value& word = block[Address(int(Address::I1) + k)];
    if (!word) continue;
    // It is not documented whether I1 is a diameter.
    if (k == 0) refuse_diameters(word);
    const bool step =
        word.measure == Measure::Step || (word.measure == Measure::Modal && incremental_);
    between[joint(k)] = word.value * unit() + (step ? between[joint(k)] : 0.0);
  }
  ArcMove move{
      .end = canon_.end_of(target), .cause = cause, .named = cause, .stated = target.stated()};
  const auto xyz = [&](const AxisVector& q) {
    return Vector3d(q[joint(0)], q[joint(1)], q[joint(2)]);
  };
  const AxisVector start = canon_.position();
  const auto circle = circle_through(xyz(start), xyz(canon_.placed(between)), xyz(move.end));
  if (!circle) refuse(cause, "three different points beside CIP that lie on no line");
  move.placed_centre = start;
  for (int k = 0; k < 3; ++k) move.placed_centre[joint(k)] = circle->centre[k];
  const program::Frame frame = canon_.frame();
  program::Frame of_the_arc{frame.shift, std::nullopt};
  int across = 0;
  const double most = circle->normal.cwiseAbs().maxCoeff(&across);
  // 1 - cos = tilt^2 / 2, a tilt of 1.4e-7 rad: the plane of two axes
  constexpr double in_plane = 1e-14;
  // In a plane of two axes no rotation is needed.
  if (most > 1 - in_plane) {
    move.first = joint((across + 1) % 3);
    move.second = joint((across + 2) % 3);
    move.clockwise = circle->normal[across] < 0;
  } else {
    // Otherwise the frame is rotated for this one arc; x points at the start, so that its angle is
    // zero.
    Eigen::Matrix3d R;
    R.col(0) = (xyz(start) - circle->centre).normalized();
    R.col(2) = circle->normal;
    R.col(1) = R.col(2).cross(R.col(0));
    of_the_arc.rotation = R;
    move.first = joint(0);
    move.second = joint(1);
  }
  // The frame in force is restored in any case.
  canon_.set_frame(system_, std::move(of_the_arc));
  try {
    put_arc(block, std::move(move));
  } catch (const BadInput&) {
    canon_.set_frame(system_, frame);
    throw;
  }
  canon_.set_frame(system_, frame);
}

}  // namespace abbe::sim::dialects::siemens
