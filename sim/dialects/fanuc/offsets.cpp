#include "sim/dialects/fanuc/fanuc.h"

namespace abbe::sim::dialects::fanuc {

namespace {
// Limits of the control's memory.
constexpr int max_additional_offset = 300;  // G54.1 P
constexpr int max_offset_index = 999;       // D and H
constexpr double length_tolerance = 1e-9;   // mm, rounding of a length converted from inches
constexpr double zero_tolerance = 1e-6;     // mm, below anything that a scene states
// 1 - cos(tilt) of a rotation about the normal of the plane; equals a tilt of 1.4e-7 rad
constexpr double plane_tolerance = 1e-14;
}  // namespace

const AxisVector& Machine::work_offset(int number) const {
  const auto entry = systems_.find(number);
  return entry == systems_.end() ? zero_offset_ : entry->second;
}

// Offsets of a Fanuc add up in this order: external, G54 to G59, G92, G52.
AxisVector Machine::total_offset() const { return external_ + work_offset(system_) + g92_ + g52_; }

/// Sets the frame: a rotation about the centre of G68 or into the plane of G68.2, then a shift.
void Machine::apply_frame() {
  program::Frame frame{total_offset(), rotation_};
  if (rotation_) {
    // A rotation about a centre leaves that centre fixed, which adds a shift.
    const Eigen::Vector3d centre_shift =
        is_tilted_ ? centre_ : Eigen::Vector3d(centre_ - *rotation_ * centre_);
    for (int k = 0; k < 3; ++k) frame.shift[joint(k)] += centre_shift[k];
  }
  canon_.set_frame(system_ - 1, std::move(frame));
}

/// Throws BadInput in a rotated system and during cutter compensation, where a change of the
/// coordinate system would be ambiguous.
void Machine::check_frame_change(const Cause& cause) const {
  if (rotation_) throw_input_error(cause, "G69 before " + shown(cause.text));
  if (compensation_.is_on()) throw_input_error(cause, "G40 before " + shown(cause.text));
}

void Machine::select_work_offset(const Block& block) {
  const Code& code = block[Group::WorkOffset];
  const Word& p = block['P'];
  // G54 to G59 are systems 1 to 6; G54.1 Pn, also written G54 Pn, is 100 + n.
  int number = (code.tenths - 530) / 10;
  if (code.tenths == 541 || (code.tenths == 540 && p)) {
    if (!p) throw_input_error(code.word, "P (number of the coordinate system) with G54.1", "none");
    number = whole_number(canon_, p, max_additional_offset);
    if (number < 1) throw_input_error(p, "a coordinate system from P1 to P300");
    number += 100;
  }
  // Repeating the system in force is allowed anywhere, because it changes nothing.
  if (number == system_) return;
  check_frame_change(code.word);
  system_ = number;
  apply_frame();
}

void Machine::set_rotation(const Block& block) {
  const Code& code = block[Group::Rotation];
  if (code.tenths == 690) {
    rotation_.reset();
    is_tilted_ = false;
    apply_frame();
    // The end of G68.2 also ends the tip coordinates it needs.
    apply_length(code.word);
    return move(block);
  }
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0)
      throw_input_error(code.word, "a machine with X Y Z for " + shown(code.word.text));
  if (rotation_) throw_input_error(code.word, "G69 before another " + shown(code.word.text));
  if (cycle_code_ != 800) throw_input_error(code.word, "G80 before " + shown(code.word.text));
  if (code.tenths == 682) return set_tilted_plane(block);
  for (const char letter : {'I', 'J', 'K'})
    if (block[letter])
      throw_input_error(block[letter], "G68.2 for a coordinate system rotated in space");
  const Word& r = block['R'];
  if (!r) throw_input_error(code.word, "R (angle) with G68", "none");
  const std::string_view plane = plane_letters();
  // A centre coordinate that is not programmed is the current position.
  const AxisVector current = canon_.programmed();
  for (int k = 0; k < 3; ++k) {
    const char letter = axis_letters[std::size_t(k)];
    const bool is_in_plane = plane.find(letter) != std::string_view::npos;
    if (block[letter] && !is_in_plane)
      throw_input_error(block[letter], "a centre in the plane with G68");
    centre_[k] = !is_in_plane ? 0.0 : block[letter] ? length(block[letter]) : current[joint(k)];
  }
  Eigen::Vector3d normal_axis = Eigen::Vector3d::Zero();
  normal_axis[plane_normal()] = 1.0;
  rotation_ = Eigen::AngleAxisd(angle_in_degrees(r) * units::deg, normal_axis).toRotationMatrix();
  apply_frame();
}

