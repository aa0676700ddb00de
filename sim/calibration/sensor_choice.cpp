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

/// The readings of one day: the drift channels and the temperatures.
struct Log {
  std::string day;
  errors::metrology::DriftTest drift;
  std::vector<double> noise;  ///< (channels) mm or rad, standard deviation of one drift
  std::vector<std::string> sensors;
  Eigen::MatrixXd T_C;      ///< (n x sensors)
  std::vector<int> cycle;   ///< (n) number of the cycle of work and rest, from 0
  VectorXd sensor_noise_K;  ///< (sensors)
};

/// Returns the standard deviation of a drift: noise and rounding of a reading and of the first one,
/// from which the drift counts. Rounding is uniform over the resolution r, with variance r^2 / 12.
std::vector<double> drift_noise(const errors::metrology::Readings& readings) {
  std::vector<double> noise;
  for (const auto& channel : readings.plan.set_ups.front().channels)
    noise.push_back(std::sqrt(
        2.0 * (channel.noise * channel.noise + channel.resolution * channel.resolution / 12.0)));
  return noise;
}

Log log_of(const DayReadings& day) {
  const errors::metrology::Readings& readings = day.readings;
  if (readings.sensors.size() < 2)
    throw BadInput(day.file.string(), 0, 0, "at least 2 temperature sensors", "fewer");
  errors::metrology::Tests tests = classify_readings(readings);
  Log log{day.name,
          std::move(tests.drifts.at(0)),
          drift_noise(readings),
          readings.sensors,
          {},
          {},
          day.sensor_noise_K.size() > 0 ? day.sensor_noise_K
                                        : VectorXd(VectorXd::Zero(Index(readings.sensors.size())))};
  const Index n = log.drift.log.time_s.size(), channels = log.drift.log.values.cols();
  const std::vector<double>& starts = day.cycle_starts_s;
  log.T_C.resize(n, readings.T_C.cols());
  for (Index i = 0; i < n; ++i) {
    // the channels of a row share one temperature
    log.T_C.row(i) = readings.T_C.row(i * channels);
    const auto next =
        // 1e-6 s: a cycle that starts with a reading includes it
        std::upper_bound(starts.begin(), starts.end(), log.drift.log.time_s[i] + 1e-6);
    log.cycle.push_back(std::max(0, int(next - starts.begin()) - 1));
  }
  return log;
}

/// Returns the rows of one channel over some days, each of their cycles as a run. Drift and, if
/// wanted, temperatures count from the first reading of the day.
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
    // 1000 cycles a day keep the runs of the days apart
    for (const int cycle : day.cycle) data.run.push_back(1000 * int(d) + cycle);
  }
  return data;
}

double range_of(const VectorXd& v) { return v.maxCoeff() - v.minCoeff(); }

std::vector<std::string> names_of(const std::vector<int>& inputs,
                                  const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : inputs) result.push_back(names[std::size_t(i)]);
  return result;
}

/// Returns the warnings about a channel.
std::vector<std::string> warnings_of(const ChannelGrade& channel) {
  std::vector<std::string> warnings;
  if (!channel.fitted.model) return warnings;
  if (channel.fitted.regression)
    for (Index k = 0; k < channel.fitted.regression->vif.size(); ++k)
      // A variance inflation factor above 10 is the usual limit of collinearity: the coefficients
      // are then hardly determined.
      if (const double vif = channel.fitted.regression->vif[k]; vif > 10.0)
        warnings.push_back(fmt::format(
            "{} says nearly what the other chosen sensors say on the training day (VIF {:.0f})",
            channel.fitted.model->names[std::size_t(k)], vif));
  for (const DayGrade& day : channel.other_days)
    if (day.outside > 0)
      warnings.push_back(fmt::format(
          "{}: {} of {} rows lie outside the trained range; a compensator would refuse them",
          day.day, day.outside, day.rows));
  return warnings;
}

