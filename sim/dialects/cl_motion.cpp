#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/inverse.h"
#include "kinematics/turn_between.h"
#include "kinematics/units.h"
#include "sim/dialects/cl_machine.h"

namespace abbe::sim::dialects::cl {

using kinematics::Reach;

namespace {

constexpr double farthest = 1e6;         // mm
constexpr double length_off = 1e-3;      // of a vector that counts as unit
constexpr double upright_within = 1e-6;  // rad, what seven digits leave
constexpr std::uint32_t every_joint = ~std::uint32_t(0);

std::string text_of(const Eigen::Vector3d& v) {
  return fmt::format("{:.6g} {:.6g} {:.6g}", v.x(), v.y(), v.z());
}

}  // namespace

Eigen::Vector3d Machine::direction_of(const Item& first, const Eigen::Vector3d& ijk) const {
  const double length = ijk.norm();
  if (!(std::abs(length - 1.0) <= length_off))
    refuse(first, "a tool vector of length 1, within a thousandth",
           fmt::format("{}, of length {:.6g}", text_of(ijk), length));
  return ijk / length;
}

Eigen::Vector3d Machine::shift() const {
  const AxisVector zero = canon_.placed(AxisVector::Zero(canon_.position().size()));
  return {zero[canon_.joint_of('X')], zero[canon_.joint_of('Y')], zero[canon_.joint_of('Z')]};
}

/// x,y,z or x,y,z,i,j,k. Without a vector the last one stays.
Location Machine::location(const Statement& s) {
  const std::size_t n = s.items.size();
  if (n != 3 && n != 6)
    refuse(n > 6 ? s.items[6].cause() : s.cause, "x,y,z or x,y,z,i,j,k behind " + s.major,
           fmt::format("{} values", n));
  Location to{vector(s, 0, "a coordinate") * unit(), direction_};
  if (n == 6) to.direction = direction_of(s.items[3], vector(s, 3, "a tool vector"));
  if (upright_ &&
      kinematics::angle_between(to.direction, Eigen::Vector3d::UnitZ()) > upright_within)
    refuse(s.items[3], "MULTAX/ON before a tool vector that is not 0,0,1", text_of(to.direction));
  return to;
}

Location Machine::here() const {
  const AxisVector& q = canon_.position();
  const Eigen::Vector3d tip_w(q[canon_.joint_of('X')], q[canon_.joint_of('Y')],
                              q[canon_.joint_of('Z')]);
  return {tip_w - shift(), direction_};
}

/// The tip mode with the tool that runs; its number must be one that the control knows.
void Machine::be_ready(const Cause& cause) {
  if (canon_.tip_mode() && canon_.coordinates() == program::Coordinates::Tip) return;
  if (tool_ < 0) {
    if (!canon_.options().tool_length.empty())
      tool_ = run_.uncalled_tool(cause, "no LOADTL");
    canon_.call_length(tool_, cause);
  }
  canon_.set_tip_mode(true, cause);
  const AxisVector& offset = canon_.frame().shift;
  for (int j = 0; j < int(offset.size()); ++j)
    if (!canon_.is_linear(j) && offset[j] != 0.0)
      run_.warn_once(
          "the work offset of a rotary axis does nothing to cutter locations: their vectors are "
          "the tool in the workpiece");
}

kinematics::AxisVector Machine::turned_axes(const Location& to, const Eigen::Vector3d& tip_w,
                                            const Cause& cause) {
  kinematics::NearestPose found;
  try {
    found = kinematics::nearest_inverse(canon_.chain(), {tip_w, to.direction}, canon_.position());
  } catch (const std::invalid_argument& fault) {
    refuse(cause, "a machine of three slides and at most two rotary axes for cutter locations",
           fault.what());
  }
  if (found.reach == Reach::Unreachable)
    refuse(cause, "a tool vector that the axes of the machine (" + canon_.letters() + ") reach",
           text_of(to.direction));
  if (found.q.size() == 0)
    refuse(cause, "a location within the travel of the axes",
           fmt::format("{} with the tool vector {}", text_of(to.tip), text_of(to.direction)));
  if (vector_lines_.rule() == PoleRule::Fanuc)
    return vector_lines_.fanuc_axes(canon_.chain(), to.direction, cause);
  return std::move(found.q);
}

/// The tip and the rotary axes there. An equal vector leaves the rotary axes where they are.
kinematics::AxisVector Machine::axes_at(const Location& to, const Cause& cause) {
  if (!(to.tip.cwiseAbs().maxCoeff() <= farthest)) refuse(cause, "a position within 1e6 mm");
  be_ready(cause);
  const Eigen::Vector3d tip_w = to.tip + shift();
  AxisVector end = canon_.position();
  if (turned_to_ != to.direction) end = turned_axes(to, tip_w, cause);
  end[canon_.joint_of('X')] = tip_w.x();
  end[canon_.joint_of('Y')] = tip_w.y();
  end[canon_.joint_of('Z')] = tip_w.z();
  turned_to_ = to.direction;
  return end;
}

void Machine::check_feed(const Cause& cause) const {
  if (!canon_.feed()) refuse(cause, "FEDRAT/ before the first move at feed", "none");
}

/// How far the tool axis is from the great circle in the middle of the move that is to come. Two
/// turns of t rad in all bend the way of the axis, and the circle, by t^2 at most, so their middles
/// are within t^2 / 4: most moves are too short to matter.
void Machine::note_turn(const AxisVector& end, const Eigen::Vector3d& direction) {
  const AxisVector& start = canon_.position();
  double turn = 0.0;
  for (int j = 0; j < int(end.size()); ++j)
    if (!canon_.is_linear(j)) turn += std::abs(end[j] - start[j]);
  if (0.25 * turn * turn <= std::max(bulge_.angle, least_bulge)) return;
  const auto axis_at = [&](const AxisVector& q) -> Eigen::Vector3d {
    return canon_.chain().tool_in_workpiece(q).linear().col(2);
  };
  const Eigen::Vector3d on_circle = kinematics::on_great_circle(axis_at(start), direction, 0.5);
  const double angle = kinematics::angle_between(axis_at(0.5 * (start + end)), on_circle);
  if (angle > bulge_.angle) bulge_ = {angle, canon_.line()};
}

void Machine::straight(const Location& to, const Cause& cause, bool stated, bool rapid) {
  AxisVector end = axes_at(to, cause);
  direction_ = to.direction;
  const std::uint32_t joints = stated ? every_joint : 0;
  if (rapid) return canon_.traverse({.end = std::move(end), .cause = cause, .stated = joints});
  check_feed(cause);
  if (vector_lines_.on()) {
    // led through a pole, the rotary axes do not stand for the vector: the next point turns them
    if (!vector_lines_.straight_feed(canon_.chain(), {std::move(end), cause, false, joints}))
      turned_to_.setZero();
    return;
  }
  note_turn(end, to.direction);
  canon_.straight_feed({.end = std::move(end), .cause = cause, .stated = joints});
}

void Machine::go_to(const Location& to, const Cause& cause, bool stated) {
  const bool rapid = rapid_;
  rapid_ = false;
  if (hole_) return hole(to, cause);
  if (circle_ && rapid && circle_->arcs == 0)
    refuse(cause, "a point at feed behind " + std::string(circle_->word), "one at rapid");
  if (circle_ && !rapid && takes_arc(to)) return arc(to, cause, stated);
  circle_.reset();
  straight(to, cause, stated, rapid);
}

void Machine::go_to(const Statement& s) { go_to(location(s), s.cause, true); }

/// Steps of x y z, or one along the tool axis.
void Machine::go_delta(const Statement& s) {
  be_ready(s.cause);
  Location to = here();
  if (s.items.size() == 1)
    to.tip += direction_ * number(s, 0, "a step along the tool axis") * unit();
  else if (s.items.size() == 3)
    to.tip += vector(s, 0, "a step") * unit();
  else
    refuse(s.cause, "dx,dy,dz or one step along the tool axis behind GODLTA/",
           fmt::format("{} values", s.items.size()));
  circle_.reset();
  go_to(to, s.cause, false);
}

/// Where the tool is said to stand. The axes come from their home, and go there at rapid.
void Machine::from(const Statement& s) {
  const Location to = location(s);
  circle_.reset();
  const std::size_t before = canon_.blocks();
  straight(to, s.cause, true, true);
  home_ = to;
  if (canon_.blocks() > before)
    run_.warn_once(
        fmt::format("FROM on line {} is not where the axes stand: they go there at rapid", s.line));
}

/// To the point of FROM, else to where the axes stood at first.
void Machine::go_home(const Statement& s) {
  for (const Item& item : s.items) refuse(item, "nothing behind GOHOME");
  circle_.reset();
  if (home_) return straight(*home_, s.cause, true, true);
  be_ready(s.cause);
  canon_.go_to(program::Coordinates::Axis, s.cause);
  canon_.traverse({.end = start_of(canon_.options()), .cause = s.cause, .stated = every_joint});
  canon_.go_to(program::Coordinates::Tip, s.cause);
  direction_ = canon_.chain().tool_in_workpiece(canon_.position()).linear().col(2);
  turned_to_ = direction_;
}

/// The tool axis of the points that state none.
void Machine::tool_axis(const Statement& s) {
  if (s.items.size() != 3) refuse(s.cause, "i,j,k behind TLAXIS/");
  if (upright_) refuse(s.cause, "MULTAX/ON before TLAXIS/");
  direction_ = direction_of(s.items.front(), vector(s, 0, "a tool vector"));
}

}  // namespace abbe::sim::dialects::cl
