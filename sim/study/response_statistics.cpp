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

// Fewest base points whose intervals are verified (indices_test.cpp).
constexpr Eigen::Index min_base_points = 8;
// Bootstrap draws: each end of a 95 % interval has 25 of them beyond it.
constexpr int draws = 1000;
// Base points processed together: few enough that Eigen never splits the sums of a product, which
// would make the bits depend on the size of the processor's caches.
constexpr Eigen::Index row_block = 128;

/// Columns of the moments from which every index and its standard error are computed: means over
/// base points of numerator n, of q = (a^2 + b^2)/2, of s = (a + b)/2 and of their products, in
/// this order. Every input has two numerators: those of the first order come first, then those of
/// the totals.
struct Terms {
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

/// Returns the terms of every base point; their weighted means are the moments.
/// @param answers  (k x inputs + 2) less their mean
Eigen::MatrixXd terms_of(const Eigen::MatrixXd& answers) {
  const Eigen::Index inputs = answers.cols() - 2;
  const Terms at{2 * inputs};
  const Eigen::ArrayXd a = answers.col(0);
  const Eigen::ArrayXd b = answers.col(1);
  const Eigen::ArrayXd q = 0.5 * (a.square() + b.square());
  const Eigen::ArrayXd s = 0.5 * (a + b);
  Eigen::MatrixXd terms(answers.rows(), at.columns());
  const auto put = [&](Eigen::Index j, const Eigen::ArrayXd& n) {
    terms.col(at.n(j)) = n;
    terms.col(at.nn(j)) = n.square();
    terms.col(at.nq(j)) = n * q;
    terms.col(at.ns(j)) = n * s;
  };
  for (Eigen::Index i = 0; i < inputs; ++i) {
    const Eigen::ArrayXd change = answers.col(2 + i).array() - a;
    put(i, b * change);
    put(inputs + i, 0.5 * change.square());
  }
  terms.col(at.q()) = q;
  terms.col(at.s()) = s;
  terms.col(at.qq()) = q.square();
  terms.col(at.ss()) = s.square();
  terms.col(at.qs()) = q * s;
  return terms;
}

/// Estimates from the means of the terms, with standard errors by the delta method.
struct Estimates {
  Eigen::ArrayXd value;  ///< (numerators)
  Eigen::ArrayXd error;
};

/// Computes the estimates.
/// @param weight  number of base points in the means
Estimates estimates(const Eigen::VectorXd& mean, const Terms& at, double weight) {
  const double q = mean(at.q());
  const double s = mean(at.s());
  const double variance = q - s * s;
  // The error of the variance is that of v = q - 2 s(mean) s about its mean, to first order.
  const double vv = (mean(at.qq()) - q * q) - 4.0 * s * (mean(at.qs()) - q * s) +
                    4.0 * s * s * (mean(at.ss()) - s * s);
  Estimates result{Eigen::ArrayXd(at.numerators), Eigen::ArrayXd(at.numerators)};
  for (Eigen::Index j = 0; j < at.numerators; ++j) {
    const double n = mean(at.n(j));
    const double value = n / variance;
    const double nv = (mean(at.nq(j)) - n * q) - 2.0 * s * (mean(at.ns(j)) - n * s);
    const double square = (mean(at.nn(j)) - n * n) - 2.0 * value * nv + value * value * vv;
    result.value(j) = value;
    result.error(j) = std::sqrt(std::max(0.0, square) / (weight - 1.0)) / variance;
  }
  return result;
}

/// Cumulative probabilities of a Poisson number of mean 1 at 0, 1, ... 17; the probability above 17
/// is 6e-17, less than the spacing 2^-53 of the uniform numbers.
constexpr std::array<double, 18> poisson_shares = [] {
  std::array<double, 18> shares = {0.36787944117144233};
  double share = shares[0];
  for (std::size_t k = 1; k < shares.size(); ++k) shares[k] = shares[k - 1] + (share /= double(k));
  return shares;
}();

/// Returns the Poisson number for a uniform number. All probabilities are compared, because a
/// branch that cannot be predicted takes longer.
double poisson_1(double u) {
  double count = 0.0;
  for (const double share : poisson_shares) count += u > share ? 1.0 : 0.0;
  return count;
}

/// Returns the weighted sums of the terms, with the sums of the weights in the last row: every base
/// point once in the first column, then the bootstrap draws. (columns + 1 x draws + 1)
Eigen::MatrixXd weighted_sums(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Terms at{2 * (answers.cols() - 2)};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(at.columns() + 1, draws + 1);
  for (Eigen::Index first = 0; first < answers.rows(); first += row_block) {
    const Eigen::Index count = std::min(row_block, answers.rows() - first);
    Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(draws + 1, count);
    weights.bottomRows(draws) =
        points({Sampling::Random, draws, seed}, std::uint64_t(first), count).unaryExpr(&poisson_1);
    Eigen::MatrixXd terms(count, at.columns() + 1);
    terms << terms_of(answers.middleRows(first, count)), Eigen::VectorXd::Ones(count);
    sums.noalias() += terms.transpose() * weights.transpose();
  }
  return sums;
}

/// Returns the distance of each draw's estimate from the estimate, in standard errors. (numerators
/// x useful draws)
std::vector<std::vector<double>> studentised(const Eigen::MatrixXd& sums, const Terms& at,
                                             const Estimates& estimate) {
  std::vector<std::vector<double>> result(static_cast<std::size_t>(at.numerators));
  for (Eigen::Index k = 1; k < sums.cols(); ++k) {
    const double weight = sums(at.columns(), k);
    // The standard error divides by weight - 1.
    if (weight < 2.0) continue;
    const Estimates drawn = estimates(sums.col(k).head(at.columns()) / weight, at, weight);
    for (Eigen::Index j = 0; j < at.numerators; ++j) {
      const double t = (drawn.value(j) - estimate.value(j)) / drawn.error(j);
      // Not finite: all points of the draw were alike.
      if (std::isfinite(t)) result[std::size_t(j)].push_back(t);
    }
  }
  return result;
}

/// Returns an estimate with its bootstrap-t interval (Hall 1992).
/// @param t  studentised draws of the estimate
IntervalEstimate banded(double value, double error, std::vector<double>& t) {
  if (!(error > 0.0) || t.empty()) return {value, value, value};
  const auto rank = [&](double p) {
    const auto at = t.begin() + std::ptrdiff_t(std::lround(p * double(t.size() - 1)));
    std::nth_element(t.begin(), at, t.end());
    return *at;
  };
  const double low = value - rank(0.975) * error;
  const double high = value - rank(0.025) * error;
  // No index is outside 0 .. 1, so clipping the interval there excludes no true value.
  return {value, std::min(value, std::max(low, 0.0)), std::max(value, std::min(high, 1.0))};
}

/// Returns the rows in which every response is finite.
Eigen::MatrixXd complete(const Eigen::MatrixXd& answers) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; k < answers.rows(); ++k)
    if (answers.row(k).allFinite()) rows.push_back(k);
  if (answers.cols() < 3) throw std::invalid_argument("Sobol indices need columns A, B and inputs");
  if (Eigen::Index(rows.size()) < min_base_points)
    throw std::invalid_argument("Sobol indices need 8 base points with all their answers");
  return answers(rows, Eigen::all);
}

