#include "errors/metrology/reading_diagnostics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double min_probability = 1e-9;  // less probable readings are an error, not chance
constexpr double large_mm = 1.0, large_rad = 0.01;  // deviations that no machine has
constexpr double error_factor =
    10.0;  // on this limit; larger deviations are an error, not a warning
// Numbers of readings; fewer can be equal, or have little scatter, by chance.
constexpr int min_equal = 5, min_equal_in_a_row = 4, min_scattered = 20;

double deviation_limit(bool is_angle) { return is_angle ? large_rad : large_mm; }

std::string size_text(double value, bool is_angle) {
  return is_angle ? fmt::format("{:.4g} mrad", value / (1e3 * units::urad))
                  : fmt::format("{:.4g} mm", value);
}

std::string noise_text(double value, bool is_angle) {
  return fmt::format("{:.3g} {}", value / (is_angle ? units::urad : units::um),
                     is_angle ? "urad" : "um");
}

/// Returns an upper bound of the probability that a reading with this noise equals the previous one
/// after rounding.
double repetition_chance(double noise, double resolution) {
  if (noise <= 0.0) return 1.0;
  return std::erf(0.5 * resolution / (noise * std::sqrt(2.0)));
}

/// Returns the index of the first reading and the length of the longest sequence of equal readings.
std::pair<Index, Index> longest_equal_run(const VectorXd& values) {
  Index first = 0, count = values.size() > 0 ? 1 : 0;
  for (Index from = 0, i = 1; i <= values.size(); ++i) {
    if (i < values.size() && values[i] == values[from]) continue;
    if (i - from > count) first = from, count = i - from;
    from = i;
  }
  return {first, count};
}

/// Adds an error or a warning for a channel with constant readings.
void check_changes(const std::string& name, const Channel& channel, const VectorXd& values,
                   ReadingDiagnostics& diagnostics) {
  const auto [first, count] = longest_equal_run(values);
  const Index n = values.size();
  const double chance =
      std::pow(repetition_chance(channel.noise, channel.resolution), double(count - 1));
  if (count == n && n >= min_equal) {
    const std::string text = fmt::format("{}: all {} readings are {}", name, n,
                                         size_text(values[0], channel.is_angle()));
    if (chance < min_probability)
      diagnostics.errors.push_back(text +
                                   fmt::format(", although the channel has {} of noise: check the "
                                               "sensor and how the readings were copied",
                                               noise_text(channel.noise, channel.is_angle())));
    else
      diagnostics.warnings.push_back(text + ": the sensor may be faulty");
  } else if (count >= min_equal_in_a_row && double(n) * chance < min_probability) {
    diagnostics.warnings.push_back(fmt::format(
        "{}: {} consecutive readings are identical, starting with number {}: the sensor was stuck",
        name, count, first + 1));
  }
}

/// Returns the noise of readings along a smooth curve, from their second differences.
double second_difference_noise(const VectorXd& v) {
  const Index n = v.size() - 2;
  // A second difference of white noise has the variance 1 + 4 + 1 = 6.
  return ((v.head(n) - 2.0 * v.segment(1, n) + v.tail(n)).matrix()).norm() /
         std::sqrt(6.0 * double(n));
}

/// Adds a warning for readings that scatter much less than their noise.
void check_scatter(const std::string& name, const Channel& channel, const VectorXd& departure,
                   ReadingDiagnostics& diagnostics) {
  // Relative to the noise. The probability is 1e-7 for 20 readings, of which 9 are independent.
  constexpr double min_scatter_ratio = 0.1;
  if (departure.size() < min_scattered || !(channel.noise > 0.0) ||
      channel.resolution > channel.noise)
    return;
  const double scatter = second_difference_noise(departure);
  if (scatter >= min_scatter_ratio * channel.noise || departure.cwiseAbs().maxCoeff() == 0.0)
    return;
  diagnostics.warnings.push_back(
      fmt::format("{}: readings scatter by {} but the stated noise is {}: check the unit and "
                  "whether they are smoothed",
                  name, noise_text(scatter, channel.is_angle()),
                  noise_text(channel.noise, channel.is_angle())));
}

/// Readings of one channel, with those of the nominal machine.
struct ChannelReadings {
  std::string name;
  const SetUp* set_up = nullptr;
  int channel = 0;
  VectorXd value, nominal;  ///< (n) mm or rad
  double alignment = 0.0;   ///< mm or rad, largest standard deviation of a reading by the set-up's
                            ///< alignment

