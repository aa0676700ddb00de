#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_machine.h"

namespace abbe::sim::dialects::siemens {

using kinematics::AxisVector;
using program::Coordinates;
using program::Feed;
using program::FeedMode;
using program::Straight;

namespace {

constexpr std::pair<Address, char> axes_of_words[] = {
    {Address::X, 'X'}, {Address::Y, 'Y'}, {Address::Z, 'Z'}, {Address::A, 'A'}, {Address::B, 'B'},
    {Address::C, 'C'}, {Address::U, 'U'}, {Address::V, 'V'}, {Address::W, 'W'}};

/// The angle of an axis that stands at `now` and is to go to `wanted` as the words say, rad.
double turned_to(double wanted, double now, Measure measure) {
  const double round = std::remainder(wanted - now, 2 * pi);  // -pi .. pi
  constexpr double there = 1e-9;                              // rad, no turn
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
  const double radius = j == joint(0) ? radius_of_x(!step) : 1.0;
  const double value = word.value * (linear ? unit() * radius : units::deg);
  const bool turns = word.measure == Measure::Shortest || word.measure == Measure::Upwards ||
                     word.measure == Measure::Downwards;
  if (turns && linear) refuse(word, "a rotary axis with DC, ACP and ACN");
  if (turns) {
    const double now = machine ? canon_.position()[j] : programmed_here()[j];
    return target.turn_to(j, turned_to(value, now, word.measure), word);
  }
  if (step && machine) refuse(word, "an absolute position beside SUPA and G53");
  if (step)
    target.by(j, value, word);
  else
    target.to(j, value, word);
}

Target Machine::target_of(const Block& block, bool machine) const {
  Target target;
  for (const auto& [address, letter] : axes_of_words)
    if (const Value& word = block[address])
      put_word(target, canon_.joint_of(letter), word, machine);
  return target;
}

/// The pole, in program coordinates of the plane.
void Machine::set_pole(const Block& block) {
  const Code& code = block[Group::Pole];
  const Plane in = plane(code.cause);
  const AxisVector p = canon_.programmed();
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
      if (address == Address::X) refuse_diameters(word);
      by[k] = word.value * unit();
    }
  }
  pole_ = {from + by};
}

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

/// What forbids a move in the coordinates of the workpiece.
void Machine::check_motion(const Block& block) const {
  const Cause cause = cause_of(block);
  if (tip_mode() && !length_counts_)
    refuse(cause, "D1 before a move of the tip: the length of the tool counts in it");
  if (swivel_ && !swivel_->turned && !traori_ &&
      (swivel_->frame.rotation.col(2) - Eigen::Vector3d::UnitZ()).norm() > 1e-12)
    refuse(cause,
           "TRAORI, or CYCLE800 with _DIR, before a move in a plane that is not swivelled to");
  if (swivel_ && swivel_->turned && !traori_)
    for (const Address address : {Address::A, Address::B, Address::C})
      if (block[address]) refuse(block[address], "TRAORI or CYCLE800() before a rotary axis turns");
  const bool length_matters = turning_.possible() ? !length_counts_ : length_counts_;
  if (length_matters && !knows_tool() && joint(2) >= 0 && !canon_.options().tool_length.empty() &&
      motion_ != "G0")
    refuse(cause, "a tool (T) before a feed: those of the scene differ in length");
  if (tool_ < 0 && motion_ != "G0" && length_counts_ && one_length())
    run_.uncalled_tool(cause, "no tool called");
}

void Machine::put_straight(Straight move, bool rapid) {
  if (compensation_.on()) return compensation_.straight(std::move(move), rapid);
  compensation_.left_behind();
  canon_.straight(std::move(move), rapid);
}

