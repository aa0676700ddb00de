#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/thermal_network.h"

/// Simulation of a thermal network over time, and the sensors that read its temperatures.
namespace abbe::errors {

/// Modes of a network with constant links. Each mode of T - T_steady decays independently.
struct ThermalModes {
  Eigen::VectorXd rate_per_s;  ///< (nodes) > 0
  Eigen::MatrixXd to_modes;    ///< (nodes x nodes) temperatures to modes
  Eigen::MatrixXd to_nodes;    ///< (nodes x nodes) its inverse; its transpose converts heat flows
                               ///< to modes
};

/// Temperatures of a network at the knots of its activity, and the data from which they are
/// computed exactly at any instant in between. Immutable; created by `simulate`. Memory is linear
/// in the number of knots.
struct ThermalRun {
  ThermalNetwork network;
  std::vector<Activity> knots;  ///< (n)
  Eigen::MatrixXd T_C;          ///< (n x nodes) at the knots
  Eigen::MatrixXd heat_W;       ///< (n x nodes) of all sources, at the knots
  ThermalModes dry, wet;        ///< without and with coolant
};

/// Simulates the network from its start temperatures at the first knot to the last. Exact for heat
/// flows that change linearly between knots, to 1e-12 of the largest temperature change (2e-11 K at
/// 20 K), also if the rates of the network differ by 1e9; curved flows (a sinusoidal room) are
/// approximated to second order in the knot spacing.
/// @throws std::invalid_argument if the network is not valid, there is no knot, time goes back, the
///         speed of an axis with friction is missing, or a number is not finite
ThermalRun simulate(const ThermalNetwork& network, std::span<const Activity> knots);

/// Returns the temperatures at an instant, (nodes) deg C: before the first knot the start
/// temperatures, after the last knot as if its activity continued.
Eigen::VectorXd temperatures(const ThermalRun& run, double time_s);

/// A temperature sensor of the control.
struct TemperatureSensor {
  std::string name;
  int node = 0;
  double offset_K = 0.0;      ///< constant; reading minus true temperature
  double noise_K = 0.0;       ///< standard deviation, one draw per sample
  double resolution_K = 0.0;  ///< readings are rounded to its multiples; 0: not rounded
  double lag_s = 0.0;         ///< time constant of the sensor's own thermal mass
  double sampling_s = 1.0;    ///< > 0; the reading is held between samples
  std::uint64_t seed = 0;     ///< of its noise, which is the same for the same sample
};

/// Checks a sensor.
/// @throws std::invalid_argument naming the sensor: an unknown node, a negative noise, resolution
///         or lag, a sampling time that is not positive, a number that is not finite
void validate(const TemperatureSensor& sensor, const ThermalNetwork& network);

/// Returns the readings of a sensor at instants that do not decrease, (times) deg C. The sensor
/// samples at whole multiples of its sampling time, from time 0, and has its node's temperature
/// until the first knot. Its lag is solved in closed form, like the temperatures.
/// @throws std::invalid_argument if the sensor is not valid or time goes back
Eigen::VectorXd readings(const TemperatureSensor& sensor, const ThermalRun& run,
                         const Eigen::VectorXd& times_s);

}  // namespace abbe::errors