void Machine::store_origin(const Block& block, bool additional) {
  const Code& code = block[Group::OneShot];
  const Word& p = block['P'];
  if (!p) throw_input_error(code.word, "P (coordinate system) with G10", "none");
  const int number = whole_number(canon_, p, additional ? max_additional_offset : 6);
  if (additional && number < 1) throw_input_error(p, "a coordinate system from P1 to P300");
  if (block['R']) throw_input_error(block['R'], "axis words with G10 L2 and L20");
  check_frame_change(code.word);
  AxisVector& origin =
      // P0 of L2 is the external offset, which shifts all systems.
      !additional && number == 0
          ? external_
          : systems_.try_emplace(additional ? 100 + number : number, zero_offset_).first->second;
  for (const auto& [j, word, is_incremental] : axis_words(block))
    origin[j] = axis_word_value(j, *word) + (is_incremental_ || is_incremental ? origin[j] : 0.0);
  apply_frame();
}

void Machine::store_tool(const Block& block, int kind) {
  const Code& code = block[Group::OneShot];
  const Word &p = block['P'], &r = block['R'];
  if (!p || !r)
    throw_input_error(code.word, "P (number) and R (value) with G10 for a tool",
                      "only one of them");
  if (const Word* axis = first_axis_word(block)) throw_input_error(*axis, "R with G10 for a tool");
  const int number = whole_number(canon_, p, max_offset_index);
  if (number < 1) throw_input_error(p, "an offset from P1 to P999");
  OffsetEntry& offset_entry = kind < 12 ? lengths_[number] : radii_[number];
  // L10 and L12 are geometry, L11 and L13 wear.
  const double previous_value =
      kind % 2 == 0 ? offset_entry.value.value_or(0.0) : offset_entry.wear;
  const double value = length(r) + (is_incremental_ ? previous_value : 0.0);
  if (kind % 2 == 0)
    offset_entry.value = value;
  else
    offset_entry.wear = value;
}

void Machine::store_data(const Block& block) {
  const Word& l = block['L'];
  // On a turning control G10 without L sets wear.
  if (is_turning_ && !(l && (l.value == 2.0 || l.value == 20.0))) return store_wear(block);
  const int kind = l ? whole_number(canon_, l, 999) : -1;
  if (kind == 2 || kind == 20) return store_origin(block, kind == 20);
  if (kind >= 10 && kind <= 13) return store_tool(block, kind);
  throw_input_error(l ? Cause(l) : Cause(block[Group::OneShot].word),
                    "L2 L20 L10 L11 L12 or L13 with G10", l ? shown(l.text) : "none");
}

/// Executes G52, G92 and G92.1, or on a turning control G52, G50 and G50.3.
void Machine::shift_origin(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Words words = axis_words(block);
  if (words.empty()) {
    // G92 S and G50 S limit the spindle speed and are handled in `set_spindle`.
    if ((code.tenths == 920 || code.tenths == 500) && block['S']) return;
    throw_input_error(code.word, "an axis word with " + shown(code.word.text), "none");
  }
  check_frame_change(code.word);
  if (code.tenths == 920 && has_tip_length_mode()) throw_input_error(code.word, "G49 before G92");
  const AxisVector current = canon_.programmed();
  for (const auto& [j, word, is_incremental] : words) {
    const bool sets_position = code.tenths == 920 || code.tenths == 500;
    const double value = axis_word_value(j, *word);
    if (is_incremental && !sets_position)
      throw_input_error(*word, "X Y Z C with " + shown(code.word.text));
    if (sets_position)
      // G92 gives the current position the programmed values, so the difference is the shift. An
      // increment (U, W) moves the zero by its value.
      g92_[j] += is_incremental ? -value : current[j] - value;
    else
      g52_[j] = code.tenths == 520 ? value : 0.0;
    if (code.tenths == 921 || code.tenths == 503) g92_[j] = 0.0;
  }
  apply_frame();
}

