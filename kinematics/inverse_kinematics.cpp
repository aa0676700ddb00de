#include "kinematics/inverse_kinematics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/LU>

#include "kinematics/frame.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"

namespace abbe::kinematics {

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Frames between the joints of the chain from workpiece to tool: T[i] maps the bed frame at zero to
// the workpiece frame after the motion of all joints before i, in the order of the code. In this
// order the joints of both sides turn by the command itself, since the workpiece side is inverted.
struct ChainFrames {
  std::array<Frame, max_joints + 1> T;  // size + 1 are used
  Eigen::Vector3d tip_w;
};

// Returns the frames between the joints at positions q.
ChainFrames chain_frames(const Chain& chain, const AxisVector& q) {
  ChainFrames result;
  Frame T = inverse(to_frame(chain.T_bw_home()));
  result.T[0] = T;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    T = T * apply_motion(identity_frame(), joint, joint.direction_b, q[i]);
    result.T[std::size_t(i) + 1] = T;
  }
  result.tip_w = transform(T, chain.T_bt_home().translation());
  return result;
}

// Returns the effect on the tool of a small [translation | rotation] at `point_b`, inserted into
// the chain at T.
Matrix6 transport(const Pose& T, const Eigen::Vector3d& point_b, const Eigen::Vector3d& tip_w) {
  Matrix6 M = Matrix6::Zero();
  M.topLeftCorner<3, 3>() = T.linear();
  M.topRightCorner<3, 3>() = -cross_matrix(tip_w - T * point_b) * T.linear();
  M.bottomRightCorner<3, 3>() = T.linear();
  return M;
}

// Returns the effect on the tool of a displacement of joint i, before or after the motion of the
// carriage in the order from the bed outwards. In the chain from workpiece to tool the workpiece
// side is reversed and inverted.
Matrix6 displacement_columns(const ChainFrames& frames, const Joint& joint, int i,
                             bool before_motion) {
  const bool is_primed = joint.side == Side::Workpiece;
  const Pose T = to_pose(frames.T[std::size_t(before_motion == is_primed ? i + 1 : i)]);
  return (is_primed ? -1.0 : 1.0) * transport(T, joint.point_b, frames.tip_w);
}

// Returns the effect on the tool of rotations of the direction of travel alone.
Eigen::Matrix<double, 6, 3> travel_rotation_columns(const ChainFrames& frames, const Joint& joint,
                                                    int i, double q) {
  Eigen::Matrix<double, 6, 3> M = Eigen::Matrix<double, 6, 3>::Zero();
  const Pose T = to_pose(frames.T[std::size_t(i)]);
  if (joint.motion == Motion::Linear)
    M.topRows<3>() = -q * T.linear() * cross_matrix(joint.direction_b);
  // Tilting the axis, moving and tilting it back is the difference of a rotation before and one
  // after the motion.
  if (joint.motion == Motion::Rotary)
    M = (transport(T, joint.point_b, frames.tip_w) -
         transport(to_pose(frames.T[std::size_t(i) + 1]), joint.point_b, frames.tip_w))
            .rightCols<3>();
  return M;
}

}  // namespace

AxisJacobian axis_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  AxisJacobian J = AxisJacobian::Zero(6, chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Frame& T = frames.T[std::size_t(i)];
    const Eigen::Vector3d direction_w = vector(rotate(T, joint.direction_b));
    if (joint.motion == Motion::Linear) J.col(i).head<3>() = direction_w;
    if (joint.motion == Motion::Rotary)
      J.col(i) << direction_w.cross(frames.tip_w - transform(T, joint.point_b)), direction_w;
  }
  return J;
}

Eigen::MatrixXd motion_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const bool is_before_motion =
        joint.motion == Motion::Rotary && joint.deviation_axes == DeviationAxes::Fixed;
    J.middleCols<6>(6 * i) = displacement_columns(frames, joint, i, is_before_motion);
  }
  return J;
}

