#include "kinematics/inverse_kinematics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/LU>

#include "kinematics/pose.h"
#include "kinematics/units.h"

namespace abbe::kinematics {

namespace {

using Eigen::Vector3d;

// A direction within this angle of an axis counts as parallel to it, one within this angle beyond
// the reachable cone as reachable. Well above rounding (4e-16), and two of them stay below the
// promised 1e-12 rad.
constexpr double angle_tolerance = 2e-13;  // rad
// A slide at most this far beyond its limit is set on the limit; a fifth of the promised 1e-9 mm.
constexpr double slide_tolerance = 2e-10;  // mm
// Near a singular pose, and where two branches meet, rounding moves an axis far more than the tool
// direction. A rotary axis at most this far beyond a limit is set on the limit if the direction
// stays within `direction_tolerance`.
constexpr double limit_slack = 1e-6;           // rad
constexpr double direction_tolerance = 8e-13;  // rad
// The sides of the spherical triangle are known to a few ulp of pi (4e-16 rad).
constexpr double rounding = 1e-15;  // rad
// Minimum volume spanned by the unit directions of the three slides (1 if square); below it they
// count as dependent.
constexpr double smallest_volume = 1e-9;

// A rotary axis of the nominal chain.
struct Rotary {
  int joint;
  Vector3d direction_b;
  double kept;  // position while the axis is free
};

// A rotary solution for the direction: a position for each rotary axis, empty where the axis is
// free.
using RotaryAngles = std::array<std::optional<double>, 2>;

bool parallel(double angle) { return std::min(angle, pi - angle) <= angle_tolerance; }

// Returns the rotation about `axis` from one direction to another. Both are projected first: near
// the axis the cross product of the full vectors would be nothing but rounding.
double rotation_between(const Vector3d& axis, const Vector3d& from, const Vector3d& to) {
  const Vector3d f = axis.cross(from);
  const Vector3d t = axis.cross(to);
  return std::atan2(axis.dot(f.cross(t)), f.dot(t));
}

// Returns the angle of a spherical triangle between the sides a and b, opposite to c; empty if the
// sides form no triangle. Uses tan^2(angle/2) = sin(s-a) sin(s-b) / (sin s sin(s-c)), s half the
// sum: the cosine rule loses half of the digits where the triangle collapses, as at singular poses.
std::optional<double> corner(double a, double b, double c) {
  const double s_a = 0.5 * ((b - a) + c);
  const double s_b = 0.5 * ((a - b) + c);
  const double s_c = 0.5 * ((a - c) + b);
  const double rest = 0.5 * (((pi - a) - b) + (pi - c));  // pi - s
  if (std::min({s_a, s_b, s_c, rest}) < -0.5 * angle_tolerance) return std::nullopt;
  const auto sine = [](double x) { return x < rounding ? 0.0 : std::sin(x); };
  return 2.0 * std::atan2(std::sqrt(sine(s_a) * sine(s_b)), std::sqrt(sine(rest) * sine(s_c)));
}

// Returns the rotation of one axis that brings `tool` to `wanted`: nullopt if there is none, an
// engaged but empty optional if every rotation does, i.e. the tool lies along the axis.
std::optional<std::optional<double>> one_axis_solution(const Vector3d& axis, const Vector3d& tool,
                                                       const Vector3d& wanted) {
  const double cone = angle_between(axis, tool);
  if (std::abs(cone - angle_between(axis, wanted)) > angle_tolerance) return std::nullopt;
  if (parallel(cone)) return std::optional<double>();
  return rotation_between(axis, tool, wanted);
}

// Solves R_0 R_1 tool = wanted (Paden and Kahan's second subproblem): R_1 brings the tool to the
// angle that `wanted` makes with axis 0, R_0 turns it there. Up to two solutions.
std::vector<RotaryAngles> two_axis_solutions(const std::array<Rotary, 2>& axes,
                                             const Vector3d& tool, const Vector3d& wanted) {
  const Vector3d& outer = axes[0].direction_b;
  const Vector3d& inner = axes[1].direction_b;
  const double between = angle_between(outer, inner);
  const double cone = angle_between(inner, tool);
  double height = angle_between(outer, wanted);

  // The tool lies along the inner axis: only the outer one moves it.
  if (parallel(cone)) {
    const auto turn = one_axis_solution(outer, tool, wanted);
    if (!turn) return {};
    return {RotaryAngles{*turn, std::nullopt}};
  }
  // Parallel axes act as one; the outer keeps its position and the inner does the rest.
  if (parallel(between)) {
    const Vector3d left = Eigen::AngleAxisd(-axes[0].kept, outer) * wanted;
    const auto turn = one_axis_solution(inner, tool, left);
    if (!turn) return {};
    return {RotaryAngles{std::nullopt, *turn}};
  }
  // The wanted direction lies along the outer axis, which is then free. Snapped to 0 or pi: the
  // rest of the angle is rounding.
  const bool free = parallel(height);
  if (free) height = height < 0.5 * pi ? 0.0 : pi;
  const std::optional<double> opening = corner(between, cone, height);
  if (!opening) return {};

  const double middle = rotation_between(inner, tool, outer);
  const auto with_inner_angle = [&](double turn) -> RotaryAngles {
    const Vector3d raised = Eigen::AngleAxisd(turn, inner) * tool;
    if (free) return {std::nullopt, turn};
    return {rotation_between(outer, raised, wanted), turn};
  };
  // A collapsed triangle has one solution; two equal branches would be listed twice.
  if (*opening == 0.0 || *opening == pi) return {with_inner_angle(middle + *opening)};
  return {with_inner_angle(middle + *opening), with_inner_angle(middle - *opening)};
}

std::vector<RotaryAngles> rotary_solutions(const std::vector<Rotary>& axes, const Vector3d& tool,
                                           const Vector3d& wanted) {
  if (axes.size() == 2) return two_axis_solutions({axes[0], axes[1]}, tool, wanted);
  if (axes.size() == 1) {
    const auto turn = one_axis_solution(axes[0].direction_b, tool, wanted);
    if (!turn) return {};
    return {RotaryAngles{*turn, std::nullopt}};
  }
  if (angle_between(tool, wanted) <= angle_tolerance) return {RotaryAngles{}};
  return {};
}

// Returns the angle plus whole turns that is within limits and nearest to `previous`; empty if
// there is none. The small slack is tried first, so that the wide one moves an axis only where
// nothing else helps.
std::optional<double> unwound(double angle, double previous, const Joint& joint) {
  constexpr double turn = 2.0 * pi;
  for (const double slack : {angle_tolerance, limit_slack}) {
    const double lowest = std::ceil((joint.min - slack - angle) / turn);
    const double highest = std::floor((joint.max + slack - angle) / turn);
    if (!(lowest <= highest)) continue;
    const double turns = std::clamp(std::round((previous - angle) / turn), lowest, highest);
    return std::clamp(angle + turns * turn, joint.min, joint.max);
  }
  return std::nullopt;
}

// Clamps slides that rounding has left just beyond a limit; returns false if one is really outside.
bool slides_within_limits(const Chain& chain, AxisVector& q) {
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.motion != Motion::Linear) continue;
    if (!(q[i] >= joint.min - slide_tolerance && q[i] <= joint.max + slide_tolerance)) return false;
    q[i] = std::clamp(q[i], joint.min, joint.max);
  }
  return true;
}

