#include "sim/commands/choose_sensors.h"

#include <nlohmann/json.hpp>

#include "sim/measure/measure.h"
#include "sim/report/thermal_pictures.h"

namespace abbe::sim {

using Json = nlohmann::ordered_json;

Day measured_day(const std::string& name, const Scene& scene) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, expected, seen);
  };
  InstrumentDescription description = instrument_of(scene, scene.sensor_choice->instrument);
  if (description.instrument.kind != errors::metrology::Kind::Drift)
    refuse("an instrument of kind drift for sensor_choice",
           errors::metrology::to_string(description.instrument.kind));
  double history = 0.0;
  for (const ThermalPhase& phase : scene.thermal->history) history += phase.duration;
  if (history <= 0.0) refuse("a [[history]] over which sensors are chosen", "none");
  description.starts_s = {-history};
  description.instrument.duration_s = history;
  return {name, scene, measured(scene, description)};
}

Json write_thermal_choice(const ResultFolder& folder, const std::vector<Day>& days) {
  const ThermalChoice choice = thermal_choice(days);
  write_json(folder / "thermal.json", choice.json);
  write_thermal_picture(folder / "thermal.png", choice);
  return {{"choices", choice.json["choices"]}, {"warnings", choice.json["warnings"]}};
}

}  // namespace abbe::sim
