#include "errors/temperature_sensor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "errors/curve.h"
#include "errors/expect.h"
#include "errors/exponential_differences.h"
#include "errors/thermal_stretch.h"

namespace abbe::errors {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// The sensor's own mass behind its node: S' = (T_node - S) / lag, mode by mode.
class LaggedNode {
 public:
  LaggedNode(const ThermalRun& run, const TemperatureSensor& sensor)
      : run_(run), node_(sensor.node), per_s_(std::min(1.0 / sensor.lag_s, 1e200)) {
    at_knot_.push_back(run.T_C(0, node_) - base_T_C(run));
  }

  double T_C(double time_s) {
    if (time_s <= run_.knots.front().time_s) return run_.T_C(0, node_);
    const std::size_t knot = knot_before(run_, time_s);
    while (at_knot_.size() <= knot) {
      const std::size_t last = at_knot_.size() - 1;
      at_knot_.push_back(after(last, run_.knots[last + 1].time_s - run_.knots[last].time_s));
    }
    return base_T_C(run_) + after(knot, time_s - run_.knots[knot].time_s);
  }

 private:
  double after(std::size_t knot, double h) const {
    const ThermalStretch stretch = stretch_after(run_, knot);
    const VectorXd z = modal(run_, *stretch.modes, knot);
    const auto of_node = stretch.modes->to_nodes.row(node_);
    const double y = per_s_ * h;
    double driven = 0.0;
    for (Index k = 0; k < z.size(); ++k) {
      const auto [first, second, third] = lagged(stretch.modes->rate_per_s[k] * h, y);
      driven += of_node[k] *
                (first * z[k] + h * (second * stretch.flow[k] + h * third * stretch.flow_rise[k]));
    }
    return std::exp(-y) * at_knot_[knot] + y * driven;
  }

  const ThermalRun& run_;
  Index node_;
  double per_s_;
  std::vector<double> at_knot_;  ///< sensor over the base, as far as it was asked for
};

/// Number of the last sample that is not after an instant.
double sample_before(double time_s, double sampling_s) {
  double k = std::floor(time_s / sampling_s);
  if ((k + 1.0) * sampling_s <= time_s) k += 1.0;
  if (k * sampling_s > time_s) k -= 1.0;
  return k;
}

void check_times(const VectorXd& times_s, const TemperatureSensor& sensor) {
  const std::string who = "sensor " + sensor.name;
  for (Index i = 0; i < times_s.size(); ++i) {
    if (!(std::abs(times_s[i]) < 9e15 * std::min(1.0, sensor.sampling_s)))
      refuse(who, fmt::format("expected a time that its samples can be counted to, seen {} s",
                              times_s[i]));
    if (i > 0 && times_s[i] < times_s[i - 1])
      refuse(who, fmt::format("time goes back from {} s to {} s", times_s[i - 1], times_s[i]));
  }
}

}  // namespace

void validate(const TemperatureSensor& sensor, const ThermalNetwork& network) {
  const std::string who = "sensor " + sensor.name;
  expect_node(sensor.node, int(network.nodes.size()), who);
  expect_finite(sensor.offset_K, who, "offset");
  expect_not_negative(sensor.noise_K, who, "noise");
  expect_not_negative(sensor.resolution_K, who, "resolution");
  expect_not_negative(sensor.lag_s, who, "lag");
  expect_positive(sensor.sampling_s, who, "sampling time");
}

VectorXd readings(const TemperatureSensor& sensor, const ThermalRun& run, const VectorXd& times_s) {
  validate(sensor, run.network);
  check_times(times_s, sensor);
  LaggedNode lagged_node(run, sensor);
  VectorXd result(times_s.size());
  double last = 0.0;
  for (Index i = 0; i < times_s.size(); ++i) {
    const double k = sample_before(times_s[i], sensor.sampling_s);
    if (i > 0 && k == last) {
      result[i] = result[i - 1];
      continue;
    }
    last = k;
    const double at_s = k * sensor.sampling_s;
    double T = sensor.lag_s > 0.0 ? lagged_node.T_C(at_s) : temperatures(run, at_s)[sensor.node];
    T += sensor.offset_K;
    if (sensor.noise_K > 0.0)
      T += sensor.noise_K * normal_deviate(sensor.seed, std::uint64_t(std::int64_t(k)));
    if (sensor.resolution_K > 0.0) T = std::round(T / sensor.resolution_K) * sensor.resolution_K;
    result[i] = T;
  }
  return result;
}

}  // namespace abbe::errors
