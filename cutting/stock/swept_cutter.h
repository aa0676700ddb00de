#pragma once

#include <limits>

#include <Eigen/Core>

#include "cutting/surface/tool.h"

/// Intersection of lines with the volume that a cutter sweeps along a straight segment, in the
/// frame of the cutter at the start: tip at the origin, axis along z. The cutter consists of its
/// end and corner and a cylinder without an upper end; a form cutter is its convex outline only.
/// Therefore the sweep is convex, and the part of a line inside it is a single interval.
namespace abbe::cutting {

/// The part of a line inside a sweep, from `in` to `out` in multiples of its direction vector.
/// Either end may be infinite; empty if in > out.
struct SweepInterval {
  double in = std::numeric_limits<double>::infinity();
  double out = -std::numeric_limits<double>::infinity();
  double t_in = 0.0;   ///< instant of the move, 0 .. 1, at which the cutter touches the end `in`
  double t_out = 0.0;  ///< the same for `out`

  bool is_empty() const { return !(in <= out); }
};

/// The volume swept by a cutter along a segment.
class CutterSweep {
 public:
  /// @param travel  mm, displacement of the cutter over the move
  CutterSweep(const Cutter& cutter, const Eigen::Vector3d& travel);

  /// Returns the interval of a line inside the sweep. Both ends are exact to 1e-9 mm along the line
  /// unless it grazes the sweep.
  SweepInterval interval(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const;

 private:
  struct Line;
  struct IntervalUnion;
  SweepInterval flat_interval(const Line& line, double radius) const;
  SweepInterval ball_interval(const Line& line) const;
  SweepInterval bull_interval(const Line& line) const;
  SweepInterval form_interval(const Line& line) const;
  void add_cylinders(const Line& line, double radius, IntervalUnion& intervals) const;
  struct NearestCorePoint;
  NearestCorePoint nearest_core_point(const Eigen::Vector3d& point, double t) const;
  double surface_crossing(const Line& line, double start, double sense, double& t) const;

  Cutter cutter_;
  double radius_, corner_, ring_;
  Eigen::Vector3d travel_;
  double lateral_;        // mm, travel across the tool axis
  double x_, y_;          // unit, its direction
  double slope_;          // rise along the axis per mm of lateral travel
  double length_;         // mm, of the travel
  Eigen::Vector3d unit_;  // unit, direction of the travel
};

/// Returns the interval of a line inside the sweep of a thin disc normal to the axis, `height`
/// above the tip. Empty if both line and travel are parallel to the disc.
SweepInterval disc_sweep_interval(double radius, double height, const Eigen::Vector3d& travel,
                                  const Eigen::Vector3d& point, const Eigen::Vector3d& direction);

}  // namespace abbe::cutting
