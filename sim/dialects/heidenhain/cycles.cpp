#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/control_table.h"
#include "sim/dialects/heidenhain/block.h"
#include "sim/dialects/heidenhain/machine.h"

/// Cycles of coordinates (CYCL DEF, TRANS, presets), and cycles that drill, bore and tap.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using program::Feed;
using program::FeedMode;

namespace {

// Reads at most five digits.
int digits_at(Cursor& cursor) {
  int number = 0;
  for (int n = 0; n < 5 && is_digit(cursor.current()); ++n)
    number = 10 * number + (cursor.text[cursor.at++] - '0');
  return number;
}

}  // namespace

/// Examples: CYCL DEF 7.1 X+10 or CYCL DEF 200 DRILLING Q200=2.
void Machine::cycle_definition(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (!is_digit(words.cursor.current())) words.refuse(from, "the number of a cycle");
  const int number = digits_at(words.cursor);
  int part = -1;
  if (words.cursor.current() == '.') {
    ++words.cursor.at;
    part = digits_at(words.cursor);
  }
  const Cause cause = words.cause(from);
  const std::string name = fmt::format("CYCL\u00a0DEF\u00a0{}", number);
  const WordTableEntry* use = find_word(heidenhain_words(), name);
  if (use == nullptr) {
    cycle_ = {};  // calling a skipped cycle must not call the previous one
    return run_.handle_unknown_word(cause, "a cycle that is read");
  }
  if (use->use == Use::Refused) {
    run_.mark_uncertain(the_cycle);
    refuse(cause, std::string(use->sentence));
  }
  // Block 7.0 of a new cycle ends a previous one.
  if (part <= 0) require_whole_cycle(cause);
  if (use->use == Use::WithoutEffect) return;
  // A new definition ends the modal call of M89.
  modal_cycle_ = false;
  if (part > 0 && (!old_cycle_ || old_cycle_->first != number))
    refuse(cause, fmt::format("CYCL DEF {}.0 in the block before", number));
  if (part >= 0) old_cycle_ = {number, part};
  if (part >= 0) return old_cycle(number, part, from, words);
  run_.define(the_cycle, [&] { new_cycle(number, from, words); });
}

/// Throws BadInput if the name of a cycle, CYCL DEF 7.0, was not followed by its values.
void Machine::require_whole_cycle(const Cause& cause) {
  const auto begun = std::exchange(old_cycle_, std::nullopt);
  if (begun && begun->second == 0)
    refuse(cause, fmt::format("CYCL DEF {0}.1 behind CYCL DEF {0}.0", begun->first));
}

void Machine::old_cycle(int number, int part, std::size_t from, Words& words) {
  if (part == 0) return;  // the name of the cycle
  switch (number) {
    case 7:
      return datum_shift(words);
    case 8:
      // Values of mirror image and scaling are accepted only if they have no effect.
      if (!words.at_end()) words.refuse(words.cursor.at, "no axis: nothing is mirrored");
      return;
    case 9: {
      if (!words.cursor.accept("DWELL")) words.refuse(words.cursor.at, "DWELL and seconds");
      const double seconds = words.value();
      words.ends();
      return canon_.dwell(seconds, words.cause(from));
    }
    case 10:
      return cycle_rotation(words);
    case 11: {
      if (words.at_end()) return;
      if (!words.cursor.accept("SCL")) words.refuse(words.cursor.at, "SCL and a factor");
      const std::size_t at = words.cursor.at;
      if (words.value() != 1.0) words.refuse(at, "SCL 1: nothing is scaled");
      return words.ends();
    }
    case 19:
      return cycle_plane(words);
    default:
      words.refuse(from, "CYCL DEF with Q parameters");
  }
}

/// Reads shifts of cycle 7 and of TRANS DATUM AXIS, for example X+10 IY-5.
void Machine::datum_shift(Words& words) {
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    if (words.cursor.current() == '#')
      words.refuse(from, "a shift in words: datum tables are not read");
    const std::string name = words.name();
    const bool step = name.size() == 2 && name[0] == 'I';
    if (name.size() != 1 && !step) words.refuse(from, "an axis and its shift");
    const double number = words.value();
    shift_axis(name.back(), number, step, words.cause(from));
  }
  apply_frame({1, "CYCL DEF 7"});
}

