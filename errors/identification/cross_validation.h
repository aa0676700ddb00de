#pragma once

#include <vector>

#include "errors/identification/features.h"
#include "errors/identification/thermal_model.h"

/// How well a model does on runs it never saw. Data are parted by run; there is no splitting of
/// rows at random, because neighbours in time would be on both sides.
namespace abbe::errors::identification {

enum class Split {
  LeaveOneRunOut,  ///< each run predicted by a model of all others
  Forward,  ///< the first k runs predict all later ones, for every k from half of them on: how
            ///< a model ages. Each k counts alike
};
struct Validation {
  FitStatus status =
      FitStatus::Ok;           ///< the first outcome of a fit that was not ok; then no figures
  std::vector<int> run;        ///< labels; of Forward: the last run trained on
  std::vector<Spread> of_run;  ///< residuals there
  Spread overall;              ///< RMS over all rows left out (Forward: over all k), and largest
  double mean_rms = 0.0;       ///< mean of the RMS of the runs
  int rows = 0;                ///< predicted
  int outside = 0;             ///< of these, rows that the model would refuse; graded all the same
};
/// @throws std::invalid_argument for fewer than 2 runs, or as `fit`
[[nodiscard]] Validation cross_validate(const ThermalData& data, const ThermalModelOptions& options,
                                        Split split = Split::LeaveOneRunOut);

/// Features and model together, as one thing to choose.
struct Recipe {
  ThermalFeatures features;
  ThermalModelOptions model;
};
/// Residuals of `test` by a model of `training`; both with the recipe's features.
[[nodiscard]] Validation validate_on(const ThermalData& training, const ThermalData& test,
                                     const Recipe& recipe);

struct RecipeChoice {
  int best = -1;                       ///< least overall RMS; -1 if none could be fitted
  std::vector<Validation> validation;  ///< one for each recipe
};
/// Chooses within these data only. Lags count in rows of `data`; the fits then take every k-th row,
/// which loses little, as neighbours are alike.
struct ChoiceOptions {
  Split split = Split::LeaveOneRunOut;
  int every = 1;
};
[[nodiscard]] RecipeChoice choose_recipe(const ThermalData& data,
                                         const std::vector<Recipe>& recipes,
                                         const ChoiceOptions& options = {});

/// Each run predicted by the recipe that the other runs chose among themselves: an honest figure
/// for choosing and fitting together.
struct NestedValidation {
  Validation validation;
  std::vector<int> chosen;  ///< recipe for each run, -1 where none could be fitted
};
/// Runs go through TBB; the result does not depend on the number of threads.
[[nodiscard]] NestedValidation nested_validation(const ThermalData& data,
                                                 const std::vector<Recipe>& recipes,
                                                 const ChoiceOptions& options = {});

}  // namespace abbe::errors::identification
