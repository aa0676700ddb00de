#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/thermal_choice.h"
#include "sim/files/output.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// A day with the readings from which its sensors are chosen.
/// @throws BadInput naming the scene if its instrument reads no drift or there is no history
Day measured_day(const std::string& name, const Scene& scene);

/// `thermal.json` and `thermal.png` of a scene that asks for a choice of sensors, else nothing.
/// @return the `choices` and `warnings` of `thermal.json`, null where there is none
/// @throws BadInput, OutputFailure
nlohmann::ordered_json write_thermal_choice(const ResultFolder& folder,
                                            const std::vector<Day>& days,
                                            const SensorChoiceDescription& description);

}  // namespace abbe::sim
