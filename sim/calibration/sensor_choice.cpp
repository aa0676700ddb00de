#include "sim/calibration/sensor_choice.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "errors/identification/sensor_choice.h"
#include "errors/metrology/machine_tests.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {

namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Eigen::VectorXd;
using identification::ThermalData;

/// Log of one day: drift channels and temperatures.
struct DriftDay {
  std::string day;
  errors::metrology::DriftTest drift;
  std::vector<double> noise;  ///< (channels) mm or rad, standard deviation of one drift
  std::vector<std::string> sensors;
  Eigen::MatrixXd T_C;      ///< (n x sensors)
  std::vector<int> cycle;   ///< (n) index of the cycle of work and rest
  VectorXd sensor_noise_K;  ///< (sensors)
};

/// Returns the standard deviation of the drift of every channel: noise and rounding of a reading
/// and of the first reading, to which the drift refers. Rounding is uniform over the resolution r,
/// with variance r^2 / 12.
std::vector<double> drift_noise(const errors::metrology::Readings& readings) {
  std::vector<double> noise;
  for (const auto& channel : readings.plan.set_ups.front().channels)
    noise.push_back(std::sqrt(
        2.0 * (channel.noise * channel.noise + channel.resolution * channel.resolution / 12.0)));
  return noise;
}

/// Returns the drift and the temperatures of a day, divided into cycles.
DriftDay drift_day(const DayReadings& day) {
  const errors::metrology::Readings& readings = day.readings;
  if (readings.sensors.size() < 2)
    throw BadInput(day.file.string(), 0, 0, "at least 2 temperature sensors", "fewer");
  errors::metrology::MachineTests tests = classify_readings(readings);
  DriftDay log{day.name,
               std::move(tests.drifts.at(0)),
               drift_noise(readings),
               readings.sensors,
               {},
               {},
               day.sensor_noise_K.size() > 0
                   ? day.sensor_noise_K
                   : VectorXd(VectorXd::Zero(Index(readings.sensors.size())))};
  const Index n = log.drift.log.time_s.size(), channels = log.drift.log.values.cols();
  const std::vector<double>& starts = day.cycle_starts_s;
  log.T_C.resize(n, readings.T_C.cols());
  for (Index i = 0; i < n; ++i) {
    // The channels of a row have the same temperatures.
    log.T_C.row(i) = readings.T_C.row(i * channels);
    // 1e-6 s: a cycle that starts at a reading includes it.
    const auto next_start =
        std::upper_bound(starts.begin(), starts.end(), log.drift.log.time_s[i] + 1e-6);
    log.cycle.push_back(std::max(0, int(next_start - starts.begin()) - 1));
  }
  return log;
}

/// Returns the data of one channel over the days `from` to `to` - 1, with a run for each of their
/// cycles. The drift and, if `since_start`, the temperatures refer to the first reading of the day.
ThermalData channel_data(const std::vector<DriftDay>& days, std::size_t from, std::size_t to,
                         Index channel, bool since_start) {
  ThermalData data;
  data.names = days.front().sensors;
  for (std::size_t d = from; d < to; ++d) {
    const DriftDay& day = days[d];
    const Index previous_rows = data.y.size(), n = day.drift.log.time_s.size();
    data.T.conservativeResize(previous_rows + n, day.T_C.cols());
    data.y.conservativeResize(previous_rows + n);
    data.T.bottomRows(n) = day.T_C;
    if (since_start) data.T.bottomRows(n).rowwise() -= day.T_C.row(0);
    data.y.tail(n) = day.drift.log.values.col(channel);
    // 1000 labels for each day separate the runs of different days.
    for (const int cycle : day.cycle) data.run.push_back(1000 * int(d) + cycle);
  }
  return data;
}

double value_range(const VectorXd& v) { return v.maxCoeff() - v.minCoeff(); }

std::vector<std::string> input_names(const std::vector<int>& inputs,
                                     const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : inputs) result.push_back(names[std::size_t(i)]);
  return result;
}