/// Sets the shift of an axis. Of a shift from before the plane only its end is known, and that
/// takes effect when the plane ends.
void Machine::shift_axis(char letter, double value, bool step, const Cause& cause) {
  const int j = joint_of(letter, cause);
  value *= canon_.is_linear(j) ? unit() : units::deg;
  const bool of_place = letter >= 'X' && letter <= 'Z';
  if (of_place && plane_ && (outer_shift_.norm() > 0 || shift_doubt_ != 0)) {
    if (value != 0.0)
      refuse(cause,
             "0, or PLANE RESET before it: a datum shift from before the tilted plane is in force");
    double& outer = outer_shift_[letter - 'X'];
    if (step || outer == 0.0) return;
    outer = 0.0;
    shift_doubt_ |= shift_bit(letter);
    return;
  }
  if (of_place && !plane_) {
    // An increment of an uncertain shift would be uncertain too.
    if (step && (shift_doubt_ & shift_bit(letter)))
      refuse(cause, "an absolute shift behind PLANE RESET: that within the plane was another");
    shift_doubt_ &= ~shift_bit(letter);
  }
  datum_shift_[j] = step ? datum_shift_[j] + value : value;
}

/// Throws BadInput unless the origin of X Y Z is known.
void Machine::require_certain_shift(const Cause& cause) const {
  if (shift_doubt_ == 0) return;
  if (plane_)
    refuse(
        cause,
        "PLANE RESET before a move: the datum shift in which the plane began has ended within it");
  refuse(cause, "a datum shift and ROT stated again before a move",
         "those of the tilted plane that was reset");
}

void Machine::cycle_rotation(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string name = words.name();
  if (name != "ROT" && name != "IROT") words.refuse(from, "ROT and an angle");
  const double angle = words.value() * units::deg;
  words.ends();
  if (name == "IROT" && (shift_doubt_ & turn_bit)) words.refuse(from, "ROT behind PLANE RESET");
  // Restored on an error, so that later blocks count from the old rotation.
  const double before = turn_;
  turn_ = name == "IROT" ? turn_ + angle : angle;
  try {
    apply_frame(words.cause(from));
  } catch (const BadInput&) {
    turn_ = before;
    throw;
  }
  shift_doubt_ &= ~turn_bit;
  tangent_.reset();
}

/// Cycle 19: spatial angles; the axes are positioned by blocks behind it.
void Machine::cycle_plane(Words& words) {
  Positioning how;
  how.cause = {1, "CYCL DEF 19"};
  if (words.at_end()) return untilt(how);
  std::array<double, 3> angles{};
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.name();
    if (name.size() == 1 && name[0] >= 'A' && name[0] <= 'C')
      angles[std::size_t(name[0] - 'A')] = words.value() * units::deg;
    else if (name == "F" || name == "DIST" || name == "ABST")
      words.value();  // used by machines whose cycle positions the axes
    else
      words.refuse(from, "A, B and C");
  }
  run_.warn_once(
      "CYCL DEF 19: A B C are taken as spatial angles, and no axis moves by itself; Q120 to Q122 "
      "are the positions");
  if (angles == std::array<double, 3>{}) {
    plane_axes_ = {};
    return untilt(how);
  }
  const Matrix3d R = (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(angles[1], Vector3d::UnitY()) *
                      Eigen::AngleAxisd(angles[0], Vector3d::UnitX()))
                         .toRotationMatrix();
  tilt(R, how);
}

/// Examples: TRANS DATUM AXIS X+10 or TRANS DATUM RESET.
void Machine::trans(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (contour_.beside()) words.refuse(from, "R0 before TRANS");
  if (words.take("ROTATION")) {
    if (words.take("RESET")) {
      turn_ = 0.0;
      shift_doubt_ &= ~turn_bit;
      return apply_frame(words.cause(from));
    }
    return cycle_rotation(words);
  }
  if (!words.take("DATUM")) words.refuse(from, "DATUM or ROTATION after TRANS");
  if (words.take("AXIS")) return datum_shift(words);
  if (!words.take("RESET"))
    words.refuse(words.cursor.at, "AXIS or RESET: datum tables are not read");
  words.ends();
  for (const char letter : std::string_view("XYZABCUVW"))
    if (canon_.joint_of(letter) >= 0) shift_axis(letter, 0.0, false, words.cause(from));
  apply_frame(words.cause(from));
}

