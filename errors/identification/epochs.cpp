#include "errors/identification/epochs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using kinematics::Motion;
using metrology::Look;
using metrology::Readings;
using metrology::SetUp;

constexpr std::size_t most_epochs = 200;

// ---- epochs

Epoch nothing_yet() { return {INFINITY, -INFINITY}; }

void take(Epoch& epoch, double time_s) {
  epoch.from_s = std::min(epoch.from_s, time_s);
  epoch.to_s = std::max(epoch.to_s, time_s);
}

std::vector<Epoch> epochs_of_starts(const std::vector<DayLog>& logs, int starts) {
  std::vector<Epoch> epochs(std::size_t(starts), nothing_yet());
  for (const DayLog& log : logs) {
    if (log.starts == 1) continue;
    if (log.starts != starts)
      throw std::invalid_argument(
          fmt::format("expected the same starts (start_h) of every instrument, seen {} and {} of "
                      "{}",
                      starts, log.starts, log.readings->plan.instrument));
    for (std::size_t i = 0; i < log.readings->plan.looks.size(); ++i)
      take(epochs[std::size_t(log.start_of(i))], log.time_s(i));
  }
  for (std::size_t k = 1; k < epochs.size(); ++k)
    if (!(epochs[k].from_s > epochs[k - 1].to_s))
      throw std::invalid_argument(fmt::format(
          "expected a start when all instruments have read from the one before, seen one at "
          "{:.2f} h while they read until {:.2f} h",
          epochs[k].from_s / 3600.0, epochs[k - 1].to_s / 3600.0));
  return epochs;
}

std::vector<Epoch> epochs_of_instants(const std::vector<DayLog>& logs) {
  std::set<double> instants;
  for (const DayLog& log : logs)
    for (const Look& look : log.readings->plan.looks) instants.insert(look.state.time_s);
  const std::size_t each = (instants.size() + most_epochs - 1) / most_epochs;
  std::vector<Epoch> epochs;
  std::size_t count = 0;
  for (const double instant : instants) {
    if (count++ % each == 0) epochs.push_back(nothing_yet());
    take(epochs.back(), instant);
  }
  return epochs;
}

// ---- what changed since the first epoch

/// A place at which a channel read, and the way it was come to; the angle of a nose says nothing.
using Place = std::vector<double>;
struct Spot {
  std::string set_up;
  int channel = 0;
  Place place;
  auto operator<=>(const Spot&) const = default;
};

Spot spot_of(const Readings& readings, const Look& look) {
  Spot spot{readings.plan.set_ups[std::size_t(look.set_up)].name, look.channel, {}};
  const auto& joints = readings.nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].motion == Motion::Spindle) continue;
    spot.place.push_back(look.state.q[Index(j)]);
    spot.place.push_back(look.state.direction[j]);
  }
  return spot;
}

struct Mean {
  double sum = 0.0;
  int count = 0;
  double value() const { return sum / count; }
};
using Means = std::map<Spot, Mean>;

bool reads(const Readings& readings, const Look& look) {
  return look.channel >= 0 && readings.value.size() > 0;
}

Means means_of(const DayLog& log, const Epoch& epoch) {
  Means means;
  for (std::size_t i = 0; i < log.readings->plan.looks.size(); ++i) {
    const Look& look = log.readings->plan.looks[i];
    if (!reads(*log.readings, look) || !epoch.holds(log.time_s(i))) continue;
    Mean& mean = means[spot_of(*log.readings, look)];
    mean.sum += log.readings->value[Index(i)];
    ++mean.count;
  }
  return means;
}

/// A set-up as a difference of two readings sees it: what stands drops out, what was laid twice
/// errs twice.
SetUp of_differences(SetUp set_up, bool stands) {
  const double twice = std::sqrt(2.0);
  for (auto& channel : set_up.channels) {
    channel.noise *= twice;
    channel.resolution *= twice;
  }
  const double again = stands ? 0.0 : twice;
  for (double* sigma :
       {&set_up.rotation_sigma, &set_up.point_of_sigma, &set_up.point_in_sigma,
        &set_up.normal_sigma, &set_up.eccentricity_sigma, &set_up.scale_sigma, &set_up.drift_sigma})
    *sigma *= again;
  if (stands) set_up.zero_unknown = false;
  return set_up;
}

/// What the nominal machine would show, and beside it what has changed since the first epoch: the
/// readings of a machine that was perfect then.
Readings changed(const DayLog& log, const Epoch& epoch, const Means& first) {
  const Readings& all = *log.readings;
  Readings some{{all.plan.instrument, all.plan.kind, {}, {}, 0.0}, all.nominal, {}, {}, {}};
  std::map<int, int> kept;  // set-ups
  std::vector<double> values;
  for (std::size_t i = 0; i < all.plan.looks.size(); ++i) {
    Look look = all.plan.looks[i];
    if (!reads(all, look) || !epoch.holds(look.state.time_s)) continue;
    const auto before = first.find(spot_of(all, look));
    if (before == first.end()) continue;
    const SetUp& set_up = all.plan.set_ups[std::size_t(look.set_up)];
    const auto bodies = metrology::nominal_bodies(all.nominal, look.state.q);
    values.push_back(all.value[Index(i)] - before->second.value() +
                     metrology::reading(set_up, look.channel, {}, bodies, bodies,
                                        metrology::spindle_angle(all.nominal, look.state)));
    const auto [at, is_new] = kept.emplace(look.set_up, int(some.plan.set_ups.size()));
    if (is_new) some.plan.set_ups.push_back(of_differences(set_up, log.starts == 1));
    look.set_up = at->second;
    some.plan.looks.push_back(look);
  }
  if (values.empty())
    throw std::invalid_argument(
        fmt::format("expected {} to read in every epoch where it read in the first, seen none from "
                    "{:.2f} to {:.2f} h",
                    all.plan.instrument, epoch.from_s / 3600.0, epoch.to_s / 3600.0));
  some.value = Eigen::Map<const VectorXd>(values.data(), Index(values.size()));
  return some;
}

}  // namespace

