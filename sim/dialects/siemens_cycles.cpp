#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_hole.h"
#include "sim/dialects/siemens_machine.h"

namespace abbe::sim::dialects::siemens {

using kinematics::AxisVector;
using program::Feed;
using program::FeedMode;

namespace {

constexpr std::string_view drilling_cycles[] = {"CYCLE81", "CYCLE82", "CYCLE83", "CYCLE84",
                                                "CYCLE85", "CYCLE86", "CYCLE89"};

/// The parameters of a cycle by their places.
class CycleWords {
 public:
  CycleWords(const ProgramCall& call, const program::Canon& canon, double unit)
      : call_(call), canon_(canon), unit_(unit) {}

  bool has(std::size_t i) const {
    return i < call_.arguments.size() && !call_.arguments[i].empty();
  }
  Cause cause(std::size_t i) const {
    return i < call_.arguments.size() ? call_.arguments[i].cause : call_.cause;
  }
  double number(std::size_t i, double otherwise = 0.0) const {
    if (!has(i)) return otherwise;
    if (!call_.arguments[i].number) canon_.refuse(cause(i), "a number");
    return *call_.arguments[i].number;
  }
  double length(std::size_t i) const { return number(i) * unit_; }
  double positive(std::size_t i, std::string_view name) const {
    if (!(number(i) > 0))
      canon_.refuse(cause(i), fmt::format("{} above zero in {}", name, call_.name));
    return number(i);
  }
  /// Parameters that are read nowhere are zero or not there.
  void only_zero(std::size_t first, std::size_t last) const {
    for (std::size_t i = first; i <= last; ++i)
      if (number(i) != 0)
        canon_.refuse(cause(i),
                      fmt::format("nothing or 0 as parameter {} of {}", i + 1, call_.name));
  }
  /// Parameters beyond those that are read: how the mask shows them.
  void at_most(std::size_t count) const {
    if (call_.arguments.size() > count)
      canon_.refuse(cause(count), fmt::format("at most {} parameters of {}", count, call_.name));
  }

 private:
  const ProgramCall& call_;
  const program::Canon& canon_;
  double unit_;
};

}  // namespace

/// A hole in program coordinates, from where the axes stand.
class Hole {
 public:
  Hole(Machine& machine, const ProgramCall& call)
      : machine_(machine),
        canon_(machine.canon_),
        call_(call),
        words_(call, canon_, machine.unit()),
        at_(canon_.programmed()),
        deep_(machine.plane(call.cause).across) {
    if (deep_ < 0) canon_.refuse(call.cause, "a machine with an axis across the plane");
    levels_ = levels();
  }

  void make();

 private:
  HoleLevels levels() const;
  void check_parameters() const;
  void to(double level, bool rapid) {
    at_[deep_] = level;
    go(rapid);
  }
  void go(bool rapid) {
    machine_.put_straight({.end = canon_.placed(at_), .cause = call_.cause}, rapid);
  }
  /// Above zero seconds, below zero turns of the spindle.
  void wait(double time) {
    if (time < 0 && !(canon_.spindle_speed() > 0))
      canon_.refuse(call_.cause, "a spindle that turns for a dwell in turns");
    canon_.dwell(time < 0 ? -time * 60.0 / canon_.spindle_speed() : time, call_.cause);
  }
  void pecks();
  void tap();
  void bore_and_lift();
  void feed_at(double word) {
    if (word > 0) canon_.set_feed(Feed{word, machine_.inch_feed_ ? Machine::inch_mm : 1.0});
  }

