#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/fanuc/machine.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using program::FeedMode;

namespace {
// Limits of the control's memory.
constexpr int max_additional = 300;   // G54.1 P
constexpr int max_offsets = 999;      // D and H
constexpr double same_length = 1e-9;  // mm, rounding of a length converted from inches
constexpr double same_zero = 1e-6;    // mm, below anything that a scene states
// 1 - cos = tilt^2 / 2, a tilt of 1.4e-7 rad: rotated about the normal of the plane only
constexpr double one_plane = 1e-14;
}  // namespace

const AxisVector& Machine::system(int number) const {
  const auto found = systems_.find(number);
  return found == systems_.end() ? zero_ : found->second;
}

// Offsets of a Fanuc add up in this order: external, G54 to G59, G92, G52.
AxisVector Machine::base() const { return external_ + system(system_) + g92_ + g52_; }

/// Sets the frame: rotated about the centre of G68 or into the plane of G68.2, then shifted.
void Machine::apply_frame() {
  program::Frame frame{base(), rotation_};
  if (rotation_) {
    // A rotation about a centre leaves that centre fixed, which adds a shift.
    const Eigen::Vector3d rest =
        tilted_ ? centre_ : Eigen::Vector3d(centre_ - *rotation_ * centre_);
    for (int k = 0; k < 3; ++k) frame.shift[joint(k)] += rest[k];
  }
  canon_.set_frame(system_ - 1, std::move(frame));
}

/// Throws BadInput where a change of the coordinate system would be ambiguous: in a rotated system,
/// and during cutter compensation.
void Machine::check_free(const Cause& cause) const {
  if (rotation_) refuse(cause, "G69 before " + shown(cause.text));
  if (compensation_.on()) refuse(cause, "G40 before " + shown(cause.text));
}

void Machine::choose_system(const Block& block) {
  const Code& code = block[Group::WorkOffset];
  const Word& p = block['P'];
  // G54 to G59 are systems 1 to 6; G54.1 Pn, also written G54 Pn, is 100 + n.
  int number = (code.tenths - 530) / 10;
  if (code.tenths == 541 || (code.tenths == 540 && p)) {
    if (!p) refuse(code.word, "P (number of the coordinate system) beside G54.1", "none");
    number = whole(canon_, p, max_additional);
    if (number < 1) refuse(p, "a coordinate system of P1 to P300");
    number += 100;
  }
  // Selecting the system in force again changes nothing, and is allowed anywhere.
  if (number == system_) return;
  check_free(code.word);
  system_ = number;
  apply_frame();
}

void Machine::set_rotation(const Block& block) {
  const Code& code = block[Group::Rotation];
  if (code.tenths == 690) {
    rotation_.reset();
    tilted_ = false;
    apply_frame();
    // The end of G68.2 also ends the tip coordinates it needs.
    apply_length(code.word);
    return move(block);
  }
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(code.word, "a machine with X Y Z beside " + shown(code.word.text));
  if (rotation_) refuse(code.word, "G69 before another " + shown(code.word.text));
  if (cycle_code_ != 800) refuse(code.word, "G80 before " + shown(code.word.text));
  if (code.tenths == 682) return tilt(block);
  for (const char letter : {'I', 'J', 'K'})
    if (block[letter]) refuse(block[letter], "G68.2 for a coordinate system turned in space");
  const Word& r = block['R'];
  if (!r) refuse(code.word, "R (angle) beside G68", "none");
  const std::string_view plane = plane_letters();
  // A centre coordinate that is not programmed is the current position.
  const AxisVector here = canon_.programmed();
  for (int k = 0; k < 3; ++k) {
    const char letter = axis_letters[std::size_t(k)];
    const bool inside = plane.find(letter) != std::string_view::npos;
    if (block[letter] && !inside) refuse(block[letter], "a centre in the plane beside G68");
    centre_[k] = !inside ? 0.0 : block[letter] ? length(block[letter]) : here[joint(k)];
  }
  Eigen::Vector3d across = Eigen::Vector3d::Zero();
  across[plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0] = 1.0;
  rotation_ = Eigen::AngleAxisd(angle_in_degrees(r) * units::deg, across).toRotationMatrix();
  apply_frame();
}

