#pragma once

#include <limits>

#include <Eigen/Core>

namespace abbe::render {

/// The figures printed with a map; NaN where there are none.
struct Figures {
  double pv_um = std::numeric_limits<double>::quiet_NaN();
  double rms_um = std::numeric_limits<double>::quiet_NaN();   ///< weighted
  double mean_um = std::numeric_limits<double>::quiet_NaN();  ///< weighted
};

/// Figures of the finite deviations (n), weighted by area (n, >= 0); sums run in the order given.
/// @throws std::invalid_argument if sizes differ or a weight is negative or not finite
Figures figures(const Eigen::VectorXd& deviation_um, const Eigen::VectorXd& weights);

}  // namespace abbe::render
