#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_machine.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using program::Coordinates;

namespace {

constexpr Address xyz_words[] = {Address::X, Address::Y, Address::Z};
constexpr double along_z = 1e-12;  // rad, of a plane that is not tilted

}  // namespace

Matrix3d Machine::total_rotation() const {
  return swivel_ ? Matrix3d(swivel_->frame.rotation * programmable_.rotation)
                 : programmable_.rotation;
}

/// Program to axes, or to the tip: what is programmable, then the swivelled plane, then the work
/// offset. Offsets of the scene that nothing changes keep their bits.
void Machine::apply_frame() {
  canon_.set_tip_mode(tip_mode(), {1, {}});
  const Placement sum = swivel_ ? behind(swivel_->frame, programmable_) : programmable_;
  program::Frame frame;
  if (system_ >= 0) frame.shift = program::work_offset(canon_.options(), system_ + 1);
  if (!sum.rotation.isIdentity(0.0)) frame.rotation = sum.rotation;
  const bool turns = !programmable_turns_.isZero(0.0);
  if (!sum.shift.isZero(0.0) || turns) {
    if (frame.shift.size() == 0) frame.shift = AxisVector::Zero(canon_.position().size());
    if (turns) frame.shift += programmable_turns_;
    for (int k = 0; k < 3; ++k)
      if (const int j = joint(k); j >= 0) frame.shift[j] += sum.shift[k];
  }
  canon_.set_frame(system_, std::move(frame));
}

void Machine::change_transformation(const Code& code) {
  const bool on = code.word == "TRAORI";
  if (on && !turning_.possible())
    refuse(code.cause, "a machine with X Y Z and one or two rotary axes beside TRAORI",
           "one with " + canon_.letters());
  compensation_.left_behind();
  traori_ = on;
  apply_tool();
}

/// The shift or rotation that the words of a frame say.
Placement Machine::frame_of_words(const Block& block) const {
  const Code& code = block[Group::Frame];
  Placement made;
  if (code.word == "TRANS" || code.word == "ATRANS") {
    for (int k = 0; k < 3; ++k) made.shift[k] = block[xyz_words[k]].value * unit();
    return made;
  }
  const Value& in_plane = block[Address::RPL];
  const Value* axis = first_axis_word(block);
  if (in_plane && axis != nullptr)
    refuse(in_plane, "either RPL or X Y Z beside " + shown(code.cause.text));
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(code.cause, "a machine with X Y Z for a frame that is turned");
  if (in_plane) {
    made.rotation = turned_about(plane_ == 17 ? 2 : plane_ == 18 ? 1 : 0, in_plane.value);
    return made;
  }
  made.rotation = turned_about(2, block[Address::Z].value) *
                  turned_about(1, block[Address::Y].value) *
                  turned_about(0, block[Address::X].value);
  return made;
}

void Machine::frame_words(const Block& block) {
  const Code& code = block[Group::Frame];
  const bool shifts = code.word == "TRANS" || code.word == "ATRANS";
  for (const auto& value : block.values)
    if (value && value.measure != Measure::Modal) refuse(value, "a number beside a frame");
  AxisVector turns = AxisVector::Zero(programmable_turns_.size());
  static constexpr std::pair<Address, char> others[] = {{Address::A, 'A'}, {Address::B, 'B'},
                                                        {Address::C, 'C'}, {Address::U, 'U'},
                                                        {Address::V, 'V'}, {Address::W, 'W'}};
  for (const auto& [address, letter] : others) {
    const Value& word = block[address];
    if (!word) continue;
    if (!shifts) refuse(word, "X Y Z beside " + shown(code.cause.text));
    const int j = canon_.joint_of(letter);
    turns[j] = word.value * (canon_.is_linear(j) ? unit() : units::deg);
  }
  for (const Address address : xyz_words)
    if (const Value& word = block[address]; word && !(std::abs(word.value) <= 1e6))
      refuse(word, "a number within 1e6");
  if (shifts && block[Address::X]) refuse_diameters(block[Address::X]);
  const Placement made = frame_of_words(block);
  const bool on_top = code.word[0] == 'A';
  programmable_ = on_top ? behind(programmable_, made) : made;
  programmable_turns_ = on_top ? AxisVector(programmable_turns_ + turns) : turns;
  if (programmable_.shift.cwiseAbs().maxCoeff() > 1e9)
    refuse(code.cause, "shifts that add up to less than 1e9 mm");
  apply_frame();
}

void Machine::unswivel() {
  if (!programmable_.is_none()) run_.warn_once("TRANS and ROT in force at CYCLE800() end with it");
  swivel_.reset();
  programmable_ = {};
  programmable_turns_.setZero();
  apply_tool();
}

namespace {

/// The parameters of CYCLE800 by their places.
struct SwivelWords {
  const ProgramCall& call;
  const program::Canon& canon;

