#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_machine.h"

/// Tilted planes and M128.
namespace abbe::sim::dialects::heidenhain {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using program::Coordinates;

namespace {

Matrix3d about(int axis, double rad) {
  return AngleAxisd(rad, Vector3d::Unit(axis)).toRotationMatrix();
}

/// x along the base, z along the normal, the base turned into the plane.
Matrix3d of_base_and_normal(const Vector3d& base, const Vector3d& normal) {
  Matrix3d R;
  R.col(2) = normal.normalized();
  R.col(0) = (base - base.dot(R.col(2)) * R.col(2)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return R;
}

constexpr double parallel = 1e-6;  // rad

}  // namespace

/// The value behind a word that must come next, as SPA+30.
double Machine::word_value(Words& words, std::string_view name) const {
  if (!words.cursor.take(name)) words.refuse(words.cursor.at, std::string(name));
  return words.value();
}

Matrix3d Machine::plane_matrix(const std::string& kind, std::size_t from, Words& words) {
  const auto angle = [&](std::string_view name) { return word_value(words, name) * units::deg; };
  const auto vector = [&](const char* x, const char* y, const char* z) {
    return Vector3d{word_value(words, x), word_value(words, y), word_value(words, z)};
  };
  if (kind == "SPATIAL") {
    const double a = angle("SPA"), b = angle("SPB"), c = angle("SPC");
    return about(2, c) * about(1, b) * about(0, a);
  }
  if (kind == "EULER") {
    const double precession = angle("EULPR"), nutation = angle("EULNU"), own = angle("EULROT");
    return about(2, precession) * about(0, nutation) * about(2, own);
  }
  if (kind == "VECTOR") {
    const Vector3d base = vector("BX", "BY", "BZ"), normal = vector("NX", "NY", "NZ");
    if (!(base.cross(normal).norm() > parallel * base.norm() * normal.norm()))
      words.refuse(from, "a base vector and a normal that are not parallel");
    return of_base_and_normal(base, normal);
  }
  if (kind == "POINTS") {
    const Vector3d p1 = vector("P1X", "P1Y", "P1Z"), p2 = vector("P2X", "P2Y", "P2Z"),
                   p3 = vector("P3X", "P3Y", "P3Z");
    const Vector3d x = p2 - p1, normal = x.cross(p3 - p1);
    if (!(normal.norm() > parallel * x.norm() * (p3 - p1).norm()))
      words.refuse(from, "three points that are not on one line");
    return of_base_and_normal(x, normal);
  }
  // RELATIV
  const Matrix3d before = plane_.value_or(Matrix3d::Identity());
  for (int k = 0; k < 3; ++k)
    if (const std::string name = std::string("SP") + char('A' + k); words.cursor.take(name)) {
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
    const char sign = words.cursor.here();
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

/// STAY, or TURN and MOVE with a feed.
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

/// Nothing is in force within the plane that its change would move.
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
  if (delta_ != 0.0 && how.kind == Positioning::Kind::Stay)
    refuse(how.cause, "TURN or MOVE beside a tool that is longer than the scene's, by DL");
  if (delta_ != 0.0 && tcpm_) refuse(how.cause, "M129 before PLANE beside DL");
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

/// What was shifted and turned within the plane is not known to the workpiece: it is in doubt until
/// it is stated again.
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

/// The rotary axes to where the tool stands along z of R. The tip mode is on.
void Machine::position_axes(const Matrix3d& R, const Positioning& how) {
  const AxisVector q = axes_for(R, how);
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
  if (how.kind == Positioning::Kind::Turn) canon_.go_to(Coordinates::Axis, how.cause);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (is_rotary(j)) end[j] = q[j];
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

/// FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS REFPNT TIP-TIP
void Machine::tcpm(Words& words) {
  const Cause cause{1, "FUNCTION TCPM"};
  const auto one_of = [&](std::string_view done, std::initializer_list<std::string_view> refused,
                          const char* sentence) {
    words.cursor.skip_blanks();
    const std::size_t from = words.cursor.at;
    for (const std::string_view other : refused)
      if (words.cursor.take(other)) words.refuse(from, sentence);
    if (!words.cursor.take(done)) words.refuse(from, std::string(done));
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
