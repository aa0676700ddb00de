#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// rad; a smaller inclination counts as none.
constexpr double min_tilt = 1e-12;

}  // namespace

Matrix3d Machine::total_rotation() const {
  return swivel_ ? Matrix3d(swivel_->frame.rotation * programmable_frame_.rotation)
                 : programmable_frame_.rotation;
}

/// Sets the frame: the programmable frame within the swivelled plane within the work offset.
/// Offsets of the scene alone keep their bits.
void Machine::apply_frame() {
  canon_.set_tip_mode(is_tip_mode(), {1, {}});
  const CoordinateFrame sum =
      swivel_ ? compose(swivel_->frame, programmable_frame_) : programmable_frame_;
  program::Frame frame;
  if (system_ >= 0) frame.shift = program::work_offset(canon_.options(), system_ + 1);
  if (!sum.rotation.isIdentity(0.0)) frame.rotation = sum.rotation;
  const bool has_axis_shift = !programmable_axis_shift_.isZero(0.0);
  if (!sum.shift.isZero(0.0) || has_axis_shift) {
    if (frame.shift.size() == 0) frame.shift = AxisVector::Zero(canon_.position().size());
    if (has_axis_shift) frame.shift += programmable_axis_shift_;
    for (int k = 0; k < 3; ++k)
      if (const int j = joint(k); j >= 0) frame.shift[j] += sum.shift[k];
  }
  canon_.set_frame(system_, std::move(frame));
}

// The exit of a compensation is dropped, because it would end in the other coordinates.
void Machine::change_transformation(const Code& code) {
  const bool is_traori = code.word == "TRAORI";
  if (is_traori && !orientation_.is_possible())
    throw_input_error(code.cause, "a machine with X Y Z and one or two rotary axes for TRAORI",
                      "one with " + canon_.letters());
  compensation_.clear_leaving();
  is_traori_ = is_traori;
  apply_tool();
}

/// Returns the shift or rotation that a block with TRANS, ATRANS, ROT or AROT states.
CoordinateFrame Machine::programmed_frame(const Block& block) const {
  const Code& code = block[Group::Frame];
  CoordinateFrame frame;
  if (code.word == "TRANS" || code.word == "ATRANS") {
    for (int k = 0; k < 3; ++k) frame.shift[k] = block.axis_word(k).value * unit();
    return frame;
  }
  const Value& in_plane = block["RPL"];
  const Value* axis = first_axis_word(block);
  if (in_plane && axis != nullptr)
    throw_input_error(in_plane, "either RPL or X Y Z with " + shown(code.cause.text));
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) throw_input_error(code.cause, "a machine with X Y Z for a rotated frame");
  if (in_plane) {
    frame.rotation = rotation_about(plane_normal(), in_plane.value);
    return frame;
  }
  // ROT rotates about Z, then the new Y, then the new X (RPY angles, the default of the control).
  frame.rotation = rotation_about(2, block["Z"].value) * rotation_about(1, block["Y"].value) *
                   rotation_about(0, block["X"].value);
  return frame;
}

void Machine::execute_frame(const Block& block) {
  const Code& code = block[Group::Frame];
  const bool is_shift = code.word == "TRANS" || code.word == "ATRANS";
  // AC() and similar words have no meaning in a frame.
  for (const auto& value : block.values)
    if (value && value.mode != PositionMode::Modal)
      throw_input_error(value, "a number with a frame");
  AxisVector axis_shift = AxisVector::Zero(programmable_axis_shift_.size());
  for (int k = 3; k < 9; ++k) {
    const Value& word = block.axis_word(k);
    if (!word) continue;
    if (!is_shift) throw_input_error(word, "X Y Z with " + shown(code.cause.text));
    const int j = joint(k);
    axis_shift[j] = word.value * (canon_.is_linear(j) ? unit() : units::deg);
  }
  for (int k = 0; k < 3; ++k)
    if (const Value& word = block.axis_word(k); word && !(std::abs(word.value) <= 1e6))
      throw_input_error(word, "a number within 1e6");
  if (is_shift && block["X"]) require_radius_words(block["X"]);
  const CoordinateFrame frame = programmed_frame(block);
  // ATRANS and AROT add to the frame in force, TRANS and ROT replace it.
  const bool is_additive = code.word[0] == 'A';
  programmable_frame_ = is_additive ? compose(programmable_frame_, frame) : frame;
  programmable_axis_shift_ =
      is_additive ? AxisVector(programmable_axis_shift_ + axis_shift) : axis_shift;
  // Bounds additive shifts in a loop.
  if (programmable_frame_.shift.cwiseAbs().maxCoeff() > 1e9)
    throw_input_error(code.cause, "shifts with a sum of less than 1e9 mm");
  apply_frame();
}

