#include "errors/identification/thermal_epochs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::errors::identification {

// The readings of a day by epoch, then Yang's composite element, which is fitted to runs along an
// axis at several temperatures.

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using kinematics::Motion;
using metrology::Measurement;
using metrology::Readings;
using metrology::SetUp;

constexpr std::size_t max_epochs = 200;

Epoch empty_epoch() { return {INFINITY, -INFINITY}; }

/// Extends an epoch so that it contains a time.
void extend(Epoch& epoch, double time_s) {
  epoch.from_s = std::min(epoch.from_s, time_s);
  epoch.to_s = std::max(epoch.to_s, time_s);
}

/// Returns one epoch per start: the time over which all instruments read.
std::vector<Epoch> epochs_by_start(const std::vector<DayLog>& logs, int start_count) {
  std::vector<Epoch> epochs(std::size_t(start_count), empty_epoch());
  for (const DayLog& log : logs) {
    // An instrument with a single start reads through the day and does not determine the epochs.
    if (log.start_count == 1) continue;
    if (log.start_count != start_count)
      throw std::invalid_argument(fmt::format(
          "expected the same number of starts (start_h) for every instrument, seen {} and {} of {}",
          start_count, log.start_count, log.readings->plan.instrument));
    for (std::size_t i = 0; i < log.readings->plan.measurements.size(); ++i)
      extend(epochs[std::size_t(log.start_of(i))], log.time_s(i));
  }
  for (std::size_t k = 1; k < epochs.size(); ++k)
    // Overlapping epochs would assign a reading to two thermal states.
    if (!(epochs[k].from_s > epochs[k - 1].to_s))
      throw std::invalid_argument(
          fmt::format("expected each start after all readings of the previous start, seen a start "
                      "at {:.2f} h during readings that last until {:.2f} h",
                      epochs[k].from_s / 3600.0, epochs[k - 1].to_s / 3600.0));
  return epochs;
}

/// Returns one epoch per instant, or per group of instants if there are too many.
std::vector<Epoch> epochs_by_instant(const std::vector<DayLog>& logs) {
  std::set<double> instants;
  for (const DayLog& log : logs)
    for (const Measurement& measurement : log.readings->plan.measurements)
      instants.insert(measurement.state.time_s);
  // Neighbouring instants are combined to keep the number of epochs within the limit.
  const std::size_t group_size = (instants.size() + max_epochs - 1) / max_epochs;
  std::vector<Epoch> epochs;
  std::size_t count = 0;
  for (const double instant : instants) {
    if (count++ % group_size == 0) epochs.push_back(empty_epoch());
    extend(epochs.back(), instant);
  }
  return epochs;
}

/// Position at which a channel reads, with the direction of approach. The angle of the spindle is
/// ignored.
struct MeasuringPoint {
  std::string set_up;
  int channel = 0;
  std::vector<double> positions;  ///< position and direction of approach of each axis in turn
  auto operator<=>(const MeasuringPoint&) const = default;
};

MeasuringPoint measuring_point(const Readings& readings, const Measurement& measurement) {
  MeasuringPoint point{
      readings.plan.set_ups[std::size_t(measurement.set_up)].name, measurement.channel, {}};
  const auto& joints = readings.nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].motion == Motion::Spindle) continue;
    point.positions.push_back(measurement.state.q[Index(j)]);
    point.positions.push_back(measurement.state.direction[j]);
  }
  return point;
}

struct Mean {
  double sum = 0.0;
  int count = 0;
  double value() const { return sum / count; }
};
using Means = std::map<MeasuringPoint, Mean>;

/// Returns true if a measurement has a reading of a channel, false if it has only temperatures.
bool has_value(const Readings& readings, const Measurement& measurement) {
  return measurement.channel >= 0 && readings.value.size() > 0;
}

/// Returns the mean reading of every measuring point over an epoch.
Means point_means(const DayLog& log, const Epoch& epoch) {
  Means means;
  for (std::size_t i = 0; i < log.readings->plan.measurements.size(); ++i) {
    const Measurement& measurement = log.readings->plan.measurements[i];
    if (!has_value(*log.readings, measurement) || !epoch.contains(log.time_s(i))) continue;
    Mean& mean = means[measuring_point(*log.readings, measurement)];
    mean.sum += log.readings->value[Index(i)];
    ++mean.count;
  }
  return means;
}