Eigen::MatrixXd location_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Matrix6 frame = displacement_columns(frames, joint, i, true);
    for (int k = 0; k < 6; ++k) {
      switch (chain.location_rule(i)[std::size_t(k)]) {
        case DisplacedPart::Frame:
          J.col(6 * i + k) = frame.col(k);
          break;
        case DisplacedPart::Carried:
          J.col(6 * i + k) = -displacement_columns(frames, joint, i, false).col(k);
          break;
        case DisplacedPart::Axis:
          J.col(6 * i + k) = travel_rotation_columns(frames, joint, i, q[i]).col(k - 3);
      }
    }
  }
  return J;
}

namespace {

using Eigen::Vector3d;

// A direction within this angle of an axis counts as parallel to it; one at most this angle beyond
// the reachable cone counts as reachable. Well above rounding (4e-16), and twice the angle is still
// below the stated bound of 1e-12 rad.
constexpr double angle_tolerance = 2e-13;  // rad
// A slide at most this far beyond its limit is set to the limit; a fifth of the stated bound of
// 1e-9 mm.
constexpr double slide_tolerance = 2e-10;  // mm
// Near a singular pose, and where two branches meet, rounding moves an axis far more than the tool
// direction. A rotary axis at most this far beyond a limit is set to the limit if the direction
// stays within `direction_tolerance`.
constexpr double limit_slack = 1e-6;           // rad
constexpr double direction_tolerance = 8e-13;  // rad
// The sides of the spherical triangle are known to a few ulp of pi (4e-16 rad).
constexpr double rounding = 1e-15;  // rad
// Minimum volume spanned by the unit directions of the three slides (1 if square); below it they
// count as dependent.
constexpr double min_volume = 1e-9;

// A rotary axis of the nominal chain.
struct RotaryAxis {
  int joint;
  Vector3d direction_b;
  double free_position;  // position while the axis is free
};

// A rotary solution for the direction: a position for each rotary axis, empty where the axis is
// free.
using RotaryAngles = std::array<std::optional<double>, 2>;

bool is_parallel(double angle) { return std::min(angle, pi - angle) <= angle_tolerance; }

// Returns the rotation about `axis` that brings one direction as near as possible to another. Both
// are projected first: near the axis the cross product of the full vectors would be nothing but
// rounding.
double rotation_about(const Vector3d& axis, const Vector3d& from, const Vector3d& to) {
  const Vector3d f = axis.cross(from);
  const Vector3d t = axis.cross(to);
  return std::atan2(axis.dot(f.cross(t)), f.dot(t));
}

// Returns the angle of a spherical triangle between the sides a and b, opposite to c; empty if the
// sides form no triangle. Uses tan^2(angle/2) = sin(s-a) sin(s-b) / (sin s sin(s-c)), s half the
// sum: the cosine rule loses half of the digits where the triangle collapses, as at singular poses.
std::optional<double> triangle_angle(double a, double b, double c) {
  const double s_a = 0.5 * ((b - a) + c);
  const double s_b = 0.5 * ((a - b) + c);
  const double s_c = 0.5 * ((a - c) + b);
  const double s_pi = 0.5 * (((pi - a) - b) + (pi - c));  // pi - s
  if (std::min({s_a, s_b, s_c, s_pi}) < -0.5 * angle_tolerance) return std::nullopt;
  const auto sine = [](double x) { return x < rounding ? 0.0 : std::sin(x); };
  return 2.0 * std::atan2(std::sqrt(sine(s_a) * sine(s_b)), std::sqrt(sine(s_pi) * sine(s_c)));
}

// Returns the rotation of one axis that brings `tool` to `target_b`: nullopt if there is none, an
// optional that holds an empty one if every rotation does, i.e. the tool lies along the axis.
std::optional<std::optional<double>> one_axis_solution(const Vector3d& axis, const Vector3d& tool,
                                                       const Vector3d& target_b) {
  const double cone = angle_between(axis, tool);
  if (std::abs(cone - angle_between(axis, target_b)) > angle_tolerance) return std::nullopt;
  if (is_parallel(cone)) return std::optional<double>();
  return rotation_about(axis, tool, target_b);
}

// Solves R_0 R_1 tool = target_b (Paden and Kahan's second subproblem): R_1 brings the tool to the
// angle that `target_b` makes with axis 0, then R_0 turns it to `target_b`. Up to two solutions.
std::vector<RotaryAngles> two_axis_solutions(const std::array<RotaryAxis, 2>& axes,
                                             const Vector3d& tool, const Vector3d& target_b) {
  const Vector3d& outer = axes[0].direction_b;
  const Vector3d& inner = axes[1].direction_b;
  const double axis_angle = angle_between(outer, inner);
  const double cone = angle_between(inner, tool);
  double height = angle_between(outer, target_b);

  // The tool lies along the inner axis: only the outer one moves it.
  if (is_parallel(cone)) {
    const auto angle = one_axis_solution(outer, tool, target_b);
    if (!angle) return {};
    return {RotaryAngles{*angle, std::nullopt}};
  }
  // Parallel axes act as one: the outer keeps its position, the inner one makes the rotation.
  if (is_parallel(axis_angle)) {
    const Vector3d remaining_b = Eigen::AngleAxisd(-axes[0].free_position, outer) * target_b;
    const auto angle = one_axis_solution(inner, tool, remaining_b);
    if (!angle) return {};
    return {RotaryAngles{std::nullopt, *angle}};
  }
  // If the target direction lies along the outer axis, that axis is free. The angle is snapped to 0
  // or pi, because the difference is only rounding.
  const bool is_outer_free = is_parallel(height);
  if (is_outer_free) height = height < 0.5 * pi ? 0.0 : pi;
  const std::optional<double> half_opening = triangle_angle(axis_angle, cone, height);
  if (!half_opening) return {};

  const double middle_angle = rotation_about(inner, tool, outer);
  const auto solution_at = [&](double angle) -> RotaryAngles {
    const Vector3d tool_at_angle = Eigen::AngleAxisd(angle, inner) * tool;
    if (is_outer_free) return {std::nullopt, angle};
    return {rotation_about(outer, tool_at_angle, target_b), angle};
  };
  // A collapsed triangle has one solution; two equal branches would be listed twice.
  if (*half_opening == 0.0 || *half_opening == pi)
    return {solution_at(middle_angle + *half_opening)};
  return {solution_at(middle_angle + *half_opening), solution_at(middle_angle - *half_opening)};
}

// Returns the rotary solutions for up to two axes.
std::vector<RotaryAngles> rotary_solutions(const std::vector<RotaryAxis>& axes,
                                           const Vector3d& tool, const Vector3d& target_b) {
  if (axes.size() == 2) return two_axis_solutions({axes[0], axes[1]}, tool, target_b);
  if (axes.size() == 1) {
    const auto angle = one_axis_solution(axes[0].direction_b, tool, target_b);
    if (!angle) return {};
    return {RotaryAngles{*angle, std::nullopt}};
  }
  if (angle_between(tool, target_b) <= angle_tolerance) return {RotaryAngles{}};
  return {};
}

// Returns the angle plus full turns that is within limits and nearest to `previous`; empty if there
// is none. The small slack is tried first, so that the wide one moves an axis only if no other
// position is possible.
std::optional<double> unwound(double angle, double previous, const Joint& joint) {
  constexpr double full_turn = 2.0 * pi;
  for (const double slack : {angle_tolerance, limit_slack}) {
    const double lowest = std::ceil((joint.min - slack - angle) / full_turn);
    const double highest = std::floor((joint.max + slack - angle) / full_turn);
    if (!(lowest <= highest)) continue;
    const double revolutions =
        std::clamp(std::round((previous - angle) / full_turn), lowest, highest);
    return std::clamp(angle + revolutions * full_turn, joint.min, joint.max);
  }
  return std::nullopt;
}

// Clamps slides that exceed a limit by rounding only; returns false if one is really outside.
bool clamp_slides(const Chain& chain, AxisVector& q) {
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.motion != Motion::Linear) continue;
    if (!(q[i] >= joint.min - slide_tolerance && q[i] <= joint.max + slide_tolerance)) return false;
    q[i] = std::clamp(q[i], joint.min, joint.max);
  }
  return true;
}

