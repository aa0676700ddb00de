#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/control_table.h"
#include "sim/dialects/heidenhain_machine.h"

/// Cycles that drill, bore and tap.
namespace abbe::sim::dialects::heidenhain {

using kinematics::AxisVector;
using program::Feed;
using program::FeedMode;

namespace {

constexpr double rapid_feed = 99999.0;  // a feed of a cycle from here on is FMAX
constexpr int most_pecks = 100000;

struct CycleFact {
  int number;
  std::array<int, 16> parameters;  ///< the first `needed` must be given
  int needed;
};

// Q200 set-up clearance, Q201 depth, Q203 surface, Q204 second clearance, Q206 feed
constexpr CycleFact cycles[] = {
    {200, {200, 201, 206, 202, 203, 204, 210, 211, 395}, 6},
    {201, {200, 201, 206, 203, 204, 211, 208}, 5},
    {202, {200, 201, 206, 203, 204, 211, 208, 214, 336}, 5},
    {203, {200, 201, 206, 202, 203, 204, 210, 212, 213, 205, 211, 208, 256, 395}, 6},
    {205, {200, 201, 206, 202, 203, 204, 212, 205, 258, 259, 257, 256, 211, 379, 253, 208}, 6},
    {206, {200, 201, 206, 203, 204, 211}, 5},
    {207, {200, 201, 239, 203, 204}, 5},
    {240, {200, 201, 206, 203, 204, 343, 344, 211, 342, 253}, 5},
    {247, {339}, 1},
};

const CycleFact* fact_of_cycle(int number) {
  for (const CycleFact& one : cycles)
    if (one.number == number) return &one;
  return nullptr;
}

bool is_feed_parameter(int number) { return (number >= 206 && number <= 208) || number == 253; }

}  // namespace

void Machine::new_cycle(int number, std::size_t from, Words& words) {
  const CycleFact* fact = fact_of_cycle(number);
  if (fact == nullptr) words.refuse(from, "a point and a part number, as CYCL DEF 7.1");
  Cycle cycle{.number = number, .line = canon_.line(), .values = {}};
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name != "Q" || !is_digit(words.cursor.here())) {
      if (cycle.values.empty() && !name.empty()) continue;  // the name of the cycle
      words.refuse(at, "Q and a number");
    }
    const int q = words.whole(1999);
    const bool known =
        std::find(fact->parameters.begin(), fact->parameters.end(), q) != fact->parameters.end() ||
        (number == 205 && q == 395);
    if (!known) words.refuse(at, fmt::format("a parameter of cycle {}", number));
    if (!words.cursor.take("=")) words.refuse(words.cursor.at, "= after a parameter");
    const double value = cycle_word(q, cycle.per_turn, words);
    cycle.values[q] = value;
    if (on_parameter) on_parameter(q, value);
  }
  for (int i = 0; i < fact->needed; ++i)
    if (!cycle.values.contains(fact->parameters[std::size_t(i)]))
      words.cursor.refuse(
          from, fmt::format("Q{} of cycle {}", fact->parameters[std::size_t(i)], number), "none");
  if (number == 247) {
    const double preset = cycle.values[339];
    const bool is_whole = preset == std::floor(preset) && preset >= 0.0 && preset <= most_preset;
    return choose_preset(is_whole ? int(preset) : -1, words.cause(from));
  }
  cycle_ = std::move(cycle);
  check_cycle(words.cause(from));
}

/// The value of a parameter of a cycle; a feed may be written as in a block, with F or without.
double Machine::cycle_word(int q, std::set<int>& per_turn, Words& words) const {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  Words ahead = words;
  const std::string name = ahead.name();
  if (!is_feed_parameter(q) || name.empty() || name.front() == 'Q') return words.value();
  words.cursor.at = ahead.cursor.at;
  const FeedValue feed = feed_value(name.substr(name.front() == 'F' ? 1 : 0), words, from);
  if (feed.word == FeedWord::PerTurn) per_turn.insert(q);
  return feed.word == FeedWord::Rapid ? 99999.9 : feed.value;
}