/// Returns the responses less their mean and scaled to size 1, so that fourth powers of tiny or
/// huge responses stay within the range of doubles. Sums are formed one by one, because the order
/// of Eigen's sums depends on the alignment of the data.
Eigen::MatrixXd standardised(const Eigen::MatrixXd& answers) {
  const auto ab = answers.leftCols(2).array();
  const double middle = 0.5 * ab.minCoeff() + 0.5 * ab.maxCoeff();
  const double reach = 0.5 * ab.maxCoeff() - 0.5 * ab.minCoeff();
  Eigen::MatrixXd result = (answers.array() - middle) / reach;
  const double sum = std::accumulate(result.data(), result.data() + 2 * result.rows(), 0.0);
  result.array() -= sum / double(2 * result.rows());
  return result;
}

/// @param answers  all finite
std::vector<SobolIndex> indices_of(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Eigen::Index inputs = answers.cols() - 2;
  std::vector<SobolIndex> result(static_cast<std::size_t>(inputs));
  if (answers.leftCols(2).maxCoeff() == answers.leftCols(2).minCoeff()) return result;
  const Terms at{2 * inputs};
  const auto count = double(answers.rows());
  const Eigen::MatrixXd sums = weighted_sums(standardised(answers), seed);
  const Estimates estimate = estimates(sums.col(0).head(at.columns()) / count, at, count);
  std::vector<std::vector<double>> t = studentised(sums, at, estimate);
  const auto band = [&](Eigen::Index j) {
    return banded(estimate.value(j), estimate.error(j), t[std::size_t(j)]);
  };
  for (Eigen::Index i = 0; i < inputs; ++i) result[std::size_t(i)] = {band(i), band(inputs + i)};
  return result;
}

}  // namespace

