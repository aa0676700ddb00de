#include "sim/dialects/heidenhain/heidenhain.h"

/// Coordinate cycles (CYCL DEF, TRANS, presets), and cycles for drilling, boring and tapping.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Parses at most five digits.
int parse_digits(Cursor& cursor) {
  int number = 0;
  for (int n = 0; n < 5 && is_digit(cursor.current()); ++n)
    number = 10 * number + (cursor.text[cursor.at++] - '0');
  return number;
}

}  // namespace

/// Executes CYCL DEF, for example CYCL DEF 7.1 X+10 or CYCL DEF 200 DRILLING Q200=2.
void Machine::execute_cycle_definition(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (!is_digit(words.cursor.current())) words.throw_input_error(from, "a cycle number");
  const int number = parse_digits(words.cursor);
  int part = -1;
  if (words.cursor.current() == '.') {
    ++words.cursor.at;
    part = parse_digits(words.cursor);
  }
  const Cause cause = words.cause(from);
  const std::string name = fmt::format("CYCL\u00a0DEF\u00a0{}", number);
  const WordTableEntry* entry = find_word(heidenhain_words(), name);
  if (entry == nullptr) {
    cycle_ = {};  // a call after the skipped definition must not run the previous cycle
    return run_.handle_unknown_word(cause, "a supported cycle");
  }
  if (entry->use == WordTreatment::Refused) {
    run_.mark_uncertain(cycle_name);
    throw_input_error(cause, std::string(entry->sentence));
  }
  // Block n.0 begins a new cycle, so the previous one must be complete.
  if (part <= 0) require_complete_cycle(cause);
  if (entry->use == WordTreatment::WithoutEffect) return;
  // A new definition ends the modal call of M89.
  is_cycle_modal_ = false;
  if (part > 0 && (!previous_cycle_block_ || previous_cycle_block_->cycle != number))
    throw_input_error(cause, fmt::format("CYCL DEF {}.0 in the block before", number));
  if (part >= 0) previous_cycle_block_ = NumberedCycleBlock{number, part};
  if (part >= 0) return execute_numbered_cycle(number, part, from, words);
  run_.define(cycle_name, [&] { define_q_cycle(number, from, words); });
}

/// Throws BadInput if a block with the name of a cycle, such as CYCL DEF 7.0, was not followed by a
/// block with its values.
void Machine::require_complete_cycle(const Cause& cause) {
  const auto cycle = std::exchange(previous_cycle_block_, std::nullopt);
  if (cycle && cycle->part == 0)
    throw_input_error(cause, fmt::format("CYCL DEF {0}.1 after CYCL DEF {0}.0", cycle->cycle));
}

void Machine::execute_numbered_cycle(int number, int part, std::size_t from, WordReader& words) {
  if (part == 0) return;  // part 0 has only the name of the cycle
  switch (number) {
    case 7:
      return execute_datum_shift(words);
    case 8:
      if (!words.at_end())
        words.throw_input_error(words.cursor.at, "no axis: mirroring is not supported");
      return;
    case 9: {
      words.require("DWELL", "DWELL and seconds");
      const double seconds = words.read_value();
      words.expect_end();
      return canon_.dwell(seconds, words.cause(from));
    }
    case 10:
      return execute_rotation_cycle(words);
    case 11: {
      if (words.at_end()) return;
      words.require("SCL", "SCL and a factor");
      const std::size_t at = words.cursor.at;
      if (words.read_value() != 1.0) words.throw_input_error(at, "SCL 1: scaling is not supported");
      return words.expect_end();
    }
    case 19:
      return execute_plane_cycle(words);
    default:
      words.throw_input_error(from, "CYCL DEF with Q parameters");
  }
}

/// Executes the shifts of cycle 7 and of TRANS DATUM AXIS, for example X+10 IY-5.
void Machine::execute_datum_shift(WordReader& words) {
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    if (words.cursor.current() == '#')
      words.throw_input_error(from, "an explicit shift: datum tables are not supported");
    const std::string name = words.read_name();
    const bool is_incremental = name.size() == 2 && name[0] == 'I';
    if (name.size() != 1 && !is_incremental) words.throw_input_error(from, "an axis and its shift");
    const double number = words.read_value();
    set_axis_shift(name.back(), number, is_incremental, words.cause(from));
  }
  apply_frame({1, "CYCL DEF 7"});
}

