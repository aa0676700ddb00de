#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/sensor_choice.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// `thermal.json`; its keys are a promise to scripts.
nlohmann::ordered_json to_json(const ThermalChoice& choice);

/// Degrees, falling, and groups of a choice from these sensors.
nlohmann::ordered_json choice_json(const errors::identification::SensorChoice& choice,
                                   const std::vector<std::string>& sensors);

/// The name that a way was given, else "deng, regression screening".
std::string name_of(const SensorChoiceDescription::Way& way);

/// The choices as a person reads them, a few lines each; foreign text in it stays on its line.
std::string sensor_choices_text(const ThermalChoice& choice);

/// Drift over time as it was read and as the chosen sensors predict it, a panel a channel and day;
/// nothing is written where the program was built without VTK. @throws OutputFailure
void write_thermal_picture(const ResultFile& file, const ThermalChoice& choice);

}  // namespace abbe::sim
