#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::study {

/// An estimate with the band in which the truth lies with 95 % confidence.
struct IntervalEstimate {
  double value = 0.0;
  double low = 0.0;   ///< <= value
  double high = 0.0;  ///< >= value
};

/// Share of a response's variance that is due to an input alone, and with all its interactions.
struct SobolIndex {
  IntervalEstimate first;
  IntervalEstimate total;
};

/// Answers to a design of Sobol indices: rows are the base points, columns A, B, then A with column
/// i of B, for every input i. Inputs are independent. A base point of which an answer is not finite
/// is left out.
/// Source: Saltelli et al. 2010 (first order, equation b of table 2), Jansen 1999 (total), on
/// answers less their mean. An estimate may leave 0 .. 1 a little; its band leaves it no further.
/// Bands: bootstrap over base points of the studentised estimate (Hall 1992), 1000 draws of Poisson
/// weights. As if the points were random: those of Sobol's sequence err far less than their band.
/// With random points the bands of the Ishigami function and of a linear one hold the truth in 94
/// to 96 % of all studies from 64 base points upwards, any single index in 90 to 97 %; at 8 base
/// points in 90 %, any single one in 85 to 95 % (indices_test.cpp counts it).
/// @param answers  (base points x inputs + 2)
/// @param seed     of the bootstrap
/// @return (inputs); all zero where the response does not vary
/// @throws std::invalid_argument for fewer than 8 complete base points or columns than 3
std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& answers, std::uint64_t seed = 1);

/// The same of the first 1/2^k of the complete base points, from at least 8 upwards, all of them
/// last.
struct IndexConvergence {
  std::vector<Eigen::Index> base_points;         ///< (m) ascending
  std::vector<std::vector<SobolIndex>> indices;  ///< (m), each (inputs)
};
IndexConvergence convergence(const Eigen::MatrixXd& answers, std::uint64_t seed = 1);

/// Point number `column` (0: A, 1: B, 2 + i) of a base point drawn as both halves of u.
/// @param u  (2 inputs) in the unit cube
/// @return (inputs)
/// @throws std::invalid_argument if u cannot be halved or there is no such column
Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column);

/// What many random machines say about one response. Bands are those of independent cases; points
/// of Sobol's sequence err less than they say.
struct Answers {
  Eigen::Index cases = 0;  ///< that have an answer; those that are not finite are left out
  IntervalEstimate mean;   ///< Student's band
  IntervalEstimate standard_deviation;  ///< Bonett's band (2006), made for what is not normal
  double min = 0.0;
  double max = 0.0;
  IntervalEstimate median;
  IntervalEstimate p95;  ///< 95 % lie below
  IntervalEstimate p99;
};
/// Of 20 to 2000 cases the band of the mean holds the truth in 93 to 96 % of all samples, that of
/// the standard deviation in 93 to 96 %, of skew answers (log-normal of 0.5) in 88 to 94 %
/// (answers_test.cpp counts it).
/// @throws std::invalid_argument for fewer than 2 finite answers
Answers answers(const Eigen::VectorXd& values);

/// The value below which a share p of the answers lies, linear between ranks (Hyndman's type 7),
/// with its band from order statistics, which covers at least 95 % whatever the distribution. Where
/// so few cases have no such rank (below 72 cases for p95, 368 for p99) the band ends at min or max
/// and that end covers less.
/// @param p  0 .. 1
/// @throws std::invalid_argument without finite answers, or p out of range
IntervalEstimate quantile_with_band(Eigen::VectorXd values, double p);

/// The same of finite values in ascending order, at least one, without its band.
double sorted_quantile(std::span<const double> sorted, double p);

/// Standard deviation of at least two finite values, of a sample (over n - 1).
double sample_deviation(std::span<const double> values);

/// Share of the finite answers at or below a limit, Wilson's band of 95 %.
/// @throws std::invalid_argument without finite answers
IntervalEstimate fraction_below(const Eigen::VectorXd& values, double limit);

/// Capability against an upper limit: (limit - mean) / 3 standard deviations; empty without spread.
std::optional<double> cpk(const Eigen::VectorXd& values, double limit);

/// Pearson's correlation of each input with the answer, and of ranks (Spearman), equal values on
/// their mean rank. Over cases with a finite answer and finite inputs.
struct Correlations {
  Eigen::VectorXd linear;  ///< (inputs) 0 where either does not vary
  Eigen::VectorXd rank;    ///< (inputs)
};
/// @param inputs  (inputs x cases)
/// @throws std::invalid_argument if the numbers of cases differ
Correlations correlations(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values);

/// Share of the variance of answers that each input makes alone, as far as a line and a parabola of
/// the input follow them: a main effect, the first-order index of Sobol for answers of that shape.
/// Answers that are even in an input, as the PV of a map often is, have no correlation with it, and
/// their parabola shows. What chance gives on the average is taken off.
/// Source: Saltelli et al. 2008, section 1.2 (first-order effects), Ezekiel 1930 (adjustment of
/// R^2).
/// @param inputs   (inputs x cases)
/// @param answers  (cases) finite
/// @return (inputs) within 0 .. 1; zero for fewer than 10 cases, where answers or an input do not
///         vary
Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& answers);

/// The largest main effect that chance alone gives any of so many inputs in 95 % of all studies,
/// exact for normal answers.
double chance_effect(Eigen::Index cases, Eigen::Index inputs);

}  // namespace abbe::sim::study
