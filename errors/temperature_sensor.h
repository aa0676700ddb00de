#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "errors/thermal_run.h"

namespace abbe::errors {

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
