#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::sim {

/// Yang's separation of a positioning that was read from several starts into a cold curve and a
/// slope that follows temperatures.
struct Composite {
  errors::GeometricErrors cold;  ///< the curve of the first start, a polynomial an axis
  nlohmann::ordered_json axes;   ///< an entry an axis: slopes of the later starts, per_K, rms
  std::vector<std::string> warnings;
};

/// @param readings  positioning of slides, the same set-ups from every start; at the first, which
/// is
///                  named in the report, the temperature changes are zero
/// @param sensors   whose changes the slopes are regressed on; one more start than these is needed
/// @param degree    of the cold polynomial
/// @throws std::invalid_argument in a sentence if the readings or sensors cannot do that
Composite identify_composite(const errors::metrology::Readings& readings,
                             const std::vector<std::string>& sensors, int degree);

}  // namespace abbe::sim
