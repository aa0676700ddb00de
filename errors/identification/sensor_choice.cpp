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
#include "errors/identification/thermal_model.h"
#include "kinematics/bad_input.h"

// Choice of temperature sensors by their similarity to thermal errors (grey relational degrees or
// correlation), and its evaluation.

namespace abbe::errors::identification {

namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void validate_series(const MatrixXd& series, const GreyOptions& options) {
  require(series.rows() >= 2, "a grey relational degree needs at least two instants");
  require(series.cols() >= 1, "a grey relational degree needs at least one series");
  require(series.allFinite(), "a grey relational degree needs finite numbers");
  require(options.rho > 0 && options.rho <= 1, "rho of a grey relational degree must be in (0, 1]");
  require(options.theta >= 0 && options.theta <= 1,
          "theta of a grey relational degree must be in [0, 1]");
}

/// Series normalised for a grey degree.
struct NormalisedSeries {
  GreyStatus status = GreyStatus::Ok;
  int failed_column = -1;  ///< column that cannot be normalised
  MatrixXd values;
};

/// Returns each column normalised: divided by its first value or its mean, or shifted by its
/// minimum and divided by its range. Stops at the first column whose divisor is 0.
NormalisedSeries normalise(const MatrixXd& series, Image image) {
  NormalisedSeries result;
  result.values = series;
  for (int i = 0; i < series.cols() && result.status == GreyStatus::Ok; ++i) {
    auto x = result.values.col(i);
    double divisor = 1.0;
    if (image == Image::Initial) {
      divisor = x(0);
      if (divisor == 0) result.status = GreyStatus::StartsAtZero;
    } else if (image == Image::Mean) {
      divisor = x.mean();
      if (divisor == 0) result.status = GreyStatus::MeanIsZero;
    } else if (image == Image::Interval) {
      divisor = x.maxCoeff() - x.minCoeff();
      if (divisor == 0) result.status = GreyStatus::ConstantSeries;
      x.array() -= x.minCoeff();
    }
    if (result.status == GreyStatus::Ok)
      x /= divisor;
    else
      result.failed_column = i;
  }
  return result;
}

/// Returns Liu's s of each column: the signed area between the series and its initial value.
VectorXd areas(const MatrixXd& series) {
  const auto n = series.rows();
  const MatrixXd from_start = series.rowwise() - series.row(0);
  return (from_start.middleRows(1, n - 2).colwise().sum() + 0.5 * from_start.row(n - 1))
      .transpose();
}

/// Returns Liu's degree of two series with the areas s0 and si.
double liu_degree(double s0, double si) {
  const double sum = 1.0 + std::abs(s0) + std::abs(si);
  return sum / (sum + std::abs(si - s0));
}

/// Returns Liu's degree of every pair of areas.
MatrixXd liu_matrix(const VectorXd& s) {
  return MatrixXd::NullaryExpr(s.size(), s.size(),
                               [&](auto i, auto j) { return liu_degree(s(i), s(j)); });
}

/// Returns Deng's degree: the mean of his relational coefficients.
double deng_degree(const ArrayXd& difference, double min_difference, double max_difference,
                   double rho) {
  if (max_difference == 0) return 1.0;
  return ((min_difference + rho * max_difference) / (difference + rho * max_difference)).mean();
}

/// Returns Liu's degrees, of the requested kind, of all pairs.
MutualDegrees liu_degrees(const MatrixXd& series, const GreyOptions& options) {
  MutualDegrees result;
  const bool absolute = options.kind != GreyKind::Relative;
  const bool relative = options.kind != GreyKind::Absolute;
  const double theta = !relative ? 1.0 : !absolute ? 0.0 : options.theta;
  result.degree.setZero(series.cols(), series.cols());
  if (absolute) result.degree += theta * liu_matrix(areas(series));
  if (relative) {
    const NormalisedSeries initial = normalise(series, Image::Initial);
    if (initial.status != GreyStatus::Ok) return {initial.status, initial.failed_column, {}};
    result.degree += (1 - theta) * liu_matrix(areas(initial.values));
  }
  return result;
}

}  // namespace

