#include "render/figures.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::render {

Figures figures(const Eigen::VectorXd& deviation_um, const Eigen::VectorXd& weights) {
  if (deviation_um.size() != weights.size()) {
    throw std::invalid_argument("figures: one weight a deviation is needed");
  }
  if (!weights.allFinite() || (weights.size() > 0 && weights.minCoeff() < 0.0)) {
    throw std::invalid_argument("figures: weights must be finite and not negative");
  }
  Figures result;
  double total = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (Eigen::Index i = 0; i < deviation_um.size(); ++i) {
    const double d = deviation_um[i];
    if (!std::isfinite(d)) continue;
    total += weights[i];
    sum += weights[i] * d;
    squares += weights[i] * d * d;
    lowest = std::min(lowest, d);
    highest = std::max(highest, d);
  }
  if (highest >= lowest) result.pv_um = highest - lowest;
  if (total > 0.0) {
    result.mean_um = sum / total;
    result.rms_um = std::sqrt(squares / total);
  }
  return result;
}

}  // namespace abbe::render
