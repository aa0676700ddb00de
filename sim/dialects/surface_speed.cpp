#include "sim/dialects/surface_speed.h"

#include <algorithm>
#include <cmath>

#include "kinematics/units.h"

namespace abbe::sim::dialects {

void turn_at_surface_speed(program::Canon& canon, double m_per_min, double most_rpm,
                           const kinematics::AxisVector& end) {
  const int x = canon.joint_of('X');
  const double from = canon.programmed()[x], to = from + end[x] - canon.position()[x];
  const double radius = std::abs(0.5 * (from + to));
  const double rpm = radius > 0 ? m_per_min * 1000.0 / (2 * pi * radius) : most_rpm;
  canon.set_spindle_speed(std::min(rpm, most_rpm));
}

}  // namespace abbe::sim::dialects
