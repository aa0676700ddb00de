#include "sim/dialects/linuxcnc/linuxcnc.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

// Returns true for A B C, which are in degrees.
bool is_rotary(int k) { return k >= 3 && k <= 5; }

// Returns the first parameter of a coordinate system. From #5221 on each system has 20.
std::size_t first_parameter(int number) { return 5221 + 20 * std::size_t(number - 1); }

}  // namespace

double Machine::programmed(int k) const {
  const int j = joint(k);
  if (j < 0) return 0.0;
  const AxisVector p = canon_.programmed();
  return canon_.is_linear(j) ? p[j] : p[j] / units::deg;
}

double Machine::axis_position(int k) const {
  const int j = joint(k);
  if (j < 0) return 0.0;
  return canon_.is_linear(j) ? canon_.position()[j] : canon_.position()[j] / units::deg;
}

double Machine::position_from_zero(int k) const {
  return axis_position(k) - (k < 3 ? canon_.shift_correction()[k] : 0.0);
}

program::Frame system_frame(const program::Canon& canon, std::span<const double> origin,
                            std::span<const double> shift, double rotation, const Cause& cause) {
  program::Frame frame;
  frame.shift = AxisVector::Zero(canon.position().size());
  // The shift of G92 is within the rotation, so it is rotated too.
  Eigen::Vector3d xyz(shift[0], shift[1], shift[2]);
  if (rotation != 0.0) {
    for (const char letter : {'X', 'Y', 'Z'})
      if (canon.joint_of(letter) < 0)
        canon.throw_input_error(cause, "a machine with X Y Z for a rotated coordinate system");
    frame.rotation = Eigen::AngleAxisd(rotation, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    xyz = *frame.rotation * Eigen::Vector3d(xyz);
  }
  for (std::size_t k = 0; k < shift.size(); ++k)
    if (const int j = canon.joint_of(axis_letters[k]); j >= 0)
      frame.shift[j] = (origin[k] + (k < 3 ? xyz[Eigen::Index(k)] : shift[k])) *
                       (canon.is_linear(j) ? 1.0 : units::deg);
  return frame;
}

/// Sets the frame. Offsets of the scene alone keep their bits.
void Machine::apply_frame() {
  const bool has_shift = std::any_of(g92_.begin(), g92_.end(), [](double v) { return v != 0.0; });
  const bool is_of_scene = !system_changed_[std::size_t(system_ - 1)] && !has_shift;
  canon_.set_frame(system_ - 1,
                   is_of_scene ? program::Frame{program::work_offset(canon_.options(), system_)}
                               : system_frame(canon_, std::span(origin_).first<9>(), g92_,
                                              origin_[9] * units::deg, {1, {}}));
}

/// Selects a coordinate system. As in rs274 the system in force does not reload its parameters.
void Machine::select_work_offset(int number) {
  if (number != system_) load_origin(number);
  parameters_[5220] = number;
  apply_frame();
}

void Machine::load_origin(int number) {
  system_ = number;
  std::copy_n(parameters_.begin() + std::ptrdiff_t(first_parameter(number)), origin_.size(),
              origin_.begin());
}

double Machine::tool_length(int tool, const Cause& cause) const {
  if (const auto length = find_value(length_, tool)) return *length;
  if (tool == 0) return 0.0;
  // Usually the tool table lacks an entry, so the message lists the known ones.
  throw_input_error(cause, "a known tool length (" + known_numbers(length_, "H") + ")");
}

void Machine::set_tool_length(const Block& block) {
  const Code& code = block[Group::ToolLength];
  if (compensation_.is_on())
    throw_input_error(code.word, "no change of the tool length under G41 or G42");
  const Word& h = block['H'];
  if (h && (h.value < 0 || h.value != std::floor(h.value) || h.value > 1e9))
    throw_input_error(h, "an integer tool number after H");
  if (code.tenths == 490) {
    length_shift_ = {};
    has_tip_length_ = false;
    canon_.select_length(-1, code.word);
    return apply_length(code.word);
  }
  AxisVector shift = AxisVector::Zero(canon_.position().size());
  // G43.1 states the offset in the block instead of the table.
  if (code.tenths == 431) {
    for (int k = 0; k < 9; ++k)
      if (const Word& word = block[axis_letters[std::size_t(k)]])
        shift[joint(k)] = axis_word(k, word) * (canon_.is_linear(joint(k)) ? 1.0 : units::deg);
    if (!first_axis_word(block)) throw_input_error(code.word, "axis words with G43.1", "none");
    length_shift_ = std::move(shift);
    has_tip_length_ = false;
    return apply_length(code.word);
  }
  const int tool = h            ? int(h.value)
                   : tool_ == 0 ? run_.assume_only_tool(code.word, "no tool called")
                                : tool_;
  if (code.tenths == 432 && !h) throw_input_error(code.word, "H (tool length) with G43.2", "none");
  const double length = tool_length(tool, h ? Cause(h) : Cause(code.word));
  const int z = joint(2);
  if (code.tenths != 434) {
    if (z < 0) throw_input_error(code.word, "a machine with a Z axis");
    // G43.2 adds to the offset in force.
    if (code.tenths == 432 && length_shift_.size() > 0) shift = length_shift_;
    const kinematics::Chain* to_tip = chain_to_tip(canon_.options(), tool);
    // On a turning control the offset of a tool has X and Z.
    if (run_.is_turning() && to_tip != nullptr && tool != 0)
      shift += measured_offset(canon_, *to_tip, code.word);
    else
      shift[z] += length;
  }
  // G43.2 does not change the tool whose tip is led.
  if (code.tenths != 432) canon_.select_length(tool, code.word);
  has_tip_length_ = code.tenths == 434;
  length_shift_ = has_tip_length_ ? AxisVector() : std::move(shift);
  apply_length(code.word);
}

/// Puts the tool length in force: as a shift of the axes, or by the chain to the tip, which must
/// have the same length.
void Machine::apply_length(const Cause& cause) {
  const bool is_tip_mode = has_tip_length_ || has_tip_kinematics_;
  if (!is_tip_mode || length_shift_.size() == 0) {
    canon_.set_tool_shift(is_tip_mode ? AxisVector() : length_shift_);
    return canon_.set_tip_mode(is_tip_mode, cause);
  }
  canon_.set_tip_mode(true, cause);
  canon_.set_tool_shift({});
  constexpr double length_tolerance = 1e-9;  // mm, rounding of a length converted from inches
  const auto zero = program::workpiece_zero(canon_.options());
  const auto tip_w = program::tip_at_zero(canon_.chain());
  // Without a known zero there is nothing to compare.
  if (!zero || !tip_w) return;
  AxisVector difference = length_shift_;
  difference[joint(2)] -= zero->nose_w.z() - tip_w->z();
  if (difference.cwiseAbs().maxCoeff() > length_tolerance)
    throw_input_error(cause,
                      "the tool length of the scene with M428, from which the tip is computed",
                      fmt::format("{:.6g} mm", length_shift_[joint(2)]));
}

void Machine::store_system(const Block& block, int number, bool by_position) {
  const std::size_t first = first_parameter(number);
  const Word& r = block['R'];
  if (r) parameters_[first + 9] = r.value;
  system_changed_[std::size_t(number - 1)] = true;
  NineAxes words{};
  for (int k = 0; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      words[std::size_t(k)] = axis_word(k, word);
  NineAxes origin = words;
  if (by_position) {
    // absolute = R (p + g92) + origin + zero + tool, where p is the programmed value, or the
    // current one for axes that are not programmed.
    const double angle = parameters_[first + 9] * units::deg;
    const double c = std::cos(angle), s = std::sin(angle);
    NineAxes tool{}, difference{};
    for (int k = 0; k < 9; ++k) {
      tool[std::size_t(k)] = tool_shift(k);
      difference[std::size_t(k)] =
          position_from_zero(k) - tool[std::size_t(k)] - parameters_[first + std::size_t(k)];
    }
    const double x = c * difference[0] + s * difference[1] - g92_[0];
    const double y = c * difference[1] - s * difference[0] - g92_[1];
    const double p_x = (block['X'] ? words[0] : x) + g92_[0];
    const double p_y = (block['Y'] ? words[1] : y) + g92_[1];
    origin[0] = position_from_zero(0) - tool[0] - (c * p_x - s * p_y);
    origin[1] = position_from_zero(1) - tool[1] - (s * p_x + c * p_y);
    for (std::size_t k = 2; k < 9; ++k)
      origin[k] = position_from_zero(int(k)) - tool[k] - g92_[k] - words[k];
  }
  // In a rotated system X and Y depend on each other, so both origins change.
  const bool sets_both = by_position && parameters_[first + 9] != 0.0 && (block['X'] || block['Y']);
  for (int k = 0; k < 9; ++k)
    if (block[axis_letters[std::size_t(k)]] || (sets_both && k < 2 && joint(k) >= 0))
      parameters_[first + std::size_t(k)] = origin[std::size_t(k)];
  // A system that is not in force is only stored.
  if (number != system_) return;
  load_origin(number);
  apply_frame();
}

void Machine::store_tool(const Block& block, int kind) {
  const Word& p = block['P'];
  const int tool = int(p.value);
  // A scene's tool has its length along Z only.
  for (const char letter : {'X', 'Y', 'A', 'B', 'C', 'U', 'V', 'W'})
    if (block[letter] && block[letter].value != 0.0)
      throw_input_error(block[letter], "Z and R of a tool: its length lies along Z");
  if (const Word& z = block['Z']) {
    const double word = axis_word(2, z);
    // L11 counts from system 9 (G59.3), L10 from the one in force.
    const std::size_t first = first_parameter(kind == 11 ? 9 : system_);
    length_[tool] = kind == 1 ? word
                              : position_from_zero(2) - word - parameters_[first + 2] -
                                    (kind == 10 ? g92_[2] : 0.0);
  }
  if (const Word& r = block['R']) radius_[tool] = r.value * unit();
}

void Machine::store_data(const Block& block) {
  const Cause code = block[Group::OneShot].word;
  const Word &l = block['L'], &p = block['P'];
  if (!l) throw_input_error(code, "L1 L2 L10 L11 or L20 with G10", "none");
  const int kind = int(l.value);
  if (l.value != kind || (kind != 1 && kind != 2 && kind != 10 && kind != 11 && kind != 20))
    throw_input_error(l, "L1 L2 L10 L11 or L20 with G10");
  const bool is_system = kind == 2 || kind == 20;
  if (!p)
    throw_input_error(code, is_system ? "P (coordinate system) with G10" : "P (tool) with G10",
                      "none");
  // P0 is the system in force.
  if (p.value != std::floor(p.value) || p.value < (is_system ? 0 : 1) ||
      p.value > (is_system ? 9 : 1e9))
    throw_input_error(p, is_system ? "a coordinate system from 0 to 9" : "an integer tool number");
  if (!is_system) return store_tool(block, kind);
  if (block['R'] && kind == 20) throw_input_error(block['R'], "no R with G10 L20");
  for (const char letter : {'I', 'J', 'Q'})
    if (block[letter]) throw_input_error(block[letter], "axis words and R with G10 L2 and L20");
  store_system(block, p.value == 0 ? system_ : int(p.value), kind == 20);
}

/// Executes G92, its variants and G52.
void Machine::shift_origin(const Block& block) {
  const Code& code = block[Group::OneShot];
  const auto stored = [&](int k) -> double& { return parameters_[5211 + std::size_t(k)]; };
  if (code.tenths == 920 || code.tenths == 520) {
    if (!first_axis_word(block))
      throw_input_error(code.word, "an axis word with " + shown(code.word.text), "none");
    const NineAxes previous = g92_;
    for (int k = 0; k < 9; ++k) {
      const Word& word = block[axis_letters[std::size_t(k)]];
      if (!word) continue;
      // G52 sets the shift; G92 gives the current position the programmed values.
      g92_[std::size_t(k)] = code.tenths == 520
                                 ? axis_word(k, word)
                                 : programmed(k) + previous[std::size_t(k)] - axis_word(k, word);
    }
    // In LinuxCNC G52 and G92 share one shift and its parameters.
    for (int k = 0; k < 9; ++k) stored(k) = g92_[std::size_t(k)];
    parameters_[5210] = 1;
  } else if (code.tenths == 923) {
    for (int k = 0; k < 9; ++k) g92_[std::size_t(k)] = stored(k);
    parameters_[5210] = 1;
  } else {
    g92_ = {};
    parameters_[5210] = 0;
    // G92.1 also clears the stored shift; G92.2 keeps it for G92.3.
    if (code.tenths == 921)
      for (int k = 0; k < 9; ++k) stored(k) = 0.0;
  }
  apply_frame();
}

/// Executes G28 and G30: a rapid over the programmed point to the stored position, for the
/// programmed axes, or for all axes if none is programmed.
void Machine::move_to_reference(const Block& block) {
  const Code& code = block[Group::OneShot];
  const std::size_t first = code.tenths < 300 ? 5161 : 5181;
  // G28.1 and G30.1 store the current position.
  if (code.tenths % 10 == 1) {
    for (int k = 0; k < 9; ++k) parameters_[first + std::size_t(k)] = axis_position(k);
    return;
  }
  const Target target = block_target(block, false);
  if (!target.empty())
    canon_.traverse({.end = canon_.end_of(target), .cause = code.word, .stated = target.stated()});
  const bool is_tip_mode = canon_.tip_mode();
  canon_.go_to(program::Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (int k = 0; k < 9; ++k) {
    const int j = joint(k);
    if (j < 0 || (!target.empty() && !target.has(j))) continue;
    end[j] = parameters_[first + std::size_t(k)] * (is_rotary(k) ? units::deg : 1.0);
  }
  // Nine zeros count as no stored position; LinuxCNC cannot distinguish the two either.
  const bool is_stored = std::any_of(parameters_.begin() + std::ptrdiff_t(first),
                                     parameters_.begin() + std::ptrdiff_t(first) + 9,
                                     [](double value) { return value != 0.0; });
  if (!is_stored && canon_.options().reference.size() == 0)
    canon_.assume({fmt::format("the target position of {} is the zero of the axes, because nothing "
                               "is stored in #{} to #{}",
                               shown(code.word.text), first, first + 8),
                   "machine.reference"});
  canon_.traverse({.end = std::move(end),
                   .cause = code.word,
                   .without_offset = true,
                   .stated = target.empty() ? ~std::uint32_t(0) : target.given()});
  if (is_tip_mode) canon_.go_to(program::Coordinates::Tip, code.word);
}

void Machine::set_compensation(const Block& block) {
  const Code& code = block[Group::CutterRadius];
  if (code.tenths == 400) return compensation_.end();
  if (compensation_.is_on())
    throw_input_error(code.word, "G40 before another " + std::string("G41 or G42"));
  const std::array<int, 2> joints = plane_joints(code.word);
  // The frame rotates about Z, which is not the normal of the plane Z X.
  if (plane_ == 18 && canon_.frame().rotation)
    throw_input_error(code.word, "G17 with cutter compensation in a rotated coordinate system");
  if (plane_ == 19) throw_input_error(code.word, "G17 or G18 with cutter compensation");
  const Word& d = block['D'];
  if (const Word& l = block['L']; l && l.value != 0)
    throw_input_error(l, "L0 with G41.1 and G42.1: the tip of a turning tool is not compensated");
  double radius = 0.0;
  if (code.tenths % 10 == 1) {
    if (!d) throw_input_error(code.word, "D (diameter) with G41.1 and G42.1", "none");
    radius = 0.5 * d.value * unit();
  } else {
    const int tool = d            ? int(d.value)
                     : tool_ == 0 ? run_.assume_only_tool(code.word, "no tool called")
                                  : tool_;
    if (d && (d.value < 0 || d.value != std::floor(d.value)))
      throw_input_error(d, "an integer tool number after D");
    const auto known_radius = find_value(radius_, tool);
    if (!known_radius && tool != 0)
      throw_input_error(d ? Cause(d) : Cause(code.word), "a tool with a known radius",
                        fmt::format("tool {}", tool));
    radius = known_radius.value_or(0.0);
  }
  const bool left = code.tenths / 10 == 41;
  // The right-handed order of G18 is Z X; left counts in a view against Y.
  compensation_.begin(left, radius, joints, linuxcnc_compensation);
}

}  // namespace abbe::sim::dialects::linuxcnc