// Returns the directions of the slides in the workpiece frame as columns, in the order of the
// structural code; empty unless there are exactly three slides.
std::optional<Eigen::Matrix3d> slide_direction_matrix(const Chain& chain, const AxisVector& q) {
  Eigen::Matrix3d slide_directions;
  int slides = 0;
  Eigen::Matrix3d R = chain.T_bw_home().linear().transpose();  // rotation relative to w of the
                                                               // joints visited so far
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.motion == Motion::Rotary && q[i] != 0.0)
      R = R * Eigen::AngleAxisd(q[i], joint.direction_b);
    if (joint.motion != Motion::Linear) continue;
    if (slides == 3) return std::nullopt;
    slide_directions.col(slides++) = R * joint.direction_b;
  }
  if (slides != 3) return std::nullopt;
  return slide_directions;
}

// Returns the rotary axes in the order of the structural code; free ones keep their position.
std::vector<RotaryAxis> rotary_axes(const Chain& chain, const AxisVector& previous) {
  std::vector<RotaryAxis> axes;
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
    throw std::invalid_argument("expected a finite non-zero tool direction");
  const auto slides = slide_direction_matrix(chain, AxisVector::Zero(chain.size()));
  if (!slides || std::abs(slides->determinant()) < min_volume)
    throw std::invalid_argument("expected three linearly independent slides");
}

