#pragma once

#include <limits>

#include <Eigen/Core>

#include "cutting/surface/tool.h"

/// Lines against a cutter that is moved along a segment, in the frame of the cutter at the start:
/// tip at the origin, axis along z. The cutter is its bottom and corner with a cylinder of its
/// radius that has no upper end, a form cutter its outline alone, which is convex: so its sweep is
/// too, and a line lies in it between two places at most.
namespace abbe::cutting {

/// Where a line is inside a sweep: from `in` to `out` in units of its direction, either may be
/// infinite; nowhere where in > out.
struct SweepInterval {
  double in = std::numeric_limits<double>::infinity();
  double out = -std::numeric_limits<double>::infinity();
  double t_in = 0.0;  ///< instant of the move, 0 .. 1, at which the cutter reaches that place
  double t_out = 0.0;

  bool is_empty() const { return !(in <= out); }
};

/// The sweep of a cutter along a segment.
class CutterSweep {
 public:
  /// @param travel  mm, of the cutter over the move
  CutterSweep(const Cutter& cutter, const Eigen::Vector3d& travel);

  /// The line's interval: both ends to 1e-9 mm along it, where it does not graze.
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
  double lateral_;        // mm of travel across the axis
  double x_, y_;          // its direction
  double slope_;          // rise of travel per mm across
  double length_;         // mm of travel
  Eigen::Vector3d unit_;  // its direction
};

/// The interval of a line in the sweep of a flat disc across the axis, at `height` above the tip;
/// empty where neither line nor travel leaves the disc's plane.
SweepInterval disc_sweep_interval(double radius, double height, const Eigen::Vector3d& travel,
                                  const Eigen::Vector3d& point, const Eigen::Vector3d& direction);

}  // namespace abbe::cutting
