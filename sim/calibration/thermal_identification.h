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

/// Options of the composite method.
struct CompositeIdentification {
  std::vector<std::string> sensors;  ///< temperatures over whose changes the slopes are regressed
  int degree = 4;                    ///< of the cold polynomial
  double margin = 0.1;  ///< fraction of a sensor's trained range by which it may leave it
};

/// The separated positioning of one axis.
struct CompositeAxis {
  char axis = 'X';
  double cold_s = 0.0;     ///< time at which its first start began; 0 is the start of the program
  Eigen::VectorXd cold_C;  ///< (sensors) temperatures at that time, at which the slope is zero
  errors::identification::CompositeFit fit;
  /// Regression of the slopes of the later starts with an additional constant, which is what the
  /// temperatures do not explain at dT = 0. None with fewer than two starts more than sensors.
  std::optional<errors::identification::Regression> with_constant;
};

/// Yang's separation of a positioning read from several starts into a cold curve and a slope that
/// follows temperatures: delta(p, T) = delta_G(p) + delta_T(T) p. Together they are the law, and
/// each is a belief. At the temperatures of the first start the thermal part is zero, so the cold
/// slope is in the cold curve alone.
struct Composite {
  errors::GeometricErrors cold;  ///< the curve of the first start, a polynomial for each axis in
                                 ///< displacements of the carriage, with covariance
  compensation::ThermalBelief thermal;  ///< a slope for each axis, linear in absolute temperatures
  std::vector<CompositeAxis> axes;
  std::vector<std::string> warnings;
};

/// Identifies the cold curves and thermal slopes of slides.
/// @param readings  positioning of slides along axes of the bed, with the same set-ups from every
///     start; at the first start the temperature changes are zero
/// @throws std::invalid_argument in a sentence if the readings or sensors do not suffice; one more
///     start than sensors is needed
Composite identify_composite(const errors::metrology::Readings& readings,
                             const CompositeIdentification& options);

/// Options of the thermal method.
struct ThermalIdentification {
  /// Names such as "EZS"; for the positioning of a slide its offset and, if it moved, its slope.
  /// Empty: positioning and angles of the slides, positions of the rotary axes and the nose,
  /// without those that do not move beyond their noise.
  std::vector<std::string> elements = {};
  std::vector<std::string> sensors = {};  ///< empty: chosen from the logged sensors
  errors::identification::SensorChoiceOptions choice = {};  ///< if no sensors are named
  /// A number is left out of the default elements if over the day it moves by less than so many of
  /// its standard uncertainties (RMS).
  double min_signal = 4.0;
  /// Fraction of a sensor's trained range by which its model continues beyond it; farther out it is
  /// held.
  double margin = 0.1;
};

/// A coefficient of an element over the epochs, and its regression on temperatures.
struct RegressedTerm {
  errors::ElementName name;
  bool slope = false;         ///< true: slope of the positioning along its slide; false: offset
  Eigen::VectorXd at_epochs;  ///< (epochs) mm or rad; a slope over a metre of travel
  Eigen::VectorXd sigma;      ///< (epochs) standard uncertainty
  errors::identification::Regression regression;  ///< on the changes of temperature; mm or rad, a
                                                  ///< slope per mm of travel
};
std::string name_of(const RegressedTerm& term);  ///< "EXX slope", "EZS offset"

/// The sensors chosen from those that were logged.
struct ChosenSensors {
  std::vector<std::string> logged;
  errors::identification::SensorChoice choice;  ///< indices into `logged`
};

/// The result of the thermal method over a day.
struct ThermalDay {
  std::vector<errors::identification::Epoch> epochs;
  std::vector<std::string> sensors;     ///< of the regression of every term
  std::optional<ChosenSensors> chosen;  ///< if none were named
  Eigen::MatrixXd dT_K;  ///< (epochs x sensors) mean change of temperature since the first epoch
  double margin = 0.0;   ///< fraction of its trained range by which a sensor may leave it
  std::vector<RegressedTerm> terms;
};

/// The effect of heat on a machine, identified from readings over a day.
struct ThermalIdentificationResult {
  compensation::ThermalBelief belief;  ///< linear in changes of temperature since the first epoch
  ThermalDay day;
  std::vector<errors::identification::Confounded> confounded;
  std::vector<std::string> warnings;
};

/// Identifies the elements at every epoch of a day (errors/identification/thermal_epochs.h) and
/// regresses each on temperatures. Readings count from those of the first epoch, so the errors of
/// the cold machine cancel; the coefficients are those of `estimate` on the exact chain. Bound: for
/// a day without noise the coefficients per K are returned to 1e-9 of the largest if the cold
/// machine is perfect, to 2e-5 if it is wrong by 60 um and 60 urad.
/// @param readings  of one machine and one day, each with temperatures
/// @throws std::invalid_argument in a sentence if the readings, elements or sensors do not suffice
ThermalIdentificationResult identify_thermal(std::span<const errors::metrology::Readings> readings,
                                             const ThermalIdentification& options = {});

}  // namespace abbe::sim