GreyDegrees grey_degrees(const VectorXd& reference, const MatrixXd& series,
                         const GreyOptions& options) {
  require(reference.size() == series.rows(),
          "reference and series of a grey relational degree differ in length");
  const auto m = series.cols();
  MatrixXd combined(series.rows(), m + 1);
  combined << reference, series;
  validate_series(combined, options);
  require(m >= 1, "a grey relational degree needs at least one series");
  if (options.kind != GreyKind::Deng) {
    const MutualDegrees mutual = liu_degrees(combined, options);
    if (mutual.status != GreyStatus::Ok) return {mutual.status, mutual.series - 1, {}};
    return {GreyStatus::Ok, -1, mutual.degree.col(0).tail(m)};
  }
  const NormalisedSeries normalised = normalise(combined, options.image);
  if (normalised.status != GreyStatus::Ok)
    return {normalised.status, normalised.failed_column - 1, {}};
  const MatrixXd difference =
      (normalised.values.rightCols(m).colwise() - normalised.values.col(0)).cwiseAbs();
  const double min_difference = difference.minCoeff(), max_difference = difference.maxCoeff();
  GreyDegrees result{GreyStatus::Ok, -1, VectorXd(m)};
  for (int i = 0; i < m; ++i)
    result.degree(i) =
        deng_degree(difference.col(i).array(), min_difference, max_difference, options.rho);
  return result;
}

MutualDegrees mutual_degrees(const MatrixXd& series, const GreyOptions& options) {
  validate_series(series, options);
  if (options.kind != GreyKind::Deng) return liu_degrees(series, options);
  const NormalisedSeries normalised = normalise(series, options.image);
  if (normalised.status != GreyStatus::Ok) return {normalised.status, normalised.failed_column, {}};
  const auto m = series.cols();
  double max_difference = 0;
  for (int i = 0; i < m; ++i)
    max_difference =
        std::max(max_difference,
                 (normalised.values.colwise() - normalised.values.col(i)).cwiseAbs().maxCoeff());
  MutualDegrees result{GreyStatus::Ok, -1, MatrixXd::Identity(m, m)};
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < i; ++j) {
      const ArrayXd difference =
          (normalised.values.col(i) - normalised.values.col(j)).cwiseAbs().array();
      result.degree(i, j) = result.degree(j, i) =
          deng_degree(difference, 0, max_difference, options.rho);
    }
  return result;
}

const char* to_string(GreyStatus status) {
  switch (status) {
    case GreyStatus::Ok:
      return "ok";
    case GreyStatus::StartsAtZero:
      return "a series that starts at zero has no initial-value image";
    case GreyStatus::MeanIsZero:
      return "a series with mean zero has no mean-value image";
    case GreyStatus::ConstantSeries:
      return "a constant series has no interval image";
  }
  return "";
}

