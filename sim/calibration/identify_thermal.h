#pragma once

#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "errors/identification/estimate.h"
#include "errors/identification/sensor_choice.h"
#include "errors/metrology/readings.h"
#include "sim/compensation/thermal_belief.h"

namespace abbe::sim {

struct ThermalIdentification {
  /// "EZS", of a slide's positioning offset and, where it moved, slope; empty: positioning and
  /// angles of the slides, the places of the rotary axes and the nose, less what does not move
  /// beyond its noise.
  std::vector<std::string> elements = {};
  std::vector<std::string> sensors = {};  ///< empty: chosen from those that were logged
  errors::identification::SensorChoiceOptions choice = {};  ///< where none are named
  /// A number of the list for which nobody asked is left out where, over the day, it moves by less
  /// than so many of its standard uncertainties (RMS).
  double least_signal = 4.0;
  /// Part of a sensor's trained range by which its model may go on beyond it; farther it is held.
  double margin = 0.1;
};

/// What heat does to a machine, from readings over a day.
struct IdentifiedThermal {
  compensation::ThermalBelief belief;  ///< linear in changes of temperature since the first epoch
  nlohmann::ordered_json report;       ///< epochs, choice of sensors, a model a term
  std::vector<errors::identification::Confounded> confounded;
  std::vector<std::string> warnings;
};

/// Finds the elements at every epoch of a day (thermal_epochs.h) and regresses each on
/// temperatures. Readings count from those of the first epoch, so that what is wrong with the cold
/// machine drops out; numbers are then those of `estimate` on the exact chain.
/// Bound: of a day without noise numbers per K come back to 1e-9 of the largest where the machine
/// is perfect when cold, to 2e-5 where it is wrong by 60 um and 60 urad then.
/// @param readings  of one machine and one day, each with temperatures
/// @throws std::invalid_argument in a sentence if the readings, elements or sensors cannot do that
IdentifiedThermal identify_thermal(std::span<const errors::metrology::Readings> readings,
                                   const ThermalIdentification& options = {});

}  // namespace abbe::sim
