// Eighteen days of a real lathe: six temperatures and one displacement, unit and sampling interval
// unstated. The data are not part of the project; these tests skip without them. No figure below
// comes from a day that chose or trained its model; the list of candidates, however, was drawn up
// by people who had looked at all eighteen days.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <numeric>
#include <optional>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/identification/thermal_options.h"

#include "errors/identification/thermal_model.h"
#include "kinematics/text.h"

namespace {

using namespace abbe::errors::identification;
using Eigen::VectorXd;

std::optional<std::filesystem::path> validation_file(const char* name) {
  const char* folder = std::getenv("ABBE_VALIDATION");
  if (!folder) return std::nullopt;
  const std::filesystem::path file = std::filesystem::path(folder) / name;
  return std::filesystem::exists(file) ? std::optional(file) : std::nullopt;
}

std::optional<ThermalData> ace() {
  const auto file = validation_file("ace_thermal.csv");
  if (!file) return std::nullopt;
  return read_thermal_data(abbe::read_text(*file, 10'000'000), "ace_thermal.csv",
                           {"day", "dia_disp", {"sample"}});
}

std::vector<int> days(int first, int last) {
  std::vector<int> result(std::size_t(last - first + 1));
  std::iota(result.begin(), result.end(), first);
  return result;
}

ThermalModelOptions support_vectors(double gamma) {
  ThermalModelOptions options = options_of(ModelKind::SupportVectors);
  options.support.gamma = gamma;
  options.max_rows = 260;
  return options;
}

/// Everything that a choice may take: temperatures as they are or since the start of the day, alone
/// or with a lagged copy, plain, shrunk, chosen or learned.
std::vector<Recipe> recipes() {
  std::vector<Recipe> result;
  for (const bool since_start : {false, true}) {
    result.push_back({{since_start, 0}, options_of(ModelKind::Linear)});
    for (const double lag : {0.0, 80.0}) {
      for (const double penalty : {1e-2, 0.1})
        result.push_back({{since_start, lag}, options_of(ModelKind::Ridge, penalty)});
      result.push_back({{since_start, lag}, options_of(ModelKind::Lasso, 5e-2)});
    }
  }
  for (const double gamma : {0.03, 0.1, 0.3})
    result.push_back({{false, 0}, support_vectors(gamma)});
  return result;
}

std::string name_of(const Recipe& recipe) {
  std::string name = to_string(recipe.model.kind);
  if (recipe.model.kind == ModelKind::Ridge || recipe.model.kind == ModelKind::Lasso)
    name += fmt::format(" {}", recipe.model.penalty);
  if (recipe.model.kind == ModelKind::SupportVectors)
    name += fmt::format(" gamma {}", recipe.model.support.gamma);
  name += recipe.features.since_start ? ", dT since start" : ", T";
  if (recipe.features.lag_rows > 0) name += fmt::format(", lag {} rows", recipe.features.lag_rows);
  return name;
}

void print(const std::string& what, const Validation& v) {
  std::cout << fmt::format(
      "  {:58} rms {:7.3f}  mean of days {:7.3f}  max {:7.2f}  outside {}/{}\n", what,
      v.overall.rms, v.mean_rms, v.overall.max, v.outside, v.rows);
}

/// Kinds as they come, nothing tuned to these data.
std::vector<Recipe> untuned() {
  std::vector<Recipe> result;
  for (const ModelKind kind :
       {ModelKind::Linear, ModelKind::SupportVectors, ModelKind::KernelRidge, ModelKind::Network}) {
    result.push_back({{false, 0}, options_of(kind)});
    result.back().model.max_rows = 260;
  }
  result.push_back({{true, 0}, options_of(ModelKind::Linear)});
  return result;
}

ChoiceOptions quick(Split split = Split::LeaveOneRunOut) {
  ChoiceOptions options;
  options.split = split;
  options.row_stride = 32;
  return options;
}

/// Leave one day out for the untuned kinds, and for a choice nested inside.
NestedValidation table_of_days_left_out(const ThermalData& data) {
  for (const Recipe& recipe : untuned())
    print(name_of(recipe), cross_validate(with_features(data, recipe.features), recipe.model));
  const std::vector<Recipe> all = recipes();
  const NestedValidation nested = nested_validation(data, all, quick());
  print("chosen by the other days, nested", nested.validation);
  std::map<int, int> times;
  for (const int chosen : nested.chosen) ++times[chosen];
  for (const auto& [recipe, count] : times)
    std::cout << "    " << count << " x " << name_of(all[std::size_t(recipe)]) << '\n';
  return nested;
}

/// Days 1-12 choose and train, days 13-18 test: the worse of two ways to choose.
double table_of_later_days(const ThermalData& data) {
  const ThermalData early = select_runs(data, days(1, 12)), late = select_runs(data, days(13, 18));
  for (const Recipe& recipe : untuned()) print(name_of(recipe), validate_on(early, late, recipe));
  const std::vector<Recipe> all = recipes();
  double worse = 0;
  for (const Split split : {Split::LeaveOneRunOut, Split::Forward}) {
    const int best = choose_recipe(early, all, quick(split)).best;
    const Recipe& recipe = all.at(std::size_t(best));
    const Validation v = validate_on(early, late, recipe);
    print((split == Split::Forward ? "chosen forward: " : "chosen leaving out: ") + name_of(recipe),
          v);
    worse = std::max(worse, v.overall.rms);
  }
  return worse;
}

}  // namespace

