#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "errors/metrology/readings.h"
#include "sim/scene/instrument_description.h"

namespace abbe::sim {

/// What the drift instrument and the sensors of a machine read over one day.
struct Day {
  std::string name;
  std::filesystem::path file;          ///< of its scene, for refusals
  std::vector<double> cycle_starts_s;  ///< at which spindle or axes start after a rest
  errors::metrology::Readings readings;
};

/// Time line of one channel of the drift on one day, for pictures.
struct DriftSeries {
  std::string day;
  std::string channel;
  bool angle = false;
  Eigen::VectorXd hours;      ///< (n)
  Eigen::VectorXd read;       ///< (n) mm or rad
  Eigen::VectorXd predicted;  ///< (n) by the model of the chosen sensors, fitted on the first day
};

/// Which sensors were chosen and what a model of them is good for.
struct ThermalChoice {
  nlohmann::ordered_json json;  ///< `thermal.json`; the keys are a promise to scripts
  std::vector<DriftSeries> series;
};

/// Chooses sensors and fits a model on what the drift instrument and the sensors read over the
/// first day, and grades both on the other days, which chose and fitted nothing. One set of
/// sensors is chosen for the three displacements together; tilts are predicted from the same ones.
/// Every other way to choose that the scene lists is graded beside, by the same models on the same
/// days. A degree that divides by a first value begins, for each displacement, at the first drift
/// beyond four standard deviations of its noise, with temperatures in deg C as read.
/// @param days  (n >= 1) of one machine; with one day alone there is no grade on days unseen
/// @throws BadInput naming the scene if the instrument or the sensors cannot do that
ThermalChoice thermal_choice(const std::vector<Day>& days,
                             const SensorChoiceDescription& description);

}  // namespace abbe::sim
