#include "kinematics/pole.h"

#include <algorithm>
#include <cmath>

#include "kinematics/turn_between.h"
#include "kinematics/units.h"

namespace abbe::kinematics {
namespace {

using Eigen::Vector3d;

constexpr double one_line = 1e-9;  // rad, between two lines that count as one

double between_lines(const Vector3d& a, const Vector3d& b) {
  const double angle = angle_between(a, b);
  return std::min(angle, pi - angle);
}

/// Turn about `axis` that brings one direction as near as it can to another.
double turn_towards(const Vector3d& axis, const Vector3d& from, const Vector3d& to) {
  const Vector3d f = axis.cross(from), t = axis.cross(to);
  return std::atan2(axis.dot(f.cross(t)), f.dot(t));
}

/// A position within a turn of zero, a multiple of `step` away from `at`, between two others.
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
  for (const double extreme : {pole.at, pole.at + pi})
    if (const auto turn = between(a, b, extreme, 2.0 * pi))
      pole.angle = std::min(pole.angle, angle_at(*turn));
  return pole;
}

double nearest_turn(const Chain& chain, const Pole& pole, const AxisVector& q,
                    const Vector3d& direction_w) {
  const Vector3d wanted_b = chain.T_bw_home().linear() * direction_w;
  const Vector3d& outer = chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d& inner = chain.joints()[std::size_t(pole.other)].direction_b;
  return turn_towards(inner, tool_of(chain), Eigen::AngleAxisd(-q[pole.axis], outer) * wanted_b);
}

}  // namespace abbe::kinematics
