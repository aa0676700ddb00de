#include "kinematics/screw.h"

#include <cmath>

namespace abbe::kinematics {
namespace {

using Eigen::Vector3d;

constexpr double small_turn = 1e-2;  // rad: below, the quotients lose digits and series have them

/// (angle - sin angle) / angle^3
double third_order(double angle) {
  const double square = angle * angle;
  if (angle < small_turn) return 1.0 / 6 - square / 120 + square * square / 5040;
  return (angle - std::sin(angle)) / (square * angle);
}

/// (1 - angle/2 cot(angle/2)) / angle^2
double of_inverse(double angle) {
  const double square = angle * angle;
  if (angle < small_turn) return 1.0 / 12 + square / 720 + square * square / 30240;
  return (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / square;
}

}  // namespace

Screw screw_between(const Pose& from, const Pose& to) {
  const Pose step = from.inverse() * to;
  const Vector3d turn = rotation_vector(step.linear()), p = step.translation();
  const Vector3d across = turn.cross(p);
  return {from, turn, p - 0.5 * across + of_inverse(turn.norm()) * turn.cross(across)};
}

Pose pose_at(const Screw& screw, double u) {
  const Vector3d turn = u * screw.turn, travel = u * screw.travel;
  const double angle = turn.norm();
  if (angle == 0.0) return screw.start * Eigen::Translation3d(travel);
  const double half = std::sin(0.5 * angle) / angle;
  const Vector3d across = turn.cross(travel);
  const Vector3d p = travel + 2.0 * half * half * across + third_order(angle) * turn.cross(across);
  return screw.start * Eigen::Translation3d(p) * Pose(rotation(turn));
}

double fastest(const Screw& screw, const Vector3d& centre, double radius) {
  return (screw.travel + screw.turn.cross(centre)).norm() + screw.turn.norm() * radius;
}

}  // namespace abbe::kinematics
