#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/calibration/thermal_choice.h"
#include "sim/files/output.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// A day with the readings from which its sensors are chosen.
/// @throws BadInput naming the scene if its instrument reads no drift or there is no history
Day measured_day(const std::string& name, const Scene& scene);

/// Chooses sensors on the scene's own day, grades them on those of its variants, and writes
/// `thermal.json` and `thermal.png`.
/// @param variants  of the scene, in its order
/// @return none where the scene asks for no choice
/// @throws BadInput, OutputFailure
std::optional<ThermalChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                            const std::vector<Scene>& variants);

}  // namespace abbe::sim
