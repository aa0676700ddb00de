#pragma once

#include <vector>

#include <Eigen/Core>

#include "kinematics/decompositions.h"

namespace abbe::errors::identification {

/// Factorisation of a weighted design matrix with columns scaled to unit norm. Dependent columns
/// are left out by preference, never by a pseudo-inverse.
struct Factor {
  std::vector<int> determined;  ///< columns that are solved for
  std::vector<int> left_out;    ///< columns left out, one for each dimension of the null space
  Eigen::MatrixXd hidden;  ///< (columns x left) combination of columns with the same effect as a
                           ///< unit of each column left out; 0 below 1e-6 of its effect; rows of
                           ///< `left_out` are 0
  double condition = 0.0;  ///< condition number of the scaled matrix of the columns found, to a few
                           ///< per cent
  int rows = 0;            ///< of the matrix

  HouseholderQr outer;   ///< of the scaled matrix, sought columns
  HouseholderQr inner;   ///< of its triangle, columns found
  Eigen::VectorXd norm;  ///< (found) scale by which the columns were divided
};

/// Factorises a design matrix.
/// @param A          (m x n) rows in standard deviations
/// @param is_sought  (n) 0: not solved for, ignored
/// @param preference (n) columns of the lowest preference are left out first; among equals that
///                   contribute at least a tenth of the largest contribution, the last
/// @param tolerance  smallest pivot that counts, relative to the largest
Factor factor(const Eigen::MatrixXd& A, const std::vector<char>& is_sought,
              const std::vector<int>& preference, double tolerance);

/// Returns the least-squares changes of the columns found for right-hand sides b (found).
Eigen::VectorXd solve(const Factor& factor, const Eigen::VectorXd& b);

/// Returns the covariance (found x found) for b of unit variance.
Eigen::MatrixXd covariance(const Factor& factor);

/// Returns the leverage of every row: the diagonal of A (A'A)^-1 A' (rows of A).
Eigen::VectorXd leverage(const Factor& factor, const Eigen::MatrixXd& A);

}  // namespace abbe::errors::identification
