#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

namespace abbe::cutting {

/// A stretch of a vertex's ray in spindle axes on which it does not pass the spindle line, and its
/// course in the meridian half-plane: x is linear in s, the radius lies within `sag` below a line.
struct NoseStretch {
  Eigen::Vector3d q, n;
  double from, to;  // of s
  double radius0, radius_step, sag;
  double radius_min;
  double azimuth;         // rad at `from`
  double azimuth_spread;  // rad from there to the other end
  double x_max;           // largest |x|

  Eigen::Vector3d at(double s) const { return q + s * n; }
};

/// mm, from the spindle line.
inline double radius(const Eigen::Vector3d& p) { return std::hypot(p.y(), p.z()); }
/// rad, about the spindle line.
inline double azimuth(const Eigen::Vector3d& p) { return std::atan2(p.z(), p.y()); }

/// rad, of their azimuths, 0 .. pi.
inline double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::abs(std::atan2(a.y() * b.z() - a.z() * b.y(), a.y() * b.y() + a.z() * b.z()));
}

/// mm: nearer to the spindle line than this a point is in the rake plane at every instant, if the
/// plane passes so near.
inline constexpr double on_axis = 1e-8;

/// The stretch of the ray q + s n between two values of s, `from` < `to`.
NoseStretch stretch_of(const Eigen::Vector3d& q, const Eigen::Vector3d& n, double from, double to);

/// Where a ray comes nearest to the spindle line, if that is within the band.
std::optional<double> nearest_to_axis(const Eigen::Vector3d& q, const Eigen::Vector3d& n,
                                      double band);

}  // namespace abbe::cutting