/// Sets the shift of an axis. In a tilted plane, a shift that was set before the plane can only be
/// ended, which takes effect when the plane ends.
void Machine::set_axis_shift(char letter, double value, bool is_incremental, const Cause& cause) {
  const int j = joint_of(letter, cause);
  value *= canon_.is_linear(j) ? unit() : units::deg;
  const bool is_xyz = letter >= 'X' && letter <= 'Z';
  if (is_xyz && plane_ && (outer_shift_.norm() > 0 || uncertain_shifts_ != 0)) {
    if (value != 0.0)
      throw_input_error(
          cause, "0, or PLANE RESET first: a datum shift from before the tilted plane is active");
    double& outer_shift = outer_shift_[letter - 'X'];
    if (is_incremental || outer_shift == 0.0) return;
    outer_shift = 0.0;
    uncertain_shifts_ |= shift_bit(letter);
    return;
  }
  if (is_xyz && !plane_) {
    // An increment of an uncertain shift would be uncertain too.
    if (is_incremental && (uncertain_shifts_ & shift_bit(letter)))
      throw_input_error(
          cause,
          "an absolute shift after PLANE RESET: the shift within the plane was a different one");
    uncertain_shifts_ &= ~shift_bit(letter);
  }
  datum_shift_[j] = is_incremental ? datum_shift_[j] + value : value;
}

/// Throws BadInput unless the origin of X Y Z is known.
void Machine::require_certain_shift(const Cause& cause) const {
  if (uncertain_shifts_ == 0) return;
  if (plane_)
    throw_input_error(cause,
                      "PLANE RESET before a move: the datum shift with which the plane started has "
                      "ended within it");
  throw_input_error(cause, "the datum shift and ROT restated before a move",
                    "those of the tilted plane that was reset");
}

void Machine::execute_rotation_cycle(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  const std::string name = words.read_name();
  if (name != "ROT" && name != "IROT") words.throw_input_error(from, "ROT and an angle");
  const double angle = words.read_value() * units::deg;
  words.expect_end();
  if (name == "IROT" && (uncertain_shifts_ & rotation_bit))
    words.throw_input_error(from, "ROT after PLANE RESET");
  // After an error the previous rotation is restored, so that later blocks refer to it.
  const double previous_rotation = rotation_;
  rotation_ = name == "IROT" ? rotation_ + angle : angle;
  try {
    apply_frame(words.cause(from));
  } catch (const BadInput&) {
    rotation_ = previous_rotation;
    throw;
  }
  uncertain_shifts_ &= ~rotation_bit;
  tangent_.reset();
}

/// Executes cycle 19, which states spatial angles. Later blocks position the axes.
void Machine::execute_plane_cycle(WordReader& words) {
  RotaryPositioning positioning;
  positioning.cause = {1, "CYCL DEF 19"};
  if (words.at_end()) return reset_plane(positioning);
  std::array<double, 3> angles{};
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.read_name();
    if (name.size() == 1 && name[0] >= 'A' && name[0] <= 'C')
      angles[std::size_t(name[0] - 'A')] = words.read_value() * units::deg;
    else if (name == "F" || name == "DIST" || name == "ABST")
      words.read_value();  // for machines on which the cycle positions the axes
    else
      words.throw_input_error(from, "A, B and C");
  }
  run_.warn_once(
      "CYCL DEF 19: A B C are taken as spatial angles, and no axis moves by itself; Q120 to Q122 "
      "give the positions");
  if (angles == std::array<double, 3>{}) {
    plane_axes_ = {};
    return reset_plane(positioning);
  }
  const Matrix3d R = (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(angles[1], Vector3d::UnitY()) *
                      Eigen::AngleAxisd(angles[0], Vector3d::UnitX()))
                         .toRotationMatrix();
  set_plane(R, positioning);
}

/// Executes TRANS, for example TRANS DATUM AXIS X+10 or TRANS DATUM RESET.
void Machine::execute_trans(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (contour_.is_compensated()) words.throw_input_error(from, "R0 before TRANS");
  if (words.accept("ROTATION")) {
    if (words.accept("RESET")) {
      rotation_ = 0.0;
      uncertain_shifts_ &= ~rotation_bit;
      return apply_frame(words.cause(from));
    }
    return execute_rotation_cycle(words);
  }
  if (!words.accept("DATUM")) words.throw_input_error(from, "DATUM or ROTATION after TRANS");
  if (words.accept("AXIS")) return execute_datum_shift(words);
  words.require_word("RESET", "AXIS or RESET: datum tables are not supported");
  words.expect_end();
  for (const char letter : axis_letters)
    if (canon_.joint_of(letter) >= 0) set_axis_shift(letter, 0.0, false, words.cause(from));
  apply_frame(words.cause(from));
}