namespace {

using Eigen::Index;

/// Returns the columns scaled to mean 0 and length 1; a constant column becomes zero.
MatrixXd standardised_columns(const MatrixXd& columns) {
  MatrixXd result = columns.rowwise() - columns.colwise().mean();
  for (Index j = 0; j < columns.cols(); ++j) {
    const double length = result.col(j).norm();
    const bool is_varying = columns.col(j).maxCoeff() > columns.col(j).minCoeff();
    result.col(j) *= is_varying && length > 0 ? 1 / length : 0;
  }
  return result;
}

/// Returns the indices of the inputs that are not constant.
std::vector<int> varying_inputs(const ThermalData& data) {
  std::vector<int> result;
  for (int j = 0; j < data.T.cols(); ++j)
    if (data.T.col(j).maxCoeff() > data.T.col(j).minCoeff()) result.push_back(j);
  return result;
}

/// Similarity of the selected inputs to the errors and to each other, 0 .. 1; entries of other
/// inputs are 0.
struct Degrees {
  GreyStatus status = GreyStatus::Ok;
  int input = -1;       ///< input that cannot be normalised; -1 stands for the error
  VectorXd with_error;  ///< (m) the highest degree with any error
  MatrixXd mutual;      ///< (m x m) between inputs
  std::vector<std::optional<int>> first_row = {};  ///< (errors)
};

/// Returns the absolute correlation of the error with every input; 0 for a constant input.
VectorXd correlations(const ThermalData& data) {
  return (standardised_columns(data.T).transpose() * standardised_columns(data.y)).cwiseAbs();
}

Degrees correlation_degrees(std::span<const ThermalData> data_sets) {
  const MatrixXd d = standardised_columns(data_sets.front().T);
  Degrees result{GreyStatus::Ok, -1, correlations(data_sets.front()),
                 (d.transpose() * d).cwiseAbs()};
  for (const ThermalData& data_set : data_sets)
    result.with_error = result.with_error.cwiseMax(correlations(data_set));
  return result;
}

/// Returns the first row at which the magnitude of the error exceeds `min_start` and no input is
/// zero, so that error and inputs can be divided by their values there.
std::optional<int> first_row(const ThermalData& data_set, const std::vector<int>& inputs,
                             double min_start) {
  for (Index k = 0; k + 1 < data_set.y.size(); ++k)
    if (std::abs(data_set.y(k)) > min_start && (data_set.T(k, inputs).array() != 0.0).all())
      return int(k);
  return std::nullopt;
}

/// Returns the inputs of one error in the form that its degree requires.
MatrixXd degree_series(const ThermalData& data_set, const std::vector<int>& inputs,
                       const GreyOptions& options) {
  MatrixXd series = data_set.T(Eigen::all, inputs);
  // The interval image maps rising and falling series to opposite shapes, so a sensor that falls
  // while the error rises is inverted first.
  if (options.kind == GreyKind::Deng && options.image == Image::Interval)
    for (Index j = 0; j < series.cols(); ++j)
      if ((series.col(j).array() - series.col(j).mean()).matrix().dot(data_set.y) < 0)
        series.col(j) *= -1;
  return series;
}

/// Returns the grey relational degrees, each the highest over all errors.
Degrees grey_relational_degrees(std::span<const ThermalData> data_sets,
                                const std::vector<int>& inputs,
                                const SensorChoiceOptions& options) {
  const Index m = data_sets.front().T.cols();
  const auto input_index = [&](int column) {
    return column < 0 ? -1 : inputs[static_cast<std::size_t>(column)];
  };
  Degrees result{GreyStatus::StartsAtZero, -1, VectorXd::Zero(m), MatrixXd::Zero(m, m)};
  for (std::size_t e = 0; e < data_sets.size(); ++e) {
    const ThermalData& data_set = data_sets[e];
    std::optional<int> start_row = 0;
    if (is_divided_by_start(options))
      start_row =
          first_row(data_set, inputs, options.min_start.empty() ? 0.0 : options.min_start[e]);
    result.first_row.push_back(start_row);
    if (!start_row) continue;
    const Index rows = data_set.y.size() - *start_row;
    const MatrixXd series = degree_series(data_set, inputs, options.grey).bottomRows(rows);
    const GreyDegrees with_error = grey_degrees(data_set.y.tail(rows), series, options.grey);
    const MutualDegrees mutual = mutual_degrees(series, options.grey);
    if (with_error.status != GreyStatus::Ok)
      return {with_error.status, input_index(with_error.series), {}, {}};
    if (mutual.status != GreyStatus::Ok) return {mutual.status, input_index(mutual.series), {}, {}};
    result.status = GreyStatus::Ok;
    result.with_error(inputs) = result.with_error(inputs).cwiseMax(with_error.degree).eval();
    result.mutual(inputs, inputs) = result.mutual(inputs, inputs).cwiseMax(mutual.degree).eval();
  }
  return result;
}

/// Returns groups of similar sensors, each with its leader first.
std::vector<std::vector<int>> group_sensors(const std::vector<int>& by_degree,
                                            const MatrixXd& mutual, double threshold) {
  std::vector<std::vector<int>> groups;
  // In descending degree, so that the best sensor of a group is its leader.
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

/// Returns the lowest threshold, among all mutual degrees, that gives at least `group_count`
/// groups.
double grouping_threshold(const std::vector<int>& by_degree, const MatrixXd& mutual,
                          std::size_t group_count) {
  std::set<double> candidates;
  for (const int i : by_degree)
    for (const int j : by_degree)
      if (i != j) candidates.insert(mutual(i, j));
  for (const double threshold : candidates)
    if (group_sensors(by_degree, mutual, threshold).size() >= group_count) return threshold;
  return 1.0 + 1e-9;  // every sensor is its own group
}

/// Returns the sum over all errors of the mean squared residual of a regression on these inputs;
/// infinite if a regression is not possible.
double regression_residual(std::span<const ThermalData> data_sets, const std::vector<int>& inputs) {
  ThermalModelOptions options;
  options.sigma_from_runs = false;
  double squared_sum = 0.0;
  for (const ThermalData& data_set : data_sets) {
    const ThermalData selected_data = select_inputs(data_set, inputs);
    if (runs(data_set).size() >= 2) {
      const Validation validation = cross_validate(selected_data, options);
      if (validation.status != FitStatus::Ok) return INFINITY;
      squared_sum += validation.overall.rms * validation.overall.rms;
    } else {
      const ThermalFit thermal_fit = fit(selected_data, options);
      if (!thermal_fit.regression) return INFINITY;
      squared_sum += thermal_fit.regression->residual_sd * thermal_fit.regression->residual_sd;
    }
  }
  return squared_sum;
}

/// Selects `count` of the leaders one by one, each time the one that lowers the residual most.
std::vector<int> screen_by_regression(std::span<const ThermalData> data_sets,
                                      std::vector<int> leaders, std::size_t count) {
  std::vector<int> chosen;
  // Greedy forward selection: every subset would need a fit of its own.
  while (chosen.size() < count && !leaders.empty()) {
    std::vector<double> residuals;
    for (const int leader : leaders) {
      std::vector<int> candidate = chosen;
      candidate.push_back(leader);
      residuals.push_back(regression_residual(data_sets, candidate));
    }
    const auto best_index = std::ranges::min_element(residuals) - residuals.begin();
    chosen.push_back(leaders[static_cast<std::size_t>(best_index)]);
    leaders.erase(leaders.begin() + best_index);
  }
  return chosen;
}

std::vector<int> input_columns(const std::vector<std::string>& selection,
                               const std::vector<std::string>& names) {
  std::vector<int> columns;
  for (const std::string& name : selection) {
    const auto position = std::ranges::find(names, name);
    if (position == names.end())
      throw std::invalid_argument("expected a logged sensor, seen " + name);
    columns.push_back(int(position - names.begin()));
  }
  return columns;
}

void check(std::span<const ThermalData> data_sets, const SensorChoiceOptions& options) {
  if (data_sets.empty())
    throw std::invalid_argument("a choice of sensors needs at least one error");
  for (const ThermalData& data_set : data_sets) {
    validate(data_set);
    if (data_set.names != data_sets.front().names || data_set.run != data_sets.front().run ||
        data_set.T != data_sets.front().T)
      throw std::invalid_argument("errors that share sensors were not recorded at the same rows");
  }
  if (options.count < 1 || options.groups < 1)
    throw std::invalid_argument("a choice of sensors needs at least one sensor and one group");
  if (!options.min_start.empty() && options.min_start.size() != data_sets.size())
    throw std::invalid_argument("a choice of sensors needs a minimum start for every error");
}

}  // namespace

bool is_divided_by_start(const SensorChoiceOptions& options) {
  if (options.similarity_measure == SimilarityMeasure::Correlation || !options.fixed.empty())
    return false;
  const GreyOptions& grey = options.grey;
  return grey.kind == GreyKind::Deng ? grey.image == Image::Initial
                                     : grey.kind != GreyKind::Absolute;
}

SensorChoice choose_sensors(std::span<const ThermalData> data_sets,
                            const SensorChoiceOptions& options) {
  check(data_sets, options);
  SensorChoice choice;
  const std::vector<int> inputs = varying_inputs(data_sets.front());
  for (int j = 0; j < data_sets.front().T.cols(); ++j)
    if (!std::ranges::count(inputs, j)) choice.constant_inputs.push_back(j);
  if (inputs.empty()) {
    choice.status = GreyStatus::ConstantSeries;
    choice.input = choice.constant_inputs.front();
    return choice;
  }
  if (!options.fixed.empty()) {
    choice.chosen = input_columns(options.fixed, data_sets.front().names);
    return choice;
  }
  Degrees degrees = options.similarity_measure == SimilarityMeasure::Correlation
                        ? correlation_degrees(data_sets)
                        : grey_relational_degrees(data_sets, inputs, options);
  choice.status = degrees.status;
  choice.input = degrees.input;
  choice.first_row = std::move(degrees.first_row);
  if (choice.status != GreyStatus::Ok) return choice;
  choice.degree = std::move(degrees.with_error);
  choice.mutual = std::move(degrees.mutual);

  std::vector<int> by_degree = ranking(choice.degree);
  std::erase_if(by_degree,
                [&](int j) { return std::ranges::count(choice.constant_inputs, j) > 0; });
  const std::size_t group_count =
      std::min(static_cast<std::size_t>(std::max(options.groups, options.count)), by_degree.size());
  choice.threshold = options.threshold ? *options.threshold
                                       : grouping_threshold(by_degree, choice.mutual, group_count);
  choice.groups = group_sensors(by_degree, choice.mutual, choice.threshold);

  std::vector<int> leaders;
  for (const std::vector<int>& group : choice.groups) leaders.push_back(group.front());
  const auto count = std::min(static_cast<std::size_t>(options.count), leaders.size());
  if (options.screening == Screening::Regression)
    choice.chosen = screen_by_regression(data_sets, leaders, count);
  else
    choice.chosen.assign(leaders.begin(), leaders.begin() + static_cast<std::ptrdiff_t>(count));
  return choice;
}

namespace {

/// Returns the data from row `start` on, with noise added.
std::vector<ThermalData> redraw_noise(std::span<const ThermalData> data_sets, Index start,
                                      const ChoiceSpreadOptions& spread, std::uint64_t stream) {
  const Index n = data_sets.front().y.size() - start, m = data_sets.front().T.cols();
  Eigen::MatrixXd T = data_sets.front().T.bottomRows(n);
  std::uint64_t counter = 0;
  for (Index j = 0; j < m; ++j)
    for (Index i = 0; i < n; ++i)
      T(i, j) += spread.input_noise[j] * normal_deviate(stream, counter++);
  std::vector<ThermalData> result;
  for (std::size_t e = 0; e < data_sets.size(); ++e) {
    ThermalData data{data_sets[e].names,
                     T,
                     data_sets[e].y.tail(n),
                     {data_sets[e].run.begin() + start, data_sets[e].run.end()}};
    for (double& y : data.y) y += spread.error_noise[e] * normal_deviate(stream, counter++);
    result.push_back(std::move(data));
  }
  return result;
}

/// Returns the ranks of the degrees, from 1; 0 for inputs without a degree.
std::vector<int> degree_ranks(const VectorXd& degree) {
  std::vector<int> ranks(std::size_t(degree.size()), 0);
  int rank = 0;
  for (const int input : ranking(degree))
    if (degree[input] > 0.0) ranks[std::size_t(input)] = ++rank;
  return ranks;
}

std::vector<int> in_ascending_order(std::vector<int> inputs) {
  std::ranges::sort(inputs);
  return inputs;
}

}  // namespace

ChoiceSpread choice_spread(std::span<const ThermalData> data_sets,
                           const SensorChoiceOptions& options, const SensorChoice& choice,
                           const ChoiceSpreadOptions& spread) {
  check(data_sets, options);
  const Index m = data_sets.front().T.cols();
  if (spread.draws < 1 || spread.input_noise.size() != m ||
      spread.error_noise.size() != data_sets.size())
    throw std::invalid_argument("the spread of a choice needs draws and a noise for every series");
  // At least three quarters of the rows remain.
  const int latest_start = std::clamp(int(data_sets.front().y.size() / 4), 0, spread.last_start);
  std::vector<SensorChoice> choices(static_cast<std::size_t>(spread.draws));
  // Each draw has a seed of its own, so the result does not depend on the number of threads;
  // multiples of an odd constant (2^64 / golden ratio) keep the seeds apart.
  tbb::parallel_for(0, spread.draws, [&](int draw) {
    // Start rows are used in turn, so that all occur even in a few draws.
    choices[std::size_t(draw)] =
        choose_sensors(redraw_noise(data_sets, draw % (latest_start + 1), spread,
                                    spread.seed + 0x9e3779b97f4a7c15ull * std::uint64_t(draw + 1)),
                       options);
  });
  ChoiceSpread result{0,
                      latest_start,
                      VectorXd::Zero(m),
                      std::vector<int>(std::size_t(m), 0),
                      std::vector<int>(std::size_t(m), 0),
                      0.0};
  for (const SensorChoice& draw_choice : choices) {
    if (draw_choice.status != GreyStatus::Ok) continue;  // from this start row there is no degree
    ++result.draws;
    for (const int input : draw_choice.chosen) result.chosen[input] += 1.0;
    result.same_fraction +=
        in_ascending_order(draw_choice.chosen) == in_ascending_order(choice.chosen);
    const std::vector<int> ranks = degree_ranks(draw_choice.degree);
    for (std::size_t j = 0; j < ranks.size(); ++j) {
      int &best = result.best_rank[j], &worst = result.worst_rank[j];
      if (ranks[j] > 0 && (best == 0 || ranks[j] < best)) best = ranks[j];
      worst = std::max(worst, ranks[j]);
    }
  }
  if (result.draws > 0) {
    result.chosen /= result.draws;
    result.same_fraction /= result.draws;
  }
  return result;
}

std::vector<int> ranking(const VectorXd& degree) {
  std::vector<int> order(static_cast<std::size_t>(degree.size()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, [&](int a, int b) { return degree(a) > degree(b); });
  return order;
}

std::vector<std::vector<int>> random_subsets(int set_size, int size, int count,
                                             std::uint64_t seed) {
  if (size < 0 || size > set_size || count < 0)
    throw std::invalid_argument("a subset cannot be larger than its set");
  std::mt19937_64 random(seed);
  std::vector<std::vector<int>> subsets;
  for (int i = 0; i < count; ++i) {
    std::vector<int> indices(static_cast<std::size_t>(set_size));
    std::iota(indices.begin(), indices.end(), 0);
    for (int k = 0; k < size; ++k) {
      // The remainder differs from uniform by set_size / 2^64, and is the same with every library.
      const auto picked_index =
          k + static_cast<int>(random() % static_cast<std::uint64_t>(set_size - k));
      std::swap(indices[static_cast<std::size_t>(k)],
                indices[static_cast<std::size_t>(picked_index)]);
    }
    indices.resize(static_cast<std::size_t>(size));
    std::ranges::sort(indices);
    subsets.push_back(std::move(indices));
  }
  return subsets;
}

namespace {

/// Returns a percentile of sorted values, linear between neighbours.
double percentile(const std::vector<double>& sorted, double fraction) {
  if (sorted.empty()) return 0.0;
  const double position = fraction * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(position);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (position - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

/// Evaluation of choices of inputs on the training and test data of every error.
struct ChoiceEvaluation {
  std::span<const ThermalData> training;
  std::span<const ThermalData> test;
  Recipe recipe;
  double range = 0.0;  ///< root of the sum of squares of the errors' ranges

  Validation validation(std::size_t error_index, const std::vector<int>& inputs) const {
    return validate_on(select_inputs(training[error_index], inputs),
                       select_inputs(test[error_index], inputs), recipe);
  }
  /// Returns the RMS of all errors over their range; nothing if an error could not be fitted.
  std::optional<double> relative_rms(const std::vector<int>& inputs) const {
    double sum = 0.0;
    for (std::size_t e = 0; e < training.size(); ++e) {
      const Validation result = validation(e, inputs);
      if (result.status != FitStatus::Ok) return std::nullopt;
      sum += result.overall.rms * result.overall.rms;
    }
    return std::sqrt(sum) / range;
  }
};

/// Evaluates random choices of as many sensors as the study has chosen.
RandomChoices random_choices(const ChoiceEvaluation& evaluation, const ThermalStudyOptions& options,
                             const ThermalStudy& study) {
  std::vector<int> usable_inputs;
  for (int j = 0; j < evaluation.training.front().T.cols(); ++j)
    if (!std::ranges::count(study.choice.constant_inputs, j)) usable_inputs.push_back(j);
  const auto subsets = random_subsets(static_cast<int>(usable_inputs.size()),
                                      static_cast<int>(study.choice.chosen.size()),
                                      options.random_subsets, options.seed);
  std::vector<std::optional<double>> rms_values(subsets.size());
  // All subsets are drawn before the parallel loop, so that the result does not depend on the
  // number of threads.
  tbb::parallel_for(std::size_t(0), subsets.size(), [&](std::size_t i) {
    std::vector<int> inputs;
    for (const int k : subsets[i]) inputs.push_back(usable_inputs[static_cast<std::size_t>(k)]);
    rms_values[i] = evaluation.relative_rms(inputs);
  });
  RandomChoices result;
  for (const std::optional<double>& rms : rms_values)
    if (rms)
      result.rms_over_range.push_back(*rms);
    else
      ++result.failed_fit_count;
  std::vector<double>& ratios = result.rms_over_range;
  std::ranges::sort(ratios);
  result.p05 = percentile(ratios, 0.05);
  result.p25 = percentile(ratios, 0.25);
  result.p50 = percentile(ratios, 0.50);
  result.p75 = percentile(ratios, 0.75);
  result.p95 = percentile(ratios, 0.95);
  const auto worse_count =
      std::ranges::count_if(ratios, [&](double ratio) { return ratio > study.rms_over_range; });
  if (!ratios.empty())
    result.fraction_beaten = static_cast<double>(worse_count) / static_cast<double>(ratios.size());
  return result;
}

void check_disjoint_runs(const ThermalData& training, const ThermalData& test) {
  if (training.names != test.names)
    throw std::invalid_argument("training and test data differ in their inputs");
  const std::vector<int> training_runs = runs(training);
  for (const int label : runs(test))
    // A run in both would let the model predict what it was trained on.
    if (std::ranges::count(training_runs, label))
      throw std::invalid_argument("run " + std::to_string(label) +
                                  " is in both the training and the test data");
}

/// Fits a model of one error with the chosen sensors, and evaluates it.
ErrorStudy study_error(const ChoiceEvaluation& evaluation, std::size_t error_index,
                       const std::vector<int>& chosen, const ThermalModelOptions& model) {
  const ThermalData& test = evaluation.test[error_index];
  ErrorStudy study;
  study.drift_range = test.y.maxCoeff() - test.y.minCoeff();
  const ThermalData training_data = with_features(
      select_inputs(evaluation.training[error_index], chosen), evaluation.recipe.features);
  study.fitted = fit(training_data, model);
  if (!study.fitted.model) return study;
  study.training_residual = spread(training_data.y - values(*study.fitted.model, training_data.T));
  if (runs(training_data).size() >= 2) study.left_out = cross_validate(training_data, model);
  study.test = evaluation.validation(error_index, chosen);
  if (study.drift_range > 0) study.rms_over_range = study.test.overall.rms / study.drift_range;
  return study;
}

}  // namespace

ThermalStudy study_sensors(std::span<const ThermalData> training, std::span<const ThermalData> test,
                           const ThermalStudyOptions& options) {
  if (training.empty() || training.size() != test.size())
    throw std::invalid_argument("training and test data differ in their errors");
  for (std::size_t e = 0; e < training.size(); ++e) {
    validate(training[e]);
    validate(test[e]);
    check_disjoint_runs(training[e], test[e]);
  }
  ThermalStudy study;
  // The choice is based on the sensors without lagged copies, which are made of the chosen ones
  // only.
  std::vector<ThermalData> choice_data;
  for (const ThermalData& data_set : training)
    choice_data.push_back(with_features(data_set, {options.features.since_start, 0}));
  study.choice = choose_sensors(choice_data, options.choice);
  if (study.choice.status != GreyStatus::Ok) return study;
  for (const int input : study.choice.chosen)
    study.chosen.push_back(training.front().names[static_cast<std::size_t>(input)]);
  ChoiceEvaluation evaluation{training, test, {options.features, options.model}};
  double squares = 0.0;
  for (std::size_t e = 0; e < training.size(); ++e) {
    study.errors.push_back(study_error(evaluation, e, study.choice.chosen, options.model));
    squares += study.errors.back().drift_range * study.errors.back().drift_range;
  }
  evaluation.range = std::sqrt(squares);
  const auto relative_rms =
      evaluation.range > 0 ? evaluation.relative_rms(study.choice.chosen) : std::nullopt;
  if (!relative_rms) return study;
  study.rms_over_range = *relative_rms;
  study.random = random_choices(evaluation, options, study);
  return study;
}

}  // namespace abbe::errors::identification