/// Returns the set-up of a difference of two readings: errors of a permanent set-up cancel, those
/// of a repeated set-up add up.
SetUp difference_set_up(SetUp set_up, bool is_permanent) {
  // The difference of two independent readings has the variance of both.
  const double root_of_two = std::sqrt(2.0);
  for (auto& channel : set_up.channels) {
    channel.noise *= root_of_two;
    channel.resolution *= root_of_two;
  }
  const double repeat_factor = is_permanent ? 0.0 : root_of_two;
  for (double* sigma :
       {&set_up.rotation_sigma, &set_up.point_of_sigma, &set_up.point_in_sigma,
        &set_up.normal_sigma, &set_up.eccentricity_sigma, &set_up.scale_sigma, &set_up.drift_sigma})
    *sigma *= repeat_factor;
  if (is_permanent) set_up.is_zero_unknown = false;
  return set_up;
}

/// Returns the nominal readings plus the change since the first epoch: the readings of a machine
/// that was perfect then.
Readings readings_since_first(const DayLog& log, const Epoch& epoch, const Means& first) {
  const Readings& original = *log.readings;
  Readings result{
      {original.plan.instrument, original.plan.kind, {}, {}, 0.0}, original.nominal, {}, {}, {}};
  std::map<int, int> new_set_up_index;  // by old index
  std::vector<double> values;
  for (std::size_t i = 0; i < original.plan.measurements.size(); ++i) {
    Measurement measurement = original.plan.measurements[i];
    if (!has_value(original, measurement) || !epoch.contains(measurement.state.time_s)) continue;
    const auto reference = first.find(measuring_point(original, measurement));
    // A point that was not read in the first epoch has no reference.
    if (reference == first.end()) continue;
    const SetUp& set_up = original.plan.set_ups[std::size_t(measurement.set_up)];
    const auto bodies = metrology::nominal_bodies(original.nominal, measurement.state.q);
    values.push_back(
        original.value[Index(i)] - reference->second.value() +
        metrology::reading(set_up, measurement.channel, {}, bodies, bodies,
                           metrology::spindle_angle(original.nominal, measurement.state)));
    const auto [entry, is_new] =
        new_set_up_index.emplace(measurement.set_up, int(result.plan.set_ups.size()));
    // Only set-ups with readings in this epoch enter the plan, so their indices change.
    if (is_new) result.plan.set_ups.push_back(difference_set_up(set_up, log.start_count == 1));
    measurement.set_up = entry->second;
    result.plan.measurements.push_back(measurement);
  }
  if (values.empty())
    throw std::invalid_argument(fmt::format(
        "expected readings of {} in every epoch as in the first, seen none from {:.2f} to {:.2f} h",
        original.plan.instrument, epoch.from_s / 3600.0, epoch.to_s / 3600.0));
  result.value = Eigen::Map<const VectorXd>(values.data(), Index(values.size()));
  return result;
}

}  // namespace

std::vector<int> start_indices(const metrology::Plan& plan) {
  std::vector<int> indices;
  std::map<std::string, int> occurrences;
  // A set-up of the same name appears once per start, so its occurrences number the starts.
  for (const SetUp& set_up : plan.set_ups) indices.push_back(occurrences[set_up.name]++);
  return indices;
}

