#include "sim/study/response_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <ranges>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "sim/study/sampling.h"

namespace abbe::sim::study {

namespace {

// The intervals are verified for this number of base points and more (indices_test.cpp).
constexpr Eigen::Index min_base_points = 8;
// Bootstrap draws. 25 of them are beyond each end of a 95 % interval.
constexpr int draws = 1000;
// Base points processed together. With so few Eigen does not split the sums of a product, which
// would make the bits depend on the size of the processor's caches.
constexpr Eigen::Index base_point_block = 128;

/// Columns of the moments from which all indices and their standard errors are computed: means over
/// base points of the numerators n, of q = (a^2 + b^2)/2, of s = (a + b)/2 and of their products.
/// The numerators of the first-order indices of all inputs precede those of the total indices.
struct MomentColumns {
  Eigen::Index numerators = 0;
  Eigen::Index columns() const { return 4 * numerators + 5; }
  Eigen::Index n(Eigen::Index j) const { return j; }
  Eigen::Index nn(Eigen::Index j) const { return numerators + j; }
  Eigen::Index nq(Eigen::Index j) const { return 2 * numerators + j; }
  Eigen::Index ns(Eigen::Index j) const { return 3 * numerators + j; }
  Eigen::Index q() const { return 4 * numerators; }
  Eigen::Index s() const { return q() + 1; }
  Eigen::Index qq() const { return q() + 2; }
  Eigen::Index ss() const { return q() + 3; }
  Eigen::Index qs() const { return q() + 4; }
};

/// Returns the terms of every base point, whose weighted means are the moments.
/// @param responses  (k x inputs + 2) minus their mean
Eigen::MatrixXd moment_terms(const Eigen::MatrixXd& responses) {
  const Eigen::Index inputs = responses.cols() - 2;
  const MomentColumns column{2 * inputs};
  const Eigen::ArrayXd a = responses.col(0);
  const Eigen::ArrayXd b = responses.col(1);
  const Eigen::ArrayXd q = 0.5 * (a.square() + b.square());
  const Eigen::ArrayXd s = 0.5 * (a + b);
  Eigen::MatrixXd terms(responses.rows(), column.columns());
  const auto set_numerator = [&](Eigen::Index j, const Eigen::ArrayXd& n) {
    terms.col(column.n(j)) = n;
    terms.col(column.nn(j)) = n.square();
    terms.col(column.nq(j)) = n * q;
    terms.col(column.ns(j)) = n * s;
  };
  for (Eigen::Index i = 0; i < inputs; ++i) {
    const Eigen::ArrayXd change = responses.col(2 + i).array() - a;
    set_numerator(i, b * change);
    set_numerator(inputs + i, 0.5 * change.square());
  }
  terms.col(column.q()) = q;
  terms.col(column.s()) = s;
  terms.col(column.qq()) = q.square();
  terms.col(column.ss()) = s.square();
  terms.col(column.qs()) = q * s;
  return terms;
}

/// Estimates of the indices with their standard errors.
struct Estimates {
  Eigen::ArrayXd value;  ///< (numerators)
  Eigen::ArrayXd error;  ///< (numerators) by the delta method
};

/// Computes the estimates from the means of the terms.
/// @param weight  number of base points in the means
Estimates estimates(const Eigen::VectorXd& mean, const MomentColumns& column, double weight) {
  const double q = mean(column.q());
  const double s = mean(column.s());
  const double variance = q - s * s;
  // To first order the error of the variance is that of v = q - 2 s(mean) s about its mean.
  const double vv = (mean(column.qq()) - q * q) - 4.0 * s * (mean(column.qs()) - q * s) +
                    4.0 * s * s * (mean(column.ss()) - s * s);
  Estimates result{Eigen::ArrayXd(column.numerators), Eigen::ArrayXd(column.numerators)};
  for (Eigen::Index j = 0; j < column.numerators; ++j) {
    const double n = mean(column.n(j));
    const double value = n / variance;
    const double nv = (mean(column.nq(j)) - n * q) - 2.0 * s * (mean(column.ns(j)) - n * s);
    const double squared_error =
        (mean(column.nn(j)) - n * n) - 2.0 * value * nv + value * value * vv;
    result.value(j) = value;
    result.error(j) = std::sqrt(std::max(0.0, squared_error) / (weight - 1.0)) / variance;
  }
  return result;
}

/// Cumulative probabilities of a Poisson number of mean 1 at 0, 1, ... 17. The probability above 17
/// is 6e-17, which is less than the spacing 2^-53 of the uniform numbers.
constexpr std::array<double, 18> poisson_cumulative = [] {
  std::array<double, 18> cumulative = {0.36787944117144233};
  double probability = cumulative[0];
  for (std::size_t k = 1; k < cumulative.size(); ++k)
    cumulative[k] = cumulative[k - 1] + (probability /= double(k));
  return cumulative;
}();

/// Returns the Poisson number of mean 1 for a uniform number. All probabilities are compared,
/// because unpredictable branches take longer.
double poisson_number(double u) {
  double count = 0.0;
  for (const double probability : poisson_cumulative) count += u > probability ? 1.0 : 0.0;
  return count;
}

/// Returns the weighted sums of the terms: in the first column with every base point once, then for
/// the bootstrap draws. The last row has the sums of the weights. (columns + 1 x draws + 1)
Eigen::MatrixXd weighted_sums(const Eigen::MatrixXd& responses, std::uint64_t seed) {
  const MomentColumns column{2 * (responses.cols() - 2)};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(column.columns() + 1, draws + 1);
  for (Eigen::Index first = 0; first < responses.rows(); first += base_point_block) {
    const Eigen::Index count = std::min(base_point_block, responses.rows() - first);
    Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(draws + 1, count);
    weights.bottomRows(draws) = points({Sampling::Random, draws, seed}, std::uint64_t(first), count)
                                    .unaryExpr(&poisson_number);
    Eigen::MatrixXd terms(count, column.columns() + 1);
    terms << moment_terms(responses.middleRows(first, count)), Eigen::VectorXd::Ones(count);
    sums.noalias() += terms.transpose() * weights.transpose();
  }
  return sums;
}

/// Returns the deviation of each draw's estimate from the estimate, in standard errors. (numerators
/// x valid draws)
std::vector<std::vector<double>> studentised_draws(const Eigen::MatrixXd& sums,
                                                   const MomentColumns& column,
                                                   const Estimates& estimate) {
  std::vector<std::vector<double>> result(static_cast<std::size_t>(column.numerators));
  for (Eigen::Index k = 1; k < sums.cols(); ++k) {
    const double weight = sums(column.columns(), k);
    // The standard error is undefined below, since it is divided by weight - 1.
    if (weight < 2.0) continue;
    const Estimates drawn = estimates(sums.col(k).head(column.columns()) / weight, column, weight);
    for (Eigen::Index j = 0; j < column.numerators; ++j) {
      const double t = (drawn.value(j) - estimate.value(j)) / drawn.error(j);
      // t is not finite if all points of the draw are equal.
      if (std::isfinite(t)) result[std::size_t(j)].push_back(t);
    }
  }
  return result;
}

/// Returns an estimate with its bootstrap-t interval (Hall 1992).
/// @param t  studentised draws of the estimate
IntervalEstimate bootstrap_interval(double value, double error, std::vector<double>& t) {
  if (!(error > 0.0) || t.empty()) return {value, value, value};
  const auto draw_quantile = [&](double p) {
    const auto rank = t.begin() + std::ptrdiff_t(std::lround(p * double(t.size() - 1)));
    std::nth_element(t.begin(), rank, t.end());
    return *rank;
  };
  const double low = value - draw_quantile(0.975) * error;
  const double high = value - draw_quantile(0.025) * error;
  // True indices are within 0 .. 1, so the clipping of the interval excludes none.
  return {value, std::min(value, std::max(low, 0.0)), std::max(value, std::min(high, 1.0))};
}

/// Returns the rows in which all responses are finite.
Eigen::MatrixXd complete_rows(const Eigen::MatrixXd& responses) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; k < responses.rows(); ++k)
    if (responses.row(k).allFinite()) rows.push_back(k);
  if (responses.cols() < 3)
    throw std::invalid_argument("Sobol indices need columns A, B and inputs");
  if (Eigen::Index(rows.size()) < min_base_points)
    throw std::invalid_argument("Sobol indices need 8 base points with complete results");
  return responses(rows, Eigen::all);
}

