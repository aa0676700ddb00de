#pragma once

#include "errors/identification/thermal_data.h"

namespace abbe::errors::identification {

/// What is made of the temperatures of a run before a model sees them. Every feature of a row uses
/// that row and earlier ones of its own run only, as a control could.
struct ThermalFeatures {
  bool since_start = false;  ///< each input minus its value at the first row of the run
  /// Beside every input its copy behind a first-order lag of this many rows, the reaction of a mass
  /// that it heats; it starts settled at the first row. 0: none.
  double lag_rows = 0.0;
};

/// The same rows, lagged copies named "NAME lag".
/// @throws std::invalid_argument if lag_rows < 0 or not finite
ThermalData with_features(const ThermalData& data, const ThermalFeatures& features);

/// y counted from the first row of each run: another problem, that of a control which resets its
/// zero at the start of a run.
ThermalData zeroed(const ThermalData& data);

}  // namespace abbe::errors::identification
