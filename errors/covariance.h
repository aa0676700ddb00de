#pragma once

#include <vector>

#include <Eigen/Core>

namespace abbe::errors {

/// One number of one curve of a description.
struct Coefficient {
  int element = 0;  ///< index in the elements
  int curve = 0;    ///< index in its curves
  int number = 0;   ///< index in the shape
  friend bool operator==(const Coefficient&, const Coefficient&) = default;
};

/// How well the numbers of a description are known; empty: they are taken as they stand. Numbers
/// that are zero by convention (the constant of an error motion, say) have zero variance.
struct Covariance {
  std::vector<Coefficient> of;  ///< (m)
  Eigen::MatrixXd matrix;       ///< (m x m) products of mm and rad
};

}  // namespace abbe::errors