// Returns the directions of the slides in the workpiece frame, columns in the order of the code;
// empty unless there are exactly three.
std::optional<Eigen::Matrix3d> slide_direction_matrix(const Chain& chain, const AxisVector& q) {
  Eigen::Matrix3d directions;
  int slides = 0;
  Eigen::Matrix3d R = chain.T_bw_home().linear().transpose();  // rotation of the joints so far,
                                                               // relative to w
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.motion == Motion::Rotary && q[i] != 0.0)
      R = R * Eigen::AngleAxisd(q[i], joint.direction_b);
    if (joint.motion != Motion::Linear) continue;
    if (slides == 3) return std::nullopt;
    directions.col(slides++) = R * joint.direction_b;
  }
  if (slides != 3) return std::nullopt;
  return directions;
}

std::vector<Rotary> rotary_axes(const Chain& chain, const AxisVector& previous) {
  std::vector<Rotary> axes;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.motion == Motion::Rotary)
      axes.push_back({i, joint.direction_b, std::clamp(previous[i], joint.min, joint.max)});
  }
  return axes;
}

void check(const Chain& chain, const TipTarget& target, const AxisVector& previous) {
  if (previous.size() != chain.size() || !previous.allFinite())
    throw std::invalid_argument("expected " + std::to_string(chain.size()) +
                                " finite previous axis positions");
  if (!target.tip_w.allFinite()) throw std::invalid_argument("expected a finite tip");
  if (!target.direction_w.allFinite() || target.direction_w.isZero(0.0))
    throw std::invalid_argument("expected a finite tool direction that is not zero");
  const auto slides = slide_direction_matrix(chain, AxisVector::Zero(chain.size()));
  if (!slides || std::abs(slides->determinant()) < smallest_volume)
    throw std::invalid_argument("expected three independent slides");
}

