#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Vector3d;

namespace {

/// Returns the angle to which an axis at the angle `start` moves for a programmed angle, rad.
double rotary_end(double programmed, double start, PositionMode mode) {
  const double shortest = std::remainder(programmed - start, 2 * pi);  // -pi .. pi
  constexpr double tolerance = 1e-9;  // rad, below it the axis does not move
  if (mode == PositionMode::Shortest) return start + shortest;
  if (mode == PositionMode::Positive)
    return start + (shortest < -tolerance ? shortest + 2 * pi : shortest);
  if (mode == PositionMode::Negative)
    return start + (shortest > tolerance ? shortest - 2 * pi : shortest);
  return programmed;
}

}  // namespace

void Machine::add_axis_word(Target& target, int j, const Value& word, bool machine) const {
  const bool is_linear = canon_.is_linear(j);
  const bool is_increment = word.mode == PositionMode::Incremental ||
                            (word.mode == PositionMode::Modal && is_incremental_);
  // Under DIAM90 an incremental X is a radius, an absolute X a diameter.
  const double factor = j == joint(0) ? x_radius_factor(!is_increment) : 1.0;
  const double value = word.value * (is_linear ? unit() * factor : units::deg);
  const bool has_direction = word.mode == PositionMode::Shortest ||
                             word.mode == PositionMode::Positive ||
                             word.mode == PositionMode::Negative;
  if (has_direction && is_linear) throw_input_error(word, "a rotary axis with DC, ACP and ACN");
  if (has_direction) {
    const double start = machine ? canon_.position()[j] : programmed_position()[j];
    // The roll-over rule of the axis must not change a programmed direction.
    return target.rotate_to(j, rotary_end(value, start, word.mode), word);
  }
  if (is_increment && machine) throw_input_error(word, "an absolute position with SUPA and G53");
  if (is_increment)
    target.by(j, value, word);
  else
    target.to(j, value, word);
}

Target Machine::block_target(const Block& block, bool machine) const {
  Target target;
  for (int k = 0; k < 9; ++k)
    if (const Value& word = block.axis_word(k)) add_axis_word(target, joint(k), word, machine);
  return target;
}

/// Sets the pole of polar coordinates, in program coordinates of the plane (G110 to G112).
void Machine::set_pole(const Block& block) {
  const Code& code = block[Group::Pole];
  const ArcPlane plane = arc_plane(code.cause);
  const AxisVector p = canon_.programmed();
  // G110 counts from the current position, G111 from the workpiece zero, G112 from the last pole.
  const Eigen::Vector2d origin = code.word == "G110"
                                     ? Eigen::Vector2d(p[plane.first], p[plane.second])
                                 : code.word == "G111" ? Eigen::Vector2d(0, 0)
                                                       : pole_.position;
  Eigen::Vector2d displacement(0, 0);
  const Value &radius = block["RP"], &angle = block["AP"];
  if (radius || angle)
    displacement =
        radius.value * unit() *
        Eigen::Vector2d(std::cos(angle.value * units::deg), std::sin(angle.value * units::deg));
  for (int k = 0; k < 2; ++k) {
    const int axis = plane.letters[std::size_t(k)] - 'X';
    if (const Value& word = block.axis_word(axis)) {
      // The manuals do not say if X is a diameter here.
      if (axis == 0) require_radius_words(word);
      displacement[k] = word.value * unit();
    }
  }
  pole_ = {origin + displacement};
}

/// Adds the polar words of a block. RP and AP stay in force until they are programmed again.
void Machine::add_polar_words(Target& target, const Block& block) {
  const Value &radius = block["RP"], &angle = block["AP"];
  if (!radius && !angle) return;
  const Cause cause = radius ? radius.cause : angle.cause;
  const ArcPlane plane = arc_plane(cause);
  if (target.has(plane.first) || target.has(plane.second))
    throw_input_error(cause,
                      fmt::format("either {} {} or AP= RP=", plane.letters[0], plane.letters[1]));
  if (radius) {
    if (radius.value < 0) throw_input_error(radius, "non-negative RP");
    pole_.radius =
        radius.value * unit() + (radius.mode == PositionMode::Incremental ? pole_.radius : 0.0);
  }
  if (angle)
    pole_.angle_deg =
        angle.value + (angle.mode == PositionMode::Incremental ? pole_.angle_deg : 0.0);
  const double a = pole_.angle_deg * units::deg;
  target.to(plane.first, pole_.position.x() + pole_.radius * std::cos(a), cause);
  target.to(plane.second, pole_.position.y() + pole_.radius * std::sin(a), cause);
}

