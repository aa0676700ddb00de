#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "kinematics/units.h"

/// The part and the programs on which surfaces are timed: z = 2 sin(x/10) cos(y/10), mm, over a
/// square.
namespace abbe::bench {

inline Eigen::Vector3d wave_normal(double x, double y) {
  const double dx = 0.2 * std::cos(x / 10) * std::cos(y / 10);
  const double dy = -0.2 * std::sin(x / 10) * std::sin(y / 10);
  return Eigen::Vector3d(-dx, -dy, 1).normalized();
}

inline Eigen::Vector3d wave_point(double x, double y) {
  return {x, y, 2 * std::sin(x / 10) * std::cos(y / 10)};
}

/// Vertices in the middles of the cells of a grid, without triangles. @param side  mm
inline cutting::Design wave(double side, int per_side) {
  cutting::Design design;
  const int n = per_side * per_side;
  design.vertices.resize(n, 3);
  design.normals.resize(n, 3);
  for (int j = 0; j < per_side; ++j)
    for (int i = 0; i < per_side; ++i) {
      const double x = side * (i + 0.5) / per_side;
      const double y = side * (j + 0.5) / per_side;
      design.vertices.row(j * per_side + i) = wave_point(x, y);
      design.normals.row(j * per_side + i) = wave_normal(x, y);
    }
  return design;
}

/// A serpentine raster of as many passes as each has points.
struct WaveRaster {
  double side = 100.0;            ///< mm
  int passes = 201;               ///< 0.5 mm of step and step-over
  bool upright = true;            ///< else the axis leads
  double lead = 10 * units::deg;  ///< rad from the normal along x
  bool into_feed = false;         ///< along the feed instead, on each pass against the one before
};

/// Where a cutter reaches farthest in a direction that goes by `across` across its axis and by
/// `rise` along it: from the axis, and above the tip.
inline Eigen::Vector2d extreme_point(const cutting::Cutter& cutter, double across, double rise) {
  const double r = cutter.corner_radius;
  if (cutter.outline) return cutting::support_point(*cutter.outline, rise, across);
  return {cutter.radius - r + r * across, r + r * rise};
}

/// Samples `first` to `last` of the raster; the cutter touches the wave at every point.
inline cutting::CutterMotion wave_motion(const cutting::Cutter& cutter, const WaveRaster& raster,
                                         long first, long last) {
  const int passes = raster.passes;
  const Eigen::Index n = last - first + 1;
  cutting::CutterMotion motion{.tip = cutting::Points(n, 3),
                               .axis = cutting::Points(n, 3),
                               .time_s = Eigen::VectorXd(n),
                               .line = std::vector<int>(std::size_t(n))};
  for (Eigen::Index k = 0; k < n; ++k) {
    const long j = (first + k) / passes, i = (first + k) % passes;
    const double x = raster.side * double(j % 2 == 0 ? i : passes - 1 - i) / (passes - 1);
    const double y = raster.side * double(j) / (passes - 1);
    const Eigen::Vector3d normal = wave_normal(x, y);
    const Eigen::Vector3d along = (Eigen::Vector3d::UnitX() - normal.x() * normal).normalized();
    const double lead = raster.into_feed && j % 2 == 1 ? -raster.lead : raster.lead;
    const Eigen::Vector3d axis =
        raster.upright ? Eigen::Vector3d::UnitZ().eval()
                       : Eigen::Vector3d(std::cos(lead) * normal + std::sin(lead) * along);
    const Eigen::Vector3d across = normal - normal.dot(axis) * axis;
    const Eigen::Vector2d touch = extreme_point(cutter, across.norm(), -normal.dot(axis));
    const Eigen::Vector3d tip =
        wave_point(x, y) - touch.y() * axis +
        (across.norm() > 1e-12 ? touch.x() : 0.0) * across.stableNormalized();
    motion.tip.row(k) = tip;
    motion.axis.row(k) = axis.normalized();
    motion.time_s[k] = 0.01 * double(first + k);
    motion.line[std::size_t(k)] = int(first + k) + 1;
  }
  return motion;
}

/// All of it.
inline cutting::CutterMotion wave_motion(const cutting::Cutter& cutter, const WaveRaster& raster) {
  return wave_motion(cutter, raster, 0, long(raster.passes) * raster.passes - 1);
}

}  // namespace abbe::bench