std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  return indices_of(complete(answers), seed);
}

IndexConvergence convergence(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Eigen::MatrixXd gapless = complete(answers);
  IndexConvergence result;
  for (Eigen::Index count = gapless.rows(); count >= min_base_points; count /= 2)
    result.base_points.insert(result.base_points.begin(), count);
  for (const Eigen::Index count : result.base_points)
    result.indices.push_back(indices_of(gapless.topRows(count), seed));
  return result;
}

Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column) {
  const Eigen::Index inputs = u.size() / 2;
  if (u.size() % 2 != 0 || column < 0 || column >= inputs + 2)
    throw std::invalid_argument("a point of Sobol's design is A, B or A with an input of B");
  if (column == 1) return u.tail(inputs);
  Eigen::VectorXd point = u.head(inputs);
  if (column >= 2) point(column - 2) = u(inputs + column - 2);
  return point;
}

namespace {

constexpr double tail = 0.025;  // of a band of 95 %, on either side

std::vector<double> finite_values(const Eigen::VectorXd& values, std::size_t least) {
  std::vector<double> result;
  std::ranges::copy_if(values, std::back_inserter(result),
                       [](double v) { return std::isfinite(v); });
  if (result.size() < least)
    throw std::invalid_argument("fewer than " + std::to_string(least) + " finite answers");
  return result;
}

/// Sums are formed one by one: the order of Eigen's sums depends on the alignment of the data.
double mean_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double sum_of_powers(std::span<const double> values, double from, int power) {
  double sum = 0.0;
  for (const double value : values) sum += std::pow(value - from, power);
  return sum;
}

IntervalEstimate mean_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double mean = mean_of(sorted);
  const boost::math::students_t student(n - 1.0);
  const double half = boost::math::quantile(boost::math::complement(student, tail)) *
                      sample_deviation(sorted) / std::sqrt(n);
  return {mean, mean - half, mean + half};
}

/// Returns the standard deviation with Bonett's interval (2006): symmetric in the logarithm, with
/// the kurtosis about a trimmed mean so that outliers do not inflate it.
IntervalEstimate deviation_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double deviation = sample_deviation(sorted);
  if (!(deviation > 0.0)) return {0.0, 0.0, 0.0};
  const double trim = n > 5.0 ? 0.5 / std::sqrt(n - 4.0) : 0.5;
  const auto cut = std::min(std::size_t(trim * n), (sorted.size() - 1) / 2);
  const double centre = mean_of(sorted.subspan(cut, sorted.size() - 2 * cut));
  const double squares = deviation * deviation * (n - 1.0);
  const double kurtosis = n * (sum_of_powers(sorted, centre, 4) / squares / squares);
  const double z = -normal_score(tail);
  const double c = n / (n - z);  // this factor and the half in `middle` are Bonett's small-sample
                                 // adjustment
  const double error = c * std::sqrt((kurtosis - (n - 3.0) / n) / (n - 1.0));
  const double middle = std::sqrt(c) * deviation;
  return {deviation, std::min(deviation, middle * std::exp(-0.5 * z * error)),
          std::max(deviation, middle * std::exp(0.5 * z * error))};
}