/// Selects a preset, which ends datum shift and rotation. Presets 1 to 6 are G54 to G59 of the
/// scene.
void Machine::select_preset(int number, const Cause& cause) {
  if (contour_.is_compensated()) throw_input_error(cause, "R0 before a preset change");
  if (plane_) throw_input_error(cause, "PLANE RESET before a preset change");
  const bool is_preset = number >= 1 && number <= max_preset;
  if (!is_preset ||
      (number > 6 && !canon_.options().extra_offsets.contains(preset_offset_key(number))))
    throw_input_error(cause,
                      "a preset from 1 to 6, which are G54 to G59 of the scene, or a preset of the "
                      "control's table (`offsets`)");
  preset_ = preset_offset_key(number) - 1;
  datum_shift_.setZero();
  rotation_ = 0.0;
  uncertain_shifts_ = 0;
  tangent_.reset();
  apply_frame(cause);
}

// Cycles for drilling, boring and tapping.

namespace {

constexpr double min_rapid_feed = 99999.0;  // a cycle's feed of this value or more means FMAX
// Bounds the number of moves in a hole whose infeed is far below any chip thickness.
constexpr int max_pecks = 100000;

// Parameters of a cycle.
struct CycleEntry {
  int number;
  std::array<int, 16> parameters;  ///< the first `mandatory_count` are mandatory
  int mandatory_count;
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
  for (const CycleEntry& cycle : cycles)
    if (cycle.number == number) return &cycle;
  return nullptr;
}

bool is_feed_parameter(int number) { return (number >= 206 && number <= 208) || number == 253; }

}  // namespace

void Machine::define_q_cycle(int number, std::size_t from, WordReader& words) {
  const CycleEntry* entry = find_cycle_entry(number);
  if (entry == nullptr)
    words.throw_input_error(from, "a point and a part number, such as CYCL DEF 7.1");
  Cycle cycle{.number = number, .line = canon_.line(), .values = {}};
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.read_name();
    if (name != "Q" || !is_digit(words.cursor.current())) {
      if (cycle.values.empty() && !name.empty()) continue;  // the name of the cycle
      words.throw_input_error(at, "Q and a number");
    }
    const int q = words.read_whole_number(1999);
    const bool is_parameter = std::ranges::find(entry->parameters, q) != entry->parameters.end() ||
                              (number == 205 && q == 395);
    if (!is_parameter) words.throw_input_error(at, fmt::format("a parameter of cycle {}", number));
    words.require("=", "= after a parameter");
    const double value = read_cycle_value(q, cycle.per_revolution, words);
    cycle.values[q] = value;
    if (on_parameter) on_parameter(q, value);
  }
  for (int i = 0; i < entry->mandatory_count; ++i)
    if (!cycle.values.contains(entry->parameters[std::size_t(i)]))
      words.cursor.throw_input_error(
          from, fmt::format("Q{} of cycle {}", entry->parameters[std::size_t(i)], number), "none");
  // Cycle 247 selects a preset at its definition.
  if (number == 247) {
    const double preset = cycle.values[339];
    const bool is_whole = preset == std::floor(preset) && preset >= 0.0 && preset <= max_preset;
    return select_preset(is_whole ? int(preset) : -1, words.cause(from));
  }
  cycle_ = std::move(cycle);
  check_cycle(words.cause(from));
}

/// Parses the value of a parameter of a cycle. A feed may be written as in a block, with or without
/// F. Parameters that are feeds per revolution are added to `per_revolution`.
double Machine::read_cycle_value(int q, std::set<int>& per_revolution, WordReader& words) const {
  const std::size_t from = skip_blanks(words.cursor);
  WordReader ahead = words;
  const std::string name = ahead.read_name();
  if (!is_feed_parameter(q) || name.empty() || name.front() == 'Q') return words.read_value();
  words.cursor.at = ahead.cursor.at;
  const FeedValue feed = read_feed(name.substr(name.front() == 'F' ? 1 : 0), words, from);
  if (feed.kind == FeedKind::PerRevolution) per_revolution.insert(q);
  return feed.kind == FeedKind::Rapid ? 99999.9 : feed.value;
}

