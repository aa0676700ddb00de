#pragma once

#include <vector>

#include "sim/program/sample.h"

namespace abbe::sim {

/// Accelerations of the axes at every sample, mm/s^2 and rad/s^2: the mean speed over the 20 ms
/// after less that over the 20 ms before, per 20 ms, since blocks meet at corners.
/// @return (samples)
std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples);

}  // namespace abbe::sim
