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

constexpr double impossible = 1e-9;                   // probability below which readings are an
                                                      // error, not a coincidence
constexpr double large_mm = 1.0, large_rad = 0.01;    // a deviation that no machine has
constexpr double certain = 10.0;                      // factor on that limit from which a warning
                                                      // becomes an error
constexpr int min_equal = 5, min_equal_in_a_row = 4;  // number of readings
constexpr int min_scattered = 20;

double limit_of(bool is_angle) { return is_angle ? large_rad : large_mm; }

std::string size_text(double value, bool is_angle) {
  return is_angle ? fmt::format("{:.4g} mrad", value / (1e3 * units::urad))
                  : fmt::format("{:.4g} mm", value);
}

std::string noise_text(double value, bool is_angle) {
  return fmt::format("{:.3g} {}", value / (is_angle ? units::urad : units::um),
                     is_angle ? "urad" : "um");
}

// Constant readings

/// Returns an upper bound of the probability that a reading with this noise repeats the previous
/// step of the resolution.
double repetition_chance(double noise, double resolution) {
  if (noise <= 0.0) return 1.0;
  return std::erf(0.5 * resolution / (noise * std::sqrt(2.0)));
}

/// Returns the first reading and the length of the longest sequence of equal ones.
std::pair<Index, Index> longest_equal_run(const VectorXd& values) {
  Index first = 0, count = values.size() > 0 ? 1 : 0;
  for (Index from = 0, i = 1; i <= values.size(); ++i) {
    if (i < values.size() && values[i] == values[from]) continue;
    if (i - from > count) first = from, count = i - from;
    from = i;
  }
  return {first, count};
}

void check_changes(const std::string& name, const Channel& channel, const VectorXd& values,
                   ReadingDiagnostics& found) {
  const auto [first, count] = longest_equal_run(values);
  const Index n = values.size();
  const double chance =
      std::pow(repetition_chance(channel.noise, channel.resolution), double(count - 1));
  if (count == n && n >= min_equal) {
    const std::string text = fmt::format("{}: all {} readings are {}", name, n,
                                         size_text(values[0], channel.is_angle()));
    if (chance < impossible)
      found.errors.push_back(
          text + fmt::format(", but the channel has {} of noise: a sensor that does not work, or "
                             "readings that were not copied",
                             noise_text(channel.noise, channel.is_angle())));
    else
      found.warnings.push_back(text + ": the sensor may not work");
  } else if (count >= min_equal_in_a_row && double(n) * chance < impossible) {
    found.warnings.push_back(fmt::format(
        "{}: {} readings in a row are the same, from the {}. on: the sensor stood still", name,
        count, first + 1));
  }
}

/// Returns the noise of readings along a smooth curve, from their second differences.
double second_difference_noise(const VectorXd& v) {
  const Index n = v.size() - 2;
  // A second difference of white noise has the variance 1 + 4 + 1 = 6.
  return ((v.head(n) - 2.0 * v.segment(1, n) + v.tail(n)).matrix()).norm() /
         std::sqrt(6.0 * double(n));
}

void check_scatter(const std::string& name, const Channel& channel, const VectorXd& departure,
                   ReadingDiagnostics& found) {
  constexpr double too_little = 0.1;  // relative to the noise: probability 1e-7 for 20 readings, of
                                      // which 9 are independent
  if (departure.size() < min_scattered || !(channel.noise > 0.0) ||
      channel.resolution > channel.noise)
    return;
  const double scatter = second_difference_noise(departure);
  if (scatter >= too_little * channel.noise || departure.cwiseAbs().maxCoeff() == 0.0) return;
  found.warnings.push_back(fmt::format(
      "{}: readings scatter by {}, their noise is {}: in another unit, or smoothed", name,
      noise_text(scatter, channel.is_angle()), noise_text(channel.noise, channel.is_angle())));
}

// Readings far from the nominal machine