/// What a cycle is asked that is not done, before it runs.
void Machine::check_cycle(const Cause& cause) {
  const auto only = [&](int q, double value, const char* sentence) {
    if (cycle_value(q, value) == value) return;
    cycle_.number = 0;
    refuse(cause, sentence, fmt::format("Q{} = {:.6g}", q, cycle_.values[q]));
  };
  only(395, 0, "Q395=0: depths are those of the tip, the angle of a drill is not known");
  only(343, 0, "Q343=0: the depth by Q201, the angle of a drill is not known");
  only(379, 0, "Q379=0: no deepened start");
  if (cycle_value(258, 0) != cycle_value(259, cycle_value(258, 0)))
    only(259, cycle_value(258, 0), "Q259 as Q258: between them the distance is not known");
  const double depth = cycle_value(201);
  if (depth > 0) only(201, 0, "Q201 below zero");
  const bool pecks = cycle_.number == 200 || cycle_.number == 203 || cycle_.number == 205;
  if (pecks && !(cycle_value(202) > 0)) only(202, 1, "Q202 above zero");
  if (cycle_.number == 207 && cycle_value(239) == 0) only(239, 1, "Q239 that is not zero");
  for (const int q : {206})
    if (cycle_.values.contains(q) && !(cycle_.values[q] > 0)) only(q, 1, "Q206 above zero");
  for (const int q : {200, 204, 210, 211, 212, 213, 205, 256, 257, 258, 208})
    if (cycle_value(q, 0) < 0) only(q, 0, "a value that is not below zero");
}

double Machine::cycle_value(int number) const { return cycle_.values.at(number); }

double Machine::cycle_value(int number, double otherwise) const {
  const auto found = cycle_.values.find(number);
  return found == cycle_.values.end() ? otherwise : found->second;
}

/// CYCL CALL M3, CYCL CALL POS X+10 Y+20 Z+0 FMAX
void Machine::cycle_call(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const bool at_place = words.take("POS");
  if (words.take("PAT"))
    words.refuse(from, "CYCL CALL, CYCL CALL POS or M99: patterns are not read");
  Move move = read_move("", words.cursor.at, words);
  move.cause = {int(from) + 1, at_place ? "CYCL CALL POS" : "CYCL CALL"};
  functions_before(move);
  set_feed(move);
  double surface = 0.0;
  if (at_place) {
    const Target target = target_of(move);
    const int z = joint_of('Z', move.cause);
    for (const char letter : {'X', 'Y', 'Z'})
      if (!target.has(joint_of(letter, move.cause)))
        refuse(move.cause, "X, Y and Z after CYCL CALL POS");
    surface = canon_.unplaced(canon_.end_of(target))[z];
    require_cycle(move.cause);
    const double r = surface + (cycle_value(203) + cycle_value(200)) * unit();
    Target plane;
    for (const char letter : {'X', 'Y'}) {
      const int j = joint_of(letter, move.cause);
      plane.to(j, canon_.unplaced(canon_.end_of(target))[j], move.cause);
    }
    if (canon_.programmed()[z] < r) to_depth(r, true);
    program::Straight straight{canon_.end_of(plane), move.cause, false, plane.stated()};
    if (move.feed_word == FeedWord::Rapid)
      canon_.traverse(std::move(straight));
    else
      canon_.straight_feed(std::move(straight));
  } else {
    for (const auto& axis : move.axes)
      if (axis) refuse(axis->cause, "CYCL CALL POS before axes");
  }
  run_cycle(surface, move.cause);
  functions_behind(move);
}

void Machine::require_cycle(const Cause& cause) const {
  run_.require_certain(the_cycle, cause);
  if (cycle_.number == 0) refuse(cause, "CYCL DEF of a hole before it", "none");
}