  Machine& machine_;
  program::Canon& canon_;
  const ProgramCall& call_;
  CycleWords words_;
  AxisVector at_;
  int deep_;
  HoleLevels levels_;
};

HoleLevels Hole::levels() const {
  for (const std::size_t i : {0, 1})
    if (!words_.has(std::size_t(i)))
      canon_.refuse(call_.cause, "the planes RTP and RFP in " + call_.name, "none");
  if (!words_.has(3) && !words_.has(4))
    canon_.refuse(call_.cause, "the depth DP or DPR in " + call_.name, "none");
  HoleLevels levels;
  levels.retract = words_.length(0);
  const double reference = words_.length(1);
  const double side = levels.retract >= reference ? 1.0 : -1.0;
  levels.reference = reference;
  levels.start = reference + side * std::abs(words_.length(2));
  const bool relative = words_.has(4) && words_.number(4) != 0;
  levels.bottom =
      relative || !words_.has(3) ? reference - side * std::abs(words_.length(4)) : words_.length(3);
  if (side * (reference - levels.bottom) <= 0)
    canon_.refuse(words_.has(3) ? words_.cause(3) : words_.cause(4),
                  "a depth beyond the reference plane, seen from the retraction plane",
                  fmt::format("reference {} mm, depth {} mm", reference, levels.bottom));
  return levels;
}

void Hole::pecks() {
  PeckWords words;
  if (words_.has(5) && !(words_.has(6) && words_.number(6) != 0))
    words.first = std::abs(levels_.reference - words_.length(5));
  else
    words.first = std::abs(words_.length(6));
  if (!(words.first > 0)) canon_.refuse(words_.cause(6), "the first depth FDEP or FDPR in CYCLE83");
  words.degression = words_.number(7) >= 0 ? words_.length(7) : words_.number(7);
  words.least = words_.length(13);
  const double total = std::abs(levels_.reference - levels_.bottom);
  if (words.first > total)
    canon_.refuse(words_.cause(words_.has(5) ? 5 : 6), "a first depth that is not beyond the whole",
                  fmt::format("{} mm of {} mm", words.first, total));
  const auto depths = peck_depths(total, words);
  if (depths.empty()) canon_.refuse(call_.cause, "at most 1e5 pecks in a hole", "more");
  constexpr double moves_of_peck = 5.0;  // at most, dwells too
  machine_.run_.check_moves(moves_of_peck * double(depths.size()), call_.cause);
  const double side = levels_.start >= levels_.bottom ? 1.0 : -1.0;
  const double factor = words_.has(10) && words_.number(10) > 0 ? words_.number(10) : 1.0;
  const bool clears = words_.number(11) == 1;
  if (words_.number(11) != 0 && !clears)
    canon_.refuse(words_.cause(11), "VARI 0 or 1: chips broken or cleared");
  const double lift = words_.number(14) > 0 ? words_.length(14) : 1.0;
  const double before = words_.number(16) > 0 ? words_.length(16) : ahead_of_peck(total);
  const auto feed = canon_.feed();
  const double last_wait =
      words_.has(15) && words_.number(15) != 0 ? words_.number(15) : words_.number(8);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    machine_.run_.count_block();
    if (i == 0 && feed) canon_.set_feed(Feed{feed->word * factor, feed->unit});
    to(levels_.reference - side * depths[i], false);
    if (i == 0) canon_.set_feed(feed);
    const bool last = i + 1 == depths.size();
    wait(last ? last_wait : words_.number(8));
    if (last) break;
    if (clears) {
      to(levels_.start, true);
      wait(words_.number(9));
      const double above = levels_.reference - side * (depths[i] - before);
      to(side * std::min(side * above, side * levels_.start), true);
    } else {
      to(levels_.reference - side * (depths[i] - lift), false);
    }
  }
  to(levels_.retract, true);
}

/// Rigid tapping: at the pitch down, the spindle reversed, and out.
void Hole::tap() {
  const double metric = words_.number(7);
  double pitch = metric != 0 ? coarse_pitch(std::abs(metric)) : words_.length(8);
  if (metric != 0 && pitch == 0) canon_.refuse(words_.cause(7), "MPIT of 3 to 48, a coarse thread");
  const bool left = metric < 0 || pitch < 0;
  pitch = std::abs(pitch);
  if (!(pitch > 0 && pitch <= 1000))
    canon_.refuse(words_.cause(8), "the pitch PIT or MPIT in CYCLE84");
  const double speed = words_.positive(10, "SST (speed)");
  const double speed_out = words_.number(11) > 0 ? words_.number(11) : speed;
  if (words_.number(13) > 1) canon_.refuse(words_.cause(13), "a pitch in mm (_PITA 0 or 1)");
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  const double rpm = canon_.spindle_speed();
  const int after = int(words_.number(6));
  canon_.set_feed_mode(FeedMode::PerRevolution);
  canon_.set_feed(Feed{pitch, 1.0});
  canon_.set_spindle_speed(speed);
  canon_.turn_spindle(left ? -1 : 1);
  to(levels_.bottom, false);
  if (words_.number(5) > 0) wait(words_.number(5));
  canon_.set_spindle_speed(speed_out);
  canon_.turn_spindle(left ? 1 : -1);
  to(levels_.start, false);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
  canon_.set_spindle_speed(rpm);
  canon_.turn_spindle(after == 3 ? 1 : after == 4 ? -1 : 0);
  to(levels_.retract, true);
}

