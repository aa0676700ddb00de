#include "sim/thermal_choice.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "errors/identification/thermal_study.h"
#include "kinematics/units.h"
#include "sim/evaluate_tests.h"
#include "sim/measure.h"
#include "sim/output.h"
#include "sim/thermal_pictures.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Eigen::VectorXd;
using identification::ThermalData;
using Json = nlohmann::ordered_json;

/// What was read on one day: the drift channels and the temperatures beside them.
struct Log {
  std::string day;
  DriftTest drift;
  std::vector<std::string> sensors;
  Eigen::MatrixXd T_C;     ///< (n x sensors)
  std::vector<int> cycle;  ///< (n) of work and rest, from 0
};

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

Log log_of(const Day& day) {
  const Scene& scene = day.scene;
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
  const auto readings = measured(scene, description);
  if (readings.sensors.size() < 2) refuse("at least 2 temperature sensors", "fewer");
  Tests tests = tests_of(readings);
  Log log{day.name, std::move(tests.drifts.at(0)), readings.sensors, {}, {}};
  const Index n = log.drift.log.time_s.size(), channels = log.drift.log.values.cols();
  const std::vector<double> starts = cycle_starts(*scene.thermal, history);
  log.T_C.resize(n, readings.T_C.cols());
  for (Index i = 0; i < n; ++i) {
    log.T_C.row(i) = readings.T_C.row(i * channels);
    const auto next =
        std::upper_bound(starts.begin(), starts.end(), log.drift.log.time_s[i] + 1e-6);
    log.cycle.push_back(std::max(0, int(next - starts.begin()) - 1));
  }
  return log;
}

/// Rows of one channel over some days, each of their cycles a run; drift and, if wanted,
/// temperatures count from the first reading of the day.
ThermalData data_of(const std::vector<Log>& days, std::size_t from, std::size_t to, Index channel,
                    bool since_start) {
  ThermalData data;
  data.names = days.front().sensors;
  for (std::size_t d = from; d < to; ++d) {
    const Log& day = days[d];
    const Index before = data.y.size(), n = day.drift.log.time_s.size();
    data.T.conservativeResize(before + n, day.T_C.cols());
    data.y.conservativeResize(before + n);
    data.T.bottomRows(n) = day.T_C;
    if (since_start) data.T.bottomRows(n).rowwise() -= day.T_C.row(0);
    data.y.tail(n) = day.drift.log.values.col(channel);
    for (const int cycle : day.cycle) data.run.push_back(1000 * int(d) + cycle);
  }
  return data;
}

Json spread_json(const identification::Spread& spread, double unit) {
  return {{"rms", spread.rms / unit}, {"max", spread.max / unit}};
}

double range_of(const VectorXd& v) { return v.maxCoeff() - v.minCoeff(); }

std::vector<std::string> names_of(const std::vector<int>& inputs,
                                  const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : inputs) result.push_back(names[std::size_t(i)]);
  return result;
}

Json choice_json(const identification::SensorChoice& choice,
                 const std::vector<std::string>& sensors) {
  Json degree = Json::object(), groups = Json::array();
  for (const int i : identification::ranking(choice.degree))
    degree[sensors[std::size_t(i)]] = choice.degree[i];
  for (const auto& group : choice.groups) groups.push_back(names_of(group, sensors));
  return {{"degree", degree},
          {"threshold", choice.threshold},
          {"groups", groups},
          {"standing_still", names_of(choice.still, sensors)},
          {"chosen", names_of(choice.chosen, sensors)}};
}

Json model_json(const identification::ThermalFit& fitted, double unit) {
  Json json;
  if (!fitted.regression || !fitted.model) return json;
  const identification::Regression& regression = *fitted.regression;
  json["constant"] = regression.constant / unit;
  for (std::size_t k = 0; k < fitted.model->names.size(); ++k)
    json[fitted.model->names[k]] = {
        {"per_K", regression.beta[Index(k)] / unit},
        {"standard_error", regression.standard_error[Index(k) + 1] / unit},
        {"vif", regression.vif[Index(k)]}};
  json["r_squared"] = regression.r_squared;
  return json;
}

/// What makes the figures doubtful.
std::vector<std::string> warnings_of(const Json& channels) {
  std::vector<std::string> warnings;
  const Json& first = channels.front();
  if (first.contains("model") && !first["model"].is_null())
    for (const auto& [name, term] : first["model"].items())
      if (term.is_object() && term["vif"].get<double>() > 10.0)
        warnings.push_back(fmt::format(
            "{} says nearly what the other chosen sensors say on the training day (VIF {:.0f})",
            name, term["vif"].get<double>()));
  if (first.contains("cross_day"))
    for (const Json& day : first["cross_day"])
      if (const int outside = day["figures"]["rows_outside_trained_range"].get<int>(); outside > 0)
        warnings.push_back(fmt::format(
            "{}: {} of {} rows lie outside the trained range; a compensator would refuse them",
            day["day"].get<std::string>(), outside, day["figures"]["rows"].get<int>()));
  return warnings;
}

/// One channel by a model of the sensors chosen.
struct Channel {
  Json json;
  identification::ThermalFit fitted;
};

