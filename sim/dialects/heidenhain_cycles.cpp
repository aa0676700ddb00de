#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/control_table.h"
#include "sim/dialects/heidenhain_machine.h"
#include "sim/dialects/heidenhain_words.h"

/// CYCL DEF of coordinates, and what TRANS and presets do; drilling is elsewhere.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;

namespace {

int digits_at(Cursor& cursor) {
  int number = 0;
  for (int n = 0; n < 5 && is_digit(cursor.here()); ++n)
    number = 10 * number + (cursor.text[cursor.at++] - '0');
  return number;
}

}  // namespace

/// CYCL DEF 7.1 X+10, CYCL DEF 200 DRILLING Q200=2 ...
void Machine::cycle_definition(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (!is_digit(words.cursor.here())) words.refuse(from, "the number of a cycle");
  const int number = digits_at(words.cursor);
  int part = -1;
  if (words.cursor.here() == '.') {
    ++words.cursor.at;
    part = digits_at(words.cursor);
  }
  const Cause cause = words.cause(from);
  const std::string name = fmt::format("CYCL\u00a0DEF\u00a0{}", number);
  const WordUse* use = find_word(heidenhain_words(), name);
  if (use == nullptr) {
    cycle_ = {};  // a call of what is skipped is no call of the cycle before it
    return run_.unknown(cause, "a cycle that is read");
  }
  if (use->use == Use::Refused) {
    run_.doubt(the_cycle);
    refuse(cause, std::string(use->sentence));
  }
  if (part <= 0) require_whole_cycle(cause);
  if (use->use == Use::WithoutEffect) return;
  modal_cycle_ = false;
  if (part > 0 && (!old_cycle_ || old_cycle_->first != number))
    refuse(cause, fmt::format("CYCL DEF {}.0 in the block before", number));
  if (part >= 0) old_cycle_ = {number, part};
  if (part >= 0) return old_cycle(number, part, from, words);
  run_.define(the_cycle, [&] { new_cycle(number, from, words); });
}

/// The name of a cycle alone, CYCL DEF 7.0, defines nothing.
void Machine::require_whole_cycle(const Cause& cause) {
  const auto begun = std::exchange(old_cycle_, std::nullopt);
  if (begun && begun->second == 0)
    refuse(cause, fmt::format("CYCL DEF {0}.1 behind CYCL DEF {0}.0", begun->first));
}

void Machine::old_cycle(int number, int part, std::size_t from, Words& words) {
  if (part == 0) return;  // its name
  switch (number) {
    case 7:
      return datum_shift(words);
    case 8:
      if (!words.at_end()) words.refuse(words.cursor.at, "no axis: nothing is mirrored");
      return;
    case 9: {
      if (!words.cursor.take("DWELL")) words.refuse(words.cursor.at, "DWELL and seconds");
      const double seconds = words.value();
      words.ends();
      return canon_.dwell(seconds, words.cause(from));
    }
    case 10:
      return cycle_rotation(words);
    case 11: {
      if (words.at_end()) return;
      if (!words.cursor.take("SCL")) words.refuse(words.cursor.at, "SCL and a factor");
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

/// X+10 IY-5 of cycle 7 and of TRANS DATUM AXIS.
void Machine::datum_shift(Words& words) {
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    if (words.cursor.here() == '#')
      words.refuse(from, "a shift in words: datum tables are not read");
    const std::string name = words.name();
    const bool step = name.size() == 2 && name[0] == 'I';
    if (name.size() != 1 && !step) words.refuse(from, "an axis and its shift");
    const double number = words.value();
    shift_axis(name.back(), number, step, words.cause(from));
  }
  apply_frame({1, "CYCL DEF 7"});
}

/// Of a shift in which the plane began only its end is certain, and that once the plane ends.
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
    if (step && (shift_doubt_ & shift_bit(letter)))
      refuse(cause, "an absolute shift behind PLANE RESET: that within the plane was another");
    shift_doubt_ &= ~shift_bit(letter);
  }
  datum_shift_[j] = step ? datum_shift_[j] + value : value;
}

/// Where X Y Z count from is known.
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
      words.value();  // of machines whose maker lets the cycle position
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

/// TRANS DATUM AXIS X+10, TRANS DATUM RESET
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

/// Presets 1 to 6 may be the scene's G54 to G59; shift and rotation end.
void Machine::choose_preset(int number, const Cause& cause) {
  if (contour_.beside()) refuse(cause, "R0 before another preset");
  if (plane_) refuse(cause, "PLANE RESET before another preset");
  const bool is_preset = number >= 1 && number <= most_preset;
  if (!is_preset ||
      (number > 6 && !canon_.options().more_offset.contains(system_of_preset(number))))
    refuse(cause,
           "a preset of 1 to 6, which are G54 to G59 of the scene, or one of the control's table "
           "(`offsets`)");
  preset_ = system_of_preset(number) - 1;
  datum_shift_.setZero();
  turn_ = 0.0;
  shift_doubt_ = 0;
  tangent_.reset();
  apply_frame(cause);
}

}  // namespace abbe::sim::dialects::heidenhain