void Machine::store_origin(const Block& block, bool additional) {
  const Code& code = block[Group::OneShot];
  const Word& p = block['P'];
  if (!p) refuse(code.word, "P (coordinate system) beside G10", "none");
  const int number = whole(canon_, p, additional ? max_additional : 6);
  if (additional && number < 1) refuse(p, "a coordinate system of P1 to P300");
  if (block['R']) refuse(block['R'], "axis words beside G10 L2 and L20");
  check_free(code.word);
  AxisVector& origin =
      // P0 of L2 is the external offset, which shifts all systems.
      !additional && number == 0
          ? external_
          : systems_.try_emplace(additional ? 100 + number : number, zero_).first->second;
  for (const auto& [j, word, step] : axis_words(block))
    origin[j] = axis_word(j, *word) + (incremental_ || step ? origin[j] : 0.0);
  apply_frame();
}

void Machine::store_tool(const Block& block, int kind) {
  const Code& code = block[Group::OneShot];
  const Word &p = block['P'], &r = block['R'];
  if (!p || !r) refuse(code.word, "P (number) and R (value) beside G10 of a tool", "one of them");
  if (const Word* axis = first_axis_word(block)) refuse(*axis, "R beside G10 of a tool");
  const int number = whole(canon_, p, max_offsets);
  if (number < 1) refuse(p, "an offset of P1 to P999");
  Geometry& one = kind < 12 ? lengths_[number] : radii_[number];
  // L10 and L12 are geometry, L11 and L13 wear.
  const double before = kind % 2 == 0 ? one.value.value_or(0.0) : one.wear;
  const double value = length(r) + (incremental_ ? before : 0.0);
  if (kind % 2 == 0)
    one.value = value;
  else
    one.wear = value;
}

void Machine::store_data(const Block& block) {
  const Word& l = block['L'];
  // On a turning control G10 without L sets wear.
  if (turning_ && !(l && (l.value == 2.0 || l.value == 20.0))) return store_wear(block);
  const int kind = l ? whole(canon_, l, 999) : -1;
  switch (kind) {
    case 2:
    case 20:
      return store_origin(block, kind == 20);
    case 10:
    case 11:
    case 12:
    case 13:
      return store_tool(block, kind);
    default:
      refuse(l ? Cause(l) : Cause(block[Group::OneShot].word),
             "L2 L20 L10 L11 L12 or L13 beside G10", l ? shown(l.text) : "none");
  }
}

/// G52, G92 and G92.1; on a turning control G52, G50 and G50.3.
void Machine::shift_origin(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Words words = axis_words(block);
  if (words.empty()) {
    // G92 S and G50 S limit the spindle speed and are handled in `set_spindle`.
    if ((code.tenths == 920 || code.tenths == 500) && block['S']) return;
    refuse(code.word, "an axis word beside " + shown(code.word.text), "none");
  }
  check_free(code.word);
  if (code.tenths == 920 && tip_words()) refuse(code.word, "G49 before G92");
  const AxisVector here = canon_.programmed();
  for (const auto& [j, word, step] : words) {
    const bool sets = code.tenths == 920 || code.tenths == 500;
    const double value = axis_word(j, *word);
    if (step && !sets) refuse(*word, "X Y Z C beside " + shown(code.word.text));
    if (sets)
      // G92 makes the current position read as programmed: the shift takes the difference. An
      // increment (U, W) moves the zero by it.
      g92_[j] += step ? -value : here[j] - value;
    else
      g52_[j] = code.tenths == 520 ? value : 0.0;
    if (code.tenths == 921 || code.tenths == 503) g92_[j] = 0.0;
  }
  apply_frame();
}

