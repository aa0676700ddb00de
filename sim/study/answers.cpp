#include "sim/study/answers.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <ranges>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "sim/study/distribution.h"

namespace abbe::sim::study {
namespace {

constexpr double tail = 0.025;  // of a band of 95 %, on either side

std::vector<double> finite_of(const Eigen::VectorXd& values, std::size_t least) {
  std::vector<double> result;
  std::ranges::copy_if(values, std::back_inserter(result),
                       [](double v) { return std::isfinite(v); });
  if (result.size() < least)
    throw std::invalid_argument("fewer than " + std::to_string(least) + " finite answers");
  return result;
}

/// Sums go one by one: Eigen's depend on where in memory they begin.
double mean_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double sum_of_powers(std::span<const double> values, double from, int power) {
  double sum = 0.0;
  for (const double value : values) sum += std::pow(value - from, power);
  return sum;
}

Banded mean_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double mean = mean_of(sorted);
  const boost::math::students_t student(n - 1.0);
  const double half = boost::math::quantile(boost::math::complement(student, tail)) *
                      deviation_of(sorted) / std::sqrt(n);
  return {mean, mean - half, mean + half};
}

/// Bonett 2006: of the logarithm, kurtosis around a trimmed mean.
Banded deviation_band(std::span<const double> sorted) {
  const auto n = double(sorted.size());
  const double deviation = deviation_of(sorted);
  if (!(deviation > 0.0)) return {0.0, 0.0, 0.0};
  const double trim = n > 5.0 ? 0.5 / std::sqrt(n - 4.0) : 0.5;
  const auto cut = std::min(std::size_t(trim * n), (sorted.size() - 1) / 2);
  const double centre = mean_of(sorted.subspan(cut, sorted.size() - 2 * cut));
  const double squares = deviation * deviation * (n - 1.0);
  const double kurtosis = n * (sum_of_powers(sorted, centre, 4) / squares / squares);
  const double z = -normal_score(tail);
  const double c = n / (n - z);  // both as Bonett adjusts them for few cases
  const double error = c * std::sqrt((kurtosis - (n - 3.0) / n) / (n - 1.0));
  const double middle = std::sqrt(c) * deviation;
  return {deviation, std::min(deviation, middle * std::exp(-0.5 * z * error)),
          std::max(deviation, middle * std::exp(0.5 * z * error))};
}

/// Ranks (from 0) between which the p-quantile of all machines lies: the number of answers below it
/// is binomial.
std::pair<std::size_t, std::size_t> rank_band(std::size_t n, double p) {
  const boost::math::binomial below(double(n), p);
  const auto ranks = std::views::iota(std::size_t(0), n);
  // Rank r lies above the quantile if at most r answers lie below it ...
  const auto too_high = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(below, double(r)) <= tail; });
  // ... and below it if more than r do.
  const auto high_enough = std::ranges::partition_point(
      ranks, [&](std::size_t r) { return cdf(complement(below, double(r))) > tail; });
  const std::size_t low = *too_high > 0 ? *too_high - 1 : 0;
  return {low, std::min(*high_enough, n - 1)};
}

Banded quantile_band(std::span<const double> sorted, double p) {
  const double value = quantile_in(sorted, p);
  const auto [low, high] = rank_band(sorted.size(), p);
  return {value, std::min(value, sorted[low]), std::max(value, sorted[high])};
}

/// Ranks of values, equal ones on their mean.
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
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (a[i] - mean_a) / scale_a * ((b[i] - mean_b) / scale_b);
  return std::clamp(sum, -1.0, 1.0);
}

}  // namespace

Answers answers(const Eigen::VectorXd& values) {
  std::vector<double> sorted = finite_of(values, 2);
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

Banded quantile_of(Eigen::VectorXd values, double p) {
  if (!(p >= 0.0 && p <= 1.0)) throw std::invalid_argument("a share is within 0 .. 1");
  std::vector<double> sorted = finite_of(values, 1);
  std::ranges::sort(sorted);
  return quantile_band(sorted, p);
}

double quantile_in(std::span<const double> sorted, double p) {
  const double at = p * double(sorted.size() - 1);
  const auto rank = std::size_t(at);
  const std::size_t next = std::min(rank + 1, sorted.size() - 1);
  return std::lerp(sorted[rank], sorted[next], at - double(rank));
}

double deviation_of(std::span<const double> values) {
  const double squares = sum_of_powers(values, mean_of(values), 2);
  return std::sqrt(squares / double(values.size() - 1));
}

Banded share_below(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_of(values, 1);
  const auto n = double(finite.size());
  const double share =
      double(std::ranges::count_if(finite, [&](double value) { return value <= limit; })) / n;
  const double z = -normal_score(tail);
  const double middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half =
      z / (1.0 + z * z / n) * std::sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n));
  return {share, std::clamp(middle - half, 0.0, share), std::clamp(middle + half, share, 1.0)};
}

std::optional<double> cpk(const Eigen::VectorXd& values, double limit) {
  const std::vector<double> finite = finite_of(values, 0);
  if (finite.size() < 2 || !varies(finite)) return std::nullopt;
  return (limit - mean_of(finite)) / (3.0 * deviation_of(finite));
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

}  // namespace abbe::sim::study
