#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/learned.h"
#include "errors/identification/regression.h"
#include "errors/identification/thermal_data.h"

/// One interface over every model that predicts a deviation from temperatures:
/// kind and options -> fit(data) -> model -> predict, to_text, thermal_model_of_text.
namespace abbe::errors::identification {

enum class ModelKind { Linear, Ridge, Lasso, SupportVectors, KernelRidge, Network };
const char* to_string(ModelKind kind);

struct ThermalModelOptions {
  ModelKind kind = ModelKind::Linear;
  /// Of ridge, inputs scaled to standard deviation 1; of LASSO as a part of the smallest penalty
  /// that leaves no coefficient.
  double penalty = 1e-2;
  SupportVectorOptions support;     ///< for inputs and y scaled to standard deviation 1
  KernelRidgeOptions kernel_ridge;  ///< likewise
  NetworkOptions network;           ///< likewise
  int most_rows = 400;          ///< of a learned model: longer data are thinned evenly, run by run
  double margin = 0.1;          ///< part of an input's trained range that may be left, >= 0
  bool sigma_from_runs = true;  ///< leave every run out once, to know the uncertainty
};

/// constant + beta . T
struct LinearLaw {
  double constant = 0.0;
  Eigen::VectorXd beta;        ///< (m)
  Eigen::MatrixXd covariance;  ///< (m + 1 x m + 1) of [constant, beta] over sigma^2 of a row; empty
                               ///< for ridge and LASSO
};
/// mean and scale of inputs and output around a learned law
struct Scaling {
  Eigen::VectorXd mean, scale;  ///< (m), scale 1 for an input that stands still
  double y_mean = 0.0, y_scale = 1.0;
};
struct KernelLaw {
  Scaling scaling;
  KernelSum sum;
};
struct NetworkLaw {
  Scaling scaling;
  Network network;
};

struct ThermalModel {
  ModelKind kind = ModelKind::Linear;
  std::vector<std::string> names;   ///< (m) of the inputs
  Eigen::VectorXd lowest, highest;  ///< (m) trained range
  double margin = 0.1;
  std::variant<LinearLaw, KernelLaw, NetworkLaw> law;
  double sigma = 0.0;            ///< of one reading in a run never seen: RMS with each run left out
  bool sigma_from_runs = false;  ///< false: of rows in runs that were seen, which flatters
};

enum class FitStatus { Ok, TooFewRows, RankDeficient, NotConverged };
struct ThermalFit {
  FitStatus status = FitStatus::Ok;
  std::vector<Dependence> confounded;    ///< where rank deficient
  std::optional<Regression> regression;  ///< diagnostics of kind Linear, where ok
  std::optional<ThermalModel> model;     ///< where ok
};
/// Linear is least squares and needs independent inputs; the other kinds take any.
/// @throws std::invalid_argument as `validate`, or for an option out of range
[[nodiscard]] ThermalFit fit(const ThermalData& data, const ThermalModelOptions& options = {});

enum class PredictionStatus { Ok, OutsideTrainedRange };
struct ThermalPrediction {
  PredictionStatus status = PredictionStatus::Ok;
  int input = -1;      ///< outside: the input that is farthest out for its range, `names[input]`
  double value = 0.0;  ///< unit of y; 0 where nothing is predicted
  double sigma = 0.0;  ///< of the value as a forecast of one reading; 0 where nothing is predicted
};
/// Refuses, as a status, an input farther than `margin` of its trained range beyond that range (one
/// that stood still in training may not move).
/// @param T  (m)
/// @throws std::invalid_argument for another size or numbers that are not finite
[[nodiscard]] ThermalPrediction predict(const ThermalModel& model, const Eigen::VectorXd& T);

/// What the law says of each row, inside the range or not: for grading models, not for correcting.
Eigen::VectorXd values(const ThermalModel& model, const Eigen::MatrixXd& T);

/// Rows that `predict` refuses.
int count_rows_outside(const ThermalModel& model, const Eigen::MatrixXd& T);

/// The model as plain text; `parse_thermal_model` returns one that predicts the same bits.
std::string to_text(const ThermalModel& model);

/// @throws BadInput with the line: anything that `to_text` would not write
ThermalModel parse_thermal_model(std::string_view text, const std::string& file);

// How well a model does on runs it never saw. Data are parted by run; there is no splitting of
// rows at random, because neighbours in time would be on both sides.

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