  const Channel& sensor() const { return set_up->channels[std::size_t(channel)]; }
};

/// Returns the readings minus those of the nominal machine. If the zero is unknown, their median is
/// subtracted, which a few wrong readings do not change.
VectorXd departure_from_nominal(const ChannelReadings& readings, const VectorXd& value) {
  VectorXd departure = value - readings.nominal;
  if (readings.set_up->is_zero_unknown && departure.size() > 0) {
    VectorXd sorted = departure;
    std::sort(sorted.begin(), sorted.end());
    departure.array() -= sorted[sorted.size() / 2];
  }
  return departure;
}

double max_departure(const ChannelReadings& readings, const VectorXd& value) {
  return departure_from_nominal(readings, value).cwiseAbs().maxCoeff();
}

/// Returns the likely cause of a departure: the change that brings the readings within the limit.
std::string likely_cause(const ChannelReadings& readings, double limit) {
  struct Factor {
    double factor;
    const char* cause;
  };
  constexpr std::array factors{
      Factor{-1.0, "their sign is reversed"},
      Factor{1000.0, "they are in m, or too small by a factor of 1000"},
      Factor{1e-3, "they are in um or urad, or too large by a factor of 1000"},
      Factor{units::inch, "they are in inches"}, Factor{units::deg, "they are in degrees"}};
  for (const Factor& candidate : factors)
    if (max_departure(readings, candidate.factor * readings.value) <= limit) return candidate.cause;
  if (max_departure(readings, readings.value.reverse()) <= limit) return "their order is reversed";
  return "check unit, sign, order and columns";
}

/// Adds an error or a warning for readings far from the nominal machine.
void check_departure(const ChannelReadings& readings, ReadingDiagnostics& diagnostics) {
  const Channel& channel = readings.sensor();
  // Five sigmas of the alignment are allowed: a misaligned set-up is not an error of the readings.
  const double allowed = 5.0 * readings.alignment;
  const double limit = deviation_limit(channel.is_angle()) + allowed;
  const double max_magnitude = max_departure(readings, readings.value);
  if (max_magnitude < limit) return;
  const bool is_certain =
      max_magnitude >= error_factor * deviation_limit(channel.is_angle()) + allowed;
  (is_certain ? diagnostics.errors : diagnostics.warnings)
      .push_back(fmt::format("{}: readings deviate by up to {} from the nominal machine: {}",
                             readings.name, size_text(max_magnitude, channel.is_angle()),
                             likely_cause(readings, limit)));
}

/// Returns the largest standard deviation of a channel's readings by the alignment of the set-up.
double alignment_sigma(const Readings& readings, const ChannelMeasurements& measured_channel) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(measured_channel.set_up)];
  const std::vector<SetUpUnknown> unknown_list = unknowns(set_up);
  double largest = 0.0;
  for (const int i : measured_channel.measurements) {
    const kinematics::AxisState& state = readings.plan.measurements[std::size_t(i)].state;
    const VectorXd gradient = unknowns_gradient(set_up, measured_channel.channel,
                                                nominal_bodies(readings.nominal, state.q),
                                                spindle_angle(readings.nominal, state));
    double variance = 0.0;
    for (std::size_t k = 0; k < unknown_list.size(); ++k)
      // Only zeros have infinite sigmas, and the median removes them.
      if (std::isfinite(unknown_list[k].sigma))
        variance += std::pow(unknown_list[k].sigma * gradient[Index(k)], 2);
    largest = std::max(largest, std::sqrt(variance));
  }
  return largest;
}

void check_channel(const Readings& readings, const ChannelMeasurements& measured_channel,
                   const VectorXd& nominal, ReadingDiagnostics& diagnostics) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(measured_channel.set_up)];
  const Channel& channel = set_up.channels[std::size_t(measured_channel.channel)];
  ChannelReadings channel_readings{set_up.name + ", " + channel.name,
                                   &set_up,
                                   measured_channel.channel,
                                   readings.value(measured_channel.measurements),
                                   nominal(measured_channel.measurements),
                                   alignment_sigma(readings, measured_channel)};
  check_changes(channel_readings.name, channel, channel_readings.value, diagnostics);
  if (channel.quantity == Quantity::Length && channel_readings.value.minCoeff() <= 0.0)
    diagnostics.errors.push_back(fmt::format("{}: a length is {}", channel_readings.name,
                                             size_text(channel_readings.value.minCoeff(), false)));
  check_departure(channel_readings, diagnostics);
  check_scatter(channel_readings.name, channel,
                departure_from_nominal(channel_readings, channel_readings.value), diagnostics);
}