/// Returns the responses minus their mean and scaled to magnitude 1, so that fourth powers of tiny
/// or huge responses stay within the range of doubles. The sum is accumulated in order, because the
/// order of Eigen's sums depends on the alignment of the data.
Eigen::MatrixXd standardise(const Eigen::MatrixXd& responses) {
  const auto ab = responses.leftCols(2).array();
  const double middle = 0.5 * ab.minCoeff() + 0.5 * ab.maxCoeff();
  const double half_range = 0.5 * ab.maxCoeff() - 0.5 * ab.minCoeff();
  Eigen::MatrixXd result = (responses.array() - middle) / half_range;
  const double sum = std::accumulate(result.data(), result.data() + 2 * result.rows(), 0.0);
  result.array() -= sum / double(2 * result.rows());
  return result;
}

/// Returns the Sobol indices.
/// @param responses  all finite
std::vector<SobolIndex> finite_sobol_indices(const Eigen::MatrixXd& responses, std::uint64_t seed) {
  const Eigen::Index inputs = responses.cols() - 2;
  std::vector<SobolIndex> result(static_cast<std::size_t>(inputs));
  if (responses.leftCols(2).maxCoeff() == responses.leftCols(2).minCoeff()) return result;
  const MomentColumns column{2 * inputs};
  const auto count = double(responses.rows());
  const Eigen::MatrixXd sums = weighted_sums(standardise(responses), seed);
  const Estimates estimate = estimates(sums.col(0).head(column.columns()) / count, column, count);
  std::vector<std::vector<double>> t = studentised_draws(sums, column, estimate);
  const auto interval = [&](Eigen::Index j) {
    return bootstrap_interval(estimate.value(j), estimate.error(j), t[std::size_t(j)]);
  };
  for (Eigen::Index i = 0; i < inputs; ++i)
    result[std::size_t(i)] = {interval(i), interval(inputs + i)};
  return result;
}

}  // namespace

