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
int rows_outside(const ThermalModel& model, const Eigen::MatrixXd& T);

/// The model as plain text; `thermal_model_of_text` returns one that predicts the same bits.
std::string to_text(const ThermalModel& model);

/// @throws BadInput with the line: anything that `to_text` would not write
ThermalModel thermal_model_of_text(std::string_view text, const std::string& file);

}  // namespace abbe::errors::identification
