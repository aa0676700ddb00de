#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc_machine.h"

namespace abbe::sim::dialects::linuxcnc {

using program::FeedMode;

namespace {
constexpr double peck_clearance = 0.254;  // mm, above the last peck
constexpr double most_pecks = 1e5;
}  // namespace

/// To a place in program coordinates.
void Machine::go(const AxisVector& end, bool rapid) {
  canon_.straight({.end = canon_.placed(end), .cause = {1, {}}}, rapid);
}

/// A cycle whose first block has an input error is not begun: the blocks behind it have none of
/// their own.
void Machine::cycle(const Block& block) {
  if (!cycle_.begun && !block[Group::Motion]) run_.require_certain("cycle", cause_of(block));
  run_.define("cycle", [&] { take_cycle(block); });
}

/// Takes the words of a cycle; what is not said stays as the block before had it.
void Machine::take_cycle(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.on()) refuse(cause, "G40 before a canned cycle");
  if (canon_.feed_mode() == FeedMode::InverseTime) refuse(cause, "G94 or G95 beside a cycle");
  const int deep = plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0;
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cause, "a machine with X Y Z beside a canned cycle");
  for (int k = 3; k < 9; ++k)
    if (const NcWord& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X Y Z beside a canned cycle");
  const char deep_letter = axis_letters[std::size_t(deep)];
  const NcWord &r = block['R'], &z = block[deep_letter], &q = block['Q'], &p = block['P'];
  if (!cycle_.begun && (!r || !z))
    refuse(cause, fmt::format("{} and R in the first block of a cycle", deep_letter), "none");
  if (r) cycle_.r = r.value * unit();
  if (z) cycle_.z = axis_word(deep, z);
  const bool pecks = motion_ == 730 || motion_ == 830;
  if (q && !pecks) refuse(q, "no Q in this cycle");
  if (q) cycle_.q = q.value * unit();
  if (pecks && !(cycle_.q > 0)) refuse(q ? Cause(q) : cause, "Q (depth of a peck) above zero");
  if (p) cycle_.p = p.value;
  if (!cycle_.begun && !p && (motion_ == 820 || motion_ == 860 || motion_ == 890))
    refuse(cause, fmt::format("P (seconds) in the first block of G{}", motion_ / 10), "none");
  if (!(cycle_.p >= 0 && cycle_.p <= 1e6)) refuse(p, "0 to 1e6 seconds after P");
  if (const NcWord& l = block['L'];
      l && (l.value < 1 || l.value > 1e6 || l.value != std::floor(l.value)))
    refuse(l, "whole repeats of 1 to 1e6 after L");
  const int turns = canon_.spindle_direction();
  if ((motion_ == 840 && turns != 1) || (motion_ == 740 && turns != -1))
    refuse(cause, motion_ == 840 ? "M3 before G84" : "M4 before G74");
  if (motion_ == 860 && turns == 0) refuse(cause, "a spindle that turns before G86");
  cycle_.begun = true;
  cycle_holes(block);
}

void Machine::cycle_holes(const Block& block) {
  const int deep = plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0;
  const int d = joint(deep);
  AxisVector at = canon_.programmed();
  if (!cycle_.initial) cycle_.initial = at[d];
  const double initial = *cycle_.initial;
  const double r = incremental_ ? cycle_.r + initial : cycle_.r;
  const double bottom = incremental_ ? r + cycle_.z : cycle_.z;
  if (r < bottom)
    refuse(block['R'] ? Cause(block['R']) : cause_of(block), "R above the bottom of the hole",
           fmt::format("R at {} mm, the bottom at {} mm", r, bottom));
  if (initial < r) {
    at[d] = r;
    go(at, true);
  }
  const double clear = to_r_ ? r : std::max(initial, r);
  double level = std::max(at[d], r);  // the first hole is reached where the axes stand, G98 or not
  const int repeats = block['L'] ? int(block['L'].value) : 1;
  const bool pecks = motion_ == 730 || motion_ == 830;
  constexpr double moves_of_hole = 4.0, moves_of_peck = 3.0;  // at most
  run_.check_moves(
      repeats * (moves_of_hole + (pecks ? moves_of_peck * (r - bottom) / cycle_.q : 0.0)),
      cause_of(block));
  for (int n = 0; n < repeats; ++n) {
    run_.count_block();
    for (int k = 0; k < 3; ++k) {
      const NcWord& word = block[axis_letters[std::size_t(k)]];
      if (k == deep || !word) continue;
      at[joint(k)] = incremental_ ? at[joint(k)] + axis_word(k, word) : axis_word(k, word);
    }
    if (block.is_polar()) {
      const Eigen::Vector2d end = polar_end(block, {at[joint(0)], at[joint(1)]});
      at[joint(0)] = end.x();
      at[joint(1)] = end.y();
    }
    at[d] = level;
    go(at, true);
    at[d] = r;
    go(at, true);
    hole({at, d, r, bottom, clear});
    level = clear;
  }
}

