#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/fanuc_machine.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using program::FeedMode;

namespace {

constexpr double peck_clearance = 0.5;  // mm: parameters 5114 and 5115, see the warning
constexpr double most_pecks = 1e5;

bool is_tap(int code) { return code == 740 || code == 840; }
bool is_peck(int code) { return code == 730 || code == 830; }
bool shifts(int code) { return code == 760 || code == 870; }
bool dwells(int code) { return is_tap(code) || shifts(code) || code == 820 || code == 890; }

}  // namespace

void Machine::to_level(double level, bool rapid) {
  cycle_.at[joint(2)] = level;
  const AxisVector to = canon_.placed(cycle_.at);
  AxisVector end = canon_.position();  // a spindle among the joints goes on
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0) end[j] = to[j];
  canon_.straight({.end = std::move(end), .cause = cycle_.cause}, rapid);
}

/// What is not said stays as the block before had it; levels stay where they are.
void Machine::take_cycle_words(const Block& block) {
  const int z = joint(2);
  const Word &r = block['R'], &deep = block['Z'], &q = block['Q'], &p = block['P'];
  if (!cycle_.begun) {
    if (!r || !deep) refuse(cycle_.cause, "Z and R in the first block of a cycle", "none");
    cycle_.initial = canon_.programmed()[z];
  }
  if (r) cycle_.r = length(r) + (incremental_ ? cycle_.initial : 0.0);
  if (deep) cycle_.bottom = length(deep) + (incremental_ ? cycle_.r : 0.0);
  if (q && !is_peck(cycle_code_) && !shifts(cycle_code_))
    refuse(q, is_tap(cycle_code_) ? "no Q: tapping with pecks is not read" : "no Q in this cycle");
  if (q) cycle_.q = std::abs(length(q));
  if ((is_peck(cycle_code_) || shifts(cycle_code_)) && !(cycle_.q > 0))
    refuse(q ? Cause(q) : cycle_.cause, "Q above zero");
  if (p && !dwells(cycle_code_)) refuse(p, "no P in this cycle");
  if (p) cycle_.dwell_s = whole(canon_, p, 99'999'999) * 1e-3;
  warn_low_start();
  const bool from_behind = cycle_code_ == 870;
  if (from_behind && to_r_) refuse(cycle_.cause, "G98 beside G87");
  if (from_behind ? cycle_.bottom < cycle_.r : cycle_.r < cycle_.bottom)
    refuse(r ? Cause(r) : cycle_.cause,
           from_behind ? "the end of the bore above R" : "R above the bottom of the hole",
           fmt::format("R at {} mm, the bottom at {} mm", cycle_.r, cycle_.bottom));
  const int turns = canon_.spindle_direction();
  const int wanted = cycle_code_ == 740 ? -1 : 1;
  if (is_tap(cycle_code_) && !rigid_ && turns != wanted)
    refuse(cycle_.cause,
           fmt::format("M{} or M29 before G{}", wanted > 0 ? 3 : 4, cycle_code_ / 10));
  if ((cycle_code_ == 860 || shifts(cycle_code_)) && turns == 0)
    refuse(cycle_.cause, "a spindle that turns before the cycle");
  cycle_.begun = true;
}

/// The last operation of a cycle under G98 leads to where Z stood at its start, also where R lies
/// above it (Haas VF operator's manual 96-8000, page 182: the six operations of a canned cycle).
/// LinuxCNC stays at R then.
void Machine::warn_low_start() {
  if (to_r_ || cycle_code_ == 870 || !(cycle_.initial < cycle_.r)) return;
  run_.warn_once(
      "a cycle begins below its R: under G98 the tool goes back down to where it began at rapid, and "
      "to the next hole at that level");
}

void Machine::cycle(const Block& block) {
  cycle_.cause = cause_of(block);
  if (compensation_.on()) refuse(cycle_.cause, "G40 before a canned cycle");
  if (canon_.feed_mode() == FeedMode::InverseTime)
    refuse(cycle_.cause, "G94 or G95 beside a cycle");
  if (plane_ != 170)
    refuse(cycle_.cause, "G17 beside a cycle: the axis that drills is a parameter elsewhere");
  if (tip_words()) refuse(cycle_.cause, "G43 beside a cycle, in a tilted plane where it is needed");
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cycle_.cause, "a machine with X Y Z beside a canned cycle");
  if (!cycle_.begun && !block[Group::Cycle]) run_.require_certain("cycle", cycle_.cause);
  run_.define("cycle", [&] { take_cycle_words(block); });
  moved_ = true;
  compensation_.left_behind();
  cycle_holes(block);
}

