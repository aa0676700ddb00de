#pragma once

#include "kinematics/pose.h"
#include "sim/scene/fields.h"

namespace abbe::sim {

/// `turn_deg`: a rotation vector in degrees; the identity where it is left out. Turns by multiples
/// of 90 degrees about one axis are exact.
const Fields<Eigen::Matrix3d>& turn_fields();
Eigen::Matrix3d read_turn(TableReader& reader);

/// Place of a thing in its parent: `at_mm` and `turn_deg`.
const Fields<kinematics::Pose>& placement_fields();

}  // namespace abbe::sim
