#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/sensor_choice.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// Returns the contents of `thermal.json`. Its keys are stable, so that scripts may rely on them.
nlohmann::ordered_json to_json(const ThermalSensorChoice& choice);

/// Returns the degrees of the sensors in descending order, the threshold and the groups of a
/// choice.
nlohmann::ordered_json choice_json(const errors::identification::SensorChoice& choice,
                                   const std::vector<std::string>& sensors);

/// Returns the name that the scene gives a method or, without one, its measure and screening:
/// "deng, regression screening".
std::string name_of(const SensorChoiceDescription::SelectionMethod& way);

/// Returns the choices as text, a few lines each. Control characters in names are escaped.
std::string sensor_choices_text(const ThermalSensorChoice& choice);

/// Draws the measured drift over time and its prediction from the chosen sensors in a panel for
/// each channel and day. Writes nothing if the program was built without VTK.
/// @throws OutputFailure
void write_thermal_picture(const ResultFile& file, const ThermalSensorChoice& choice);

}  // namespace abbe::sim