double Machine::length_of(int h, const Cause& cause) const {
  if (h == 0) return 0.0;
  if (const auto found = lengths_.find(h); found != lengths_.end() && found->second.value)
    return *found->second.value + found->second.wear;
  std::string known;
  for (const auto& [number, one] : lengths_)
    if (one.value) known += fmt::format(" H{}", number);
  refuse(cause,
         "a tool length that is known (" + (known.empty() ? "none is" : known.substr(1)) + ")",
         fmt::format("H{}", h));
}

void Machine::set_tool_length(const Block& block) {
  const Code& code = block[Group::ToolLength];
  const Word& h = block['H'];
  if (h) {
    h_ = whole(canon_, h, max_offsets);
    h_stated_ = true;
  }
  if (!code && length_mode_ == 490) return;
  const Cause cause = code ? Cause(code.word) : Cause(h);
  if (compensation_.on()) refuse(cause, "no other tool length under G41 or G42");
  if (code) length_mode_ = code.tenths;
  if (length_mode_ == 490) h_ = 0, h_stated_ = false;
  // A tool that was never called: with one tool there is no doubt which one is meant.
  if ((length_mode_ == 430 || length_mode_ == 440) && !h_stated_) {
    h_ = run_.uncalled_tool(cause, "no H beside " + shown(code.word.text));
    h_stated_ = true;
  }
  const int z = joint(2);
  if (z < 0) refuse(cause, "a machine with a Z axis");
  const auto shift_of_z = [&] {
    const AxisVector& shift = canon_.tool_shift();
    return shift.size() > 0 ? shift[z] : 0.0;
  };
  const double before = shift_of_z();
  const bool tip_before = canon_.tip_mode();
  apply_length(cause);
  const double change = shift_of_z() - before;
  // A Z word in the block moves the tip to where it is programmed, so nothing is left open.
  if (change == 0.0 || tip_before || canon_.tip_mode() || block['Z']) return;
  // G49 where Z stands at first is the usual safety block of a program: nothing to report.
  const double reference = program::start_of(canon_.options())[z];
  if (length_mode_ == 490 && canon_.position()[z] == reference) return;
  run_.warn_once(
      "a change of the tool length without a Z word moves nothing (parameter 5006.6 TOS = 1); a "
      "control with TOS = 0 moves Z by it");
}

/// Puts the tool length in force: as a shift of Z, or in the chain with which the tip is computed.
void Machine::apply_length(const Cause& cause) {
  const bool has = length_mode_ != 490 && h_ != 0;
  const int h = has ? h_ : -1;
  const double mm = has ? length_of(h, cause) : 0.0;
  if (!tilted_ && !tip_words()) {
    AxisVector shift;
    if (has) {
      shift = zero_;
      shift[joint(2)] = length_mode_ == 440 ? -mm : mm;
    }
    canon_.select_length(h, cause);
    canon_.set_tool_shift(std::move(shift));
    canon_.set_tip_mode(false, cause);
    seen_axis_length_ = seen_axis_length_ || has;
    return compare_zeros(cause);
  }
  if (length_mode_ == 440) refuse(cause, "G43 for a tool length in a tilted plane");
  if (tip_words() && !has) refuse(cause, "H (tool length) beside G43.4 and G43.5", "none");
  const auto& known = canon_.options().tool_length;
  // The chain has the length of the scene's tool; another length would need a chain of its own.
  const auto own = known.find(h);
  if (has && (own == known.end() || std::abs(own->second - mm) > same_length))
    refuse(cause,
           "the length of the tool as the scene has it: the tip is counted with that chain, and "
           "G10 does not change it",
           fmt::format("{} mm", mm));
  const bool of_tool = canon_.options().control_of_h.contains(tool_);
  canon_.set_tool_shift({});
  canon_.select_length(has ? h : of_tool ? tool_ : -1, cause);
  // Only the begin of G43.4 depends on where the table stands.
  const bool begins = !canon_.tip_mode();
  canon_.set_tip_mode(true, cause);
  if (begins && tip_words()) note_turned_table(cause);
  seen_tip_length_ = seen_tip_length_ || has;
  compare_zeros(cause);
}