/// One hole from R down and out again.
void Machine::hole(const Hole& hole) {
  AxisVector at = hole.at;
  const auto to = [&](double level, bool rapid) {
    at[hole.deep] = level;
    go(at, rapid);
  };
  if (motion_ == 730 || motion_ == 830) {
    if ((hole.r - hole.bottom) / cycle_.q > most_pecks)
      refuse({1, {}}, "at most 1e5 pecks in a hole", "more");
    for (double depth = hole.r - cycle_.q; depth > hole.bottom; depth -= cycle_.q) {
      to(depth, false);
      if (motion_ == 830) to(hole.r, true);
      to(depth + peck_clearance, true);
    }
  }
  to(hole.bottom, false);
  const int turns = canon_.spindle_direction();
  const auto wait = [&] { canon_.dwell(cycle_.p, {1, {}}); };
  switch (motion_) {
    case 740:
    case 840:
      canon_.turn_spindle(-turns);
      wait();
      to(hole.clear, false);
      canon_.turn_spindle(turns);
      return;
    case 860:
      wait();
      canon_.turn_spindle(0);
      to(hole.clear, true);
      canon_.turn_spindle(turns);
      return;
    case 820:
      wait();
      return to(hole.clear, true);
    case 850:
      to(hole.r, false);
      return to(hole.clear, true);
    case 890:
      wait();
      return to(hole.clear, false);
    default:
      return to(hole.clear, true);
  }
}

namespace {

/// Words of G76 in mm.
struct Thread {
  double pitch = 0.0, z_end = 0.0, peak = 0.0, first = 0.0, height = 0.0;
  double degression = 1.0, angle = 0.0, taper = 0.0;
  int springs = 0;
  bool tapers_in = false, tapers_out = false;
};

}  // namespace

/// The passes of a thread, in program coordinates of X and Z.
class ThreadPasses {
 public:
  ThreadPasses(Machine& machine, const Thread& thread)
      : machine_(machine),
        thread_(thread),
        at_(machine.canon_.programmed()),
        x_(machine.joint(0)),
        z_(machine.joint(2)),
        x0_(at_[x_]),
        z0_(at_[z_]) {}

  void cut() {
    const double full = std::abs(thread_.peak);
    const double end = std::abs(thread_.height) + full;
    double depth = full + thread_.first;
    for (int n = 1; depth < end;) {
      machine_.run_.count_block();
      pass(depth, end);
      depth = full + thread_.first * std::pow(++n, 1.0 / thread_.degression);
    }
    for (int n = 0; n <= thread_.springs; ++n) pass(end, end);
    to(x0_, thread_.z_end, true);
  }

 private:
  void to(double x, double z, bool rapid) {
    at_[x_] = x;
    at_[z_] = z;
    machine_.go(at_, rapid);
  }
  void feed(double per_turn, double x, double z) {
    machine_.canon_.set_feed(program::Feed{per_turn, 1.0});
    to(x, z, false);
  }
  void pass(double depth, double end) {
    const double side = thread_.peak > 0 ? 1.0 : -1.0;
    const double tangent = std::tan(thread_.angle * units::deg);
    const double back = (depth - std::abs(thread_.peak)) * tangent;
    const double z_start = z0_ - back, z_end = thread_.z_end + thread_.height * tangent - back;
    const double x_safe = x0_ - side * (end - depth), x_cut = x0_ + side * depth;
    const double x_out = x_cut - side * thread_.height;
    const double taper = thread_.z_end > z0_ ? -thread_.taper : thread_.taper;
    const double slanted =
        thread_.taper > 0
            ? thread_.pitch * std::hypot(thread_.taper, thread_.height) / thread_.taper
            : thread_.pitch;
    to(x_safe, z_start, true);
    if (thread_.tapers_in) {
      feed(slanted, x_out, z_start);
      feed(slanted, x_cut, z_start - taper);
    } else {
      to(x_cut, z_start, true);
    }
    feed(thread_.pitch, x_cut, thread_.tapers_out ? z_end + taper : z_end);
    if (thread_.tapers_out) feed(slanted, x_out, z_end);
    to(x_safe, z_end, true);
  }

  Machine& machine_;
  const Thread& thread_;
  Machine::AxisVector at_;
  int x_, z_;
  double x0_, z0_;
};

void Machine::thread(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.on()) refuse(cause, "G40 before G76");
  if (plane_ != 180) refuse(cause, "G18 before G76");
  if (joint(0) < 0 || joint(2) < 0) refuse(cause, "a machine with X and Z beside G76");
  for (const char letter : {'P', 'Z', 'I', 'J', 'K'})
    if (!block[letter]) refuse(cause, fmt::format("{} beside G76", letter), "none");
  const auto positive = [&](char letter) {
    if (!(block[letter].value > 0)) refuse(block[letter], fmt::format("{} above zero", letter));
    return block[letter].value * unit();
  };
  const double across = diameter_ ? 0.5 : 1.0;  // I J K are diameters under G7
  Thread thread;
  thread.pitch = positive('P');
  thread.first = across * positive('J');
  thread.height = across * positive('K');
  thread.peak = across * block['I'].value * unit();
  thread.z_end = axis_word(2, block['Z']) + (incremental_ ? programmed(2) : 0.0);
  if (const NcWord& r = block['R']) thread.degression = r.value;
  if (thread.degression < 1 || thread.degression > 100) refuse(block['R'], "R of 1 to 100");
  if (const NcWord& q = block['Q']) thread.angle = q.value;
  if (thread.angle < 0 || thread.angle > 80) refuse(block['Q'], "Q of 0 to 80 degrees");
  if (const NcWord& h = block['H']) thread.springs = whole_word(h, 1000);
  const int tapers = block['L'] ? whole_word(block['L'], 3) : 0;
  thread.tapers_in = tapers % 2 == 1;
  thread.tapers_out = tapers >= 2;
  if (tapers > 0) {
    if (!block['E']) refuse(cause, "E (length of the taper) beside L", "none");
    thread.taper = positive('E');
  }
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  ThreadPasses(*this, thread).cut();
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

int Machine::whole_word(const NcWord& word, int most) const {
  if (word.value < 0 || word.value > most || word.value != std::floor(word.value))
    refuse(word, fmt::format("a whole number of 0 to {}", most));
  return int(word.value);
}

}  // namespace abbe::sim::dialects::linuxcnc
