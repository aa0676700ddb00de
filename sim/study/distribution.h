#pragma once

#include <limits>

#include <Eigen/Core>

/// What a study varies, how its cases are drawn, and what their answers say.
namespace abbe::sim::study {

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
const char* fault_of(const Distribution& distribution);

/// The value below which a share p of the distribution lies; never decreases by more than rounding,
/// always within low .. high.
/// Bound: 1e-12 of the spread (of the logarithm) and four ulp of the value, in both tails as far as
/// p or 1 - p is 1e-300.
/// @param p  0 .. 1; 0 and 1 give the ends, which may be infinite
double quantile(const Distribution& distribution, double p);

/// The value that has as much of the distribution below it as a standard normal number has below
/// `score`: quantile(cumulative share of the score) without the loss of digits near a share of 1.
double at_score(const Distribution& distribution, double score);

/// The same of many at once, bit for bit, in half the time where the distribution is cut off.
Eigen::VectorXd quantiles(const Distribution& distribution, const Eigen::VectorXd& p);
Eigen::VectorXd at_scores(const Distribution& distribution, const Eigen::VectorXd& scores);

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

}  // namespace abbe::sim::study
