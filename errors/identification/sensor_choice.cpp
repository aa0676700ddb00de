#include "errors/identification/sensor_choice.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "errors/curve.h"
#include "errors/identification/cross_validation.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Columns of mean 0 and length 1; zero for one that stands still.
MatrixXd directions(const MatrixXd& columns) {
  MatrixXd result = columns.rowwise() - columns.colwise().mean();
  for (Index j = 0; j < columns.cols(); ++j) {
    const double length = result.col(j).norm();
    const bool moves = columns.col(j).maxCoeff() > columns.col(j).minCoeff();
    result.col(j) *= moves && length > 0 ? 1 / length : 0;
  }
  return result;
}

std::vector<int> moving(const ThermalData& data) {
  std::vector<int> result;
  for (int j = 0; j < data.T.cols(); ++j)
    if (data.T.col(j).maxCoeff() > data.T.col(j).minCoeff()) result.push_back(j);
  return result;
}

/// Degrees of the inputs named, the other entries 0.
struct Degrees {
  GreyStatus status = GreyStatus::Ok;
  int input = -1;
  VectorXd with_error;  ///< the highest with any error
  MatrixXd mutual;
  std::vector<std::optional<int>> first_row = {};  ///< (errors)
};

Degrees by_correlation(std::span<const ThermalData> errors) {
  Degrees result{GreyStatus::Ok, -1, correlations(errors.front()),
                 mutual_correlations(errors.front())};
  for (const ThermalData& error : errors)
    result.with_error = result.with_error.cwiseMax(correlations(error));
  return result;
}

/// The first row at which neither the error nor an input is too near to zero to divide by.
std::optional<int> first_row(const ThermalData& error, const std::vector<int>& inputs,
                             double least_start) {
  for (Index k = 0; k + 1 < error.y.size(); ++k)
    if (std::abs(error.y(k)) > least_start && (error.T(k, inputs).array() != 0.0).all())
      return int(k);
  return std::nullopt;
}

/// Inputs of one error as its degree takes them.
MatrixXd series_of(const ThermalData& error, const std::vector<int>& inputs,
                   const GreyOptions& options) {
  MatrixXd series = error.T(Eigen::all, inputs);
  if (options.kind == GreyKind::Deng && options.image == Image::Interval)
    for (Index j = 0; j < series.cols(); ++j)
      if ((series.col(j).array() - series.col(j).mean()).matrix().dot(error.y) < 0)
        series.col(j) *= -1;
  return series;
}

Degrees by_grey(std::span<const ThermalData> errors, const std::vector<int>& inputs,
                const SensorChoiceOptions& options) {
  const Index m = errors.front().T.cols();
  const auto input_of = [&](int series) {
    return series < 0 ? -1 : inputs[static_cast<std::size_t>(series)];
  };
  Degrees result{GreyStatus::StartsAtZero, -1, VectorXd::Zero(m), MatrixXd::Zero(m, m)};
  for (std::size_t e = 0; e < errors.size(); ++e) {
    const ThermalData& error = errors[e];
    std::optional<int> first = 0;
    if (divides_by_start(options))
      first = first_row(error, inputs, options.least_start.empty() ? 0.0 : options.least_start[e]);
    result.first_row.push_back(first);
    if (!first) continue;
    const Index rows = error.y.size() - *first;
    const MatrixXd series = series_of(error, inputs, options.grey).bottomRows(rows);
    const GreyDegrees with_error = grey_degrees(error.y.tail(rows), series, options.grey);
    const MutualDegrees mutual = mutual_degrees(series, options.grey);
    if (with_error.status != GreyStatus::Ok)
      return {with_error.status, input_of(with_error.series), {}, {}};
    if (mutual.status != GreyStatus::Ok) return {mutual.status, input_of(mutual.series), {}, {}};
    result.status = GreyStatus::Ok;
    result.with_error(inputs) = result.with_error(inputs).cwiseMax(with_error.degree).eval();
    result.mutual(inputs, inputs) = result.mutual(inputs, inputs).cwiseMax(mutual.degree).eval();
  }
  return result;
}

std::vector<std::vector<int>> grouped(const std::vector<int>& by_degree, const MatrixXd& mutual,
                                      double threshold) {
  std::vector<std::vector<int>> groups;
  for (const int sensor : by_degree) {
    const auto leader = std::ranges::find_if(groups, [&](const std::vector<int>& group) {
      return mutual(group.front(), sensor) >= threshold;
    });
    if (leader == groups.end())
      groups.push_back({sensor});
    else
      leader->push_back(sensor);
  }
  return groups;
}

/// The lowest mutual degree that, as a threshold, leaves at least `wanted` groups.
double threshold_for(const std::vector<int>& by_degree, const MatrixXd& mutual,
                     std::size_t wanted) {
  std::set<double> candidates;
  for (const int i : by_degree)
    for (const int j : by_degree)
      if (i != j) candidates.insert(mutual(i, j));
  for (const double threshold : candidates)
    if (grouped(by_degree, mutual, threshold).size() >= wanted) return threshold;
  return 1.0 + 1e-9;  // each sensor a group of its own
}