/// Returns the ranks (from 0) that enclose the p-quantile of the population: the number of
/// responses below it is binomial.
std::pair<std::size_t, std::size_t> rank_band(std::size_t n, double p) {
  const boost::math::binomial below(double(n), p);
  const auto ranks = std::views::iota(std::size_t(0), n);
  // Rank r lies above the quantile if at most r responses lie below it,
  const auto too_high = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(below, double(r)) <= tail; });
  // and below it if more than r do.
  const auto lower_rank = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(complement(below, double(r))) > tail; });
  const std::size_t low = *too_high > 0 ? *too_high - 1 : 0;
  return {low, std::min(*lower_rank, n - 1)};
}

IntervalEstimate quantile_band(std::span<const double> sorted, double p) {
  const double value = sorted_quantile(sorted, p);
  const auto [low, high] = rank_band(sorted.size(), p);
  return {value, std::min(value, sorted[low]), std::max(value, sorted[high])};
}

/// Returns the ranks of values, ties at their mean rank.
std::vector<double> ranks_of(std::span<const double> values) {
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

bool varies(std::span<const double> values) {
  return std::ranges::any_of(values, [&](double value) { return value != values.front(); });
}

double pearson(std::span<const double> a, std::span<const double> b) {
  if (!varies(a) || !varies(b)) return 0.0;
  const double mean_a = mean_of(a);
  const double mean_b = mean_of(b);
  const double scale_a = std::sqrt(sum_of_powers(a, mean_a, 2));
  const double scale_b = std::sqrt(sum_of_powers(b, mean_b, 2));
  double sum = 0.0;
  // Both are normalised before the products: the product of two sums of squares may overflow.
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (a[i] - mean_a) / scale_a * ((b[i] - mean_b) / scale_b);
  return std::clamp(sum, -1.0, 1.0);
}

}  // namespace

Answers answers(const Eigen::VectorXd& values) {
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

IntervalEstimate quantile_with_band(Eigen::VectorXd values, double p) {
  if (!(p >= 0.0 && p <= 1.0)) throw std::invalid_argument("a share is within 0 .. 1");
  std::vector<double> sorted = finite_values(values, 1);
  std::ranges::sort(sorted);
  return quantile_band(sorted, p);
}

double sorted_quantile(std::span<const double> sorted, double p) {
  const double at = p * double(sorted.size() - 1);
  const auto rank = std::size_t(at);
  const std::size_t next = std::min(rank + 1, sorted.size() - 1);
  return std::lerp(sorted[rank], sorted[next], at - double(rank));
}

double sample_deviation(std::span<const double> values) {
  const double squares = sum_of_powers(values, mean_of(values), 2);
  return std::sqrt(squares / double(values.size() - 1));
}

IntervalEstimate fraction_below(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_values(values, 1);
  const auto n = double(finite.size());
  const double share =
      double(std::ranges::count_if(finite, [&](double value) { return value <= limit; })) / n;
  const double z = -normal_score(tail);
  // Wilson's interval stays within 0 .. 1 and keeps a width where all or no responses are within
  // the limit, unlike the normal approximation.
  const double middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half =
      z / (1.0 + z * z / n) * std::sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n));
  return {share, std::clamp(middle - half, 0.0, share), std::clamp(middle + half, share, 1.0)};
}

