#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc_machine.h"
#include "sim/program/arc_of_block.h"

namespace abbe::sim::dialects::linuxcnc {

using program::ArcMove;
using program::Coordinates;
using program::Feed;
using program::FeedMode;
using program::Straight;

Eigen::Vector2d Machine::polar_end(const Block& block, const Eigen::Vector2d& from) const {
  const NcWord &r = block.radius(), &a = block.angle();
  double radius = from.norm(), angle = std::atan2(from.y(), from.x()) / units::deg;
  if (r) radius = r.value * unit() + (incremental_ ? radius : 0.0);
  if (a) angle = a.value + (incremental_ ? angle : 0.0);
  return {radius * std::cos(angle * units::deg), radius * std::sin(angle * units::deg)};
}

Target Machine::target_of(const Block& block, bool machine) const {
  Target target;
  for (int k = 0; k < 9; ++k) {
    const NcWord& word = block[axis_letters[std::size_t(k)]];
    if (!word) continue;
    const int j = joint(k);
    const double value = axis_word(k, word) * (canon_.is_linear(j) ? 1.0 : units::deg);
    if (incremental_ && !machine)
      target.by(j, value, word);
    else
      target.to(j, value, word);
  }
  if (block.is_polar()) {
    const bool beside = compensation_.on() || compensation_.leaving();
    const AxisVector p = canon_.unplaced(beside ? compensation_.programmed() : canon_.position());
    const Eigen::Vector2d end = polar_end(block, {p[joint(0)], p[joint(1)]});
    const NcWord& word = block.radius() ? block.radius() : block.angle();
    target.to(joint(0), end.x(), word);
    target.to(joint(1), end.y(), word);
  }
  return target;
}

void Machine::straight(const Block& block, AxisVector end, std::uint32_t stated, bool machine) {
  Straight move{std::move(end), cause_of(block), machine, stated};
  if (compensation_.on()) {
    if (machine) refuse(move.cause, "G40 before G53");
    return compensation_.straight(std::move(move), motion_ == 0);
  }
  canon_.straight(std::move(move), motion_ == 0);
}

void Machine::arc(const Block& block, AxisVector end, std::uint32_t stated) {
  const bool beside = compensation_.on();
  ArcMove arc = program::arc_of_block(
      canon_, {.plane = plane_ / 10,
               .clockwise = motion_ == 20,
               .absolute_centre = absolute_centre_,
               .from = beside ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = cause_of(block),
               .stated = stated,
               .word = [&](char letter) -> std::optional<program::LengthWord> {
                 const NcWord& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthWord{word.value * unit(), word};
               }});
  if (const NcWord& turns = block['P']) {
    if (!(turns.value >= 1 && turns.value <= 1e6) || turns.value != std::floor(turns.value))
      refuse(turns, "whole turns of 1 to 1e6 after P");
    arc.turns = int(turns.value);
  }
  if (beside) return compensation_.arc(std::move(arc));
  canon_.arc(std::move(arc));
}

/// A line at so much per turn of the spindle, whatever F says.
void Machine::feed_per_turn(const NcWord& pitch, const Straight& move) {
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  canon_.set_feed(Feed{std::abs(pitch.value), unit()});
  const auto again = [&] {
    canon_.set_feed_mode(mode);
    canon_.set_feed(feed);
  };
  try {
    canon_.straight(move, false);
  } catch (const BadInput&) {
    again();
    throw;
  }
  again();
}

void Machine::spindle_synchronised(const Block& block, AxisVector end) {
  const Cause cause = cause_of(block);
  const NcWord& k = block['K'];
  if (!k || k.value == 0) refuse(k ? Cause(k) : cause, "K (pitch) beside G33", k ? "0" : "none");
  if (block['I']) refuse(block['I'], "no I beside G33.1: the way back is as fast");
  const AxisVector start = canon_.position();
  feed_per_turn(k, {.end = std::move(end), .cause = cause});
  if (motion_ != 331) return;
  const int direction = canon_.spindle_direction();
  canon_.turn_spindle(-direction);
  AxisVector back = canon_.position();
  for (int k9 = 0; k9 < 9; ++k9)
    if (const int j = joint(k9); j >= 0) back[j] = start[j];
  feed_per_turn(k, {.end = std::move(back), .cause = cause});
  canon_.turn_spindle(direction);
}

void Machine::move(const Block& block) {
  const NcWord& axis = first_axis_word(block);
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool centre = block['I'] || block['J'] || block['K'] || block['R'];
  if (motion_ == 52 || motion_ == 53 || motion_ == 50 || motion_ == 51) {
    if (axis || block[Group::Motion]) spline(block);
    return;
  }
  if (motion_ == 760) {
    if (block[Group::Motion]) thread(block);
    return;
  }
  if (!axis && !(is_arc && centre)) return;
  if (motion_ == 730 || motion_ == 740 || (motion_ >= 810 && motion_ <= 890)) return cycle(block);
  const Cause cause = cause_of(block);
  const bool machine = block.tenths(Group::OneBlock) == 530;
  if (machine) canon_.go_to(Coordinates::Axis, cause);
  const Target target = target_of(block, machine);
  const bool beside = compensation_.on() || compensation_.leaving();
  AxisVector end =
      beside && !machine ? compensation_.end_of(target) : canon_.end_of(target, machine);
  if (compensation_.leaving() && is_arc) refuse(cause, "a line as the first move after G40");
  compensation_.left_behind();
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else if (motion_ == 330 || motion_ == 331)
    spindle_synchronised(block, std::move(end));
  else
    straight(block, std::move(end), target.stated(), machine);
  if (machine && canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

}  // namespace abbe::sim::dialects::linuxcnc
