// Chen and Wang 2013: four of 13 sensors.

#include "errors/identification/sensor_choice.h"
#include "errors/identification/thermal_model.h"
#include "errors/metrology/machine_tests.h"
#include "sim/commands/calibration_commands.h"
#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

namespace identification = errors::identification;
using nlohmann::ordered_json;

const std::string day_scene = "thermal_protocol_chen";

/// Number of a sensor as the paper counts them: the order in which the scene names them.
std::string number(const ordered_json& thermal, const std::string& name) {
  const auto& sensors = thermal["sensors"];
  return std::to_string(std::find(sensors.begin(), sensors.end(), name) - sensors.begin() + 1);
}

std::string ranking(const ordered_json& thermal) {
  std::vector<std::string> order;
  for (const auto& [name, degree] : thermal["degree"].items())
    order.push_back(number(thermal, name));
  return joined(order, " > ");
}

std::string chosen_numbers(const ordered_json& thermal) {
  std::vector<std::string> order;
  for (const ordered_json& name : thermal["chosen"]) order.push_back(number(thermal, name));
  return joined(order, ", ");
}

/// Drift along Z and all temperatures over the scene's own day.
identification::ThermalData readings_of_the_day() {
  const sim::Scene day = scene_of(day_scene);
  sim::InstrumentDescription drift = sim::find_instrument(day, "drift");
  double history = 0.0;
  for (const sim::ThermalPhase& phase : day.thermal->history) history += phase.duration;
  drift.starts_s = {-history};
  drift.instrument.duration_s = history;
  const auto readings = sim::measure_machine(day, drift);
  const errors::metrology::DriftTest test = classify_readings(readings).drifts.at(0);
  const auto z = std::find(test.log.names.begin(), test.log.names.end(), "Z");
  if (z == test.log.names.end()) throw std::invalid_argument("no drift along Z");
  const Index n = test.log.values.rows(), channels = test.log.values.cols();
  identification::ThermalData data;
  data.names = readings.sensors;
  data.T.resize(n, readings.T_C.cols());
  for (Index i = 0; i < n; ++i) data.T.row(i) = readings.T_C.row(i * channels);
  data.y = test.log.values.col(z - test.log.names.begin());
  data.run.assign(std::size_t(n), 0);
  return data;
}

/// RMS in um by which Z misses a regression on sensors, on the day that is fitted.
double in_cycle(const std::vector<int>& numbers) {
  std::vector<int> inputs;
  for (const int i : numbers) inputs.push_back(i - 1);
  const auto fit =
      identification::fit(identification::select_inputs(readings_of_the_day(), inputs));
  return identification::spread(fit.regression.value().residual).rms / units::um;
}

/// The four sensors most like the drift by the paper's own image, x / x(1), from the first reading
/// on that is not zero.
std::string by_initial_image() {
  const identification::ThermalData data = readings_of_the_day();
  Index first = 0;
  while (data.y[first] == 0.0) ++first;
  const Index n = data.y.size() - first;
  const auto degrees = identification::grey_degrees(data.y.tail(n), data.T.bottomRows(n));
  if (degrees.status != identification::GreyStatus::Ok)
    return identification::to_string(degrees.status);
  std::vector<std::string> order;
  for (const int i : identification::ranking(degrees.degree))
    order.push_back(std::to_string(i + 1));
  order.resize(4);
  return joined(order, ", ");
}

const ordered_json& choice(const char* name) {
  return choice_of(thermal_choice_of(day_scene), name);
}

const char* const scenes_four = "deng, regression screening";
const char* const initial = "Deng's degree, Chen and Wang 2013";
const char* const papers = "the paper's four, Chen and Wang 2013";

/// "8: 1-2, 12: 2-3" ranks of the sensors chosen over start rows and noise, and how often the same
/// four are chosen.
std::string ranks_by_chance(const char* name) {
  const ordered_json& one = choice(name);
  const ordered_json& spread = one["spread"];
  std::vector<std::string> ranks;
  for (const ordered_json& sensor : one["chosen"]) {
    const ordered_json& range = spread["rank_from_to"][sensor.get<std::string>()];
    ranks.push_back(fmt::format("{}: {}-{}", number(thermal_choice_of(day_scene), sensor),
                                range[0].get<int>(), range[1].get<int>()));
  }
  return fmt::format("{}; {:.0f} %", joined(ranks, ", "),
                     spread["same_sensors_percent"].get<double>());
}

