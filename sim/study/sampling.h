#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::study {

enum class Sampling {
  Random,  ///< pseudo-random: independent points
  Sobol,   ///< Sobol's sequence with one random digital shift: fills the cube evenly
};

/// Points of the open unit cube, any of them by its number: the same for any order, thread or
/// machine.
struct Sequence {
  Sampling sampling = Sampling::Random;
  int dimensions = 1;      ///< 1 .. 3600
  std::uint64_t seed = 1;  ///< of the random points, and of the shift
};

/// Points number `first` to `first + count - 1`, bit for bit the same in whatever stretches they
/// are asked for. Each is an odd multiple of 2^-53, so strictly within 0 .. 1.
/// Random: SplitMix64's stream (Steele, Lea, Flood 2014) of a state that seed and number of the
/// point make, one draw a dimension. Sobol: Boost's engine with the directions of Joe and Kuo 2008,
/// every coordinate's bits xored with a random word of its own, which keeps the sequence's balance
/// exactly; the point at the origin, shifted like the others, is number 0, as leaving it out would
/// spoil that balance (Owen 2022). Sobol points 0 .. 2^k - 1 have one coordinate in every 2^-k of
/// each axis.
/// Time: Random 1 to 2 ns a number. Sobol the same and, at every call wherever it begins, some
/// 0.5 us a dimension: ask for dozens of points together.
/// @return (dimensions x count)
/// @throws std::invalid_argument for dimensions out of range, or more points than 2^52
Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count);

// What a study varies, how its cases are drawn, and what their answers say.

/// How an input varies, in its own unit, cut off where physics ends.
struct Distribution {
  enum class Kind {
    Normal,      ///< centre is the mean, spread the standard deviation, before it is cut off
    Uniform,     ///< centre +- spread
    Triangular,  ///< the same, its mode at the centre
    LogNormal,   ///< centre (> 0) is the median, spread the standard deviation of the logarithm
  } kind = Kind::Normal;
  double centre = 0.0;
  double spread = 1.0;  ///< > 0; at most 10 where it is of a logarithm
  double low = -std::numeric_limits<double>::infinity();  ///< nothing is below
  double high = std::numeric_limits<double>::infinity();  ///< nor above
};

/// Why a distribution is none, in words that follow "expected"; null if it is one. The other
/// functions take only distributions without a fault.
const char* distribution_error(const Distribution& distribution);

/// The value below which a share p of the distribution lies; never decreases by more than rounding,
/// always within low .. high.
/// Bound: 1e-12 of the spread (of the logarithm) and four ulp of the value, in both tails as far as
/// p or 1 - p is 1e-300.
/// @param p  0 .. 1; 0 and 1 give the ends, which may be infinite
double quantile(const Distribution& distribution, double p);

/// The value that has as much of the distribution below it as a standard normal number has below
/// `score`: quantile(cumulative share of the score) without the loss of digits near a share of 1.
double value_at_score(const Distribution& distribution, double score);

/// The same of many at once, bit for bit, in half the time where the distribution is cut off.
Eigen::VectorXd quantiles(const Distribution& distribution, const Eigen::VectorXd& p);
Eigen::VectorXd values_at_scores(const Distribution& distribution, const Eigen::VectorXd& scores);

/// The standard normal number below which a share p lies; infinite at 0 and 1.
double normal_score(double p);

/// Share of the distribution below a value.
/// Bound: 1e-14 over the share that the cut leaves of the distribution.
double cumulative(const Distribution& distribution, double value);

struct Moments {
  double mean = 0.0;
  double standard_deviation = 0.0;
};
/// Of the distribution as it is cut off, however narrow or far out the cut. Bound: relative 1e-10
/// of the standard deviation for both, and four ulp of the mean.
Moments moments(const Distribution& distribution);

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
struct CovarianceFactors {
  Eigen::VectorXd standard_deviation;  ///< (m)
  Copula copula;                       ///< of m inputs
};
/// @param covariance  (m x m)
/// @throws std::invalid_argument if it is not symmetric to 1e-9, a variance is negative, what does
///         not vary covaries, something is not finite, or as the copula
CovarianceFactors factor_covariance(const Eigen::MatrixXd& covariance);

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
