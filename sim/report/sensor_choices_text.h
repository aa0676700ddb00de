#pragma once

#include <string>

#include "sim/calibration/thermal_choice.h"

namespace abbe::sim {

/// The choices as a person reads them, a few lines each; foreign text in it stays on its line.
std::string sensor_choices_text(const ThermalChoice& choice);

}  // namespace abbe::sim