/// RMS in um by which Z misses on the day that chose.
std::string z_of_choice(const char* name) {
  for (const ordered_json& channel : choice(name)["channels"])
    if (channel["name"] == "Z")
      return fmt::format("{:.4f}", channel["in_cycle"]["rms"].get<double>());
  return "none";
}

std::string together_on_another_day(const char* name) {
  return fmt::format("{:.1f}", 100.0 * choice(name)["rms_over_range"].get<double>());
}

/// What the choices are worth: Z on the other day, and X, Y and Z together of their ranges.
std::vector<Figure> other_day() {
  const std::string paper = "Chen and Wang 2013", none = "no figure";
  const std::string command =
      "`abbe compare scenes/thermal_protocol_chen.toml`, `thermal.json`, `choices`";
  const std::string day = "the day and the machine are chosen";
  std::vector<Figure> rows;
  for (const auto& [vector4, name] : {std::pair{"Deng's four, initial image", initial},
                                      {"the paper's four", papers},
                                      {"the scene's four", scenes_four}}) {
    rows.push_back({paper, fmt::format("Z on another day by {}, µm RMS", vector4), none,
                    [name] { return z_missed_on_another_day(choice(name)); }, command, day});
    rows.push_back({paper,
                    fmt::format("X, Y and Z together on another day by {}, % of ranges", vector4),
                    none, [name] { return together_on_another_day(name); }, command, day});
  }
  return rows;
}

}  // namespace

std::vector<Figure> chen() {
  const std::string paper = "Chen and Wang 2013", none = "no figure";
  const std::string compare = "`abbe compare scenes/thermal_protocol_chen.toml`, `thermal.json`";
  const std::string by_degree = "the same with `--set sensor_choice.screening=degree`";
  const std::string day =
      "the day and the machine are chosen; the paper's readings are not printed";
  std::vector<Figure> rows{
      {paper, "sensors by Deng's degree with the spindle's drift, interval image",
       "8 > 13 > 12 > 10 > 3 > 5 > 7 > 1 > 6 > 9 > 2 > 11 > 4",
       [] { return ranking(thermal_choice_of(day_scene)); }, compare,
       day + "; the drift starts at zero, where the paper's image divides by it"},
      {paper, "four of 13 by Deng's degree, interval image", "8, 13, 12, 10",
       [] {
         return chosen_numbers(
             thermal_choice_of(day_scene, {{"sensor_choice.screening", "degree"}}));
       },
       by_degree, day},
      {paper, "four of 13 by Deng's degree, initial image from the first drift on", "8, 13, 12, 10",
       by_initial_image, "`abbe test -R '^Figures'`", day},
      {paper,
       "ranks of these four over start rows 0 to 10 and noise drawn again, and how often the same "
       "four are chosen",
       none, [] { return ranks_by_chance(initial); }, compare + ", `choices`, `spread`",
       "the order of neighbours is one of chance"},
      {paper, "four of 13 as the scene chooses", "8, 13, 12, 10",
       [] { return chosen_numbers(thermal_choice_of(day_scene)); }, compare,
       "screened by regression, which takes what lowers the residual most"},
      {paper, "Z on the day that is fitted by the paper's four, µm RMS", none,
       [] {
         return fmt::format("{:.4f}", in_cycle({8, 13, 12, 10}));
       },
       "`abbe test -R '^Figures'`", "the paper's readings are not printed"},
      {paper, "Z on the day that is fitted by the scene's four, µm RMS", none,
       [] { return z_of_choice(scenes_four); }, compare,
       "chosen for X, Y and Z together, not for Z alone"},
      {paper, "Z on the day that is fitted by Deng's four, initial image, µm RMS", none,
       [] { return z_of_choice(initial); }, compare + ", `choices`",
       "the paper's readings are not printed"},
  };
  for (Figure& row : other_day()) rows.push_back(std::move(row));
  return rows;
}

}  // namespace abbe::figures
