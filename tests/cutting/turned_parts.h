#pragma once

#include "cutting/surface/surface.h"
#include "tests/test.h"

/// Turned parts for tests. Lathe frame l: the spindle along x, the nose at +z of it with its frame
/// parallel to l, y the height. It stands obliquely in the workpiece, so that no axis is special.
namespace abbe::cutting {

inline constexpr double two_pi = 2.0 * std::numbers::pi;

inline Eigen::Isometry3d lathe_in_workpiece() {
  Eigen::Isometry3d T_wl = Eigen::Isometry3d::Identity();
  T_wl.linear() = Eigen::AngleAxisd(1.1, Vector3d(0.3, -0.5, 0.81).normalized()).toRotationMatrix();
  T_wl.translation() = Vector3d(3.0, -7.0, 11.0);
  return T_wl;
}

/// Slow poses of the nose in the lathe frame against the spindle.
struct NosePath {
  std::vector<Eigen::Isometry3d> T_lt;
  std::vector<double> spindle;  // rad

  void add(const Vector3d& centre, double angle, const Matrix3d& R = Matrix3d::Identity()) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = R;
    T.translation() = centre;
    T_lt.push_back(T);
    spindle.push_back(angle);
  }
};

/// One second a revolution; the line of a sample is its index + 100.
inline NoseMotion motion_of(const NosePath& path) {
  const Eigen::Isometry3d T_wl = lathe_in_workpiece();
  NoseMotion motion;
  motion.spindle = VectorXd::Map(path.spindle.data(), Index(path.spindle.size()));
  motion.time_s.resize(motion.spindle.size());
  for (std::size_t i = 0; i < path.T_lt.size(); ++i) {
    motion.T_without_spindle.push_back(T_wl * path.T_lt[i]);
    motion.line.push_back(100 + int(i));
    const auto k = Index(i);
    motion.time_s[k] =
        k == 0 ? 0.0
               : motion.time_s[k - 1] +
                     std::max(1e-6, std::abs(motion.spindle[k] - motion.spindle[k - 1]) / two_pi);
  }
  motion.spindle_point = T_wl * Vector3d(2.5, 0, 0);
  motion.spindle_direction = T_wl.linear().col(0);
  return motion;
}

/// A ray of a turned part: meridian place and direction, at an azimuth at which the nose stands
/// when the spindle is at `angle`.
struct MeridianVertex {
  double x, r, angle;
  double nx, nr;
};

inline Design design_of(const std::vector<MeridianVertex>& vertices) {
  const Eigen::Isometry3d T_wl = lathe_in_workpiece();
  const auto n = Index(vertices.size());
  Design design;
  design.vertices.resize(n, 3);
  design.normals.resize(n, 3);
  for (Index i = 0; i < n; ++i) {
    const MeridianVertex& v = vertices[std::size_t(i)];
    const Vector3d out(0, -std::sin(v.angle), std::cos(v.angle));
    const Vector3d p_l = v.x * Vector3d::UnitX() + v.r * out;
    design.vertices.row(i) = (T_wl * p_l).transpose();
    design.normals.row(i) = (T_wl.linear() * (v.nx * Vector3d::UnitX() + v.nr * out)).transpose();
  }
  design.judged.assign(vertices.size(), 1);
  return design;
}

}  // namespace abbe::cutting
