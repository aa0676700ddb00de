#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain/machine.h"

/// Position of program coordinates: datum, tool and tilted plane, and the rotary axes for a
/// direction.
namespace abbe::sim::dialects::heidenhain {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Reach;
using program::Coordinates;

namespace {

constexpr double same_direction = 1e-9;  // rad
constexpr double unlimited = 1e8;        // mm, travel of a slide without limits

bool is_identity(const Matrix3d& R) { return (R - Matrix3d::Identity()).norm() == 0.0; }

}  // namespace

const Chain* Machine::known_chain() const {
  const auto& options = canon_.options();
  const auto own = options.control_of_h.find(tool_);
  if (own != options.control_of_h.end()) return &own->second;
  return options.control ? &*options.control : nullptr;
}

const Chain& Machine::chain(const Cause& cause) const {
  const Chain* known = known_chain();
  if (known == nullptr) refuse(cause, "a control that knows its kinematics");
  return *known;
}

/// Returns the chain with unlimited slides, for directions alone.
const Chain& Machine::free_chain(const Cause& cause) {
  const auto made = free_chains_.find(tool_);
  if (made != free_chains_.end()) return made->second;
  const Chain& limited = chain(cause);
  std::vector<kinematics::Joint> joints = limited.joints();
  for (kinematics::Joint& joint : joints)
    if (joint.motion == kinematics::Motion::Linear) {
      joint.min = -1e9;
      joint.max = 1e9;
    }
  return free_chains_.emplace(tool_, Chain(joints, limited.T_bw_home(), limited.T_bt_home()))
      .first->second;
}

// A B C that turn; a C that is the spindle is no rotary axis.
bool Machine::is_rotary(int joint) const {
  for (const char letter : {'A', 'B', 'C'})
    if (canon_.joint_of(letter) == joint) return !canon_.is_linear(joint);
  return false;
}

// Rotation of cycle 10 is inside the tilted plane.
Matrix3d Machine::rotation() const {
  const Matrix3d in_plane = turn_ == 0.0
                                ? Matrix3d(Matrix3d::Identity())
                                : Eigen::AngleAxisd(turn_, Vector3d::UnitZ()).toRotationMatrix();
  return plane_ ? Matrix3d(*plane_ * in_plane) : in_plane;
}

/// Shift of the axes for the tool that the control has in force while the axes are commanded; on a
/// machine with rotary axes that of its chain.
AxisVector Machine::axis_shift(const Cause& cause) {
  AxisVector shift = AxisVector::Zero(canon_.position().size());
  const auto& zero = canon_.zero();
  const Chain* known = known_chain();
  const auto tip_w =
      zero && zero->places && known != nullptr ? program::tip_at_zero(*known) : std::nullopt;
  const int z = canon_.joint_of('Z');
  if (tip_w) {
    // Nose minus tip at zero is the length of the tool in all three directions.
    for (int k = 0; k < 3; ++k) shift[canon_.joint_of("XYZ"[k])] = zero->nose_w[k] - (*tip_w)[k];
    shift[z] += delta_;
  } else if (z >= 0 && tool_ >= 0) {
    shift[z] = length_of(tool_, cause) + delta_length_;
  }
  return shift;
}

void Machine::apply_frame(const Cause& cause) {
  if (contour_.beside() || contour_.waits())
    refuse(cause, "R0, and no corner, where coordinates or tools change");
  const AxisVector& offset = program::work_offset(canon_.options(), preset_ + 1);
  const Matrix3d R = rotation();
  program::Frame frame;
  frame.shift = datum_shift_ + turns_;
  const std::array<int, 3> xyz{canon_.joint_of('X'), canon_.joint_of('Y'), canon_.joint_of('Z')};
  if (!is_identity(R)) {
    for (const int j : xyz)
      if (j < 0) refuse(cause, "a machine with X Y Z for coordinates that are turned");
    frame.rotation = R;
  }
  // Shifts: outer_shift_ in the workpiece, cycle 7 and the additional tool length in the plane.
  if (plane_) {
    const Vector3d inner(datum_shift_[xyz[0]], datum_shift_[xyz[1]], datum_shift_[xyz[2]]);
    const Vector3d shift = outer_shift_ + *plane_ * (inner + delta_ * Vector3d::UnitZ());
    for (int k = 0; k < 3; ++k) frame.shift[xyz[std::size_t(k)]] = shift[k];
  }
  if (offset.size() > 0) frame.shift += offset;
  canon_.set_frame(preset_, std::move(frame));
  // In tip mode the chain contains the tool.
  canon_.set_tool_shift(canon_.tip_mode() ? AxisVector{} : axis_shift(cause));
}

void Machine::update_tip_mode(const Cause& cause) {
  if (contour_.beside() || contour_.waits())
    refuse(cause, "R0, and no corner, where coordinates or tools change");
  // An additional length under M128 would have to follow the tool direction within a move.
  if (tcpm_ && !plane_ && delta_ != 0.0)
    refuse(cause, "a tool of the length that the scene has, without DL, under M128",
           fmt::format("one that is {:.6g} mm longer", delta_));
  canon_.set_tip_mode(tcpm_ || plane_, cause);
  apply_frame(cause);
}

void Machine::set_tcpm(bool on, const Cause& cause) {
  if (tcpm_ == on) return;
  tcpm_ = on;
  try {
    update_tip_mode(cause);
  } catch (const BadInput&) {
    // On an error the mode stays as it was, so that later blocks are judged correctly.
    tcpm_ = canon_.tip_mode() && !plane_;
    throw;
  }
}

AxisVector Machine::axes_now(const Cause& cause) const {
  const AxisVector& at = canon_.position();
  if (canon_.coordinates() == Coordinates::Axis) return at;
  const int x = canon_.joint_of('X'), y = canon_.joint_of('Y'), z = canon_.joint_of('Z');
  // The slides are solved because the position is that of the tip.
  const auto q = kinematics::slides_for_tip(chain(cause), at, {at[x], at[y], at[z]});
  if (!q) refuse(cause, "slides that reach the tip", "a tip out of their reach");
  return *q;
}

// Reach of the direction alone: the position of the tip does not matter.
kinematics::InverseSolution Machine::solve(const Vector3d& direction, const AxisVector& previous,
                                           const Cause& cause) {
  try {
    auto found = kinematics::inverse(free_chain(cause), {Vector3d::Zero(), direction}, previous);
    if (!found.branches.empty()) return found;
    refuse(cause, "a direction of the tool that the rotary axes reach",
           fmt::format("({:.6g}, {:.6g}, {:.6g}){}", direction.x(), direction.y(), direction.z(),
                       found.reach == Reach::OutOfLimits ? " beyond their travel" : ""));
  } catch (const std::invalid_argument& fault) {
    refuse(cause, "a machine of three slides and at most two rotary axes", fault.what());
  }
}

AxisVector Machine::nearest_axes(const Vector3d& direction, const Cause& cause) {
  return solve(direction, axes_now(cause), cause).branches.front();
}

/// Sets a rotary axis that turns about the tool's own direction to zero, or with TABLE ROT to where
/// the machine's x is that of the plane.
AxisVector Machine::with_free_axis(AxisVector q, const Matrix3d& R, const Positioning& how) {
  const Chain& machine = chain(how.cause);
  const auto pose = [&](const AxisVector& at) -> Matrix3d {
    return machine.tool_in_workpiece(at).linear();
  };
  for (int j = 0; j < int(q.size()); ++j) {
    if (!is_rotary(j)) continue;
    AxisVector turned = q;
    // 0.3 rad: an arbitrary rotation, far from zero and from half a turn, that shows whether the
    // axis changes the tool direction.
    turned[j] += 0.3;
    if ((pose(turned).col(2) - pose(q).col(2)).norm() > same_direction) continue;
    q[j] = canon_.frame().shift.size() > 0 ? canon_.frame().shift[j] : 0.0;
    if (!how.table) return q;
    const Vector3d from = pose(q).col(0), to = R.col(0), about = R.col(2);
    const double angle = std::atan2(from.cross(to).dot(about), from.dot(to));
    // The sign of the axis depends on the side that carries it.
    for (const double way : {angle, -angle}) {
      turned = q;
      turned[j] += way;
      if ((pose(turned).col(0) - to).norm() < same_direction) return turned;
    }
    refuse(how.cause, "COORD ROT: the free axis does not reach the plane's x");
  }
  return q;
}

/// Selects the rotary axes for a plane. SEQ and SYM choose the sign of the master axis, the rotary
/// axis nearest to the tool.
AxisVector Machine::axes_for(const Matrix3d& R, const Positioning& how) {
  AxisVector previous = axes_now(how.cause);
  auto found = solve(R.col(2), previous, how.cause);
  // In a singular pose one axis is free: it is fixed first, and the other solved again.
  if (found.reach == Reach::Singular) {
    const AxisVector wanted = with_free_axis(found.branches.front(), R, how);
    for (int j = 0; j < int(wanted.size()); ++j)
      if (is_rotary(j)) previous[j] = wanted[j];
    found = solve(R.col(2), previous, how.cause);
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
  for (const AxisVector& q : found.branches) {
    if (how.sign != 0 && q[master] * how.sign < -same_direction) continue;
    // Shorter travel wins; of two equal ones the solution with a positive master axis.
    const double more = best == nullptr ? -1.0 : travel(q) - travel(*best);
    if (more < -same_direction || (more < same_direction && best != nullptr && q[master] > 0) ||
        best == nullptr)
      best = &q;
  }
  if (best == nullptr)
    refuse(how.cause, fmt::format("a solution with SEQ{} within the travel of the rotary axes",
                                  how.sign > 0 ? "+" : "-"));
  return *best;
}

/// Moves along the tool direction with the slides alone.
void Machine::retract_by(double distance, bool to_end, bool rapid, const Cause& cause) {
  const int x = joint_of('X', cause), y = joint_of('Y', cause), z = joint_of('Z', cause);
  const AxisVector q = axes_now(cause);
  AxisVector way = AxisVector::Zero(q.size());
  way[z] = 1.0;
  const Chain& machine = chain(cause);
  // Slides that move the tip by 1 mm along the tool.
  const auto T_wt = machine.tool_in_workpiece(q);
  const auto next =
      kinematics::slides_for_tip(machine, q, T_wt.translation() + T_wt.linear().col(2));
  if (!next) refuse(cause, "slides that follow the tool", "others");
  const AxisVector along = *next - q;
  // Without M128 and PLANE only the direction of an upright tool is certain: Z.
  if (!canon_.tip_mode() && (along - way).norm() > 1e-6)
    refuse(cause, "M128 or PLANE before MB where the tool leans");
  way = along;
  // The nearest limit of any slide ends the retraction.
  if (to_end) {
    distance = unlimited;
    for (const int j : {x, y, z}) {
      const kinematics::Joint& joint = machine.joints()[std::size_t(j)];
      if (std::abs(way[j]) < 1e-12) continue;
      const double limit = way[j] > 0 ? joint.max : joint.min;
      distance = std::min(distance, (limit - q[j]) / way[j]);
    }
    if (distance >= unlimited) refuse(cause, "slides with limits beside MB MAX", "none");
    distance = std::max(distance, 0.0);
  }
  canon_.go_to(Coordinates::Axis, cause);
  program::Straight straight{q + distance * way, cause};
  if (rapid)
    canon_.traverse(std::move(straight));
  else
    canon_.straight_feed(std::move(straight));
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

// Tilted planes and M128.

namespace {

Matrix3d about(int axis, double rad) {
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

constexpr double parallel = 1e-6;  // rad; below it the plane is not defined

}  // namespace

/// Returns the value behind a word that must follow, for example SPA+30.
double Machine::word_value(Words& words, std::string_view name) const {
  if (!words.cursor.accept(name)) words.refuse(words.cursor.at, std::string(name));
  return words.value();
}

Matrix3d Machine::plane_matrix(const std::string& kind, std::size_t from, Words& words) {
  const auto angle = [&](std::string_view name) { return word_value(words, name) * units::deg; };
  const auto vector = [&](const char* x, const char* y, const char* z) {
    return Vector3d{word_value(words, x), word_value(words, y), word_value(words, z)};
  };
  if (kind == "SPATIAL") {
    const double a = angle("SPA"), b = angle("SPB"), c = angle("SPC");
    // Spatial angles turn about fixed axes, A first.
    return about(2, c) * about(1, b) * about(0, a);
  }
  if (kind == "EULER") {
    const double precession = angle("EULPR"), nutation = angle("EULNU"), own = angle("EULROT");
    // Euler angles turn about z, the new x and the new z.
    return about(2, precession) * about(0, nutation) * about(2, own);
  }
  if (kind == "VECTOR") {
    const Vector3d base = vector("BX", "BY", "BZ"), normal = vector("NX", "NY", "NZ");
    if (!(base.cross(normal).norm() > parallel * base.norm() * normal.norm()))
      words.refuse(from, "a base vector and a normal that are not parallel");
    return rotation_from_base_and_normal(base, normal);
  }
  if (kind == "POINTS") {
    const Vector3d p1 = vector("P1X", "P1Y", "P1Z"), p2 = vector("P2X", "P2Y", "P2Z"),
                   p3 = vector("P3X", "P3Y", "P3Z");
    const Vector3d x = p2 - p1, normal = x.cross(p3 - p1);
    if (!(normal.norm() > parallel * x.norm() * (p3 - p1).norm()))
      words.refuse(from, "three points that are not on one line");
    return rotation_from_base_and_normal(x, normal);
  }
  // RELATIV turns about an axis of the plane in force.
  const Matrix3d before = plane_.value_or(Matrix3d::Identity());
  for (int k = 0; k < 3; ++k)
    if (const std::string name = std::string("SP") + char('A' + k); words.cursor.accept(name)) {
      require_certain_shift(words.cause(from));
      return before * about(k, words.value() * units::deg);
    }
  words.refuse(words.cursor.at, "SPA, SPB or SPC after PLANE RELATIV");
}

bool Machine::read_positioning_word(const std::string& name, Words& words, Positioning& how) {
  if (name.starts_with('F')) {
    const FeedValue feed = feed_value(name.substr(1), words, words.cursor.at);
    if (feed.word == FeedWord::PerTurn) refuse(how.cause, "a feed per minute beside TURN and MOVE");
    how.rapid = feed.word == FeedWord::Rapid;
    how.feed = feed.value;
    return true;
  }
  if (name == "DIST" || name == "ABST") {
    how.distance = words.value() * unit();
    return true;
  }
  if (name == "MB" || name == "MBMAX") {
    how.retract_to_end = name == "MBMAX" || words.take("MAX");
    if (!how.retract_to_end) how.retract = words.value() * unit();
    return true;
  }
  if (name == "SEQ" || name == "SYM") {
    words.cursor.skip_blanks();
    const char sign = words.cursor.current();
    if (sign != '+' && sign != '-') return false;
    ++words.cursor.at;
    how.sign = sign == '+' ? 1 : -1;
    return true;
  }
  if (name == "TABLE" || name == "COORD") {
    how.table = name == "TABLE";
    return words.take("ROT");
  }
  return false;
}

/// Reads STAY, or TURN and MOVE with a feed.
Machine::Positioning Machine::read_positioning(Words& words) {
  Positioning how;
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string kind = words.name();
  how.cause = words.cause(from);
  if (kind != "STAY" && kind != "TURN" && kind != "MOVE") words.refuse(from, "STAY, TURN or MOVE");
  how.kind = kind == "STAY"   ? Positioning::Kind::Stay
             : kind == "TURN" ? Positioning::Kind::Turn
                              : Positioning::Kind::Move;
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    if (!read_positioning_word(words.name(), words, how))
      words.refuse(at, "F, DIST, MB, SEQ, SYM, TABLE ROT or COORD ROT");
  }
  if (how.kind != Positioning::Kind::Stay && !how.rapid && !(how.feed > 0))
    refuse(how.cause, "F or FMAX beside TURN and MOVE", "none");
  return how;
}

void Machine::plane(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  const std::string kind = words.name();
  if (contour_.beside()) words.refuse(from, "R0 before PLANE");
  refuse_if_named("PLANE\u00a0" + kind, words.cause(from));
  if (kind == "RESET") return untilt(read_positioning(words));
  static constexpr std::string_view kinds[] = {"SPATIAL", "EULER", "VECTOR", "POINTS", "RELATIV"};
  if (std::find(std::begin(kinds), std::end(kinds), kind) == std::end(kinds))
    words.refuse(from, "SPATIAL, EULER, VECTOR, POINTS, RELATIV or RESET after PLANE");
  const Matrix3d R = plane_matrix(kind, from, words);
  tilt(R, read_positioning(words));
}

/// Throws BadInput if something in force inside the plane would be moved by a change of plane.
void Machine::check_plane_is_free(const Cause& cause) const {
  if (!plane_) require_certain_shift(cause);
  if (turn_ != 0.0) refuse(cause, "CYCL DEF 10 with ROT+0 before PLANE");
  if (!plane_) return;
  for (const char letter : {'X', 'Y', 'Z'})
    if (datum_shift_[canon_.joint_of(letter)] != 0.0)
      refuse(cause, "the datum shift of the tilted plane at zero before PLANE");
}

void Machine::tilt(const Matrix3d& R, const Positioning& how) {
  check_plane_is_free(how.cause);
  for (const char letter : {'X', 'Y', 'Z'}) joint_of(letter, how.cause);
  // DL lies along the tool, which STAY leaves at an angle to the plane.
  if (delta_ != 0.0 && how.kind == Positioning::Kind::Stay)
    refuse(how.cause, "TURN or MOVE beside a tool that is longer than the scene's, by DL");
  if (delta_ != 0.0 && tcpm_) refuse(how.cause, "M129 before PLANE beside DL");
  // The datum shift from before the plane stays outside of it.
  if (!plane_)
    for (const char letter : {'X', 'Y', 'Z'}) {
      double& shift = datum_shift_[canon_.joint_of(letter)];
      outer_shift_[letter - 'X'] = shift;
      shift = 0.0;
    }
  plane_ = R;
  shift_doubt_ = 0;
  update_tip_mode(how.cause);
  position_axes(R, how);
  tangent_.reset();
}

/// Ends the plane. A shift or rotation inside the plane has no known meaning outside: it is
/// uncertain until it is programmed again.
void Machine::untilt(const Positioning& how) {
  if (how.kind != Positioning::Kind::Stay) {
    if (!canon_.tip_mode()) canon_.set_tip_mode(true, how.cause);
    position_axes(Matrix3d::Identity(), how);
  }
  if (plane_) {
    shift_doubt_ = turn_ != 0.0 ? turn_bit : 0u;
    for (const char letter : {'X', 'Y', 'Z'}) {
      double& shift = datum_shift_[canon_.joint_of(letter)];
      if (shift != 0.0) shift_doubt_ |= shift_bit(letter);
      shift = outer_shift_[letter - 'X'];
    }
  }
  plane_.reset();
  outer_shift_.setZero();
  update_tip_mode(how.cause);
  tangent_.reset();
}

/// Moves the rotary axes so that the tool is along z of R. Tip mode must be on.
void Machine::position_axes(const Matrix3d& R, const Positioning& how) {
  const AxisVector q = axes_for(R, how);
  // Q120 to Q122 are set even with STAY, for blocks that position the axes.
  for (const char letter : {'A', 'B', 'C'}) {
    const int j = canon_.joint_of(letter);
    plane_axes_[std::size_t(letter - 'A')] =
        j >= 0 ? (q[j] - canon_.frame().shift[j]) / units::deg : 0.0;
  }
  if (how.kind == Positioning::Kind::Stay) return;
  const auto feed = canon_.feed();
  const auto mode = canon_.feed_mode();
  if (!how.rapid) {
    canon_.set_feed_mode(program::FeedMode::PerMinute);
    canon_.set_feed(program::Feed{how.feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  if (how.retract || how.retract_to_end)
    retract_by(how.retract.value_or(0.0), how.retract_to_end, how.rapid, how.cause);
  const AxisVector before = axes_now(how.cause);
  // TURN moves the rotary axes with the slides at rest, MOVE with the tip at rest.
  if (how.kind == Positioning::Kind::Turn) canon_.go_to(Coordinates::Axis, how.cause);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (is_rotary(j)) end[j] = q[j];
  // With DIST the point at that distance in front of the tip stays at rest.
  if (how.kind == Positioning::Kind::Move && how.distance) {
    const Vector3d moved =
        *how.distance * (R.col(2) - chain(how.cause).tool_in_workpiece(before).linear().col(2));
    for (const char letter : {'X', 'Y', 'Z'}) end[canon_.joint_of(letter)] += moved[letter - 'X'];
  }
  if (how.rapid)
    canon_.traverse({.end = std::move(end), .cause = how.cause});
  else
    canon_.straight_feed({.end = std::move(end), .cause = how.cause});
  canon_.go_to(Coordinates::Tip, how.cause);
  canon_.set_feed(feed);
  canon_.set_feed_mode(mode);
}

/// Example: FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS REFPNT TIP-TIP.
void Machine::tcpm(Words& words) {
  const Cause cause{1, "FUNCTION TCPM"};
  const auto one_of = [&](std::string_view done, std::initializer_list<std::string_view> refused,
                          const char* sentence) {
    words.cursor.skip_blanks();
    const std::size_t from = words.cursor.at;
    for (const std::string_view other : refused)
      if (words.cursor.accept(other)) words.refuse(from, sentence);
    if (!words.cursor.accept(done)) words.refuse(from, std::string(done));
  };
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.name();
    if (name == "F" && words.has_value()) {
      words.value();  // limits the feed of compensating moves
    } else if (name == "F") {
      one_of("TCP", {"CONT"}, "F TCP: feeds are those of the tip");
    } else if (name == "AXIS") {
      one_of("POS", {"SPAT"}, "AXIS POS: rotary words are positions of the axes");
    } else if (name == "PATHCTRL") {
      one_of("AXIS", {"VECTOR"}, "PATHCTRL AXIS: rotary axes run in proportion, not in a plane");
    } else if (name == "REFPNT") {
      one_of("TIP-TIP", {"TIP-CENTER", "CENTER-CENTER"},
             "REFPNT TIP-TIP: coordinates are those of the tip");
    } else {
      words.refuse(from, "F TCP, AXIS POS, PATHCTRL AXIS or REFPNT TIP-TIP");
    }
  }
  set_tcpm(true, cause);
}

}  // namespace abbe::sim::dialects::heidenhain