/// Throws BadInput if moves in workpiece coordinates are not possible.
void Machine::check_motion(const Block& block) const {
  const Cause cause = motion_cause(block);
  // In tip mode the chain contains the tool length, so D0 cannot be executed.
  if (is_tip_mode() && !has_tool_length_)
    throw_input_error(cause, "D1 before a move of the tip, which includes the tool length");
  if (swivel_ && !swivel_->is_aligned && !is_traori_ &&
      (swivel_->frame.rotation.col(2) - Eigen::Vector3d::UnitZ()).norm() > 1e-12)
    throw_input_error(cause,
                      "TRAORI, or CYCLE800 with _DIR, before a move in a plane to which the rotary "
                      "axes have not swivelled");
  if (swivel_ && swivel_->is_aligned && !is_traori_)
    for (const Address address : Addresses{"A", "B", "C"})
      if (block[address])
        throw_input_error(block[address], "TRAORI or CYCLE800() before a rotary axis turns");
  // On a machine with rotary axes the length of the scene's tool is part of the coordinates, so its
  // value is needed under D0; on other machines it is needed under D1.
  const bool needs_length = orientation_.is_possible() ? !has_tool_length_ : has_tool_length_;
  if (needs_length && !is_known_tool() && joint(2) >= 0 && !canon_.options().tool_length.empty() &&
      motion_ != "G0")
    throw_input_error(cause, "a tool (T) before a feed: the tools of the scene differ in length");
  // Without a tool call the only tool of the scene is assumed.
  if (tool_ < 0 && motion_ != "G0" && has_tool_length_ && has_single_length())
    run_.assume_only_tool(cause, "no tool called");
}

void Machine::make_straight(Straight move, bool rapid) {
  if (compensation_.is_on()) return compensation_.straight(std::move(move), rapid);
  compensation_.clear_leaving();
  canon_.straight(std::move(move), rapid);
}

void Machine::apply_tool_vector(const Block& block, AxisVector& end) const {
  const Value &a = block["A3"], &b = block["B3"], &c = block["C3"];
  if (!a && !b && !c) return;
  const Cause cause = a ? a.cause : b ? b.cause : c.cause;
  for (const Address address : Addresses{"A", "B", "C"})
    if (block[address]) throw_input_error(block[address], "either rotary axes or A3= B3= C3=");
  // The control accepts vectors of any length.
  const Eigen::Vector3d direction(a.value, b.value, c.value);
  if (!(direction.norm() > 1e-6)) throw_input_error(cause, "a nonzero tool direction");
  // The direction counts in the frames in force.
  const auto solutions = orientation_.positions(total_rotation() * direction.normalized(), end);
  if (solutions.empty())
    throw_input_error(cause, "a direction that the rotary axes can reach",
                      fmt::format("({:.6g}, {:.6g}, {:.6g})", a.value, b.value, c.value));
  // The nearest solution comes first.
  end = solutions.front();
}

void Machine::move_on_great_circle(Straight move) {
  // Without ORIVECT the rule depends on machine data, so the assumption is reported.
  if (!on_great_circle_ && turns_in_workpiece_)
    run_.warn_once(
        "lines turn the tool on great circles, as ORIWKS does if the machine has no other rule: "
        "with ORIAXES or ORIMKS the rotary axes interpolate linearly");
  const auto segments =
      great_circle_segments(orientation_, canon_.position(), move.end, great_circle_tolerance);
  if (segments.empty())
    throw_input_error(move.cause,
                      "ORIAXES before a tool rotation that is not on a great circle of these axes");
  feed_along_segments(canon_, orientation_, segments, move);
}

