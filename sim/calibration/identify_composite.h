#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/geometric.h"
#include "errors/identification/composite.h"
#include "errors/metrology/readings.h"
#include "sim/compensation/thermal_belief.h"

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

}  // namespace abbe::sim