/// Throws BadInput if a cycle has settings that are not supported.
void Machine::check_cycle(const Cause& cause) {
  const auto require = [&](int q, double value, const char* sentence) {
    if (cycle_value(q, value) == value) return;
    // Resetting the cycle number avoids further errors from calls.
    cycle_.number = 0;
    throw_input_error(cause, sentence, fmt::format("Q{} = {:.6g}", q, cycle_.values[q]));
  };
  require(395, 0,
          "Q395=0: depths are those of the tip, because the point angle of a drill is unknown");
  require(343, 0, "Q343=0: the depth from Q201, because the point angle of a drill is unknown");
  require(379, 0, "Q379=0: no deepened starting point");
  if (cycle_value(258, 0) != cycle_value(259, cycle_value(258, 0)))
    require(259, cycle_value(258, 0), "Q259 equal to Q258: the clearance between them is unknown");
  const double depth = cycle_value(201);
  if (depth > 0) require(201, 0, "Q201 less than zero");
  const bool has_infeeds = cycle_.number == 200 || cycle_.number == 203 || cycle_.number == 205;
  if (has_infeeds && !(cycle_value(202) > 0)) require(202, 1, "Q202 greater than zero");
  if (cycle_.number == 207 && cycle_value(239) == 0) require(239, 1, "a nonzero Q239");
  if (cycle_.values.contains(206) && !(cycle_.values[206] > 0))
    require(206, 1, "Q206 greater than zero");
  for (const int q : {200, 204, 210, 211, 212, 213, 205, 256, 257, 258, 208})
    if (cycle_value(q, 0) < 0) require(q, 0, "a non-negative value");
}

double Machine::cycle_value(int number) const { return cycle_.values.at(number); }

double Machine::cycle_value(int number, double default_value) const {
  return find_value(cycle_.values, number).value_or(default_value);
}

/// Executes CYCL CALL, for example CYCL CALL M3 or CYCL CALL POS X+10 Y+20 Z+0 FMAX.
void Machine::call_cycle(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  const bool has_position = words.accept("POS");
  if (words.accept("PAT"))
    words.throw_input_error(from, "CYCL CALL, CYCL CALL POS or M99: patterns are not supported");
  MotionBlock move = read_move("", words.cursor.at, words);
  move.cause = {int(from) + 1, has_position ? "CYCL CALL POS" : "CYCL CALL"};
  apply_functions_before_motion(move);
  set_feed(move);
  double surface = 0.0;
  if (has_position) {
    const Target target = block_target(move);
    const int z = joint_of('Z', move.cause);
    for (const char letter : {'X', 'Y', 'Z'})
      if (!target.has(joint_of(letter, move.cause)))
        throw_input_error(move.cause, "X, Y and Z after CYCL CALL POS");
    surface = canon_.without_offsets(canon_.end_of(target))[z];
    require_cycle(move.cause);
    const double clearance = surface + (cycle_value(203) + cycle_value(200)) * unit();
    Target hole;
    for (const char letter : {'X', 'Y'}) {
      const int j = joint_of(letter, move.cause);
      hole.to(j, canon_.without_offsets(canon_.end_of(target))[j], move.cause);
    }
    // The tool first rises to the clearance, so that it does not move sideways through the part.
    if (canon_.programmed()[z] < clearance) move_to_depth(clearance, true);
    canon_.straight({canon_.end_of(hole), move.cause, false, hole.stated()},
                    move.feed_kind == FeedKind::Rapid);
  } else {
    for (const auto& axis : move.axes)
      if (axis) throw_input_error(axis->cause, "CYCL CALL POS before axes");
  }
  run_cycle(surface, move.cause);
  apply_functions_after_motion(move);
}

void Machine::require_cycle(const Cause& cause) const {
  run_.require_certain(cycle_name, cause);
  if (cycle_.number == 0) throw_input_error(cause, "CYCL DEF of a hole before it", "none");
}