/// Warns of repeated rows, which would double the weight of a reading.
void check_repeated_rows(const Plan& plan, ReadingDiagnostics& diagnostics) {
  std::set<std::tuple<int, int, int, int, double>> seen_rows;
  int repeated_count = 0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const Measurement& measurement = plan.measurements[i];
    if (seen_rows
            .emplace(measurement.set_up, measurement.channel, measurement.run, measurement.target,
                     measurement.state.time_s)
            .second)
      continue;
    if (repeated_count++ == 0) first = i + 1;
  }
  if (repeated_count > 0)
    diagnostics.warnings.push_back(
        fmt::format("{} readings are duplicates (same channel, target and instant), the first of "
                    "them at number {}",
                    repeated_count, first));
}

/// Warns of directions of approach that contradict the motion. They would falsify the backlash.
void check_directions(const Readings& readings, ReadingDiagnostics& diagnostics) {
  const std::vector<Measurement>& measurements = readings.plan.measurements;
  const auto& joints = readings.nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    int contradiction_count = 0;
    for (std::size_t i = 1; i < measurements.size(); ++i) {
      const kinematics::AxisState &from = measurements[i - 1].state, &to = measurements[i].state;
      const bool is_one_stroke = measurements[i].set_up == measurements[i - 1].set_up &&
                                 measurements[i].run == measurements[i - 1].run &&
                                 from.stroke[j] == to.stroke[j];
      contradiction_count +=
          is_one_stroke && (to.q[Index(j)] - from.q[Index(j)]) * to.direction[j] < -1e-9;
    }
    if (contradiction_count > 0)
      diagnostics.warnings.push_back(
          fmt::format("{} did not move in the stated direction of approach at {} readings: its "
                      "column {}_way contradicts its positions",
                      joints[j].name, contradiction_count, joints[j].name));
  }
}

/// Warns if the readings of one set-up take longer than the whole measurement.
void check_duration(const Plan& plan, ReadingDiagnostics& diagnostics) {
  std::map<int, std::pair<double, double>> spans;
  for (const Measurement& measurement : plan.measurements) {
    const double time = measurement.state.time_s;
    const auto at = spans.try_emplace(measurement.set_up, time, time).first;
    at->second.first = std::min(at->second.first, time);
    at->second.second = std::max(at->second.second, time);
  }
  double longest = 0.0;
  for (const auto& [set_up, span] : spans) longest = std::max(longest, span.second - span.first);
  if (plan.duration_s > 0.0 && longest > plan.duration_s * (1.0 + 1e-6))
    diagnostics.warnings.push_back(
        fmt::format("readings of one set-up take {:.6g} s, but the whole measurement takes {:.6g} "
                    "s: check the unit of the times",
                    longest, plan.duration_s));
}

void check_plan(const Readings& readings, ReadingDiagnostics& diagnostics) {
  const Plan& plan = readings.plan;
  const auto& joints = readings.nominal.joints();
  std::vector<int> outside_count(joints.size(), 0);
  int reversal_count = 0;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const kinematics::AxisState& state = plan.measurements[i].state;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double q = state.q[Index(j)];
      outside_count[j] += q < joints[j].min - 1e-6 || q > joints[j].max + 1e-6;
    }
    reversal_count += i > 0 && state.time_s < plan.measurements[i - 1].state.time_s;
  }
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (outside_count[j] > 0)
      diagnostics.warnings.push_back(
          fmt::format("{} of {} readings have {} beyond its travel: columns may be swapped",
                      outside_count[j], plan.measurements.size(), joints[j].name));
  if (reversal_count > 0)
    diagnostics.warnings.push_back(fmt::format(
        "time decreases at {} readings: they are not in chronological order", reversal_count));
  check_repeated_rows(plan, diagnostics);
  check_directions(readings, diagnostics);
  check_duration(plan, diagnostics);
}

/// Warns of channels without readings, as in a truncated file.
void check_complete(const Plan& plan, const std::vector<ChannelMeasurements>& measured_channels,
                    ReadingDiagnostics& diagnostics) {
  std::size_t channels = 0;
  for (const SetUp& set_up : plan.set_ups) channels += set_up.channels.size();
  if (measured_channels.size() < channels)
    diagnostics.warnings.push_back(
        fmt::format("{} of {} channels have no readings: the file may be truncated",
                    channels - measured_channels.size(), channels));
}

