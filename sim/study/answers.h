#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "sim/study/indices.h"

namespace abbe::sim::study {

/// What many random machines say about one response. Bands are those of independent cases; points
/// of Sobol's sequence err less than they say.
struct Answers {
  Eigen::Index cases = 0;     ///< that have an answer; those that are not finite are left out
  Banded mean;                ///< Student's band
  Banded standard_deviation;  ///< Bonett's band (2006), made for what is not normal
  double min = 0.0;
  double max = 0.0;
  Banded median;
  Banded p95;  ///< 95 % lie below
  Banded p99;
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
Banded quantile_of(Eigen::VectorXd values, double p);

/// The same of finite values in ascending order, at least one, without its band.
double quantile_in(std::span<const double> sorted, double p);

/// Standard deviation of at least two finite values, of a sample (over n - 1).
double deviation_of(std::span<const double> values);

/// Share of the finite answers at or below a limit, Wilson's band of 95 %.
/// @throws std::invalid_argument without finite answers
Banded share_below(const Eigen::VectorXd& values, double limit);

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

}  // namespace abbe::sim::study