/// Selects a preset: 1 to 6 may be G54 to G59 of the scene. Datum shift and rotation end.
void Machine::choose_preset(int number, const Cause& cause) {
  if (contour_.beside()) refuse(cause, "R0 before another preset");
  if (plane_) refuse(cause, "PLANE RESET before another preset");
  const bool is_preset = number >= 1 && number <= max_preset;
  if (!is_preset || (number > 6 && !canon_.options().more_offset.contains(preset_system(number))))
    refuse(cause,
           "a preset of 1 to 6, which are G54 to G59 of the scene, or one of the control's table "
           "(`offsets`)");
  preset_ = preset_system(number) - 1;
  datum_shift_.setZero();
  turn_ = 0.0;
  shift_doubt_ = 0;
  tangent_.reset();
  apply_frame(cause);
}

// Cycles that drill, bore and tap.

namespace {

constexpr double rapid_feed = 99999.0;  // a feed of a cycle from here on is FMAX
// Bounds a hole whose infeed is far below any chip.
constexpr int max_pecks = 100000;

// Parameters of a cycle.
struct CycleEntry {
  int number;
  std::array<int, 16> parameters;  ///< the first `needed` ones are mandatory
  int needed;
};

// Q200 set-up clearance, Q201 depth, Q203 surface, Q204 second set-up clearance, Q206 feed.
constexpr CycleEntry cycles[] = {
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

const CycleEntry* find_cycle_entry(int number) {
  for (const CycleEntry& one : cycles)
    if (one.number == number) return &one;
  return nullptr;
}

bool is_feed_parameter(int number) { return (number >= 206 && number <= 208) || number == 253; }

}  // namespace

void Machine::new_cycle(int number, std::size_t from, Words& words) {
  const CycleEntry* fact = find_cycle_entry(number);
  if (fact == nullptr) words.refuse(from, "a point and a part number, as CYCL DEF 7.1");
  Cycle cycle{.number = number, .line = canon_.line(), .values = {}};
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name != "Q" || !is_digit(words.cursor.current())) {
      if (cycle.values.empty() && !name.empty()) continue;  // the name of the cycle
      words.refuse(at, "Q and a number");
    }
    const int q = words.whole(1999);
    const bool known =
        std::find(fact->parameters.begin(), fact->parameters.end(), q) != fact->parameters.end() ||
        (number == 205 && q == 395);
    if (!known) words.refuse(at, fmt::format("a parameter of cycle {}", number));
    if (!words.cursor.accept("=")) words.refuse(words.cursor.at, "= after a parameter");
    const double value = cycle_word(q, cycle.per_turn, words);
    cycle.values[q] = value;
    if (on_parameter) on_parameter(q, value);
  }
  for (int i = 0; i < fact->needed; ++i)
    if (!cycle.values.contains(fact->parameters[std::size_t(i)]))
      words.cursor.refuse(
          from, fmt::format("Q{} of cycle {}", fact->parameters[std::size_t(i)], number), "none");
  // Cycle 247 selects a preset and is executed at once.
  if (number == 247) {
    const double preset = cycle.values[339];
    const bool is_whole = preset == std::floor(preset) && preset >= 0.0 && preset <= max_preset;
    return choose_preset(is_whole ? int(preset) : -1, words.cause(from));
  }
  cycle_ = std::move(cycle);
  check_cycle(words.cause(from));
}

/// Returns the value of a parameter of a cycle; a feed may be written as in a block, with or
/// without F.
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