std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& responses, std::uint64_t seed) {
  return finite_sobol_indices(complete_rows(responses), seed);
}

IndexConvergence index_convergence(const Eigen::MatrixXd& responses, std::uint64_t seed) {
  const Eigen::MatrixXd complete = complete_rows(responses);
  IndexConvergence result;
  for (Eigen::Index count = complete.rows(); count >= min_base_points; count /= 2)
    result.base_points.insert(result.base_points.begin(), count);
  for (const Eigen::Index count : result.base_points)
    result.indices.push_back(finite_sobol_indices(complete.topRows(count), seed));
  return result;
}

Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column) {
  const Eigen::Index inputs = u.size() / 2;
  if (u.size() % 2 != 0 || column < 0 || column >= inputs + 2)
    throw std::invalid_argument("a point of the Sobol design is A, B or A with one input of B");
  if (column == 1) return u.tail(inputs);
  Eigen::VectorXd point = u.head(inputs);
  if (column >= 2) point(column - 2) = u(inputs + column - 2);
  return point;
}

namespace {

constexpr double tail = 0.025;  // probability beyond either end of a 95 % interval

/// Returns the finite values. Throws std::invalid_argument if they are fewer than `min_count`.
std::vector<double> finite_values(const Eigen::VectorXd& values, std::size_t min_count) {
  std::vector<double> result;
  std::ranges::copy_if(values, std::back_inserter(result),
                       [](double v) { return std::isfinite(v); });
  if (result.size() < min_count)
    throw std::invalid_argument("fewer than " + std::to_string(min_count) + " finite responses");
  return result;
}

/// Returns the mean. The sum is accumulated in order, because the order of Eigen's sums depends on
/// the alignment of the data.
double sample_mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

/// Returns the sum of powers of the deviations from a centre.
double sum_of_powers(std::span<const double> values, double centre, int power) {
  double sum = 0.0;
  for (const double value : values) sum += std::pow(value - centre, power);
  return sum;
}

/// Returns the mean with Student's interval.
IntervalEstimate mean_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double mean = sample_mean(sorted);
  const boost::math::students_t student(n - 1.0);
  const double half = boost::math::quantile(boost::math::complement(student, tail)) *
                      sample_standard_deviation(sorted) / std::sqrt(n);
  return {mean, mean - half, mean + half};
}

