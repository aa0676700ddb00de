#pragma once

#include "errors/identification/thermal_model.h"

namespace abbe::errors::identification {

/// Options of a kind of model whose sigma is not taken from whole runs.
inline ThermalModelOptions options_of(ModelKind kind, double penalty = 1e-2) {
  ThermalModelOptions options;
  options.kind = kind;
  options.penalty = penalty;
  options.sigma_from_runs = false;
  return options;
}

}  // namespace abbe::errors::identification
