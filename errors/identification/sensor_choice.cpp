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

namespace abbe::errors::identification {

namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void validate_series(const MatrixXd& series, const GreyOptions& options) {
  require(series.rows() >= 2, "a grey degree needs two instants or more");
  require(series.cols() >= 1, "a grey degree needs a series");
  require(series.allFinite(), "a grey degree needs finite numbers");
  require(options.rho > 0 && options.rho <= 1, "rho of a grey degree lies in (0, 1]");
  require(options.theta >= 0 && options.theta <= 1, "theta of a grey degree lies in [0, 1]");
}

struct Images {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;
  MatrixXd image;
};

/// Returns every column divided, or shifted and divided, according to the image.
Images images(const MatrixXd& series, Image image) {
  Images result;
  result.image = series;
  for (int i = 0; i < series.cols() && result.status == GreyStatus::Ok; ++i) {
    auto x = result.image.col(i);
    double divisor = 1.0;
    if (image == Image::Initial) {
      divisor = x(0);
      if (divisor == 0) result.status = GreyStatus::StartsAtZero;
    } else if (image == Image::Mean) {
      divisor = x.mean();
      if (divisor == 0) result.status = GreyStatus::MeanIsZero;
    } else if (image == Image::Interval) {
      divisor = x.maxCoeff() - x.minCoeff();
      if (divisor == 0) result.status = GreyStatus::StandsStill;
      x.array() -= x.minCoeff();
    }
    if (result.status == GreyStatus::Ok)
      x /= divisor;
    else
      result.series = i;
  }
  return result;
}

/// Returns |s| of each column: the area between the series and its initial value.
VectorXd areas(const MatrixXd& series) {
  const auto n = series.rows();
  const MatrixXd from_start = series.rowwise() - series.row(0);
  return (from_start.middleRows(1, n - 2).colwise().sum() + 0.5 * from_start.row(n - 1))
      .transpose();
}

double liu_degree(double s0, double si) {
  const double sum = 1.0 + std::abs(s0) + std::abs(si);
  return sum / (sum + std::abs(si - s0));
}

/// Returns Liu's degree of every pair of areas.
MatrixXd liu_matrix(const VectorXd& s) {
  return MatrixXd::NullaryExpr(s.size(), s.size(),
                               [&](auto i, auto j) { return liu_degree(s(i), s(j)); });
}

double mean_grade(const ArrayXd& difference, double least, double most, double rho) {
  if (most == 0) return 1.0;
  return ((least + rho * most) / (difference + rho * most)).mean();
}

/// Returns Liu's degrees of all pairs, of the requested kind.
MutualDegrees liu_degrees(const MatrixXd& series, const GreyOptions& options) {
  MutualDegrees result;
  const bool absolute = options.kind != GreyKind::Relative;
  const bool relative = options.kind != GreyKind::Absolute;
  const double theta = !relative ? 1.0 : !absolute ? 0.0 : options.theta;
  result.degree.setZero(series.cols(), series.cols());
  if (absolute) result.degree += theta * liu_matrix(areas(series));
  if (relative) {
    const Images initial = images(series, Image::Initial);
    if (initial.status != GreyStatus::Ok) return {initial.status, initial.series, {}};
    result.degree += (1 - theta) * liu_matrix(areas(initial.image));
  }
  return result;
}

}  // namespace

GreyDegrees grey_degrees(const VectorXd& reference, const MatrixXd& series,
                         const GreyOptions& options) {
  require(reference.size() == series.rows(),
          "reference and series of a grey degree differ in length");
  const auto m = series.cols();
  MatrixXd all(series.rows(), m + 1);
  all << reference, series;
  validate_series(all, options);
  require(m >= 1, "a grey degree needs a series");
  if (options.kind != GreyKind::Deng) {
    const MutualDegrees mutual = liu_degrees(all, options);
    if (mutual.status != GreyStatus::Ok) return {mutual.status, mutual.series - 1, {}};
    return {GreyStatus::Ok, -1, mutual.degree.col(0).tail(m)};
  }
  const Images made = images(all, options.image);
  if (made.status != GreyStatus::Ok) return {made.status, made.series - 1, {}};
  const MatrixXd difference = (made.image.rightCols(m).colwise() - made.image.col(0)).cwiseAbs();
  const double least = difference.minCoeff(), most = difference.maxCoeff();
  GreyDegrees result{GreyStatus::Ok, -1, VectorXd(m)};
  for (int i = 0; i < m; ++i)
    result.degree(i) = mean_grade(difference.col(i).array(), least, most, options.rho);
  return result;
}

