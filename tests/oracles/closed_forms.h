#pragma once

#include <cmath>

#include <Eigen/Core>

/// Closed forms that several tests hold the program against. Lengths in mm, angles in rad.
namespace abbe::oracles {

/// Height of the ridge between two passes of a round edge of radius R, `step` apart on a plane.
inline double cusp(double R, double step) {
  const double half = 0.5 * step;
  return half * half / (R + std::sqrt(R * R - half * half));
}

/// The same at arc offset `offset` from a pass on a convex sphere or cylinder of radius rho, along
/// its normal; rho may be infinite.
inline double pass_height(double R, double rho, double offset) {
  if (std::isinf(rho)) return cusp(R, 2.0 * offset);
  const double delta = offset / rho;
  const double d = (rho + R) * std::sin(delta);
  return (rho + R) * std::cos(delta) - std::sqrt(R * R - d * d) - rho;
}

/// Ridge between two passes of a ball R at an arc distance `step` on a dome of radius rho.
inline double dome_cusp(double R, double rho, double step) {
  return pass_height(R, rho, 0.5 * step);
}

/// How deep a straight move cuts into a dome of radius rho when the centre of the ball R should
/// have gone along an arc of length L, at a fixed tool axis.
inline double chord_gouge(double R, double rho, double L) {
  return (rho + R) * (1.0 - std::cos(0.5 * L / (rho + R)));
}

/// The same when the tip goes straight and the axis turns along, leaning by `lead` in the feed
/// plane.
inline double chord_gouge_turning(double R, double rho, double L, double lead) {
  return (rho + R - R * std::cos(lead)) * (1.0 - std::cos(0.5 * L / (rho + R)));
}

/// Radius of the ring that a rotary table cuts alone, its centre off by `offset`, the tool standing
/// at `radius` in the unit direction `tool`: |r e - d|.
inline double ring_radius(double radius, const Eigen::Vector2d& tool,
                          const Eigen::Vector2d& offset) {
  return (radius * tool - offset).norm();
}

/// Circularity of a circle of radius R whose axes are out of square by S, to first order in S.
inline double squareness_circularity(double R, double S) { return R * S; }

/// Distance along a ray in a plane to a circle: centre less ray origin `to_centre`, unit direction
/// `ray`. NaN where it misses.
inline double ray_to_circle(const Eigen::Vector2d& to_centre, const Eigen::Vector2d& ray,
                            double R) {
  const double along = to_centre.dot(ray);
  const double across = to_centre.x() * ray.y() - to_centre.y() * ray.x();
  return along - std::sqrt((R - across) * (R + across));
}

}  // namespace abbe::oracles