void Hole::bore_and_lift() {
  const int direction = int(words_.number(6));
  if (direction != 3 && direction != 4) canon_.refuse(words_.cause(6), "SDIR 3 or 4 in CYCLE86");
  canon_.turn_spindle(direction == 3 ? 1 : -1);
  to(levels_.bottom, false);
  wait(words_.number(5));
  canon_.turn_spindle(0);
  const AxisVector in_hole = at_;
  const auto in = machine_.plane(call_.cause);
  at_[in.first] += words_.length(7);
  at_[in.second] += words_.length(8);
  at_[deep_] += words_.length(9);
  go(true);
  to(levels_.start, true);
  to(levels_.retract, true);
  at_ = in_hole;
  to(levels_.retract, true);
}

/// Parameters that would change what is cut, and that are not read.
void Hole::check_parameters() const {
  const std::string& name = call_.name;
  const bool has_axis = name == "CYCLE83" || name == "CYCLE84";
  if (const double axis = has_axis ? words_.number(12) : 0.0; axis != 0) {
    const int said = axis == 1   ? machine_.joint(0)
                     : axis == 2 ? machine_.joint(1)
                                 : machine_.joint(2);
    if (said != deep_) canon_.refuse(words_.cause(12), "_AXN of the axis across the plane");
  }
  struct Rest {
    std::string_view name;
    std::size_t zero_first, zero_last, most;
  };
  static constexpr Rest rests[] = {{"CYCLE81", 6, 6, 9},    {"CYCLE82", 6, 6, 9},
                                   {"CYCLE83", 17, 17, 20}, {"CYCLE84", 15, 15, 26},
                                   {"CYCLE85", 8, 8, 11},   {"CYCLE86", 11, 11, 14},
                                   {"CYCLE89", 6, 6, 9}};
  for (const Rest& rest : rests) {
    if (rest.name != name) continue;
    words_.at_most(rest.most);
    words_.only_zero(rest.zero_first, rest.zero_last);
  }
}

void Hole::make() {
  const std::string& name = call_.name;
  if (canon_.feed_mode() == FeedMode::InverseTime)
    canon_.refuse(call_.cause, "G94 or G95 beside a cycle");
  check_parameters();
  to(levels_.start, true);
  if (name == "CYCLE83") return pecks();
  if (name == "CYCLE84") return tap();
  if (name == "CYCLE86") return bore_and_lift();
  const auto feed = canon_.feed();
  if (name == "CYCLE85") feed_at(words_.positive(6, "FFR (feed)"));
  to(levels_.bottom, false);
  if (name != "CYCLE81" || words_.has(5)) wait(words_.number(5));
  if (name == "CYCLE85") feed_at(words_.positive(7, "RFF (feed out)"));
  if (name == "CYCLE85" || name == "CYCLE89") to(levels_.start, false);
  canon_.set_feed(feed);
  to(levels_.retract, true);
}

bool Machine::is_cycle(std::string_view name) {
  return name == "CYCLE800" || std::find(std::begin(drilling_cycles), std::end(drilling_cycles),
                                         name) != std::end(drilling_cycles);
}

bool Machine::cycle(const ProgramCall& call) {
  if (!is_cycle(call.name)) return false;
  if (compensation_.on()) refuse(call.cause, "G40 before " + call.name);
  compensation_.left_behind();
  if (call.name == "CYCLE800") {
    swivel(call);
    return true;
  }
  Block nothing;
  check_motion(nothing);
  Hole(*this, call).make();
  return true;
}

}  // namespace abbe::sim::dialects::siemens