/// K and L: how often, with 0 the words are only taken.
void Machine::cycle_holes(const Block& block) {
  const Word& repeats = block['K'] ? block['K'] : block['L'];
  if (block['K'] && block['L']) refuse(block['L'], "either K or L");
  const int n = repeats ? whole(canon_, repeats, 1'000'000) : 1;
  constexpr double moves_of_hole = 4.0, moves_of_peck = 3.0;  // at most
  const double pecks = is_peck(cycle_code_) ? std::abs(cycle_.r - cycle_.bottom) / cycle_.q : 0.0;
  run_.check_moves(n * (moves_of_hole + moves_of_peck * pecks), cycle_.cause);
  for (int i = 0; i < n; ++i) {
    run_.count_block();
    Target target = target_of(block, false);
    const int z = joint(2);
    target.by(z, 0.0, cycle_.cause);
    check_tilted(target, cycle_.cause);
    AxisVector end = canon_.end_of(target);
    canon_.straight({.end = end, .cause = cycle_.cause, .stated = target.stated()}, true);
    hole(canon_.unplaced(end));
  }
}

void Machine::turn_for_tap(int direction) {
  canon_.turn_spindle(cycle_code_ == 740 ? -direction : direction);
}

/// Across the hole by Q along +X, which parameter 5148 may say otherwise.
void Machine::shift_tool(double by) {
  run_.warn_once(
      "G76 and G87 shift the tool along +X (5101.4 RD1, 5101.5 RD2 and 5148 may say otherwise)");
  cycle_.at[joint(0)] += by;
  to_level(cycle_.at[joint(2)], true);
}

void Machine::pecks() {
  run_.warn_once(fmt::format(
      "the clearance of pecks in G73 and G83 is taken to be {} mm (parameters 5114 and 5115)",
      peck_clearance));
  if ((cycle_.r - cycle_.bottom) / cycle_.q > most_pecks)
    refuse(cycle_.cause, "at most 1e5 pecks in a hole", "more");
  for (int n = 1;; ++n) {
    const double depth = cycle_.r - n * cycle_.q;
    if (!(depth > cycle_.bottom)) return;
    to_level(depth, false);
    if (cycle_code_ == 830) to_level(cycle_.r, true);
    to_level(std::min(cycle_.r, depth + peck_clearance), true);
  }
}

/// G87: shifted down to R, up to Z at feed, shifted out.
void Machine::bore_from_behind() {
  const int turns = canon_.spindle_direction();
  canon_.turn_spindle(0);
  shift_tool(cycle_.q);
  to_level(cycle_.r, true);
  shift_tool(-cycle_.q);
  canon_.turn_spindle(turns);
  to_level(cycle_.bottom, false);
  canon_.dwell(cycle_.dwell_s, cycle_.cause);
  canon_.turn_spindle(0);
  shift_tool(cycle_.q);
  to_level(cycle_.initial, true);
  shift_tool(-cycle_.q);
  canon_.turn_spindle(turns);
}

/// What the cycle does at the bottom, and out to R.
void Machine::bottom_of_hole() {
  const int turns = canon_.spindle_direction();
  if (dwells(cycle_code_)) canon_.dwell(cycle_.dwell_s, cycle_.cause);
  switch (cycle_code_) {
    case 740:
    case 840:
      turn_for_tap(-1);
      to_level(cycle_.r, false);
      return turn_for_tap(rigid_ ? 0 : 1);
    case 760:
      canon_.turn_spindle(0);
      shift_tool(cycle_.q);
      to_level(to_r_ ? cycle_.r : cycle_.initial, true);
      shift_tool(-cycle_.q);
      return canon_.turn_spindle(turns);
    case 850:
    case 890:
      return to_level(cycle_.r, false);
    case 860:
      canon_.turn_spindle(0);
      to_level(cycle_.r, true);
      return canon_.turn_spindle(turns);
    default:
      return to_level(cycle_.r, true);
  }
}

/// One hole, from above its place.
void Machine::hole(const AxisVector& place) {
  cycle_.at = place;
  if (cycle_code_ == 870) return bore_from_behind();
  to_level(cycle_.r, true);
  if (is_tap(cycle_code_)) turn_for_tap(1);
  if (is_peck(cycle_code_)) pecks();
  to_level(cycle_.bottom, false);
  bottom_of_hole();
  if (!to_r_ && cycle_.initial != cycle_.r && cycle_code_ != 760) to_level(cycle_.initial, true);
}

}  // namespace abbe::sim::dialects::fanuc