// Fits a channel on the first day and grades it on the others.
ChannelGrade channel_of(const std::vector<Log>& days, Index c, const std::vector<int>& chosen,
                        const identification::ThermalStudyOptions& options, bool since_start) {
  const identification::Recipe recipe{options.features, options.model};
  const ThermalData training =
      identification::select_inputs(data_of(days, 0, 1, c, since_start), chosen);
  const ThermalData seen = identification::with_features(training, recipe.features);
  const errors::metrology::DriftTest& drift = days.front().drift;
  ChannelGrade channel{drift.log.names[std::size_t(c)],
                       bool(drift.angle[std::size_t(c)]),
                       range_of(training.y),
                       identification::fit(seen, recipe.model),
                       {},
                       {}};
  if (!channel.fitted.model) return channel;
  // the residual of the fit itself, with no day unseen
  channel.in_cycle =
      identification::spread(seen.y - identification::values(*channel.fitted.model, seen.T));
  for (std::size_t d = 1; d < days.size(); ++d) {
    const ThermalData test =
        identification::select_inputs(data_of(days, d, d + 1, c, since_start), chosen);
    const identification::Validation graded = identification::validate_on(training, test, recipe);
    channel.other_days.push_back(
        {days[d].day, graded.overall, range_of(test.y), graded.rows, graded.outside});
  }
  return channel;
}

/// Returns the displacements among the channels, or those with the given names; sensors are chosen
/// for these.
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
                   const std::vector<int>& chosen, const ChannelGrade& channel,
                   const identification::ThermalFeatures& features, bool since_start) {
  if (!channel.fitted.model) return;
  for (std::size_t d = 0; d < days.size(); ++d) {
    const ThermalData data = identification::with_features(
        identification::select_inputs(data_of(days, d, d + 1, c, since_start), chosen), features);
    all.push_back({days[d].day, channel.name, channel.angle,
                   (days[d].drift.log.time_s.array() - days[d].drift.log.time_s[0]) / 3600.0,
                   data.y, identification::values(*channel.fitted.model, data.T)});
  }
}

// Selection methods

using Way = SensorChoiceDescription::Way;

// Returns true if the similarity compares areas, which depend on the unit of the drift.
bool uses_area_comparison(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  return choice.similarity_measure == identification::SimilarityMeasure::Grey &&
         (choice.grey.kind == GreyKind::Absolute || choice.grey.kind == GreyKind::Comprehensive);
}

/// Returns the row from which the degree of each displacement starts.
std::vector<DegreeStart> degree_starts(const Log& day, const std::vector<Index>& channels,
                                       const identification::SensorChoice& choice) {
  std::vector<DegreeStart> begins;
  const errors::metrology::DriftLog& log = day.drift.log;
  for (std::size_t e = 0; e < choice.first_row.size(); ++e) {
    begins.push_back({log.names[std::size_t(channels[e])], {}});
    if (const auto row = choice.first_row[e])
      begins.back().at = {*row, log.time_s[*row] - log.time_s[0], log.values(*row, channels[e])};
  }
  return begins;
}

// Area comparisons treat drift and temperature as plain numbers, so the drift is in um, as in the
// papers.
SensorChoiceGrade chosen_by(const std::vector<Log>& days, const Way& way, bool since_start) {
  constexpr double beyond_noise = 4.0;  // standard deviations of the noise, below which a drift is
                                        // taken as none
  identification::SensorChoiceOptions options = way.choice;
  const bool by_start = identification::is_divided_by_start(options);
  const double unit = uses_area_comparison(options) ? units::um : 1.0;
  const std::vector<Index> channels = displacements(days.front(), way.drifts);
  SensorChoiceGrade result;
  result.way = way;
  result.since_start = since_start && !by_start;
  std::vector<ThermalData> training;
  for (const Index c : channels) {
    training.push_back(data_of(days, 0, 1, c, result.since_start));
    training.back().y /= unit;
    options.min_start.push_back(beyond_noise * days.front().noise[std::size_t(c)] / unit);
  }
  result.choice = identification::choose_sensors(training, options);
  const identification::SensorChoice& choice = result.choice;
  if (choice.status == identification::GreyStatus::StartsAtZero && choice.input < 0)
    throw std::invalid_argument("no displacement drifts beyond its noise");
  if (choice.status != identification::GreyStatus::Ok)
    throw std::invalid_argument(fmt::format(
        "{} ({})", identification::to_string(choice.status),
        choice.input < 0 ? "the drift" : training.front().names[std::size_t(choice.input)]));
  result.chosen = names_of(choice.chosen, days.front().sensors);
  if (options.fixed.empty()) {
    identification::ChoiceSpreadOptions spread;
    spread.input_noise = days.front().sensor_noise_K;
    for (const Index c : channels)
      spread.error_noise.push_back(days.front().noise[std::size_t(c)] / unit);
    result.spread = identification::choice_spread(training, options, choice, spread);
  }
  if (by_start) result.begins = degree_starts(days.front(), channels, choice);
  return result;
}

