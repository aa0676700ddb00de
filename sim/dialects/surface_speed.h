#pragma once

#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// Turns the spindle for a block under constant surface speed (G96): the block runs at the speed
/// that belongs to the X of its middle, radius of the workpiece in program coordinates.
/// @param m_per_min  surface speed
/// @param most_rpm   speed at most, and on the axis
/// @param end        (axes) where the block ends; there is an X axis
void turn_at_surface_speed(program::Canon& canon, double m_per_min, double most_rpm,
                           const kinematics::AxisVector& end);

}  // namespace abbe::sim::dialects
