#include "errors/thermal_run.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/decompositions.h"

namespace abbe::errors {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Divided differences of exp: the response of one mode to heat that is linear in time. Inline,
// since they are evaluated for every mode at every knot.

/// Returns the divided difference of exp over `zeros` zeros, -x and -y: sum of (-1)^k h_k(x, y) /
/// (k + zeros + 1)!, h_k the complete homogeneous polynomial.
inline double exp_series(int zeros, double x, double y) {
  constexpr int terms = 20;  // the last one is below 1e-19 if both arguments are at most 1
  double coefficient = 1.0;
  for (int k = 2; k <= zeros + 1; ++k) coefficient /= k;
  double h = 1.0, power = 1.0, sum = coefficient;
  for (int k = 1; k < terms; ++k) {
    power *= -x;
    h = -y * h + power;
    coefficient /= k + zeros + 1;
    sum += coefficient * h;
  }
  return sum;
}

// phi1 = (1 - e^-x) / x, phi2 = (1 - phi1) / x, x >= 0. Below 1 the difference would cancel, so the
// series is used.
inline double phi1(double x) { return x > 0.0 ? -std::expm1(-x) / x : 1.0; }
inline double phi2(double x) { return x < 1.0 ? exp_series(1, x, 0.0) : (1.0 - phi1(x)) / x; }

/// Returns the divided differences of exp over (-x, -y), (0, -x, -y) and (0, 0, -x, -y), x and y >=
/// 0.
inline std::array<double, 3> lagged_response(double x, double y) {
  // The larger argument is the divisor, so y - x and y lose no digits.
  if (x > y) std::swap(x, y);
  const double first = std::exp(-x) * phi1(y - x);
  if (y < 1.0) return {first, exp_series(1, x, y), exp_series(2, x, y)};
  const double second = (phi1(x) - first) / y;
  return {first, second, (phi2(x) - second) / y};
}

/// The equations of the modes between two knots: z' = -rate z + flow + t flow_rise.
struct ThermalSegment {
  const ThermalModes* modes = nullptr;
  Eigen::VectorXd flow, flow_rise;  ///< (nodes) in modes
  double length = 0.0;              ///< s; 0 after the last knot, whose activity continues
};

/// Returns the initial room temperature. All temperatures are computed relative to it, so that a
/// machine at that temperature stays there to the last bit.
double base_T_C(const ThermalRun& run) { return run.knots.front().room_T_C; }

/// Returns the heat from the surroundings into every node if all nodes were at `base_T_C`, W.
VectorXd surroundings_heat_W(const ThermalNetwork& network, const Activity& activity, bool coolant,
                             double base_T_C) {
  VectorXd flow = VectorXd::Zero(Index(network.nodes.size()));
  for (const SurroundingsLink& link : network.surroundings) {
    if (link.to == Surroundings::Room)
      flow[link.node] += link.conductance_W_per_K * (activity.room_T_C - base_T_C);
    else if (coolant)
      flow[link.node] += link.conductance_W_per_K * (activity.coolant_T_C - base_T_C);
  }
  return flow;
}

/// Returns the equations after a knot of a run.
ThermalSegment segment_after(const ThermalRun& run, std::size_t knot) {
  const Activity& from = run.knots[knot];
  ThermalSegment segment;
  segment.modes = from.coolant ? &run.wet : &run.dry;
  const auto modal_flow = [&](std::size_t i) -> VectorXd {
    const VectorXd surroundings =
        surroundings_heat_W(run.network, run.knots[i], from.coolant, base_T_C(run));
    return segment.modes->to_nodes.transpose() *
           (surroundings + run.heat_W.row(Index(i)).transpose());
  };
  segment.flow = modal_flow(knot);
  segment.flow_rise = VectorXd::Zero(segment.flow.size());
  if (knot + 1 < run.knots.size()) segment.length = run.knots[knot + 1].time_s - from.time_s;
  if (segment.length > 0.0)
    segment.flow_rise = (modal_flow(knot + 1) - segment.flow) / segment.length;
  return segment;
}

/// Returns the temperatures of a run at a knot above its base, in modes.
VectorXd modal_temperatures(const ThermalRun& run, const ThermalModes& modes, std::size_t knot) {
  return modes.to_modes * (run.T_C.row(Index(knot)).transpose().array() - base_T_C(run)).matrix();
}

/// Returns the last knot that is not after an instant; the instant is not before the first knot.
std::size_t last_knot_before(const ThermalRun& run, double time_s) {
  const auto knot = std::upper_bound(run.knots.begin(), run.knots.end(), time_s,
                                     [](double t, const Activity& a) { return t < a.time_s; });
  return std::size_t(knot - run.knots.begin()) - 1;
}

// Activity of a machine

void check(const Activity& activity, const ThermalNetwork& network) {
  const std::string who = fmt::format("activity at {} s", activity.time_s);
  for (const double number : {activity.time_s, activity.spindle_speed, activity.cutting_power_W,
                              activity.room_T_C, activity.coolant_T_C})
    require_finite(number, who, "number");
  if (!activity.axis_speed.allFinite()) refuse(who, "expected finite axis speeds");
  if (activity.axis_speed.size() == 0) return;
  for (const HeatSource& source : network.sources)
    if (const auto* axis = std::get_if<AxisHeat>(&source.law);
        axis && axis->joint >= activity.axis_speed.size())
      refuse(who, fmt::format("expected the speed of joint {}, seen {} speeds", axis->joint,
                              activity.axis_speed.size()));
}

void check(std::span<const Activity> knots, const ThermalNetwork& network) {
  if (knots.empty()) refuse("activity", "expected at least one knot");
  for (std::size_t i = 0; i < knots.size(); ++i) {
    check(knots[i], network);
    if (i > 0 && knots[i].time_s < knots[i - 1].time_s)
      refuse("activity",
             fmt::format("time decreases from {} s to {} s", knots[i - 1].time_s, knots[i].time_s));
  }
}

/// Returns the heat of all sources into each node, W.
VectorXd node_heats_W(const ThermalNetwork& network, const Activity& activity) {
  VectorXd heats = VectorXd::Zero(Index(network.nodes.size()));
  for (const HeatSource& source : network.sources) heats[source.node] += heat_W(source, activity);
  return heats;
}

// Modes

/// The conductances of a network; parallel links are added.
struct ConductanceMesh {
  MatrixXd between;    ///< (nodes x nodes) symmetric
  VectorXd to_ground;  ///< (nodes) to the surroundings
};

/// Returns the conductances with the coolant on or off.
ConductanceMesh conductance_mesh(const ThermalNetwork& network, bool coolant) {
  const Index n = Index(network.nodes.size());
  ConductanceMesh mesh{MatrixXd::Zero(n, n), VectorXd::Zero(n)};
  for (const ThermalLink& link : network.links) {
    mesh.between(link.a, link.b) += link.conductance_W_per_K;
    mesh.between(link.b, link.a) += link.conductance_W_per_K;
  }
  for (const SurroundingsLink& link : network.surroundings)
    if (coolant || link.to == Surroundings::Room)
      mesh.to_ground[link.node] += link.conductance_W_per_K;
  return mesh;
}

/// Returns the square roots of the heat capacities.
VectorXd capacity_roots(const ThermalNetwork& network) {
  VectorXd root_capacity(Index(network.nodes.size()));
  for (Index i = 0; i < root_capacity.size(); ++i)
    root_capacity[i] = std::sqrt(network.nodes[std::size_t(i)].capacity_J_per_K);
  return root_capacity;
}

/// Returns the weighted incidence matrix: a column sqrt(G) / sqrt(C) for every conductance.
MatrixXd incidence(const ConductanceMesh& mesh, const VectorXd& root_capacity) {
  const Index n = root_capacity.size();
  MatrixXd B = MatrixXd::Zero(n, n * (n + 1) / 2);
  Index column = 0;
  for (Index i = 0; i < n; ++i) {
    if (mesh.to_ground[i] > 0.0) B(i, column++) = std::sqrt(mesh.to_ground[i]) / root_capacity[i];
    for (Index j = 0; j < i; ++j) {
      if (!(mesh.between(i, j) > 0.0)) continue;
      const double g = std::sqrt(mesh.between(i, j));
      B(i, column) = g / root_capacity[i];
      B(j, column++) = -g / root_capacity[j];
    }
  }
  return B.leftCols(column);
}

/// Returns the modes of S = C^-1/2 L C^-1/2 = B B^T as singular vectors of the incidence B. Forming
/// L would lose a slow rate in the rounding of a fast one; the singular values of B span only half
/// as many decades.
ThermalModes modes(const ThermalNetwork& network, bool coolant) {
  const VectorXd root_capacity = capacity_roots(network);
  const MatrixXd B = incidence(conductance_mesh(network, coolant), root_capacity);
  if (!B.allFinite())
    refuse("thermal network", "its capacities and conductances exceed the numeric range");
  const SingularValues svd = singular_values(B, Eigen::ComputeThinU);
  const MatrixXd& V = svd.U;
  ThermalModes result{svd.values.cwiseAbs2(), V.transpose() * root_capacity.asDiagonal(),
                      root_capacity.cwiseInverse().asDiagonal() * V};
  if (!result.rate_per_s.allFinite() || !result.to_modes.allFinite() ||
      !result.to_nodes.allFinite())
    refuse("thermal network", "its capacities and conductances exceed the numeric range");
  return result;
}

bool has_coolant(const ThermalNetwork& network) {
  return std::any_of(network.surroundings.begin(), network.surroundings.end(),
                     [](const SurroundingsLink& link) { return link.to == Surroundings::Coolant; });
}

// Steps between knots

/// Returns the change of the modes from z in a time h. The change is computed directly, so that its
/// rounding error is relative to the change and not to the temperature.
VectorXd modal_change(const ThermalSegment& segment, const VectorXd& z, double h) {
  VectorXd dz(z.size());
  for (Index k = 0; k < z.size(); ++k) {
    const double rate = segment.modes->rate_per_s[k];
    const double x = rate * h;
    dz[k] = h * (phi1(x) * (segment.flow[k] - rate * z[k]) + h * phi2(x) * segment.flow_rise[k]);
  }
  return dz;
}

/// Compensated summation (Kahan): near a steady state the change from knot to knot is far below an
/// ulp of the temperature but must still accumulate.
struct CompensatedSum {
  VectorXd value, lost_digits;

