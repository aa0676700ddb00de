#include "errors/identification/thermal_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "errors/identification/cross_validation.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double finite_sd(const VectorXd& centred) {
  const double sd = std::sqrt(centred.squaredNorm() / static_cast<double>(centred.size()));
  return sd > 0 ? sd : 1.0;
}

Scaling scaling_of(const ThermalData& data) {
  Scaling s{data.T.colwise().mean(), VectorXd(data.T.cols()), data.y.mean(), 1.0};
  for (Index j = 0; j < data.T.cols(); ++j)
    s.scale(j) = finite_sd(data.T.col(j).array() - s.mean(j));
  s.y_scale = finite_sd(data.y.array() - s.y_mean);
  return s;
}

MatrixXd scaled(const Scaling& s, const MatrixXd& T) {
  return (T.rowwise() - s.mean.transpose()).array().rowwise() / s.scale.transpose().array();
}

/// Every k-th row, so that no more than `most` are left (one a run at least).
ThermalData at_most(const ThermalData& data, int most) {
  const auto n = static_cast<int>(data.y.size());
  return n <= most ? data : thinned(data, (n + most - 1) / most);
}

ThermalFit fit_linear(const ThermalData& data, ThermalModel model) {
  ThermalFit result;
  Regression regression = fit_regression(data.T, data.y);
  result.confounded = regression.confounded;
  if (regression.status == RegressionStatus::TooFewRows) result.status = FitStatus::TooFewRows;
  if (regression.status == RegressionStatus::RankDeficient)
    result.status = FitStatus::RankDeficient;
  if (result.status != FitStatus::Ok) return result;
  const double variance = regression.residual_sd * regression.residual_sd;
  model.law = LinearLaw{regression.constant, regression.beta,
                        variance > 0 ? MatrixXd(regression.covariance / variance)
                                     : MatrixXd::Zero(data.T.cols() + 1, data.T.cols() + 1)};
  model.sigma = regression.residual_sd;
  result.regression = std::move(regression);
  result.model = std::move(model);
  return result;
}

ThermalFit fit_shrunk(const ThermalData& data, const ThermalModelOptions& options,
                      ThermalModel model) {
  const Shrunk shrunk =
      options.kind == ModelKind::Ridge
          ? fit_ridge(data.T, data.y, options.penalty)
          : fit_lasso(data.T, data.y, options.penalty * most_penalty(data.T, data.y));
  ThermalFit result;
  if (!shrunk.converged) {
    result.status = FitStatus::NotConverged;
    return result;
  }
  model.law = LinearLaw{shrunk.constant, shrunk.beta, {}};
  result.model = std::move(model);
  return result;
}

ThermalFit fit_learned(const ThermalData& all, const ThermalModelOptions& options,
                       ThermalModel model) {
  const ThermalData data = at_most(all, options.most_rows);
  const Scaling s = scaling_of(data);
  const MatrixXd Z = scaled(s, data.T);
  const VectorXd y = (data.y.array() - s.y_mean) / s.y_scale;
  if (options.kind == ModelKind::SupportVectors)
    model.law = KernelLaw{s, fit_support_vectors(Z, y, options.support)};
  else if (options.kind == ModelKind::KernelRidge)
    model.law = KernelLaw{s, fit_kernel_ridge(Z, y, options.kernel_ridge)};
  else
    model.law = NetworkLaw{s, fit_network(Z, y, options.network)};
  ThermalFit result;
  result.model = std::move(model);
  return result;
}

/// How far beyond the range, as a part of it; infinite if the input stood still and now does not.
double beyond(const ThermalModel& model, Index input, double T) {
  const double out = std::max({model.lowest(input) - T, T - model.highest(input), 0.0});
  return out == 0 ? 0.0 : out / (model.highest(input) - model.lowest(input));
}