double Machine::tool_length(int h, const Cause& cause) const {
  if (h == 0) return 0.0;
  if (const auto entry = lengths_.find(h); entry != lengths_.end() && entry->second.value)
    return *entry->second.value + entry->second.wear;
  auto known = lengths_ | std::views::filter([](const auto& entry) -> bool {
                 return entry.second.value.has_value();
               });
  throw_input_error(cause, "a known tool length (" + known_numbers(known, "H") + ")",
                    fmt::format("H{}", h));
}

void Machine::set_tool_length(const Block& block) {
  const Code& code = block[Group::ToolLength];
  const Word& h = block['H'];
  if (h) {
    h_ = whole_number(canon_, h, max_offset_index);
    is_h_stated_ = true;
  }
  if (!code && length_mode_ == 490) return;
  const Cause cause = code ? Cause(code.word) : Cause(h);
  if (compensation_.is_on())
    throw_input_error(cause, "no change of the tool length under G41 or G42");
  if (code) length_mode_ = code.tenths;
  if (length_mode_ == 490) h_ = 0, is_h_stated_ = false;
  // Without a stated H the only tool of the scene is assumed.
  if ((length_mode_ == 430 || length_mode_ == 440) && !is_h_stated_) {
    h_ = run_.assume_only_tool(cause, "no H with " + shown(code.word.text));
    is_h_stated_ = true;
  }
  const int z = joint(2);
  if (z < 0) throw_input_error(cause, "a machine with a Z axis");
  const auto z_shift = [&] {
    const AxisVector& shift = canon_.tool_shift();
    return shift.size() > 0 ? shift[z] : 0.0;
  };
  const double previous_shift = z_shift();
  const bool was_tip_mode = canon_.tip_mode();
  apply_length(cause);
  const double change = z_shift() - previous_shift;
  // A Z word in the block moves the tip to its programmed position with either parameter.
  if (change == 0.0 || was_tip_mode || canon_.tip_mode() || block['Z']) return;
  // G49 at the start position of Z is the usual safety block of a program, so it is not reported.
  const double reference = program::initial_position(canon_.options())[z];
  if (length_mode_ == 490 && canon_.position()[z] == reference) return;
  run_.warn_once(
      "changing the tool length without a Z word moves nothing (parameter 5006.6 TOS = 1); a "
      "control with TOS = 0 moves Z by it");
}

/// Puts the tool length in force: as a shift of Z, or by the chain that computes the tip.
void Machine::apply_length(const Cause& cause) {
  const bool has_length = length_mode_ != 490 && h_ != 0;
  const int h = has_length ? h_ : -1;
  const double length_mm = has_length ? tool_length(h, cause) : 0.0;
  if (!is_tilted_ && !has_tip_length_mode()) {
    AxisVector shift;
    if (has_length) {
      shift = zero_offset_;
      shift[joint(2)] = length_mode_ == 440 ? -length_mm : length_mm;
    }
    canon_.select_length(h, cause);
    canon_.set_tool_shift(std::move(shift));
    canon_.set_tip_mode(false, cause);
    had_axis_length_ = had_axis_length_ || has_length;
    return compare_zero_points(cause);
  }
  if (length_mode_ == 440) throw_input_error(cause, "G43 for a tool length in a tilted plane");
  if (has_tip_length_mode() && !has_length)
    throw_input_error(cause, "H (tool length) with G43.4 and G43.5", "none");
  const auto& scene_lengths = canon_.options().tool_length;
  // The chain has the length of the scene's tool; another length would need another chain.
  const auto scene_length = scene_lengths.find(h);
  if (has_length && (scene_length == scene_lengths.end() ||
                     std::abs(scene_length->second - length_mm) > length_tolerance))
    throw_input_error(cause,
                      "the tool length of the scene: the tip is computed from that kinematic "
                      "chain, and G10 does not change it",
                      fmt::format("{} mm", length_mm));
  const bool has_tool_chain = canon_.options().control_by_h.contains(tool_);
  canon_.set_tool_shift({});
  canon_.select_length(has_length ? h : has_tool_chain ? tool_ : -1, cause);
  // Only the begin of G43.4 depends on the position of the table.
  const bool is_begin = !canon_.tip_mode();
  canon_.set_tip_mode(true, cause);
  if (is_begin && has_tip_length_mode()) warn_of_rotated_table(cause);
  had_tip_length_ = had_tip_length_ || has_length;
  compare_zero_points(cause);
}