std::vector<Readings> split_by_start(const Readings& readings) {
  const std::vector<int> start_index = start_indices(readings.plan);
  const metrology::Plan& plan = readings.plan;
  std::vector<Readings> result;
  std::vector<int> index_in_start;  // (set-ups)
  for (std::size_t s = 0; s < start_index.size(); ++s) {
    const auto k = std::size_t(start_index[s]);
    if (k == result.size())
      result.push_back(
          {{plan.instrument, plan.kind, {}, {}, 0.0}, readings.nominal, {}, readings.sensors, {}});
    index_in_start.push_back(int(result[k].plan.set_ups.size()));
    result[k].plan.set_ups.push_back(plan.set_ups[s]);
  }
  std::vector<std::vector<Index>> rows(result.size());
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const auto s = std::size_t(plan.measurements[i].set_up), k = std::size_t(start_index[s]);
    rows[k].push_back(Index(i));
    result[k].plan.measurements.push_back(plan.measurements[i]);
    result[k].plan.measurements.back().set_up = index_in_start[s];
  }
  for (std::size_t k = 0; k < result.size(); ++k) {
    if (readings.value.size() > 0) result[k].value = readings.value(rows[k]);
    result[k].T_C = readings.T_C(rows[k], Eigen::all);
  }
  return result;
}

std::vector<Index> sensor_columns(const std::vector<std::string>& sensors,
                                  const std::vector<std::string>& logged) {
  std::vector<Index> columns;
  for (const std::string& name : sensors) {
    const auto position = std::ranges::find(logged, name);
    if (position == logged.end())
      throw std::invalid_argument("expected a logged sensor, seen " + name);
    columns.push_back(position - logged.begin());
  }
  return columns;
}

MatrixXd temperature_rise_K(std::span<const Readings> readings,
                            const std::vector<std::string>& sensors) {
  const std::vector<Index> columns = sensor_columns(sensors, readings.front().sensors);
  MatrixXd T_C(Index(readings.size()), Index(sensors.size()));
  for (Index i = 0; i < T_C.rows(); ++i)
    for (Index k = 0; k < T_C.cols(); ++k)
      T_C(i, k) = readings[std::size_t(i)].T_C.col(columns[std::size_t(k)]).mean();
  return T_C.rowwise() - T_C.row(0).eval();
}

DayLog day_log(const Readings& readings) {
  DayLog log{&readings, start_indices(readings.plan), 1};
  for (const int start_index : log.start_index)
    log.start_count = std::max(log.start_count, start_index + 1);
  return log;
}

std::vector<Epoch> split_into_epochs(const std::vector<DayLog>& logs) {
  int start_count = 1;
  for (const DayLog& log : logs) start_count = std::max(start_count, log.start_count);
  std::vector<Epoch> epochs =
      start_count > 1 ? epochs_by_start(logs, start_count) : epochs_by_instant(logs);
  if (epochs.size() < 3)
    throw std::invalid_argument(fmt::format(
        "expected readings from at least 3 starts (start_h) or instants, seen {}", epochs.size()));
  return epochs;
}

std::vector<std::vector<Readings>> changes_since_first(const std::vector<DayLog>& logs,
                                                       const std::vector<Epoch>& epochs) {
  std::vector<std::vector<Readings>> changes(epochs.size());
  for (const DayLog& log : logs) {
    if (log.readings->value.size() == 0) continue;
    const Means first = point_means(log, epochs.front());
    for (std::size_t k = 0; k < epochs.size(); ++k)
      changes[k].push_back(readings_since_first(log, epochs[k], first));
  }
  if (changes.front().empty())
    throw std::invalid_argument("expected readings of the machine in addition to the temperatures");
  return changes;
}

std::vector<std::string> common_sensors(const std::vector<DayLog>& logs) {
  std::vector<std::string> common = logs.front().readings->sensors;
  for (const DayLog& log : logs)
    std::erase_if(common, [&](const std::string& name) {
      return std::ranges::count(log.readings->sensors, name) == 0;
    });
  if (common.empty())
    throw std::invalid_argument(
        "expected temperatures in addition to the readings, seen no sensor");
  return common;
}

MatrixXd temperature_rise_K(const std::vector<DayLog>& logs, const std::vector<Epoch>& epochs,
                            const std::vector<std::string>& sensors) {
  MatrixXd sum = MatrixXd::Zero(Index(epochs.size()), Index(sensors.size()));
  VectorXd count = VectorXd::Zero(Index(epochs.size()));
  for (const DayLog& log : logs) {
    const std::vector<Index> columns = sensor_columns(sensors, log.readings->sensors);
    for (std::size_t i = 0; i < log.readings->plan.measurements.size(); ++i) {
      const auto epoch = std::ranges::find_if(
          epochs, [&](const Epoch& candidate) { return candidate.contains(log.time_s(i)); });
      if (epoch == epochs.end()) continue;
      const auto k = Index(epoch - epochs.begin());
      sum.row(k) += log.readings->T_C.row(Index(i))(columns);
      count[k] += 1.0;
    }
  }
  // Every reading has the same weight, whichever instrument took it.
  const MatrixXd mean = sum.array().colwise() / count.array();
  return mean.rowwise() - mean.row(0).eval();
}