/// Executes the cycle at the current position. `surface`, mm, is added to Q203.
void Machine::run_cycle(double surface, const Cause& cause) {
  require_cycle(cause);
  require_certain_shift(cause);
  if (contour_.is_compensated() || contour_.is_waiting())
    throw_input_error(cause, "R0, without a pending corner, before a cycle");
  joint_of('Z', cause);
  const double depth = cycle_value(201) * unit();
  if (depth == 0.0) return;  // the control does not run a cycle of depth zero
  surface += cycle_value(203) * unit();
  const double clearance = surface + cycle_value(200) * unit();
  const auto feed = canon_.feed();
  const auto mode = canon_.feed_mode();
  // Feeds of cycles are per minute unless stated otherwise; the mode of the program is restored.
  canon_.set_feed_mode(FeedMode::PerMinute);
  move_to_depth(clearance, true);
  if (cycle_.number == 200)
    drill(surface, surface + depth);
  else if (cycle_.number == 203)
    peck_universal(surface, surface + depth);
  else if (cycle_.number == 205)
    peck_deep(surface, surface + depth);
  else if (cycle_.number == 202)
    bore(surface, surface + depth);
  else if (cycle_.number == 206 || cycle_.number == 207)
    tap(surface, surface + depth);
  else
    ream(surface, surface + depth);
  // The second clearance may be programmed below the first one.
  move_to_depth(surface + std::max(cycle_value(204), cycle_value(200)) * unit(), true);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
  tangent_.reset();
}

void Machine::move_to_depth(double z, bool rapid) {
  const int j = canon_.joint_of('Z');
  Target target;
  target.to(j, z, {1, {}});
  program::Straight straight{canon_.end_of(target), {1, {}}, false, target.stated()};
  canon_.straight(std::move(straight), rapid);
}