void Machine::end_swivel() {
  // A program may rely on its frames after CYCLE800(), so their end is reported.
  if (!programmable_frame_.is_identity())
    run_.warn_once("TRANS and ROT that are active at CYCLE800() end with it");
  swivel_.reset();
  programmable_frame_ = {};
  programmable_axis_shift_.setZero();
  apply_tool();
}

namespace {

/// Arguments of a cycle by position.
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
  double number(std::size_t i, double default_value = 0.0) const {
    if (!has(i)) return default_value;
    if (!call_.arguments[i].number) canon_.throw_input_error(cause(i), "a number");
    return *call_.arguments[i].number;
  }
  double length(std::size_t i) const { return number(i) * unit_; }
  int integer(std::size_t i, int default_value, int min, int max) const {
    const double value = number(i, default_value);
    if (value != std::floor(value) || value < min || value > max)
      throw_input_error(i, fmt::format("an integer from {} to {}", min, max));
    return int(value);
  }
  Vector3d vector(std::size_t i) const { return {number(i), number(i + 1), number(i + 2)}; }
  double positive(std::size_t i, std::string_view name) const {
    if (!(number(i) > 0))
      throw_input_error(i, fmt::format("{} greater than zero in {}", name, call_.name));
    return number(i);
  }
  /// Throws BadInput if one of the unsupported arguments `first` to `last` is not zero.
  void require_zero(std::size_t first, std::size_t last) const {
    for (std::size_t i = first; i <= last; ++i)
      if (number(i) != 0)
        throw_input_error(i, fmt::format("nothing or 0 as parameter {} of {}", i + 1, call_.name));
  }
  /// Throws BadInput for more than `count` arguments.
  void require_at_most(std::size_t count) const {
    if (call_.arguments.size() > count)
      throw_input_error(count, fmt::format("at most {} parameters of {}", count, call_.name));
  }
  [[noreturn]] void throw_input_error(std::size_t i, std::string expected) const {
    canon_.throw_input_error(cause(i), std::move(expected));
  }

 private:
  const ProgramCall& call_;
  const program::Canon& canon_;
  double unit_;
};

/// Returns the rotation of the plane. Bits 7 and 6 of _MODE state the meaning of the angles, the
/// pairs of bits below them the axes in their order.
Matrix3d swivel_frame_rotation(const CycleParameters& words) {
  // 57 = 0b111001 is X, Y, Z in this order, the default.
  const int mode = words.integer(3, 57, 0, 255);
  const Vector3d angles = words.vector(7);
  if (mode >= 128)
    words.throw_input_error(3, mode >= 192
                                   ? "plane angles: not positions of rotary axes (_MODE 192)"
                                   : "_MODE by axes or by solid angle: not projected angles");
  if (mode >= 64) return swivel_rotation(SwivelMode::SolidAngle, {}, angles);
  Eigen::Vector3i order;
  for (int k = 0; k < 3; ++k) {
    const int axis = (mode >> (2 * k)) & 3;
    if (axis == 0 && angles[k] != 0) words.throw_input_error(3, "an axis for every angle in _MODE");
    order[k] = std::max(axis, 1) - 1;
  }
  return swivel_rotation(SwivelMode::AxisByAxis, order, angles);
}

}  // namespace