  double number(std::size_t i, double otherwise = 0.0) const {
    if (i >= call.arguments.size() || call.arguments[i].empty()) return otherwise;
    if (!call.arguments[i].number) canon.refuse(call.arguments[i].cause, "a number");
    return *call.arguments[i].number;
  }
  int whole(std::size_t i, int otherwise, int least, int most) const {
    const double value = number(i, otherwise);
    if (value != std::floor(value) || value < least || value > most)
      canon.refuse(call.arguments[i].cause, fmt::format("a whole number of {} to {}", least, most));
    return int(value);
  }
  Vector3d three(std::size_t i) const { return {number(i), number(i + 1), number(i + 2)}; }
  [[noreturn]] void refuse(std::size_t i, const std::string& expected) const {
    canon.refuse(i < call.arguments.size() ? call.arguments[i].cause : call.cause, expected);
  }
};

/// Bits 7 and 6 of _MODE say how angles count, the pairs below them the axes from the first on.
Matrix3d rotation_of(const SwivelWords& words) {
  const int mode = words.whole(3, 57, 0, 255);
  const Vector3d angles = words.three(7);
  if (mode >= 128)
    words.refuse(3, mode >= 192 ? "angles of the plane: not positions of rotary axes (_MODE 192)"
                                : "_MODE by axes or by solid angle: not projected angles");
  if (mode >= 64) return swivel_rotation(SwivelMode::SolidAngle, {}, angles);
  Eigen::Vector3i order;
  for (int k = 0; k < 3; ++k) {
    const int axis = (mode >> (2 * k)) & 3;
    if (axis == 0 && angles[k] != 0) words.refuse(3, "an axis for every angle in _MODE");
    order[k] = std::max(axis, 1) - 1;
  }
  return swivel_rotation(SwivelMode::AxisByAxis, order, angles);
}

}  // namespace

void Machine::swivel(const ProgramCall& call) {
  const SwivelWords words{call, canon_};
  if (call.arguments.size() > 16) words.refuse(16, "at most 16 parameters of CYCLE800");
  const bool ends =
      call.arguments.empty() || (call.arguments.size() > 1 && call.arguments[1].text == "0");
  if (ends) return unswivel();
  const int manner = words.whole(0, 0, 0, 8), status = words.whole(2, 0, 0, 299999);
  const bool on_top = status % 10 == 1, tip_stays = status / 10 % 10 == 1;
  if (status % 10 > 1 || status / 10 % 10 > 1 || status / 100 % 100 != 0 || status / 10000 % 10 > 1)
    words.refuse(2, "_ST of new or additive, with or without follow-up of the tip, and direction");
  const int direction = status / 10000 % 10 == 1 ? 0 : words.whole(13, -1, -2, 2);
  if (on_top && !programmable_.is_none())
    refuse(call.cause, "TRANS without words before an additive CYCLE800");
  const Placement to_point{words.three(4) * unit(), Matrix3d::Identity()};
  const Placement turned{Vector3d::Zero(), rotation_of(words)};
  const Placement in_plane{words.three(10) * unit(), Matrix3d::Identity()};
  Placement frame = behind(behind(to_point, turned), in_plane);
  if (on_top && swivel_) frame = behind(swivel_->frame, frame);
  if (!(frame.shift.cwiseAbs().maxCoeff() < 1e9)) refuse(call.cause, "a plane within 1e9 mm");
  const Vector3d normal_w = frame.rotation.col(2);
  if (!turning_.possible() && (normal_w - Vector3d::UnitZ()).norm() > along_z)
    refuse(call.cause, "a machine with rotary axes for a plane that is tilted",
           "one with " + canon_.letters());
  if (manner != 0) retract(manner, words.number(14), call.cause);
  const bool turns = direction != 0 && turning_.possible();
  if (turns) turn_to(normal_w, direction, tip_stays, call.cause);
  programmable_ = {};
  programmable_turns_.setZero();
  swivel_ = Swivel{frame, turns};
  apply_tool();
}

/// Away from the workpiece before the rotary axes turn.
void Machine::retract(int manner, double by, const Cause& cause) {
  if (manner == 5) {
    if (!turning_.possible()) refuse(cause, "_FR 0 to 2 on a machine without rotary axes");
    if (!(by >= 0 && by * unit() <= 1e6)) refuse(cause, "_FR_I of 0 to 1e6 mm");
    canon_.go_to(Coordinates::Tip, cause);
    AxisVector end = canon_.position();
    const Vector3d away = by * unit() * turning_.direction_w(end);
    for (int k = 0; k < 3; ++k) end[joint(k)] += away[k];
    return canon_.traverse({.end = std::move(end), .cause = cause});
  }
  if (manner != 1 && manner != 2 && manner != 4)
    refuse(cause, "_FR 0, 1, 2, 4 or 5", fmt::format("{}", manner));
  const int z = joint(2);
  if (z < 0) refuse(cause, "a machine with a Z axis");
  const AxisVector first = program::start_of(canon_.options());
  canon_.assume(
      {fmt::format("CYCLE800 retracts Z to {:.6g} mm, where it stood at first", first[z]),
       "machine.home"});
  canon_.go_to(Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  end[z] = std::max(end[z], first[z]);
  canon_.traverse({.end = end, .cause = cause});
  if (manner != 2) return;
  for (int k = 0; k < 2; ++k)
    if (const int j = joint(k); j >= 0) end[j] = first[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

/// Of the positions that point the tool so, the one with the first (second) rotary axis lower or
/// higher; a free axis goes to zero.
void Machine::turn_to(const Vector3d& direction_w, int preference, bool tip_stays,
                      const Cause& cause) {
  AxisVector near = canon_.position();
  for (const int j : turning_.rotary()) near[j] = 0.0;
  const std::vector<AxisVector> all = turning_.positions(direction_w, near);
  if (all.empty())
    refuse(cause, "a plane that the rotary axes reach",
           fmt::format("its normal ({:.6g}, {:.6g}, {:.6g})", direction_w.x(), direction_w.y(),
                       direction_w.z()));
  const std::size_t number = std::abs(preference) == 2 && turning_.rotary().size() > 1 ? 1 : 0;
  const int judged = turning_.rotary()[number];
  constexpr double alike = 1e-9;  // rad
  const AxisVector* best = &all.front();
  for (const AxisVector& one : all)
    if ((one[judged] - (*best)[judged]) * preference > alike) best = &one;
  canon_.go_to(tip_stays ? Coordinates::Tip : Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  for (const int j : turning_.rotary()) end[j] = (*best)[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

}  // namespace abbe::sim::dialects::siemens
