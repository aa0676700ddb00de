#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/dialects/cl_machine.h"

namespace abbe::sim::dialects::cl {

using Eigen::Vector3d;

namespace {

// As the canon allows radii to differ at the ends of an arc.
constexpr double free_mm = 0.005, most_mm = 0.5, share = 1e-3;
constexpr double one_point = 1e-8;       // mm, a circle closes
constexpr double angle_allowed = 0.002;  // rad, of a stated sweep: digits of the points
constexpr double same_angle = 1e-6;      // rad
constexpr double worth_saying = 0.01;    // mm between chord and arc
constexpr double along_axis = 1e-9;      // rad

double allowed(double radius) { return std::max(free_mm, std::min(most_mm, share * radius)); }

Vector3d across(const Vector3d& v, const Vector3d& axis) { return v - axis * axis.dot(v); }

/// A turn that takes z to the axis.
Eigen::Matrix3d frame_about(const Vector3d& axis) {
  Eigen::Matrix3d R;
  R.col(2) = axis;
  R.col(0) = (std::abs(axis.x()) < 0.7 ? Vector3d::UnitX() : Vector3d::UnitY()).cross(axis);
  R.col(0).normalize();
  R.col(1) = axis.cross(R.col(0));
  return R;
}

}  // namespace

/// Centre, vector, radius.
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

/// x,y,z,i,j,k,r: counter-clockwise about the vector, for the points that lie on it. With t,f,d,e
/// behind (NX): clockwise about it, for one point.
void Machine::circle(const Statement& s) {
  const std::size_t n = s.items.size();
  if (n != 7 && n < 11)
    refuse(s.cause, "x,y,z,i,j,k,r or x,y,z,i,j,k,r,t,f,d,e behind CIRCLE/",
           fmt::format("{} values", n));
  Circle circle = stated_circle(s, "CIRCLE/");
  circle.for_one = n > 7;
  circle.sense_in_doubt = n == 7;
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
  if (!(*circle.sweep > 0 && *circle.sweep < 1e6)) refuse(s.items[i], "an angle of 0 to 5.7e7 deg");
  if (i + 1 < s.items.size()) refuse(s.items[i + 1], "nothing behind the angle");
  circle_ = circle;
}

/// From where the tool is to there, rad, counter-clockwise about the axis, above 0 to a whole turn.
double Machine::sweep_to(const Vector3d& to) const {
  const Vector3d& axis = circle_->axis;
  const Vector3d a = across(here().tip - circle_->centre, axis);
  const Vector3d b = across(to - circle_->centre, axis);
  if ((a - b).norm() < one_point) return 2 * pi;
  const double angle = std::atan2(axis.dot(a.cross(b)), a.dot(b));
  return angle > 0 ? angle : angle + 2 * pi;
}

/// Whether the point is the end of an arc of the circle that was stated; behind the first arc of a
/// circle for several points those that leave it go straight.
bool Machine::takes_arc(const Location& to) {
  if (circle_->for_one || circle_->arcs == 0) return true;
  const Vector3d from_centre = across(to.tip - circle_->centre, circle_->axis);
  if (std::abs(from_centre.norm() - circle_->radius) > free_mm) return false;
  const double bulge = circle_->radius * (1 - std::cos(0.5 * sweep_to(to.tip)));
  if (bulge > worth_saying)
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
  if (circle.turned > 2 * pi + same_angle && circle.arcs > 0)
    refuse(cause,
           fmt::format("points that go once around the CIRCLE/ of line {} at most, "
                       "counter-clockwise about its vector",
                       circle.line),
           fmt::format("{:.4g} deg: the vector seems to point the other way",
                       circle.turned / units::deg));
  const bool whole = sweep > 2 * pi - same_angle;
  if (circle.sense_in_doubt && sweep > pi - same_angle && !whole)
    run_.warn_once(
        fmt::format("the arc of line {} is taken counter-clockwise about the vector of its "
                    "CIRCLE/, {:.5g} deg; "
                    "a CAM system that means clockwise has {:.5g} deg the other way",
                    canon_.line(), sweep / units::deg, 360 - sweep / units::deg));
}

void Machine::arc(const Location& to, const Cause& cause, bool stated) {
  check_feed(cause);
  be_ready(cause);
  check_radii(to.tip, cause);
  const double sweep = sweep_to(to.tip);
  check_sense(sweep, cause);
  const Circle circle = *circle_;
  if (circle.for_one)
    circle_.reset();
  else
    ++circle_->arcs;

  program::ArcMove move;
  move.end = axes_at(to, cause);
  direction_ = to.direction;
  note_turn(move.end, to.direction);
  move.cause = move.named = cause;
  move.stated = stated ? ~std::uint32_t(0) : 0;
  if (circle.sweep) move.turns = 1 + int(std::lround((*circle.sweep - sweep) / (2 * pi)));
  const int x = canon_.joint_of('X'), y = canon_.joint_of('Y'), z = canon_.joint_of('Z');
  const Vector3d centre = circle.centre + shift();
  move.placed_centre = canon_.position();
  move.placed_centre[x] = centre.x();
  move.placed_centre[y] = centre.y();
  move.placed_centre[z] = centre.z();
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

}  // namespace abbe::sim::dialects::cl
