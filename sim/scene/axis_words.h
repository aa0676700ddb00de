#pragma once

#include "kinematics/chain.h"
#include "sim/scene/fields.h"

namespace abbe::sim {

/// Positions of axes (joints) by words such as Z_mm and A_deg; those left out stand at zero.
/// @param joints  none where only the keys are wanted
Fields<kinematics::AxisVector> axis_word_fields(const std::vector<kinematics::Joint>& joints);
kinematics::AxisVector read_axis_words(TableReader& reader,
                                       const std::vector<kinematics::Joint>& joints);

}  // namespace abbe::sim