/// @param surface  mm, what the place of the call adds to Q203
void Machine::run_cycle(double surface, const Cause& cause) {
  require_cycle(cause);
  require_certain_shift(cause);
  if (contour_.beside() || contour_.waits()) refuse(cause, "R0, and no corner, before a cycle");
  joint_of('Z', cause);
  const double depth = cycle_value(201) * unit();
  if (depth == 0.0) return;  // it is not run
  surface += cycle_value(203) * unit();
  const double r = surface + cycle_value(200) * unit();
  const auto feed = canon_.feed();
  const auto mode = canon_.feed_mode();
  canon_.set_feed_mode(FeedMode::PerMinute);
  to_depth(r, true);
  switch (cycle_.number) {
    case 200:
      drill(surface, surface + depth);
      break;
    case 203:
      peck_universal(surface, surface + depth);
      break;
    case 205:
      peck_deep(surface, surface + depth);
      break;
    case 202:
      bore(surface, surface + depth);
      break;
    case 206:
    case 207:
      tap(surface, surface + depth);
      break;
    default:
      ream(surface, surface + depth);
  }
  to_depth(surface + std::max(cycle_value(204), cycle_value(200)) * unit(), true);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
  tangent_.reset();
}

void Machine::to_depth(double z, bool rapid) {
  const int j = canon_.joint_of('Z');
  Target target;
  target.to(j, z, {1, {}});
  program::Straight straight{canon_.end_of(target), {1, {}}, false, target.stated()};
  if (rapid)
    canon_.traverse(std::move(straight));
  else
    canon_.straight_feed(std::move(straight));
}

