#include "sim/dialects/heidenhain/heidenhain.h"

/// Frames of program coordinates (datum, tool, tilted plane), and the rotary axes for a direction.
namespace abbe::sim::dialects::heidenhain {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::Reachability;

namespace {

constexpr double direction_tolerance = 1e-9;  // rad
constexpr double unlimited_travel = 1e8;      // mm, of a slide without limits

bool is_identity(const Matrix3d& R) { return (R - Matrix3d::Identity()).norm() == 0.0; }

}  // namespace

const Chain& Machine::chain(const Cause& cause) const {
  const Chain* chain = chain_to_tip(canon_.options(), tool_);
  if (chain == nullptr) throw_input_error(cause, "a control that knows its kinematics");
  return *chain;
}

/// Returns the chain with unlimited slides, so that their positions cannot limit a direction.
const Chain& Machine::free_chain(const Cause& cause) {
  const auto entry = free_chains_.find(tool_);
  if (entry != free_chains_.end()) return entry->second;
  return free_chains_.emplace(tool_, with_free_slides(chain(cause))).first->second;
}

// Returns true for rotary axes A B C; a C that is the spindle is none.
bool Machine::is_rotary(int joint) const {
  for (const char letter : {'A', 'B', 'C'})
    if (canon_.joint_of(letter) == joint) return !canon_.is_linear(joint);
  return false;
}

// The rotation of cycle 10 is within the tilted plane.
Matrix3d Machine::rotation() const {
  const Matrix3d in_plane =
      rotation_ == 0.0 ? Matrix3d(Matrix3d::Identity())
                       : Eigen::AngleAxisd(rotation_, Vector3d::UnitZ()).toRotationMatrix();
  return plane_ ? Matrix3d(*plane_ * in_plane) : in_plane;
}

/// Returns the shift, (axes) mm, for the tool in force in axis coordinates. On a machine with
/// rotary axes it is that of the chain.
AxisVector Machine::axis_shift(const Cause& cause) {
  AxisVector shift = AxisVector::Zero(canon_.position().size());
  const auto& zero = canon_.zero();
  const Chain* chain = chain_to_tip(canon_.options(), tool_);
  const auto tip_w =
      zero && zero->places && chain != nullptr ? program::tip_at_zero(*chain) : std::nullopt;
  const int z = canon_.joint_of('Z');
  if (tip_w) {
    // With the axes at zero the vector from the tip to the nose is the length of the tool.
    for (int k = 0; k < 3; ++k) shift[canon_.joint_of("XYZ"[k])] = zero->nose_w[k] - (*tip_w)[k];
    shift[z] += extra_length_;
  } else if (z >= 0 && tool_ >= 0) {
    shift[z] = tool_length(tool_, cause) + delta_length_;
  }
  return shift;
}

void Machine::apply_frame(const Cause& cause) {
  if (contour_.is_compensated() || contour_.is_waiting())
    throw_input_error(cause, "R0, without a pending corner, where coordinates or tools change");
  const AxisVector& offset = program::work_offset(canon_.options(), preset_ + 1);
  const Matrix3d R = rotation();
  program::Frame frame;
  frame.shift = datum_shift_ + removed_turns_;
  const std::array<int, 3> xyz{canon_.joint_of('X'), canon_.joint_of('Y'), canon_.joint_of('Z')};
  if (!is_identity(R)) {
    for (const int j : xyz)
      if (j < 0) throw_input_error(cause, "a machine with X Y Z for rotated coordinates");
    frame.rotation = R;
  }
  // `outer_shift_` is in the workpiece; cycle 7 and the extra tool length are in the plane.
  if (plane_) {
    const Vector3d inner_shift(datum_shift_[xyz[0]], datum_shift_[xyz[1]], datum_shift_[xyz[2]]);
    const Vector3d shift =
        outer_shift_ + *plane_ * (inner_shift + extra_length_ * Vector3d::UnitZ());
    for (int k = 0; k < 3; ++k) frame.shift[xyz[std::size_t(k)]] = shift[k];
  }
  if (offset.size() > 0) frame.shift += offset;
  canon_.set_frame(preset_, std::move(frame));
  // In tip mode the chain contains the tool length.
  canon_.set_tool_shift(canon_.tip_mode() ? AxisVector{} : axis_shift(cause));
}

void Machine::update_tip_mode(const Cause& cause) {
  if (contour_.is_compensated() || contour_.is_waiting())
    throw_input_error(cause, "R0, without a pending corner, where coordinates or tools change");
  // Under M128 an extra length would have to follow the tool direction within a move.
  if (is_tcpm_ && !plane_ && extra_length_ != 0.0)
    throw_input_error(cause, "a tool with the length stated in the scene, without DL, under M128",
                      fmt::format("a tool {:.6g} mm longer", extra_length_));
  canon_.set_tip_mode(is_tcpm_ || plane_, cause);
  apply_frame(cause);
}

void Machine::set_tcpm(bool on, const Cause& cause) {
  if (is_tcpm_ == on) return;
  is_tcpm_ = on;
  try {
    update_tip_mode(cause);
  } catch (const BadInput&) {
    // An error restores the mode, so that later blocks are read correctly.
    is_tcpm_ = canon_.tip_mode() && !plane_;
    throw;
  }
}

AxisVector Machine::axis_position(const Cause& cause) const {
  const AxisVector& position = canon_.position();
  if (canon_.coordinates() == Coordinates::Axis) return position;
  const int x = canon_.joint_of('X'), y = canon_.joint_of('Y'), z = canon_.joint_of('Z');
  // The position is that of the tip, so the slides are solved for it.
  const auto q =
      kinematics::solve_slides(chain(cause), position, {position[x], position[y], position[z]});
  if (!q)
    throw_input_error(cause, "a tip within the travel of the linear axes", "a tip out of reach");
  return *q;
}

/// Returns the solutions for a tool direction; the position of the tip does not matter.
kinematics::InverseSolution Machine::solve_direction(const Vector3d& direction,
                                                     const AxisVector& previous,
                                                     const Cause& cause) {
  try {
    auto solution = kinematics::inverse(free_chain(cause), {Vector3d::Zero(), direction}, previous);
    if (!solution.branches.empty()) return solution;
    throw_input_error(
        cause, "a tool direction that the rotary axes can reach",
        fmt::format("({:.6g}, {:.6g}, {:.6g}){}", direction.x(), direction.y(), direction.z(),
                    solution.reach == Reachability::OutOfLimits ? ", beyond their travel" : ""));
  } catch (const std::invalid_argument& error) {
    throw_input_error(cause, "a machine with three linear axes and at most two rotary axes",
                      error.what());
  }
}

AxisVector Machine::nearest_axes(const Vector3d& direction, const Cause& cause) {
  return solve_direction(direction, axis_position(cause), cause).branches.front();
}

/// Sets a free rotary axis, whose rotation does not change the tool direction, to zero, or with
/// TABLE ROT to the position at which the machine's x lies along that of the plane.
AxisVector Machine::fix_free_axis(AxisVector q, const Matrix3d& R,
                                  const RotaryPositioning& positioning) {
  const Chain& machine = chain(positioning.cause);
  const auto tool_rotation = [&](const AxisVector& position) -> Matrix3d {
    return machine.tool_in_workpiece(position).linear();
  };
  for (int j = 0; j < int(q.size()); ++j) {
    if (!is_rotary(j)) continue;
    AxisVector rotated = q;
    // 0.3 rad: any rotation far from zero and from half a turn shows if the axis changes the tool
    // direction.
    rotated[j] += 0.3;
    if ((tool_rotation(rotated).col(2) - tool_rotation(q).col(2)).norm() > direction_tolerance)
      continue;
    q[j] = canon_.frame().shift.size() > 0 ? canon_.frame().shift[j] : 0.0;
    if (!positioning.rotates_table) return q;
    const Vector3d from = tool_rotation(q).col(0), to = R.col(0), normal = R.col(2);
    const double angle = std::atan2(from.cross(to).dot(normal), from.dot(to));
    // The sign of the axis depends on the side that carries it.
    for (const double rotation : {angle, -angle}) {
      rotated = q;
      rotated[j] += rotation;
      if ((tool_rotation(rotated).col(0) - to).norm() < direction_tolerance) return rotated;
    }
    throw_input_error(positioning.cause,
                      "COORD ROT: the free axis cannot reach the x axis of the plane");
  }
  return q;
}

/// Returns the rotary axes for a plane. SEQ and SYM select the sign of the master axis, which is
/// the rotary axis nearest to the tool.
AxisVector Machine::axes_for_plane(const Matrix3d& R, const RotaryPositioning& positioning) {
  AxisVector previous = axis_position(positioning.cause);
  auto solution = solve_direction(R.col(2), previous, positioning.cause);
  // In a singular pose one axis is free. It is fixed first, then the other one is solved again.
  if (solution.reach == Reachability::Singular) {
    const AxisVector fixed = fix_free_axis(solution.branches.front(), R, positioning);
    for (int j = 0; j < int(fixed.size()); ++j)
      if (is_rotary(j)) previous[j] = fixed[j];
    solution = solve_direction(R.col(2), previous, positioning.cause);
  }
  int master = -1;
  // The last rotary joint is nearest to the tool.
  for (int j = 0; j < int(previous.size()); ++j)
    if (is_rotary(j)) master = j;
  if (master < 0) return previous;
  const auto travel = [&](const AxisVector& q) {
    double sum = 0.0;
    for (int j = 0; j < int(q.size()); ++j)
      if (is_rotary(j)) sum += std::abs(q[j] - previous[j]);
    return sum;
  };
  const AxisVector* best = nullptr;
  for (const AxisVector& q : solution.branches) {
    if (positioning.sign != 0 && q[master] * positioning.sign < -direction_tolerance) continue;
    // The solution with less travel is better; of two equal ones that with a positive master axis.
    const double extra_travel = best == nullptr ? -1.0 : travel(q) - travel(*best);
    if (extra_travel < -direction_tolerance ||
        (extra_travel < direction_tolerance && best != nullptr && q[master] > 0) || best == nullptr)
      best = &q;
  }
  if (best == nullptr)
    throw_input_error(positioning.cause,
                      fmt::format("a solution with SEQ{} within the travel of the rotary axes",
                                  positioning.sign > 0 ? "+" : "-"));
  return *best;
}

/// Retracts along the tool direction with the slides alone.
void Machine::retract_by(double distance, bool to_end, bool rapid, const Cause& cause) {
  const int x = joint_of('X', cause), y = joint_of('Y', cause), z = joint_of('Z', cause);
  const AxisVector q = axis_position(cause);
  AxisVector unit_z = AxisVector::Zero(q.size());
  unit_z[z] = 1.0;
  const Chain& machine = chain(cause);
  // Slides that move the tip by 1 mm along the tool.
  const auto T_wt = machine.tool_in_workpiece(q);
  const auto next = kinematics::solve_slides(machine, q, T_wt.translation() + T_wt.linear().col(2));
  if (!next) throw_input_error(cause, "linear axes that can follow the tool", "other axes");
  const AxisVector displacement = *next - q;
  // Without M128 and PLANE the tool must be upright, or its direction is uncertain.
  if (!canon_.tip_mode() && (displacement - unit_z).norm() > 1e-6)
    throw_input_error(cause, "M128 or PLANE before MB where the tool is inclined");
  // The nearest limit of any slide ends the retraction.
  if (to_end) {
    distance = unlimited_travel;
    for (const int j : {x, y, z}) {
      const kinematics::Joint& joint = machine.joints()[std::size_t(j)];
      if (std::abs(displacement[j]) < 1e-12) continue;
      const double limit = displacement[j] > 0 ? joint.max : joint.min;
      distance = std::min(distance, (limit - q[j]) / displacement[j]);
    }
    if (distance >= unlimited_travel)
      throw_input_error(cause, "linear axes with travel limits for MB MAX", "none");
    distance = std::max(distance, 0.0);
  }
  canon_.go_to(Coordinates::Axis, cause);
  canon_.straight({q + distance * displacement, cause}, rapid);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

// Tilted planes and M128.

namespace {

Matrix3d rotation_about(int axis, double rad) {
  return AngleAxisd(rad, Vector3d::Unit(axis)).toRotationMatrix();
}

/// Returns a rotation with z along the normal and x along the projection of the base onto the
/// plane.
Matrix3d rotation_from_base_and_normal(const Vector3d& base, const Vector3d& normal) {
  Matrix3d R;
  R.col(2) = normal.normalized();
  R.col(0) = (base - base.dot(R.col(2)) * R.col(2)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return R;
}

constexpr double min_plane_angle = 1e-6;  // rad, between the vectors that define a plane

}  // namespace

/// Parses a word that must follow, for example SPA+30, and returns its value.
double Machine::read_word(WordReader& words, std::string_view name) const {
  words.require(name, name);
  return words.read_value();
}

Matrix3d Machine::plane_matrix(const std::string& kind, std::size_t from, WordReader& words) {
  const auto angle = [&](std::string_view name) { return read_word(words, name) * units::deg; };
  const auto vector = [&](const char* x, const char* y, const char* z) {
    return Vector3d{read_word(words, x), read_word(words, y), read_word(words, z)};
  };
  if (kind == "SPATIAL") {
    const double a = angle("SPA"), b = angle("SPB"), c = angle("SPC");
    // Spatial angles rotate about fixed axes, A first.
    return rotation_about(2, c) * rotation_about(1, b) * rotation_about(0, a);
  }
  if (kind == "EULER") {
    const double precession = angle("EULPR"), nutation = angle("EULNU"), rotation = angle("EULROT");
    // Euler angles rotate about z, the new x and the new z.
    return rotation_about(2, precession) * rotation_about(0, nutation) *
           rotation_about(2, rotation);
  }
  if (kind == "VECTOR") {
    const Vector3d base = vector("BX", "BY", "BZ"), normal = vector("NX", "NY", "NZ");
    if (!(base.cross(normal).norm() > min_plane_angle * base.norm() * normal.norm()))
      words.throw_input_error(from, "a base vector and a normal that are not parallel");
    return rotation_from_base_and_normal(base, normal);
  }
  if (kind == "POINTS") {
    const Vector3d p1 = vector("P1X", "P1Y", "P1Z"), p2 = vector("P2X", "P2Y", "P2Z"),
                   p3 = vector("P3X", "P3Y", "P3Z");
    const Vector3d x = p2 - p1, normal = x.cross(p3 - p1);
    if (!(normal.norm() > min_plane_angle * x.norm() * (p3 - p1).norm()))
      words.throw_input_error(from, "three points that are not on one line");
    return rotation_from_base_and_normal(x, normal);
  }
  // RELATIV rotates about an axis of the plane in force.
  const Matrix3d current = plane_.value_or(Matrix3d::Identity());
  for (int k = 0; k < 3; ++k)
    if (const std::string name = std::string("SP") + char('A' + k); words.cursor.accept(name)) {
      require_certain_shift(words.cause(from));
      return current * rotation_about(k, words.read_value() * units::deg);
    }
  words.throw_input_error(words.cursor.at, "SPA, SPB or SPC after PLANE RELATIV");
}

bool Machine::read_positioning_word(const std::string& name, WordReader& words,
                                    RotaryPositioning& positioning) {
  if (name.starts_with('F')) {
    const FeedValue feed = read_feed(name.substr(1), words, words.cursor.at);
    if (feed.kind == FeedKind::PerRevolution)
      throw_input_error(positioning.cause, "a feed per minute with TURN and MOVE");
    positioning.is_rapid = feed.kind == FeedKind::Rapid;
    positioning.feed = feed.value;
    return true;
  }
  if (name == "DIST" || name == "ABST") {
    positioning.distance = words.read_value() * unit();
    return true;
  }
  if (name == "MB" || name == "MBMAX") {
    positioning.retract_to_end = name == "MBMAX" || words.accept("MAX");
    if (!positioning.retract_to_end) positioning.retract = words.read_value() * unit();
    return true;
  }
  if (name == "SEQ" || name == "SYM") {
    words.cursor.skip_blanks();
    const char sign = words.cursor.current();
    if (sign != '+' && sign != '-') return false;
    ++words.cursor.at;
    positioning.sign = sign == '+' ? 1 : -1;
    return true;
  }
  if (name == "TABLE" || name == "COORD") {
    positioning.rotates_table = name == "TABLE";
    return words.accept("ROT");
  }
  return false;
}

/// Parses STAY, or TURN and MOVE with a feed.
Machine::RotaryPositioning Machine::read_positioning(WordReader& words) {
  RotaryPositioning positioning;
  const std::size_t from = skip_blanks(words.cursor);
  const std::string kind = words.read_name();
  positioning.cause = words.cause(from);
  if (kind != "STAY" && kind != "TURN" && kind != "MOVE")
    words.throw_input_error(from, "STAY, TURN or MOVE");
  positioning.kind = kind == "STAY"   ? RotaryPositioning::Kind::Stay
                     : kind == "TURN" ? RotaryPositioning::Kind::Turn
                                      : RotaryPositioning::Kind::Move;
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    if (!read_positioning_word(words.read_name(), words, positioning))
      words.throw_input_error(at, "F, DIST, MB, SEQ, SYM, TABLE ROT or COORD ROT");
  }
  if (positioning.kind != RotaryPositioning::Kind::Stay && !positioning.is_rapid &&
      !(positioning.feed > 0))
    throw_input_error(positioning.cause, "F or FMAX with TURN and MOVE", "none");
  return positioning;
}

void Machine::execute_plane(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  const std::string kind = words.read_name();
  if (contour_.is_compensated()) words.throw_input_error(from, "R0 before PLANE");
  reject_unsupported("PLANE\u00a0" + kind, words.cause(from));
  if (kind == "RESET") return reset_plane(read_positioning(words));
  static constexpr std::string_view kinds[] = {"SPATIAL", "EULER", "VECTOR", "POINTS", "RELATIV"};
  if (std::find(std::begin(kinds), std::end(kinds), kind) == std::end(kinds))
    words.throw_input_error(from, "SPATIAL, EULER, VECTOR, POINTS, RELATIV or RESET after PLANE");
  const Matrix3d R = plane_matrix(kind, from, words);
  set_plane(R, read_positioning(words));
}

/// Throws BadInput if a change of plane would move a shift or rotation in force within the plane.
void Machine::check_plane_change(const Cause& cause) const {
  if (!plane_) require_certain_shift(cause);
  if (rotation_ != 0.0) throw_input_error(cause, "CYCL DEF 10 with ROT+0 before PLANE");
  if (!plane_) return;
  for (const char letter : {'X', 'Y', 'Z'})
    if (datum_shift_[canon_.joint_of(letter)] != 0.0)
      throw_input_error(cause, "the datum shift of the tilted plane at zero before PLANE");
}

void Machine::set_plane(const Matrix3d& R, const RotaryPositioning& positioning) {
  check_plane_change(positioning.cause);
  for (const char letter : {'X', 'Y', 'Z'}) joint_of(letter, positioning.cause);
  // DL lies along the tool, but under STAY the tool is not along z of the plane.
  if (extra_length_ != 0.0 && positioning.kind == RotaryPositioning::Kind::Stay)
    throw_input_error(positioning.cause,
                      "TURN or MOVE with a tool that is not longer than that of the scene (DL 0)");
  if (extra_length_ != 0.0 && is_tcpm_)
    throw_input_error(positioning.cause, "M129 before PLANE with DL");
  // The datum shift from before the plane stays outside of it.
  if (!plane_)
    for (const char letter : {'X', 'Y', 'Z'}) {
      double& shift = datum_shift_[canon_.joint_of(letter)];
      outer_shift_[letter - 'X'] = shift;
      shift = 0.0;
    }
  plane_ = R;
  uncertain_shifts_ = 0;
  update_tip_mode(positioning.cause);
  move_to_plane(R, positioning);
  tangent_.reset();
}

/// Ends the plane. A shift or rotation within the plane has no known meaning outside of it, so it
/// is uncertain until it is programmed again.
void Machine::reset_plane(const RotaryPositioning& positioning) {
  if (positioning.kind != RotaryPositioning::Kind::Stay) {
    if (!canon_.tip_mode()) canon_.set_tip_mode(true, positioning.cause);
    move_to_plane(Matrix3d::Identity(), positioning);
  }
  if (plane_) {
    uncertain_shifts_ = rotation_ != 0.0 ? rotation_bit : 0u;
    for (const char letter : {'X', 'Y', 'Z'}) {
      double& shift = datum_shift_[canon_.joint_of(letter)];
      if (shift != 0.0) uncertain_shifts_ |= shift_bit(letter);
      shift = outer_shift_[letter - 'X'];
    }
  }
  plane_.reset();
  outer_shift_.setZero();
  update_tip_mode(positioning.cause);
  tangent_.reset();
}

/// Moves the rotary axes so that the tool is along z of `R`. Tip mode must be on.
void Machine::move_to_plane(const Matrix3d& R, const RotaryPositioning& positioning) {
  const AxisVector q = axes_for_plane(R, positioning);
  // Q120 to Q122 are set even with STAY, for blocks that position the axes.
  for (const char letter : {'A', 'B', 'C'}) {
    const int j = canon_.joint_of(letter);
    plane_axes_[std::size_t(letter - 'A')] =
        j >= 0 ? (q[j] - canon_.frame().shift[j]) / units::deg : 0.0;
  }
  if (positioning.kind == RotaryPositioning::Kind::Stay) return;
  const auto feed = canon_.feed();
  const auto mode = canon_.feed_mode();
  if (!positioning.is_rapid) {
    canon_.set_feed_mode(program::FeedMode::PerMinute);
    canon_.set_feed(program::Feed{positioning.feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  if (positioning.retract || positioning.retract_to_end)
    retract_by(positioning.retract.value_or(0.0), positioning.retract_to_end, positioning.is_rapid,
               positioning.cause);
  const AxisVector start = axis_position(positioning.cause);
  // TURN moves the rotary axes with the slides at rest, MOVE with the tip at rest.
  if (positioning.kind == RotaryPositioning::Kind::Turn)
    canon_.go_to(Coordinates::Axis, positioning.cause);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (is_rotary(j)) end[j] = q[j];
  // With DIST the point at that distance from the tip stays at rest.
  if (positioning.kind == RotaryPositioning::Kind::Move && positioning.distance) {
    const Vector3d tip_displacement =
        *positioning.distance *
        (R.col(2) - chain(positioning.cause).tool_in_workpiece(start).linear().col(2));
    for (const char letter : {'X', 'Y', 'Z'})
      end[canon_.joint_of(letter)] += tip_displacement[letter - 'X'];
  }
  canon_.straight({.end = std::move(end), .cause = positioning.cause}, positioning.is_rapid);
  canon_.go_to(Coordinates::Tip, positioning.cause);
  canon_.set_feed(feed);
  canon_.set_feed_mode(mode);
}

/// Executes FUNCTION TCPM, for example FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS REFPNT TIP-TIP.
void Machine::execute_tcpm(WordReader& words) {
  const Cause cause{1, "FUNCTION TCPM"};
  const auto read_option = [&](std::string_view supported,
                               std::initializer_list<std::string_view> rejected,
                               const char* sentence) {
    const std::size_t from = skip_blanks(words.cursor);
    for (const std::string_view option : rejected)
      if (words.cursor.accept(option)) words.throw_input_error(from, sentence);
    if (!words.cursor.accept(supported)) words.throw_input_error(from, std::string(supported));
  };
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.read_name();
    if (name == "F" && words.has_value()) {
      words.read_value();  // limits the feed of compensating moves
    } else if (name == "F") {
      read_option("TCP", {"CONT"}, "F TCP: feeds are those of the tip");
    } else if (name == "AXIS") {
      read_option("POS", {"SPAT"}, "AXIS POS: rotary words are axis positions");
    } else if (name == "PATHCTRL") {
      read_option("AXIS", {"VECTOR"},
                  "PATHCTRL AXIS: rotary axes interpolate linearly, not in a plane");
    } else if (name == "REFPNT") {
      read_option("TIP-TIP", {"TIP-CENTER", "CENTER-CENTER"},
                  "REFPNT TIP-TIP: coordinates are those of the tip");
    } else {
      words.throw_input_error(from, "F TCP, AXIS POS, PATHCTRL AXIS or REFPNT TIP-TIP");
    }
  }
  set_tcpm(true, cause);
}

}  // namespace abbe::sim::dialects::heidenhain