bool is_axis_varied(const std::vector<DayLog>& logs, int joint) {
  std::optional<double> previous_position;
  for (const DayLog& log : logs)
    for (const Measurement& measurement : log.readings->plan.measurements) {
      if (!has_value(*log.readings, measurement)) continue;
      if (previous_position && *previous_position != measurement.state.q[joint]) return true;
      previous_position = measurement.state.q[joint];
    }
  return false;
}

// Yang's composite element: a cold curve plus a thermal slope.

namespace {

void validate(const std::vector<CompositeRun>& runs, const CompositeOptions& options) {
  require(!runs.empty(), "a composite model needs at least one run");
  require(options.degree >= 1 && options.degree <= 12,
          "the degree of the cold curve must be from 1 to 12");
  for (const CompositeRun& run : runs) {
    require(run.p.size() == run.delta.size(), "positions and deviations of a run differ in number");
    require(run.dT_K.size() == runs.front().dT_K.size() && run.dT_K.size() >= 1,
            "the runs differ in their temperature sensors");
    require(run.p.allFinite() && run.delta.allFinite() && run.dT_K.allFinite(),
            "a run contains a number that is not finite");
  }
}

double polynomial_value(const VectorXd& c, double p) {
  double value = 0;
  for (Index k = c.size(); k-- > 0;) value = value * p + c(k);
  return value;
}

/// Returns all cold runs combined into one, for the cold curve.
CompositeRun cold_runs(const std::vector<CompositeRun>& runs) {
  CompositeRun combined;
  for (const CompositeRun& run : runs) {
    if (!run.cold) continue;
    VectorXd p(combined.p.size() + run.p.size()), delta(p.size());
    p << combined.p, run.p;
    delta << combined.delta, run.delta;
    combined.p = p;
    combined.delta = delta;
  }
  return combined;
}

/// Fits the cold curve in powers of p / scale, because the fourth power of 500 mm would dwarf the
/// first. Returns false if the positions do not determine it.
bool fit_curve(const CompositeRun& cold, int degree, CompositeFit& fit) {
  const double largest = cold.p.size() ? cold.p.cwiseAbs().maxCoeff() : 0.0;
  fit.curve_scale = largest > 0 ? largest : 1.0;
  MatrixXd powers(cold.p.size(), degree);
  for (Index i = 0; i < cold.p.size(); ++i)
    for (int k = 0; k < degree; ++k) powers(i, k) = std::pow(cold.p(i) / fit.curve_scale, k + 1);
  fit.curve = fit_regression(powers, cold.delta);
  if (fit.curve.status != RegressionStatus::Ok) return false;
  fit.geometric.resize(degree + 1);
  fit.geometric(0) = fit.curve.constant;
  for (int k = 0; k < degree; ++k)
    fit.geometric(k + 1) = fit.curve.beta(k) / std::pow(fit.curve_scale, k + 1);
  return true;
}

/// Subtracts the cold curve from a warm run and fits a straight line to the rest.
Regression fit_slope(const CompositeRun& run, const VectorXd& geometric, bool free_offset) {
  VectorXd thermal_part = run.delta;
  for (Index i = 0; i < thermal_part.size(); ++i)
    thermal_part(i) -= polynomial_value(geometric, run.p(i));
  RegressionOptions options;
  options.constant = free_offset;
  return fit_regression(run.p, thermal_part, options);
}

/// Regresses the slopes of all warm runs on the temperatures.
void fit_temperatures(const std::vector<CompositeRun>& runs, const CompositeOptions& options,
                      CompositeFit& fit) {
  MatrixXd dT(static_cast<Index>(fit.warm_runs.size()), runs.front().dT_K.size());
  for (Index i = 0; i < dT.rows(); ++i)
    dT.row(i) = runs[static_cast<std::size_t>(fit.warm_runs[static_cast<std::size_t>(i)])].dT_K;
  RegressionOptions regression;
  regression.constant = options.slope_constant;
  fit.slope_fit = fit_regression(dT, fit.slope, regression);
  if (fit.slope_fit.status != RegressionStatus::Ok) {
    fit.status = CompositeStatus::SlopeNotDetermined;
    return;
  }
  fit.thermal = fit.slope_fit.beta;
  fit.thermal_constant = fit.slope_fit.constant;
}

/// Returns the RMS residual of all readings about the composite law with offsets.
double composite_rms(const std::vector<CompositeRun>& runs, const CompositeFit& fit) {
  double squares = 0;
  Index rows = 0, warm_run_index = 0;
  for (const CompositeRun& run : runs) {
    const double offset = run.cold ? 0.0 : fit.offset(warm_run_index++);
    for (Index i = 0; i < run.p.size(); ++i) {
      // A cold run has dT = 0, and the constant of the slope applies to warm runs only.
      const double thermal = run.cold ? 0.0 : fit.thermal_constant + fit.thermal.dot(run.dT_K);
      const double predicted_delta =
          polynomial_value(fit.geometric, run.p(i)) + thermal * run.p(i) + offset;
      squares += (run.delta(i) - predicted_delta) * (run.delta(i) - predicted_delta);
    }
    rows += run.p.size();
  }
  return std::sqrt(squares / static_cast<double>(rows));
}

/// Stores the indices of the warm runs in `fit`. Returns Ok, or the first reason why the cold curve
/// and the thermal slope cannot be separated; then `fit.run` is the run that causes it, if there is
/// one.
CompositeStatus classify_runs(const std::vector<CompositeRun>& runs, CompositeFit& fit) {
  bool has_cold_run = false;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!runs[i].cold) {
      fit.warm_runs.push_back(static_cast<int>(i));
      continue;
    }
    has_cold_run = true;
    if (!runs[i].dT_K.isZero(0)) {
      fit.run = static_cast<int>(i);
      return CompositeStatus::ColdRunNotCold;
    }
  }
  if (!has_cold_run) return CompositeStatus::NoColdRun;
  return fit.warm_runs.empty() ? CompositeStatus::NoLaterRun : CompositeStatus::Ok;
}

}  // namespace