/// Warns if G43.4 begins with a rotated table. With parameter 19696.5 WKP = 0, X Y Z count in the
/// workpiece coordinate system as it lies over the table at that block (FANUC A-79348E,
/// "Explanation"), so an earlier rotation of the table is not included. Here they count in the
/// workpiece with the table at zero.
void Machine::warn_of_rotated_table(const Cause& cause) {
  constexpr double position_tolerance = 1e-6;  // rad, rounding of a position
  const AxisVector offsets = total_offset();
  std::string tables;
  for (const kinematics::Joint& joint : chain(cause).joints()) {
    const int j = canon_.joint_of(joint.name);
    if (j < 0 || joint.side != kinematics::Side::Workpiece ||
        joint.motion != kinematics::Motion::Rotary)
      continue;
    const double angle = canon_.position()[j] - offsets[j];
    if (std::abs(std::remainder(angle, 2 * pi)) > position_tolerance)
      tables +=
          fmt::format("{}{}{:.6g}", tables.empty() ? "" : " ", joint.name, angle / units::deg);
  }
  if (tables.empty()) return;
  run_.warn_once(
      fmt::format("{} on line {} starts with the table rotated ({}): X Y Z are counted in the "
                  "workpiece with its table at zero; a control with parameter 19696.5 WKP = 0 "
                  "counts in the coordinate system as it is on the table at that moment",
                  length_mode_ == 435 ? "G43.5" : "G43.4", canon_.line(), tables));
}

/// Warns if words count from different points under G43 and G43.4, which they do not on a control.
/// Here they do if the scene states no offset, or a tool length other than that of the chain.
void Machine::compare_zero_points(const Cause& cause) {
  if (!had_axis_length_ || !had_tip_length_ || length_mode_ == 490 || h_ == 0) return;
  AxisVector axes = total_offset();
  const int n = int(axes.size());
  // Both must agree with the rotary axes at zero.
  for (int j = 0; j < n; ++j)
    if (!canon_.is_linear(j)) axes[j] = 0.0;
  const Eigen::Vector3d tip_position(axes[joint(0)], axes[joint(1)], axes[joint(2)]);
  const Eigen::Vector3d zero_shift =
      program::offset_correction(canon_.zero(), program::Coordinates::Axis);
  for (int k = 0; k < 3; ++k) axes[joint(k)] += zero_shift[k];
  axes[joint(2)] += tool_length(h_, cause);
  const Eigen::Vector3d difference =
      chain(cause).tool_in_workpiece(axes).translation() - tip_position;
  if (difference.norm() <= zero_tolerance) return;
  run_.warn_once(fmt::format(
      "with the rotary axes at zero, X Y Z under G43 H{} lead to a point {:.6g} {:.6g} {:.6g} mm "
      "away from the one under G43.4 and G68.2: tool_length_mm of the program does not match, or "
      "the position of the spindle nose with the axes at zero",
      h_, difference.x(), difference.y(), difference.z()));
}