double rotary_travel(const std::vector<RotaryAxis>& axes, const AxisVector& from,
                     const AxisVector& to) {
  double travel = 0.0;
  for (const RotaryAxis& axis : axes) travel += std::abs(to[axis.joint] - from[axis.joint]);
  return travel;
}

// Returns true if the axes turn the tool to the target within `direction_tolerance`; both
// directions in the bed frame, all axes at zero.
bool reaches_direction(const std::vector<RotaryAxis>& axes, const AxisVector& q,
                       const Vector3d& tool_b, const Vector3d& target_b) {
  Vector3d direction = tool_b;
  for (auto axis = axes.rbegin(); axis != axes.rend(); ++axis)
    direction = Eigen::AngleAxisd(q[axis->joint], axis->direction_b) * direction;
  return angle_between(direction, target_b) <= direction_tolerance;
}

// Returns the unit direction of the tool in the bed frame with all axes at zero.
Vector3d tool_direction(const Chain& chain) {
  return chain.T_bt_home().linear().col(2).normalized();
}

// Returns the rotary positions of one solution, unwound; empty if one is beyond its limits.
std::optional<AxisVector> unwound_positions(const Chain& chain, const std::vector<RotaryAxis>& axes,
                                            const RotaryAngles& angles,
                                            const AxisVector& previous) {
  AxisVector q = previous;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const int i = axes[k].joint;
    const auto position = angles[k]
                              ? unwound(*angles[k], previous[i], chain.joints()[std::size_t(i)])
                              : std::optional<double>(axes[k].free_position);
    if (!position) return std::nullopt;
    q[i] = *position;
  }
  return q;
}

}  // namespace

std::optional<AxisVector> solve_slides(const Chain& chain, const AxisVector& q,
                                       const Eigen::Vector3d& tip_w) {
  const auto directions = slide_direction_matrix(chain, q);
  if (!directions || !(std::abs(directions->determinant()) >= min_volume)) return std::nullopt;
  const Eigen::Matrix3d slide_travel = directions->inverse();  // per displacement of the tip
  AxisVector result = q;
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == Motion::Linear) result[i] = 0.0;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass removes the rounding of the first
    const Vector3d step = slide_travel * (tip_w - chain.tool_in_workpiece(result).translation());
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
  bool is_free = false;  ///< a rotary axis is free and keeps its position
};

