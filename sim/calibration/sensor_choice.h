#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/sensor_choice.h"
#include "errors/metrology/readings.h"
#include "sim/scene/instruments.h"

namespace abbe::sim {

/// What the drift instrument and the sensors of a machine read over one day.
struct DayReadings {
  std::string name;
  std::filesystem::path file;          ///< of its scene, for refusals
  std::vector<double> cycle_starts_s;  ///< at which spindle or axes start after a rest
  errors::metrology::Readings readings;
  Eigen::VectorXd sensor_noise_K = {};  ///< (sensors) standard deviation of one temperature, noise
                                        ///< and rounding; empty: none
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

/// What a model leaves of a channel on a day that neither chose nor fitted.
struct DayGrade {
  std::string day;
  errors::identification::Spread left;  ///< mm or rad
  double drift_range = 0.0;             ///< mm or rad, highest less lowest
  int rows = 0;
  int outside = 0;  ///< rows beyond the trained range, graded all the same
};

/// One channel of the drift by a model of the chosen sensors, fitted on the first day.
struct ChannelGrade {
  std::string name;
  bool angle = false;
  double training_range = 0.0;                ///< mm or rad, highest less lowest
  errors::identification::ThermalFit fitted;  ///< what follows is empty where it has no model
  errors::identification::Spread in_cycle;    ///< mm or rad, left of the first day
  std::vector<DayGrade> other_days;
};

/// Where the degree with a displacement began that divides by its first value.
struct DegreeStart {
  std::string channel;
  struct Row {
    int row = 0;
    double since_start_s = 0.0;
    double drift = 0.0;  ///< mm
  };
  std::optional<Row> at;  ///< none: it drifts within its noise and takes no part
};

/// A way to choose, what it chose on the first day, and what that is worth.
struct SensorChoiceGrade {
  SensorChoiceDescription::Way way;
  bool since_start = false;  ///< its temperatures counted from the start of the day
  errors::identification::SensorChoice choice;     ///< indices into the sensors logged
  std::vector<std::string> chosen;                 ///< names, in the order in which it chose them
  std::optional<std::vector<DegreeStart>> begins;  ///< of a degree that divides by a first value
  std::vector<ChannelGrade> channels;
  std::optional<double> rms_over_range;  ///< of all displacements on all other days, if any
  std::optional<errors::identification::RandomChoices> random;  ///< of as many sensors, graded in
                                                                ///< the same way
  std::optional<errors::identification::ChoiceSpread> spread;   ///< none of sensors that are fixed
};

/// Which sensors were chosen and what a model of them is good for.
struct ThermalChoice {
  std::string training_day;
  Eigen::Index rows = 0;  ///< read on it
  std::vector<std::string> sensors;
  std::vector<SensorChoiceGrade> ways;  ///< the scene's own first, then those beside it
  std::vector<std::string> warnings;    ///< about the first
  std::vector<DriftSeries> series;      ///< of the first
};

/// Chooses sensors and fits a model on what the drift instrument and the sensors read over the
/// first day, and grades both on the other days, which chose and fitted nothing. One set of
/// sensors is chosen for the three displacements together; tilts are predicted from the same ones.
/// Every other way to choose that the scene lists is graded beside, by the same models on the same
/// days. Every choice is made again from other start rows with the noise of sensors and drift drawn
/// again, and compared with random choices of as many sensors. A degree that divides by a first
/// value begins, for each displacement, at the first drift beyond four standard deviations of its
/// noise, with temperatures in deg C as read.
/// @param days  (n >= 1) of one machine; with one day alone there is no grade on days unseen
/// @throws BadInput naming the scene if the instrument or the sensors cannot do that
ThermalChoice thermal_choice(const std::vector<DayReadings>& days,
                             const SensorChoiceDescription& description);

}  // namespace abbe::sim