/// Executes G53, G153 and SUPA: machine coordinates, to which a tool length in force is added.
void Machine::move_in_machine_coordinates(const Block& block) {
  const Code& code = block[Group::WithoutOffset];
  const Value* axis = first_axis_word(block);
  if (axis == nullptr) return;
  if (motion_ != "G0" && motion_ != "G1")
    throw_input_error(code.cause, "G0 or G1 with " + shown(code.cause.text));
  // Under TRAORI X Y Z words are not axis positions.
  if (is_traori_) throw_input_error(code.cause, "TRAFOOF before " + shown(code.cause.text));
  if (is_tip_mode() && has_tool_length_)
    throw_input_error(code.cause, "D0 with " + shown(code.cause.text) + " in a swivelled plane");
  canon_.go_to(Coordinates::Axis, code.cause);
  Target target = block_target(block, true);
  // On a turning control the tool offset in force has X and Z.
  if (const AxisVector shift = active_tool_shift(); run_.is_turning() && shift.size() > 0) {
    for (int k = 0; k < 3; ++k)
      if (const Value& word = block.axis_word(k))
        target.to(joint(k), target.value(joint(k)) + shift[joint(k)], word);
  } else if (const Value& z = block["Z"]; z && has_tool_length_ && is_known_tool())
    target.to(joint(2), target.value(joint(2)) + active_tool_length(z), z);
  AxisVector end = canon_.end_of(target, true);
  make_straight({std::move(end), code.cause, true, target.stated()}, motion_ == "G0");
  if (is_tip_mode()) canon_.go_to(Coordinates::Tip, code.cause);
}

/// Cuts a thread (G33): a line at a feed per revolution that does not depend on F.
void Machine::cut_thread(const Block& block, AxisVector end) {
  const Cause cause = motion_cause(block);
  const AxisVector displacement = end - canon_.position();
  // The pitch is that of the axis with the longest path, as on the control.
  int longest = 0;
  for (int k = 1; k < 3; ++k)
    if (joint(k) >= 0 && (joint(longest) < 0 || std::abs(displacement[joint(k)]) >
                                                    std::abs(displacement[joint(longest)])))
      longest = k;
  const Value& pitch = block[Address("I") + longest];
  if (!pitch || pitch.value == 0)
    throw_input_error(
        cause, fmt::format("{}, the pitch along {}, with G33", "IJK"[longest], "XYZ"[longest]),
        "none");
  double squared_length = 0.0;
  for (int k = 0; k < 3; ++k)
    if (joint(k) >= 0) squared_length += displacement[joint(k)] * displacement[joint(k)];
  const double along = std::abs(displacement[joint(longest)]);
  // The feed along the path is larger than the pitch by the ratio of path to axis travel.
  const double ratio = along > 0 ? std::sqrt(squared_length) / along : 1.0;
  const TemporaryFeed feed(canon_, FeedMode::PerRevolution,
                           Feed{std::abs(pitch.value) * ratio, unit()});
  make_straight({.end = std::move(end), .cause = cause}, false);
}

/// Executes the motion of a block. Returns true if the block had words of motion.
bool Machine::move(const Block& block) {
  if (block[Group::WithoutOffset]) {
    move_in_machine_coordinates(block);
    return first_axis_word(block) != nullptr;
  }
  // A3 B3 C3 alone rotate the tool about its tip; I J K or CR alone make a full circle.
  const bool has_vector = block["A3"] || block["B3"] || block["C3"];
  const bool is_polar = block["AP"] || block["RP"];
  const bool is_circular = motion_ == "G2" || motion_ == "G3" || motion_ == "CIP";
  const bool has_arc_words = block["I"] || block["J"] || block["K"] || block["CR"] || block["AR"];
  if (first_axis_word(block) == nullptr && !has_vector && !is_polar &&
      !(is_circular && has_arc_words))
    return false;
  check_motion(block);
  Target target = block_target(block, false);
  add_polar_words(target, block);
  if (motion_ == "CIP") {
    make_arc_through_point(block, target);
    return true;
  }
  if (is_circular) {
    arc(block, target);
    return true;
  }
  AxisVector end = canon_.target_position_from(current_position(), target, false);
  if (motion_ == "G33") {
    cut_thread(block, std::move(end));
    return true;
  }
  apply_tool_vector(block, end);
  Straight move{std::move(end), motion_cause(block), false, target.stated()};
  const bool rotates = std::ranges::any_of(
      orientation_.rotary_joints(), [&](int j) { return move.end[j] != canon_.position()[j]; });
  // Great circles apply to G1 only; rapids move the rotary axes in proportion.
  if (is_traori_ && rotates && motion_ == "G1" && on_great_circle_.value_or(turns_in_workpiece_))
    move_on_great_circle(std::move(move));
  else
    make_straight(std::move(move), motion_ == "G0");
  return true;
}

Machine::ArcPlane Machine::arc_plane(const Cause& cause) const {
  const std::string_view letters = plane_letters();
  const auto [first, second] = plane_joints(cause);
  return {{letters[0], letters[1], "XYZ"[plane_normal()]}, first, second, joint(plane_normal())};
}