/// Mean square of what regressions on these inputs leave of all errors; infinite where one cannot
/// be made.
double left_by(std::span<const ThermalData> errors, const std::vector<int>& inputs) {
  ThermalModelOptions options;
  options.sigma_from_runs = false;
  double sum = 0.0;
  for (const ThermalData& error : errors) {
    const ThermalData some = only_inputs(error, inputs);
    if (runs(error).size() >= 2) {
      const Validation validation = cross_validate(some, options);
      if (validation.status != FitStatus::Ok) return INFINITY;
      sum += validation.overall.rms * validation.overall.rms;
    } else {
      const ThermalFit fitted = fit(some, options);
      if (!fitted.regression) return INFINITY;
      sum += fitted.regression->residual_sd * fitted.regression->residual_sd;
    }
  }
  return sum;
}

std::vector<int> screened_by_regression(std::span<const ThermalData> errors,
                                        std::vector<int> leaders, std::size_t count) {
  std::vector<int> chosen;
  while (chosen.size() < count && !leaders.empty()) {
    std::vector<double> left;
    for (const int leader : leaders) {
      std::vector<int> with = chosen;
      with.push_back(leader);
      left.push_back(left_by(errors, with));
    }
    const auto best = std::ranges::min_element(left) - left.begin();
    chosen.push_back(leaders[static_cast<std::size_t>(best)]);
    leaders.erase(leaders.begin() + best);
  }
  return chosen;
}

std::vector<int> columns_of(const std::vector<std::string>& wanted,
                            const std::vector<std::string>& names) {
  std::vector<int> columns;
  for (const std::string& name : wanted) {
    const auto found = std::ranges::find(names, name);
    if (found == names.end())
      throw std::invalid_argument("expected a sensor that was logged, seen " + name);
    columns.push_back(int(found - names.begin()));
  }
  return columns;
}

void check(std::span<const ThermalData> errors, const SensorChoiceOptions& options) {
  if (errors.empty()) throw std::invalid_argument("a choice of sensors needs an error");
  for (const ThermalData& error : errors) {
    validate(error);
    if (error.names != errors.front().names || error.run != errors.front().run ||
        error.T != errors.front().T)
      throw std::invalid_argument("errors that share sensors were not seen at the same rows");
  }
  if (options.count < 1 || options.groups < 1)
    throw std::invalid_argument("a choice of sensors needs one or more");
  if (!options.least_start.empty() && options.least_start.size() != errors.size())
    throw std::invalid_argument("a choice of sensors needs a least start for every error");
}

}  // namespace

bool divides_by_start(const SensorChoiceOptions& options) {
  if (options.likeness == Likeness::Correlation || !options.fixed.empty()) return false;
  const GreyOptions& grey = options.grey;
  return grey.kind == GreyKind::Deng ? grey.image == Image::Initial
                                     : grey.kind != GreyKind::Absolute;
}

SensorChoice choose_sensors(const ThermalData& error, const SensorChoiceOptions& options) {
  return choose_sensors(std::span(&error, 1), options);
}

SensorChoice choose_sensors(std::span<const ThermalData> errors,
                            const SensorChoiceOptions& options) {
  check(errors, options);
  SensorChoice choice;
  const std::vector<int> inputs = moving(errors.front());
  for (int j = 0; j < errors.front().T.cols(); ++j)
    if (!std::ranges::count(inputs, j)) choice.still.push_back(j);
  if (inputs.empty()) {
    choice.status = GreyStatus::StandsStill;
    choice.input = choice.still.front();
    return choice;
  }
  if (!options.fixed.empty()) {
    choice.chosen = columns_of(options.fixed, errors.front().names);
    return choice;
  }
  Degrees degrees = options.likeness == Likeness::Correlation ? by_correlation(errors)
                                                              : by_grey(errors, inputs, options);
  choice.status = degrees.status;
  choice.input = degrees.input;
  choice.first_row = std::move(degrees.first_row);
  if (choice.status != GreyStatus::Ok) return choice;
  choice.degree = std::move(degrees.with_error);
  choice.mutual = std::move(degrees.mutual);

  std::vector<int> by_degree = ranking(choice.degree);
  std::erase_if(by_degree, [&](int j) { return std::ranges::count(choice.still, j) > 0; });
  const std::size_t wanted =
      std::min(static_cast<std::size_t>(std::max(options.groups, options.count)), by_degree.size());
  choice.threshold =
      options.threshold ? *options.threshold : threshold_for(by_degree, choice.mutual, wanted);
  choice.groups = grouped(by_degree, choice.mutual, choice.threshold);

  std::vector<int> leaders;
  for (const std::vector<int>& group : choice.groups) leaders.push_back(group.front());
  const auto count = std::min(static_cast<std::size_t>(options.count), leaders.size());
  if (options.screening == Screening::Regression)
    choice.chosen = screened_by_regression(errors, leaders, count);
  else
    choice.chosen.assign(leaders.begin(), leaders.begin() + static_cast<std::ptrdiff_t>(count));
  return choice;
}

