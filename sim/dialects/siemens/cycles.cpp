#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens/machine.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using program::Coordinates;
using program::Feed;
using program::FeedMode;

namespace {

constexpr Address xyz_words[] = {Address::X, Address::Y, Address::Z};
constexpr double along_z = 1e-12;  // rad, of a plane that is not tilted

}  // namespace

Matrix3d Machine::total_rotation() const {
  return swivel_ ? Matrix3d(swivel_->frame.rotation * programmable_.rotation)
                 : programmable_.rotation;
}

/// Sets the frame: programmable frame, then swivelled plane, then work offset. Unchanged offsets of
/// the scene keep their bits.
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

// A compensation that is being left would end at a position in the other coordinates.
void Machine::change_transformation(const Code& code) {
  const bool on = code.word == "TRAORI";
  if (on && !orientation_.is_possible())
    refuse(code.cause, "a machine with X Y Z and one or two rotary axes beside TRAORI",
           "one with " + canon_.letters());
  compensation_.clear_leaving();
  traori_ = on;
  apply_tool();
}

/// Returns the shift or rotation that the words of a frame state.
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
    made.rotation = rotation_about(plane_ == 17 ? 2 : plane_ == 18 ? 1 : 0, in_plane.value);
    return made;
  }
  // ROT rotates about Z, then the new Y, then the new X (RPY angles, the default of the control).
  made.rotation = rotation_about(2, block[Address::Z].value) *
                  rotation_about(1, block[Address::Y].value) *
                  rotation_about(0, block[Address::X].value);
  return made;
}

void Machine::frame_words(const Block& block) {
  const Code& code = block[Group::Frame];
  const bool shifts = code.word == "TRANS" || code.word == "ATRANS";
  // AC() and the like have no meaning in a frame.
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
  // ATRANS and AROT add to the frame in force, TRANS and ROT replace it.
  const bool on_top = code.word[0] == 'A';
  programmable_ = on_top ? behind(programmable_, made) : made;
  programmable_turns_ = on_top ? AxisVector(programmable_turns_ + turns) : turns;
  // Additive shifts in a loop would otherwise grow without limit.
  if (programmable_.shift.cwiseAbs().maxCoeff() > 1e9)
    refuse(code.cause, "shifts that add up to less than 1e9 mm");
  apply_frame();
}

void Machine::unswivel() {
  // Reported because a program may rely on its frames after CYCLE800().
  if (!programmable_.is_none()) run_.warn_once("TRANS and ROT in force at CYCLE800() end with it");
  swivel_.reset();
  programmable_ = {};
  programmable_turns_.setZero();
  apply_tool();
}