/// Returns the warnings about a channel.
std::vector<std::string> channel_warnings(const ChannelGrade& channel) {
  std::vector<std::string> warnings;
  if (!channel.fitted.model) return warnings;
  if (channel.fitted.regression)
    for (Index k = 0; k < channel.fitted.regression->vif.size(); ++k)
      // 10 is the usual limit of variance inflation: coefficients above it are hardly determined.
      if (const double vif = channel.fitted.regression->vif[k]; vif > 10.0)
        warnings.push_back(fmt::format(
            "{} is nearly collinear with the other chosen sensors on the training day (VIF {:.0f})",
            channel.fitted.model->names[std::size_t(k)], vif));
  for (const DayGrade& day : channel.other_days)
    if (day.outside > 0)
      warnings.push_back(fmt::format(
          "{}: {} of {} rows are outside the training range; a compensator would reject them",
          day.day, day.outside, day.rows));
  return warnings;
}

/// Fits a channel on the first day and grades the model on the other days.
ChannelGrade grade_channel(const std::vector<DriftDay>& days, Index c,
                           const std::vector<int>& chosen,
                           const identification::ThermalStudyOptions& options, bool since_start) {
  const identification::Recipe recipe{options.features, options.model};
  const ThermalData training =
      identification::select_inputs(channel_data(days, 0, 1, c, since_start), chosen);
  const ThermalData training_features = identification::with_features(training, recipe.features);
  const errors::metrology::DriftTest& drift = days.front().drift;
  ChannelGrade channel{drift.log.names[std::size_t(c)],
                       bool(drift.angle[std::size_t(c)]),
                       value_range(training.y),
                       identification::fit(training_features, recipe.model),
                       {},
                       {}};
  if (!channel.fitted.model) return channel;
  // Residual of the fit on its own training data.
  channel.training_residual = identification::spread(
      training_features.y - identification::values(*channel.fitted.model, training_features.T));
  for (std::size_t d = 1; d < days.size(); ++d) {
    const ThermalData test =
        identification::select_inputs(channel_data(days, d, d + 1, c, since_start), chosen);
    const identification::Validation validation =
        identification::validate_on(training, test, recipe);
    channel.other_days.push_back({days[d].day, validation.overall, value_range(test.y),
                                  validation.rows, validation.outside});
  }
  return channel;
}

/// Returns the displacements among the channels, or those with given names. Sensors are chosen for
/// them.
/// @throws std::invalid_argument for a name that no displacement has
std::vector<Index> displacements(const DriftDay& day, const std::vector<std::string>& names = {}) {
  std::vector<Index> result;
  for (std::size_t c = 0; c < day.drift.angle.size(); ++c)
    if (!day.drift.angle[c] &&
        (names.empty() || std::ranges::count(names, day.drift.log.names[c]) > 0))
      result.push_back(Index(c));
  if (!names.empty() && result.size() != names.size())
    throw std::invalid_argument(
        "expected displacements of the drift, seen a different one in `for`");
  return result;
}

/// Returns the data of all displacements over the days `from` to `to` - 1.
std::vector<ThermalData> displacement_data(const std::vector<DriftDay>& days, std::size_t from,
                                           std::size_t to, bool since_start) {
  std::vector<ThermalData> result;
  for (const Index c : displacements(days.front()))
    result.push_back(channel_data(days, from, to, c, since_start));
  return result;
}

/// Appends the drift of a channel on every day, as read and as predicted.
void append_series(std::vector<DriftSeries>& list, const std::vector<DriftDay>& days, Index c,
                   const std::vector<int>& chosen, const ChannelGrade& channel,
                   const identification::ThermalFeatures& features, bool since_start) {
  if (!channel.fitted.model) return;
  for (std::size_t d = 0; d < days.size(); ++d) {
    const ThermalData data = identification::with_features(
        identification::select_inputs(channel_data(days, d, d + 1, c, since_start), chosen),
        features);
    list.push_back({days[d].day, channel.name, channel.angle,
                    (days[d].drift.log.time_s.array() - days[d].drift.log.time_s[0]) / 3600.0,
                    data.y, identification::values(*channel.fitted.model, data.T)});
  }
}

