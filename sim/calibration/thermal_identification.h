#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/geometric.h"
#include "errors/identification/estimate.h"
#include "errors/identification/sensor_choice.h"
#include "errors/identification/thermal_epochs.h"
#include "errors/metrology/readings.h"
#include "sim/compensation/machine_belief.h"

/// Identification of thermal beliefs: positioning from several starts, and readings over a day.
namespace abbe::sim {

inline constexpr double um_per_m = 1e-6;  ///< of a slope, mm per mm

/// Options of the composite method.
struct CompositeIdentification {
  std::vector<std::string> sensors;  ///< temperatures on whose changes the slopes are regressed
  int degree = 4;                    ///< of the cold polynomial
  double margin = 0.1;  ///< fraction of a sensor's trained range by which it may be exceeded
};

/// Positioning of one axis, separated into cold curve and thermal slope.
struct CompositeAxis {
  char axis = 'X';
  double cold_s = 0.0;     ///< time of the first start; 0 is the start of the program
  Eigen::VectorXd cold_C;  ///< (sensors) temperatures at that time, for which the slope is zero
  errors::identification::CompositeFit fit;
  /// Regression of the slopes of the later starts with an additional constant: the slope at dT = 0
  /// that the temperatures do not explain. Empty unless there are two starts more than sensors.
  std::optional<errors::identification::Regression> with_constant;
};

/// Yang's separation of the positioning from several starts into a cold curve and a slope that
/// depends on temperatures: delta(p, T) = delta_G(p) + delta_T(T) p. Each of the two is a belief.
/// The thermal part is zero at the temperatures of the first start, so the cold curve contains the
/// cold slope.
struct Composite {
  errors::GeometricErrors cold;  ///< curve of the first start: a polynomial of the carriage's
                                 ///< displacement for each axis, with covariance
  compensation::ThermalBelief thermal;  ///< a slope for each axis, linear in absolute temperatures
  std::vector<CompositeAxis> axes;
  std::vector<std::string> warnings;
};

/// Identifies the cold curves and thermal slopes of slides.
/// @param readings  positioning of slides along axes of the bed, with the same set-ups at every
///     start; at the first start the temperature changes are zero
/// @throws std::invalid_argument if the readings or sensors do not suffice; one start more than
///     sensors is needed
Composite identify_composite(const errors::metrology::Readings& readings,
                             const CompositeIdentification& options);

/// Options of the thermal method.
struct ThermalIdentification {
  /// Names such as "EZS". The positioning of a slide has an offset and, if it was read at several
  /// positions, a slope. Empty: positioning and angles of the slides, positions of the rotary axes
  /// and of the nose, without those that do not exceed their noise.
  std::vector<std::string> elements = {};
  std::vector<std::string> sensors = {};  ///< empty: chosen from the logged sensors
  errors::identification::SensorChoiceOptions choice = {};  ///< if no sensors are named
  /// A coefficient of the default elements is left out if its RMS over the day is less than this
  /// multiple of its standard uncertainty.
  double min_signal = 4.0;
  /// Fraction of a sensor's trained range by which the model is extrapolated; further outside it is
  /// held.
  double margin = 0.1;
};

/// Coefficient of an element over the epochs, and its regression on temperatures.
struct RegressedTerm {
  errors::ElementName name;
  bool slope = false;         ///< true: slope of the positioning along its slide; false: offset
  Eigen::VectorXd at_epochs;  ///< (epochs) mm or rad; a slope over a metre of travel
  Eigen::VectorXd sigma;      ///< (epochs) standard uncertainty
  errors::identification::Regression regression;  ///< on the changes of temperature; mm or rad, a
                                                  ///< slope per mm of travel
};
/// Returns the name of a term, "EXX slope" or "EZS offset".
std::string name_of(const RegressedTerm& term);

/// Sensors chosen from the logged ones.
struct ChosenSensors {
  std::vector<std::string> logged;
  errors::identification::SensorChoice choice;  ///< indices into `logged`
};

/// Result of the thermal method over a day.
struct ThermalDay {
  std::vector<errors::identification::Epoch> epochs;
  std::vector<std::string> sensors;     ///< of the regression of every term
  std::optional<ChosenSensors> chosen;  ///< if no sensors were named
  Eigen::MatrixXd dT_K;  ///< (epochs x sensors) mean change of temperature since the first epoch
  double margin = 0.0;   ///< fraction of a sensor's trained range by which it may be exceeded
  std::vector<RegressedTerm> terms;
};

/// Effect of heat on a machine, identified from readings over a day.
struct ThermalIdentificationResult {
  compensation::ThermalBelief belief;  ///< linear in changes of temperature since the first epoch
  ThermalDay day;
  std::vector<errors::identification::ConfoundedCoefficient> confounded;
  std::vector<std::string> warnings;
};

/// Identifies the elements at every epoch of a day (errors/identification/thermal_epochs.h) and
/// regresses each on temperatures. Readings refer to those of the first epoch, so the errors of the
/// cold machine cancel. The coefficients are estimated by `estimate` on the exact chain. Bound: for
/// a day without noise the coefficients per K are exact to 1e-9 of the largest if the cold machine
/// is perfect, and to 2e-5 if its errors are 60 um and 60 urad.
/// @param readings  of one machine and one day, each with temperatures
/// @throws std::invalid_argument if the readings, elements or sensors do not suffice
ThermalIdentificationResult identify_thermal(std::span<const errors::metrology::Readings> readings,
                                             const ThermalIdentification& options = {});

}  // namespace abbe::sim