/// Returns the centre that I J K state, in program coordinates.
AxisVector Machine::arc_centre(const Block& block, const ArcPlane& plane,
                               const Cause& cause) const {
  const auto centre_word = [&](std::size_t k) -> const Value& {
    return block[Address("I") + (plane.letters[k] - 'X')];
  };
  const Value &first = centre_word(0), &second = centre_word(1);
  if (const Value& across = centre_word(2))
    throw_input_error(
        across, fmt::format("the centre in the plane {} {}", plane.letters[0], plane.letters[1]));
  if (!first && !second)
    throw_input_error(cause, "I J K, CR=, AR= or a pole with " + std::string(motion_), "none");
  AxisVector p = programmed_position();
  const auto set_coordinate = [&](int j, const Value& word) {
    if (!word) return;
    const bool is_absolute = word.mode == PositionMode::Absolute;
    // An incremental I is a radius even under DIAMON.
    const double factor = is_absolute && j == joint(0) ? x_radius_factor(true) : 1.0;
    const double value = word.value * unit() * factor;
    p[j] = is_absolute ? value : p[j] + value;
  };
  set_coordinate(plane.first, first);
  set_coordinate(plane.second, second);
  return p;
}

void Machine::arc(const Block& block, const Target& words) {
  const Cause cause = motion_cause(block);
  const ArcPlane plane = arc_plane(cause);
  const Value &radius = block["CR"], &angle = block["AR"], &whole_turns = block["TURN"];
  const bool is_polar = block["AP"] || block["RP"];
  const bool has_centre = block["I"] || block["J"] || block["K"];
  // An arc is programmed by exactly one of these.
  if (radius && (angle || has_centre || is_polar))
    throw_input_error(radius, "only one of CR=, AR=, I J K and a pole");
  if (is_polar && (angle || has_centre))
    throw_input_error(cause, "only one of CR=, AR=, I J K and a pole");
  Target target = words;
  ArcMove move{.first = plane.first,
               .second = plane.second,
               .end = {},
               .clockwise = motion_ == "G2",
               .cause = cause,
               .named = radius  ? radius.cause
                        : angle ? angle.cause
                                : cause};
  // The chord of AR=360 would be zero and define no circle.
  if (angle && !(angle.value > 0 && angle.value < 360))
    throw_input_error(angle, "AR greater than 0 and less than 360 degrees");
  const double opening_angle = angle.value * units::deg;
  AxisVector p;
  if (is_polar) {
    p = programmed_position();
    p[plane.first] = pole_.position.x();
    p[plane.second] = pole_.position.y();
  } else if (has_centre || (!radius && !angle)) {
    p = arc_centre(block, plane, cause);
  }
  // AR with the centre: the end is the start rotated about the centre.
  if (angle && has_centre) {
    if (target.has(plane.first) || target.has(plane.second))
      throw_input_error(angle, "AR= with either the centre or the end");
    const AxisVector start = programmed_position();
    const Eigen::Rotation2Dd rotation(move.clockwise ? -opening_angle : opening_angle);
    const Eigen::Vector2d end = Eigen::Vector2d(p[plane.first], p[plane.second]) +
                                rotation * Eigen::Vector2d(start[plane.first] - p[plane.first],
                                                           start[plane.second] - p[plane.second]);
    target.to(plane.first, end.x(), angle);
    target.to(plane.second, end.y(), angle);
  }
  move.end = canon_.target_position_from(current_position(), target, false);
  if (p.size() > 0) {
    move.centre_with_offsets = canon_.placed(std::move(p));
  } else if (radius) {
    move.radius = radius.value * unit();
  } else {
    const AxisVector from = programmed_position(), to = canon_.without_offsets(move.end);
    const double chord =
        std::hypot(to[plane.first] - from[plane.first], to[plane.second] - from[plane.second]);
    // AR with the end: the radius follows from the chord. A negative radius is an arc of more than
    // half a turn.
    const double r = chord / (2 * std::sin(0.5 * opening_angle));
    move.radius = opening_angle > pi ? -r : r;
  }
  if (whole_turns && (whole_turns.value < 0 || whole_turns.value > 999 ||
                      whole_turns.value != std::floor(whole_turns.value)))
    throw_input_error(whole_turns, "an integer from 0 to 999 (turns) after TURN");
  move.turns = 1 + int(whole_turns.value);
  move.stated = target.stated();
  make_arc(block, std::move(move));
}

