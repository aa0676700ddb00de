#include "sim/dialects/fanuc/fanuc.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::Motion;

/// Adds the polar words (G16) to the target. The first axis of the plane is a radius about the
/// origin, or under G91 about the current position. The second is an angle, under G91 added to the
/// previous one.
void Machine::polar_words(const Block& block, Target& target) {
  const std::string_view plane = plane_letters();
  const Word &r = block[plane[0]], &a = block[plane[1]];
  if (!r && !a) return;
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  const AxisVector p = programmed_position();
  if (r) {
    polar_.radius = length(r);
    polar_.centre = is_incremental_ ? Eigen::Vector2d(p[first], p[second]) : Eigen::Vector2d(0, 0);
  }
  if (a) polar_.angle = angle_in_degrees(a) + (is_incremental_ ? polar_.angle : 0.0);
  const double angle = polar_.angle * units::deg;
  const Word& word = r ? r : a;
  target.to(first, polar_.centre.x() + polar_.radius * std::cos(angle), word);
  target.to(second, polar_.centre.y() + polar_.radius * std::sin(angle), word);
}

Target Machine::block_target(const Block& block, bool in_machine_coordinates) {
  Target target;
  const std::string_view plane = plane_letters();
  for (const auto& [j, word, is_incremental] : axis_words(block)) {
    // Words of the plane are polar and handled together in `polar_words`.
    if (polar_.is_on && !in_machine_coordinates &&
        plane.find(word->letter) != std::string_view::npos)
      continue;
    if (is_incremental && in_machine_coordinates) throw_input_error(*word, "X Y Z C with G53");
    if (target.has(j))
      throw_input_error(*word, "an axis as a position or as an increment, not both");
    const double value = axis_word_value(j, *word);
    if (is_incremental || (is_incremental_ && !in_machine_coordinates))
      target.by(j, value, *word);
    else
      target.to(j, value, *word);
  }
  if (polar_.is_on && !in_machine_coordinates) polar_words(block, target);
  return target;
}

void Machine::straight(const Block& block, AxisVector end, std::uint32_t stated) {
  Straight move{std::move(end), motion_cause(block), false, stated};
  if (compensation_.is_on()) return compensation_.straight(std::move(move), motion_ == 0);
  // The pole rule of the control applies to vectors (G43.5) at feed only.
  if (length_mode_ == 435 && motion_ == 10 && vector_lines_.is_active()) {
    const kinematics::Chain& tool_chain = chain(move.cause);
    vector_lines_.straight_feed(tool_chain, std::move(move));
    return;
  }
  canon_.straight(std::move(move), motion_ == 0);
}

void Machine::arc(const Block& block, AxisVector end, std::uint32_t stated) {
  const Cause cause = motion_cause(block);
  if (length_mode_ == 435) throw_input_error(cause, "G1 under G43.5");
  const bool is_compensated = compensation_.is_on();
  ArcMove arc = program::arc_from_block(
      canon_, {.plane = plane_,
               .clockwise = motion_ == 20,
               .from = is_compensated ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = cause,
               .stated = stated,
               .word = [&](char letter) -> std::optional<program::LengthValue> {
                 const Word& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthValue{length(word), word};
               }});
  if (is_compensated && !compensation_.has_entered())
    // Entry of type A needs the direction of a line.
    throw_input_error(cause, "a straight line as the first move after G41 and G42");
  if (is_compensated) return compensation_.arc(std::move(arc));
  canon_.arc(std::move(arc));
}

void Machine::move(const Block& block) {
  const bool has_axis_word = first_axis_word(block) != nullptr;
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool has_arc_words = block['I'] || block['J'] || block['K'] || block['R'];
  if (cycle_code_ != 800) {
    if (has_axis_word || block[Group::Cycle]) execute_cycle(block);
    return;
  }
  // G90 and G94 of a turning control.
  if (motion_ == 900 || motion_ == 940) {
    if (has_axis_word) turning_cycle(block);
    return;
  }
  // Under G43.5 I J K alone rotate the tool at the current tip.
  const bool rotates_tool = length_mode_ == 435 && has_arc_words && !is_arc;
  if (!has_axis_word && !rotates_tool && !(is_arc && has_arc_words)) return;
  has_moved_ = true;
  const Cause cause = motion_cause(block);
  note_uncalled_tool(cause);
  const Target target = block_target(block, false);
  check_tilted_move(target, cause);
  AxisVector end = canon_.target_position_from(current_position(), target, false);
  if (compensation_.is_leaving() && is_arc)
    throw_input_error(cause, "a straight line as the first move after G40");
  compensation_.clear_leaving();
  if (length_mode_ == 435) end = point_tool_along_direction(block, std::move(end));
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else
    straight(block, std::move(end), target.stated());
}

