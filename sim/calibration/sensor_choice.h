#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/sensor_choice.h"
#include "errors/metrology/readings.h"
#include "sim/scene/instruments.h"

/// Choice of temperature sensors for a thermal model, and its grades on days not used for the
/// choice.
namespace abbe::sim {

/// Readings of the drift instrument and the sensors of a machine over one day.
struct DayReadings {
  std::string name;
  std::filesystem::path file;          ///< scene, for messages
  std::vector<double> cycle_starts_s;  ///< times at which spindle or axes start after a rest
  errors::metrology::Readings readings;
  Eigen::VectorXd sensor_noise_K = {};  ///< (sensors) standard deviation of one temperature by
                                        ///< noise and rounding; empty: zeros
};

/// Drift of one channel over one day, for pictures.
struct DriftSeries {
  std::string day;
  std::string channel;
  bool angle = false;
  Eigen::VectorXd hours;      ///< (n)
  Eigen::VectorXd read;       ///< (n) mm or rad
  Eigen::VectorXd predicted;  ///< (n) by the model of the chosen sensors, fitted on the first day
};

/// Grade of a model of a channel on a day not used for choice or fit.
struct DayGrade {
  std::string day;
  errors::identification::Spread left;  ///< residual, mm or rad
  double drift_range = 0.0;             ///< mm or rad, highest minus lowest
  int rows = 0;
  int outside = 0;  ///< number of rows outside the trained range; the grade includes them
};

/// Channel of the drift, with a model of the chosen sensors that is fitted on the first day.
struct ChannelGrade {
  std::string name;
  bool angle = false;
  double training_range = 0.0;                ///< mm or rad, highest minus lowest
  errors::identification::ThermalFit fitted;  ///< the members below are empty if it has no model
  errors::identification::Spread training_residual;  ///< mm or rad, residual on the first day
  std::vector<DayGrade> other_days;
};

/// Start of the degree of a displacement, for degrees that divide by an initial value.
struct DegreeStart {
  std::string channel;
  /// First row of the degree.
  struct Row {
    int row = 0;
    double since_start_s = 0.0;
    double drift = 0.0;  ///< mm
  };
  std::optional<Row> at;  ///< empty: the displacement drifts within its noise and is not used
};

/// Grade of a selection method and of the sensors that it chooses on the first day.
struct SensorChoiceGrade {
  SensorChoiceDescription::SelectionMethod way;
  bool since_start = false;                     ///< temperatures refer to the start of the day
  errors::identification::SensorChoice choice;  ///< indices of the logged sensors
  std::vector<std::string> chosen;              ///< names, in the order of choice
  std::optional<std::vector<DegreeStart>>
      begins;  ///< for a degree that divides by an initial value
  std::vector<ChannelGrade> channels;
  std::optional<double> rms_over_range;  ///< of all displacements on all other days; empty for a
                                         ///< single day
  /// Grades of random selections of as many sensors.
  std::optional<errors::identification::RandomChoices> random;
  std::optional<errors::identification::ChoiceSpread> spread;  ///< empty for fixed sensors
};

/// Chosen sensors and the grades of their models.
struct ThermalSensorChoice {
  std::string training_day;
  Eigen::Index rows = 0;  ///< number of rows of the training day
  std::vector<std::string> sensors;
  std::vector<SensorChoiceGrade> ways;  ///< the scene's method first, then the compared ones
  std::vector<std::string> warnings;    ///< about all methods, about sensors of the first
  std::vector<DriftSeries> series;      ///< of the first method
};

/// Chooses sensors and fits a model on the readings of the first day, and grades both on the other
/// days. One set of sensors is chosen for the three displacements together; the same sensors
/// predict the tilts. The other methods of the scene are graded with the same models on the same
/// days. Every choice is repeated from other start rows with new noise of sensors and drift, and is
/// compared with random selections of as many sensors. A degree that divides by an initial value
/// starts, for each displacement, at the first drift beyond four standard deviations of its noise,
/// with temperatures in deg C as read.
/// @param days  (n >= 1) of one machine; a single day gives no grade on other days
/// @throws BadInput naming the scene if the instrument or the sensors do not suffice
ThermalSensorChoice choose_thermal_sensors(const std::vector<DayReadings>& days,
                                           const SensorChoiceDescription& description);

}  // namespace abbe::sim