/// Grades a selection on all days: its channels, and its rank among random selections.
SensorChoiceGrade graded(const std::vector<Log>& logs, SensorChoiceGrade way,
                         identification::ThermalStudyOptions options, bool since_start) {
  // the sensors are fixed now; only the models are fitted
  options.choice.fixed = way.chosen;
  if (logs.size() > 1) {
    const auto study = identification::study_sensors(
        all_data(logs, 0, 1, since_start), all_data(logs, 1, logs.size(), since_start), options);
    way.rms_over_range = study.rms_over_range;
    if (options.random_subsets > 0) way.random = study.random;
  }
  for (Index c = 0; c < logs.front().drift.log.values.cols(); ++c)
    way.channels.push_back(channel_of(logs, c, way.choice.chosen, options, since_start));
  return way;
}

/// Compares the other selections with the random ones of the first; these also apply to any
/// selection of as many sensors.
void compare_with_random(std::vector<SensorChoiceGrade>& ways) {
  const std::optional<identification::RandomChoices> random = ways.front().random;
  if (!random || random->rms_over_range.empty()) return;
  for (SensorChoiceGrade& way : ways) {
    if (way.chosen.size() != ways.front().chosen.size() || !way.rms_over_range) continue;
    way.random = random;
    const auto worse = std::ranges::count_if(random->rms_over_range,
                                             [&](double rms) { return *way.rms_over_range < rms; });
    way.random->fraction_beaten = double(worse) / double(random->rms_over_range.size());
  }
}

/// Adds warnings where an order or a choice may be due to chance.
void add_chance_warnings(const SensorChoiceGrade& way, std::vector<std::string>& warnings) {
  // A choice made in fewer than 90 % of the draws, or better than fewer than 75 % of the random
  // choices, counts as chance.
  constexpr double certain = 0.9, better = 0.75;
  const std::string name = way.way.name.empty() ? "the choice" : way.way.name;
  if (way.spread && way.spread->draws > 0 && way.spread->same < certain)
    warnings.push_back(fmt::format(
        "{}: {:.0f} % of {} draws of start row (0 to {}) and noise choose these sensors; their "
        "order is one of chance",
        name, 100.0 * way.spread->same, way.spread->draws, way.spread->last_start));
  if (way.random && way.random->fraction_beaten < better)
    warnings.push_back(fmt::format(
        "{}: on days unseen it leaves {:.1f} % of the range, random choices of {} sensors {:.1f} % "
        "(median): it is better than {:.0f} % of them, which is chance",
        name, 100.0 * *way.rms_over_range, way.chosen.size(), 100.0 * way.random->p50,
        100.0 * way.random->fraction_beaten));
}

}  // namespace

ThermalChoice thermal_choice(const std::vector<DayReadings>& days,
                             const SensorChoiceDescription& description) {
  std::vector<Log> logs;
  for (const DayReadings& day : days) logs.push_back(log_of(day));
  identification::ThermalStudyOptions options = description.study;
  // drift and temperatures count from the start of the day, not from that of each cycle
  const bool since_start = std::exchange(options.features.since_start, false);
  const Log& training = logs.front();
  ThermalChoice result{
      training.day, training.drift.log.time_s.size(), training.sensors, {}, {}, {}};
  std::vector<Way> ways{{"", options.choice, {}}};
  ways.insert(ways.end(), description.beside.begin(), description.beside.end());
  try {
    for (const Way& way : ways) {
      result.ways.push_back(graded(logs, chosen_by(logs, way, since_start), options, since_start));
      options.random_subsets = 0;  // the first is compared with them
    }
  } catch (const std::invalid_argument& fault) {
    throw BadInput(days.front().file.string(), 0, 0, "sensors that can be chosen from",
                   fault.what());
  }
  compare_with_random(result.ways);
  const SensorChoiceGrade& own = result.ways.front();
  result.warnings = warnings_of(own.channels.front());
  for (const SensorChoiceGrade& way : result.ways) add_chance_warnings(way, result.warnings);
  for (std::size_t c = 0; c < own.channels.size(); ++c)
    append_series(result.series, logs, Index(c), own.choice.chosen, own.channels[c],
                  options.features, since_start);
  return result;
}

}  // namespace abbe::sim
