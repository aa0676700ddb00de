#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/dialects/cl/machine.h"

namespace abbe::sim::dialects::cl {

using Eigen::Vector3d;
using kinematics::Reach;
using program::Feed;
using program::FeedMode;

namespace {

constexpr double farthest = 1e6;  // mm, the limit of positions of the canon
// Deviation from length 1; vectors of three decimals stay within it.
constexpr double length_off = 1e-3;
constexpr double upright_within = 1e-6;  // rad, rounding of a vector of seven digits
// A stated point determines every axis.
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

// Displacement of the work offset: the programmed zero in the coordinates of the tip.
Eigen::Vector3d Machine::shift() const {
  const AxisVector zero = canon_.placed(AxisVector::Zero(canon_.position().size()));
  return {zero[canon_.joint_of('X')], zero[canon_.joint_of('Y')], zero[canon_.joint_of('Z')]};
}

/// Reads x,y,z or x,y,z,i,j,k; without a vector the last one is kept.
Location Machine::location(const Statement& s) {
  const std::size_t n = s.items.size();
  if (n != 3 && n != 6)
    refuse(n > 6 ? s.items[6].cause() : s.cause, "x,y,z or x,y,z,i,j,k behind " + s.major,
           fmt::format("{} values", n));
  Location to{vector(s, 0, "a coordinate") * unit(), direction_};
  if (n == 6) to.direction = direction_of(s.items[3], vector(s, 3, "a tool vector"));
  // MULTAX/OFF promises upright vectors; a tilted one contradicts it.
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

/// Switches to tip mode with the current tool, whose number the control must know.
void Machine::enter_tip_mode(const Cause& cause) {
  if (canon_.tip_mode() && canon_.coordinates() == program::Coordinates::Tip) return;
  if (tool_ < 0) {
    // Without LOADTL the only tool is assumed, and reported.
    if (!canon_.options().tool_length.empty()) tool_ = run_.assume_only_tool(cause, "no LOADTL");
    canon_.select_length(tool_, cause);
  }
  canon_.set_tip_mode(true, cause);
  const AxisVector& offset = canon_.frame().shift;
  for (int j = 0; j < int(offset.size()); ++j)
    if (!canon_.is_linear(j) && offset[j] != 0.0)
      run_.warn_once(
          "the work offset of a rotary axis does nothing to cutter locations: their vectors are "
          "the tool in the workpiece");
}

// Positions are solved with travel limits first: a direction that is reachable only beyond them
// gets a message of its own.
kinematics::AxisVector Machine::turned_axes(const Location& to, const Eigen::Vector3d& tip_w,
                                            const Cause& cause) {
  kinematics::NearestPose found;
  try {
    found = kinematics::nearest_inverse_solution(canon_.chain(), {tip_w, to.direction},
                                                 canon_.position());
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
  // Fanuc's rule chooses among the solutions by travel axis by axis, not by total travel.
  if (vector_lines_.rule() == PoleRule::Fanuc)
    return vector_lines_.fanuc_rotary_axes(canon_.chain(), to.direction, cause);
  return std::move(found.q);
}

/// Returns the axes at a location. An equal vector keeps the rotary axes, so that rounding of the
/// inverse does not move them.
kinematics::AxisVector Machine::axes_at(const Location& to, const Cause& cause) {
  if (!(to.tip.cwiseAbs().maxCoeff() <= farthest)) refuse(cause, "a position within 1e6 mm");
  enter_tip_mode(cause);
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

/// Records how far the tool axis is from the great circle in the middle of the next move. Rotations
/// of t rad in total bend the path of the axis, and the circle, by at most t^2, so their middles
/// are within t^2 / 4: most moves are too short to need the exact value.
void Machine::note_turn(const AxisVector& end, const Eigen::Vector3d& direction) {
  const AxisVector& start = canon_.position();
  double turn = 0.0;
  for (int j = 0; j < int(end.size()); ++j)
    if (!canon_.is_linear(j)) turn += std::abs(end[j] - start[j]);
  if (0.25 * turn * turn <= std::max(axis_deviation_.angle, min_bulge)) return;
  const auto axis_at = [&](const AxisVector& q) -> Eigen::Vector3d {
    return canon_.chain().tool_in_workpiece(q).linear().col(2);
  };
  const Eigen::Vector3d on_circle = kinematics::great_circle_point(axis_at(start), direction, 0.5);
  const double angle = kinematics::angle_between(axis_at(0.5 * (start + end)), on_circle);
  if (angle > axis_deviation_.angle) axis_deviation_ = {angle, canon_.line()};
}

void Machine::straight(const Location& to, const Cause& cause, bool stated, bool rapid) {
  AxisVector end = axes_at(to, cause);
  direction_ = to.direction;
  const std::uint32_t joints = stated ? every_joint : 0;
  if (rapid) return canon_.traverse({.end = std::move(end), .cause = cause, .stated = joints});
  check_feed(cause);
  if (vector_lines_.is_active()) {
    // After a passage through a pole the rotary axes do not correspond to the vector: the next
    // point solves them again.
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
  // RAPID between a circle and its first point makes no sense; behind the first arc it just ends
  // the circle.
  if (circle_ && rapid && circle_->arcs == 0)
    refuse(cause, "a point at feed behind " + std::string(circle_->word), "one at rapid");
  if (circle_ && !rapid && continues_arc(to)) return arc(to, cause, stated);
  circle_.reset();
  straight(to, cause, stated, rapid);
}

void Machine::go_to(const Statement& s) { go_to(location(s), s.cause, true); }

/// Steps of x y z, or one step along the tool axis.
void Machine::go_delta(const Statement& s) {
  enter_tip_mode(s.cause);
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

/// FROM states where the tool is. If the axes are elsewhere, they move there at rapid.
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

/// Moves to the point of FROM, or to the initial axis positions.
void Machine::go_home(const Statement& s) {
  for (const Item& item : s.items) refuse(item, "nothing behind GOHOME");
  circle_.reset();
  if (home_) return straight(*home_, s.cause, true, true);
  enter_tip_mode(s.cause);
  // Home is a position of the axes, not of the tip.
  canon_.go_to(program::Coordinates::Axis, s.cause);
  canon_.traverse({.end = start_of(canon_.options()), .cause = s.cause, .stated = every_joint});
  canon_.go_to(program::Coordinates::Tip, s.cause);
  direction_ = canon_.chain().tool_in_workpiece(canon_.position()).linear().col(2);
  turned_to_ = direction_;
}

/// Sets the tool axis of points that state none.
void Machine::tool_axis(const Statement& s) {
  if (s.items.size() != 3) refuse(s.cause, "i,j,k behind TLAXIS/");
  if (upright_) refuse(s.cause, "MULTAX/ON before TLAXIS/");
  direction_ = direction_of(s.items.front(), vector(s, 0, "a tool vector"));
}

namespace {

// Tolerances of the canon for the radii at the ends of an arc, see the README of sim/program.
constexpr double free_mm = 0.005, max_mm = 0.5, share = 1e-3;
constexpr double one_point = 1e-8;         // mm, a circle closes
constexpr double angle_allowed = 0.002;    // rad, for a stated sweep: rounding of the points
constexpr double same_angle = 1e-6;        // rad, rounding of a sweep
constexpr double bulge_warning_mm = 0.01;  // mm between chord and arc
constexpr double along_axis = 1e-9;  // rad, an axis this close to X, Y or Z needs no rotated plane

double allowed(double radius) { return std::max(free_mm, std::min(max_mm, share * radius)); }

// Component perpendicular to an axis.
Vector3d across(const Vector3d& v, const Vector3d& axis) { return v - axis * axis.dot(v); }

/// Returns a rotation that maps z to the axis. The reference axis is not closer than 45 deg to it.
Eigen::Matrix3d frame_about(const Vector3d& axis) {
  Eigen::Matrix3d R;
  R.col(2) = axis;
  R.col(0) = (std::abs(axis.x()) < 0.7 ? Vector3d::UnitX() : Vector3d::UnitY()).cross(axis);
  R.col(0).normalize();
  R.col(1) = axis.cross(R.col(0));
  return R;
}

}  // namespace

/// Reads centre, vector and radius.
Machine::Circle Machine::stated_circle(const Statement& s, std::string_view word) const {
  Circle circle;
  circle.line = s.line;
  circle.word = word;
  circle.centre = vector(s, 0, "the centre of a circle") * unit();
  circle.axis = direction_of(s.items.size() > 3 ? s.items[3] : s.items.front(),
                             vector(s, 3, "the vector of a circle"));
  circle.radius = number(s, 6, "the radius of a circle") * unit();
  if (!(circle.radius > 0)) refuse(s.items[6], "a radius above zero");
  return circle;
}

/// CIRCLE/x,y,z,i,j,k,r: counter-clockwise about the vector, for the points that lie on the circle.
/// With t,f,d,e behind (NX): clockwise about the vector, for one point.
void Machine::circle(const Statement& s) {
  const std::size_t n = s.items.size();
  if (n != 7 && n < 11)
    refuse(s.cause, "x,y,z,i,j,k,r or x,y,z,i,j,k,r,t,f,d,e behind CIRCLE/",
           fmt::format("{} values", n));
  Circle circle = stated_circle(s, "CIRCLE/");
  circle.for_next_point_only = n > 7;
  circle.sense_in_doubt = n == 7;
  // NX's clockwise arc is a counter-clockwise one about the opposite vector.
  if (n > 7) circle.axis = -circle.axis;
  for (std::size_t i = 7; i < n; ++i) {
    if (i < 11) {
      number(s, i, "tolerance, its share, diameter and corner radius");
    } else if (!s.items[i].is("TIMES") && s.items[i].number.value_or(2.0) > 1.0) {
      refuse(s.items[i], "arcs of at most a whole turn: TIMES is not read");
    }
  }
  circle_ = circle;
}

/// MOVARC/x,y,z,i,j,k,r,ANGLE,degrees: counter-clockwise about the vector, to the next point.
void Machine::moving_arc(const Statement& s) {
  Circle circle = stated_circle(s, "MOVARC/");
  std::size_t i = 7;
  if (i < s.items.size() && s.items[i].is("ANGLE")) ++i;
  circle.sweep = number(s, i, "the degrees of an arc") * units::deg;
  // 1e6 rad keeps the number of turns within int.
  if (!(*circle.sweep > 0 && *circle.sweep < 1e6)) refuse(s.items[i], "an angle of 0 to 5.7e7 deg");
  if (i + 1 < s.items.size()) refuse(s.items[i + 1], "nothing behind the angle");
  circle_ = circle;
}

/// Returns the sweep from the current position to a point, rad, counter-clockwise about the axis,
/// above 0 and up to a whole turn.
double Machine::sweep_to(const Vector3d& to) const {
  const Vector3d& axis = circle_->axis;
  const Vector3d a = across(here().tip - circle_->centre, axis);
  const Vector3d b = across(to - circle_->centre, axis);
  // Coinciding ends are a full circle; a straight line would have no length.
  if ((a - b).norm() < one_point) return 2 * pi;
  const double angle = std::atan2(axis.dot(a.cross(b)), a.dot(b));
  return angle > 0 ? angle : angle + 2 * pi;
}

/// Returns true if a point is the end of an arc of the stated circle. After the first arc of a
/// circle for several points, a point off the circle is reached straight and ends it.
bool Machine::continues_arc(const Location& to) {
  if (circle_->for_next_point_only || circle_->arcs == 0) return true;
  const Vector3d from_centre = across(to.tip - circle_->centre, circle_->axis);
  if (std::abs(from_centre.norm() - circle_->radius) > free_mm) return false;
  // Sagitta of the arc: how far a wrong guess would be off.
  const double bulge = circle_->radius * (1 - std::cos(0.5 * sweep_to(to.tip)));
  if (bulge > bulge_warning_mm)
    run_.warn_once(fmt::format(
        "the point of line {} lies on the CIRCLE/ of line {}, too, and is taken as the end of "
        "another arc of it: a straight line would be up to {:.3g} mm beside",
        canon_.line(), circle_->line, bulge));
  return true;
}

void Machine::check_radii(const Vector3d& to, const Cause& cause) const {
  const Circle& circle = *circle_;
  for (const auto& [point, name] : {std::pair{here().tip, "start"}, std::pair{to, "end"}}) {
    const double radius = across(point - circle.centre, circle.axis).norm();
    if (std::abs(radius - circle.radius) > allowed(circle.radius))
      refuse(cause,
             fmt::format("the {} of the arc {:.6g} mm from the axis of {} of line {}", name,
                         circle.radius, circle.word, circle.line),
             fmt::format("{:.6g} mm", radius));
  }
}

// Checks the sweep against MOVARC's angle, modulo whole turns, and against one turn in total.
void Machine::check_sense(double sweep, const Cause& cause) {
  Circle& circle = *circle_;
  if (circle.sweep) {
    const double turns = (*circle.sweep - sweep) / (2 * pi);
    if (std::abs(turns - std::round(turns)) * 2 * pi > angle_allowed)
      refuse(cause,
             fmt::format("the end of an arc of {:.6g} deg, as MOVARC/ of line {} says",
                         *circle.sweep / units::deg, circle.line),
             fmt::format("one of {:.6g} deg", sweep / units::deg));
  }
  circle.turned += sweep;
  // Points that exceed one turn in total show that the vector points the other way.
  if (circle.turned > 2 * pi + same_angle && circle.arcs > 0)
    refuse(cause,
           fmt::format("points that go once around the CIRCLE/ of line {} at most, "
                       "counter-clockwise about its vector",
                       circle.line),
           fmt::format("{:.4g} deg: the vector seems to point the other way",
                       circle.turned / units::deg));
  const bool whole = sweep > 2 * pi - same_angle;
  // A sweep of more than half a turn is the sign of a vector with the opposite convention.
  if (circle.sense_in_doubt && sweep > pi - same_angle && !whole)
    run_.warn_once(
        fmt::format("the arc of line {} is taken counter-clockwise about the vector of its "
                    "CIRCLE/, {:.5g} deg; "
                    "a CAM system that means clockwise has {:.5g} deg the other way",
                    canon_.line(), sweep / units::deg, 360 - sweep / units::deg));
}

void Machine::arc(const Location& to, const Cause& cause, bool stated) {
  check_feed(cause);
  enter_tip_mode(cause);
  check_radii(to.tip, cause);
  const double sweep = sweep_to(to.tip);
  check_sense(sweep, cause);
  const Circle circle = *circle_;
  if (circle.for_next_point_only)
    circle_.reset();
  else
    ++circle_->arcs;

  program::ArcMove move;
  move.end = axes_at(to, cause);
  direction_ = to.direction;
  note_turn(move.end, to.direction);
  move.cause = move.named = cause;
  move.stated = stated ? ~std::uint32_t(0) : 0;
  // Whole turns beyond the sweep between the ends are additional turns of a helix.
  if (circle.sweep) move.turns = 1 + int(std::lround((*circle.sweep - sweep) / (2 * pi)));
  const int x = canon_.joint_of('X'), y = canon_.joint_of('Y'), z = canon_.joint_of('Z');
  const Vector3d centre = circle.centre + shift();
  move.placed_centre = canon_.position();
  move.placed_centre[x] = centre.x();
  move.placed_centre[y] = centre.y();
  move.placed_centre[z] = centre.z();
  // A circle about X, Y or Z lies in the plane of two axes, which needs no rotation.
  const std::array<std::array<int, 3>, 3> planes{{{y, z, x}, {z, x, y}, {x, y, z}}};
  for (int k = 0; k < 3; ++k)
    if (std::abs(circle.axis[k]) > std::cos(along_axis)) {
      move.first = planes[std::size_t(k)][0];
      move.second = planes[std::size_t(k)][1];
      move.clockwise = circle.axis[k] < 0;
      return canon_.arc(std::move(move));
    }
  move.first = x;
  move.second = y;
  // Otherwise the frame is rotated for this one arc; the frame in force is restored in any case.
  const program::Frame upright = canon_.frame();
  canon_.set_frame(0, {upright.shift, frame_about(circle.axis)});
  try {
    canon_.arc(std::move(move));
  } catch (const BadInput&) {
    canon_.set_frame(0, upright);
    throw;
  }
  canon_.set_frame(0, upright);
}

namespace {

/// Levels of CYCLE/DRILL read so far, mm from the point along the tool axis.
struct HoleParameters {
  std::optional<double> bottom, clear, back;
};

}  // namespace

/// Reads CYCLE/DRILL, whose word and number pairs may be in any order.
Machine::Hole Machine::parse_hole(const Statement& s) {
  HoleParameters words;
  Hole hole;
  const auto one = [&](std::optional<double>& into, const Item& word, double value) {
    if (into) refuse(word, "a distance once", std::string(word.text) + " besides");
    into = value;
  };
  for (std::size_t i = 1; i < s.items.size(); ++i) {
    const Item& word = s.items[i];
    // A number directly behind DRILL is the depth.
    if (word.number && i == 1) {
      words.bottom = -*word.number * unit();
      continue;
    }
    if (word.number) refuse(word, "a word before the number");
    const bool feeds = word.is("MMPM") || word.is("IPM") || word.is("PERMIN") || word.is("MMPR") ||
                       word.is("IPR") || word.is("PERREV");
    const bool known = feeds || word.is("DEPTH") || word.is("FEDTO") || word.is("CLEAR") ||
                       word.is("RAPTO") || word.is("RTRCTO") || word.is("RETURN") ||
                       word.is("DWELL");
    if (!known) {
      unknown(s, word, "DEPTH, FEDTO, CLEAR, RAPTO, RTRCTO, RETURN, DWELL or a unit of feed");
      // The numbers of an unknown word belong to it.
      while (i + 1 < s.items.size() && s.items[i + 1].number) ++i;
      continue;
    }
    // A word without a number names a level that only the control knows.
    if (i + 1 < s.items.size() && !s.items[i + 1].number)
      refuse(s.items[i + 1], fmt::format("a number behind {}: levels that a control chooses are "
                                         "not known here",
                                         word.text));
    const double value = number(s, ++i, "a number");
    if (feeds) {
      if (!(value > 0)) refuse(s.items[i], "a feed above zero");
      const bool inches = word.is("IPM") || word.is("IPR");
      const bool own_unit = word.is("PERMIN") || word.is("PERREV");
      hole.feed = Feed{value, own_unit ? unit() : inches ? units::inch : 1.0};
      if (word.is("MMPR") || word.is("IPR") || word.is("PERREV"))
        hole.mode = FeedMode::PerRevolution;
    } else if (word.is("DEPTH") || word.is("FEDTO")) {
      // DEPTH counts downwards, FEDTO is a position along the tool axis.
      one(words.bottom, word, (word.is("DEPTH") ? -value : value) * unit());
    } else if (word.is("CLEAR") || word.is("RAPTO")) {
      one(words.clear, word, value * unit());
    } else if (word.is("DWELL")) {
      hole.dwell_s = value;
    } else {
      one(words.back, word, value * unit());
    }
  }
  if (!words.bottom) refuse(s.cause, "DEPTH or FEDTO and a distance behind CYCLE/DRILL", "none");
  if (!words.clear) refuse(s.cause, "CLEAR or RAPTO and a distance behind CYCLE/DRILL", "none");
  hole.depth = -*words.bottom;
  hole.clear = *words.clear;
  hole.back = words.back.value_or(hole.clear);
  // Moves are made in this order, so the levels must be in order too.
  if (!(hole.clear > -hole.depth) || hole.back < hole.clear)
    refuse(s.cause, "the bottom below the clearance, and that not above the return",
           fmt::format("{:.6g}, {:.6g} and {:.6g} mm above the point", -hole.depth, hole.clear,
                       hole.back));
  return hole;
}

void Machine::cycle(const Statement& s) {
  circle_.reset();
  if (s.items.empty()) refuse(s.cause, "DRILL or OFF behind CYCLE/");
  if (s.items.front().is("OFF")) {
    hole_.reset();
    return;
  }
  if (!s.items.front().is("DRILL"))
    refuse(s.items.front(), "CYCLE/DRILL, or the moves themselves: other cycles are not expanded");
  hole_ = parse_hole(s);
}

void Machine::go(const Location& to, const Cause& cause, bool rapid) {
  straight(to, cause, true, rapid);
}

/// Makes a hole: above it at the current level, or first up to the clearance; down at feed and back
/// at rapid.
void Machine::hole(const Location& at, const Cause& cause) {
  const Hole& hole = *hole_;
  enter_tip_mode(cause);
  const auto above = [&](double height) {
    return Location{at.tip + at.direction * height, at.direction};
  };
  // A level is comparable only if the tool axis does not change.
  if (at.direction == turned_to_) {
    const Location now = here();
    const double level = at.direction.dot(now.tip - at.tip);
    if (level >= hole.clear)
      go(above(level), cause, true);
    else
      go({now.tip + at.direction * (hole.clear - level), at.direction}, cause, true);
  }
  go(above(hole.clear), cause, true);
  // The feed of the cycle holds for the hole alone.
  const auto feed = canon_.feed();
  const FeedMode mode = canon_.feed_mode();
  if (hole.feed) {
    canon_.set_feed_mode(hole.mode);
    canon_.set_feed(hole.feed);
  }
  go(above(-hole.depth), cause, false);
  canon_.dwell(hole.dwell_s, cause);
  go(above(hole.back), cause, true);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

}  // namespace abbe::sim::dialects::cl