/// One channel: its readings and those of the nominal machine.
struct ChannelReadings {
  std::string name;
  const SetUp* set_up = nullptr;
  int channel = 0;
  VectorXd value, nominal;  ///< (n) mm or rad
  double alignment = 0.0;   ///< mm or rad, largest standard deviation of a reading by the set-up's
                            ///< alignment

  const Channel& of() const { return set_up->channels[std::size_t(channel)]; }
};

/// Returns reading minus nominal; a counter of unknown zero counts from its median, which a few
/// wrong readings do not move.
VectorXd departure_from_nominal(const ChannelReadings& readings, const VectorXd& value) {
  VectorXd departure = value - readings.nominal;
  if (readings.set_up->zero_unknown && departure.size() > 0) {
    VectorXd sorted = departure;
    std::sort(sorted.begin(), sorted.end());
    departure.array() -= sorted[sorted.size() / 2];
  }
  return departure;
}

double max_departure(const ChannelReadings& readings, const VectorXd& value) {
  return departure_from_nominal(readings, value).cwiseAbs().maxCoeff();
}

/// Returns the likely cause: the change of the readings that would bring them within the limit.
std::string cause_of(const ChannelReadings& readings, double limit) {
  struct Factor {
    double factor;
    const char* cause;
  };
  constexpr std::array factors{
      Factor{-1.0, "they are of the other sign"},
      Factor{1000.0, "they are in m, or a thousandth of their unit"},
      Factor{1e-3, "they are in um or urad, or a thousand times their unit"},
      Factor{units::inch, "they are in inches"}, Factor{units::deg, "they are in degrees"}};
  for (const Factor& one : factors)
    if (max_departure(readings, one.factor * readings.value) <= limit) return one.cause;
  if (max_departure(readings, readings.value.reverse()) <= limit)
    return "they are in reversed order";
  return "unit, sign, order or columns may be wrong";
}

void check_departure(const ChannelReadings& readings, ReadingDiagnostics& found) {
  const Channel& channel = readings.of();
  // Five sigmas: a set-up that is merely misaligned is no error of the readings.
  const double allowed = 5.0 * readings.alignment;
  const double limit = limit_of(channel.is_angle()) + allowed;
  const double far = max_departure(readings, readings.value);
  if (far < limit) return;
  const bool is_certain = far >= certain * limit_of(channel.is_angle()) + allowed;
  (is_certain ? found.errors : found.warnings)
      .push_back(fmt::format("{}: readings are up to {} from what the nominal machine shows: {}",
                             readings.name, size_text(far, channel.is_angle()),
                             cause_of(readings, limit)));
}

double alignment_sigma(const Readings& readings, const ChannelMeasurements& read) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(read.set_up)];
  const std::vector<SetUpUnknown> list = unknowns(set_up);
  double largest = 0.0;
  for (const int i : read.measurements) {
    const kinematics::AxisState& state = readings.plan.measurements[std::size_t(i)].state;
    const VectorXd gradient =
        unknowns_gradient(set_up, read.channel, nominal_bodies(readings.nominal, state.q),
                          spindle_angle(readings.nominal, state));
    double variance = 0.0;
    for (std::size_t k = 0; k < list.size(); ++k)
      // Infinite sigmas are those of zeros, which the median already removes.
      if (std::isfinite(list[k].sigma)) variance += std::pow(list[k].sigma * gradient[Index(k)], 2);
    largest = std::max(largest, std::sqrt(variance));
  }
  return largest;
}

void check_channel(const Readings& readings, const ChannelMeasurements& read,
                   const VectorXd& nominal, ReadingDiagnostics& found) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(read.set_up)];
  const Channel& channel = set_up.channels[std::size_t(read.channel)];
  ChannelReadings one{set_up.name + ", " + channel.name,
                      &set_up,
                      read.channel,
                      readings.value(read.measurements),
                      nominal(read.measurements),
                      alignment_sigma(readings, read)};
  check_changes(one.name, channel, one.value, found);
  if (channel.quantity == Quantity::Length && one.value.minCoeff() <= 0.0)
    found.errors.push_back(
        fmt::format("{}: a length is {}", one.name, size_text(one.value.minCoeff(), false)));
  check_departure(one, found);
  check_scatter(one.name, channel, departure_from_nominal(one, one.value), found);
}