/// Returns the standard deviation with Bonett's interval (2006), which is symmetric in the
/// logarithm. Its kurtosis is about a trimmed mean, so that outliers do not inflate it.
IntervalEstimate deviation_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double deviation = sample_standard_deviation(sorted);
  if (!(deviation > 0.0)) return {0.0, 0.0, 0.0};
  const double trim = n > 5.0 ? 0.5 / std::sqrt(n - 4.0) : 0.5;
  const auto trimmed = std::min(std::size_t(trim * n), (sorted.size() - 1) / 2);
  const double centre = sample_mean(sorted.subspan(trimmed, sorted.size() - 2 * trimmed));
  const double sum_of_squares = deviation * deviation * (n - 1.0);
  const double kurtosis = n * (sum_of_powers(sorted, centre, 4) / sum_of_squares / sum_of_squares);
  const double z = -normal_score(tail);
  // c, and its square root in `middle`, are Bonett's adjustment for small samples.
  const double c = n / (n - z);
  const double error = c * std::sqrt((kurtosis - (n - 3.0) / n) / (n - 1.0));
  const double middle = std::sqrt(c) * deviation;
  return {deviation, std::min(deviation, middle * std::exp(-0.5 * z * error)),
          std::max(deviation, middle * std::exp(0.5 * z * error))};
}

/// Returns the ranks (from 0) that enclose the p-quantile of the population. The number of
/// responses below the quantile is binomial.
std::pair<std::size_t, std::size_t> rank_band(std::size_t n, double p) {
  const boost::math::binomial below(double(n), p);
  const auto ranks = std::views::iota(std::size_t(0), n);
  // Rank r is above the quantile if at most r responses are below it,
  const auto first_inside = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(below, double(r)) <= tail; });
  // and below the quantile if more than r responses are below it.
  const auto high = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(complement(below, double(r))) > tail; });
  const std::size_t low = *first_inside > 0 ? *first_inside - 1 : 0;
  return {low, std::min(*high, n - 1)};
}

/// Returns the quantile p with its interval from order statistics.
IntervalEstimate quantile_band(std::span<const double> sorted, double p) {
  const double value = sorted_quantile(sorted, p);
  const auto [low, high] = rank_band(sorted.size(), p);
  return {value, std::min(value, sorted[low]), std::max(value, sorted[high])};
}

/// Returns the ranks of values; ties have their mean rank.
std::vector<double> mean_ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t first = 0; first < order.size();) {
    std::size_t last = first;
    while (last < order.size() && values[order[last]] == values[order[first]]) ++last;
    for (std::size_t i = first; i < last; ++i) ranks[order[i]] = 0.5 * double(first + last - 1);
    first = last;
  }
  return ranks;
}

bool is_varying(std::span<const double> values) {
  return std::ranges::any_of(values, [&](double value) { return value != values.front(); });
}

/// Returns Pearson's correlation; 0 if either sample does not vary.
double pearson_correlation(std::span<const double> a, std::span<const double> b) {
  if (!is_varying(a) || !is_varying(b)) return 0.0;
  const double mean_a = sample_mean(a);
  const double mean_b = sample_mean(b);
  const double scale_a = std::sqrt(sum_of_powers(a, mean_a, 2));
  const double scale_b = std::sqrt(sum_of_powers(b, mean_b, 2));
  double sum = 0.0;
  // Both are normalised before they are multiplied, because the product of their sums of squares
  // may overflow.
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (a[i] - mean_a) / scale_a * ((b[i] - mean_b) / scale_b);
  return std::clamp(sum, -1.0, 1.0);
}

}  // namespace

ResponseStatistics answers(const Eigen::VectorXd& values) {
  std::vector<double> sorted = finite_values(values, 2);
  std::ranges::sort(sorted);
  return {.cases = Eigen::Index(sorted.size()),
          .mean = mean_band(sorted),
          .standard_deviation = deviation_band(sorted),
          .min = sorted.front(),
          .max = sorted.back(),
          .median = quantile_band(sorted, 0.5),
          .p95 = quantile_band(sorted, 0.95),
          .p99 = quantile_band(sorted, 0.99)};
}

double sorted_quantile(std::span<const double> sorted, double p) {
  const double position = p * double(sorted.size() - 1);
  const auto rank = std::size_t(position);
  const std::size_t next = std::min(rank + 1, sorted.size() - 1);
  return std::lerp(sorted[rank], sorted[next], position - double(rank));
}

double sample_standard_deviation(std::span<const double> values) {
  const double sum_of_squares = sum_of_powers(values, sample_mean(values), 2);
  return std::sqrt(sum_of_squares / double(values.size() - 1));
}

