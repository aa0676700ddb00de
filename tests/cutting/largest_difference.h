#pragma once

#include "cutting/surface/surface.h"
#include "tests/test.h"

namespace abbe::cutting {

/// NaN if there is one.
inline double largest_difference(const Surface& surface, const std::vector<double>& expected) {
  double worst = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double difference = std::abs(surface.residual[Index(i)] - expected[i]);
    if (std::isnan(difference)) return difference;
    worst = std::max(worst, difference);
  }
  return worst;
}

}  // namespace abbe::cutting
