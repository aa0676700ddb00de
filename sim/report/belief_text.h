#pragma once

#include <string>

#include "sim/calibration/identify.h"

namespace abbe::sim {

/// The belief file of what was identified, its head saying from what: an errors file (belief_file),
/// of a day a thermal belief (thermal_belief).
std::string belief_text(const Identified& identified);

/// The file of the thermal half of a composite.
std::string thermal_half_text(const Identified& composite);

}  // namespace abbe::sim
