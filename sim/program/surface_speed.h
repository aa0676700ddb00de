#pragma once

#include <optional>

/// Speed of the workpiece spindle under constant surface speed (G96).
namespace abbe::sim::program {

/// Constant surface speed as a program states it.
struct SurfaceSpeed {
  double m_per_min = 0.0;
  std::optional<double> max_rpm = {};  ///< G50 S, LIMS=, G96 D; none: that of the machine
};

/// How a move changes its distance from the spindle's axis: in proportion from one end to the
/// other, or along an arc in the plane of that distance.
struct RadialMove {
  double from = 0.0, to = 0.0;  ///< mm, signed: both sides of the axis
  struct Arc {
    double centre = 0.0;  ///< mm, from the axis
    double radius = 0.0;  ///< mm
    double start = 0.0;   ///< rad, from the direction away from the axis
    double sweep = 0.0;   ///< rad
  };
  std::optional<Arc> arc = {};
};

/// Returns the one speed at which a move takes as long, at a feed per turn, as with the speed that
/// belongs to each of its points: the harmonic mean over its path, rpm. The result is exact for
/// lines and arcs, whether or not `max_rpm` holds in a part of them.
double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm);

/// Returns the least distance from the axis, mm, 0 where a line crosses it.
double least_radius(const RadialMove& move);

}  // namespace abbe::sim::program
