#include "sim/program/block_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/jacobian.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

// At a feed per revolution the time of an element of path is proportional to the inverse of the
// speed, i.e. to max(|x|, least), where `least` is the radius at which the largest speed is
// reached. The functions below therefore return means of max(|x|, least).

// Mean of max(|x|, least) over a line.
double mean_along_line(double from, double to, double least) {
  const bool one_side = (from < 0.0) == (to < 0.0);
  // The mid-point itself, without the rounding of the integral.
  if (one_side && std::min(std::abs(from), std::abs(to)) >= least)
    return std::abs(0.5 * (from + to));
  if (from == to) return std::max(std::abs(from), least);
  const auto integral = [least](double x) {
    const double r = std::abs(x);
    return std::copysign(r <= least ? least * r : 0.5 * (r * r + least * least), x);
  };
  return (integral(to) - integral(from)) / (to - from);
}

/// Integral of max(|x|, least) over at most one turn from `start`. The range is split where x
/// crosses -least, 0 and least, because each part then has a closed form.
double integral_along_arc(const RadialMove::Arc& arc, double start, double sweep, double least) {
  const double end = start + sweep;
  std::vector<double> angles{start, end};
  for (const double x : {-least, 0.0, least}) {
    const double cosine = (x - arc.centre) / arc.radius;
    if (!(std::abs(cosine) <= 1.0)) continue;
    for (const double angle : {std::acos(cosine), -std::acos(cosine)}) {
      const double turns = std::ceil((std::min(start, end) - angle) / (2 * pi));
      for (double at = angle + 2 * pi * turns; at < std::max(start, end); at += 2 * pi)
        angles.push_back(at);
    }
  }
  std::sort(angles.begin(), angles.end());
  double sum = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double a = angles[i - 1], b = angles[i];
    const double middle = arc.centre + arc.radius * std::cos(0.5 * (a + b));
    const double x = arc.centre * (b - a) + arc.radius * (std::sin(b) - std::sin(a));
    sum += std::abs(middle) <= least ? least * (b - a) : std::copysign(x, x * middle);
  }
  return sum;
}

double mean_along_arc(const RadialMove::Arc& arc, double least) {
  const double turns = std::floor(std::abs(arc.sweep) / (2 * pi));
  const double rest = std::abs(arc.sweep) - 2 * pi * turns;
  // Whole turns have the same integral from any start, which avoids a list of crossings over many
  // turns.
  const double whole =
      turns > 0.0 ? turns * integral_along_arc(arc, arc.start, 2 * pi, least) : 0.0;
  const double sum =
      whole + integral_along_arc(arc, arc.start, std::copysign(rest, arc.sweep), least);
  return sum / std::abs(arc.sweep);
}

}  // namespace

double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm) {
  if (!(m_per_min > 0.0)) return 0.0;
  const double mm_per_turn = m_per_min * 1000.0 / (2 * pi);
  const double least = mm_per_turn / max_rpm;
  const double mean = move.arc && move.arc->sweep != 0.0
                          ? mean_along_arc(*move.arc, least)
                          : mean_along_line(move.from, move.to, least);
  // A mean of zero is a line along the spindle axis without a speed limit.
  return mean > 0.0 ? std::min(m_per_min * 1000.0 / (2 * pi * mean), max_rpm) : max_rpm;
}

double min_radius(const RadialMove& move) {
  if (!move.arc && (move.from < 0.0) != (move.to < 0.0)) return 0.0;
  return std::min(std::abs(move.from), std::abs(move.to));
}

namespace {

using Eigen::Vector2d;

constexpr double largest_radius = 1e6;  // mm, the same limit as for positions
// mm. LinuxCNC has the same limits: radii may differ by 0.005 mm, or by 0.1 % of the radius up to
// 0.5 mm. Coordinates and I J K of three decimals stay below the first.
constexpr double max_growth = 0.5;
constexpr double free_growth = 0.005;
constexpr double relative_growth = 1e-3;  // of the radius, accepted up to max_growth
// mm; an arc that ends this close to its start cannot be given by R
constexpr double one_point = 1e-8;

[[noreturn]] void refuse_arc(const NcLocation& place, const Cause& cause, std::string expected,
                             std::optional<std::string> seen = {}) {
  throw BadGeometry(place.file, place.line, cause.column, std::move(expected),
                    seen ? *std::move(seen) : shown(cause.text));
}

}  // namespace

Vector2d centre_by_radius(const ArcGeometry& ends, double r, const NcLocation& place,
                          const Cause& cause) {
  const Vector2d chord = ends.end - ends.start;
  if (chord.norm() < one_point) refuse_arc(place, cause, "an end that is not the start beside R");
  if (std::abs(r) < one_point) refuse_arc(place, cause, "a radius that is not zero");
  // A chord that is too long by the same tolerance is taken as half a turn.
  if (chord.norm() > 2 * std::abs(r) + free_growth)
    refuse_arc(place, cause,
               fmt::format("a radius of at least half the chord of {} mm", chord.norm()));
  const double height = std::sqrt(std::max(0.0, r * r - 0.25 * chord.squaredNorm()));
  const Vector2d left = Vector2d(-chord.y(), chord.x()).normalized();
  // The centre of an arc below half a turn lies left of the chord if the arc is counter-clockwise.
  const bool centre_is_left = !ends.clockwise == (r > 0);
  return ends.start + 0.5 * chord + (centre_is_left ? height : -height) * left;
}

