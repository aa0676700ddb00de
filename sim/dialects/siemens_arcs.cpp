#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/siemens_machine.h"

namespace abbe::sim::dialects::siemens {

using Eigen::Vector3d;
using kinematics::AxisVector;
using program::ArcMove;

Machine::Plane Machine::plane(const Cause& cause) const {
  using enum Address;
  Plane in = plane_ == 17   ? Plane{"XYZ", {I, J, K}}
             : plane_ == 18 ? Plane{"ZXY", {K, I, J}}
                            : Plane{"YZX", {J, K, I}};
  in.first = canon_.joint_of(in.letters[0]);
  in.second = canon_.joint_of(in.letters[1]);
  in.across = canon_.joint_of(in.letters[2]);
  if (in.first < 0 || in.second < 0)
    refuse(cause,
           fmt::format("a machine with the axes {} {} of the plane", in.letters[0], in.letters[1]));
  return in;
}

/// The centre by I J K, in program coordinates.
AxisVector Machine::centre_of(const Block& block, const Plane& in, const Cause& cause) const {
  const Value &first = block[in.centre[0]], &second = block[in.centre[1]];
  if (const Value& across = block[in.centre[2]])
    refuse(across, fmt::format("the centre in the plane {} {}", in.letters[0], in.letters[1]));
  if (!first && !second)
    refuse(cause, "I J K, CR=, AR= or a pole beside " + std::string(motion_), "none");
  AxisVector p = programmed_here();
  const auto put = [&](int j, const Value& word) {
    if (!word) return;
    const bool absolute = word.measure == Measure::Absolute;
    // an I from the start is a radius under DIAMON too
    const double radius = absolute && j == joint(0) ? radius_of_x(true) : 1.0;
    const double value = word.value * unit() * radius;
    p[j] = absolute ? value : p[j] + value;
  };
  put(in.first, first);
  put(in.second, second);
  return p;
}

void Machine::arc(const Block& block, const Target& words) {
  const Cause cause = cause_of(block);
  const Plane in = plane(cause);
  const Value &radius = block[Address::CR], &angle = block[Address::AR],
              &more = block[Address::TURN];
  const bool polar = block[Address::AP] || block[Address::RP];
  const bool centre = block[Address::I] || block[Address::J] || block[Address::K];
  if (radius && (angle || centre || polar)) refuse(radius, "one of CR=, AR=, I J K and a pole");
  if (polar && (angle || centre)) refuse(cause, "one of CR=, AR=, I J K and a pole");
  Target target = words;
  ArcMove move{.first = in.first,
               .second = in.second,
               .end = {},
               .clockwise = motion_ == "G2",
               .cause = cause,
               .named = radius  ? radius.cause
                        : angle ? angle.cause
                                : cause};
  if (angle && !(angle.value > 0 && angle.value < 360))
    refuse(angle, "AR of more than 0 to less than 360 degrees");
  const double turn = angle.value * units::deg;
  AxisVector p;
  if (polar) {
    p = programmed_here();
    p[in.first] = pole_.at.x();
    p[in.second] = pole_.at.y();
  } else if (centre || (!radius && !angle)) {
    p = centre_of(block, in, cause);
  }
  if (angle && centre) {
    if (target.has(in.first) || target.has(in.second))
      refuse(angle, "AR= beside either the centre or the end");
    const AxisVector start = programmed_here();
    const Eigen::Rotation2Dd rotated(move.clockwise ? -turn : turn);
    const Eigen::Vector2d end =
        Eigen::Vector2d(p[in.first], p[in.second]) +
        rotated * Eigen::Vector2d(start[in.first] - p[in.first], start[in.second] - p[in.second]);
    target.to(in.first, end.x(), angle);
    target.to(in.second, end.y(), angle);
  }
  move.end = canon_.end_from(here(), target, false);
  if (p.size() > 0) {
    move.placed_centre = canon_.placed(std::move(p));
  } else if (radius) {
    move.radius = radius.value * unit();
  } else {
    const AxisVector from = programmed_here(), to = canon_.unplaced(move.end);
    const double chord = std::hypot(to[in.first] - from[in.first], to[in.second] - from[in.second]);
    const double r = chord / (2 * std::sin(0.5 * turn));
    move.radius = turn > pi ? -r : r;
  }
  if (more && (more.value < 0 || more.value > 999 || more.value != std::floor(more.value)))
    refuse(more, "whole turns of 0 to 999 after TURN");
  move.turns = 1 + int(more.value);
  move.stated = target.stated();
  put_arc(block, std::move(move));
}

void Machine::put_arc(const Block& block, ArcMove move) {
  if (compensation_.leaving()) refuse(move.cause, "a line as the first move after G40");
  if (compensation_.on()) {
    if (!compensation_.entered()) refuse(move.cause, "a line as the first move after G41 and G42");
    return compensation_.arc(std::move(move));
  }
  const AxisVector start = canon_.position();
  point_tool(block, move.end);
  for (const int j : turning_.rotary())
    if (traori_ && move.end[j] != start[j] && on_great_circle_.value_or(workpiece_frame_))
      refuse(move.cause, "ORIAXES before an arc that turns the tool");
  canon_.arc(std::move(move));
}

namespace {

/// Centre and normal of the circle through three points, along which it is counter-clockwise; none
/// where they lie on a line.
struct Circle {
  Vector3d centre, normal;
};

std::optional<Circle> circle_through(const Vector3d& start, const Vector3d& between,
                                     const Vector3d& end) {
  const Vector3d a = between - start, b = end - start, n = a.cross(b);
  if (!(n.norm() > 1e-9 * a.norm() * b.norm()) || !(n.norm() > 1e-12)) return std::nullopt;
  const Vector3d to_centre =
      (a.squaredNorm() * b - b.squaredNorm() * a).cross(n) / (2 * n.squaredNorm());
  return Circle{start + to_centre, n.normalized()};
}

}  // namespace

/// CIP: the circle through a point between, in the plane of the three points.
void Machine::arc_through(const Block& block, const Target& target) {
  const Cause cause = cause_of(block);
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cause, "a machine with X Y Z beside CIP");
  AxisVector between = canon_.programmed();
  for (int k = 0; k < 3; ++k) {
    const Value& word = block[Address(int(Address::I1) + k)];
    if (!word) continue;
    if (k == 0) refuse_diameters(word);
    const bool step =
        word.measure == Measure::Step || (word.measure == Measure::Modal && incremental_);
    between[joint(k)] = word.value * unit() + (step ? between[joint(k)] : 0.0);
  }
  ArcMove move{
      .end = canon_.end_of(target), .cause = cause, .named = cause, .stated = target.stated()};
  const auto xyz = [&](const AxisVector& q) {
    return Vector3d(q[joint(0)], q[joint(1)], q[joint(2)]);
  };
  const AxisVector start = canon_.position();
  const auto circle = circle_through(xyz(start), xyz(canon_.placed(between)), xyz(move.end));
  if (!circle) refuse(cause, "three different points beside CIP that lie on no line");
  move.placed_centre = start;
  for (int k = 0; k < 3; ++k) move.placed_centre[joint(k)] = circle->centre[k];
  const program::Frame frame = canon_.frame();
  program::Frame of_the_arc{frame.shift, std::nullopt};
  int across = 0;
  const double most = circle->normal.cwiseAbs().maxCoeff(&across);
  constexpr double in_plane = 1e-14;
  if (most > 1 - in_plane) {
    move.first = joint((across + 1) % 3);
    move.second = joint((across + 2) % 3);
    move.clockwise = circle->normal[across] < 0;
  } else {
    Eigen::Matrix3d R;
    R.col(0) = (xyz(start) - circle->centre).normalized();
    R.col(2) = circle->normal;
    R.col(1) = R.col(2).cross(R.col(0));
    of_the_arc.rotation = R;
    move.first = joint(0);
    move.second = joint(1);
  }
  canon_.set_frame(system_, std::move(of_the_arc));
  try {
    put_arc(block, std::move(move));
  } catch (const BadInput&) {
    canon_.set_frame(system_, frame);
    throw;
  }
  canon_.set_frame(system_, frame);
}

}  // namespace abbe::sim::dialects::siemens