/// With parameter 19696.5 WKP = 0, X Y Z count in the workpiece coordinate system as it lies over
/// the table at the block that begins G43.4 (FANUC A-79348E, "Explanation"): a rotation of the
/// table up to then is not included. Here they count in the workpiece with the table at zero.
void Machine::note_turned_table(const Cause& cause) {
  constexpr double turned = 1e-6;  // rad, rounding of a position
  const AxisVector offsets = base();
  std::string tables;
  for (const kinematics::Joint& joint : chain(cause).joints()) {
    const int j = canon_.joint_of(joint.name);
    if (j < 0 || joint.side != kinematics::Side::Workpiece ||
        joint.motion != kinematics::Motion::Rotary)
      continue;
    const double at = canon_.position()[j] - offsets[j];
    if (std::abs(std::remainder(at, 2 * pi)) > turned)
      tables += fmt::format("{}{}{:.6g}", tables.empty() ? "" : " ", joint.name, at / units::deg);
  }
  if (tables.empty()) return;
  run_.warn_once(fmt::format(
      "{} on line {} begins with the table turned ({}): X Y Z count in the workpiece with its "
      "table at zero; a control with parameter 19696.5 WKP = 0 counts in the coordinate system "
      "as it stands over the table then",
      length_mode_ == 435 ? "G43.5" : "G43.4", canon_.line(), tables));
}

/// On a control words count from the same point under G43 and G43.4. Here they do not if the scene
/// states no offset, or if the tool length differs from that of the chain.
void Machine::compare_zeros(const Cause& cause) {
  if (!seen_axis_length_ || !seen_tip_length_ || length_mode_ == 490 || h_ == 0) return;
  AxisVector axes = base();
  const int n = int(axes.size());
  // The comparison is made with rotary axes at zero, where both must agree.
  for (int j = 0; j < n; ++j)
    if (!canon_.is_linear(j)) axes[j] = 0.0;
  const Eigen::Vector3d under_tip(axes[joint(0)], axes[joint(1)], axes[joint(2)]);
  const Eigen::Vector3d more =
      program::offset_correction(canon_.zero(), program::Coordinates::Axis);
  for (int k = 0; k < 3; ++k) axes[joint(k)] += more[k];
  axes[joint(2)] += length_of(h_, cause);
  const Eigen::Vector3d apart = chain(cause).tool_in_workpiece(axes).translation() - under_tip;
  if (apart.norm() <= same_zero) return;
  run_.warn_once(fmt::format(
      "with the rotary axes at zero X Y Z under G43 H{} lead to a point {:.6g} {:.6g} {:.6g} mm "
      "from where they lead under G43.4 and G68.2: tool_length_mm of the program, or where the "
      "nose stands with the axes at zero, does not fit",
      h_, apart.x(), apart.y(), apart.z()));
}

