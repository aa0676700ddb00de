#include "sim/calibration/thermal_choice.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "errors/identification/thermal_study.h"
#include "errors/metrology/machine_tests.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"

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
  errors::metrology::DriftTest drift;
  std::vector<double> noise;  ///< (channels) mm or rad, standard deviation of one drift
  std::vector<std::string> sensors;
  Eigen::MatrixXd T_C;     ///< (n x sensors)
  std::vector<int> cycle;  ///< (n) of work and rest, from 0
};

/// Noise and rounding of a reading and of the first one, from which the drift counts.
std::vector<double> drift_noise(const errors::metrology::Readings& readings) {
  std::vector<double> noise;
  for (const auto& channel : readings.plan.set_ups.front().channels)
    noise.push_back(std::sqrt(
        2.0 * (channel.noise * channel.noise + channel.resolution * channel.resolution / 12.0)));
  return noise;
}

Log log_of(const Day& day) {
  const errors::metrology::Readings& readings = day.readings;
  if (readings.sensors.size() < 2)
    throw BadInput(day.file.string(), 0, 0, "at least 2 temperature sensors", "fewer");
  errors::metrology::Tests tests = tests_of(readings);
  Log log{day.name, std::move(tests.drifts.at(0)), drift_noise(readings), readings.sensors, {}, {}};
  const Index n = log.drift.log.time_s.size(), channels = log.drift.log.values.cols();
  const std::vector<double>& starts = day.cycle_starts_s;
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

/// The displacements among the channels, or those of these names: what sensors are chosen for.
/// @throws std::invalid_argument for a name that no displacement has
std::vector<Index> displacements(const Log& day, const std::vector<std::string>& names = {}) {
  std::vector<Index> result;
  for (std::size_t c = 0; c < day.drift.angle.size(); ++c)
    if (!day.drift.angle[c] &&
        (names.empty() || std::ranges::count(names, day.drift.log.names[c]) > 0))
      result.push_back(Index(c));
  if (!names.empty() && result.size() != names.size())
    throw std::invalid_argument("expected displacements of the drift, seen another in `for`");
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

// ---- ways to choose

using Way = SensorChoiceDescription::Way;

const char* word_of(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  if (choice.likeness == identification::Likeness::Correlation) return "correlation";
  switch (choice.grey.kind) {
    case GreyKind::Deng:
      return "deng";
    case GreyKind::Absolute:
      return "absolute";
    case GreyKind::Relative:
      return "relative";
    case GreyKind::Comprehensive:
      return "comprehensive";
  }
  return "";
}

const char* word_of(identification::Image image) {
  using identification::Image;
  return image == Image::Initial    ? "initial"
         : image == Image::Mean     ? "mean"
         : image == Image::Interval ? "interval"
                                    : "none";
}

bool compares_areas(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  return choice.likeness == identification::Likeness::Grey &&
         (choice.grey.kind == GreyKind::Absolute || choice.grey.kind == GreyKind::Comprehensive);
}

/// What a way chooses on the first day, and from where its degrees began.
struct Chosen {
  identification::SensorChoice choice;
  Json method;
};

Json method_json(const Way& way, bool since_start) {
  const identification::SensorChoiceOptions& how = way.choice;
  if (!how.fixed.empty()) return {{"fixed", true}};
  const bool deng = how.likeness == identification::Likeness::Grey &&
                    how.grey.kind == identification::GreyKind::Deng;
  return {
      {"likeness", word_of(how)},
      {"image", deng ? Json(word_of(how.grey.image)) : Json(nullptr)},
      {"screening", how.screening == identification::Screening::Degree ? "degree" : "regression"},
      {"temperatures", since_start ? "since the start of the day" : "as read, C"},
      {"for", way.drifts.empty() ? Json("all displacements") : Json(way.drifts)}};
}

/// Where the degree of each displacement began; those that it left out by null.
Json begins_json(const Log& day, const std::vector<Index>& channels,
                 const identification::SensorChoice& choice) {
  Json json = Json::object();
  for (std::size_t e = 0; e < choice.first_row.size(); ++e) {
    const std::string& name = day.drift.log.names[std::size_t(channels[e])];
    if (const auto row = choice.first_row[e])
      json[name] = {{"row", *row},
                    {"h", (day.drift.log.time_s[*row] - day.drift.log.time_s[0]) / 3600.0},
                    {"drift_um", day.drift.log.values(*row, channels[e]) / units::um}};
    else
      json[name] = nullptr;
  }
  return json;
}

// Areas of drift and temperature are compared as numbers: drift in um, as the papers have it.
Chosen chosen_by(const std::vector<Log>& days, const Way& way, bool since_start) {
  constexpr double beyond_noise = 4.0;  // standard deviations
  identification::SensorChoiceOptions options = way.choice;
  const bool by_start = identification::divides_by_start(options);
  const double unit = compares_areas(options) ? units::um : 1.0;
  const std::vector<Index> channels = displacements(days.front(), way.drifts);
  std::vector<ThermalData> training;
  for (const Index c : channels) {
    training.push_back(data_of(days, 0, 1, c, since_start && !by_start));
    training.back().y /= unit;
    options.least_start.push_back(beyond_noise * days.front().noise[std::size_t(c)] / unit);
  }
  Chosen chosen{identification::choose_sensors(training, options),
                method_json(way, since_start && !by_start)};
  if (chosen.choice.status == identification::GreyStatus::StartsAtZero && chosen.choice.input < 0)
    throw std::invalid_argument("no displacement drifts beyond its noise");
  if (chosen.choice.status != identification::GreyStatus::Ok)
    throw std::invalid_argument(fmt::format(
        "{} ({})", identification::to_string(chosen.choice.status),
        chosen.choice.input < 0 ? "the drift"
                                : training.front().names[std::size_t(chosen.choice.input)]));
  if (by_start) chosen.method["begins"] = begins_json(days.front(), channels, chosen.choice);
  return chosen;
}

/// A way with what it chose, and the figures of its channels without their models.
Json way_json(const Way& way, const Chosen& chosen, const Json& channels,
              const std::vector<std::string>& sensors, const Json& rms_over_range) {
  Json json{{"name", way.name}, {"method", chosen.method}};
  json["chosen"] = names_of(chosen.choice.chosen, sensors);
  json["degree"] = choice_json(chosen.choice, sensors)["degree"];
  Json list = Json::array();
  for (const Json& channel : channels) {
    Json one{{"name", channel["name"]}, {"unit", channel["unit"]}};
    for (const char* key : {"in_cycle", "cross_day"})
      if (channel.contains(key)) one[key] = channel[key];
    list.push_back(one);
  }
  json["channels"] = list;
  json["rms_over_range"] = rms_over_range;
  return json;
}

/// One way on all days: its channels, and how it compares with random choices.
struct Graded {
  Json channels = Json::array();
  Json rms_over_range;
  Json random;
  std::vector<DriftSeries> series;
};

Graded graded(const std::vector<Log>& logs, const Chosen& chosen,
              identification::ThermalStudyOptions options, bool since_start) {
  Graded result;
  options.choice.fixed = names_of(chosen.choice.chosen, logs.front().sensors);
  if (logs.size() > 1) {
    const auto study = identification::study_sensors(
        all_data(logs, 0, 1, since_start), all_data(logs, 1, logs.size(), since_start), options);
    result.rms_over_range = study.rms_over_range;
    if (options.random_subsets > 0) result.random = random_json(study);
  }
  for (Index c = 0; c < logs.front().drift.log.values.cols(); ++c) {
    const Channel channel = channel_of(logs, c, chosen.choice.chosen, options, since_start);
    result.channels.push_back(channel.json);
    append_series(result.series, logs, c, chosen.choice.chosen, channel, options.features,
                  since_start);
  }
  return result;
}

std::string default_name(const Way& way) {
  if (!way.name.empty()) return way.name;
  return fmt::format(
      "{}, {} screening", word_of(way.choice),
      way.choice.screening == identification::Screening::Degree ? "degree" : "regression");
}

}  // namespace

ThermalChoice thermal_choice(const std::vector<Day>& days,
                             const SensorChoiceDescription& description) {
  std::vector<Log> logs;
  for (const Day& day : days) logs.push_back(log_of(day));
  identification::ThermalStudyOptions options = description.study;
  // counted from the start of the day, not from that of each cycle
  const bool since_start = std::exchange(options.features.since_start, false);
  const std::vector<std::string>& sensors = logs.front().sensors;
  ThermalChoice result;
  try {
    Way own{"", options.choice, {}};
    own.name = default_name(own);
    const Chosen chosen = chosen_by(logs, own, since_start);
    Graded grade = graded(logs, chosen, options, since_start);
    result.json = {{"training_day", logs.front().day},
                   {"rows", logs.front().drift.log.time_s.size()},
                   {"sensors", sensors}};
    result.json.update(choice_json(chosen.choice, sensors));
    if (!grade.random.is_null()) result.json["random_choices_rms_over_range"] = grade.random;
    result.json["channels"] = grade.channels;
    result.json["warnings"] = warnings_of(grade.channels);
    result.series = std::move(grade.series);
    Json choices =
        Json::array({way_json(own, chosen, grade.channels, sensors, grade.rms_over_range)});
    options.random_subsets = 0;
    for (Way way : description.beside) {
      way.name = default_name(way);
      const Chosen other = chosen_by(logs, way, since_start);
      const Graded its = graded(logs, other, options, since_start);
      choices.push_back(way_json(way, other, its.channels, sensors, its.rms_over_range));
    }
    result.json["choices"] = choices;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(days.front().file.string(), 0, 0, "sensors that can be chosen from",
                   fault.what());
  }
  return result;
}

}  // namespace abbe::sim
