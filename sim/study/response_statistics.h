#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::study {

/// An estimate with its 95 % confidence interval.
struct IntervalEstimate {
  double value = 0.0;
  double low = 0.0;   ///< <= value
  double high = 0.0;  ///< >= value
};

/// Fractions of the variance of a response that are due to an input.
struct SobolIndex {
  IntervalEstimate first;  ///< due to the input alone
  IntervalEstimate total;  ///< including its interactions
};

/// Returns the Sobol indices from the responses of a Saltelli design. Its rows are the base points;
/// its columns are A, B, and for every input i A with column i of B. The inputs must be
/// independent. Base points with a response that is not finite are left out. Source: Saltelli et
/// al. 2010 (first order, equation b of table 2), Jansen 1999 (total), for responses minus their
/// mean. An estimate may be slightly outside 0 .. 1; its interval does not extend further.
/// Intervals: bootstrap over base points of the studentised estimate (Hall 1992) with 1000 draws of
/// Poisson weights. The points are treated as random; the errors of points of Sobol's sequence are
/// much smaller than the intervals. Measured coverage with random points, for the Ishigami function
/// and a linear one (indices_test.cpp): 94 to 96 % with 64 or more base points (90 to 97 % for any
/// single index); 90 % with 8 (85 to 95 %).
/// @param responses  (base points x inputs + 2)
/// @param seed       of the bootstrap
/// @return (inputs); all zero if the response does not vary
/// @throws std::invalid_argument for fewer than 8 complete base points or fewer than 3 columns
std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& responses, std::uint64_t seed = 1);

/// Sobol indices from the first 1/2^k of the complete base points, for all k that leave at least 8
/// of them.
struct IndexConvergence {
  std::vector<Eigen::Index> base_points;         ///< (m) ascending
  std::vector<std::vector<SobolIndex>> indices;  ///< (m), each (inputs)
};
/// Returns the indices for increasing numbers of base points. Arguments and exceptions are those of
/// sobol_indices.
IndexConvergence index_convergence(const Eigen::MatrixXd& responses, std::uint64_t seed = 1);

/// Returns the inputs of a column (0: A, 1: B, 2 + i) of the Saltelli design.
/// @param u  (2 inputs) base point in the unit cube, with A in its first half and B in its second
/// @return (inputs)
/// @throws std::invalid_argument if the size of u is odd or the column does not exist
Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column);

/// Statistics of a response over many random machines. The intervals are valid for independent
/// cases; the errors of points of Sobol's sequence are smaller.
struct ResponseStatistics {
  Eigen::Index cases = 0;               ///< with a finite response; others are left out
  IntervalEstimate mean;                ///< Student's interval
  IntervalEstimate standard_deviation;  ///< Bonett's interval (2006), valid for non-normal values
  double min = 0.0;
  double max = 0.0;
  IntervalEstimate median;
  IntervalEstimate p95;  ///< 95 % of the responses are below
  IntervalEstimate p99;
};
/// Computes the statistics. Measured coverage for 20 to 2000 cases (answers_test.cpp): 93 to 96 %
/// for mean and standard deviation; for skewed responses (log-normal, sigma 0.5) 88 to 94 % for the
/// standard deviation. Quantiles are linear between ranks (Hyndman's type 7); their intervals, from
/// order statistics, cover at least 95 % for any distribution. With too few cases (below 72 for
/// p95, 368 for p99) such an interval ends at min or max, and its coverage is lower.
/// @throws std::invalid_argument for fewer than 2 finite responses
ResponseStatistics answers(const Eigen::VectorXd& values);

/// Returns the quantile p of finite values, at least one, in ascending order, linear between ranks.
double sorted_quantile(std::span<const double> sorted, double p);

/// Returns the sample standard deviation (over n - 1) of at least two finite values.
double sample_standard_deviation(std::span<const double> values);

/// Returns the fraction of the finite responses at or below a limit, with Wilson's 95 % interval.
/// @throws std::invalid_argument without finite responses
IntervalEstimate fraction_within_limit(const Eigen::VectorXd& values, double limit);

/// Returns the process capability for an upper limit, (limit - mean) / (3 standard deviations);
/// empty if the values do not vary.
std::optional<double> process_capability(const Eigen::VectorXd& values, double limit);

/// Correlations of each input with the response. Cases with a response or an input that is not
/// finite are left out.
struct Correlations {
  Eigen::VectorXd linear;  ///< (inputs) Pearson's; 0 if input or response does not vary
  Eigen::VectorXd rank;    ///< (inputs) Spearman's; ties have their mean rank
};
/// Computes the correlations.
/// @param inputs  (inputs x cases)
/// @throws std::invalid_argument if the numbers of cases differ
Correlations correlations(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values);

/// Returns the main effect of each input: the fraction of the variance of the responses that a line
/// and a parabola of the input explain. For responses of this shape it is Sobol's first-order
/// index. A response that is an even function of an input, as the PV of a map often is, is not
/// correlated with it, but the parabola explains it. The mean contribution of chance is subtracted.
/// Source: Saltelli et al. 2008, section 1.2 (first-order effects), Ezekiel 1930 (adjustment of
/// R^2).
/// @param inputs     (inputs x cases)
/// @param responses  (cases) finite
/// @return (inputs) within 0 .. 1; zero for fewer than 10 cases, and if the responses or the input
/// do not vary
Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& responses);

/// Returns the main effect that chance alone does not exceed for any input in 95 % of all studies;
/// exact for normal responses.
double main_effect_chance_limit(Eigen::Index cases, Eigen::Index inputs);

}  // namespace abbe::sim::study
