#pragma once

#include <limits>

#include <Eigen/Core>

#include "cutting/surface/tool.h"

/// Intersection of lines with the sweep of a cutter along a segment, in the frame of the cutter at
/// the start: tip at the origin, axis along z. The cutter consists of its bottom and corner and a
/// cylinder of its radius without an upper end; a form cutter consists of its outline alone, which
/// is convex. The sweep is therefore convex too, and a line is inside it on one interval at most.
namespace abbe::cutting {

/// The interval of a line inside a sweep: from `in` to `out` in units of its direction, either may
/// be infinite; empty if in > out.
struct SweepInterval {
  double in = std::numeric_limits<double>::infinity();
  double out = -std::numeric_limits<double>::infinity();
  double t_in = 0.0;  ///< instant of the move, 0 .. 1, at which the cutter reaches that end
  double t_out = 0.0;

  bool is_empty() const { return !(in <= out); }
};

/// The sweep of a cutter along a segment.
class CutterSweep {
 public:
  /// @param travel  mm, displacement of the cutter over the move
  CutterSweep(const Cutter& cutter, const Eigen::Vector3d& travel);

  /// Returns the line's interval; both ends are exact to 1e-9 mm along it unless it grazes.
  SweepInterval along(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const;

 private:
  struct Line;
  struct Sum;
  SweepInterval along_flat(const Line& line, double radius) const;
  SweepInterval along_ball(const Line& line) const;
  SweepInterval along_bull(const Line& line) const;
  SweepInterval along_form(const Line& line) const;
  void add_cylinders(const Line& line, double radius, Sum& sum) const;
  struct Nearest;
  Nearest nearest(const Eigen::Vector3d& point, double t) const;
  double settled(const Line& line, double from, double sense, double& t) const;

  Cutter cutter_;
  double radius_, corner_, ring_;
  Eigen::Vector3d travel_;
  double lateral_;        // mm, travel normal to the axis
  double x_, y_;          // direction of that travel
  double slope_;          // rise of the travel per mm of lateral travel
  double length_;         // mm, of travel
  Eigen::Vector3d unit_;  // direction of the travel
};

/// Returns the interval of a line in the sweep of a flat disc normal to the axis, at `height` above
/// the tip; empty if neither line nor travel leaves the disc's plane.
SweepInterval disc_sweep_interval(double radius, double height, const Eigen::Vector3d& travel,
                                  const Eigen::Vector3d& point, const Eigen::Vector3d& direction);

}  // namespace abbe::cutting
