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

/// Models that predict a deviation from temperatures. All kinds have one interface: `fit` returns a
/// model, which `predict` evaluates, `to_text` writes and `parse_thermal_model` reads.
namespace abbe::errors::identification {

enum class ModelKind { Linear, Ridge, Lasso, SupportVectors, KernelRidge, Network };
const char* to_string(ModelKind kind);

/// Options of a thermal model.
struct ThermalModelOptions {
  ModelKind kind = ModelKind::Linear;
  /// Penalty of ridge for inputs scaled to standard deviation 1; for LASSO a fraction of the
  /// smallest penalty for which all coefficients are 0.
  double penalty = 1e-2;
  SupportVectorOptions support;     ///< for inputs and y scaled to standard deviation 1
  KernelRidgeOptions kernel_ridge;  ///< likewise
  NetworkOptions network;           ///< likewise
  int max_rows = 400;           ///< of a learned model: longer data are thinned evenly in every run
  double margin = 0.1;          ///< fraction of an input's trained range by which it may be
                                ///< exceeded, >= 0
  bool sigma_from_runs = true;  ///< leave every run out once to estimate the uncertainty
};

/// Linear law: constant + beta . T.
struct LinearLaw {
  double constant = 0.0;
  Eigen::VectorXd beta;        ///< (m)
  Eigen::MatrixXd covariance;  ///< (m + 1 x m + 1) of [constant, beta] over sigma^2 of a row; empty
                               ///< for ridge and LASSO
};
/// Mean and scale of inputs and output of a learned law.
struct Scaling {
  Eigen::VectorXd mean, scale;  ///< (m), scale 1 for a constant input
  double y_mean = 0.0, y_scale = 1.0;
};
/// Law of support vectors and of kernel ridge.
struct KernelLaw {
  Scaling scaling;
  KernelSum sum;
};
/// Law of a network.
struct NetworkLaw {
  Scaling scaling;
  Network network;
};

/// A fitted model.
struct ThermalModel {
  ModelKind kind = ModelKind::Linear;
  std::vector<std::string> names;   ///< (m) of the inputs
  Eigen::VectorXd lowest, highest;  ///< (m) trained range
  double margin = 0.1;              ///< as in the options
  std::variant<LinearLaw, KernelLaw, NetworkLaw> law;
  double sigma = 0.0;  ///< standard deviation of one reading in a new run: RMS with each
                       ///< run left out
  bool sigma_from_runs =
      false;  ///< false: sigma is that of rows in training runs, which is too low
};

/// Outcome of a fit.
enum class FitStatus { Ok, TooFewRows, RankDeficient, NotConverged };
/// Result of a fit.
struct ThermalFit {
  FitStatus status = FitStatus::Ok;
  std::vector<Dependence> confounded;    ///< if rank deficient
  std::optional<Regression> regression;  ///< diagnostics of kind Linear, if ok
  std::optional<ThermalModel> model;     ///< if ok
};
/// Fits a model. Linear is least squares and requires independent inputs; the other kinds accept
/// any.
/// @throws std::invalid_argument as `validate`, or for an option out of range
[[nodiscard]] ThermalFit fit(const ThermalData& data, const ThermalModelOptions& options = {});

enum class PredictionStatus { Ok, OutsideTrainedRange };
/// Prediction of a deviation.
struct ThermalPrediction {
  PredictionStatus status = PredictionStatus::Ok;
  int input = -1;      ///< index of the input farthest outside relative to its range; -1: none
  double value = 0.0;  ///< unit of y; 0 without a prediction
  double sigma = 0.0;  ///< standard deviation as a forecast of one reading; 0 without a prediction
};
/// Predicts a deviation. Returns the status OutsideTrainedRange if an input lies outside its
/// trained range by more than `margin` of it; an input that was constant in training may not
/// change.
/// @param T  (m)
/// @throws std::invalid_argument for another size or numbers that are not finite
[[nodiscard]] ThermalPrediction predict(const ThermalModel& model, const Eigen::VectorXd& T);

/// Returns the values of the law for each row without a check of the range: for evaluations, not
/// for corrections.
Eigen::VectorXd values(const ThermalModel& model, const Eigen::MatrixXd& T);

/// Returns the model as plain text. The model that `parse_thermal_model` reads from it predicts the
/// same bits.
std::string to_text(const ThermalModel& model);

/// Parses a model.
/// @throws BadInput with the line for anything that `to_text` would not write
ThermalModel parse_thermal_model(std::string_view text, const std::string& file);

/// Residuals on runs that were not used for training. Data are divided by run, never by row at
/// random, because neighbours in time would be on both sides.
struct Validation {
  FitStatus status = FitStatus::Ok;  ///< first outcome of a fit other than Ok; all other members
                                     ///< are then empty
  std::vector<int> run;              ///< labels of the runs left out
  std::vector<Spread> run_spread;    ///< residuals of each of them
  Spread overall;                    ///< RMS over all rows left out, and largest
  int rows = 0;                      ///< number of predicted rows
  int outside = 0;                   ///< number of predicted rows outside the trained range, which
                                     ///< count in the figures
};
/// Predicts each run by a model of all others.
/// @throws std::invalid_argument for fewer than 2 runs, or as `fit`
[[nodiscard]] Validation cross_validate(const ThermalData& data,
                                        const ThermalModelOptions& options);

/// Features and model that are chosen together.
struct Recipe {
  ThermalFeatures features;
  ThermalModelOptions model;
};
/// Returns the residuals of `test` by a model of `training`; both with the recipe's features.
[[nodiscard]] Validation validate_on(const ThermalData& training, const ThermalData& test,
                                     const Recipe& recipe);

}  // namespace abbe::errors::identification