void Machine::execute_cycle800(const ProgramCall& call) {
  const CycleParameters words(call, canon_, unit());
  words.require_at_most(16);
  // CYCLE800() and the swivel data "0" end the plane.
  const bool is_end =
      call.arguments.empty() || (call.arguments.size() > 1 && call.arguments[1].text == "0");
  if (is_end) return end_swivel();
  const int retraction = words.integer(0, 0, 0, 8), status = words.integer(2, 0, 0, 299999);
  const bool is_additive = status % 10 == 1, keeps_tip = status / 10 % 10 == 1;
  // Digits of _ST: new or additive, follow-up of the tip, and direction.
  if (status % 10 > 1 || status / 10 % 10 > 1 || status / 100 % 100 != 0 || status / 10000 % 10 > 1)
    words.throw_input_error(2, "_ST new or additive, with or without tip follow-up, and direction");
  const int direction = status / 10000 % 10 == 1 ? 0 : words.integer(13, -1, -2, 2);
  if (is_additive && !programmable_frame_.is_identity())
    throw_input_error(call.cause, "TRANS without words before an additive CYCLE800");
  // As on the control the plane is shifted to the reference point, rotated, and shifted in itself.
  const CoordinateFrame shift_before{words.vector(4) * unit(), Matrix3d::Identity()};
  const CoordinateFrame rotation{Vector3d::Zero(), swivel_frame_rotation(words)};
  const CoordinateFrame shift_after{words.vector(10) * unit(), Matrix3d::Identity()};
  CoordinateFrame frame = compose(compose(shift_before, rotation), shift_after);
  if (is_additive && swivel_) frame = compose(swivel_->frame, frame);
  if (!(frame.shift.cwiseAbs().maxCoeff() < 1e9))
    throw_input_error(call.cause, "a plane within 1e9 mm");
  const Vector3d normal_w = frame.rotation.col(2);
  // Without rotary axes only a plane parallel to X Y can be machined.
  if (!orientation_.is_possible() && (normal_w - Vector3d::UnitZ()).norm() > min_tilt)
    throw_input_error(call.cause, "a machine with rotary axes for a tilted plane",
                      "one with " + canon_.letters());
  if (retraction != 0) retract(retraction, words.number(14), call.cause);
  // _DIR 0 computes the plane without moving the axes.
  const bool rotates = direction != 0 && orientation_.is_possible();
  if (rotates) swivel_tool(normal_w, direction, keeps_tip, call.cause);
  // A new CYCLE800 ends TRANS and ROT.
  programmable_frame_ = {};
  programmable_axis_shift_.setZero();
  swivel_ = Swivel{frame, rotates};
  apply_tool();
}