void Machine::set_compensation(const Block& block) {
  const Code& code = block[Group::CutterRadius];
  if (const Word& d = block['D']) {
    const int number = whole(canon_, d, max_offsets);
    // Another radius in the middle of a contour would leave the transition undefined.
    if (compensation_.on() && number != d_ && code.tenths != 400) refuse(d, "G40 before another D");
    d_ = number;
    d_stated_ = true;
  }
  if (!code) return;
  cutter_ = code.tenths;
  if (code.tenths == 400) return compensation_.end();
  if (compensation_.on()) {
    if (code.tenths == side_) return;  // posts say it again
    refuse(code.word, "G40 between G41 and G42");
  }
  if (!d_stated_) {
    d_ = run_.uncalled_tool(code.word, "no D beside G41 and G42");
    d_stated_ = true;
  }
  const std::string_view plane = plane_letters();
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  if (first < 0 || second < 0)
    refuse(code.word,
           fmt::format("a machine with the axes {} {} of the plane", plane[0], plane[1]));
  // Under G43.4 the plane of compensation would rotate with the table.
  if (tip_words()) refuse(code.word, "G40 beside G43.4 and G43.5");
  const int across = plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0;
  if (rotation_ && (*rotation_)(across, across) < 1.0 - one_plane)
    refuse(code.word, "contours compensated beforehand in a tilted plane: no G41 and G42 there");
  const auto known = radii_.find(d_);
  const bool has = known != radii_.end() && known->second.value;
  if (!has && d_ != 0)
    refuse(block['D'] ? Cause(block['D']) : Cause(code.word), "a tool whose radius is known",
           fmt::format("D{}", d_));
  // D0 is a radius of zero.
  const double radius = has ? *known->second.value + known->second.wear : 0.0;
  run_.warn_once(
      "cutter compensation ends its first move across the beginning of the next (type A, parameter "
      "5003.0 SUP = 0) and goes around outside corners in arcs (19607.2 CCC = 1): with type B a "
      "control enters an outside corner otherwise, with CCC = 0 it goes around in lines");
  side_ = code.tenths;
  compensation_.begin(code.tenths == 410, radius, {first, second});
}

namespace {

/// Returns the index of a variable within `most` numbers from `first` on, or -1.
int within(int number, int first, int most) {
  return number >= first && number < first + most ? number - first : -1;
}

}  // namespace

void Machine::note_numbers(int sequence, int program) {
  if (sequence >= 0) sequence_ = sequence;
  program_ = program;
}

/// Returns the joint of the k-th axis as the control counts them: X Y Z, then the others by letter.
int Machine::axis_of(int k) const {
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0 && k-- == 0) return j;
  return -1;
}

/// Returns a position in program units: mm or inch, degrees; X as a diameter where words are.
double Machine::shown_value(int j, const AxisVector& q) const {
  if (j < 0 || q.size() == 0) return 0.0;
  if (diameters_ && j == joint(0)) return 2.0 * q[j] / unit();
  return canon_.is_linear(j) ? q[j] / unit() : q[j] / units::deg;
}

/// #4001 and following: the G codes in force, by group.
std::optional<double> Machine::mode(int group) const {
  const FeedMode feed = canon_.feed_mode();
  switch (group) {
    case 1:
      return motion_ / 10;
    case 2:
      return plane_ / 10;
    case 3:
      return incremental_ ? 91 : 90;
    case 5:
      if (turning_) return feed == FeedMode::PerMinute ? 98 : 99;
      return feed == FeedMode::InverseTime ? 93 : feed == FeedMode::PerMinute ? 94 : 95;
    case 6:
      return canon_.inch() ? 20 : 21;
    case 7:
      return cutter_ / 10;
    case 8:
      // G43.4 reads as 43.4.
      return length_mode_ / 10.0;
    case 9:
      return cycle_code_ / 10;
    case 10:
      return to_r_ ? 99 : 98;
    case 13:
      return surface_speed_ ? 96 : 97;
    case 14:
      return system_ <= 6 ? 53.0 + system_ : 54.1;
    case 15:
      return 64;
    case 16:
      return !rotation_ ? 69.0 : tilted_ ? 68.2 : 68.0;
    case 17:
      return polar_.on ? 16 : 15;
    default:
      return std::nullopt;
  }
}

/// #4107 and following: words in force.
std::optional<double> Machine::modal_word(int number) const {
  switch (number) {
    case 4107:
      return d_;
    case 4109:
      return canon_.feed() ? canon_.feed()->word : 0.0;
    case 4111:
      return h_;
    case 4113:
      return last_m_;
    case 4114:
      return sequence_;
    case 4115:
      return program_;
    case 4119:
      return speed_;
    case 4120:
      return std::max(selected_, 0);
    case 4130:
      return system_ > 6 ? system_ - 100 : 0;
    default:
      return std::nullopt;
  }
}