  explicit CompensatedSum(VectorXd start)
      : value(std::move(start)), lost_digits(VectorXd::Zero(value.size())) {}
  void add(const VectorXd& change) {
    const VectorXd corrected = change - lost_digits;
    const VectorXd sum = value + corrected;
    lost_digits = (sum - value) - corrected;
    value = sum;
  }
};

}  // namespace

ThermalRun simulate(const ThermalNetwork& network, std::span<const Activity> knots) {
  validate(network);
  check(knots, network);
  const Index n = Index(knots.size());
  const Index nodes = Index(network.nodes.size());
  ThermalRun run{network,
                 {knots.begin(), knots.end()},
                 MatrixXd(n, nodes),
                 MatrixXd(n, nodes),
                 modes(network, false),
                 {}};
  run.wet = has_coolant(network) ? modes(network, true) : run.dry;
  for (Index i = 0; i < n; ++i) run.heat_W.row(i) = node_heats_W(network, knots[std::size_t(i)]);
  if (!run.heat_W.allFinite()) refuse("activity", "expected finite heat from every source");
  run.T_C.row(0) = network.start_T_C;
  const ThermalModes* current_modes = nullptr;
  CompensatedSum z{VectorXd()};
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    // A jump (two knots at one instant) leaves the temperatures unchanged.
    run.T_C.row(Index(i) + 1) = run.T_C.row(Index(i));
    const ThermalSegment segment = segment_after(run, i);
    if (segment.length == 0.0) continue;
    // The dry and the wet network have different modes, so the state is converted where the coolant
    // is switched; otherwise it stays in modes and accumulates no rounding errors.
    if (segment.modes != current_modes)
      z = CompensatedSum(modal_temperatures(run, *segment.modes, i));
    current_modes = segment.modes;
    z.add(modal_change(segment, z.value, segment.length));
    run.T_C.row(Index(i) + 1) =
        (current_modes->to_nodes * z.value).transpose().array() + base_T_C(run);
  }
  return run;
}

