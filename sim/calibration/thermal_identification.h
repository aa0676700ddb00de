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

namespace abbe::sim {

struct CompositeIdentification {
  std::vector<std::string> sensors;  ///< whose changes the slopes are regressed on
  int degree = 4;                    ///< of the cold polynomial
  double margin = 0.1;               ///< part of a sensor's trained range by which it may leave it
};

/// One axis, as it was read and separated.
struct CompositeAxis {
  char axis = 'X';
  double cold_s = 0.0;     ///< when its first start began; 0 is the start of the program
  Eigen::VectorXd cold_C;  ///< (sensors) temperatures then, at which the slope is zero
  errors::identification::CompositeFit fit;
  /// The slopes of the later starts regressed with a constant as well: what the temperatures leave
  /// at dT = 0. None for fewer than two starts beyond the number of sensors.
  std::optional<errors::identification::Regression> with_constant;
};

/// Yang's separation of a positioning that was read from several starts into a cold curve and a
/// slope that follows temperatures: delta(p, T) = delta_G(p) + delta_T(T) p. Both together are the
/// law, each is a belief: where the first start's temperatures come again the thermal part is zero,
/// so the cold slope stands in the cold curve alone.
struct Composite {
  errors::GeometricErrors cold;  ///< the curve of the first start, a polynomial an axis, of the
                                 ///< carriage itself, with covariance
  compensation::ThermalBelief thermal;  ///< a slope an axis, linear in absolute temperatures
  std::vector<CompositeAxis> axes;
  std::vector<std::string> warnings;
};

/// @param readings  positioning of slides along axes of the bed, the same set-ups from every start;
///                  at the first the temperature changes are zero
/// @throws std::invalid_argument in a sentence if the readings or sensors cannot do that; one more
///         start than sensors is needed
Composite identify_composite(const errors::metrology::Readings& readings,
                             const CompositeIdentification& options);

struct ThermalIdentification {
  /// "EZS", of a slide's positioning offset and, where it moved, slope; empty: positioning and
  /// angles of the slides, the places of the rotary axes and the nose, less what does not move
  /// beyond its noise.
  std::vector<std::string> elements = {};
  std::vector<std::string> sensors = {};  ///< empty: chosen from those that were logged
  errors::identification::SensorChoiceOptions choice = {};  ///< where none are named
  /// A number of the list for which nobody asked is left out where, over the day, it moves by less
  /// than so many of its standard uncertainties (RMS).
  double min_signal = 4.0;
  /// Part of a sensor's trained range by which its model may go on beyond it; farther it is held.
  double margin = 0.1;
};

/// One number of an element over the epochs, and how it follows the temperatures.
struct RegressedTerm {
  errors::ElementName name;
  bool slope = false;         ///< of the positioning along its slide, else an offset
  Eigen::VectorXd at_epochs;  ///< (epochs) mm or rad; of a slope over a metre of travel
  Eigen::VectorXd sigma;      ///< (epochs) its standard uncertainty
  errors::identification::Regression regression;  ///< on the changes of temperature; mm or rad, of
                                                  ///< a slope per mm of travel
};
std::string name_of(const RegressedTerm& term);  ///< "EXX slope", "EZS offset"

/// How sensors were chosen from those that were logged.
struct ChosenSensors {
  std::vector<std::string> logged;
  errors::identification::SensorChoice choice;  ///< indices into `logged`
};

/// A day, regressed.
struct ThermalDay {
  std::vector<errors::identification::Epoch> epochs;
  std::vector<std::string> sensors;     ///< on which every term is regressed
  std::optional<ChosenSensors> chosen;  ///< where none were named
  Eigen::MatrixXd dT_K;  ///< (epochs x sensors) mean change of temperature since the first epoch
  double margin = 0.0;   ///< part of its trained range by which a sensor may leave it
  std::vector<RegressedTerm> terms;
};

/// What heat does to a machine, from readings over a day.
struct ThermalIdentificationResult {
  compensation::ThermalBelief belief;  ///< linear in changes of temperature since the first epoch
  ThermalDay day;
  std::vector<errors::identification::Confounded> confounded;
  std::vector<std::string> warnings;
};

/// Finds the elements at every epoch of a day (errors/identification/thermal_epochs.h) and
/// regresses each on temperatures. Readings count from those of the first epoch, so that what is
/// wrong with the cold machine drops out; numbers are then those of `estimate` on the exact chain.
/// Bound: of a day without noise numbers per K come back to 1e-9 of the largest where the machine
/// is perfect when cold, to 2e-5 where it is wrong by 60 um and 60 urad then.
/// @param readings  of one machine and one day, each with temperatures
/// @throws std::invalid_argument in a sentence if the readings, elements or sensors cannot do that
ThermalIdentificationResult identify_thermal(std::span<const errors::metrology::Readings> readings,
                                             const ThermalIdentification& options = {});

}  // namespace abbe::sim
