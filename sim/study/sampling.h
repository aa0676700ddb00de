#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::study {

/// Method of drawing points.
enum class Sampling {
  Random,  ///< independent pseudo-random points
  Sobol,   ///< Sobol's sequence with a random digital shift, which fills the cube evenly
};

/// A sequence of points in the open unit cube. A point depends only on its number, not on the
/// order, thread or computer.
struct Sequence {
  Sampling sampling = Sampling::Random;
  int dimensions = 1;      ///< 1 .. 3600
  std::uint64_t seed = 1;  ///< of the random points, and of the Sobol shift
};

/// Returns the points `first` to `first + count - 1`. Their bits do not depend on how the range is
/// divided into calls. Each coordinate is an odd multiple of 2^-53, i.e. strictly between 0 and 1.
/// Random: SplitMix64's stream (Steele, Lea, Flood 2014) from a state that depends on the seed and
/// the number of the point, with one draw per dimension. Sobol: Boost's engine with the direction
/// numbers of Joe and Kuo 2008. The bits of each coordinate are xored with a random number of the
/// dimension, which preserves the balance of the sequence exactly. Point 0 is the shifted origin,
/// because the balance would be lost without it (Owen 2022). Points 0 .. 2^k - 1 have one
/// coordinate in each interval of length 2^-k of each axis. Time: 1 to 2 ns per number; for Sobol
/// also about 0.5 us per dimension in each call, so that dozens of points should be requested
/// together.
/// @return (dimensions x count)
/// @throws std::invalid_argument for dimensions out of range, or more than 2^52 points
Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count);

/// Distribution of an input, in its own unit, truncated at physical limits.
struct Distribution {
  enum class Kind {
    Normal,      ///< centre is the mean, spread the standard deviation, before truncation
    Uniform,     ///< centre +- spread
    Triangular,  ///< within centre +- spread, with its mode at the centre
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

/// Returns the quantile at the probability that a standard normal number is below `score`, without
/// the loss of digits near a probability of 1.
double value_at_score(const Distribution& distribution, double score);

/// Return the values of many points at once, with the same bits as `quantile` and `value_at_score`;
/// twice as fast if the distribution is truncated.
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
/// Returns the moments of the truncated distribution, also for a narrow window far out in a tail.
/// Bound: relative 1e-10 of the standard deviation for both, and four ulp of the mean.
Moments moments(const Distribution& distribution);

/// Correlation of two inputs.
struct Correlation {
  int a = 0;         ///< index of an input
  int b = 0;         ///< index of another input
  double rho = 0.0;  ///< -1 .. 1, of the normal scores of the two inputs
};

/// Joint distribution of the inputs: a Gaussian copula, defined by the correlation of their normal
/// scores. For inputs that are normal and not truncated this is the correlation of the values; the
/// values of other inputs are slightly less correlated. Immutable.
class Copula {
 public:
  /// Correlated inputs, whose scores are `factor` times independent scores.
  struct Group {
    std::vector<int> of;     ///< (m) indices of the inputs, ascending
    Eigen::MatrixXd factor;  ///< (m x m) lower triangular with rows of norm 1, so that the first
                             ///< input depends on its own coordinate only
  };

  /// @param inputs        number of inputs
  /// @param correlations  of pairs of inputs; all other pairs are independent
  /// @throws std::invalid_argument if an index or rho is out of range, a pair appears twice, or the
  /// correlations are inconsistent, i.e. an eigenvalue is below -1e-8 (larger negative eigenvalues
  /// are regarded as rounding of 0, so full correlation and groups of lower rank are valid)
  explicit Copula(int inputs, std::span<const Correlation> correlations = {});

  /// @param correlation  (inputs x inputs) of the scores, symmetric with ones on the diagonal to
  /// within 1e-9
  /// @throws std::invalid_argument if it is not such a matrix, or if it is inconsistent
  explicit Copula(const Eigen::MatrixXd& correlation);

  int inputs() const { return inputs_; }
  /// Returns the groups of correlated inputs. An input outside all groups is independent.
  const std::vector<Group>& groups() const { return groups_; }

 private:
  int inputs_ = 0;
  std::vector<Group> groups_;
};

/// Returns standard normal scores correlated by the copula. The bits of a case do not depend on the
/// other cases of the call.
/// @param u  (inputs x cases) within the open unit cube
/// @return   (inputs x cases)
/// @throws std::invalid_argument if u has another number of inputs
Eigen::MatrixXd scores(const Copula& copula, const Eigen::MatrixXd& u);

/// Returns values of the inputs: `quantile(u)` for an independent input, the value at its score for
/// a correlated one. The bits of a case do not depend on the other cases of the call.
/// @param u          (inputs x cases) within the open unit cube
/// @param marginals  (inputs) valid distributions
/// @return           (inputs x cases)
/// @throws std::invalid_argument if the numbers of inputs differ
Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u);

}  // namespace abbe::sim::study
