#include "cutting/parting_plane.h"

#include <algorithm>
#include <limits>

namespace abbe::cutting {

using Eigen::Vector3d;
using kinematics::Pose;

namespace {

/// The point of balls that is least along a direction, which is given in their frame.
Vector3d lowest_point(std::span<const Ball> balls, const Vector3d& direction) {
  Vector3d lowest = Vector3d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    const double height = direction.dot(ball.centre) - ball.radius;
    if (height >= least) continue;
    least = height;
    lowest = ball.centre - ball.radius * direction;
  }
  return lowest;
}

}  // namespace

PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b, const Pose& T_ab,
                           const Vector3d& way) {
  constexpr int steps = 6;
  constexpr double close_enough = 0.995;
  PartingPlane best;
  if (hull_b.empty() || !(way.norm() > 0.0)) return best;
  double most = -std::numeric_limits<double>::infinity();
  Vector3d towards = way;
  for (int step = 0; step < steps && towards.norm() > 0.0; ++step) {
    const Vector3d normal = towards.normalized();
    const Vector3d on_a = farthest_point(a, normal);
    const Vector3d on_b = T_ab * lowest_point(hull_b, T_ab.linear().transpose() * normal);
    const double between = normal.dot(on_b - on_a);
    if (between > most) best = {normal, normal.dot(on_a)};
    most = std::max(most, between);
    if (between >= close_enough * towards.norm()) break;
    const Vector3d back = towards - (on_b - on_a);
    if (!(back.squaredNorm() > 0.0)) break;
    towards -= std::clamp(towards.dot(back) / back.squaredNorm(), 0.0, 1.0) * back;
  }
  return best;
}

double beyond(const PartingPlane& plane, std::span<const Ball> hull_b, const Pose& T_ab) {
  if (hull_b.empty() || plane.normal.isZero(0.0)) return 0.0;
  const Vector3d normal = T_ab.linear().transpose() * plane.normal;
  return normal.dot(lowest_point(hull_b, normal)) + plane.normal.dot(T_ab.translation()) -
         plane.height;
}

}  // namespace abbe::cutting
