#pragma once

#include <filesystem>

#include "sim/calibration/thermal_choice.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// Drift over time as it was read and as the chosen sensors predict it, a panel a channel and day;
/// nothing is written where the program was built without VTK. @throws OutputFailure
void write_thermal_picture(const ResultFile& file, const ThermalChoice& choice);

}  // namespace abbe::sim
