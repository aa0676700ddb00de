#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/sensor_choice.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// Returns the contents of `thermal.json`; its keys are stable for scripts.
nlohmann::ordered_json to_json(const ThermalChoice& choice);

/// Returns the degrees of the sensors in falling order, the threshold and the groups of a choice.
nlohmann::ordered_json choice_json(const errors::identification::SensorChoice& choice,
                                   const std::vector<std::string>& sensors);

/// Returns the given name of a method, else "deng, regression screening".
std::string name_of(const SensorChoiceDescription::Way& way);

/// Returns the choices as text, a few lines each; every foreign text stays on one line.
std::string sensor_choices_text(const ThermalChoice& choice);

/// Draws the measured drift over time and its prediction from the chosen sensors, one panel for
/// each channel and day. Writes nothing if the program was built without VTK.
/// @throws OutputFailure
void write_thermal_picture(const ResultFile& file, const ThermalChoice& choice);

}  // namespace abbe::sim
