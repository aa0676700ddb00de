#include "errors/identification/thermal_study.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace abbe::errors::identification {
namespace {

/// The value below which this part of the sorted values lies, linear between neighbours.
double percentile(const std::vector<double>& sorted, double part) {
  if (sorted.empty()) return 0.0;
  const double at = part * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

/// Training and test data of every error and what is done with a choice of their inputs.
struct Trial {
  std::span<const ThermalData> training;
  std::span<const ThermalData> test;
  Recipe recipe;
  double range = 0.0;  ///< root of the sum of the squares of the errors' ranges

  Validation of(std::size_t error, const std::vector<int>& inputs) const {
    return validate_on(only_inputs(training[error], inputs), only_inputs(test[error], inputs),
                       recipe);
  }
  /// RMS over range of all errors; none where one could not be fitted.
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
      ++result.not_fitted;
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
    result.beaten = static_cast<double>(worse) / static_cast<double>(ratios.size());
  return result;
}

void require_apart(const ThermalData& training, const ThermalData& test) {
  if (training.names != test.names)
    throw std::invalid_argument("training and test data differ in their inputs");
  const std::vector<int> seen = runs(training);
  for (const int label : runs(test))
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
      with_features(only_inputs(trial.training[error], chosen), trial.recipe.features);
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
    require_apart(training[e], test[e]);
  }
  ThermalStudy study;
  // Lagged copies are made of the chosen sensors only, so the choice goes by the sensors
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