using Method = SensorChoiceDescription::SelectionMethod;

/// Returns true if the similarity compares areas, which depend on the unit of the drift.
bool uses_area_comparison(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  return choice.similarity_measure == identification::SimilarityMeasure::Grey &&
         (choice.grey.kind == GreyKind::Absolute || choice.grey.kind == GreyKind::Comprehensive);
}

/// Returns the row at which the degree of each displacement starts.
std::vector<DegreeStart> degree_starts(const DriftDay& day, const std::vector<Index>& channels,
                                       const identification::SensorChoice& choice) {
  std::vector<DegreeStart> starts;
  const errors::metrology::DriftLog& log = day.drift.log;
  for (std::size_t e = 0; e < choice.first_row.size(); ++e) {
    starts.push_back({log.names[std::size_t(channels[e])], {}});
    if (const auto row = choice.first_row[e])
      starts.back().at = {*row, log.time_s[*row] - log.time_s[0], log.values(*row, channels[e])};
  }
  return starts;
}

/// Chooses sensors by one method on the first day. Area comparisons treat drift and temperature as
/// plain numbers, so the drift is in um for them, as in the papers.
SensorChoiceGrade choose_by_method(const std::vector<DriftDay>& days, const Method& method,
                                   bool since_start) {
  // In standard deviations of the noise. A smaller drift counts as none.
  constexpr double min_drift_ratio = 4.0;
  identification::SensorChoiceOptions options = method.choice;
  const bool divides_by_start = identification::is_divided_by_start(options);
  const double unit = uses_area_comparison(options) ? units::um : 1.0;
  const std::vector<Index> channels = displacements(days.front(), method.drifts);
  SensorChoiceGrade result;
  result.way = method;
  result.since_start = since_start && !divides_by_start;
  std::vector<ThermalData> training;
  for (const Index c : channels) {
    training.push_back(channel_data(days, 0, 1, c, result.since_start));
    training.back().y /= unit;
    options.min_start.push_back(min_drift_ratio * days.front().noise[std::size_t(c)] / unit);
  }
  result.choice = identification::choose_sensors(training, options);
  const identification::SensorChoice& choice = result.choice;
  if (choice.status == identification::GreyStatus::StartsAtZero && choice.input < 0)
    throw std::invalid_argument("no displacement drifts by more than its noise");
  if (choice.status != identification::GreyStatus::Ok)
    throw std::invalid_argument(fmt::format(
        "{} ({})", identification::to_string(choice.status),
        choice.input < 0 ? "the drift" : training.front().names[std::size_t(choice.input)]));
  result.chosen = input_names(choice.chosen, days.front().sensors);
  if (options.fixed.empty()) {
    identification::ChoiceSpreadOptions spread;
    spread.input_noise = days.front().sensor_noise_K;
    for (const Index c : channels)
      spread.error_noise.push_back(days.front().noise[std::size_t(c)] / unit);
    result.spread = identification::choice_spread(training, options, choice, spread);
  }
  if (divides_by_start) result.begins = degree_starts(days.front(), channels, choice);
  return result;
}

/// Grades the models of a selection on all days, and the selection among random ones.
SensorChoiceGrade grade_selection(const std::vector<DriftDay>& logs, SensorChoiceGrade grade,
                                  identification::ThermalStudyOptions options, bool since_start) {
  // The sensors are now fixed; only models are fitted.
  options.choice.fixed = grade.chosen;
  if (logs.size() > 1) {
    const auto study = identification::study_sensors(
        displacement_data(logs, 0, 1, since_start),
        displacement_data(logs, 1, logs.size(), since_start), options);
    grade.rms_over_range = study.rms_over_range;
    if (options.random_subsets > 0) grade.random = study.random;
  }
  for (Index c = 0; c < logs.front().drift.log.values.cols(); ++c)
    grade.channels.push_back(grade_channel(logs, c, grade.choice.chosen, options, since_start));
  return grade;
}