void Machine::make_arc(const Block& block, ArcMove move) {
  // The direction of a line defines the entry and the exit of compensation.
  if (compensation_.is_leaving())
    throw_input_error(move.cause, "a straight line as the first move after G40");
  if (compensation_.is_on()) {
    if (!compensation_.has_entered())
      throw_input_error(move.cause, "a straight line as the first move after G41 and G42");
    return compensation_.arc(std::move(move));
  }
  const AxisVector start = canon_.position();
  apply_tool_vector(block, move.end);
  for (const int j : orientation_.rotary_joints())
    // The plane of an arc does not define how the tool follows a great circle along it.
    if (is_traori_ && move.end[j] != start[j] && on_great_circle_.value_or(turns_in_workpiece_))
      throw_input_error(move.cause, "ORIAXES before an arc that turns the tool");
  canon_.arc(std::move(move));
}

namespace {

/// A circle through three points, counter-clockwise about its normal in their order.
struct Circle {
  Vector3d centre, normal;
};

std::optional<Circle> circle_through(const Vector3d& start, const Vector3d& intermediate,
                                     const Vector3d& end) {
  const Vector3d a = intermediate - start, b = end - start, n = a.cross(b);
  // Relative 1e-9: the points lie on a line up to rounding.
  if (!(n.norm() > 1e-9 * a.norm() * b.norm()) || !(n.norm() > 1e-12)) return std::nullopt;
  const Vector3d to_centre =
      (a.squaredNorm() * b - b.squaredNorm() * a).cross(n) / (2 * n.squaredNorm());
  return Circle{start + to_centre, n.normalized()};
}

}  // namespace

/// Executes CIP: the arc through an intermediate point, in the plane of the three points.
void Machine::make_arc_through_point(const Block& block, const Target& target) {
  const Cause cause = motion_cause(block);
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) throw_input_error(cause, "a machine with X Y Z for CIP");
  AxisVector intermediate = canon_.programmed();
  for (int k = 0; k < 3; ++k) {
    const Value& word = block[Address("I1") + k];
    if (!word) continue;
    // The manuals do not say if I1 is a diameter.
    if (k == 0) require_radius_words(word);
    const bool is_increment = word.mode == PositionMode::Incremental ||
                              (word.mode == PositionMode::Modal && is_incremental_);
    intermediate[joint(k)] = word.value * unit() + (is_increment ? intermediate[joint(k)] : 0.0);
  }
  ArcMove move{
      .end = canon_.end_of(target), .cause = cause, .named = cause, .stated = target.stated()};
  const auto xyz = [&](const AxisVector& q) {
    return Vector3d(q[joint(0)], q[joint(1)], q[joint(2)]);
  };
  const AxisVector start = canon_.position();
  const auto circle = circle_through(xyz(start), xyz(canon_.placed(intermediate)), xyz(move.end));
  if (!circle) throw_input_error(cause, "three different points with CIP that are not on one line");
  move.centre_with_offsets = start;
  for (int k = 0; k < 3; ++k) move.centre_with_offsets[joint(k)] = circle->centre[k];
  program::Frame arc_frame{canon_.frame().shift, std::nullopt};
  int normal_axis = 0;
  const double max_cosine = circle->normal.cwiseAbs().maxCoeff(&normal_axis);
  // 1 - cos(tilt) of a plane of two axes; equals a tilt of 1.4e-7 rad
  constexpr double plane_tolerance = 1e-14;
  // In a plane of two axes no rotation is needed.
  if (max_cosine > 1 - plane_tolerance) {
    move.first = joint((normal_axis + 1) % 3);
    move.second = joint((normal_axis + 2) % 3);
    move.clockwise = circle->normal[normal_axis] < 0;
  } else {
    // Otherwise the frame is rotated for this arc. Its x points at the start, whose angle is then
    // 0.
    Eigen::Matrix3d R;
    R.col(0) = (xyz(start) - circle->centre).normalized();
    R.col(2) = circle->normal;
    R.col(1) = R.col(2).cross(R.col(0));
    arc_frame.rotation = R;
    move.first = joint(0);
    move.second = joint(1);
  }
  const TemporaryFrame frame(canon_, system_, std::move(arc_frame));
  make_arc(block, std::move(move));
}

}  // namespace abbe::sim::dialects::siemens