std::vector<int> starts_of(const metrology::Plan& plan) {
  std::vector<int> starts;
  std::map<std::string, int> seen;
  for (const SetUp& set_up : plan.set_ups) starts.push_back(seen[set_up.name]++);
  return starts;
}

std::vector<Readings> by_start(const Readings& readings) {
  const std::vector<int> start = starts_of(readings.plan);
  const metrology::Plan& plan = readings.plan;
  std::vector<Readings> result;
  std::vector<int> place;  // of every set-up in its start
  for (std::size_t s = 0; s < start.size(); ++s) {
    const auto k = std::size_t(start[s]);
    if (k == result.size())
      result.push_back(
          {{plan.instrument, plan.kind, {}, {}, 0.0}, readings.nominal, {}, readings.sensors, {}});
    place.push_back(int(result[k].plan.set_ups.size()));
    result[k].plan.set_ups.push_back(plan.set_ups[s]);
  }
  std::vector<std::vector<Index>> rows(result.size());
  for (std::size_t i = 0; i < plan.looks.size(); ++i) {
    const auto s = std::size_t(plan.looks[i].set_up), k = std::size_t(start[s]);
    rows[k].push_back(Index(i));
    result[k].plan.looks.push_back(plan.looks[i]);
    result[k].plan.looks.back().set_up = place[s];
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
    const auto found = std::ranges::find(logged, name);
    if (found == logged.end())
      throw std::invalid_argument("expected a sensor that was logged, seen " + name);
    columns.push_back(found - logged.begin());
  }
  return columns;
}

MatrixXd warmed_K(std::span<const Readings> readings, const std::vector<std::string>& sensors) {
  const std::vector<Index> columns = sensor_columns(sensors, readings.front().sensors);
  MatrixXd T_C(Index(readings.size()), Index(sensors.size()));
  for (Index i = 0; i < T_C.rows(); ++i)
    for (Index k = 0; k < T_C.cols(); ++k)
      T_C(i, k) = readings[std::size_t(i)].T_C.col(columns[std::size_t(k)]).mean();
  return T_C.rowwise() - T_C.row(0).eval();
}

DayLog day_log(const Readings& readings) {
  DayLog log{&readings, starts_of(readings.plan), 1};
  for (const int start : log.start) log.starts = std::max(log.starts, start + 1);
  return log;
}

std::vector<Epoch> epochs_of(const std::vector<DayLog>& logs) {
  int starts = 1;
  for (const DayLog& log : logs) starts = std::max(starts, log.starts);
  std::vector<Epoch> epochs =
      starts > 1 ? epochs_of_starts(logs, starts) : epochs_of_instants(logs);
  if (epochs.size() < 3)
    throw std::invalid_argument(fmt::format(
        "expected readings from at least 3 starts (start_h) or instants, seen {}", epochs.size()));
  return epochs;
}

std::vector<std::vector<Readings>> changes_of(const std::vector<DayLog>& logs,
                                              const std::vector<Epoch>& epochs) {
  std::vector<std::vector<Readings>> changes(epochs.size());
  for (const DayLog& log : logs) {
    if (log.readings->value.size() == 0) continue;
    const Means first = means_of(log, epochs.front());
    for (std::size_t k = 0; k < epochs.size(); ++k)
      changes[k].push_back(changed(log, epochs[k], first));
  }
  if (changes.front().empty())
    throw std::invalid_argument("expected readings of the machine beside the temperatures");
  return changes;
}

std::vector<std::string> common_sensors(const std::vector<DayLog>& logs) {
  std::vector<std::string> common = logs.front().readings->sensors;
  for (const DayLog& log : logs)
    std::erase_if(common, [&](const std::string& name) {
      return std::ranges::count(log.readings->sensors, name) == 0;
    });
  if (common.empty())
    throw std::invalid_argument("expected temperatures beside the readings, seen no sensor");
  return common;
}

MatrixXd warmed_K(const std::vector<DayLog>& logs, const std::vector<Epoch>& epochs,
                  const std::vector<std::string>& sensors) {
  MatrixXd sum = MatrixXd::Zero(Index(epochs.size()), Index(sensors.size()));
  VectorXd count = VectorXd::Zero(Index(epochs.size()));
  for (const DayLog& log : logs) {
    const std::vector<Index> columns = sensor_columns(sensors, log.readings->sensors);
    for (std::size_t i = 0; i < log.readings->plan.looks.size(); ++i) {
      const auto epoch =
          std::ranges::find_if(epochs, [&](const Epoch& one) { return one.holds(log.time_s(i)); });
      if (epoch == epochs.end()) continue;
      const auto k = Index(epoch - epochs.begin());
      sum.row(k) += log.readings->T_C.row(Index(i))(columns);
      count[k] += 1.0;
    }
  }
  const MatrixXd mean = sum.array().colwise() / count.array();
  return mean.rowwise() - mean.row(0).eval();
}

bool is_moved(const std::vector<DayLog>& logs, int joint) {
  std::optional<double> place;
  for (const DayLog& log : logs)
    for (const Look& look : log.readings->plan.looks) {
      if (!reads(*log.readings, look)) continue;
      if (place && *place != look.state.q[joint]) return true;
      place = look.state.q[joint];
    }
  return false;
}

}  // namespace abbe::errors::identification