double rotary_travel(const std::vector<Rotary>& axes, const AxisVector& from,
                     const AxisVector& to) {
  double travel = 0.0;
  for (const Rotary& axis : axes) travel += std::abs(to[axis.joint] - from[axis.joint]);
  return travel;
}

// Actual and wanted tool direction, bed frame at zero.
struct Directions {
  Vector3d tool_b;
  Vector3d target_b;
};

bool gives_direction(const std::vector<Rotary>& axes, const AxisVector& q, const Directions& d) {
  Vector3d turned = d.tool_b;
  for (auto axis = axes.rbegin(); axis != axes.rend(); ++axis)
    turned = Eigen::AngleAxisd(q[axis->joint], axis->direction_b) * turned;
  return angle_between(turned, d.target_b) <= direction_tolerance;
}

// Returns the rotary positions of one solution, unwound; empty if one is beyond its limits.
std::optional<AxisVector> with_turns(const Chain& chain, const std::vector<Rotary>& axes,
                                     const RotaryAngles& turns, const AxisVector& previous) {
  AxisVector q = previous;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const int i = axes[k].joint;
    const auto position = turns[k] ? unwound(*turns[k], previous[i], chain.joints()[std::size_t(i)])
                                   : std::optional<double>(axes[k].kept);
    if (!position) return std::nullopt;
    q[i] = *position;
  }
  return q;
}

}  // namespace

std::optional<AxisVector> slides_for_tip(const Chain& chain, const AxisVector& q,
                                         const Eigen::Vector3d& tip_w) {
  const auto directions = slide_direction_matrix(chain, q);
  if (!directions || !(std::abs(directions->determinant()) >= smallest_volume)) return std::nullopt;
  const Eigen::Matrix3d solve = directions->inverse();
  AxisVector result = q;
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == Motion::Linear) result[i] = 0.0;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass removes the rounding of the first
    const Vector3d step = solve * (tip_w - chain.tool_in_workpiece(result).translation());
    int slide = 0;
    for (int i = 0; i < chain.size(); ++i)
      if (chain.joints()[std::size_t(i)].motion == Motion::Linear) result[i] += step[slide++];
  }
  if (!result.allFinite()) return std::nullopt;
  return result;
}

namespace {

/// A solution of the rotary axes, without the slides.
struct Branch {
  AxisVector q;
  bool free = false;  ///< a rotary axis is free and keeps its position
};

/// Returns the branches that give the direction within the limits of the rotary axes, least rotary
/// travel first. A tie goes to the upper branch of the triangle, independent of rounding.
/// @param reach  set to the reason if there are none
std::vector<Branch> rotary_branches(const Chain& chain, const TipTarget& target,
                                    const AxisVector& previous, Reach& reach) {
  check(chain, target, previous);
  const std::vector<Rotary> axes = rotary_axes(chain, previous);
  if (axes.size() > 2) throw std::invalid_argument("expected at most two rotary axes");
  const Directions directions{
      chain.T_bt_home().linear().col(2).normalized(),
      (chain.T_bw_home().linear() * target.direction_w.stableNormalized()).normalized()};
  std::vector<Branch> branches;
  for (const RotaryAngles& turns : rotary_solutions(axes, directions.tool_b, directions.target_b)) {
    const auto turned = with_turns(chain, axes, turns, previous);
    if (!turned || !gives_direction(axes, *turned, directions)) {
      reach = Reach::OutOfLimits;
      continue;
    }
    branches.push_back(
        {*turned, std::any_of(turns.begin(), turns.begin() + std::ptrdiff_t(axes.size()),
                              [](const auto& turn) { return !turn; })});
  }
  // 1e-9 rad: equal travels differ by rounding only, and must not swap from pose to pose.
  if (branches.size() == 2 && rotary_travel(axes, previous, branches[1].q) <
                                  rotary_travel(axes, previous, branches[0].q) - 1e-9)
    std::swap(branches[0], branches[1]);
  return branches;
}

}  // namespace

