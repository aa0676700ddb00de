#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "sim/study/distribution.h"

namespace abbe::sim::study {

/// How two inputs go together.
struct Correlation {
  int a = 0;         ///< index of an input
  int b = 0;         ///< of another one
  double rho = 0.0;  ///< -1 .. 1, of the normal scores of both
};

/// How inputs vary together: a Gaussian copula, the correlation of their normal scores. Between
/// inputs that are normal and not cut off it is the correlation of the values; of others the values
/// correlate a little less. Immutable once made.
class Copula {
 public:
  /// Correlated inputs: their scores are `factor` times as many independent ones.
  struct Group {
    std::vector<int> of;     ///< (m) ascending
    Eigen::MatrixXd factor;  ///< (m x m) lower triangular, rows of norm 1: the first of a group
                             ///< follows its own coordinate alone
  };

  /// @param inputs        how many there are
  /// @param correlations  pairs that are not named are independent
  /// @throws std::invalid_argument if an index or rho is out of range, a pair appears twice, or no
  ///         numbers can be correlated so: an eigenvalue is below -1e-8 (that of rounding is taken
  ///         for 0, so full correlation and groups of less rank are fine)
  explicit Copula(int inputs, std::span<const Correlation> correlations = {});

  /// @param correlation  (inputs x inputs) of the scores, symmetric, ones on the diagonal, to 1e-9
  /// @throws the same
  explicit Copula(const Eigen::MatrixXd& correlation);

  int inputs() const { return inputs_; }
  /// Inputs that are in no group are independent of all others.
  const std::vector<Group>& groups() const { return groups_; }

 private:
  int inputs_ = 0;
  std::vector<Group> groups_;
};

/// A covariance taken apart. What does not vary has standard deviation 0 and no correlation, so
/// value = belief + standard_deviation * score draws from any belief, of full rank or not.
struct Correlated {
  Eigen::VectorXd standard_deviation;  ///< (m)
  Copula copula;                       ///< of m inputs
};
/// @param covariance  (m x m)
/// @throws std::invalid_argument if it is not symmetric to 1e-9, a variance is negative, what does
///         not vary covaries, something is not finite, or as the copula
Correlated correlated(const Eigen::MatrixXd& covariance);

/// Standard normal numbers that correlate as the copula says; bit for bit the same for a case in
/// whatever company it is drawn.
/// @param u  (inputs x cases) within the open unit cube
/// @return   (inputs x cases)
/// @throws std::invalid_argument if u is of another number of inputs
Eigen::MatrixXd scores(const Copula& copula, const Eigen::MatrixXd& u);

/// Values of the inputs: of an independent one `quantile(u)` and nothing else, of a correlated one
/// its value at its score. Bits as above.
/// @param u          (inputs x cases) within the open unit cube
/// @param marginals  (inputs) without a fault
/// @return           (inputs x cases)
/// @throws std::invalid_argument if the numbers of inputs differ
Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u);

}  // namespace abbe::sim::study
