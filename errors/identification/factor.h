#pragma once

#include <vector>

#include <Eigen/Core>

#include "kinematics/decompositions.h"

namespace abbe::errors::identification {

/// A weighted design matrix, its columns scaled to unit norm and taken apart once; where columns
/// are dependent some are left out by rank of preference, never by a pseudo-inverse.
struct Factor {
  std::vector<int> found;  ///< columns that are solved for
  std::vector<int> left;   ///< columns left out, one for each direction that nothing determines
  Eigen::MatrixXd hidden;  ///< (columns x left) what reads the same as a unit of each column left
                           ///< out; 0 where that is below 1e-6 of it, rows of `left` are 0
  double condition = 0.0;  ///< of the scaled matrix over what is solved for, to some percent
  int rows = 0;

  HouseholderQr outer;   ///< of the scaled matrix, sought columns
  HouseholderQr inner;   ///< of its triangle, columns found
  Eigen::VectorXd norm;  ///< (found) that the columns were divided by
};

/// @param A           (m x n) rows in standard deviations
/// @param sought      (n) 0: not solved for and not looked at
/// @param preference  (n) columns of the lowest are left out first; among equals that take part
///                    to a tenth of the most, the last
/// @param tolerance   least pivot that counts, of the largest
Factor factor(const Eigen::MatrixXd& A, const std::vector<char>& is_sought,
              const std::vector<int>& preference, double tolerance);

/// Least squares: changes of the columns found for right-hand sides b. (found)
Eigen::VectorXd solve(const Factor& factor, const Eigen::VectorXd& b);

/// (found x found), of b of unit variance.
Eigen::MatrixXd covariance(const Factor& factor);

/// Share of every row in its own fit, the diagonal of A (A'A)^-1 A'. (rows of A)
Eigen::VectorXd leverage(const Factor& factor, const Eigen::MatrixXd& A);

}  // namespace abbe::errors::identification