Channel channel_of(const std::vector<Log>& days, Index c, const std::vector<int>& chosen,
                   const identification::ThermalStudyOptions& options, bool since_start) {
  const bool angle = days.front().drift.angle[std::size_t(c)];
  const double unit = angle ? units::urad : units::um;
  const identification::Recipe recipe{options.features, options.model};
  const ThermalData training =
      identification::only_inputs(data_of(days, 0, 1, c, since_start), chosen);
  const ThermalData seen = identification::with_features(training, recipe.features);
  Channel channel{{}, identification::fit(seen, recipe.model)};
  channel.json = {{"name", days.front().drift.log.names[std::size_t(c)]},
                  {"unit", angle ? "urad" : "um"},
                  {"training_range", range_of(training.y) / unit}};
  if (!channel.fitted.model) return channel;
  channel.json["model"] = model_json(channel.fitted, unit);
  channel.json["in_cycle"] = spread_json(
      identification::spread(seen.y - identification::values(*channel.fitted.model, seen.T)), unit);
  Json others = Json::array();
  for (std::size_t d = 1; d < days.size(); ++d) {
    const ThermalData test =
        identification::only_inputs(data_of(days, d, d + 1, c, since_start), chosen);
    const identification::Validation graded = identification::validate_on(training, test, recipe);
    const double range = range_of(test.y);
    Json one = spread_json(graded.overall, unit);
    one["drift_range"] = range / unit;
    one["rms_over_range"] = range > 0.0 ? Json(graded.overall.rms / range) : Json(nullptr);
    one["rows"] = graded.rows;
    one["rows_outside_trained_range"] = graded.outside;
    others.push_back({{"day", days[d].day}, {"figures", one}});
  }
  channel.json["cross_day"] = others;
  return channel;
}

Json random_json(const identification::ThermalStudy& study) {
  const identification::RandomChoices& random = study.random;
  return {{"subsets", random.rms_over_range.size()},
          {"p05", random.p05},
          {"p25", random.p25},
          {"p50", random.p50},
          {"p75", random.p75},
          {"p95", random.p95},
          {"chosen", study.rms_over_range},
          {"beaten_by_the_choice", random.beaten}};
}

/// The displacements among the channels: what sensors are chosen for.
std::vector<Index> displacements(const Log& day) {
  std::vector<Index> result;
  for (std::size_t c = 0; c < day.drift.angle.size(); ++c)
    if (!day.drift.angle[c]) result.push_back(Index(c));
  return result;
}

std::vector<ThermalData> all_data(const std::vector<Log>& days, std::size_t from, std::size_t to,
                                  bool since_start) {
  std::vector<ThermalData> result;
  for (const Index c : displacements(days.front()))
    result.push_back(data_of(days, from, to, c, since_start));
  return result;
}

void append_series(std::vector<DriftSeries>& all, const std::vector<Log>& days, Index c,
                   const std::vector<int>& chosen, const Channel& channel,
                   const identification::ThermalFeatures& features, bool since_start) {
  if (!channel.fitted.model) return;
  for (std::size_t d = 0; d < days.size(); ++d) {
    const ThermalData data = identification::with_features(
        identification::only_inputs(data_of(days, d, d + 1, c, since_start), chosen), features);
    all.push_back({days[d].day, days[d].drift.log.names[std::size_t(c)],
                   bool(days[d].drift.angle[std::size_t(c)]),
                   (days[d].drift.log.time_s.array() - days[d].drift.log.time_s[0]) / 3600.0,
                   data.y, identification::values(*channel.fitted.model, data.T)});
  }
}

}  // namespace

ThermalChoice thermal_choice(const std::vector<Day>& days) {
  std::vector<Log> logs;
  for (const Day& day : days) logs.push_back(log_of(day));
  identification::ThermalStudyOptions options = days.front().scene.sensor_choice->study;
  // counted from the start of the day, not from that of each cycle
  const bool since_start = std::exchange(options.features.since_start, false);
  const std::vector<ThermalData> training = all_data(logs, 0, 1, since_start);
  ThermalChoice result;
  try {
    identification::SensorChoice choice;
    Json random;
    if (logs.size() > 1) {
      const auto study = identification::study_sensors(
          training, all_data(logs, 1, logs.size(), since_start), options);
      choice = study.choice;
      random = random_json(study);
    } else {
      choice = identification::choose_sensors(training, options.choice);
    }
    result.json = {{"training_day", logs.front().day},
                   {"rows", training.front().y.size()},
                   {"sensors", training.front().names}};
    result.json.update(choice_json(choice, training.front().names));
    if (!random.is_null()) result.json["random_choices_rms_over_range"] = random;
    Json channels = Json::array();
    for (Index c = 0; c < logs.front().drift.log.values.cols(); ++c) {
      const Channel channel = channel_of(logs, c, choice.chosen, options, since_start);
      channels.push_back(channel.json);
      append_series(result.series, logs, c, choice.chosen, channel, options.features, since_start);
    }
    result.json["channels"] = channels;
    result.json["warnings"] = warnings_of(channels);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(days.front().scene.file.string(), 0, 0, "sensors that can be chosen from",
                   fault.what());
  }
  return result;
}

void write_thermal_choice(const ResultFolder& folder, const std::vector<Day>& days) {
  if (!days.front().scene.sensor_choice || !days.front().scene.thermal) return;
  const ThermalChoice choice = thermal_choice(days);
  write_json(folder / "thermal.json", choice.json);
  write_thermal_picture(folder / "thermal.png", choice);
}

}  // namespace abbe::sim