/// Returns the branches that reach the direction within the limits of the rotary axes, least rotary
/// travel first. Of branches with equal travel the upper one of the triangle comes first,
/// independent of rounding.
/// @param reach  set to the reason if there are no branches
std::vector<Branch> rotary_branches(const Chain& chain, const TipTarget& target,
                                    const AxisVector& previous, Reachability& reach) {
  check(chain, target, previous);
  const std::vector<RotaryAxis> axes = rotary_axes(chain, previous);
  if (axes.size() > 2) throw std::invalid_argument("expected at most two rotary axes");
  const Vector3d tool_b = tool_direction(chain);
  const Vector3d target_b =
      (chain.T_bw_home().linear() * target.direction_w.stableNormalized()).normalized();
  std::vector<Branch> branches;
  for (const RotaryAngles& angles : rotary_solutions(axes, tool_b, target_b)) {
    const auto q = unwound_positions(chain, axes, angles, previous);
    if (!q || !reaches_direction(axes, *q, tool_b, target_b)) {
      reach = Reachability::OutOfLimits;
      continue;
    }
    branches.push_back(
        {*q, std::any_of(angles.begin(), angles.begin() + std::ptrdiff_t(axes.size()),
                         [](const auto& angle) { return !angle; })});
  }
  // 1e-9 rad: equal travels differ by rounding only and must not swap branches from pose to pose.
  if (branches.size() == 2 && rotary_travel(axes, previous, branches[1].q) <
                                  rotary_travel(axes, previous, branches[0].q) - 1e-9)
    std::swap(branches[0], branches[1]);
  return branches;
}

}  // namespace

InverseSolution inverse(const Chain& chain, const TipTarget& target, const AxisVector& previous) {
  InverseSolution result;
  bool is_free = false;
  for (const Branch& branch : rotary_branches(chain, target, previous, result.reach)) {
    auto q = solve_slides(chain, branch.q, target.tip_w);
    if (!q) continue;
    if (!clamp_slides(chain, *q)) {
      if (result.branches.empty()) result.reach = Reachability::OutOfLimits;
      continue;
    }
    if (result.branches.empty()) is_free = branch.is_free;
    result.branches.push_back(*q);
  }
  if (!result.branches.empty())
    result.reach = is_free ? Reachability::Singular : Reachability::Reached;
  return result;
}

NearestPose solve_nearest_pose(const Chain& chain, const TipTarget& target,
                               const AxisVector& previous) {
  NearestPose nearest;
  for (const Branch& branch : rotary_branches(chain, target, previous, nearest.reach)) {
    auto q = solve_slides(chain, branch.q, target.tip_w);
    if (!q) continue;
    if (clamp_slides(chain, *q))
      return {branch.is_free ? Reachability::Singular : Reachability::Reached, *std::move(q)};
    nearest.reach = Reachability::OutOfLimits;
  }
  return nearest;
}

namespace {

constexpr double min_line_angle = 1e-9;  // rad; two axes at a smaller angle count as parallel

double angle_between_lines(const Vector3d& a, const Vector3d& b) {
  const double angle = angle_between(a, b);
  return std::min(angle, pi - angle);
}

/// Returns the lowest of the positions offset + k * step (k whole) between a and b; empty if none
/// of them is.
std::optional<double> first_between(double a, double b, double offset, double step) {
  const double first = offset + std::ceil((std::min(a, b) - offset) / step) * step;
  if (first > std::max(a, b)) return std::nullopt;
  return first;
}

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
  const Vector3d tool = tool_direction(chain);
  if (angle_between_lines(inner, tool) < min_line_angle ||
      angle_between_lines(inner, outer) < min_line_angle)
    return std::nullopt;
  pole.at = rotation_about(inner, tool, outer);
  const auto angle_at = [&](double position) {
    return angle_between_lines(outer, Eigen::AngleAxisd(position, inner) * tool);
  };
  const double a = from[pole.other], b = to[pole.other];
  pole.angle = std::min(angle_at(a), angle_at(b));
  // Along the move the angle is monotonic except at `at` and half a turn later, so the ends and
  // these positions are sufficient.
  for (const double extreme : {pole.at, pole.at + pi})
    if (const auto position = first_between(a, b, extreme, 2.0 * pi))
      pole.angle = std::min(pole.angle, angle_at(*position));
  return pole;
}

double nearest_rotary_position(const Chain& chain, const Pole& pole, const AxisVector& q,
                               const Vector3d& direction_w) {
  const Vector3d target_b = chain.T_bw_home().linear() * direction_w;
  const Vector3d& outer = chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d& inner = chain.joints()[std::size_t(pole.other)].direction_b;
  return rotation_about(inner, tool_direction(chain),
                        Eigen::AngleAxisd(-q[pole.axis], outer) * target_b);
}

}  // namespace abbe::kinematics