/// Warns of temperatures that contradict each other by a wrong unit or sign, or by a loose contact.
void check_temperature_levels(const Readings& readings, ReadingDiagnostics& diagnostics) {
  constexpr double max_room_C = 45.0;          // 20 degrees Celsius are 68 Fahrenheit
  constexpr double max_below_median_K = 25.0;  // machines are warmer than their room
  constexpr double jump_K = 10.0, max_interval_s = 120.0;
  const Eigen::MatrixXd& T_C = readings.T_C;
  if (T_C.size() == 0) return;
  if (T_C.minCoeff() > max_room_C)
    diagnostics.warnings.push_back(
        fmt::format("no sensor reads less than {:.2f} C: temperatures must be in degrees Celsius, "
                    "not Fahrenheit",
                    T_C.minCoeff()));
  VectorXd values = T_C.reshaped();
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  const double median = values[values.size() / 2];
  for (Index k = 0; k < T_C.cols(); ++k) {
    const std::string& name = readings.sensors[std::size_t(k)];
    if (const double min = T_C.col(k).minCoeff(); min < median - max_below_median_K)
      diagnostics.warnings.push_back(
          fmt::format("{} reads {:.2f} C while the median of all sensors is {:.2f} C: check sign, "
                      "unit and contact",
                      name, min, median));
    for (Index i = 1; i < T_C.rows(); ++i) {
      const double elapsed_s = readings.plan.measurements[std::size_t(i)].state.time_s -
                               readings.plan.measurements[std::size_t(i - 1)].state.time_s;
      if (std::abs(T_C(i, k) - T_C(i - 1, k)) <= jump_K || std::abs(elapsed_s) > max_interval_s)
        continue;
      diagnostics.warnings.push_back(fmt::format(
          "{} jumps from {:.2f} to {:.2f} C in {:.3g} s: a loose contact or a typing error", name,
          T_C(i - 1, k), T_C(i, k), elapsed_s));
      break;
    }
  }
}

void check_temperatures(const Readings& readings, ReadingDiagnostics& diagnostics) {
  constexpr double lowest_C = -40.0, highest_C = 150.0, absolute_zero_C = -273.15;
  const Eigen::MatrixXd& T_C = readings.T_C;
  // Fewer readings can be constant by chance.
  const bool has_enough_rows = T_C.rows() >= min_equal;
  check_temperature_levels(readings, diagnostics);
  bool has_varying_sensor = false;
  for (Index k = 0; has_enough_rows && k < T_C.cols(); ++k)
    has_varying_sensor = has_varying_sensor || T_C.col(k).maxCoeff() > T_C.col(k).minCoeff();
  for (std::size_t k = 0; T_C.rows() > 0 && k < readings.sensors.size(); ++k) {
    const std::string& name = readings.sensors[k];
    const double low = T_C.col(Index(k)).minCoeff(), high = T_C.col(Index(k)).maxCoeff();
    if (low < absolute_zero_C)
      diagnostics.errors.push_back(
          fmt::format("{} reads {:.2f} C, below absolute zero", name, low));
    else if (low < lowest_C || high > highest_C)
      diagnostics.warnings.push_back(
          fmt::format("{} reads {:.2f} to {:.2f} C, which is implausible for a machine: "
                      "temperatures must be in degrees Celsius, not kelvin or Fahrenheit",
                      name, low, high));
    if (has_varying_sensor && low == high)
      diagnostics.warnings.push_back(fmt::format(
          "{} reads {:.2f} C throughout while other sensors change: it may be faulty", name, low));
  }
}

/// Warns of constant or excessive deviations of a series without stated noise.
void check_deviations(const std::string& name, const VectorXd& v, bool is_angle,
                      ReadingDiagnostics& diagnostics) {
  if (v.size() == 0) return;
  if (v.size() >= min_equal && v.minCoeff() == v.maxCoeff())
    diagnostics.warnings.push_back(
        fmt::format("{}: all {} deviations are {}: the sensor may be faulty", name, v.size(),
                    noise_text(v[0], is_angle)));
  const double max_magnitude = v.cwiseAbs().maxCoeff();
  if (max_magnitude >= deviation_limit(is_angle))
    diagnostics.warnings.push_back(
        fmt::format("{}: deviations are up to {}, which is implausible for a machine: check unit, "
                    "sign and order",
                    name, size_text(max_magnitude, is_angle)));
}