/// At the feed of a parameter, that of the other one where it is zero or not given.
void Machine::feed_to(double z, int parameter, int otherwise) {
  if (cycle_value(parameter, 0.0) == 0.0) parameter = otherwise;
  const double feed = cycle_value(parameter, 0.0);
  if (feed >= rapid_feed) return to_depth(z, true);
  if (cycle_.per_turn.contains(parameter)) {
    canon_.set_feed_mode(FeedMode::PerRevolution);
    canon_.set_feed(Feed{feed, unit()});
  } else {
    canon_.set_feed(Feed{feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  to_depth(z, false);
  canon_.set_feed_mode(FeedMode::PerMinute);
}

void Machine::wait(int parameter) { canon_.dwell(cycle_value(parameter, 0.0), {1, {}}); }

/// 200: each infeed ends above the surface, and begins by the clearance above the last one.
void Machine::drill(double surface, double bottom) {
  const double clear = cycle_value(200) * unit(), step = cycle_value(202) * unit();
  check_infeeds(surface - bottom, step);
  for (double level = surface - step; level > bottom + 1e-9; level -= step) {
    run_.count_block();
    feed_to(level, 206, 206);
    to_depth(surface + clear, true);
    wait(210);
    to_depth(level + clear, true);
  }
  feed_to(bottom, 206, 206);
  wait(211);
}

void Machine::check_pecks(double pecks) const {
  if (!(pecks <= most_pecks)) refuse({1, {}}, "at most 1e5 infeeds in a hole", "more");
}

/// Infeeds of a depth that become no longer: known before the first is made.
void Machine::check_infeeds(double depth, double step) const {
  constexpr double moves_of_infeed = 2.0;  // at least: in and out
  check_pecks(depth / step);
  run_.check_moves(moves_of_infeed * depth / step, {1, {}});
}

/// 201, 240
void Machine::ream(double surface, double bottom) {
  feed_to(bottom, 206, 206);
  wait(211);
  if (cycle_.number == 201) feed_to(surface + cycle_value(200) * unit(), 208, 206);
}

/// 203: infeeds become smaller; of every Q213 + 1 the last one leaves the hole.
void Machine::peck_universal(double surface, double bottom) {
  const double clear = cycle_value(200) * unit(), back = cycle_value(256, 0.2) * unit();
  const double less = cycle_value(212, 0) * unit(), least = cycle_value(205, 0) * unit();
  double step = cycle_value(202) * unit();
  check_infeeds(surface - bottom, step);
  int breaks = 0;
  const int between = int(std::lround(std::min(cycle_value(213, 0), 1e6)));
  double level = surface;
  for (int pecks = 0;; ++pecks) {
    run_.count_block();
    check_pecks(pecks);
    level = std::max(bottom, level - step);
    feed_to(level, 206, 206);
    if (level <= bottom + 1e-9) break;
    if (between > 0 && breaks < between) {
      ++breaks;
      feed_to(std::min(level + back, surface + clear), 208, 206);
    } else {
      breaks = 0;
      feed_to(surface + clear, 208, 206);
      wait(210);
      to_depth(level + clear, true);
    }
    if (less > 0) step = std::min(step, std::max(step - less, least));
    if (!(step > 0)) refuse({1, {}}, "Q205 above zero beside Q212", "infeeds that come to nothing");
  }
  wait(211);
  feed_to(surface + clear, 208, 206);
}

/// 205: chips are broken every Q257, the hole is left after every infeed.
void Machine::peck_deep(double surface, double bottom) {
  const double clear = cycle_value(200) * unit(), back = cycle_value(256, 0.2) * unit();
  const double less = cycle_value(212, 0) * unit(), least = cycle_value(205, 0) * unit();
  const double chip = cycle_value(257, 0) * unit(), stop = cycle_value(258, 0.2) * unit();
  double step = cycle_value(202) * unit(), level = surface;
  check_infeeds(surface - bottom, step);
  for (int pecks = 0;; ++pecks) {
    check_pecks(pecks);
    const double next = std::max(bottom, level - step);
    if (chip > 0) {
      check_infeeds(level - next, chip);
      for (double part = level - chip; part > next + 1e-9; part -= chip) {
        run_.count_block();
        feed_to(part, 206, 206);
        to_depth(part + back, true);
      }
    }
    run_.count_block();
    feed_to(next, 206, 206);
    level = next;
    if (level <= bottom + 1e-9) break;
    to_depth(surface + clear, true);
    to_depth(std::min(level + stop, surface + clear), true);
    if (less > 0) step = std::min(step, std::max(step - less, least));
    if (!(step > 0)) refuse({1, {}}, "Q205 above zero beside Q212", "infeeds that come to nothing");
  }
  wait(211);
  feed_to(surface + clear, 208, 206);
}

/// 202: out with the spindle standing, off the wall by 0.2 mm where Q214 says which way.
void Machine::bore(double surface, double bottom) {
  feed_to(bottom, 206, 206);
  wait(211);
  const int turns = canon_.spindle_direction();
  const double way = cycle_value(214, 0);
  const int j = canon_.joint_of(way == 1 || way == 3 ? 'X' : 'Y');
  const double off = way == 1 || way == 2 ? -0.2 : 0.2;  // mm
  if (way != 0 && (j < 0 || (way != 1 && way != 2 && way != 3 && way != 4)))
    refuse({1, {}}, "Q214 of 0 to 4");
  const auto aside = [&](double by) {
    if (way == 0) return;
    Target target;
    target.by(j, by, {1, {}});
    canon_.traverse({.end = canon_.end_of(target), .cause = {1, {}}});
  };
  canon_.turn_spindle(0);
  aside(off);
  feed_to(surface + cycle_value(200) * unit(), 208, 206);
  aside(-off);
  canon_.turn_spindle(turns);
}

/// 207 with the feed of the pitch, 206 with its own.
void Machine::tap(double surface, double bottom) {
  const int turns = canon_.spindle_direction();
  const double top = surface + cycle_value(200) * unit();
  if (cycle_.number == 207) {
    const double pitch = cycle_value(239);
    const int in = pitch > 0 ? 1 : -1;
    canon_.set_feed_mode(FeedMode::PerRevolution);
    canon_.set_feed(Feed{std::abs(pitch), unit()});
    canon_.turn_spindle(in);
    to_depth(bottom, false);
    canon_.turn_spindle(-in);
    to_depth(top, false);
  } else {
    feed_to(bottom, 206, 206);
    canon_.turn_spindle(-turns);
    wait(211);
    feed_to(top, 206, 206);
  }
  canon_.turn_spindle(turns);
}

}  // namespace abbe::sim::dialects::heidenhain
