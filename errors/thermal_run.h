#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/thermal_network.h"

/// Heat in a machine: its network, a run of it over time, and the sensors that read it.

namespace abbe::errors {

/// The modes of a network while its links stand: (T - T_steady) decays mode by mode.
struct ThermalModes {
  Eigen::VectorXd rate_per_s;  ///< (nodes) > 0
  Eigen::MatrixXd to_modes;    ///< (nodes x nodes) of temperatures
  Eigen::MatrixXd to_nodes;    ///< (nodes x nodes) its inverse; transposed, modes of heat flows
};

/// Temperatures of a network over the knots of its activity, with all that it takes to say them
/// exactly at any instant between. Immutable: made by `simulate`. Memory is linear in the knots.
struct ThermalRun {
  ThermalNetwork network;
  std::vector<Activity> knots;  ///< (n)
  Eigen::MatrixXd T_C;          ///< (n x nodes) at the knots
  Eigen::MatrixXd heat_W;       ///< (n x nodes) of all sources, at the knots
  ThermalModes dry, wet;        ///< without and with coolant
};

/// Runs the network from its start temperatures at the first knot to the last. Exact for heat flows
/// that change linearly between knots, to 1e-12 of the largest temperature change (2e-11 K at 20
/// K), also where the rates of the network lie 1e9 apart; flows that curve between knots (a
/// sinusoidal room) are met to second order in the spacing.
/// @throws std::invalid_argument if the network is not valid, there is no knot, time goes back, the
///         speed of an axis with friction is not said, or a number is not finite
ThermalRun simulate(const ThermalNetwork& network, std::span<const Activity> knots);

/// Temperatures at an instant, (nodes) deg C: before the first knot the start, after the last knot
/// as if its activity went on.
Eigen::VectorXd temperatures(const ThermalRun& run, double time_s);

/// Where the temperatures go if an activity lasts for ever, (nodes) deg C; to some ulp of the
/// change however far apart the conductances lie. @throws std::invalid_argument as `simulate`
Eigen::VectorXd steady_state(const ThermalNetwork& network, const Activity& activity);

/// Heat between two knots of a run, J, each integrated in closed form.
struct HeatBalance {
  double generated_J = 0.0;
  double to_surroundings_J = 0.0;
  double stored_J = 0.0;
};
/// generated = to_surroundings + stored to 1e-10 of the largest of them, or of the heat that flows
/// on the way where they cancel. @throws std::out_of_range
HeatBalance heat_balance(const ThermalRun& run, std::size_t from_knot, std::size_t to_knot);

/// A temperature sensor of the control.
struct TemperatureSensor {
  std::string name;
  int node = 0;
  double offset_K = 0.0;      ///< reading minus truth, constant
  double noise_K = 0.0;       ///< standard deviation, one draw a sample
  double resolution_K = 0.0;  ///< readings are rounded to multiples of it; 0: not rounded
  double lag_s = 0.0;         ///< time constant of the sensor's own mass
  double sampling_s = 1.0;    ///< > 0; between samples the last reading stands
  std::uint64_t seed = 0;     ///< of its noise: the same time gives the same reading
};

/// @throws std::invalid_argument naming the sensor: an unknown node, a negative noise, resolution
///         or lag, a sampling time that is not positive, a number that is not finite
void validate(const TemperatureSensor& sensor, const ThermalNetwork& network);

/// What a sensor says at instants that do not decrease, (times) deg C. It samples at whole
/// multiples of its sampling time, of which time 0 is one, and has stood at its node's temperature
/// before the first knot. Its lag is met in closed form, as the temperatures are.
/// @throws std::invalid_argument if the sensor is not valid or time goes back
Eigen::VectorXd readings(const TemperatureSensor& sensor, const ThermalRun& run,
                         const Eigen::VectorXd& times_s);

}  // namespace abbe::errors