/// Executes G53: a rapid to machine coordinates.
void Machine::move_in_machine_coordinates(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (is_incremental_) throw_input_error(code.word, "G90 with G53");
  const Target target = block_target(block, true);
  if (target.empty()) throw_input_error(code.word, "an axis word with G53", "none");
  has_moved_ = true;
  compensation_.clear_leaving();
  canon_.go_to(Coordinates::Axis, code.word);
  canon_.straight({.end = canon_.end_of(target, true),
                   .cause = code.word,
                   .without_offset = true,
                   .stated = target.stated()},
                  true);
  // G53 suspends the tip mode only for its block.
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

/// Executes G28 and G30: a rapid over the programmed point to the reference position, for the
/// programmed axes only.
void Machine::move_to_reference(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (const Word& p = block['P']; p && whole_number(canon_, p, 4) < 2)
    throw_input_error(p, "P2 P3 or P4 with G30");
  const Target words = block_target(block, false);
  if (words.empty())
    throw_input_error(code.word, "an axis word with " + shown(code.word.text), "none");
  has_moved_ = true;
  compensation_.clear_leaving();
  canon_.straight({.end = canon_.end_of(words), .cause = code.word, .stated = words.stated()},
                  true);
  const AxisVector reference = program::reference_position(canon_.options());
  std::string positions;
  for (const auto& axis : canon_.options().axes)
    if (const int j = canon_.joint_of(axis.name); j >= 0 && words.has(j))
      positions += fmt::format(" {}{:g}", axis.name,
                               reference[j] / (canon_.is_linear(j) ? 1.0 : units::deg) + 0.0);
  // Reported because the scene does not state the reference position.
  if (canon_.options().reference.size() == 0)
    canon_.assume(
        {"the reference position (G28, G30) is taken to be the start position of the axes:" +
             positions,
         "machine.reference"});
  canon_.go_to(Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (words.has(j)) end[j] = reference[j];
  canon_.straight(
      {.end = std::move(end), .cause = code.word, .without_offset = true, .stated = words.given()},
      true);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

namespace {

// Inclination of the tool from Z of a tilted plane; angles with three decimals stay far below it.
constexpr double max_inclination = 0.02 * units::deg;

}  // namespace

/// Executes G68.2: an origin, and Euler angles about Z, the new X and the new Z.
void Machine::set_tilted_plane(const Block& block) {
  const Code& code = block[Group::Rotation];
  if (has_tip_length_mode()) throw_input_error(code.word, "G49 before G68.2");
  if (polar_.is_on) throw_input_error(code.word, "G15 before G68.2");
  // P1 to P4 of G68.2 state the plane by other angles, points or vectors.
  if (const Word& p = block['P']; p && p.value != 0.0)
    throw_input_error(p,
                      "Euler angles I J K with G68.2: no other definition of a plane is supported");
  const auto rotation = [&](char letter, const Eigen::Vector3d& axis) {
    const double degrees = block[letter] ? angle_in_degrees(block[letter]) : 0.0;
    return Eigen::AngleAxisd(degrees * units::deg, axis);
  };
  for (int k = 0; k < 3; ++k) {
    const Word& word = block[axis_letters[std::size_t(k)]];
    centre_[k] = word ? length(word) : 0.0;
  }
  for (int k = 3; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      throw_input_error(word, "X Y Z I J K with G68.2");
  rotation_ = (rotation('I', Eigen::Vector3d::UnitZ()) * rotation('J', Eigen::Vector3d::UnitX()) *
               rotation('K', Eigen::Vector3d::UnitZ()))
                  .toRotationMatrix();
  is_tilted_ = true;
  apply_frame();
  apply_length(code.word);
}

const Chain& Machine::chain(const Cause& cause) const {
  const bool has_length = length_mode_ != 490 && h_ != 0;
  const Chain* chain = chain_to_tip(canon_.options(), has_length ? h_ : tool_);
  if (chain == nullptr) throw_input_error(cause, "a control that knows its kinematics");
  return *chain;
}

AxisVector Machine::rotary_positions(const Eigen::Vector3d& direction_w, const Cause& cause) {
  const Chain& tool_chain = chain(cause);
  // The copy with unlimited slides is kept because programs rarely change the chain.
  if (!free_slides_ || chain_of_free_slides_ != &tool_chain) {
    free_slides_ = with_free_slides(tool_chain);
    chain_of_free_slides_ = &tool_chain;
    rotary_order_ = rotary_judgement_order(tool_chain);
  }
  kinematics::InverseSolution solution;
  const AxisVector current = canon_.position();  // its rotary joints, valid in any coordinates
  try {
    solution = kinematics::inverse(*free_slides_, {Eigen::Vector3d::Zero(), direction_w}, current);
  } catch (const std::invalid_argument&) {
    throw_input_error(
        cause, "a machine with three linear axes and at most two rotary axes for a direction");
  }
  if (solution.branches.empty())
    throw_input_error(
        cause, "a direction that the rotary axes can reach",
        fmt::format("{:.6f} {:.6f} {:.6f}{}", direction_w.x(), direction_w.y(), direction_w.z(),
                    solution.reach == kinematics::Reachability::OutOfLimits
                        ? ", beyond their limits"
                        : ""));
  const AxisVector& best = output_judgement(solution.branches, current, rotary_order_);
  AxisVector q = current;
  for (const int j : rotary_order_) q[j] = best[j];
  return q;
}

/// Executes G53.1, which rotates the tool with the slides at rest, and G53.6, with the tip at rest.
void Machine::align_tool_with_plane(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (!is_tilted_) throw_input_error(code.word, "G68.2 before " + shown(code.word.text));
  if (const Word* axis = first_axis_word(block))
    throw_input_error(*axis, "a block without axis words with " + shown(code.word.text));
  const AxisVector aligned = rotary_positions(rotation_->col(2), code.word);
  const bool keeps_tip = code.tenths == 536;
  // In axis coordinates the slides stay; in tip coordinates they follow the rotation.
  if (!keeps_tip) canon_.go_to(program::Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (const int j : rotary_order_) end[j] = aligned[j];
  canon_.traverse({.end = std::move(end), .cause = code.word});
  canon_.go_to(program::Coordinates::Tip, code.word);
}

/// Returns `end` with the rotary axes at the direction I J K of G43.5.
AxisVector Machine::point_tool_along_direction(const Block& block, AxisVector end) {
  for (const auto& [j, word, is_incremental] : axis_words(block))
    if (canon_.options().axes[std::size_t(j)].motion == Motion::Rotary)
      throw_input_error(*word, "I J K for the tool direction under G43.5");
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  const Word* first = nullptr;
  for (int k = 0; k < 3; ++k)
    if (const Word& word = block["IJK"[k]]) {
      direction[k] = word_value(word);
      if (first == nullptr) first = &word;
    }
  if (first == nullptr) return end;
  if (!(direction.norm() > 1e-9)) throw_input_error(*first, "a nonzero direction I J K");
  // The direction is programmed in the tilted system.
  if (rotation_) direction = *rotation_ * direction;
  const AxisVector aligned = rotary_positions(direction.normalized(), *first);
  for (const int j : rotary_order_) end[j] = aligned[j];
  return end;
}

/// Checks a move in a tilted plane. X Y Z are those of the tip only while the tool is along Z of
/// the plane, and without a tool length Z would be that of the nose.
void Machine::check_tilted_move(const Target& target, const Cause& cause) const {
  if (!is_tilted_ || has_tip_length_mode()) return;
  const int x = joint(0), y = joint(1), z = joint(2);
  if (!target.has(x) && !target.has(y) && !target.has(z)) return;
  const Eigen::Vector3d tool = chain(cause).tool_in_workpiece(canon_.position()).linear().col(2);
  const Eigen::Vector3d plane_normal = rotation_->col(2);
  const double inclination = std::atan2(tool.cross(plane_normal).norm(), tool.dot(plane_normal));
  if (inclination > max_inclination)
    throw_input_error(cause,
                      "G53.1 or rotary words that align the tool with Z of the plane before X Y Z",
                      fmt::format("a tool inclined by {:.3f} degrees", inclination / units::deg));
  if (target.has(z) && (length_mode_ == 490 || h_ == 0))
    throw_input_error(target.cause(z), "G43 H before a Z word in a tilted plane");
}

namespace {

constexpr double peck_clearance = 0.5;  // mm, parameters 5114 and 5115; reported in a warning
// Bounds the moves of a hole whose Q is far below any chip thickness.
constexpr double max_pecks = 1e5;

// Steps of a hole: p pecks, b feed to the bottom, d dwell, r and R rapid and feed to R, c rapid to
// the level of G98 or G99, i rapid to the initial level under G98, x and X the tool shifted and
// back, s spindle stop, o spindle as before, t v T spindle as the thread needs it on the way down,
// up and after it.
constexpr gcode::CodeLetters hole_steps[] = {
    {730, "rpbri"},  {740, "rtbdvRTi"},     {760, "rbdsxcXo"}, {810, "rbri"},
    {820, "rbdri"},  {830, "rpbri"},        {840, "rtbdvRTi"}, {850, "rbRi"},
    {860, "rbsroi"}, {870, "sxrXobdsxcXo"}, {890, "rbdRi"}};

bool is_tap(int code) { return code == 740 || code == 840; }
bool is_peck(int code) { return code == 730 || code == 830; }
bool shifts_tool(int code) { return code == 760 || code == 870; }
bool dwells(int code) { return is_tap(code) || shifts_tool(code) || code == 820 || code == 890; }

}  // namespace

void Machine::move_to_level(double level, bool rapid) {
  cycle_.position[joint(2)] = level;
  const AxisVector placed = canon_.placed(cycle_.position);
  AxisVector end = canon_.position();  // a spindle among the joints keeps turning
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0) end[j] = placed[j];
  canon_.straight({.end = std::move(end), .cause = cycle_.cause}, rapid);
}

/// Reads the words of a cycle. Words that a block does not state keep their values.
void Machine::read_cycle_words(const Block& block) {
  const int z = joint(2);
  const Word &r = block['R'], &bottom = block['Z'], &q = block['Q'], &p = block['P'];
  if (!cycle_.has_begun) {
    if (!r || !bottom)
      throw_input_error(cycle_.cause, "Z and R in the first block of a cycle", "none");
    cycle_.initial = canon_.programmed()[z];
  }
  // Under G91 R counts from the initial level and Z from R.
  if (r) cycle_.r = length(r) + (is_incremental_ ? cycle_.initial : 0.0);
  if (bottom) cycle_.bottom = length(bottom) + (is_incremental_ ? cycle_.r : 0.0);
  if (q && !is_peck(cycle_code_) && !shifts_tool(cycle_code_))
    throw_input_error(
        q, is_tap(cycle_code_) ? "no Q: peck tapping is not supported" : "no Q in this cycle");
  // The control ignores the sign of Q.
  if (q) cycle_.q = std::abs(length(q));
  if ((is_peck(cycle_code_) || shifts_tool(cycle_code_)) && !(cycle_.q > 0))
    throw_input_error(q ? Cause(q) : cycle_.cause, "Q greater than zero");
  if (p && !dwells(cycle_code_)) throw_input_error(p, "no P in this cycle");
  // P is in milliseconds.
  if (p) cycle_.dwell_s = whole_number(canon_, p, 99'999'999) * 1e-3;
  warn_low_start();
  const bool from_behind = cycle_code_ == 870;
  if (from_behind && returns_to_r_) throw_input_error(cycle_.cause, "G98 with G87");
  if (from_behind ? cycle_.bottom < cycle_.r : cycle_.r < cycle_.bottom)
    throw_input_error(
        r ? Cause(r) : cycle_.cause,
        from_behind ? "the end of the bore above R" : "R above the bottom of the hole",
        fmt::format("R at {} mm, the bottom at {} mm", cycle_.r, cycle_.bottom));
  const int direction = canon_.spindle_direction();
  const int expected_direction = cycle_code_ == 740 ? -1 : 1;
  // Tapping needs the spindle direction of the thread; under M29 (rigid) the control sets it
  // itself.
  if (is_tap(cycle_code_) && !is_rigid_tapping_ && direction != expected_direction)
    throw_input_error(cycle_.cause, fmt::format("M{} or M29 before G{}",
                                                expected_direction > 0 ? 3 : 4, cycle_code_ / 10));
  if ((cycle_code_ == 860 || shifts_tool(cycle_code_)) && direction == 0)
    throw_input_error(cycle_.cause, "a running spindle before the cycle");
  cycle_.has_begun = true;
}

/// Warns of a cycle that begins below R. Under G98 its last operation returns to the Z of its
/// start, even if R is above it (Haas VF operator's manual 96-8000, page 182: the six operations of
/// a canned cycle). LinuxCNC stays at R in that case.
void Machine::warn_low_start() {
  if (returns_to_r_ || cycle_code_ == 870 || !(cycle_.initial < cycle_.r)) return;
  run_.warn_once(
      "a cycle starts below its R: under G98 the tool returns down to its initial level at rapid "
      "and goes to the next hole at that level");
}

void Machine::execute_cycle(const Block& block) {
  cycle_.cause = motion_cause(block);
  if (compensation_.is_on()) throw_input_error(cycle_.cause, "G40 before a canned cycle");
  if (canon_.feed_mode() == FeedMode::InverseTime)
    throw_input_error(cycle_.cause, "G94 or G95 with a cycle");
  if (plane_ != 17)
    throw_input_error(cycle_.cause,
                      "G17 with a cycle: in other planes the drilling axis depends on a parameter");
  if (has_tip_length_mode())
    throw_input_error(cycle_.cause, "G43 with a cycle, in a tilted plane if one is needed");
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) throw_input_error(cycle_.cause, "a machine with X Y Z for a canned cycle");
  // A cycle whose definition has an error is not reported again for each hole.
  if (!cycle_.has_begun && !block[Group::Cycle]) run_.require_certain("cycle", cycle_.cause);
  run_.define("cycle", [&] { read_cycle_words(block); });
  has_moved_ = true;
  compensation_.clear_leaving();
  make_holes(block);
}

/// Makes the holes of a block. K or L is their number; with 0 the words are only stored.
void Machine::make_holes(const Block& block) {
  const Word& repeat_word = block['K'] ? block['K'] : block['L'];
  if (block['K'] && block['L']) throw_input_error(block['L'], "either K or L");
  const int hole_count = repeat_word ? whole_number(canon_, repeat_word, 1'000'000) : 1;
  // Moves of a hole: to its position, to R, to the bottom, back; each peck adds up to three.
  constexpr double moves_per_hole = 4.0, moves_per_peck = 3.0;  // at most
  const double pecks = is_peck(cycle_code_) ? std::abs(cycle_.r - cycle_.bottom) / cycle_.q : 0.0;
  run_.check_moves(hole_count * (moves_per_hole + moves_per_peck * pecks), cycle_.cause);
  for (int i = 0; i < hole_count; ++i) {
    run_.count_block();
    Target target = block_target(block, false);
    const int z = joint(2);
    // The tool moves to the position of a hole at the current Z.
    target.by(z, 0.0, cycle_.cause);
    check_tilted_move(target, cycle_.cause);
    AxisVector end = canon_.end_of(target);
    canon_.straight({.end = end, .cause = cycle_.cause, .stated = target.stated()}, true);
    make_hole(canon_.without_offsets(end));
  }
}

/// Shifts the tool across the hole by Q along +X; parameter 5148 may state another direction.
void Machine::shift_tool(double distance) {
  run_.warn_once(
      "G76 and G87 shift the tool along +X (5101.4 RD1, 5101.5 RD2 and 5148 may say otherwise)");
  cycle_.position[joint(0)] += distance;
  move_to_level(cycle_.position[joint(2)], true);
}

void Machine::make_pecks() {
  run_.warn_once(fmt::format(
      "the peck clearance in G73 and G83 is taken to be {} mm (parameters 5114 and 5115)",
      peck_clearance));
  if ((cycle_.r - cycle_.bottom) / cycle_.q > max_pecks)
    throw_input_error(cycle_.cause, "at most 1e5 pecks in a hole", "more");
  for (int hole_count = 1;; ++hole_count) {
    const double depth = cycle_.r - hole_count * cycle_.q;
    if (!(depth > cycle_.bottom)) return;
    move_to_level(depth, false);
    // G83 clears the chips at R; G73 only breaks them by the clearance.
    if (cycle_code_ == 830) move_to_level(cycle_.r, true);
    move_to_level(std::min(cycle_.r, depth + peck_clearance), true);
  }
}

/// Makes one hole, starting above its position.
void Machine::make_hole(const AxisVector& position) {
  cycle_.position = position;
  const int direction = canon_.spindle_direction(), thread = cycle_code_ == 740 ? -1 : 1;
  for (const char step : gcode::letters_of_code(hole_steps, cycle_code_)) {
    if (step == 'p') make_pecks();
    if (step == 'b') move_to_level(cycle_.bottom, false);
    if (step == 'd') canon_.dwell(cycle_.dwell_s, cycle_.cause);
    if (step == 'r' || step == 'R') move_to_level(cycle_.r, step == 'r');
    if (step == 'c') move_to_level(returns_to_r_ ? cycle_.r : cycle_.initial, true);
    if (step == 'i' && !returns_to_r_ && cycle_.initial != cycle_.r)
      move_to_level(cycle_.initial, true);
    if (step == 'x' || step == 'X') shift_tool(step == 'x' ? cycle_.q : -cycle_.q);
    if (step == 's') canon_.turn_spindle(0);
    if (step == 'o') canon_.turn_spindle(direction);
    if (step == 't') canon_.turn_spindle(thread);
    if (step == 'v') canon_.turn_spindle(-thread);
    // Rigid tapping leaves the spindle at rest.
    if (step == 'T') canon_.turn_spindle(is_rigid_tapping_ ? 0 : thread);
  }
}

}  // namespace abbe::sim::dialects::fanuc
