#pragma once

#include <string>
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

// Linear regression with diagnostics, ridge regression and LASSO.

/// Linear dependence of a column on others: column = sum of factor times the columns in `with`.
struct Dependence {
  int column = 0;              ///< index in A; -1: the constant
  std::vector<int> with;       ///< indices of the other columns, -1: the constant
  std::vector<double> factor;  ///< one for each of `with`
};
/// Outcome of a regression.
enum class RegressionStatus {
  Ok,
  TooFewRows,     ///< fewer rows of non-zero weight than coefficients
  RankDeficient,  ///< `confounded` names the columns; nothing else is filled in
};
struct RegressionOptions {
  bool constant = true;    ///< also fit a constant
  Eigen::VectorXd weight;  ///< (n) >= 0, 1 / variance up to a factor; empty: all 1
  /// A column is confounded if less than this fraction of its length remains after projection on
  /// the others.
  double rank_tolerance = 1e-11;
};
/// Result of weighted least squares. With more rows than coefficients the variance is estimated
/// from the residuals; with as many rows as coefficients it is unknown, and everything that depends
/// on it is 0.
struct Regression {
  RegressionStatus status = RegressionStatus::Ok;
  std::vector<Dependence> confounded;

  double constant = 0.0;       ///< 0 if not requested
  Eigen::VectorXd beta;        ///< (p)
  Eigen::MatrixXd covariance;  ///< (q x q) of [constant, beta], q = p + 1; of beta if no constant
  Eigen::VectorXd standard_error;  ///< (q) in the same order
  Eigen::VectorXd residual;        ///< (n) y minus fit
  Eigen::VectorXd leverage;        ///< (n) diagonal of the hat matrix
  int degrees_of_freedom = 0;      ///< rows of non-zero weight minus q
  double residual_sd = 0.0;        ///< sqrt(weighted sum of squares / degrees of freedom)
  double r_squared = 0.0;          ///< about the weighted mean; about 0 without a constant
  double condition = 0.0;          ///< 2-norm, of the design with columns scaled to length 1
  Eigen::VectorXd vif;             ///< (p) variance inflation factors, 1 / (1 - R^2 on the other
                                   ///< columns)
  double press_rms = 0.0;  ///< RMS of each row predicted by a fit to all others; optimistic for
                           ///< rows of one run, which are correlated; see thermal_model.h
};

/// Fits a weighted linear regression by column-pivoted Householder QR with 64-bit mantissas, then
/// one step of refinement with a compensated gradient. The NIST StRD linear sets are reproduced to
/// 12 digits and more, Filip to 7, the limit set by rounding its tenth powers to double;
/// regression_test.cpp prints them.
/// @param A  (n x p), p >= 1, or p >= 0 with a constant
/// @throws std::invalid_argument for shapes that disagree, numbers that are not finite, or a weight
///         < 0
[[nodiscard]] Regression fit_regression(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                        const RegressionOptions& options = {});

/// Returns the dependences as text, e.g. "T3 = 0.5 T1 - 2 constant".
std::string describe(const std::vector<Dependence>& confounded,
                     const std::vector<std::string>& names);

/// Fit with shrunk coefficients, of columns scaled to standard deviation 1; the constant is not
/// penalised.
struct ShrunkFit {
  bool converged = true;
  double constant = 0.0;
  Eigen::VectorXd beta;  ///< (p) in the units of the columns; 0 for a constant column
};

/// Minimises (1/2n) |y - a - Z b|^2 + (penalty/2) |b|^2, Z the scaled columns, by Cholesky.
/// @param penalty  > 0
[[nodiscard]] ShrunkFit fit_ridge(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                  double penalty);

/// Minimises (1/2n) |y - a - Z b|^2 + penalty |b|_1 by coordinate descent. Converged means that
/// every column's gradient g = Z_j' r / n satisfies |g| <= penalty if b_j = 0 and g = penalty
/// sign(b_j) otherwise, both within 1e-9 of `max_penalty`; at most 20 000 sweeps.
/// @param penalty  >= 0
[[nodiscard]] ShrunkFit fit_lasso(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                  double penalty);

/// Returns the smallest LASSO penalty for which every coefficient is 0: the largest |Z_j' (y -
/// mean)| / n.
double max_penalty(const Eigen::MatrixXd& A, const Eigen::VectorXd& y);

}  // namespace abbe::errors::identification