/// Moves to a depth at the feed of a parameter, or at that of the default parameter if the first is
/// zero or not programmed.
void Machine::feed_to_depth(double z, int parameter, int default_parameter) {
  if (cycle_value(parameter, 0.0) == 0.0) parameter = default_parameter;
  const double feed = cycle_value(parameter, 0.0);
  if (feed >= min_rapid_feed) return move_to_depth(z, true);
  if (cycle_.per_revolution.contains(parameter)) {
    canon_.set_feed_mode(FeedMode::PerRevolution);
    canon_.set_feed(Feed{feed, unit()});
  } else {
    canon_.set_feed(Feed{feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  move_to_depth(z, false);
  canon_.set_feed_mode(FeedMode::PerMinute);
}

void Machine::dwell(int parameter) { canon_.dwell(cycle_value(parameter, 0.0), {1, {}}); }

/// Executes cycle 200: after each infeed the tool leaves the hole, and the next infeed begins one
/// clearance above the last depth.
void Machine::drill(double surface, double bottom) {
  const double clearance = cycle_value(200) * unit(), infeed = cycle_value(202) * unit();
  check_infeeds(surface - bottom, infeed);
  // A remainder below 1e-9 mm is due to rounding, so it is not an infeed.
  for (double level = surface - infeed; level > bottom + 1e-9; level -= infeed) {
    run_.count_block();
    feed_to_depth(level, 206, 206);
    move_to_depth(surface + clearance, true);
    dwell(210);
    move_to_depth(level + clearance, true);
  }
  feed_to_depth(bottom, 206, 206);
  dwell(211);
}

void Machine::check_pecks(double pecks) const {
  if (!(pecks <= max_pecks)) throw_input_error({1, {}}, "at most 1e5 infeeds in a hole", "more");
}

/// Checks the number of equal infeeds before the first one is executed.
void Machine::check_infeeds(double depth, double infeed) const {
  constexpr double moves_per_infeed = 2.0;  // at least: one in, one out
  check_pecks(depth / infeed);
  run_.check_moves(moves_per_infeed * depth / infeed, {1, {}});
}

/// Returns the infeed after another one: Q212 reduces the infeeds down to Q205.
double Machine::next_infeed(double infeed) const {
  const double decrement = cycle_value(212, 0) * unit(), min_infeed = cycle_value(205, 0) * unit();
  if (decrement > 0) infeed = std::min(infeed, std::max(infeed - decrement, min_infeed));
  if (!(infeed > 0))
    throw_input_error({1, {}}, "Q205 greater than zero with Q212", "infeeds that decrease to zero");
  return infeed;
}

/// Executes cycles 201 and 240.
void Machine::ream(double surface, double bottom) {
  feed_to_depth(bottom, 206, 206);
  dwell(211);
  if (cycle_.number == 201) feed_to_depth(surface + cycle_value(200) * unit(), 208, 206);
}

/// Executes cycle 203: infeeds decrease, and chips are broken Q213 times before the tool leaves the
/// hole.
void Machine::peck_universal(double surface, double bottom) {
  // Without Q256 chips are broken by a retraction of 0.2 mm.
  const double clearance = cycle_value(200) * unit(), retraction = cycle_value(256, 0.2) * unit();
  double infeed = cycle_value(202) * unit();
  check_infeeds(surface - bottom, infeed);
  int break_count = 0;
  const int max_breaks = int(std::lround(std::min(cycle_value(213, 0), 1e6)));
  double level = surface;
  for (int pecks = 0;; ++pecks) {
    run_.count_block();
    check_pecks(pecks);
    level = std::max(bottom, level - infeed);
    feed_to_depth(level, 206, 206);
    if (level <= bottom + 1e-9) break;
    if (max_breaks > 0 && break_count < max_breaks) {
      ++break_count;
      feed_to_depth(std::min(level + retraction, surface + clearance), 208, 206);
    } else {
      break_count = 0;
      feed_to_depth(surface + clearance, 208, 206);
      dwell(210);
      move_to_depth(level + clearance, true);
    }
    infeed = next_infeed(infeed);
  }
  dwell(211);
  feed_to_depth(surface + clearance, 208, 206);
}

/// Executes cycle 205: chips are broken every Q257, and the tool leaves the hole after every
/// infeed.
void Machine::peck_deep(double surface, double bottom) {
  const double clearance = cycle_value(200) * unit(), retraction = cycle_value(256, 0.2) * unit();
  const double break_infeed = cycle_value(257, 0) * unit();
  const double stop_distance = cycle_value(258, 0.2) * unit();
  double infeed = cycle_value(202) * unit(), level = surface;
  check_infeeds(surface - bottom, infeed);
  for (int pecks = 0;; ++pecks) {
    check_pecks(pecks);
    const double next_level = std::max(bottom, level - infeed);
    if (break_infeed > 0) {
      check_infeeds(level - next_level, break_infeed);
      for (double break_level = level - break_infeed; break_level > next_level + 1e-9;
           break_level -= break_infeed) {
        run_.count_block();
        feed_to_depth(break_level, 206, 206);
        move_to_depth(break_level + retraction, true);
      }
    }
    run_.count_block();
    feed_to_depth(next_level, 206, 206);
    level = next_level;
    if (level <= bottom + 1e-9) break;
    move_to_depth(surface + clearance, true);
    // The tool returns at rapid to the stop distance above the last depth.
    move_to_depth(std::min(level + stop_distance, surface + clearance), true);
    infeed = next_infeed(infeed);
  }
  dwell(211);
  feed_to_depth(surface + clearance, 208, 206);
}

/// Executes cycle 202: the tool leaves the hole with the spindle stopped, 0.2 mm away from the wall
/// in the direction of Q214.
void Machine::bore(double surface, double bottom) {
  feed_to_depth(bottom, 206, 206);
  dwell(211);
  const int spindle_direction = canon_.spindle_direction();
  const double direction = cycle_value(214, 0);
  const int j = canon_.joint_of(direction == 1 || direction == 3 ? 'X' : 'Y');
  const double lift = direction == 1 || direction == 2 ? -0.2 : 0.2;  // mm
  if (direction != 0 &&
      (j < 0 || (direction != 1 && direction != 2 && direction != 3 && direction != 4)))
    throw_input_error({1, {}}, "Q214 from 0 to 4");
  const auto move_sideways = [&](double distance) {
    if (direction == 0) return;
    Target target;
    target.by(j, distance, {1, {}});
    canon_.traverse({.end = canon_.end_of(target), .cause = {1, {}}});
  };
  canon_.turn_spindle(0);
  move_sideways(lift);
  feed_to_depth(surface + cycle_value(200) * unit(), 208, 206);
  move_sideways(-lift);
  canon_.turn_spindle(spindle_direction);
}

/// Executes tapping: cycle 207 at the feed of the pitch, cycle 206 at its own feed.
void Machine::tap(double surface, double bottom) {
  const int spindle_direction = canon_.spindle_direction();
  const double top = surface + cycle_value(200) * unit();
  if (cycle_.number == 207) {
    const double pitch = cycle_value(239);
    // A negative pitch is a left-hand thread.
    const int thread_direction = pitch > 0 ? 1 : -1;
    canon_.set_feed_mode(FeedMode::PerRevolution);
    canon_.set_feed(Feed{std::abs(pitch), unit()});
    canon_.turn_spindle(thread_direction);
    move_to_depth(bottom, false);
    canon_.turn_spindle(-thread_direction);
    move_to_depth(top, false);
  } else {
    feed_to_depth(bottom, 206, 206);
    canon_.turn_spindle(-spindle_direction);
    dwell(211);
    feed_to_depth(top, 206, 206);
  }
  canon_.turn_spindle(spindle_direction);
}

}  // namespace abbe::sim::dialects::heidenhain