IntervalEstimate fraction_within_limit(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_values(values, 1);
  const auto n = double(finite.size());
  const double fraction =
      double(std::ranges::count_if(finite, [&](double value) { return value <= limit; })) / n;
  const double z = -normal_score(tail);
  // Unlike the normal approximation, Wilson's interval stays within 0 .. 1 and has a width even if
  // all responses or none are within the limit.
  const double middle = (fraction + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half =
      z / (1.0 + z * z / n) * std::sqrt(fraction * (1.0 - fraction) / n + z * z / (4.0 * n * n));
  return {fraction, std::clamp(middle - half, 0.0, fraction),
          std::clamp(middle + half, fraction, 1.0)};
}

std::optional<double> process_capability(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_values(values, 0);
  if (finite.size() < 2 || !is_varying(finite)) return std::nullopt;
  return (limit - sample_mean(finite)) / (3.0 * sample_standard_deviation(finite));
}

Correlations correlations(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values) {
  if (inputs.cols() != values.size())
    throw std::invalid_argument("inputs and responses have different numbers of cases");
  std::vector<Eigen::Index> cases;
  for (Eigen::Index k = 0; k < values.size(); ++k)
    if (std::isfinite(values(k)) && inputs.col(k).allFinite()) cases.push_back(k);
  const auto select_cases = [&](const auto& all_values) {
    std::vector<double> result;
    for (const Eigen::Index k : cases) result.push_back(all_values(k));
    return result;
  };
  Correlations result{Eigen::VectorXd::Zero(inputs.rows()), Eigen::VectorXd::Zero(inputs.rows())};
  if (cases.empty()) return result;
  const std::vector<double> response = select_cases(values);
  const std::vector<double> response_ranks = mean_ranks(response);
  tbb::parallel_for(Eigen::Index(0), inputs.rows(), [&](Eigen::Index i) {
    const std::vector<double> input = select_cases(inputs.row(i));
    result.linear(i) = pearson_correlation(input, response);
    result.rank(i) = pearson_correlation(mean_ranks(input), response_ranks);
  });
  return result;
}

namespace {

// With fewer cases two regressors explain more than 2/9 of the variance by chance.
constexpr Eigen::Index min_cases = 10;
constexpr double regressors = 2.0;  // line and parabola

Eigen::VectorXd centred(const Eigen::VectorXd& values) { return values.array() - values.mean(); }

/// Returns R^2 minus its mean for independent input and response (Ezekiel 1930).
double adjusted_r_squared(double r_squared, Eigen::Index cases) {
  const double n = double(cases);
  return 1.0 - (1.0 - r_squared) * (n - 1.0) / (n - 1.0 - regressors);
}

/// Returns the part of the sum of squares of y that a regressor explains; both are centred.
double explained_squares(const Eigen::VectorXd& y, const Eigen::VectorXd& regressor) {
  const double squared_norm = regressor.squaredNorm();
  return squared_norm > 0.0 ? std::pow(y.dot(regressor), 2) / squared_norm : 0.0;
}

}  // namespace

Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& responses) {
  Eigen::VectorXd effects = Eigen::VectorXd::Zero(inputs.rows());
  const Eigen::VectorXd y = centred(responses);
  if (responses.size() < min_cases || !(y.squaredNorm() > 0.0)) return effects;
  for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
    Eigen::VectorXd x = centred(inputs.row(i).transpose());
    const double spread = x.norm() / std::sqrt(double(x.size()));
    if (!(spread > 0.0)) continue;
    x /= spread;  // its squares could underflow or overflow
    Eigen::VectorXd parabola = centred(x.cwiseProduct(x));
    // The parabola is made orthogonal to the line, so that the explained variances add up.
    parabola -= parabola.dot(x) / x.squaredNorm() * x;
    // An input with only two values has no parabola, only rounding of about 1e-16 of the line.
    const bool has_parabola = parabola.norm() > 1e-9 * x.norm();
    const double r_squared =
        (explained_squares(y, x) + (has_parabola ? explained_squares(y, parabola) : 0.0)) /
        y.squaredNorm();
    effects[i] = std::clamp(adjusted_r_squared(r_squared, responses.size()), 0.0, 1.0);
  }
  return effects;
}

double main_effect_chance_limit(Eigen::Index cases, Eigen::Index inputs) {
  if (cases < min_cases || inputs < 1) return 1.0;
  // R^2 of two regressors is beta distributed: P(R^2 > r) = (1 - r)^((n - 3) / 2). The probability
  // of 5 % is divided by the number of inputs (Bonferroni).
  const double probability = 0.05 / double(inputs);
  return std::max(0.0,
                  adjusted_r_squared(1.0 - std::pow(probability, 2.0 / double(cases - 3)), cases));
}

}  // namespace abbe::sim::study