InverseSolution inverse(const Chain& chain, const TipTarget& target, const AxisVector& previous) {
  InverseSolution result;
  bool free = false;
  for (const Branch& branch : rotary_branches(chain, target, previous, result.reach)) {
    auto q = slides_for_tip(chain, branch.q, target.tip_w);
    if (!q) continue;
    if (!slides_within_limits(chain, *q)) {
      if (result.branches.empty()) result.reach = Reach::OutOfLimits;
      continue;
    }
    if (result.branches.empty()) free = branch.free;
    result.branches.push_back(*q);
  }
  if (!result.branches.empty()) result.reach = free ? Reach::Singular : Reach::Reached;
  return result;
}

NearestPose nearest_inverse_solution(const Chain& chain, const TipTarget& target,
                                     const AxisVector& previous) {
  NearestPose nearest;
  for (const Branch& branch : rotary_branches(chain, target, previous, nearest.reach)) {
    auto q = slides_for_tip(chain, branch.q, target.tip_w);
    if (!q) continue;
    if (slides_within_limits(chain, *q))
      return {branch.free ? Reach::Singular : Reach::Reached, *std::move(q)};
    nearest.reach = Reach::OutOfLimits;
  }
  return nearest;
}

namespace {

constexpr double one_line = 1e-9;  // rad, between two axes that count as parallel

double between_lines(const Vector3d& a, const Vector3d& b) {
  const double angle = angle_between(a, b);
  return std::min(angle, pi - angle);
}

/// Returns the rotation about `axis` that brings one direction as near as possible to another.
double turn_towards(const Vector3d& axis, const Vector3d& from, const Vector3d& to) {
  const Vector3d f = axis.cross(from), t = axis.cross(to);
  return std::atan2(axis.dot(f.cross(t)), f.dot(t));
}

/// Returns the first position at + k * step between two others; empty if there is none.
std::optional<double> between(double a, double b, double at, double step) {
  const double first = at + std::ceil((std::min(a, b) - at) / step) * step;
  if (first > std::max(a, b)) return std::nullopt;
  return first;
}

Vector3d tool_of(const Chain& chain) { return chain.T_bt_home().linear().col(2).normalized(); }

}  // namespace

std::optional<Pole> nearest_pole(const Chain& chain, const AxisVector& from, const AxisVector& to) {
  Pole pole{-1, -1, 0.0, 0.0};
  for (int j = 0; j < chain.size(); ++j) {
    if (chain.joints()[std::size_t(j)].motion != Motion::Rotary) continue;
    // More than two rotary axes have no pole in this sense.
    if (pole.other >= 0) return std::nullopt;
    (pole.axis < 0 ? pole.axis : pole.other) = j;
  }
  if (pole.other < 0) return std::nullopt;
  const Vector3d& outer = chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d& inner = chain.joints()[std::size_t(pole.other)].direction_b;
  const Vector3d tool = tool_of(chain);
  if (between_lines(inner, tool) < one_line || between_lines(inner, outer) < one_line)
    return std::nullopt;
  pole.at = turn_towards(inner, tool, outer);
  const auto angle_at = [&](double turn) {
    return between_lines(outer, Eigen::AngleAxisd(turn, inner) * tool);
  };
  const double a = from[pole.other], b = to[pole.other];
  pole.angle = std::min(angle_at(a), angle_at(b));
  // Along the move the angle is monotonic except at `at` and half a turn on, so the ends and these
  // positions are enough.
  for (const double extreme : {pole.at, pole.at + pi})
    if (const auto turn = between(a, b, extreme, 2.0 * pi))
      pole.angle = std::min(pole.angle, angle_at(*turn));
  return pole;
}

double nearest_rotary_position(const Chain& chain, const Pole& pole, const AxisVector& q,
                               const Vector3d& direction_w) {
  const Vector3d target_b = chain.T_bw_home().linear() * direction_w;
  const Vector3d& outer = chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d& inner = chain.joints()[std::size_t(pole.other)].direction_b;
  return turn_towards(inner, tool_of(chain), Eigen::AngleAxisd(-q[pole.axis], outer) * target_b);
}

}  // namespace abbe::kinematics