/// Compares all selections of as many sensors as the first with its random selections.
void compare_with_random(std::vector<SensorChoiceGrade>& grades) {
  const std::optional<identification::RandomChoices> random = grades.front().random;
  if (!random || random->rms_over_range.empty()) return;
  for (SensorChoiceGrade& grade : grades) {
    if (grade.chosen.size() != grades.front().chosen.size() || !grade.rms_over_range) continue;
    grade.random = random;
    const auto worse = std::ranges::count_if(
        random->rms_over_range, [&](double rms) { return *grade.rms_over_range < rms; });
    grade.random->fraction_beaten = double(worse) / double(random->rms_over_range.size());
  }
}

/// Adds warnings if an order or a choice may be due to chance.
void add_chance_warnings(const SensorChoiceGrade& grade, std::vector<std::string>& warnings) {
  // A choice counts as chance if fewer than 90 % of the draws agree, or if it is better than fewer
  // than 75 % of the random choices.
  constexpr double min_same_fraction = 0.9, min_fraction_beaten = 0.75;
  const std::string name = grade.way.name.empty() ? "the choice" : grade.way.name;
  if (grade.spread && grade.spread->draws > 0 && grade.spread->same_fraction < min_same_fraction)
    warnings.push_back(fmt::format(
        "{}: {:.0f} % of {} draws of start row (0 to {}) and noise choose these sensors; their "
        "order is random",
        name, 100.0 * grade.spread->same_fraction, grade.spread->draws, grade.spread->last_start));
  if (grade.random && grade.random->fraction_beaten < min_fraction_beaten)
    warnings.push_back(fmt::format(
        "{}: on unseen days it leaves {:.1f} % of the range, random choices of {} sensors {:.1f} % "
        "(median): it is better than only {:.0f} % of them, which is not significant",
        name, 100.0 * *grade.rms_over_range, grade.chosen.size(), 100.0 * grade.random->p50,
        100.0 * grade.random->fraction_beaten));
}

}  // namespace

ThermalSensorChoice choose_thermal_sensors(const std::vector<DayReadings>& days,
                                           const SensorChoiceDescription& description) {
  std::vector<DriftDay> logs;
  for (const DayReadings& day : days) logs.push_back(drift_day(day));
  identification::ThermalStudyOptions options = description.study;
  // Drift and temperatures refer to the start of the day, not to that of each cycle.
  const bool since_start = std::exchange(options.features.since_start, false);
  const DriftDay& training = logs.front();
  ThermalSensorChoice result{
      training.day, training.drift.log.time_s.size(), training.sensors, {}, {}, {}};
  std::vector<Method> methods{{"", options.choice, {}}};
  methods.insert(methods.end(), description.compared_methods.begin(),
                 description.compared_methods.end());
  try {
    for (const Method& method : methods) {
      result.ways.push_back(
          grade_selection(logs, choose_by_method(logs, method, since_start), options, since_start));
      options.random_subsets = 0;  // the random selections of the first method serve all
    }
  } catch (const std::invalid_argument& exception) {
    throw BadInput(days.front().file.string(), 0, 0, "sensors to choose from", exception.what());
  }
  compare_with_random(result.ways);
  const SensorChoiceGrade& first = result.ways.front();
  result.warnings = channel_warnings(first.channels.front());
  for (const SensorChoiceGrade& grade : result.ways) add_chance_warnings(grade, result.warnings);
  for (std::size_t c = 0; c < first.channels.size(); ++c)
    append_series(result.series, logs, Index(c), first.choice.chosen, first.channels[c],
                  options.features, since_start);
  return result;
}

}  // namespace abbe::sim
