#include "sim/program/block_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

// At a feed per revolution the time of an element of path is proportional to the inverse of the
// speed, i.e. to max(|x|, limit_radius), where `limit_radius` is the radius at which the largest
// speed is reached. The functions below therefore return means of max(|x|, limit_radius).

/// Returns the mean of max(|x|, limit_radius) over a line.
double mean_along_line(double from, double to, double limit_radius) {
  const bool is_one_sided = (from < 0.0) == (to < 0.0);
  // The midpoint is exact; the integral below would round.
  if (is_one_sided && std::min(std::abs(from), std::abs(to)) >= limit_radius)
    return std::abs(0.5 * (from + to));
  if (from == to) return std::max(std::abs(from), limit_radius);
  const auto integral = [limit_radius](double x) {
    const double r = std::abs(x);
    return std::copysign(
        r <= limit_radius ? limit_radius * r : 0.5 * (r * r + limit_radius * limit_radius), x);
  };
  return (integral(to) - integral(from)) / (to - from);
}

/// Returns the integral of max(|x|, limit_radius) over at most one turn from `start`. The range is
/// split where x crosses -limit_radius, 0 and limit_radius, because each part has a closed form.
double integral_along_arc(const RadialMove::Arc& arc, double start, double sweep,
                          double limit_radius) {
  const double end = start + sweep;
  std::vector<double> angles{start, end};
  for (const double x : {-limit_radius, 0.0, limit_radius}) {
    const double cosine = (x - arc.centre) / arc.radius;
    if (!(std::abs(cosine) <= 1.0)) continue;
    for (const double angle : {std::acos(cosine), -std::acos(cosine)}) {
      const double turns = std::ceil((std::min(start, end) - angle) / (2 * pi));
      for (double crossing = angle + 2 * pi * turns; crossing < std::max(start, end);
           crossing += 2 * pi)
        angles.push_back(crossing);
    }
  }
  std::sort(angles.begin(), angles.end());
  double sum = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double a = angles[i - 1], b = angles[i];
    const double middle = arc.centre + arc.radius * std::cos(0.5 * (a + b));
    const double x = arc.centre * (b - a) + arc.radius * (std::sin(b) - std::sin(a));
    sum += std::abs(middle) <= limit_radius ? limit_radius * (b - a) : std::copysign(x, x * middle);
  }
  return sum;
}

double mean_along_arc(const RadialMove::Arc& arc, double limit_radius) {
  const double turns = std::floor(std::abs(arc.sweep) / (2 * pi));
  const double partial_sweep = std::abs(arc.sweep) - 2 * pi * turns;
  // A whole turn has the same integral from any start. Integrating one turn avoids a list of
  // crossings over many turns.
  const double whole_turn_integral =
      turns > 0.0 ? turns * integral_along_arc(arc, arc.start, 2 * pi, limit_radius) : 0.0;
  const double sum =
      whole_turn_integral +
      integral_along_arc(arc, arc.start, std::copysign(partial_sweep, arc.sweep), limit_radius);
  return sum / std::abs(arc.sweep);
}

}  // namespace

double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm) {
  if (!(m_per_min > 0.0)) return 0.0;
  const double arc_speed_mm = m_per_min * 1000.0 / (2 * pi);
  const double limit_radius = arc_speed_mm / max_rpm;
  const double mean = move.arc && move.arc->sweep != 0.0
                          ? mean_along_arc(*move.arc, limit_radius)
                          : mean_along_line(move.from, move.to, limit_radius);
  // The mean is zero only for a line along the spindle axis without a speed limit.
  return mean > 0.0 ? std::min(m_per_min * 1000.0 / (2 * pi * mean), max_rpm) : max_rpm;
}

double min_radius(const RadialMove& move) {
  if (!move.arc && (move.from < 0.0) != (move.to < 0.0)) return 0.0;
  return std::min(std::abs(move.from), std::abs(move.to));
}

namespace {

using Eigen::Vector2d;

constexpr double max_arc_radius = 1e6;  // mm, the same limit as for positions
// Start and end radius may differ by 0.005 mm, or by 0.1 % of the radius up to 0.5 mm, as in
// LinuxCNC. Coordinates and I J K of three decimals stay below the first.
constexpr double max_radius_mismatch = 0.5;        // mm
constexpr double always_allowed_mismatch = 0.005;  // mm
constexpr double relative_mismatch = 1e-3;  // of the radius, accepted up to max_radius_mismatch
// mm; an arc whose end is closer to its start cannot be given by R
constexpr double min_chord = 1e-8;

[[noreturn]] void throw_arc_error(const NcLocation& location, const Cause& cause,
                                  std::string expected, std::optional<std::string> seen = {}) {
  throw BadGeometry(location.file, location.line, cause.column, std::move(expected),
                    seen ? *std::move(seen) : shown(cause.text));
}

}  // namespace

Vector2d centre_by_radius(const ArcGeometry& ends, double r, const NcLocation& location,
                          const Cause& cause) {
  const Vector2d chord = ends.end - ends.start;
  if (chord.norm() < min_chord)
    throw_arc_error(location, cause, "with R, an end that differs from the start");
  if (std::abs(r) < min_chord) throw_arc_error(location, cause, "a nonzero radius");
  // A chord that exceeds the diameter by no more than the tolerance is taken as half a turn.
  if (chord.norm() > 2 * std::abs(r) + always_allowed_mismatch)
    throw_arc_error(location, cause,
                    fmt::format("a radius of at least half the chord of {} mm", chord.norm()));
  const double height = std::sqrt(std::max(0.0, r * r - 0.25 * chord.squaredNorm()));
  const Vector2d left = Vector2d(-chord.y(), chord.x()).normalized();
  // The centre of an arc below half a turn lies left of the chord if the arc is counter-clockwise.
  const bool centre_is_left = !ends.clockwise == (r > 0);
  return ends.start + 0.5 * chord + (centre_is_left ? height : -height) * left;
}

