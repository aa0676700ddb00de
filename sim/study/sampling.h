#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::study {

/// Method by which points are drawn.
enum class Sampling {
  Random,  ///< pseudo-random: independent points
  Sobol,   ///< Sobol's sequence with one random digital shift: fills the cube evenly
};

/// A sequence of points of the open unit cube, each defined by its number alone: the same for any
/// order, thread or computer.
struct Sequence {
  Sampling sampling = Sampling::Random;
  int dimensions = 1;      ///< 1 .. 3600
  std::uint64_t seed = 1;  ///< of the random points, and of the Sobol shift
};

/// Returns the points number `first` to `first + count - 1`; their bits do not depend on how the
/// range is divided into calls. Each coordinate is an odd multiple of 2^-53, so strictly within 0
/// .. 1.
/// Random: SplitMix64's stream (Steele, Lea, Flood 2014) from a state made of seed and number of
/// the point, one draw a dimension. Sobol: Boost's engine with the direction numbers of Joe and Kuo
/// 2008, the bits of every coordinate xored with a random number of its own, which preserves the
/// balance of the sequence exactly; the point at the origin, shifted like the others, is number 0,
/// because leaving it out would spoil that balance (Owen 2022). Sobol points 0 .. 2^k - 1 have one
/// coordinate in every interval of 2^-k of each axis.
/// Time: Random 1 to 2 ns a number. Sobol the same and, in every call wherever it begins, some 0.5
/// us a dimension: request dozens of points together.
/// @return (dimensions x count)
/// @throws std::invalid_argument for dimensions out of range, or more than 2^52 points
Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count);

/// Distribution of an input, in its own unit, truncated at physical limits.
struct Distribution {
  enum class Kind {
    Normal,      ///< centre is the mean, spread the standard deviation, before truncation
    Uniform,     ///< centre +- spread
    Triangular,  ///< within centre +- spread, its mode at the centre
    LogNormal,   ///< centre (> 0) is the median, spread the standard deviation of the logarithm
  } kind = Kind::Normal;
  double centre = 0.0;
  double spread = 1.0;                                    ///< > 0; at most 10 for a logarithm
  double low = -std::numeric_limits<double>::infinity();  ///< lower truncation limit
  double high = std::numeric_limits<double>::infinity();  ///< upper truncation limit
};

/// Returns the reason why a distribution is invalid, to follow "expected" in a message; null if it
/// is valid. The other functions require a valid distribution.
const char* distribution_error(const Distribution& distribution);

/// Returns the quantile p of the distribution: never decreasing in p by more than rounding, always
/// within low .. high.
/// Bound: 1e-12 of the spread (of the logarithm) and four ulp of the value, in both tails down to p
/// or 1 - p of 1e-300.
/// @param p  0 .. 1; 0 and 1 give the ends, which may be infinite
double quantile(const Distribution& distribution, double p);

/// Returns the value that has the same probability below it as a standard normal number has below
/// `score`: the quantile at the normal probability of the score, without the loss of digits near a
/// probability of 1.
double value_at_score(const Distribution& distribution, double score);

/// Return the same values of many points at once, bit for bit; in half the time if the distribution
/// is truncated.
Eigen::VectorXd quantiles(const Distribution& distribution, const Eigen::VectorXd& p);
Eigen::VectorXd values_at_scores(const Distribution& distribution, const Eigen::VectorXd& scores);

/// Returns the standard normal quantile p; infinite at 0 and 1.
double normal_score(double p);

/// Returns the probability of the distribution below a value.
/// Bound: 1e-14 over the probability that the truncation leaves.
double cumulative(const Distribution& distribution, double value);

/// Mean and standard deviation of a distribution.
struct Moments {
  double mean = 0.0;
  double standard_deviation = 0.0;
};
/// Returns the moments of the truncated distribution, however narrow or far out the window is.
/// Bound: relative 1e-10 of the standard deviation for both, and four ulp of the mean.
Moments moments(const Distribution& distribution);

/// Correlation of two inputs.
struct Correlation {
  int a = 0;         ///< index of an input
  int b = 0;         ///< of another one
  double rho = 0.0;  ///< -1 .. 1, of the normal scores of the two inputs
};

/// Joint distribution of the inputs: a Gaussian copula, defined by the correlation of their normal
/// scores. For inputs that are normal and not truncated this is the correlation of the values; for
/// others the values correlate slightly less. Immutable once made.
class Copula {
 public:
  /// Correlated inputs: their scores are `factor` times independent scores.
  struct Group {
    std::vector<int> of;     ///< (m) indices of the inputs, ascending
    Eigen::MatrixXd factor;  ///< (m x m) lower triangular, rows of norm 1: the first input of a
                             ///< group follows its own coordinate alone
  };

  /// @param inputs        number of inputs
  /// @param correlations  inputs of a pair that is not listed are independent
  /// @throws std::invalid_argument if an index or rho is out of range, a pair appears twice, or the
  /// correlations are inconsistent: an eigenvalue is below -1e-8 (eigenvalues above it are taken as
  /// rounding of 0, so full correlation and groups of lower rank are fine)
  explicit Copula(int inputs, std::span<const Correlation> correlations = {});

  /// @param correlation  (inputs x inputs) of the scores, symmetric, ones on the diagonal, to 1e-9
  /// @throws std::invalid_argument for the same reasons
  explicit Copula(const Eigen::MatrixXd& correlation);

  int inputs() const { return inputs_; }
  /// Returns the groups of correlated inputs. Inputs outside all groups are independent of all
  /// others.
  const std::vector<Group>& groups() const { return groups_; }

 private:
  int inputs_ = 0;
  std::vector<Group> groups_;
};

/// A covariance as standard deviations and a copula. An input that does not vary has standard
/// deviation 0 and no correlation, so value = belief + standard_deviation * score draws from any
/// belief, of full rank or not.
struct CovarianceFactors {
  Eigen::VectorXd standard_deviation;  ///< (m)
  Copula copula;                       ///< of m inputs
};
/// Factors a covariance.
/// @param covariance  (m x m)
/// @throws std::invalid_argument if it is not symmetric to 1e-9, a variance is negative, an input
/// without variance has a covariance, a number is not finite, or as the copula
CovarianceFactors factor_covariance(const Eigen::MatrixXd& covariance);

/// Returns standard normal scores correlated by the copula; the bits of a case do not depend on the
/// cases drawn with it.
/// @param u  (inputs x cases) within the open unit cube
/// @return   (inputs x cases)
/// @throws std::invalid_argument if u has another number of inputs
Eigen::MatrixXd scores(const Copula& copula, const Eigen::MatrixXd& u);

/// Returns values of the inputs: `quantile(u)` for an independent input, the value at its score for
/// a correlated one. Bits as for `scores`.
/// @param u          (inputs x cases) within the open unit cube
/// @param marginals  (inputs) valid distributions
/// @return           (inputs x cases)
/// @throws std::invalid_argument if the numbers of inputs differ
Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u);

}  // namespace abbe::sim::study