Arc checked_arc(const ArcGeometry& words, int turns, const NcLocation& place, const Cause& cause) {
  Arc arc = arc_through(words);
  if (turns > 1) arc.sweep += std::copysign(2 * pi * (turns - 1), arc.sweep);
  const double end_radius = (words.end - words.centre).norm();
  if (std::min(arc.radius, end_radius) < one_point)
    refuse_arc(place, cause, "a radius that is not zero", "a centre at an end of the arc");
  if (arc.radius > largest_radius) refuse_arc(place, cause, "a radius of at most 1e6 mm");
  const double off = std::abs(arc.growth);
  if (off > max_growth || (off > free_growth && off > relative_growth * arc.radius))
    refuse_arc(place, cause, "one radius at both ends of the arc",
               fmt::format("{} mm at the start and {} mm at the end", arc.radius, end_radius));
  return arc;
}

AxisVector axes_for_tip(const Path& path, const Block& block, const Chain& control,
                        const AxisVector& programmed, const Eigen::Vector3d& tip_w) {
  const auto q = slides_for_tip(control, programmed, tip_w);
  if (!q)
    throw BadInput(path.file, block.line, 0, "slides that reach the tip",
                   "a tip out of their reach");
  return *q;
}

AxisVector axes_at(const Path& path, const Block& block, const Chain& control, double u) {
  AxisVector programmed = position(path, block, u);
  if (block.coordinates == Coordinates::Axis) return programmed;
  const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
  if (!x || !y || !z)
    throw BadInput(path.file, block.line, 0, "a machine with X Y Z for a tip mode", "another");
  return axes_for_tip(path, block, control, programmed,
                      {programmed[*x], programmed[*y], programmed[*z]});
}

// Derivatives of arcs are not included; callers add them from radius and sweep.
DerivativeBounds bends(const Path& path, const Block& block, int j) {
  const double way = block.end[j] - block.start[j];
  if (block.interpolation != Interpolation::Cubic) return {std::abs(way), 0.0, 0.0};
  const double duration = block.end_s - block.start_s;
  const Cubic& cubic = path.cubics[block.shape];
  const double v0 = cubic.start_velocity[j] * duration, v1 = cubic.end_velocity[j] * duration;
  const double middle = 3 * way - v0 - v1;  // Bezier coefficients of the first derivative
  // A Bezier curve stays within the hull of its coefficients, which bounds each derivative.
  return {std::max({std::abs(v0), std::abs(middle), std::abs(v1)}),
          2 * std::max(std::abs(middle - v0), std::abs(v1 - middle)),
          2 * std::abs(v0 - 2 * middle + v1)};
}

namespace {

constexpr double far_lever = 1e4;  // mm, larger than the lever of any machine

bool is_positioned_turn(const kinematics::Joint& joint) {
  return joint.motion == Motion::Rotary && joint.name != 'S';
}

/// Sum of the distances by which rotary axes displace the tip, mm per rad.
double levers(const Chain& chain, const AxisVector& q) {
  const kinematics::AxisJacobian J = kinematics::axis_jacobian(chain, q);
  double sum = 0.0;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioned_turn(chain.joints()[std::size_t(j)])) sum += J.col(j).head<3>().norm();
  return sum;
}

}  // namespace

double rotary_turn_sum(const Path& path, const Block& block, const Chain& control) {
  double turn = 0.0;
  for (int j = 0; j < control.size(); ++j)
    if (is_positioned_turn(control.joints()[std::size_t(j)])) turn += bends(path, block, j).first;
  return turn;
}

std::size_t chords_of(const Path& path, const Block& block, const Chain& control, double within) {
  const double turn = rotary_turn_sum(path, block, control);
  double way = 0.0, bend = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != Motion::Linear) continue;
    const DerivativeBounds b = bends(path, block, j);
    way += b.first;
    bend += b.second;
  }
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    const double radius = arc.radius + std::abs(arc.growth), sweep = std::abs(arc.sweep);
    way += radius * sweep;
    bend += radius * sweep * sweep;
  }
  // A chord deviates by at most b / 8 n^2, so n is the root of b / (8 within).
  const double allowed = 8 * within;
  bend += 2 * way * turn + way * turn * turn;
  // The Jacobian is computed only if the largest conceivable lever could make a difference.
  if (turn > 0.0 && bend + far_lever * turn * turn > allowed)
    bend += levers(control, axes_at(path, block, control, 0.0)) * turn * turn;
  const double parts = std::max(1.0, std::ceil(std::sqrt(bend / allowed)));
  if (!(parts <= max_chords))
    throw BadInput(path.file, block.line, 0,
                   fmt::format("a move of at most {:.0g} chords within {:.4g} um", max_chords,
                               within / units::um),
                   fmt::format("one of {:.3g}; a larger tolerance needs fewer", parts));
  return std::size_t(parts);
}

}  // namespace abbe::sim::program
