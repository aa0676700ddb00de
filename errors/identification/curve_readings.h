#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/estimate.h"

namespace abbe::errors::identification {

/// One identified element over its axis, with its uncertainty and the readings that bear on it.
struct CurveReadings {
  ElementName element;
  Eigen::VectorXd q;          ///< (k) mm or rad, over where the axis was read
  Eigen::VectorXd value;      ///< (k) mm or rad, the mean of both ways of approach
  Eigen::VectorXd sigma;      ///< (k) standard uncertainty of it
  Eigen::VectorXd reading_q;  ///< (r) positions of the readings that bear on this element
  Eigen::VectorXd reading;    ///< (r) its value there as each reading alone would have it, all else
                              ///< as identified; readings left out as outliers are left out here
};

/// Every element of a belief that has a curve, in its order; a location error or a constant has
/// none. A reading bears on an element whose numbers, each 1 um or 10 urad, would change it at
/// least a quarter as much as those of the element that changes it most.
/// @param readings  those of the estimate
std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const metrology::Readings> readings);

}  // namespace abbe::errors::identification