namespace {

/// Arguments of CYCLE800 by position.
struct SwivelParameters {
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

/// Bits 7 and 6 of _MODE state how angles count, the pairs of bits below them the axes in order.
Matrix3d swivel_frame_rotation(const SwivelParameters& words) {
  // 57 = 0b111001 is X, Y, Z in this order, the default.
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
  const SwivelParameters words{call, canon_};
  if (call.arguments.size() > 16) words.refuse(16, "at most 16 parameters of CYCLE800");
  // CYCLE800() and the swivel data "0" end the plane.
  const bool ends =
      call.arguments.empty() || (call.arguments.size() > 1 && call.arguments[1].text == "0");
  if (ends) return unswivel();
  const int manner = words.whole(0, 0, 0, 8), status = words.whole(2, 0, 0, 299999);
  const bool on_top = status % 10 == 1, tip_stays = status / 10 % 10 == 1;
  // Digits of _ST: new or additive, follow-up of the tip, and direction.
  if (status % 10 > 1 || status / 10 % 10 > 1 || status / 100 % 100 != 0 || status / 10000 % 10 > 1)
    words.refuse(2, "_ST of new or additive, with or without follow-up of the tip, and direction");
  const int direction = status / 10000 % 10 == 1 ? 0 : words.whole(13, -1, -2, 2);
  if (on_top && !programmable_.is_none())
    refuse(call.cause, "TRANS without words before an additive CYCLE800");
  // The plane is built as on the control: to the reference point, rotated, shifted within the
  // plane.
  const Placement to_point{words.three(4) * unit(), Matrix3d::Identity()};
  const Placement turned{Vector3d::Zero(), swivel_frame_rotation(words)};
  const Placement in_plane{words.three(10) * unit(), Matrix3d::Identity()};
  Placement frame = behind(behind(to_point, turned), in_plane);
  if (on_top && swivel_) frame = behind(swivel_->frame, frame);
  if (!(frame.shift.cwiseAbs().maxCoeff() < 1e9)) refuse(call.cause, "a plane within 1e9 mm");
  const Vector3d normal_w = frame.rotation.col(2);
  // Without rotary axes only a plane parallel to X Y can be machined.
  if (!orientation_.is_possible() && (normal_w - Vector3d::UnitZ()).norm() > along_z)
    refuse(call.cause, "a machine with rotary axes for a plane that is tilted",
           "one with " + canon_.letters());
  if (manner != 0) retract(manner, words.number(14), call.cause);
  // _DIR 0 computes the plane without moving the axes.
  const bool turns = direction != 0 && orientation_.is_possible();
  if (turns) turn_to(normal_w, direction, tip_stays, call.cause);
  // A new CYCLE800 ends TRANS and ROT.
  programmable_ = {};
  programmable_turns_.setZero();
  swivel_ = Swivel{frame, turns};
  apply_tool();
}

/// Retracts from the workpiece before the rotary axes move.
void Machine::retract(int manner, double by, const Cause& cause) {
  // _FR 5 retracts along the tool by _FR_I, 1 along Z, 2 along Z then X Y.
  if (manner == 5) {
    if (!orientation_.is_possible()) refuse(cause, "_FR 0 to 2 on a machine without rotary axes");
    if (!(by >= 0 && by * unit() <= 1e6)) refuse(cause, "_FR_I of 0 to 1e6 mm");
    canon_.go_to(Coordinates::Tip, cause);
    AxisVector end = canon_.position();
    const Vector3d away = by * unit() * orientation_.direction_w(end);
    for (int k = 0; k < 3; ++k) end[joint(k)] += away[k];
    return canon_.traverse({.end = std::move(end), .cause = cause});
  }
  if (manner != 1 && manner != 2 && manner != 4)
    refuse(cause, "_FR 0, 1, 2, 4 or 5", fmt::format("{}", manner));
  const int z = joint(2);
  if (z < 0) refuse(cause, "a machine with a Z axis");
  const AxisVector first = program::start_of(canon_.options());
  canon_.assume({fmt::format("CYCLE800 retracts Z to {:.6g} mm, where it stood at first", first[z]),
                 "machine.home"});
  canon_.go_to(Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  // Z must never move down for a retraction.
  end[z] = std::max(end[z], first[z]);
  canon_.traverse({.end = end, .cause = cause});
  if (manner != 2) return;
  for (int k = 0; k < 2; ++k)
    if (const int j = joint(k); j >= 0) end[j] = first[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

/// Selects, of the solutions for the tool direction, the one whose first (second) rotary axis is
/// lower or higher; an axis that does not matter goes to zero.
void Machine::turn_to(const Vector3d& direction_w, int preference, bool tip_stays,
                      const Cause& cause) {
  AxisVector near = canon_.position();
  // Solved from zero, which is where a free axis goes.
  for (const int j : orientation_.rotary_joints()) near[j] = 0.0;
  const std::vector<AxisVector> all = orientation_.positions(direction_w, near);
  if (all.empty())
    refuse(cause, "a plane that the rotary axes reach",
           fmt::format("its normal ({:.6g}, {:.6g}, {:.6g})", direction_w.x(), direction_w.y(),
                       direction_w.z()));
  const std::size_t number = std::abs(preference) == 2 && orientation_.rotary_joints().size() > 1 ? 1 : 0;
  const int judged = orientation_.rotary_joints()[number];
  constexpr double alike = 1e-9;  // rad, below it two solutions count as equal
  const AxisVector* best = &all.front();
  for (const AxisVector& one : all)
    if ((one[judged] - (*best)[judged]) * preference > alike) best = &one;
  canon_.go_to(tip_stays ? Coordinates::Tip : Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  for (const int j : orientation_.rotary_joints()) end[j] = (*best)[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

namespace {

// Cycles whose moves are known; milling cycles are not expanded.
constexpr std::string_view drilling_cycles[] = {"CYCLE81", "CYCLE82", "CYCLE83", "CYCLE84",
                                                "CYCLE85", "CYCLE86", "CYCLE89"};

/// Arguments of a drilling cycle by position.
class CycleParameters {
 public:
  CycleParameters(const ProgramCall& call, const program::Canon& canon, double unit)
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
  /// Throws BadInput if an argument that is not supported has a value other than zero.
  void only_zero(std::size_t first, std::size_t last) const {
    for (std::size_t i = first; i <= last; ++i)
      if (number(i) != 0)
        canon_.refuse(cause(i),
                      fmt::format("nothing or 0 as parameter {} of {}", i + 1, call_.name));
  }
  /// Throws BadInput for more arguments than are known; the last ones only describe the input mask.
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

/// A hole in program coordinates, from the current position of the axes.
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
  /// Positive values are seconds, negative ones spindle turns.
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
  CycleParameters words_;
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
  // The retraction plane lies on the side from which the hole is drilled.
  const double side = levels.retract >= reference ? 1.0 : -1.0;
  levels.reference = reference;
  levels.start = reference + side * std::abs(words_.length(2));
  // DPR counts from the reference plane; if both are given it has precedence.
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
  PeckParameters words;
  // FDEP is absolute, FDPR counts from the reference plane and has precedence.
  if (words_.has(5) && !(words_.has(6) && words_.number(6) != 0))
    words.first = std::abs(levels_.reference - words_.length(5));
  else
    words.first = std::abs(words_.length(6));
  if (!(words.first > 0)) canon_.refuse(words_.cause(6), "the first depth FDEP or FDPR in CYCLE83");
  // A negative degression is a factor and has no unit.
  words.degression = words_.number(7) >= 0 ? words_.length(7) : words_.number(7);
  words.least = words_.length(13);
  const double total = std::abs(levels_.reference - levels_.bottom);
  if (words.first > total)
    canon_.refuse(words_.cause(words_.has(5) ? 5 : 6), "a first depth that is not beyond the whole",
                  fmt::format("{} mm of {} mm", words.first, total));
  const auto depths = peck_depths(total, words);
  if (depths.empty()) canon_.refuse(call_.cause, "at most 1e5 pecks in a hole", "more");
  constexpr double moves_per_peck = 5.0;  // at most, dwells included
  machine_.run_.check_moves(moves_per_peck * double(depths.size()), call_.cause);
  const double side = levels_.start >= levels_.bottom ? 1.0 : -1.0;
  // FRF scales the feed of the first peck.
  const double factor = words_.has(10) && words_.number(10) > 0 ? words_.number(10) : 1.0;
  const bool clears = words_.number(11) == 1;
  if (words_.number(11) != 0 && !clears)
    canon_.refuse(words_.cause(11), "VARI 0 or 1: chips broken or cleared");
  // 1 mm is the default retraction of chip breaking.
  const double lift = words_.number(14) > 0 ? words_.length(14) : 1.0;
  const double before = words_.number(16) > 0 ? words_.length(16) : peck_stop_distance(total);
  const auto feed = canon_.feed();
  const double last_wait =
      words_.has(15) && words_.number(15) != 0 ? words_.number(15) : words_.number(8);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    // Counted as blocks, so that a limit stops endless holes.
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
      // The drill returns at rapid to just above the last depth.
      const double above = levels_.reference - side * (depths[i] - before);
      to(side * std::min(side * above, side * levels_.start), true);
    } else {
      to(levels_.reference - side * (depths[i] - lift), false);
    }
  }
  to(levels_.retract, true);
}

/// Rigid tapping: down at the pitch, spindle reversed, and out.
void Hole::tap() {
  const double metric = words_.number(7);
  // MPIT gives the thread by its size, PIT by its pitch; the sign is the direction.
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
  // SDAC states the spindle after the cycle.
  canon_.turn_spindle(after == 3 ? 1 : after == 4 ? -1 : 0);
  to(levels_.retract, true);
}

// CYCLE86: the tool is lifted off the wall with the spindle at rest before it retracts.
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

/// Throws BadInput for arguments that would change what is cut and are not supported.
void Hole::check_parameters() const {
  const std::string& name = call_.name;
  const bool has_axis = name == "CYCLE83" || name == "CYCLE84";
  if (const double axis = has_axis ? words_.number(12) : 0.0; axis != 0) {
    const int said = axis == 1   ? machine_.joint(0)
                     : axis == 2 ? machine_.joint(1)
                                 : machine_.joint(2);
    if (said != deep_) canon_.refuse(words_.cause(12), "_AXN of the axis across the plane");
  }
  // Ranges of arguments that must be zero, and their largest number.
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
  // In inverse time each move would need an F of its own.
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
  // CYCLE82 and others dwell at the bottom.
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
  if (compensation_.is_on()) refuse(call.cause, "G40 before " + call.name);
  compensation_.clear_leaving();
  if (call.name == "CYCLE800") {
    swivel(call);
    return true;
  }
  // Checks tool and plane as for a motion block.
  Block nothing;
  check_motion(nothing);
  Hole(*this, call).make();
  return true;
}

}  // namespace abbe::sim::dialects::siemens