void Machine::set_compensation(const Block& block) {
  const Code& code = block[Group::CutterRadius];
  if (const Word& d = block['D']) {
    const int number = whole_number(canon_, d, max_offset_index);
    // Another radius in the middle of a contour would leave the transition undefined.
    if (compensation_.is_on() && number != d_ && code.tenths != 400)
      throw_input_error(d, "G40 before another D");
    d_ = number;
    is_d_stated_ = true;
  }
  if (!code) return;
  cutter_code_ = code.tenths;
  if (code.tenths == 400) return compensation_.end();
  if (compensation_.is_on()) {
    if (code.tenths == start_side_) return;  // postprocessors repeat the code
    throw_input_error(code.word, "G40 between G41 and G42");
  }
  if (!is_d_stated_) {
    d_ = run_.assume_only_tool(code.word, "no D with G41 and G42");
    is_d_stated_ = true;
  }
  const std::array<int, 2> joints = plane_joints(code.word);
  // Under G43.4 the plane of compensation would rotate with the table.
  if (has_tip_length_mode()) throw_input_error(code.word, "G40 with G43.4 and G43.5");
  if (rotation_ && (*rotation_)(plane_normal(), plane_normal()) < 1.0 - plane_tolerance)
    throw_input_error(
        code.word,
        "contours compensated in advance in a tilted plane: G41 and G42 are not supported there");
  const auto entry = radii_.find(d_);
  const bool has_radius = entry != radii_.end() && entry->second.value;
  if (!has_radius && d_ != 0)
    throw_input_error(block['D'] ? Cause(block['D']) : Cause(code.word),
                      "a tool with a known radius", fmt::format("D{}", d_));
  // D0 is a radius of zero.
  const double radius = has_radius ? *entry->second.value + entry->second.wear : 0.0;
  run_.warn_once(
      "cutter compensation ends its first move perpendicular to the start of the next (type A, "
      "parameter 5003.0 "
      "SUP = 0) and goes around outside corners in arcs (19607.2 CCC = 1): with type B a control "
      "enters an outside corner differently, with CCC = 0 it goes around in lines");
  start_side_ = code.tenths;
  compensation_.begin(code.tenths == 410, radius, joints);
}

namespace {

/// Returns the index of a variable among `count` numbers from `first` on, or -1.
int index_in_range(int number, int first, int count) {
  return number >= first && number < first + count ? number - first : -1;
}

}  // namespace

void Machine::note_numbers(int sequence, int program) {
  if (sequence >= 0) sequence_ = sequence;
  program_ = program;
}

/// Returns the joint of the k-th axis as the control counts axes: X Y Z, then the others by letter.
/// Returns -1 beyond the last axis.
int Machine::joint_of_index(int k) const {
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0 && k-- == 0) return j;
  return -1;
}

/// Returns a position in program units: mm or inch, degrees, and X as a diameter if X words are.
double Machine::program_value(int j, const AxisVector& q) const {
  if (j < 0 || q.size() == 0) return 0.0;
  if (has_diameters_ && j == joint(0)) return 2.0 * q[j] / unit();
  return canon_.is_linear(j) ? q[j] / unit() : q[j] / units::deg;
}

/// Returns a mode or a word in force, #4001 and following.
std::optional<double> Machine::modal_variable(int number) const {
  const FeedMode feed = canon_.feed_mode();
  const double feed_code = is_turning_                     ? (feed == FeedMode::PerMinute ? 98 : 99)
                           : feed == FeedMode::InverseTime ? 93
                           : feed == FeedMode::PerMinute   ? 94
                                                           : 95;
  const std::pair<int, double> variables[] = {
      {4001, motion_ / 10},
      {4002, plane_},
      {4003, is_incremental_ ? 91 : 90},
      {4005, feed_code},
      {4006, canon_.inch() ? 20 : 21},
      {4007, cutter_code_ / 10},
      {4008, length_mode_ / 10.0},  // G43.4 reads as 43.4
      {4009, cycle_code_ / 10},
      {4010, returns_to_r_ ? 99 : 98},
      {4013, has_surface_speed_ ? 96 : 97},
      {4014, system_ <= 6 ? 53.0 + system_ : 54.1},
      {4015, 64},
      {4016, !rotation_   ? 69.0
             : is_tilted_ ? 68.2
                          : 68.0},
      {4017, polar_.is_on ? 16 : 15},
      {4107, d_},
      {4109, canon_.feed() ? canon_.feed()->word : 0.0},
      {4111, h_},
      {4113, last_m_},
      {4114, sequence_},
      {4115, program_},
      {4119, speed_word_},
      {4120, std::max(preselected_tool_, 0)},
      {4130, system_ > 6 ? system_ - 100 : 0},
  };
  for (const auto& [variable, value] : variables)
    if (variable == number) return value;
  return std::nullopt;
}

