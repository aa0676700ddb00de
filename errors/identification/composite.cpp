#include "errors/identification/composite.h"

#include <cmath>
#include <stdexcept>

#include "kinematics/require.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void validate(const std::vector<CompositeRun>& runs, const CompositeOptions& options) {
  require(!runs.empty(), "a composite needs runs");
  require(options.degree >= 1 && options.degree <= 12, "degree of a cold curve lies in 1 .. 12");
  for (const CompositeRun& run : runs) {
    require(run.p.size() == run.delta.size(), "positions and deviations of a run differ in number");
    require(run.dT_K.size() == runs.front().dT_K.size() && run.dT_K.size() >= 1,
            "runs differ in their temperatures");
    require(run.p.allFinite() && run.delta.allFinite() && run.dT_K.allFinite(),
            "a run holds a number that is not finite");
  }
}

double polynomial(const VectorXd& c, double p) {
  double value = 0;
  for (Index k = c.size(); k-- > 0;) value = value * p + c(k);
  return value;
}

/// All cold runs as one, which is what makes the cold curve.
CompositeRun cold_runs(const std::vector<CompositeRun>& runs) {
  CompositeRun all;
  for (const CompositeRun& run : runs) {
    if (!run.cold) continue;
    VectorXd p(all.p.size() + run.p.size()), delta(p.size());
    p << all.p, run.p;
    delta << all.delta, run.delta;
    all.p = p;
    all.delta = delta;
  }
  return all;
}

/// Powers of p / scale, so that a fourth power of 500 mm does not drown the first.
bool fit_curve(const CompositeRun& cold, int degree, CompositeFit& fit) {
  const double largest = cold.p.size() ? cold.p.cwiseAbs().maxCoeff() : 0.0;
  fit.curve_scale = largest > 0 ? largest : 1.0;
  MatrixXd powers(cold.p.size(), degree);
  for (Index i = 0; i < cold.p.size(); ++i)
    for (int k = 0; k < degree; ++k) powers(i, k) = std::pow(cold.p(i) / fit.curve_scale, k + 1);
  fit.curve = fit_regression(powers, cold.delta);
  if (fit.curve.status != RegressionStatus::Ok) return false;
  fit.geometric.resize(degree + 1);
  fit.geometric(0) = fit.curve.constant;
  for (int k = 0; k < degree; ++k)
    fit.geometric(k + 1) = fit.curve.beta(k) / std::pow(fit.curve_scale, k + 1);
  return true;
}

/// Straight line through a later run minus the cold curve.
Regression fit_slope(const CompositeRun& run, const VectorXd& geometric, bool free_offset) {
  VectorXd rest = run.delta;
  for (Index i = 0; i < rest.size(); ++i) rest(i) -= polynomial(geometric, run.p(i));
  RegressionOptions options;
  options.constant = free_offset;
  return fit_regression(run.p, rest, options);
}

/// Where every slope is known: what they owe to the temperatures.
void fit_temperatures(const std::vector<CompositeRun>& runs, const CompositeOptions& options,
                      CompositeFit& fit) {
  MatrixXd dT(static_cast<Index>(fit.later.size()), runs.front().dT_K.size());
  for (Index i = 0; i < dT.rows(); ++i)
    dT.row(i) = runs[static_cast<std::size_t>(fit.later[static_cast<std::size_t>(i)])].dT_K;
  RegressionOptions regression;
  regression.constant = options.slope_constant;
  fit.slope_fit = fit_regression(dT, fit.slope, regression);
  if (fit.slope_fit.status != RegressionStatus::Ok) {
    fit.status = CompositeStatus::SlopeNotDetermined;
    return;
  }
  fit.thermal = fit.slope_fit.beta;
  fit.thermal_constant = fit.slope_fit.constant;
}

double rms_about(const std::vector<CompositeRun>& runs, const CompositeFit& fit) {
  double squares = 0;
  Index rows = 0, later = 0;
  for (const CompositeRun& run : runs) {
    const double offset = run.cold ? 0.0 : fit.offset(later++);
    for (Index i = 0; i < run.p.size(); ++i) {
      // A cold run has dT = 0, but a constant of the slope belongs to the later runs.
      const double thermal = run.cold ? 0.0 : fit.thermal_constant + fit.thermal.dot(run.dT_K);
      const double law = polynomial(fit.geometric, run.p(i)) + thermal * run.p(i) + offset;
      squares += (run.delta(i) - law) * (run.delta(i) - law);
    }
    rows += run.p.size();
  }
  return std::sqrt(squares / static_cast<double>(rows));
}

/// The first run that makes a separation meaningless.
CompositeStatus check(const std::vector<CompositeRun>& runs, CompositeFit& fit) {
  bool any_cold = false;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!runs[i].cold) {
      fit.later.push_back(static_cast<int>(i));
      continue;
    }
    any_cold = true;
    if (!runs[i].dT_K.isZero(0)) {
      fit.run = static_cast<int>(i);
      return CompositeStatus::ColdRunWarm;
    }
  }
  if (!any_cold) return CompositeStatus::NoColdRun;
  return fit.later.empty() ? CompositeStatus::NoLaterRun : CompositeStatus::Ok;
}

}  // namespace

CompositeFit separate(const std::vector<CompositeRun>& runs, const CompositeOptions& options) {
  validate(runs, options);
  CompositeFit fit;
  fit.status = check(runs, fit);
  if (fit.status != CompositeStatus::Ok) return fit;
  if (!fit_curve(cold_runs(runs), options.degree, fit)) {
    fit.status = CompositeStatus::CurveNotDetermined;
    return fit;
  }
  const auto count = static_cast<Index>(fit.later.size());
  fit.slope = fit.slope_error = fit.offset = VectorXd::Zero(count);
  for (Index i = 0; i < count; ++i) {
    const int index = fit.later[static_cast<std::size_t>(i)];
    const Regression line =
        fit_slope(runs[static_cast<std::size_t>(index)], fit.geometric, options.free_offset);
    if (line.status != RegressionStatus::Ok) {
      fit.status = CompositeStatus::SlopeNotDetermined;
      fit.run = index;
      return fit;
    }
    fit.slope(i) = line.beta(0);
    fit.slope_error(i) = line.standard_error(line.standard_error.size() - 1);
    fit.offset(i) = line.constant;
  }
  fit_temperatures(runs, options, fit);
  if (fit.status == CompositeStatus::Ok) fit.rms = rms_about(runs, fit);
  return fit;
}

double value(const CompositeFit& fit, double p, const VectorXd& dT_K) {
  return polynomial(fit.geometric, p) + (fit.thermal_constant + fit.thermal.dot(dT_K)) * p;
}

double whole_slope(const CompositeRun& run) {
  const Regression line = fit_regression(run.p, run.delta);
  require(line.status == RegressionStatus::Ok, "a slope needs two positions");
  return line.beta(0);
}

}  // namespace abbe::errors::identification