void Machine::point_tool(const Block& block, AxisVector& end) const {
  const Value &a = block[Address::A3], &b = block[Address::B3], &c = block[Address::C3];
  if (!a && !b && !c) return;
  const Cause cause = a ? a.cause : b ? b.cause : c.cause;
  for (const Address address : {Address::A, Address::B, Address::C})
    if (block[address]) refuse(block[address], "either rotary axes or A3= B3= C3=");
  const Eigen::Vector3d direction(a.value, b.value, c.value);
  if (!(direction.norm() > 1e-6)) refuse(cause, "a direction of the tool that is not zero");
  const auto all = turning_.positions(total_rotation() * direction.normalized(), end);
  if (all.empty())
    refuse(cause, "a direction that the rotary axes reach",
           fmt::format("({:.6g}, {:.6g}, {:.6g})", a.value, b.value, c.value));
  end = all.front();
}

void Machine::great_circle(Straight move) {
  const bool ruled = on_great_circle_.has_value();
  if (!ruled && workpiece_frame_)
    run_.warn_once(
        "lines turn the tool on great circles, as ORIWKS does where a machine has no other rule: "
        "ORIAXES or ORIMKS moves its rotary axes in proportion");
  const auto pieces =
      great_circle_pieces(turning_, canon_.position(), move.end, great_circle_within);
  if (pieces.empty())
    refuse(move.cause, "ORIAXES before a turn of the tool that is no great circle of these axes");
  feed_in_pieces(canon_, turning_, pieces, move);
}

/// G53, G153, SUPA: the axes themselves; a tool length that counts lies between Z and its tip.
void Machine::to_machine(const Block& block) {
  const Code& code = block[Group::WithoutOffset];
  const Value* axis = first_axis_word(block);
  if (axis == nullptr) return;
  if (motion_ != "G0" && motion_ != "G1")
    refuse(code.cause, "G0 or G1 beside " + shown(code.cause.text));
  if (traori_) refuse(code.cause, "TRAFOOF before " + shown(code.cause.text));
  if (tip_mode() && length_counts_)
    refuse(code.cause, "D0 beside " + shown(code.cause.text) + " in a swivelled plane");
  canon_.go_to(Coordinates::Axis, code.cause);
  Target target = target_of(block, true);
  if (const AxisVector shift = shift_of_tool(); run_.turning() && shift.size() > 0) {
    for (const Address address : {Address::X, Address::Y, Address::Z})
      if (const Value& word = block[address]) {
        const int j = joint(int(address) - int(Address::X));
        target.to(j, target.value(j) + shift[j], word);
      }
  } else if (const Value& z = block[Address::Z]; z && length_counts_ && knows_tool())
    target.to(joint(2), target.value(joint(2)) + length_of_tool(z), z);
  AxisVector end = canon_.end_of(target, true);
  put_straight({std::move(end), code.cause, true, target.stated()}, motion_ == "G0");
  if (tip_mode()) canon_.go_to(Coordinates::Tip, code.cause);
}

/// A line at so much per turn of the spindle, whatever F says.
void Machine::thread(const Block& block, AxisVector end) {
  const Cause cause = cause_of(block);
  const AxisVector way = end - canon_.position();
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
  const double slant = along > 0 ? std::sqrt(squares) / along : 1.0;
  canon_.set_feed(Feed{std::abs(pitch.value) * slant, unit()});
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

/// @return whether the block had words of motion
bool Machine::move(const Block& block) {
  if (block[Group::WithoutOffset]) {
    to_machine(block);
    return first_axis_word(block) != nullptr;
  }
  const bool points = block[Address::A3] || block[Address::B3] || block[Address::C3];
  const bool polar = block[Address::AP] || block[Address::RP];
  const bool round = motion_ == "G2" || motion_ == "G3" || motion_ == "CIP";
  const bool centre = block[Address::I] || block[Address::J] || block[Address::K] ||
                      block[Address::CR] || block[Address::AR];
  if (first_axis_word(block) == nullptr && !points && !polar && !(round && centre)) return false;
  check_motion(block);
  Target target = target_of(block, false);
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
  for (const int j : turning_.rotary()) turns = turns || move.end[j] != canon_.position()[j];
  if (traori_ && turns && motion_ == "G1" && on_great_circle_.value_or(workpiece_frame_))
    great_circle(std::move(move));
  else
    put_straight(std::move(move), motion_ == "G0");
  return true;
}

}  // namespace abbe::sim::dialects::siemens