double value_of(const LinearLaw& law, const VectorXd& T) { return law.constant + law.beta.dot(T); }
double value_of(const KernelLaw& law, const VectorXd& T) {
  return law.scaling.y_mean +
         law.scaling.y_scale *
             value(law.sum, (T - law.scaling.mean).cwiseQuotient(law.scaling.scale));
}
double value_of(const NetworkLaw& law, const VectorXd& T) {
  return law.scaling.y_mean +
         law.scaling.y_scale *
             value(law.network, (T - law.scaling.mean).cwiseQuotient(law.scaling.scale));
}
double value_of(const ThermalModel& model, const VectorXd& T) {
  return std::visit([&](const auto& law) { return value_of(law, T); }, model.law);
}

/// What the uncertainty of the coefficients adds, as variance over that of a reading.
double leverage(const ThermalModel& model, const VectorXd& T) {
  const auto* law = std::get_if<LinearLaw>(&model.law);
  if (!law || law->covariance.size() == 0) return 0.0;
  VectorXd x(T.size() + 1);
  x << 1, T;
  return std::max(x.dot(law->covariance * x), 0.0);
}

}  // namespace

const char* to_string(ModelKind kind) {
  switch (kind) {
    case ModelKind::Linear:
      return "linear";
    case ModelKind::Ridge:
      return "ridge";
    case ModelKind::Lasso:
      return "lasso";
    case ModelKind::SupportVectors:
      return "support_vectors";
    case ModelKind::KernelRidge:
      return "kernel_ridge";
    case ModelKind::Network:
      return "network";
  }
  return "";
}

ThermalFit fit(const ThermalData& data, const ThermalModelOptions& options) {
  validate(data);
  if (!(options.margin >= 0) || !std::isfinite(options.margin) || options.most_rows < 1)
    throw std::invalid_argument("an option of a thermal model is out of range");
  ThermalModel model;
  model.kind = options.kind;
  model.names = data.names;
  model.lowest = data.T.colwise().minCoeff();
  model.highest = data.T.colwise().maxCoeff();
  model.margin = options.margin;
  const bool shrunk = options.kind == ModelKind::Ridge || options.kind == ModelKind::Lasso;
  ThermalFit result = options.kind == ModelKind::Linear ? fit_linear(data, std::move(model))
                      : shrunk ? fit_shrunk(data, options, std::move(model))
                               : fit_learned(data, options, std::move(model));
  if (!result.model) return result;
  if (options.kind != ModelKind::Linear)
    result.model->sigma = spread(data.y - values(*result.model, data.T)).rms;
  if (options.sigma_from_runs && runs(data).size() >= 2) {
    const Validation left_out = cross_validate(data, options);
    result.model->sigma_from_runs = left_out.status == FitStatus::Ok;
    if (result.model->sigma_from_runs) result.model->sigma = left_out.overall.rms;
  }
  return result;
}

ThermalPrediction predict(const ThermalModel& model, const VectorXd& T) {
  if (T.size() != model.lowest.size() || !T.allFinite())
    throw std::invalid_argument("a prediction needs as many finite inputs as were trained");
  ThermalPrediction result;
  double farthest = model.margin;
  for (Index i = 0; i < T.size(); ++i)
    if (const double out = beyond(model, i, T(i)); out > farthest) {
      result.status = PredictionStatus::OutsideTrainedRange;
      result.input = static_cast<int>(i);
      farthest = out;
    }
  if (result.status != PredictionStatus::Ok) return result;
  result.value = value_of(model, T);
  result.sigma = model.sigma * std::sqrt(1.0 + leverage(model, T));
  return result;
}

VectorXd values(const ThermalModel& model, const MatrixXd& T) {
  VectorXd result(T.rows());
  for (Index row = 0; row < T.rows(); ++row) result(row) = value_of(model, T.row(row).transpose());
  return result;
}

int rows_outside(const ThermalModel& model, const MatrixXd& T) {
  int count = 0;
  for (Index row = 0; row < T.rows(); ++row)
    count += predict(model, T.row(row).transpose()).status != PredictionStatus::Ok;
  return count;
}

}  // namespace abbe::errors::identification