/// Returns the readings of the nominal machine in perfect set-ups (measurements), mm or rad; 0 for
/// logged temperatures.
VectorXd nominal_values(const Readings& readings) {
  VectorXd nominal = VectorXd::Zero(Index(readings.plan.measurements.size()));
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const Measurement& measurement = readings.plan.measurements[i];
    if (measurement.channel < 0) continue;
    const BodyPoses bodies = nominal_bodies(readings.nominal, measurement.state.q);
    nominal[Index(i)] =
        reading(readings.plan.set_ups[std::size_t(measurement.set_up)], measurement.channel, {},
                bodies, bodies, spindle_angle(readings.nominal, measurement.state));
  }
  return nominal;
}

}  // namespace

std::vector<ChannelMeasurements> channel_measurements(const Plan& plan) {
  std::map<std::pair<int, int>, std::vector<int>> measurements;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i)
    if (plan.measurements[i].channel >= 0)
      measurements[{plan.measurements[i].set_up, plan.measurements[i].channel}].push_back(int(i));
  std::vector<ChannelMeasurements> channels;
  for (auto& [key, list] : measurements)
    channels.push_back({key.first, key.second, std::move(list)});
  return channels;
}

ReadingDiagnostics diagnose(const Readings& readings) {
  ReadingDiagnostics diagnostics;
  check_plan(readings, diagnostics);
  check_temperatures(readings, diagnostics);
  if (readings.value.size() == 0) return diagnostics;
  const std::vector<ChannelMeasurements> measured_channels = channel_measurements(readings.plan);
  check_complete(readings.plan, measured_channels, diagnostics);
  const VectorXd nominal = nominal_values(readings);
  for (const ChannelMeasurements& channel : measured_channels)
    check_channel(readings, channel, nominal, diagnostics);
  return diagnostics;
}

std::vector<RepeatedSeries> repeated_series(std::span<const Readings> files) {
  std::vector<RepeatedSeries> result;
  std::map<std::vector<double>, SeriesIndex> earlier_series;
  for (std::size_t f = 0; f < files.size(); ++f) {
    if (files[f].value.size() == 0) continue;
    for (const ChannelMeasurements& measured_channel : channel_measurements(files[f].plan)) {
      const Channel& channel =
          files[f].plan.set_ups[std::size_t(measured_channel.set_up)].channels[std::size_t(
              measured_channel.channel)];
      std::map<int, std::vector<double>> runs;
      for (const int i : measured_channel.measurements)
        runs[files[f].plan.measurements[std::size_t(i)].run].push_back(files[f].value[i]);
      for (auto& [run, values] : runs) {
        const double chance =
            std::pow(repetition_chance(channel.noise, channel.resolution), double(values.size()));
        const auto [low, high] = std::ranges::minmax(values);
        if (chance >= min_probability || low == high) continue;  // reported elsewhere
        const SeriesIndex series{int(f), measured_channel.set_up, measured_channel.channel, run};
        const auto [earlier, is_first] = earlier_series.try_emplace(std::move(values), series);
        if (!is_first) result.push_back({earlier->second, series});
      }
    }
  }
  return result;
}

std::string series_text(const Readings& readings, const SeriesIndex& series) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(series.set_up)];
  return fmt::format("{}, {}, run {}", set_up.name,
                     set_up.channels[std::size_t(series.channel)].name, series.run);
}

ReadingDiagnostics diagnose(const PartReadings& readings) {
  ReadingDiagnostics diagnostics;
  Channel channel;
  channel.noise = readings.sigma;
  const std::string name = "the part";
  check_changes(name, channel, readings.deviation, diagnostics);
  if (readings.deviation.size() == 0) return diagnostics;
  if (const double max_magnitude = readings.deviation.cwiseAbs().maxCoeff();
      max_magnitude >= large_mm)
    diagnostics.warnings.push_back(
        fmt::format("{}: deviations are up to {}: check unit and alignment", name,
                    size_text(max_magnitude, false)));
  check_scatter(name, channel, readings.deviation, diagnostics);
  return diagnostics;
}

ReadingDiagnostics diagnose(const std::vector<AxisTest>& tests) {
  ReadingDiagnostics diagnostics;
  for (const AxisTest& test : tests) {
    VectorXd deviations(test.runs.up.size() + test.runs.down.size());
    deviations << test.runs.up.reshaped(), test.runs.down.reshaped();
    check_deviations(test.name, deviations, test.angle, diagnostics);
  }
  return diagnostics;
}

}  // namespace abbe::errors::metrology
