#include "errors/identification/cross_validation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace abbe::errors::identification {
namespace {

using Eigen::VectorXd;

/// Residuals of one part that was left out, and what to call it.
struct Part {
  int run = 0;
  FitStatus status = FitStatus::Ok;
  VectorXd residual;
  int outside = 0;
};

Part graded(const ThermalFit& fitted, const ThermalData& test, int run) {
  if (!fitted.model) return {run, fitted.status, {}, 0};
  return {run, FitStatus::Ok, test.y - values(*fitted.model, test.T),
          rows_outside(*fitted.model, test.T)};
}

Part left_out(const ThermalData& training, const ThermalData& test, ThermalModelOptions options,
              int run) {
  options.sigma_from_runs = false;
  return graded(fit(training, options), test, run);
}

/// @param alike  every part counts alike, not every row
Validation summary(const std::vector<Part>& parts, bool alike) {
  Validation result;
  double squares = 0, weight = 0, sum_rms = 0;
  for (const Part& part : parts) {
    if (part.status != FitStatus::Ok) {
      result = {};
      result.status = part.status;
      return result;
    }
    const Spread s = spread(part.residual);
    const double w = alike ? 1.0 : static_cast<double>(part.residual.size());
    squares += w * s.rms * s.rms;
    weight += w;
    sum_rms += s.rms;
    result.run.push_back(part.run);
    result.of_run.push_back(s);
    result.overall.max = std::max(result.overall.max, s.max);
    result.rows += static_cast<int>(part.residual.size());
    result.outside += part.outside;
  }
  result.overall.rms = std::sqrt(squares / weight);
  result.mean_rms = sum_rms / static_cast<double>(parts.size());
  return result;
}

}  // namespace

Validation cross_validate(const ThermalData& data, const ThermalModelOptions& options,
                          Split split) {
  const std::vector<int> labels = runs(data);
  if (labels.size() < 2) throw std::invalid_argument("cross-validation by run needs two runs");
  std::vector<Part> parts;
  if (split == Split::LeaveOneRunOut) {
    for (const int label : labels)
      parts.push_back(left_out(without_run(data, label), only_runs(data, {label}), options, label));
  } else {
    for (std::size_t k = (labels.size() + 1) / 2; k < labels.size(); ++k) {
      const auto cut = labels.begin() + static_cast<std::ptrdiff_t>(k);
      parts.push_back(left_out(only_runs(data, {labels.begin(), cut}),
                               only_runs(data, {cut, labels.end()}), options, labels[k - 1]));
    }
  }
  return summary(parts, split == Split::Forward);
}

Validation validate_on(const ThermalData& training, const ThermalData& test, const Recipe& recipe) {
  validate(test);
  const ThermalData seen = with_features(training, recipe.features);
  const ThermalData unseen = with_features(test, recipe.features);
  if (seen.names != unseen.names)
    throw std::invalid_argument("training and test data differ in their inputs");
  ThermalModelOptions options = recipe.model;
  options.sigma_from_runs = false;
  const ThermalFit fitted = fit(seen, options);
  std::vector<Part> parts;
  for (const int label : runs(unseen))
    parts.push_back(graded(fitted, only_runs(unseen, {label}), label));
  return summary(parts, false);
}

RecipeChoice choose_recipe(const ThermalData& data, const std::vector<Recipe>& recipes,
                           const ChoiceOptions& options) {
  RecipeChoice choice;
  for (const Recipe& recipe : recipes) {
    const ThermalData made = thinned(with_features(data, recipe.features), options.every);
    choice.validation.push_back(cross_validate(made, recipe.model, options.split));
    const Validation& last = choice.validation.back();
    if (last.status != FitStatus::Ok) continue;
    const bool better =
        choice.best < 0 ||
        last.overall.rms < choice.validation[static_cast<std::size_t>(choice.best)].overall.rms;
    if (better) choice.best = static_cast<int>(choice.validation.size()) - 1;
  }
  return choice;
}

NestedValidation nested_validation(const ThermalData& data, const std::vector<Recipe>& recipes,
                                   const ChoiceOptions& options) {
  const std::vector<int> labels = runs(data);
  if (labels.size() < 3) throw std::invalid_argument("nested validation by run needs three runs");
  std::vector<Part> parts(labels.size());
  std::vector<int> chosen(labels.size(), -1);
  tbb::parallel_for(std::size_t(0), labels.size(), [&](std::size_t i) {
    const ThermalData others = without_run(data, labels[i]);
    chosen[i] = choose_recipe(others, recipes, options).best;
    parts[i].run = labels[i];
    parts[i].status = FitStatus::NotConverged;
    if (chosen[i] < 0) return;
    const Recipe& recipe = recipes[static_cast<std::size_t>(chosen[i])];
    parts[i] = left_out(with_features(others, recipe.features),
                        with_features(only_runs(data, {labels[i]}), recipe.features), recipe.model,
                        labels[i]);
  });
  return {summary(parts, false), chosen};
}

}  // namespace abbe::errors::identification