VectorXd temperatures(const ThermalRun& run, double time_s) {
  if (!(time_s > run.knots.front().time_s)) return run.T_C.row(0);
  const std::size_t knot = last_knot_before(run, time_s);
  const double h = time_s - run.knots[knot].time_s;
  if (h == 0.0) return run.T_C.row(Index(knot));
  const ThermalSegment segment = segment_after(run, knot);
  const VectorXd z = modal_temperatures(run, *segment.modes, knot);
  return run.T_C.row(Index(knot)).transpose() +
         segment.modes->to_nodes * modal_change(segment, z, h);
}

namespace {

/// A sensor with a thermal mass that lags behind its node: S' = (T_node - S) / lag, solved mode by
/// mode.
class LaggedNode {
 public:
  LaggedNode(const ThermalRun& run, const TemperatureSensor& sensor)
      // 1e200: the rate of a lag of almost 0 must not overflow; the sensor then follows its node.
      : run_(run), node_(sensor.node), rate_per_s_(std::min(1.0 / sensor.lag_s, 1e200)) {
    sensor_at_knots_.push_back(run.T_C(0, node_) - base_T_C(run));
  }

  double T_C(double time_s) {
    if (time_s <= run_.knots.front().time_s) return run_.T_C(0, node_);
    const std::size_t knot = last_knot_before(run_, time_s);
    while (sensor_at_knots_.size() <= knot) {
      const std::size_t last_knot = sensor_at_knots_.size() - 1;
      sensor_at_knots_.push_back(
          sensor_after(last_knot, run_.knots[last_knot + 1].time_s - run_.knots[last_knot].time_s));
    }
    return base_T_C(run_) + sensor_after(knot, time_s - run_.knots[knot].time_s);
  }