namespace {

/// The rows from `start` on with noise added.
std::vector<ThermalData> redrawn(std::span<const ThermalData> errors, Index start,
                                 const ChoiceSpreadOptions& spread, std::uint64_t stream) {
  const Index n = errors.front().y.size() - start, m = errors.front().T.cols();
  Eigen::MatrixXd T = errors.front().T.bottomRows(n);
  std::uint64_t counter = 0;
  for (Index j = 0; j < m; ++j)
    for (Index i = 0; i < n; ++i)
      T(i, j) += spread.input_noise[j] * normal_deviate(stream, counter++);
  std::vector<ThermalData> result;
  for (std::size_t e = 0; e < errors.size(); ++e) {
    ThermalData data{errors[e].names,
                     T,
                     errors[e].y.tail(n),
                     {errors[e].run.begin() + start, errors[e].run.end()}};
    for (double& y : data.y) y += spread.error_noise[e] * normal_deviate(stream, counter++);
    result.push_back(std::move(data));
  }
  return result;
}

/// Ranks of degrees, from 1; 0 of inputs without one.
std::vector<int> degree_ranks(const VectorXd& degree) {
  std::vector<int> ranks(std::size_t(degree.size()), 0);
  int rank = 0;
  for (const int input : ranking(degree))
    if (degree[input] > 0.0) ranks[std::size_t(input)] = ++rank;
  return ranks;
}

std::vector<int> ascending(std::vector<int> inputs) {
  std::ranges::sort(inputs);
  return inputs;
}

}  // namespace

ChoiceSpread choice_spread(std::span<const ThermalData> errors, const SensorChoiceOptions& options,
                           const SensorChoice& choice, const ChoiceSpreadOptions& spread) {
  check(errors, options);
  const Index m = errors.front().T.cols();
  if (spread.draws < 1 || spread.input_noise.size() != m ||
      spread.error_noise.size() != errors.size())
    throw std::invalid_argument("a spread of a choice needs draws, and a noise of every series");
  const int last = std::clamp(int(errors.front().y.size() / 4), 0, spread.last_start);
  std::vector<SensorChoice> choices(static_cast<std::size_t>(spread.draws));
  tbb::parallel_for(0, spread.draws, [&](int draw) {
    // each start row in turn, so that none is left out of a few draws
    choices[std::size_t(draw)] =
        choose_sensors(redrawn(errors, draw % (last + 1), spread,
                               spread.seed + 0x9e3779b97f4a7c15ull * std::uint64_t(draw + 1)),
                       options);
  });
  ChoiceSpread result{0,
                      last,
                      VectorXd::Zero(m),
                      std::vector<int>(std::size_t(m), 0),
                      std::vector<int>(std::size_t(m), 0),
                      0.0};
  for (const SensorChoice& one : choices) {
    if (one.status != GreyStatus::Ok) continue;  // this start has no degree
    ++result.draws;
    for (const int input : one.chosen) result.chosen[input] += 1.0;
    result.same += ascending(one.chosen) == ascending(choice.chosen);
    const std::vector<int> ranks = degree_ranks(one.degree);
    for (std::size_t j = 0; j < ranks.size(); ++j) {
      int &best = result.best_rank[j], &worst = result.worst_rank[j];
      if (ranks[j] > 0 && (best == 0 || ranks[j] < best)) best = ranks[j];
      worst = std::max(worst, ranks[j]);
    }
  }
  if (result.draws > 0) {
    result.chosen /= result.draws;
    result.same /= result.draws;
  }
  return result;
}

VectorXd correlations(const ThermalData& data) {
  return (directions(data.T).transpose() * directions(data.y)).cwiseAbs();
}

MatrixXd mutual_correlations(const ThermalData& data) {
  const MatrixXd d = directions(data.T);
  return (d.transpose() * d).cwiseAbs();
}

std::vector<int> ranking(const VectorXd& degree) {
  std::vector<int> order(static_cast<std::size_t>(degree.size()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, [&](int a, int b) { return degree(a) > degree(b); });
  return order;
}

std::vector<std::vector<int>> random_subsets(int below, int size, int how_many,
                                             std::uint64_t seed) {
  if (size < 0 || size > below || how_many < 0)
    throw std::invalid_argument("a subset is no larger than its set");
  std::mt19937_64 random(seed);
  std::vector<std::vector<int>> subsets;
  for (int i = 0; i < how_many; ++i) {
    std::vector<int> all(static_cast<std::size_t>(below));
    std::iota(all.begin(), all.end(), 0);
    for (int k = 0; k < size; ++k) {
      // The remainder is off from uniform by below / 2^64, and the same with every library.
      const auto pick = k + static_cast<int>(random() % static_cast<std::uint64_t>(below - k));
      std::swap(all[static_cast<std::size_t>(k)], all[static_cast<std::size_t>(pick)]);
    }
    all.resize(static_cast<std::size_t>(size));
    std::ranges::sort(all);
    subsets.push_back(std::move(all));
  }
  return subsets;
}

}  // namespace abbe::errors::identification
