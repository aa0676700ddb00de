#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/thermal_choice.h"

namespace abbe::sim {

/// `thermal.json`; its keys are a promise to scripts.
nlohmann::ordered_json to_json(const ThermalChoice& choice);

/// Degrees, falling, and groups of a choice from these sensors.
nlohmann::ordered_json choice_json(const errors::identification::SensorChoice& choice,
                                   const std::vector<std::string>& sensors);

/// The name that a way was given, else "deng, regression screening".
std::string name_of(const SensorChoiceDescription::Way& way);

}  // namespace abbe::sim