// Plan and temperatures

/// Warns of rows that hold one reading twice, which would double its weight.
void check_repeated_rows(const Plan& plan, ReadingDiagnostics& found) {
  std::set<std::tuple<int, int, int, int, double>> known;
  int repeated = 0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const Measurement& measurement = plan.measurements[i];
    if (known
            .emplace(measurement.set_up, measurement.channel, measurement.run, measurement.target,
                     measurement.state.time_s)
            .second)
      continue;
    if (repeated++ == 0) first = i + 1;
  }
  if (repeated > 0)
    found.warnings.push_back(
        fmt::format("{} readings stand twice, of one channel, target and instant, the first of "
                    "them as the {}.",
                    repeated, first));
}

/// Warns of directions of approach that contradict the motion: the direction determines the
/// backlash.
void check_directions(const Readings& readings, ReadingDiagnostics& found) {
  const std::vector<Measurement>& measurements = readings.plan.measurements;
  const auto& joints = readings.nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    int wrong = 0;
    for (std::size_t i = 1; i < measurements.size(); ++i) {
      const kinematics::AxisState &from = measurements[i - 1].state, &to = measurements[i].state;
      const bool is_one_stroke = measurements[i].set_up == measurements[i - 1].set_up &&
                                 measurements[i].run == measurements[i - 1].run &&
                                 from.stroke[j] == to.stroke[j];
      wrong += is_one_stroke && (to.q[Index(j)] - from.q[Index(j)]) * to.direction[j] < -1e-9;
    }
    if (wrong > 0)
      found.warnings.push_back(fmt::format(
          "{} moved against the side from which it is said to come at {} readings: its column "
          "{}_way contradicts its positions",
          joints[j].name, wrong, joints[j].name));
  }
}

/// Warns if the readings of one set-up take longer than the whole measurement.
void check_duration(const Plan& plan, ReadingDiagnostics& found) {
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
    found.warnings.push_back(
        fmt::format("readings of one set-up take {:.6g} s, the whole measurement {:.6g} s: times "
                    "may be in another unit",
                    longest, plan.duration_s));
}

void check_plan(const Readings& readings, ReadingDiagnostics& found) {
  const Plan& plan = readings.plan;
  const auto& joints = readings.nominal.joints();
  std::vector<int> beyond(joints.size(), 0);
  int backwards = 0;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const kinematics::AxisState& state = plan.measurements[i].state;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double q = state.q[Index(j)];
      beyond[j] += q < joints[j].min - 1e-6 || q > joints[j].max + 1e-6;
    }
    backwards += i > 0 && state.time_s < plan.measurements[i - 1].state.time_s;
  }
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (beyond[j] > 0)
      found.warnings.push_back(
          fmt::format("{} of {} readings stand at {} beyond its travel: columns may be exchanged",
                      beyond[j], plan.measurements.size(), joints[j].name));
  if (backwards > 0)
    found.warnings.push_back(
        fmt::format("time runs backwards at {} readings: they are not in the order in which they "
                    "were read",
                    backwards));
  check_repeated_rows(plan, found);
  check_directions(readings, found);
  check_duration(plan, found);
}

/// Warns of channels of the plan without readings, as in a truncated file.
void check_complete(const Plan& plan, const std::vector<ChannelMeasurements>& read,
                    ReadingDiagnostics& found) {
  std::size_t channels = 0;
  for (const SetUp& set_up : plan.set_ups) channels += set_up.channels.size();
  if (read.size() < channels)
    found.warnings.push_back(
        fmt::format("{} of {} channels have no reading: the file may have been cut off",
                    channels - read.size(), channels));
}