/// Retracts from the workpiece before the rotary axes move.
void Machine::retract(int mode, double distance, const Cause& cause) {
  // _FR 5 retracts along the tool by _FR_I, 1 along Z, 2 along Z and then along X Y.
  if (mode == 5) {
    if (!orientation_.is_possible())
      throw_input_error(cause, "_FR 0 to 2 on a machine without rotary axes");
    if (!(distance >= 0 && distance * unit() <= 1e6))
      throw_input_error(cause, "_FR_I from 0 to 1e6 mm");
    canon_.go_to(Coordinates::Tip, cause);
    AxisVector end = canon_.position();
    const Vector3d displacement = distance * unit() * orientation_.direction_w(end);
    for (int k = 0; k < 3; ++k) end[joint(k)] += displacement[k];
    return canon_.traverse({.end = std::move(end), .cause = cause});
  }
  if (mode != 1 && mode != 2 && mode != 4)
    throw_input_error(cause, "_FR 0, 1, 2, 4 or 5", fmt::format("{}", mode));
  const int z = joint(2);
  if (z < 0) throw_input_error(cause, "a machine with a Z axis");
  const AxisVector start = program::initial_position(canon_.options());
  canon_.assume({fmt::format("CYCLE800 retracts Z to {:.6g} mm, its start position", start[z]),
                 "machine.home"});
  canon_.go_to(Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  // A retraction must never move Z down.
  end[z] = std::max(end[z], start[z]);
  canon_.traverse({.end = end, .cause = cause});
  if (mode != 2) return;
  for (int k = 0; k < 2; ++k)
    if (const int j = joint(k); j >= 0) end[j] = start[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

/// Moves the rotary axes to the tool direction. Of the solutions `preference` selects the one whose
/// first (-1, 1) or second (-2, 2) rotary axis is lower or higher. An axis without influence goes
/// to zero.
void Machine::swivel_tool(const Vector3d& direction_w, int preference, bool keeps_tip,
                          const Cause& cause) {
  AxisVector near = canon_.position();
  // The solution starts from zero, so that a free axis goes there.
  for (const int j : orientation_.rotary_joints()) near[j] = 0.0;
  const std::vector<AxisVector> solutions = orientation_.positions(direction_w, near);
  if (solutions.empty())
    throw_input_error(cause, "a plane that the rotary axes can reach",
                      fmt::format("its normal ({:.6g}, {:.6g}, {:.6g})", direction_w.x(),
                                  direction_w.y(), direction_w.z()));
  const std::size_t axis_index =
      std::abs(preference) == 2 && orientation_.rotary_joints().size() > 1 ? 1 : 0;
  const int compared_joint = orientation_.rotary_joints()[axis_index];
  constexpr double tolerance = 1e-9;  // rad, below it two solutions count as equal
  const AxisVector* best = &solutions.front();
  for (const AxisVector& solution : solutions)
    if ((solution[compared_joint] - (*best)[compared_joint]) * preference > tolerance)
      best = &solution;
  canon_.go_to(keeps_tip ? Coordinates::Tip : Coordinates::Axis, cause);
  AxisVector end = canon_.position();
  for (const int j : orientation_.rotary_joints()) end[j] = (*best)[j];
  canon_.traverse({.end = std::move(end), .cause = cause});
}

namespace {

// Cycles that are expanded into moves; milling cycles are not.
constexpr std::string_view drilling_cycles[] = {"CYCLE81", "CYCLE82", "CYCLE83", "CYCLE84",
                                                "CYCLE85", "CYCLE86", "CYCLE89"};

}  // namespace

/// A hole that a drilling cycle makes at the current position of the axes.
class Hole {
 public:
  Hole(Machine& machine, const ProgramCall& call)
      : machine_(machine),
        canon_(machine.canon_),
        call_(call),
        parameters_(call, canon_, machine.unit()),
        position_(canon_.programmed()),
        depth_joint_(machine.arc_plane(call.cause).normal) {
    if (depth_joint_ < 0)
      canon_.throw_input_error(call.cause, "a machine with an axis normal to the plane");
    levels_ = levels();
  }

  void make() {
    const std::string& name = call_.name;
    // Under inverse time each move would need an F of its own.
    if (canon_.feed_mode() == FeedMode::InverseTime)
      canon_.throw_input_error(call_.cause, "G94 or G95 with a cycle");
    check_parameters();
    move_to_level(levels_.start, true);
    if (name == "CYCLE83") return drill_pecks();
    if (name == "CYCLE84") return tap();
    if (name == "CYCLE86") return bore_and_lift();
    const auto feed = canon_.feed();
    if (name == "CYCLE85") set_feed(parameters_.positive(6, "FFR (feed)"));
    move_to_level(levels_.bottom, false);
    if (name != "CYCLE81" || parameters_.has(5)) dwell(parameters_.number(5));
    if (name == "CYCLE85") set_feed(parameters_.positive(7, "RFF (feed out)"));
    if (name == "CYCLE85" || name == "CYCLE89") move_to_level(levels_.start, false);
    canon_.set_feed(feed);
    move_to_level(levels_.retract, true);
  }

 private:
  HoleLevels levels() const {
    for (const std::size_t i : {0, 1})
      if (!parameters_.has(std::size_t(i)))
        canon_.throw_input_error(call_.cause, "the planes RTP and RFP in " + call_.name, "none");
    if (!parameters_.has(3) && !parameters_.has(4))
      canon_.throw_input_error(call_.cause, "the depth DP or DPR in " + call_.name, "none");
    HoleLevels levels;
    levels.retract = parameters_.length(0);
    const double reference = parameters_.length(1);
    // The retraction plane lies on the side from which the hole is drilled.
    const double side = levels.retract >= reference ? 1.0 : -1.0;
    levels.reference = reference;
    levels.start = reference + side * std::abs(parameters_.length(2));
    // DPR counts from the reference plane; it has precedence over DP.
    const bool is_relative = parameters_.has(4) && parameters_.number(4) != 0;
    levels.bottom = is_relative || !parameters_.has(3)
                        ? reference - side * std::abs(parameters_.length(4))
                        : parameters_.length(3);
    if (side * (reference - levels.bottom) <= 0)
      canon_.throw_input_error(
          parameters_.has(3) ? parameters_.cause(3) : parameters_.cause(4),
          "a depth beyond the reference plane as viewed from the retraction plane",
          fmt::format("reference {} mm, depth {} mm", reference, levels.bottom));
    return levels;
  }

  /// Throws BadInput for unsupported arguments that would change the hole.
  void check_parameters() const {
    const std::string& name = call_.name;
    const bool has_axis = name == "CYCLE83" || name == "CYCLE84";
    if (const double axis = has_axis ? parameters_.number(12) : 0.0; axis != 0) {
      const int joint = axis == 1   ? machine_.joint(0)
                        : axis == 2 ? machine_.joint(1)
                                    : machine_.joint(2);
      if (joint != depth_joint_)
        canon_.throw_input_error(parameters_.cause(12), "_AXN of the axis normal to the plane");
    }
    // Ranges of arguments that must be zero, and the number of arguments of a cycle. The last
    // arguments only describe the input mask.
    struct ArgumentLimits {
      std::string_view name;
      std::size_t zero_first, zero_last, max_count;
    };
    static constexpr ArgumentLimits all_limits[] = {
        {"CYCLE81", 6, 6, 9},    {"CYCLE82", 6, 6, 9},  {"CYCLE83", 17, 17, 20},
        {"CYCLE84", 15, 15, 26}, {"CYCLE85", 8, 8, 11}, {"CYCLE86", 11, 11, 14},
        {"CYCLE89", 6, 6, 9}};
    for (const ArgumentLimits& limits : all_limits) {
      if (limits.name != name) continue;
      parameters_.require_at_most(limits.max_count);
      parameters_.require_zero(limits.zero_first, limits.zero_last);
    }
  }

  void move_to_level(double level, bool rapid) {
    position_[depth_joint_] = level;
    move_to_position(rapid);
  }
  void move_to_position(bool rapid) {
    machine_.make_straight({.end = canon_.placed(position_), .cause = call_.cause}, rapid);
  }
  /// Dwells for a time in seconds, or for -time spindle revolutions if it is negative.
  void dwell(double time) {
    if (time < 0 && !(canon_.spindle_speed() > 0))
      canon_.throw_input_error(call_.cause, "a running spindle for a dwell in revolutions");
    canon_.dwell(time < 0 ? -time * 60.0 / canon_.spindle_speed() : time, call_.cause);
  }
  void drill_pecks() {
    PeckParameters pecks;
    // FDEP is absolute, FDPR counts from the reference plane and has precedence.
    if (parameters_.has(5) && !(parameters_.has(6) && parameters_.number(6) != 0))
      pecks.first = std::abs(levels_.reference - parameters_.length(5));
    else
      pecks.first = std::abs(parameters_.length(6));
    if (!(pecks.first > 0))
      canon_.throw_input_error(parameters_.cause(6), "the first depth FDEP or FDPR in CYCLE83");
    // A negative degression is a factor and has no unit.
    pecks.degression = parameters_.number(7) >= 0 ? parameters_.length(7) : parameters_.number(7);
    pecks.min_peck = parameters_.length(13);
    const double total = std::abs(levels_.reference - levels_.bottom);
    if (pecks.first > total)
      canon_.throw_input_error(parameters_.cause(parameters_.has(5) ? 5 : 6),
                               "a first depth not beyond the total depth",
                               fmt::format("{} mm of {} mm", pecks.first, total));
    const auto depths = peck_depths(total, pecks);
    if (depths.empty())
      canon_.throw_input_error(call_.cause, "at most 1e5 pecks in a hole", "more");
    constexpr double moves_per_peck = 5.0;  // at most, dwells included
    machine_.run_.check_moves(moves_per_peck * double(depths.size()), call_.cause);
    const double side = levels_.start >= levels_.bottom ? 1.0 : -1.0;
    // FRF scales the feed of the first peck.
    const double factor =
        parameters_.has(10) && parameters_.number(10) > 0 ? parameters_.number(10) : 1.0;
    const bool clears_chips = parameters_.number(11) == 1;
    if (parameters_.number(11) != 0 && !clears_chips)
      canon_.throw_input_error(parameters_.cause(11),
                               "VARI 0 or 1: with chip breaking or with full retraction");
    // Chip breaking retracts by 1 mm unless VRT states another distance.
    const double lift = parameters_.number(14) > 0 ? parameters_.length(14) : 1.0;
    const double stop_distance =
        parameters_.number(16) > 0 ? parameters_.length(16) : peck_stop_distance(total);
    const auto feed = canon_.feed();
    const double last_dwell = parameters_.has(15) && parameters_.number(15) != 0
                                  ? parameters_.number(15)
                                  : parameters_.number(8);
    for (std::size_t i = 0; i < depths.size(); ++i) {
      // Each peck counts as a block, so that the limit of blocks bounds the pecks.
      machine_.run_.count_block();
      if (i == 0 && feed) canon_.set_feed(Feed{feed->word * factor, feed->unit});
      move_to_level(levels_.reference - side * depths[i], false);
      if (i == 0) canon_.set_feed(feed);
      const bool is_last = i + 1 == depths.size();
      dwell(is_last ? last_dwell : parameters_.number(8));
      if (is_last) break;
      if (clears_chips) {
        move_to_level(levels_.start, true);
        dwell(parameters_.number(9));
        // The drill returns at rapid to a level just above the last depth.
        const double return_level = levels_.reference - side * (depths[i] - stop_distance);
        move_to_level(side * std::min(side * return_level, side * levels_.start), true);
      } else {
        move_to_level(levels_.reference - side * (depths[i] - lift), false);
      }
    }
    move_to_level(levels_.retract, true);
  }

  /// Executes CYCLE84, rigid tapping: down at the pitch, and out with the spindle reversed.
  void tap() {
    const double size = parameters_.number(7);
    // MPIT states the thread by its size, PIT by its pitch; the sign is the direction.
    double pitch = size != 0 ? coarse_pitch(std::abs(size)) : parameters_.length(8);
    if (size != 0 && pitch == 0)
      canon_.throw_input_error(parameters_.cause(7), "MPIT from 3 to 48, a coarse thread");
    const bool is_left_handed = size < 0 || pitch < 0;
    pitch = std::abs(pitch);
    if (!(pitch > 0 && pitch <= 1000))
      canon_.throw_input_error(parameters_.cause(8), "the pitch PIT or MPIT in CYCLE84");
    const double speed = parameters_.positive(10, "SST (speed)");
    const double speed_out = parameters_.number(11) > 0 ? parameters_.number(11) : speed;
    if (parameters_.number(13) > 1)
      canon_.throw_input_error(parameters_.cause(13), "a pitch in mm (_PITA 0 or 1)");
    const FeedMode mode = canon_.feed_mode();
    const auto feed = canon_.feed();
    const double rpm = canon_.spindle_speed();
    const int spindle_code = int(parameters_.number(6));
    canon_.set_feed_mode(FeedMode::PerRevolution);
    canon_.set_feed(Feed{pitch, 1.0});
    canon_.set_spindle_speed(speed);
    canon_.turn_spindle(is_left_handed ? -1 : 1);
    move_to_level(levels_.bottom, false);
    if (parameters_.number(5) > 0) dwell(parameters_.number(5));
    canon_.set_spindle_speed(speed_out);
    canon_.turn_spindle(is_left_handed ? 1 : -1);
    move_to_level(levels_.start, false);
    canon_.set_feed_mode(mode);
    canon_.set_feed(feed);
    canon_.set_spindle_speed(rpm);
    // SDAC states the spindle after the cycle.
    canon_.turn_spindle(spindle_code == 3 ? 1 : spindle_code == 4 ? -1 : 0);
    move_to_level(levels_.retract, true);
  }

  /// Executes CYCLE86: before the tool retracts, it is lifted off the wall with the spindle at
  /// rest.
  void bore_and_lift() {
    const int direction = int(parameters_.number(6));
    if (direction != 3 && direction != 4)
      canon_.throw_input_error(parameters_.cause(6), "SDIR 3 or 4 in CYCLE86");
    canon_.turn_spindle(direction == 3 ? 1 : -1);
    move_to_level(levels_.bottom, false);
    dwell(parameters_.number(5));
    canon_.turn_spindle(0);
    const AxisVector hole_position = position_;
    const auto plane = machine_.arc_plane(call_.cause);
    position_[plane.first] += parameters_.length(7);
    position_[plane.second] += parameters_.length(8);
    position_[depth_joint_] += parameters_.length(9);
    move_to_position(true);
    move_to_level(levels_.start, true);
    move_to_level(levels_.retract, true);
    position_ = hole_position;
    move_to_level(levels_.retract, true);
  }

  void set_feed(double feed) {
    if (feed > 0) canon_.set_feed(Feed{feed, machine_.is_feed_in_inches_ ? units::inch : 1.0});
  }

  Machine& machine_;
  program::Canon& canon_;
  const ProgramCall& call_;
  CycleParameters parameters_;
  AxisVector position_;  ///< program coordinates
  int depth_joint_;
  HoleLevels levels_;
};

bool Machine::is_cycle(std::string_view name) {
  return name == "CYCLE800" || std::find(std::begin(drilling_cycles), std::end(drilling_cycles),
                                         name) != std::end(drilling_cycles);
}

bool Machine::execute_cycle(const ProgramCall& call) {
  if (!is_cycle(call.name)) return false;
  if (compensation_.is_on()) throw_input_error(call.cause, "G40 before " + call.name);
  compensation_.clear_leaving();
  if (call.name == "CYCLE800") {
    execute_cycle800(call);
    return true;
  }
  // Checks tool and plane as for a motion block.
  check_motion(Block{});
  Hole(*this, call).make();
  return true;
}

}  // namespace abbe::sim::dialects::siemens
