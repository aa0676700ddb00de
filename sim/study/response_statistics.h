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

/// Fractions of a response's variance due to an input alone, and due to it with all its
/// interactions.
struct SobolIndex {
  IntervalEstimate first;
  IntervalEstimate total;
};

/// Returns the Sobol indices from the responses of a Saltelli design: rows are the base points,
/// columns A, B, then A with column i of B, for every input i. Inputs must be independent. A base
/// point with a response that is not finite is left out.
/// Source: Saltelli et al. 2010 (first order, equation b of table 2), Jansen 1999 (total), on
/// responses less their mean. An estimate may lie slightly outside 0 .. 1; its interval does not
/// extend further.
/// Intervals: bootstrap over base points of the studentised estimate (Hall 1992), 1000 draws of
/// Poisson weights, as if the points were random: those of Sobol's sequence err far less than their
/// interval. With random points the intervals of the Ishigami function and of a linear one contain
/// the truth in 94 to 96 % of all studies from 64 base points upwards, any single index in 90 to 97
/// %; at 8 base points in 90 %, any single one in 85 to 95 % (counted by indices_test.cpp).
/// @param answers  (base points x inputs + 2)
/// @param seed     of the bootstrap
/// @return (inputs); all zero if the response does not vary
/// @throws std::invalid_argument for fewer than 8 complete base points or fewer than 3 columns
std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& answers, std::uint64_t seed = 1);

/// Sobol indices of the first 1/2^k of the complete base points, from at least 8 up to all of them.
struct IndexConvergence {
  std::vector<Eigen::Index> base_points;         ///< (m) ascending
  std::vector<std::vector<SobolIndex>> indices;  ///< (m), each (inputs)
};
/// Returns the indices for growing numbers of base points; arguments and exceptions as for
/// sobol_indices.
IndexConvergence convergence(const Eigen::MatrixXd& answers, std::uint64_t seed = 1);

/// Returns the inputs of one column (0: A, 1: B, 2 + i) of the Saltelli design.
/// @param u  (2 inputs) a base point in the unit cube: A in its first half, B in its second
/// @return (inputs)
/// @throws std::invalid_argument if the size of u is odd or the column does not exist
Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column);

/// Statistics of one response over many random machines. Intervals are those of independent cases;
/// points of Sobol's sequence err less.
struct Answers {
  Eigen::Index cases = 0;               ///< cases with a finite response; the others are left out
  IntervalEstimate mean;                ///< Student's interval
  IntervalEstimate standard_deviation;  ///< Bonett's interval (2006), valid for non-normal values
  double min = 0.0;
  double max = 0.0;
  IntervalEstimate median;
  IntervalEstimate p95;  ///< 95 % of the responses lie below
  IntervalEstimate p99;
};
/// Computes the statistics. For 20 to 2000 cases the interval of the mean contains the truth in 93
/// to 96 % of all samples, that of the standard deviation in 93 to 96 %, for skew responses
/// (log-normal of 0.5) in 88 to 94 % (counted by answers_test.cpp).
/// @throws std::invalid_argument for fewer than 2 finite responses
Answers answers(const Eigen::VectorXd& values);

/// Returns the quantile p of the responses, linear between ranks (Hyndman's type 7), with an
/// interval from order statistics that covers at least 95 % for any distribution. Where too few
/// cases have such a rank (below 72 cases for p95, 368 for p99) the interval ends at min or max and
/// that end covers less.
/// @param p  0 .. 1
/// @throws std::invalid_argument without finite responses, or for p out of range
IntervalEstimate quantile_with_band(Eigen::VectorXd values, double p);

/// Returns the same quantile of finite values in ascending order, at least one, without its
/// interval.
double sorted_quantile(std::span<const double> sorted, double p);

/// Returns the sample standard deviation (over n - 1) of at least two finite values.
double sample_deviation(std::span<const double> values);

/// Returns the fraction of the finite responses at or below a limit, with Wilson's 95 % interval.
/// @throws std::invalid_argument without finite responses
IntervalEstimate fraction_below(const Eigen::VectorXd& values, double limit);

/// Returns the capability against an upper limit, (limit - mean) / 3 standard deviations; empty if
/// the values do not vary.
std::optional<double> cpk(const Eigen::VectorXd& values, double limit);

/// Pearson's correlation of each input with the response, and Spearman's correlation of ranks, ties
/// at their mean rank. Cases with a response or an input that is not finite are left out.
struct Correlations {
  Eigen::VectorXd linear;  ///< (inputs) 0 where input or response does not vary
  Eigen::VectorXd rank;    ///< (inputs)
};
/// Computes the correlations.
/// @param inputs  (inputs x cases)
/// @throws std::invalid_argument if the numbers of cases differ
Correlations correlations(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values);

/// Returns the fraction of the variance of the responses due to each input alone, as far as a line
/// and a parabola of the input fit them: a main effect, which is Sobol's first-order index for
/// responses of that shape. Responses that are even in an input, as the PV of a map often is, have
/// no correlation with it, but their parabola shows. The mean contribution of chance is subtracted.
/// Source: Saltelli et al. 2008, section 1.2 (first-order effects), Ezekiel 1930 (adjustment of
/// R^2).
/// @param inputs   (inputs x cases)
/// @param answers  (cases) finite
/// @return (inputs) within 0 .. 1; zero for fewer than 10 cases, or where responses or an input do
/// not vary
Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& answers);

/// Returns the largest main effect that chance alone gives any of so many inputs in 95 % of all
/// studies; exact for normal responses.
double chance_effect(Eigen::Index cases, Eigen::Index inputs);

}  // namespace abbe::sim::study