std::optional<double> cpk(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_values(values, 0);
  if (finite.size() < 2 || !varies(finite)) return std::nullopt;
  return (limit - mean_of(finite)) / (3.0 * sample_deviation(finite));
}

Correlations correlations(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values) {
  if (inputs.cols() != values.size())
    throw std::invalid_argument("inputs and answers of different numbers of cases");
  std::vector<Eigen::Index> cases;
  for (Eigen::Index k = 0; k < values.size(); ++k)
    if (std::isfinite(values(k)) && inputs.col(k).allFinite()) cases.push_back(k);
  const auto of_cases = [&](const auto& all) {
    std::vector<double> result;
    for (const Eigen::Index k : cases) result.push_back(all(k));
    return result;
  };
  Correlations result{Eigen::VectorXd::Zero(inputs.rows()), Eigen::VectorXd::Zero(inputs.rows())};
  if (cases.empty()) return result;
  const std::vector<double> answer = of_cases(values);
  const std::vector<double> answer_ranks = ranks_of(answer);
  tbb::parallel_for(Eigen::Index(0), inputs.rows(), [&](Eigen::Index i) {
    const std::vector<double> input = of_cases(inputs.row(i));
    result.linear(i) = pearson(input, answer);
    result.rank(i) = pearson(ranks_of(input), answer_ranks);
  });
  return result;
}

namespace {

// With fewer cases chance alone explains more than 2 / 9 of the variance by two regressors.
constexpr Eigen::Index min_cases = 10;
constexpr double regressors = 2.0;  // line, parabola

Eigen::VectorXd centred(const Eigen::VectorXd& values) { return values.array() - values.mean(); }

/// Returns R^2 less its mean where input and response are independent (Ezekiel 1930).
double adjusted(double r_squared, Eigen::Index cases) {
  const double n = double(cases);
  return 1.0 - (1.0 - r_squared) * (n - 1.0) / (n - 1.0 - regressors);
}

/// Returns the part of the sum of squares of y, which is centred, along a direction.
double explained(const Eigen::VectorXd& y, const Eigen::VectorXd& along) {
  const double size = along.squaredNorm();
  return size > 0.0 ? std::pow(y.dot(along), 2) / size : 0.0;
}

}  // namespace

Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& answers) {
  Eigen::VectorXd effects = Eigen::VectorXd::Zero(inputs.rows());
  const Eigen::VectorXd y = centred(answers);
  if (answers.size() < min_cases || !(y.squaredNorm() > 0.0)) return effects;
  for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
    Eigen::VectorXd x = centred(inputs.row(i).transpose());
    const double spread = x.norm() / std::sqrt(double(x.size()));
    if (!(spread > 0.0)) continue;
    x /= spread;  // so that its squares neither underflow nor overflow
    Eigen::VectorXd parabola = centred(x.cwiseProduct(x));
    // Made orthogonal to the line, so that both parts of the variance add up.
    parabola -= parabola.dot(x) / x.squaredNorm() * x;
    // An input with two values only has no parabola beyond rounding, some 1e-16 of the line.
    const bool bends = parabola.norm() > 1e-9 * x.norm();
    const double r_squared =
        (explained(y, x) + (bends ? explained(y, parabola) : 0.0)) / y.squaredNorm();
    effects[i] = std::clamp(adjusted(r_squared, answers.size()), 0.0, 1.0);
  }
  return effects;
}

double chance_effect(Eigen::Index cases, Eigen::Index inputs) {
  if (cases < min_cases || inputs < 1) return 1.0;
  // R^2 of two regressors is beta distributed: P(R^2 > r) = (1 - r)^((n - 3) / 2). The probability
  // of 5 % is divided by the number of inputs (Bonferroni).
  const double any = 0.05 / double(inputs);
  return std::max(0.0, adjusted(1.0 - std::pow(any, 2.0 / double(cases - 3)), cases));
}

}  // namespace abbe::sim::study