/// Returns the tool offset that a variable holds, in the layout of memory C.
Machine::OffsetVariable Machine::offset(int number) {
  if (turning_) return {};  // those of a turning control have other numbers
  const struct {
    int first, most;
    Offsets* of;
    bool wear;
  } ranges[] = {{2001, 200, &lengths_, true},  {2201, 200, &lengths_, false},
                {10001, 999, &lengths_, true}, {11001, 999, &lengths_, false},
                {12001, 999, &radii_, true},   {13001, 999, &radii_, false}};
  for (const auto& range : ranges)
    if (const int i = within(number, range.first, range.most); i >= 0)
      return {range.of, i + 1, range.wear};
  return {};
}

/// Returns the coordinate system that a variable belongs to, and its axis: 20 numbers for each
/// system, from #5201 the external offset and G54 to G59, from #7001 G54.1 P1 to P48.
AxisVector* Machine::origin(int number, int& k) {
  if (const int i = within(number, 5201, 140); i >= 0 && i % 20 < 9) {
    k = i % 20;
    return i / 20 == 0 ? &external_ : &systems_.try_emplace(i / 20, zero_).first->second;
  }
  if (const int i = within(number, 7001, 960); i >= 0 && i % 20 < 9) {
    k = i % 20;
    return &systems_.try_emplace(101 + i / 20, zero_).first->second;
  }
  return nullptr;
}

std::optional<double> Machine::variable(int number) {
  if (const OffsetVariable one = offset(number); one.of != nullptr) {
    const auto found = one.of->find(one.number);
    if (found == one.of->end()) return 0.0;
    return (one.wear ? found->second.wear : found->second.value.value_or(0.0)) / unit();
  }
  int k = 0;
  if (const AxisVector* of = origin(number, k)) return shown_value(axis_of(k), *of);
  if (const int group = within(number, 4001, 30); group >= 0) return mode(group + 1);
  if (const auto word = modal_word(number)) return word;
  // Under compensation a program reads the programmed position, not that of the offset tool.
  const bool beside = compensation_.on() || compensation_.leaving();
  const AxisVector at = beside ? compensation_.programmed() : canon_.position();
  if (const int i = within(number, 5001, 9); i >= 0)
    return shown_value(axis_of(i), canon_.unplaced(at));
  // #5041: position with tool length; #5021: machine coordinates.
  if (const int i = within(number, 5041, 9); i >= 0) {
    AxisVector with_length = canon_.unplaced(canon_.position());
    if (canon_.tool_shift().size() > 0) with_length += canon_.tool_shift();
    return shown_value(axis_of(i), with_length);
  }
  if (const int i = within(number, 5021, 9); i >= 0) {
    const program::Coordinates now = canon_.coordinates();
    canon_.go_to(program::Coordinates::Axis, {1, {}});
    const double value = shown_value(axis_of(i), canon_.position());
    canon_.go_to(now, {1, {}});
    return value;
  }
  if (const int i = within(number, 5081, 9); i >= 0)
    return shown_value(axis_of(i), canon_.tool_shift());
  // #3003 and #3004 suppress single block and feed hold, which a virtual control does not have.
  if (number == 3003 || number == 3004) return 0.0;
  return std::nullopt;
}

bool Machine::set_variable(int number, double value) {
  if (number == 3003 || number == 3004 || number == 3006) return true;
  if (const OffsetVariable one = offset(number); one.of != nullptr) {
    Geometry& geometry = (*one.of)[one.number];
    if (one.wear)
      geometry.wear = value * unit();
    else
      geometry.value = value * unit();
    return true;
  }
  int k = 0;
  AxisVector* of = origin(number, k);
  // A change of the system in a rotated frame or under compensation is ambiguous, as for G10.
  if (of == nullptr || axis_of(k) < 0 || rotation_ || compensation_.on()) return false;
  const int j = axis_of(k);
  const double scale = diameters_ && j == joint(0) ? 0.5 : 1.0;
  (*of)[j] = scale * value * (canon_.is_linear(j) ? unit() : units::deg);
  apply_frame();
  return true;
}

}  // namespace abbe::sim::dialects::fanuc
