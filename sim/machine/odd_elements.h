#pragma once

#include <string>
#include <vector>

#include "errors/geometric.h"

namespace abbe::sim {

/// Elements whose size no machine has, as of a number in another unit than its key: 1 mm or 10 mrad
/// and more; of a slide, 10 nm or 0.01 urad and less but not nothing. Each with its largest value
/// at 129 positions of its axis from `least` to `most`, of a spindle over a turn.
/// @param model  with the scale of the errors in it
std::vector<std::string> odd_elements(const errors::GeometricModel& model,
                                      const kinematics::AxisVector& least,
                                      const kinematics::AxisVector& most);

}  // namespace abbe::sim