TEST(Ace, PlainRegressionHasThePublishedCoefficients) {
  const auto data = ace();
  const auto file = validation_file("ace_mlr_expected.csv");
  if (!data || !file) GTEST_SKIP() << "no validation data";
  const auto coefficients = [&](const ThermalData& some) {
    const Regression fit = fit_regression(some.T, some.y);
    std::vector<double> result = {fit.constant};
    result.insert(result.end(), fit.beta.begin(), fit.beta.end());
    return result;
  };
  const std::vector<double> all = coefficients(*data);
  const std::vector<double> early = coefficients(select_runs(*data, days(1, 12)));
  std::size_t of_all = 0, of_early = 0;
  double worst = 0;
  std::ifstream in(*file);
  for (std::string line; std::getline(in, line);) {
    const double expected = std::atof(line.substr(line.rfind(',') + 1).c_str());
    if (line.starts_with("all-days beta"))
      worst = std::max(worst, std::abs(all.at(of_all++) / expected - 1));
    if (line.starts_with("days1-12 beta"))
      worst = std::max(worst, std::abs(early.at(of_early++) / expected - 1));
    if (line.starts_with("all-days RMSE")) {
      EXPECT_NEAR(spread(fit_regression(data->T, data->y).residual).rms, expected, 1e-12);
    }
    if (line.starts_with("days13-18 test RMSE")) {
      const Validation late =
          validate_on(select_runs(*data, days(1, 12)), select_runs(*data, days(13, 18)),
                      {{}, options_of(ModelKind::Linear)});
      EXPECT_NEAR(late.overall.rms, expected, 1e-9);
    }
  }
  ASSERT_EQ(of_all, 7u);
  ASSERT_EQ(of_early, 7u);
  std::cout << "worst coefficient off by " << worst << " of itself\n";
  EXPECT_LT(worst, 1e-10);
}

TEST(Ace, DisplacementAsItIs) {
  const auto data = ace();
  if (!data) GTEST_SKIP() << "no validation data";
  std::cout << "Leave one day out (untouched, about its mean: rms "
            << spread(data->y.array() - data->y.mean()).rms << ")\n";
  const NestedValidation nested = table_of_days_left_out(*data);
  std::cout << "Days 1-12 train, 13-18 test\n";
  const double later = table_of_later_days(*data);
  EXPECT_LT(later, 0.65 * 26.0) << "the plain regression scores 26.0 there";
  EXPECT_LT(nested.validation.overall.rms,
            0.5 * cross_validate(*data, options_of(ModelKind::Linear)).overall.rms);
}

TEST(Ace, ZeroSetEveryMorningIsAnotherProblem) {
  const auto data = ace();
  if (!data) GTEST_SKIP() << "no validation data";
  const ThermalData zero = zeroed_at_start(*data);
  double untouched = 0;
  for (const int day : runs(zero)) untouched += spread(select_runs(zero, {day}).y).rms / 18;
  std::cout << "Leave one day out (untouched: rms " << spread(zero.y).rms << ", mean of days "
            << untouched << ")\n";
  const NestedValidation nested = table_of_days_left_out(zero);
  std::cout << "Days 1-12 train, 13-18 test\n";
  table_of_later_days(zero);
  // The figures to beat, 15.4 -> 8.0, are these: the mean of the days.
  const Validation plain =
      cross_validate(with_features(zero, {true, 0}), options_of(ModelKind::Linear));
  EXPECT_NEAR(untouched, 15.4391, 1e-4);
  EXPECT_NEAR(plain.mean_rms, 7.9754, 1e-4);
  std::cout << fmt::format("Reduction of the mean of days: plain {:.1f} %, chosen {:.1f} %\n",
                           100 * (1 - plain.mean_rms / untouched),
                           100 * (1 - nested.validation.mean_rms / untouched));
  EXPECT_LT(nested.validation.mean_rms, 0.7 * plain.mean_rms);
}