/// Throws BadInput for settings of a cycle that are not supported, before it runs.
void Machine::check_cycle(const Cause& cause) {
  const auto only = [&](int q, double value, const char* sentence) {
    if (cycle_value(q, value) == value) return;
    // The cycle is discarded, so that calls report no further errors.
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

/// Examples: CYCL CALL M3 or CYCL CALL POS X+10 Y+20 Z+0 FMAX.
void Machine::cycle_call(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const bool at_place = words.take("POS");
  if (words.take("PAT"))
    words.refuse(from, "CYCL CALL, CYCL CALL POS or M99: patterns are not read");
  Move move = read_move("", words.cursor.at, words);
  move.cause = {int(from) + 1, at_place ? "CYCL CALL POS" : "CYCL CALL"};
  apply_functions_before_motion(move);
  set_feed(move);
  double surface = 0.0;
  if (at_place) {
    const Target target = block_target(move);
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
    // The tool first rises to the clearance, so that it does not move sideways through the part.
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
  apply_functions_after_motion(move);
}

void Machine::require_cycle(const Cause& cause) const {
  run_.require_certain(the_cycle, cause);
  if (cycle_.number == 0) refuse(cause, "CYCL DEF of a hole before it", "none");
}

/// Executes the cycle. `surface` is what the position of the call adds to Q203, mm.
void Machine::run_cycle(double surface, const Cause& cause) {
  require_cycle(cause);
  require_certain_shift(cause);
  if (contour_.beside() || contour_.waits()) refuse(cause, "R0, and no corner, before a cycle");
  joint_of('Z', cause);
  const double depth = cycle_value(201) * unit();
  if (depth == 0.0) return;  // with a depth of zero the control does not run the cycle
  surface += cycle_value(203) * unit();
  const double r = surface + cycle_value(200) * unit();
  const auto feed = canon_.feed();
  const auto mode = canon_.feed_mode();
  // Feeds of cycles are per minute unless stated otherwise; the mode of the program is restored.
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
  // The second clearance may be programmed below the first one.
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

/// Feeds to a level with the feed of a parameter, or of the other parameter if that is zero or not
/// given.
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

/// Cycle 200: each infeed ends above the surface and begins one clearance above the last depth.
void Machine::drill(double surface, double bottom) {
  const double clear = cycle_value(200) * unit(), step = cycle_value(202) * unit();
  check_infeeds(surface - bottom, step);
  // 1e-9 mm: a remainder of rounding is no infeed.
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
  if (!(pecks <= max_pecks)) refuse({1, {}}, "at most 1e5 infeeds in a hole", "more");
}

/// Checks the number of infeeds of constant depth before the first one is made.
void Machine::check_infeeds(double depth, double step) const {
  constexpr double moves_per_infeed = 2.0;  // at least: in and out
  check_pecks(depth / step);
  run_.check_moves(moves_per_infeed * depth / step, {1, {}});
}

/// Cycles 201 and 240.
void Machine::ream(double surface, double bottom) {
  feed_to(bottom, 206, 206);
  wait(211);
  if (cycle_.number == 201) feed_to(surface + cycle_value(200) * unit(), 208, 206);
}

/// Cycle 203: infeeds become smaller; chips are broken Q213 times before the tool leaves the hole.
void Machine::peck_universal(double surface, double bottom) {
  // Without Q256 chips are broken by a retraction of 0.2 mm.
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
    // Infeeds shrink by Q212 down to Q205.
    if (less > 0) step = std::min(step, std::max(step - less, least));
    if (!(step > 0)) refuse({1, {}}, "Q205 above zero beside Q212", "infeeds that come to nothing");
  }
  wait(211);
  feed_to(surface + clear, 208, 206);
}

/// Cycle 205: chips are broken every Q257, and the tool leaves the hole after every infeed.
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
    // Back at rapid to the stop distance above the last depth.
    to_depth(std::min(level + stop, surface + clear), true);
    if (less > 0) step = std::min(step, std::max(step - less, least));
    if (!(step > 0)) refuse({1, {}}, "Q205 above zero beside Q212", "infeeds that come to nothing");
  }
  wait(211);
  feed_to(surface + clear, 208, 206);
}

/// Cycle 202: out with the spindle at rest, 0.2 mm off the wall in the direction of Q214.
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

/// Cycle 207 at the feed of the pitch, cycle 206 at its own feed.
void Machine::tap(double surface, double bottom) {
  const int turns = canon_.spindle_direction();
  const double top = surface + cycle_value(200) * unit();
  if (cycle_.number == 207) {
    const double pitch = cycle_value(239);
    // A negative pitch is a left-hand thread.
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
