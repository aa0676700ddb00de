#include "tests/oracles/axis_geometry.h"

#include <cmath>
#include <numbers>

#include <Eigen/Dense>

namespace abbe::oracles {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::VectorXd;

Vector3d tip(const Matrix4d& T) { return T.topRightCorner<3, 1>(); }

Vector3d tip_at(const Poses& machine, int first, double a, int second, double b) {
  VectorXd q = VectorXd::Zero(machine.axes);
  q[first] = a;
  q[second] = b;
  return tip(machine.T_wt(q));
}

Matrix4d inverse(const Matrix4d& T) {
  Matrix4d result = Matrix4d::Identity();
  result.topLeftCorner<3, 3>() = T.topLeftCorner<3, 3>().transpose();
  result.topRightCorner<3, 1>() = -T.topLeftCorner<3, 3>().transpose() * tip(T);
  return result;
}

}  // namespace

Matrix4d with_axis_at(const Poses& machine, int axis, double q) {
  VectorXd all = VectorXd::Zero(machine.axes);
  all[axis] = q;
  return machine.T_wt(all);
}

Vector3d direction_of_travel(const Poses& machine, int axis, double reach) {
  const Vector3d from = tip(with_axis_at(machine, axis, -reach));
  const Vector3d to = tip(with_axis_at(machine, axis, reach));
  return (to - from).normalized();
}

Line axis_line(const Poses& machine, int axis, Standing standing, const Vector3d& near) {
  const Matrix4d from = with_axis_at(machine, axis, 0.0), to = with_axis_at(machine, axis, 1.0);
  const Matrix4d turn = standing == Standing::InWorkpiece ? Matrix4d(to * inverse(from))
                                                          : Matrix4d(inverse(from) * to);
  const Matrix3d R = turn.topLeftCorner<3, 3>();
  const Vector3d u = Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)).normalized();
  // a point p of the axis goes along it: R p + t - p = s u; p = near + y with y across u
  const Vector3d t = tip(turn) + R * near - near;
  const Matrix3d A = Matrix3d::Identity() - R + u * u.transpose();
  return {near + A.inverse() * (t - u * u.dot(t)), u};
}

double angle(const Vector3d& one, const Vector3d& other) {
  return std::atan2(one.cross(other).norm(), one.dot(other));
}

double angle_by_ball_bar(const Poses& machine, int first, int second, double radius) {
  const Vector3d centre = tip_at(machine, first, 0.0, second, 0.0);
  constexpr int n = 72;
  double sum = 0.0;
  for (int i = 0; i < n; ++i) {
    const double t = 2.0 * std::numbers::pi * i / n;
    const Vector3d p = tip_at(machine, first, radius * std::cos(t), second, radius * std::sin(t));
    sum += ((p - centre).norm() - radius) * std::sin(2.0 * t);
  }
  return -2.0 * (2.0 * sum / n) / radius;
}

double angle_by_diagonals(const Poses& machine, int first, int second, double side) {
  const double h = 0.5 * side;
  const double rising =
      (tip_at(machine, first, h, second, h) - tip_at(machine, first, -h, second, -h)).norm();
  const double falling =
      (tip_at(machine, first, -h, second, h) - tip_at(machine, first, h, second, -h)).norm();
  return (falling - rising) * (falling + rising) / (4.0 * side * side);
}

double angle_by_square(const Poses& machine, int first, int second, double reach) {
  // the square lies with one edge on the ends of the first axis's run, the other across it in the
  // plane of both runs
  const Vector3d a =
      tip_at(machine, first, reach, second, 0.0) - tip_at(machine, first, -reach, second, 0.0);
  const Vector3d b =
      tip_at(machine, first, 0.0, second, reach) - tip_at(machine, first, 0.0, second, -reach);
  const Vector3d edge = a.normalized();
  const Vector3d across = (b - edge * edge.dot(b)).normalized();
  return -std::atan2(edge.dot(b), across.dot(b));
}

}  // namespace abbe::oracles