/// Warns of temperatures that contradict each other: wrong unit or sign, or a loose contact.
void check_temperature_levels(const Readings& readings, ReadingDiagnostics& found) {
  constexpr double warmest_room_C = 45.0;  // 20 degrees Celsius are 68 Fahrenheit
  constexpr double coldest_K = 25.0;       // below the median: machines are warmer than their room
  constexpr double jump_K = 10.0, soon_s = 120.0;
  const Eigen::MatrixXd& T_C = readings.T_C;
  if (T_C.size() == 0) return;
  if (T_C.minCoeff() > warmest_room_C)
    found.warnings.push_back(
        fmt::format("no sensor reads less than {:.2f} C: temperatures are in degrees Celsius, not "
                    "Fahrenheit",
                    T_C.minCoeff()));
  VectorXd all = T_C.reshaped();
  std::nth_element(all.begin(), all.begin() + all.size() / 2, all.end());
  const double median = all[all.size() / 2];
  for (Index k = 0; k < T_C.cols(); ++k) {
    const std::string& name = readings.sensors[std::size_t(k)];
    if (const double low = T_C.col(k).minCoeff(); low < median - coldest_K)
      found.warnings.push_back(fmt::format(
          "{} reads {:.2f} C where the median of all is {:.2f} C: sign, unit or contact may be "
          "wrong",
          name, low, median));
    for (Index i = 1; i < T_C.rows(); ++i) {
      const double passed_s = readings.plan.measurements[std::size_t(i)].state.time_s -
                              readings.plan.measurements[std::size_t(i - 1)].state.time_s;
      if (std::abs(T_C(i, k) - T_C(i - 1, k)) <= jump_K || std::abs(passed_s) > soon_s) continue;
      found.warnings.push_back(
          fmt::format("{} jumps from {:.2f} to {:.2f} C in {:.3g} s: a loose contact, or a mistake "
                      "in writing",
                      name, T_C(i - 1, k), T_C(i, k), passed_s));
      break;
    }
  }
}

void check_temperatures(const Readings& readings, ReadingDiagnostics& found) {
  constexpr double lowest_C = -40.0, highest_C = 150.0, zero_K = -273.15;
  const Eigen::MatrixXd& T_C = readings.T_C;
  const bool is_long = T_C.rows() >= min_equal;
  // Fewer readings than this can be constant by chance.
  check_temperature_levels(readings, found);
  bool some_move = false;
  for (Index k = 0; is_long && k < T_C.cols(); ++k)
    some_move = some_move || T_C.col(k).maxCoeff() > T_C.col(k).minCoeff();
  for (std::size_t k = 0; T_C.rows() > 0 && k < readings.sensors.size(); ++k) {
    const std::string& name = readings.sensors[k];
    const double low = T_C.col(Index(k)).minCoeff(), high = T_C.col(Index(k)).maxCoeff();
    if (low < zero_K)
      found.errors.push_back(fmt::format("{} reads {:.2f} C, below absolute zero", name, low));
    else if (low < lowest_C || high > highest_C)
      found.warnings.push_back(
          fmt::format("{} reads {:.2f} to {:.2f} C, as no machine is: temperatures are in degrees "
                      "Celsius, not kelvin or Fahrenheit",
                      name, low, high));
    if (some_move && low == high)
      found.warnings.push_back(fmt::format(
          "{} reads {:.2f} C throughout while other sensors move: it may not work", name, low));
  }
}

/// Warns of constant or excessive deviations of series that state no noise, e.g. "X: all 11
/// deviations are 0".
void check_deviations(const std::string& name, const VectorXd& v, bool is_angle,
                      ReadingDiagnostics& found) {
  if (v.size() == 0) return;
  if (v.size() >= min_equal && v.minCoeff() == v.maxCoeff())
    found.warnings.push_back(fmt::format("{}: all {} deviations are {}: the sensor may not work",
                                         name, v.size(), noise_text(v[0], is_angle)));
  const double far = v.cwiseAbs().maxCoeff();
  if (far >= limit_of(is_angle))
    found.warnings.push_back(fmt::format(
        "{}: deviations are up to {}, and no machine is that wrong: unit, sign or order "
        "may be wrong",
        name, size_text(far, is_angle)));
}

}  // namespace

