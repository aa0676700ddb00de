#include "tests/oracles/paper_chain.h"

#include <cmath>

#include <Eigen/LU>

namespace abbe::oracles {
namespace {

using Eigen::Matrix4d;
using Eigen::Vector3d;

Matrix4d translation(const Vector3d& d) {
  Matrix4d T = Matrix4d::Identity();
  T(0, 3) = d.x();
  T(1, 3) = d.y();
  T(2, 3) = d.z();
  return T;
}

// Written out per axis, as the papers do.
Matrix4d moved(char motion, double amount) {
  const double c = std::cos(amount);
  const double s = std::sin(amount);
  Matrix4d T = Matrix4d::Identity();
  switch (motion) {
    case 'x':
      T(0, 3) = amount;
      break;
    case 'y':
      T(1, 3) = amount;
      break;
    case 'z':
      T(2, 3) = amount;
      break;
    case 'a':
      T << 1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0, 0, 0, 0, 1;
      break;
    case 'b':
      T << c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, 0, 0, 0, 1;
      break;
    case 'c':
      T << c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
      break;
    default:
      break;
  }
  return T;
}

Matrix4d linearised(const SixErrors& e) {
  Matrix4d T;
  T << 1, -e.gamma, e.beta, e.dx,  //
      e.gamma, 1, -e.alpha, e.dy,  //
      -e.beta, e.alpha, 1, e.dz,   //
      0, 0, 0, 1;
  return T;
}

// exp of the linearised matrix's rotation by its power series, for any angle below a turn or so.
Matrix4d exact(const SixErrors& e) {
  SixErrors angles = e;
  angles.dx = angles.dy = angles.dz = 0;
  const Matrix4d K = linearised(angles) - Matrix4d::Identity();
  Matrix4d T = Matrix4d::Identity();
  Matrix4d term = Matrix4d::Identity();
  for (int n = 1; n <= 24; ++n) {
    term = term * K / n;
    T += term;
  }
  T(0, 3) = e.dx;
  T(1, 3) = e.dy;
  T(2, 3) = e.dz;
  return T;
}

Matrix4d error(const SixErrors& e, Angles angles) {
  return angles == Angles::Exact ? exact(e) : linearised(e);
}

Matrix4d in_lower(const Body& body, Angles angles) {
  const Matrix4d T_p = translation(body.place);
  const Matrix4d dT_p = error(body.place_error, angles);
  const Matrix4d T_s = moved(body.motion, body.amount);
  const Matrix4d dT_s = error(body.motion_error, angles);
  if (body.error_before_motion) return T_p * dT_p * dT_s * T_s;
  return T_p * dT_p * T_s * dT_s;
}

Vector3d applied(const Matrix4d& T, const Vector3d& p) {
  const Eigen::Vector4d q = T * Eigen::Vector4d(p.x(), p.y(), p.z(), 1.0);
  return {q.x(), q.y(), q.z()};
}

SixErrors rotations(double alpha, double beta, double gamma) {
  return {0, 0, 0, alpha, beta, gamma};
}

}  // namespace

Matrix4d in_bed(const std::vector<Body>& bodies, int body, Angles angles) {
  Matrix4d T = Matrix4d::Identity();
  for (int k = body; k != 0; k = bodies[std::size_t(k - 1)].lower)
    T = in_lower(bodies[std::size_t(k - 1)], angles) * T;
  return T;
}

Matrix4d relative(const std::vector<Body>& bodies, int other, int body, Angles angles) {
  return in_bed(bodies, other, angles).inverse() * in_bed(bodies, body, angles);
}

Vector3d platform_error(const Platform& platform, const Vector3d& p_w, const Vector3d& p_t,
                        Angles angles) {
  // 1 X slide, 2 spindle, 3 workpiece, 4 Z slide, 5 servo frame, 6 tool; lower bodies 0 1 2 0 4 5
  const auto points = [&](const Platform& p) -> Vector3d {
    std::vector<Body> bodies(6);
    const int lower[6] = {0, 1, 2, 0, 4, 5};
    for (int k = 0; k < 6; ++k) bodies[std::size_t(k)].lower = lower[k];
    bodies[0].motion = 'x';
    bodies[0].amount = p.x_position;
    bodies[0].motion_error = p.x;
    bodies[3].motion = 'z';
    bodies[3].amount = p.z_position;
    bodies[3].motion_error = p.z;
    bodies[3].place_error = rotations(0, p.squareness, 0);
    return applied(in_bed(bodies, 3, angles), p_w) - applied(in_bed(bodies, 6, angles), p_t);
  };
  Platform without;
  without.x_position = platform.x_position;
  without.z_position = platform.z_position;
  return points(platform) - points(without);
}

Vector3d platform_formula(const Platform& platform, const Vector3d& p_w, const Vector3d& p_t) {
  const SixErrors& x = platform.x;
  const SixErrors& z = platform.z;
  const double b = platform.squareness;
  const double Z = platform.z_position;
  return {
      x.dx - z.dx - x.gamma * p_w.y() + z.gamma * p_t.y() + x.beta * p_w.z() - z.beta * p_t.z() -
          b * (Z + p_t.z()) + b * (z.beta * p_t.x() - z.alpha * p_t.y() - z.dz),
      x.dy - z.dy + x.gamma * p_w.x() - z.gamma * p_t.x() - x.alpha * p_w.z() + z.alpha * p_t.z(),
      x.dz - z.dz - x.beta * p_w.x() + z.beta * p_t.x() + x.alpha * p_w.y() - z.alpha * p_t.y() +
          b * p_t.x() + b * (z.dx - z.gamma * p_t.y() + z.beta * p_t.z())};
}

Matrix4d gantry_tool_in_workpiece(const Gantry& errors, const GantryPlaces& places,
                                  const GantryPositions& positions, const GantryForm& form) {
  // 1 C, 2 workpiece, 3 X, 4 Y, 5 Z, 6 A, 7 spindle, 8 tool
  std::vector<Body> bodies(8);
  const int lower[8] = {0, 1, 0, 3, 4, 5, 6, 7};
  const Vector3d stands[8] = {places.c, places.workpiece, places.x,       places.y,
                              places.z, places.a,         places.spindle, places.tool};
  for (int k = 0; k < 8; ++k) {
    const Vector3d below = lower[k] == 0 ? Vector3d(Vector3d::Zero()) : stands[lower[k] - 1];
    bodies[std::size_t(k)].lower = lower[k];
    bodies[std::size_t(k)].place = stands[k] - below;
  }
  const auto set = [&](int number, char motion, double amount, const SixErrors& motion_error,
                       const SixErrors& place_error) {
    Body& body = bodies[std::size_t(number - 1)];
    body.motion = motion;
    body.amount = amount;
    body.motion_error = motion_error;
    body.place_error = place_error;
  };
  set(1, 'c', positions.c, errors.c,
      {errors.dx_c, errors.dy_c, 0, errors.alpha_c, errors.beta_c, 0});
  set(3, 'x', positions.x, errors.x, {});
  set(4, 'y', positions.y, errors.y, rotations(0, 0, errors.gamma_xy));
  set(5, 'z', positions.z, errors.z, rotations(errors.alpha_yz, errors.beta_xz, 0));
  set(6, 'a', positions.a, errors.a,
      {0, errors.dy_a, errors.dz_a, 0, errors.beta_a, errors.gamma_a});
  set(7, '-', 0, errors.spindle, {});
  bodies[0].error_before_motion = bodies[5].error_before_motion = !form.turning;
  return relative(bodies, 2, 8, form.angles);
}

}  // namespace abbe::oracles