MutualDegrees mutual_degrees(const MatrixXd& series, const GreyOptions& options) {
  validate_series(series, options);
  if (options.kind != GreyKind::Deng) return liu_degrees(series, options);
  const Images made = images(series, options.image);
  if (made.status != GreyStatus::Ok) return {made.status, made.series, {}};
  const auto m = series.cols();
  double most = 0;
  for (int i = 0; i < m; ++i)
    most = std::max(most, (made.image.colwise() - made.image.col(i)).cwiseAbs().maxCoeff());
  MutualDegrees result{GreyStatus::Ok, -1, MatrixXd::Identity(m, m)};
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < i; ++j) {
      const ArrayXd difference = (made.image.col(i) - made.image.col(j)).cwiseAbs().array();
      result.degree(i, j) = result.degree(j, i) = mean_grade(difference, 0, most, options.rho);
    }
  return result;
}

const char* to_string(GreyStatus status) {
  switch (status) {
    case GreyStatus::Ok:
      return "ok";
    case GreyStatus::StartsAtZero:
      return "a series that starts at zero has no initial image";
    case GreyStatus::MeanIsZero:
      return "a series of mean zero has no mean image";
    case GreyStatus::StandsStill:
      return "a series that stands still has no interval image";
  }
  return "";
}

namespace {

using Eigen::Index;

/// Returns the columns with mean 0 and length 1; zero for a constant one.
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

/// Degrees of the selected inputs; the other entries are 0.
struct Degrees {
  GreyStatus status = GreyStatus::Ok;
  int input = -1;
  VectorXd with_error;  ///< the highest with any error
  MatrixXd mutual;
  std::vector<std::optional<int>> first_row = {};  ///< (errors)
};

Degrees correlation_degrees(std::span<const ThermalData> errors) {
  Degrees result{GreyStatus::Ok, -1, correlations(errors.front()),
                 mutual_correlations(errors.front())};
  for (const ThermalData& error : errors)
    result.with_error = result.with_error.cwiseMax(correlations(error));
  return result;
}

/// Returns the first row at which neither the error nor an input is too close to zero as a divisor.
std::optional<int> first_row(const ThermalData& error, const std::vector<int>& inputs,
                             double min_start) {
  for (Index k = 0; k + 1 < error.y.size(); ++k)
    if (std::abs(error.y(k)) > min_start && (error.T(k, inputs).array() != 0.0).all())
      return int(k);
  return std::nullopt;
}

/// Returns the inputs of one error as required by its degree.
MatrixXd series_of(const ThermalData& error, const std::vector<int>& inputs,
                   const GreyOptions& options) {
  MatrixXd series = error.T(Eigen::all, inputs);
  // The interval image maps rising and falling series to opposite shapes, so a sensor that falls
  // while the error rises is inverted first.
  if (options.kind == GreyKind::Deng && options.image == Image::Interval)
    for (Index j = 0; j < series.cols(); ++j)
      if ((series.col(j).array() - series.col(j).mean()).matrix().dot(error.y) < 0)
        series.col(j) *= -1;
  return series;
}

Degrees grey_relational_degrees(std::span<const ThermalData> errors, const std::vector<int>& inputs,
                                const SensorChoiceOptions& options) {
  const Index m = errors.front().T.cols();
  const auto input_of = [&](int series) {
    return series < 0 ? -1 : inputs[static_cast<std::size_t>(series)];
  };
  Degrees result{GreyStatus::StartsAtZero, -1, VectorXd::Zero(m), MatrixXd::Zero(m, m)};
  for (std::size_t e = 0; e < errors.size(); ++e) {
    const ThermalData& error = errors[e];
    std::optional<int> first = 0;
    if (is_divided_by_start(options))
      first = first_row(error, inputs, options.min_start.empty() ? 0.0 : options.min_start[e]);
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

/// Returns the lowest mutual degree that, as a threshold, gives at least `wanted` groups.
double threshold_for(const std::vector<int>& by_degree, const MatrixXd& mutual,
                     std::size_t wanted) {
  std::set<double> candidates;
  for (const int i : by_degree)
    for (const int j : by_degree)
      if (i != j) candidates.insert(mutual(i, j));
  for (const double threshold : candidates)
    if (group_sensors(by_degree, mutual, threshold).size() >= wanted) return threshold;
  return 1.0 + 1e-9;  // every sensor is its own group
}

/// Returns the mean squared residual of regressions on these inputs over all errors; infinite if
/// one is not possible.
double regression_residual(std::span<const ThermalData> errors, const std::vector<int>& inputs) {
  ThermalModelOptions options;
  options.sigma_from_runs = false;
  double sum = 0.0;
  for (const ThermalData& error : errors) {
    const ThermalData some = select_inputs(error, inputs);
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

std::vector<int> screen_by_regression(std::span<const ThermalData> errors, std::vector<int> leaders,
                                      std::size_t count) {
  std::vector<int> chosen;
  // Greedy forward selection: trying all subsets would need a fit for each.
  while (chosen.size() < count && !leaders.empty()) {
    std::vector<double> left;
    for (const int leader : leaders) {
      std::vector<int> with = chosen;
      with.push_back(leader);
      left.push_back(regression_residual(errors, with));
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
  if (!options.min_start.empty() && options.min_start.size() != errors.size())
    throw std::invalid_argument("a choice of sensors needs a least start for every error");
}

}  // namespace

bool is_divided_by_start(const SensorChoiceOptions& options) {
  if (options.similarity_measure == SimilarityMeasure::Correlation || !options.fixed.empty())
    return false;
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
  Degrees degrees = options.similarity_measure == SimilarityMeasure::Correlation
                        ? correlation_degrees(errors)
                        : grey_relational_degrees(errors, inputs, options);
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
  choice.groups = group_sensors(by_degree, choice.mutual, choice.threshold);

  std::vector<int> leaders;
  for (const std::vector<int>& group : choice.groups) leaders.push_back(group.front());
  const auto count = std::min(static_cast<std::size_t>(options.count), leaders.size());
  if (options.screening == Screening::Regression)
    choice.chosen = screen_by_regression(errors, leaders, count);
  else
    choice.chosen.assign(leaders.begin(), leaders.begin() + static_cast<std::ptrdiff_t>(count));
  return choice;
}

namespace {

/// Returns the rows from `start` on with additional noise.
std::vector<ThermalData> redraw_noise(std::span<const ThermalData> errors, Index start,
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

/// Returns the ranks of the degrees, from 1; 0 for inputs without a degree.
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
    // Start rows in turn, so that all occur even in a few draws.
    choices[std::size_t(draw)] =
        choose_sensors(redraw_noise(errors, draw % (last + 1), spread,
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
      // The remainder differs from uniform by below / 2^64, and is the same with every library.
      const auto pick = k + static_cast<int>(random() % static_cast<std::uint64_t>(below - k));
      std::swap(all[static_cast<std::size_t>(k)], all[static_cast<std::size_t>(pick)]);
    }
    all.resize(static_cast<std::size_t>(size));
    std::ranges::sort(all);
    subsets.push_back(std::move(all));
  }
  return subsets;
}

namespace {

/// Returns a percentile of sorted values, linear between neighbours.
double percentile(const std::vector<double>& sorted, double part) {
  if (sorted.empty()) return 0.0;
  const double at = part * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

/// Training and test data of every error, and the evaluation of a choice of inputs.
struct Trial {
  std::span<const ThermalData> training;
  std::span<const ThermalData> test;
  Recipe recipe;
  double range = 0.0;  ///< root of the sum of squares of the errors' ranges

  Validation of(std::size_t error, const std::vector<int>& inputs) const {
    return validate_on(select_inputs(training[error], inputs), select_inputs(test[error], inputs),
                       recipe);
  }
  /// Returns the RMS over the range of all errors; empty if one could not be fitted.
  std::optional<double> graded(const std::vector<int>& inputs) const {
    double sum = 0.0;
    for (std::size_t e = 0; e < training.size(); ++e) {
      const Validation validation = of(e, inputs);
      if (validation.status != FitStatus::Ok) return std::nullopt;
      sum += validation.overall.rms * validation.overall.rms;
    }
    return std::sqrt(sum) / range;
  }
};

RandomChoices random_choices(const Trial& trial, const ThermalStudyOptions& options,
                             const ThermalStudy& study) {
  std::vector<int> usable;
  for (int j = 0; j < trial.training.front().T.cols(); ++j)
    if (!std::ranges::count(study.choice.still, j)) usable.push_back(j);
  const auto subsets =
      random_subsets(static_cast<int>(usable.size()), static_cast<int>(study.choice.chosen.size()),
                     options.random_subsets, options.seed);
  std::vector<std::optional<double>> grades(subsets.size());
  // Subsets are drawn before, so that the result does not depend on the number of threads.
  tbb::parallel_for(std::size_t(0), subsets.size(), [&](std::size_t i) {
    std::vector<int> inputs;
    for (const int k : subsets[i]) inputs.push_back(usable[static_cast<std::size_t>(k)]);
    grades[i] = trial.graded(inputs);
  });
  RandomChoices result;
  for (const std::optional<double>& grade : grades)
    if (grade)
      result.rms_over_range.push_back(*grade);
    else
      ++result.unfitted_count;
  std::vector<double>& ratios = result.rms_over_range;
  std::ranges::sort(ratios);
  result.p05 = percentile(ratios, 0.05);
  result.p25 = percentile(ratios, 0.25);
  result.p50 = percentile(ratios, 0.50);
  result.p75 = percentile(ratios, 0.75);
  result.p95 = percentile(ratios, 0.95);
  const auto worse =
      std::ranges::count_if(ratios, [&](double ratio) { return ratio > study.rms_over_range; });
  if (!ratios.empty())
    result.fraction_beaten = static_cast<double>(worse) / static_cast<double>(ratios.size());
  return result;
}

void check_disjoint_runs(const ThermalData& training, const ThermalData& test) {
  if (training.names != test.names)
    throw std::invalid_argument("training and test data differ in their inputs");
  const std::vector<int> seen = runs(training);
  for (const int label : runs(test))
    // A run in both would let the model predict what it was trained on.
    if (std::ranges::count(seen, label))
      throw std::invalid_argument("run " + std::to_string(label) +
                                  " stands in the training and in the test data");
}

ErrorStudy study_error(const Trial& trial, std::size_t error, const std::vector<int>& chosen,
                       const ThermalModelOptions& model) {
  const ThermalData& test = trial.test[error];
  ErrorStudy study;
  study.drift_range = test.y.maxCoeff() - test.y.minCoeff();
  const ThermalData seen =
      with_features(select_inputs(trial.training[error], chosen), trial.recipe.features);
  study.fitted = fit(seen, model);
  if (!study.fitted.model) return study;
  study.in_cycle = spread(seen.y - values(*study.fitted.model, seen.T));
  if (runs(seen).size() >= 2) study.left_out = cross_validate(seen, model);
  study.test = trial.of(error, chosen);
  if (study.drift_range > 0) study.rms_over_range = study.test.overall.rms / study.drift_range;
  return study;
}

}  // namespace

ThermalStudy study_sensors(const ThermalData& training, const ThermalData& test,
                           const ThermalStudyOptions& options) {
  return study_sensors(std::span(&training, 1), std::span(&test, 1), options);
}

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
  // Lagged copies are made of the chosen sensors only, so the choice is based on the sensors
  // themselves.
  std::vector<ThermalData> featured;
  for (const ThermalData& error : training)
    featured.push_back(with_features(error, {options.features.since_start, 0}));
  study.choice = choose_sensors(featured, options.choice);
  if (study.choice.status != GreyStatus::Ok) return study;
  for (const int input : study.choice.chosen)
    study.chosen.push_back(training.front().names[static_cast<std::size_t>(input)]);
  Trial trial{training, test, {options.features, options.model}};
  double squares = 0.0;
  for (std::size_t e = 0; e < training.size(); ++e) {
    study.errors.push_back(study_error(trial, e, study.choice.chosen, options.model));
    squares += study.errors.back().drift_range * study.errors.back().drift_range;
  }
  trial.range = std::sqrt(squares);
  const auto graded = trial.range > 0 ? trial.graded(study.choice.chosen) : std::nullopt;
  if (!graded) return study;
  study.rms_over_range = *graded;
  study.random = random_choices(trial, options, study);
  return study;
}

}  // namespace abbe::errors::identification
