#include "sim/commands/choose_sensors.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "sim/measure/measure.h"
#include "sim/report/sensor_choices_json.h"
#include "sim/report/thermal_pictures.h"

namespace abbe::sim {
namespace {

/// Instants at which the spindle or an axis starts after a rest, s; the first is that of the day.
std::vector<double> cycle_starts(const ThermalDescription& thermal, double history) {
  std::vector<double> starts;
  double time_s = -history;
  bool rests = true;
  for (const ThermalPhase& phase : thermal.history) {
    const bool works = phase.spindle_speed > 0.0 ||
                       (phase.axis_speed.size() > 0 && phase.axis_speed.maxCoeff() > 0.0);
    if (works && rests) starts.push_back(time_s);
    rests = !works;
    time_s += phase.duration;
  }
  return starts;
}

}  // namespace

Day measured_day(const std::string& name, const Scene& scene) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, expected, seen);
  };
  InstrumentDescription description = instrument_of(scene, scene.sensor_choice->instrument);
  if (description.instrument.kind != errors::metrology::Kind::Drift)
    refuse("an instrument of kind drift for sensor_choice",
           errors::metrology::to_string(description.instrument.kind));
  const double history = history_s(*scene.thermal);
  if (history <= 0.0) refuse("a [[history]] over which sensors are chosen", "none");
  description.starts_s = {-history};
  description.instrument.duration_s = history;
  Day day{
      name, scene.file, cycle_starts(*scene.thermal, history), measured(scene, description), {}};
  day.sensor_noise_K = Eigen::VectorXd::Zero(Eigen::Index(day.readings.sensors.size()));
  for (const errors::TemperatureSensor& sensor : scene.thermal->sensors)
    if (const auto at = std::ranges::find(day.readings.sensors, sensor.name);
        at != day.readings.sensors.end())
      day.sensor_noise_K[at - day.readings.sensors.begin()] = std::sqrt(
          sensor.noise_K * sensor.noise_K + sensor.resolution_K * sensor.resolution_K / 12.0);
  return day;
}

std::optional<ThermalChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                            const std::vector<Scene>& variants) {
  if (!scene.sensor_choice || !scene.thermal) return std::nullopt;
  std::vector<Day> days{measured_day("its own day", scene)};
  for (std::size_t i = 0; i < variants.size(); ++i)
    days.push_back(measured_day(scene.variants[i].name, variants[i]));
  ThermalChoice choice = thermal_choice(days, *scene.sensor_choice);
  write_json(folder / "thermal.json", to_json(choice));
  write_thermal_picture(folder / "thermal.png", choice);
  return choice;
}

}  // namespace abbe::sim