CompositeFit fit_composite(const std::vector<CompositeRun>& runs, const CompositeOptions& options) {
  validate(runs, options);
  CompositeFit fit;
  fit.status = classify_runs(runs, fit);
  if (fit.status != CompositeStatus::Ok) return fit;
  if (!fit_curve(cold_runs(runs), options.degree, fit)) {
    fit.status = CompositeStatus::CurveNotDetermined;
    return fit;
  }
  const auto count = static_cast<Index>(fit.warm_runs.size());
  fit.slope = fit.slope_standard_error = fit.offset = VectorXd::Zero(count);
  for (Index i = 0; i < count; ++i) {
    const int index = fit.warm_runs[static_cast<std::size_t>(i)];
    const Regression line =
        fit_slope(runs[static_cast<std::size_t>(index)], fit.geometric, options.free_offset);
    if (line.status != RegressionStatus::Ok) {
      fit.status = CompositeStatus::SlopeNotDetermined;
      fit.run = index;
      return fit;
    }
    fit.slope(i) = line.beta(0);
    // The constant, if fitted, comes first; the slope is last.
    fit.slope_standard_error(i) = line.standard_error(line.standard_error.size() - 1);
    fit.offset(i) = line.constant;
  }
  fit_temperatures(runs, options, fit);
  if (fit.status == CompositeStatus::Ok) fit.rms = composite_rms(runs, fit);
  return fit;
}

double value(const CompositeFit& fit, double p, const VectorXd& dT_K) {
  return polynomial_value(fit.geometric, p) + (fit.thermal_constant + fit.thermal.dot(dT_K)) * p;
}

}  // namespace abbe::errors::identification