/// Returns the tool offset that a variable holds, in the layout of memory C.
Machine::OffsetVariable Machine::offset_variable(int number) {
  if (is_turning_) return {};  // a turning control has other numbers for them
  const struct {
    int first, count;
    Offsets* offsets;
    bool is_wear;
  } ranges[] = {{2001, 200, &lengths_, true},  {2201, 200, &lengths_, false},
                {10001, 999, &lengths_, true}, {11001, 999, &lengths_, false},
                {12001, 999, &radii_, true},   {13001, 999, &radii_, false}};
  for (const auto& range : ranges)
    if (const int i = index_in_range(number, range.first, range.count); i >= 0)
      return {range.offsets, i + 1, range.is_wear};
  return {};
}

/// Returns the coordinate system and the axis of a variable, or null if it is none. Each system has
/// 20 numbers: from #5201 on the external offset and G54 to G59, from #7001 on G54.1 P1 to P48.
Machine::OriginVariable Machine::origin_variable(int number) {
  if (const int i = index_in_range(number, 5201, 140); i >= 0 && i % 20 < 9) {
    AxisVector* origin =
        i / 20 == 0 ? &external_ : &systems_.try_emplace(i / 20, zero_offset_).first->second;
    return {origin, i % 20};
  }
  if (const int i = index_in_range(number, 7001, 960); i >= 0 && i % 20 < 9) {
    return {&systems_.try_emplace(101 + i / 20, zero_offset_).first->second, i % 20};
  }
  return {};
}

std::optional<double> Machine::variable(int number) {
  if (const OffsetVariable variable = offset_variable(number); variable.offsets != nullptr) {
    const auto entry = variable.offsets->find(variable.number);
    if (entry == variable.offsets->end()) return 0.0;
    return (variable.is_wear ? entry->second.wear : entry->second.value.value_or(0.0)) / unit();
  }
  if (const OriginVariable variable = origin_variable(number); variable.origin != nullptr)
    return program_value(joint_of_index(variable.axis), *variable.origin);
  if (const auto value = modal_variable(number)) return value;
  // Under compensation a program reads the programmed position, not that of the offset tool.
  if (const int i = index_in_range(number, 5001, 9); i >= 0)
    return program_value(joint_of_index(i), programmed_position());
  // #5041: position with tool length; #5021: machine coordinates.
  if (const int i = index_in_range(number, 5041, 9); i >= 0) {
    AxisVector with_length = canon_.without_offsets(canon_.position());
    if (canon_.tool_shift().size() > 0) with_length += canon_.tool_shift();
    return program_value(joint_of_index(i), with_length);
  }
  if (const int i = index_in_range(number, 5021, 9); i >= 0) {
    const program::Coordinates coordinates = canon_.coordinates();
    canon_.go_to(program::Coordinates::Axis, {1, {}});
    const double value = program_value(joint_of_index(i), canon_.position());
    canon_.go_to(coordinates, {1, {}});
    return value;
  }
  if (const int i = index_in_range(number, 5081, 9); i >= 0)
    return program_value(joint_of_index(i), canon_.tool_shift());
  // #3003 and #3004 suppress single block and feed hold, which a virtual control does not have.
  if (number == 3003 || number == 3004) return 0.0;
  return std::nullopt;
}

bool Machine::set_variable(int number, double value) {
  if (number == 3003 || number == 3004 || number == 3006) return true;
  if (const OffsetVariable variable = offset_variable(number); variable.offsets != nullptr) {
    OffsetEntry& offset_entry = (*variable.offsets)[variable.number];
    if (variable.is_wear)
      offset_entry.wear = value * unit();
    else
      offset_entry.value = value * unit();
    return true;
  }
  const OriginVariable variable = origin_variable(number);
  const int j = joint_of_index(variable.axis);
  // A change of the system in a rotated frame or under compensation is ambiguous, as for G10.
  if (variable.origin == nullptr || j < 0 || rotation_ || compensation_.is_on()) return false;
  const double scale = has_diameters_ && j == joint(0) ? 0.5 : 1.0;
  (*variable.origin)[j] = scale * value * (canon_.is_linear(j) ? unit() : units::deg);
  apply_frame();
  return true;
}

}  // namespace abbe::sim::dialects::fanuc