 private:
  double sensor_after(std::size_t knot, double h) const {
    const ThermalSegment segment = segment_after(run_, knot);
    const VectorXd z = modal_temperatures(run_, *segment.modes, knot);
    const auto node_row = segment.modes->to_nodes.row(node_);
    const double y = rate_per_s_ * h;
    double response = 0.0;
    for (Index k = 0; k < z.size(); ++k) {
      const auto [first_difference, second_difference, third_difference] =
          lagged_response(segment.modes->rate_per_s[k] * h, y);
      response += node_row[k] *
                  (first_difference * z[k] + h * (second_difference * segment.flow[k] +
                                                  h * third_difference * segment.flow_rise[k]));
    }
    return std::exp(-y) * sensor_at_knots_[knot] + y * response;
  }

  const ThermalRun& run_;
  Index node_;
  double rate_per_s_;
  std::vector<double> sensor_at_knots_;  ///< sensor above the base at the knots evaluated so far
};

/// Returns the number of the last sample that is not after an instant.
double last_sample_number(double time_s, double sampling_s) {
  double number = std::floor(time_s / sampling_s);
  // The quotient may round across a whole number in either direction.
  if ((number + 1.0) * sampling_s <= time_s) number += 1.0;
  if (number * sampling_s > time_s) number -= 1.0;
  return number;
}

void check_times(const VectorXd& times_s, const TemperatureSensor& sensor) {
  const std::string who = "sensor " + sensor.name;
  for (Index i = 0; i < times_s.size(); ++i) {
    // 9e15 is about 2^53: above it a double cannot represent every sample number.
    if (!(std::abs(times_s[i]) < 9e15 * std::min(1.0, sensor.sampling_s)))
      refuse(who, fmt::format("expected a time with a countable number of samples, seen {} s",
                              times_s[i]));
    if (i > 0 && times_s[i] < times_s[i - 1])
      refuse(who, fmt::format("time decreases from {} s to {} s", times_s[i - 1], times_s[i]));
  }
}

}  // namespace

void validate(const TemperatureSensor& sensor, const ThermalNetwork& network) {
  const std::string who = "sensor " + sensor.name;
  require_node(sensor.node, int(network.nodes.size()), who);
  require_finite(sensor.offset_K, who, "offset");
  require_not_negative(sensor.noise_K, who, "noise");
  require_not_negative(sensor.resolution_K, who, "resolution");
  require_not_negative(sensor.lag_s, who, "lag");
  require_positive_value(sensor.sampling_s, who, "sampling time");
}

VectorXd readings(const TemperatureSensor& sensor, const ThermalRun& run, const VectorXd& times_s) {
  validate(sensor, run.network);
  check_times(times_s, sensor);
  LaggedNode lagged_node(run, sensor);
  VectorXd result(times_s.size());
  double last_sample = 0.0;
  for (Index i = 0; i < times_s.size(); ++i) {
    const double sample_number = last_sample_number(times_s[i], sensor.sampling_s);
    // Between samples the reading is held, noise included.
    if (i > 0 && sample_number == last_sample) {
      result[i] = result[i - 1];
      continue;
    }
    last_sample = sample_number;
    const double sample_time_s = sample_number * sensor.sampling_s;
    double T = sensor.lag_s > 0.0 ? lagged_node.T_C(sample_time_s)
                                  : temperatures(run, sample_time_s)[sensor.node];
    T += sensor.offset_K;
    if (sensor.noise_K > 0.0)
      T += sensor.noise_K * normal_deviate(sensor.seed, std::uint64_t(std::int64_t(sample_number)));
    if (sensor.resolution_K > 0.0) T = std::round(T / sensor.resolution_K) * sensor.resolution_K;
    result[i] = T;
  }
  return result;
}

}  // namespace abbe::errors
