#include "sim/dialects/fanuc_turning.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "kinematics/pole.h"
#include "kinematics/turn_between.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::fanuc {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Side;

namespace {

constexpr double same_turn = 1e-9;     // rad
constexpr double right_angles = 1e-9;  // rad, by which axes may be off them

/// How far from zero, whole turns left out.
double from_zero(double angle) { return std::abs(std::remainder(angle, 2 * pi)); }

bool before(const AxisVector& a, const AxisVector& b, const AxisVector& now,
            const std::vector<int>& ranks) {
  for (const int j : ranks)
    if (const double less = std::abs(a[j] - now[j]) - std::abs(b[j] - now[j]);
        std::abs(less) > same_turn)
      return less < 0;
  for (const int j : ranks)
    if (const double less = from_zero(a[j]) - from_zero(b[j]); std::abs(less) > same_turn)
      return less < 0;
  return false;
}

Vector3d tool_w(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2).normalized();
}

/// How the great circle between two directions of the tool passes an axis.
struct Passing {
  Vector3d pole;       ///< unit, the axis in the direction in which the tool comes near it
  double angle = 0.0;  ///< rad
};

/// None where it comes nearest at an end, or has no plane.
std::optional<Passing> passing(const Vector3d& from, const Vector3d& to, const Vector3d& axis) {
  const Vector3d normal = from.cross(to);
  if (!(normal.norm() > same_turn)) return std::nullopt;
  const Vector3d n = normal.normalized();
  for (const Vector3d& pole : {axis, Vector3d(-axis)}) {
    const Vector3d foot = pole - pole.dot(n) * n;
    if (from.cross(foot).dot(n) > 0.0 && foot.cross(to).dot(n) > 0.0)
      return Passing{pole, std::asin(std::min(1.0, std::abs(axis.dot(n))))};
  }
  return std::nullopt;
}

/// The pole of a machine, its axes at right angles.
kinematics::Pole right_angled_pole(const Chain& chain, const AxisVector& q) {
  const auto pole = kinematics::nearest_pole(chain, q, q);
  const auto direction = [&](int j) { return chain.joints()[std::size_t(j)].direction_b; };
  const bool right =
      pole && std::abs(direction(pole->axis).dot(direction(pole->other))) < right_angles &&
      std::abs(chain.T_bt_home().linear().col(2).dot(direction(pole->other))) < right_angles;
  if (!right)
    throw std::invalid_argument(
        "a machine with two rotary axes at right angles to each other and to the tool");
  return *pole;
}

}  // namespace

std::vector<int> turning_ranks(const Chain& chain) {
  std::vector<int> table, head;
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.motion == Motion::Rotary) (joint.side == Side::Tool ? head : table).push_back(j);
  }
  std::reverse(table.begin(), table.end());  // the code goes from the workpiece to the bed
  table.insert(table.end(), head.begin(), head.end());
  return table;
}

const AxisVector& output_judgement(std::span<const AxisVector> branches, const AxisVector& now,
                                   const std::vector<int>& ranks) {
  const AxisVector* best = &branches.front();
  for (const AxisVector& one : branches)
    if (before(one, *best, now, ranks)) best = &one;
  return *best;
}

std::optional<PolePassage> through_pole(const Chain& chain, const AxisVector& from,
                                        const AxisVector& to, const PoleOptions& limits) {
  const kinematics::Pole pole = right_angled_pole(chain, from);
  const kinematics::Joint& other = chain.joints()[std::size_t(pole.other)];
  const Vector3d axis_w =
      chain.T_bw_home().linear().transpose() * chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d wanted = tool_w(chain, to);
  const auto passed = passing(tool_w(chain, from), wanted, axis_w);
  if (!passed || passed->angle >= limits.near) return std::nullopt;
  const double in_pole = passed->pole.dot(axis_w) > 0.0 ? pole.at : pole.at + pi;
  const double lean = std::remainder(from[pole.other] - in_pole, 2 * pi);
  const double singular = from[pole.other] - lean;
  const double end = kinematics::angle_between(wanted, passed->pole);
  if (std::abs(lean) < same_turn || end < same_turn) return std::nullopt;
  PolePassage passage{to, passed->angle, 0.0, 0.0};
  passage.end[pole.axis] = from[pole.axis];
  passage.end[pole.other] = singular - std::copysign(end, lean);
  const Vector3d reached = tool_w(chain, passage.end);
  passage.turned = kinematics::angle_between(wanted.cross(axis_w), reached.cross(axis_w));
  passage.off = kinematics::angle_between(wanted, reached);
  const bool reachable =
      passage.end[pole.other] >= other.min && passage.end[pole.other] <= other.max;
  if (passage.turned > limits.most_change || !reachable) return std::nullopt;
  return passage;
}

}  // namespace abbe::sim::dialects::fanuc