Arc validated_arc(const ArcGeometry& geometry, int turns, const NcLocation& location,
                  const Cause& cause) {
  Arc arc = arc_through(geometry);
  if (turns > 1) arc.sweep += std::copysign(2 * pi * (turns - 1), arc.sweep);
  const double end_radius = (geometry.end - geometry.centre).norm();
  if (std::min(arc.radius, end_radius) < min_chord)
    throw_arc_error(location, cause, "a nonzero radius", "a centre at an end of the arc");
  if (arc.radius > max_arc_radius) throw_arc_error(location, cause, "a radius of at most 1e6 mm");
  const double mismatch = std::abs(arc.growth);
  if (mismatch > max_radius_mismatch ||
      (mismatch > always_allowed_mismatch && mismatch > relative_mismatch * arc.radius))
    throw_arc_error(location, cause, "equal radii at both ends of the arc",
                    fmt::format("{} mm at the start and {} mm at the end", arc.radius, end_radius));
  return arc;
}

AxisVector axes_for_tip(const Path& path, const Block& block, const Chain& control,
                        const AxisVector& programmed, const Eigen::Vector3d& tip_w) {
  const auto q = solve_slides(control, programmed, tip_w);
  if (!q)
    throw BadInput(path.file, block.line, 0, "a tip within the travel of the linear axes",
                   "a tip out of reach");
  return *q;
}

AxisVector axes_at(const Path& path, const Block& block, const Chain& control, double u) {
  AxisVector programmed = position(path, block, u);
  if (block.coordinates == Coordinates::Axis) return programmed;
  const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
  if (!x || !y || !z)
    throw BadInput(path.file, block.line, 0, "a machine with X Y Z for a tip mode", "other axes");
  return axes_for_tip(path, block, control, programmed,
                      {programmed[*x], programmed[*y], programmed[*z]});
}

// Arcs are not included: callers add their derivatives from radius and sweep.
DerivativeBounds derivative_bounds(const Path& path, const Block& block, int j) {
  const double displacement = block.end[j] - block.start[j];
  if (block.interpolation != Interpolation::Cubic) return {std::abs(displacement), 0.0, 0.0};
  const double duration = block.end_s - block.start_s;
  const Cubic& cubic = path.cubics[block.shape];
  const double v0 = cubic.start_velocity[j] * duration, v1 = cubic.end_velocity[j] * duration;
  const double middle = 3 * displacement - v0 - v1;  // Bezier coefficients of the first derivative
  // A Bezier curve stays within the hull of its coefficients, which bounds each derivative.
  return {std::max({std::abs(v0), std::abs(middle), std::abs(v1)}),
          2 * std::max(std::abs(middle - v0), std::abs(v1 - middle)),
          2 * std::abs(v0 - 2 * middle + v1)};
}

namespace {

constexpr double max_lever = 1e4;  // mm, larger than the lever of any rotary axis

bool is_positioning_rotary(const kinematics::Joint& joint) {
  return joint.motion == Motion::Rotary && joint.name != 'S';
}

/// Returns the sum of the distances by which the rotary axes displace the tip, mm per rad.
double rotary_lever_sum(const Chain& chain, const AxisVector& q) {
  const kinematics::AxisJacobian J = kinematics::axis_jacobian(chain, q);
  double sum = 0.0;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioning_rotary(chain.joints()[std::size_t(j)])) sum += J.col(j).head<3>().norm();
  return sum;
}

}  // namespace

double total_rotation(const Path& path, const Block& block, const Chain& control) {
  double rotation = 0.0;
  for (int j = 0; j < control.size(); ++j)
    if (is_positioning_rotary(control.joints()[std::size_t(j)]))
      rotation += derivative_bounds(path, block, j).first;
  return rotation;
}

std::size_t chords_of(const Path& path, const Block& block, const Chain& control,
                      double tolerance) {
  const double rotation = total_rotation(path, block, control);
  double travel = 0.0, second_derivative = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != Motion::Linear) continue;
    const DerivativeBounds b = derivative_bounds(path, block, j);
    travel += b.first;
    second_derivative += b.second;
  }
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    const double radius = arc.radius + std::abs(arc.growth), sweep = std::abs(arc.sweep);
    travel += radius * sweep;
    second_derivative += radius * sweep * sweep;
  }
  // A chord deviates by at most b / 8 n^2, so n is the square root of b / (8 tolerance).
  const double allowed = 8 * tolerance;
  second_derivative += 2 * travel * rotation + travel * rotation * rotation;
  // The Jacobian is computed only if the largest conceivable lever could make a difference.
  if (rotation > 0.0 && second_derivative + max_lever * rotation * rotation > allowed)
    second_derivative +=
        rotary_lever_sum(control, axes_at(path, block, control, 0.0)) * rotation * rotation;
  const double chords = std::max(1.0, std::ceil(std::sqrt(second_derivative / allowed)));
  if (!(chords <= max_chords))
    throw BadInput(path.file, block.line, 0,
                   fmt::format("a move of at most {:.0g} chords within {:.4g} um", max_chords,
                               tolerance / units::um),
                   fmt::format("one of {:.3g}; a larger tolerance gives fewer", chords));
  return std::size_t(chords);
}

}  // namespace abbe::sim::program