VectorXd nominal_values(const Readings& readings) {
  VectorXd nominal = VectorXd::Zero(Index(readings.plan.measurements.size()));
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const Measurement& measurement = readings.plan.measurements[i];
    if (measurement.channel < 0) continue;
    const Bodies bodies = nominal_bodies(readings.nominal, measurement.state.q);
    nominal[Index(i)] =
        reading(readings.plan.set_ups[std::size_t(measurement.set_up)], measurement.channel, {},
                bodies, bodies, spindle_angle(readings.nominal, measurement.state));
  }
  return nominal;
}

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
  ReadingDiagnostics found;
  check_plan(readings, found);
  check_temperatures(readings, found);
  if (readings.value.size() == 0) return found;
  const std::vector<ChannelMeasurements> read = channel_measurements(readings.plan);
  check_complete(readings.plan, read, found);
  const VectorXd nominal = nominal_values(readings);
  for (const ChannelMeasurements& one : read) check_channel(readings, one, nominal, found);
  return found;
}

std::vector<RepeatedSeries> repeated_series(std::span<const Readings> files) {
  std::vector<RepeatedSeries> repeated;
  std::map<std::vector<double>, SeriesIndex> known;
  for (std::size_t f = 0; f < files.size(); ++f) {
    if (files[f].value.size() == 0) continue;
    for (const ChannelMeasurements& read : channel_measurements(files[f].plan)) {
      const Channel& channel =
          files[f].plan.set_ups[std::size_t(read.set_up)].channels[std::size_t(read.channel)];
      std::map<int, std::vector<double>> runs;
      for (const int i : read.measurements)
        runs[files[f].plan.measurements[std::size_t(i)].run].push_back(files[f].value[i]);
      for (auto& [run, values] : runs) {
        const double chance =
            std::pow(repetition_chance(channel.noise, channel.resolution), double(values.size()));
        const auto [low, high] = std::ranges::minmax(values);
        if (chance >= impossible || low == high) continue;  // reported elsewhere
        const SeriesIndex name{int(f), read.set_up, read.channel, run};
        const auto [at, is_first] = known.try_emplace(std::move(values), name);
        if (!is_first) repeated.push_back({at->second, name});
      }
    }
  }
  return repeated;
}

std::string series_text(const Readings& readings, const SeriesIndex& series) {
  const SetUp& set_up = readings.plan.set_ups[std::size_t(series.set_up)];
  return fmt::format("{}, {}, run {}", set_up.name,
                     set_up.channels[std::size_t(series.channel)].name, series.run);
}

ReadingDiagnostics diagnose(const PartReadings& readings) {
  ReadingDiagnostics found;
  Channel channel;
  channel.noise = readings.sigma;
  const std::string name = "the part";
  check_changes(name, channel, readings.deviation, found);
  if (readings.deviation.size() == 0) return found;
  if (const double far = readings.deviation.cwiseAbs().maxCoeff(); far >= large_mm)
    found.warnings.push_back(
        fmt::format("{}: deviations are up to {}: unit or alignment may be wrong", name,
                    size_text(far, false)));
  check_scatter(name, channel, readings.deviation, found);
  return found;
}

ReadingDiagnostics diagnose(const std::vector<AxisTest>& tests) {
  ReadingDiagnostics found;
  for (const AxisTest& test : tests) {
    VectorXd all(test.runs.up.size() + test.runs.down.size());
    all << test.runs.up.reshaped(), test.runs.down.reshaped();
    check_deviations(test.name, all, test.angle, found);
  }
  return found;
}

}  // namespace abbe::errors::metrology
