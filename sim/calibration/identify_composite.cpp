#include "sim/calibration/identify_composite.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/identification/epochs.h"
#include "errors/metrology/machine_tests.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using errors::metrology::Readings;
using identification::CompositeFit;
using identification::CompositeRun;
using identification::CompositeStatus;
using identification::Regression;
using Sensors = std::vector<std::string>;

constexpr double per_m = 1e-6;  // um/m

/// The runs of one axis, start by start.
struct AxisRuns {
  std::vector<CompositeRun> runs;
  std::vector<VectorXd> T_C;   ///< of the sensors during each
  std::vector<double> time_s;  ///< at which each began
};

/// Mean temperatures of some sensors while a set-up stood.
VectorXd mean_C(const Readings& readings, int set_up, const Sensors& sensors) {
  const std::vector<Index> columns = identification::sensor_columns(sensors, readings.sensors);
  VectorXd sum = VectorXd::Zero(Index(sensors.size()));
  int count = 0;
  for (std::size_t i = 0; i < readings.plan.looks.size(); ++i) {
    if (readings.plan.looks[i].set_up != set_up) continue;
    ++count;
    sum += readings.T_C.row(Index(i))(columns).transpose();
  }
  return sum / count;
}

double start_s(const Readings& readings, int set_up) {
  double first = INFINITY;
  for (const auto& look : readings.plan.looks)
    if (look.set_up == set_up) first = std::min(first, look.state.time_s);
  return first;
}

std::map<char, AxisRuns> runs_of(const Readings& readings, const Sensors& sensors) {
  std::map<char, AxisRuns> axes;
  using errors::metrology::AxisTest;
  for (const Readings& start : identification::by_start(readings)) {
    const errors::metrology::Tests tests = tests_of(start);
    for (const AxisTest& test : tests.axes) {
      if (test.what != AxisTest::What::Positioning || test.rotary) continue;
      AxisRuns& axis = axes[test.axis];
      const bool cold = axis.runs.empty();
      axis.T_C.push_back(mean_C(start, test.set_up, sensors));
      axis.time_s.push_back(start_s(start, test.set_up));
      axis.runs.push_back(
          {test.runs.target, mean_of(test.runs), axis.T_C.back() - axis.T_C.front(), cold});
    }
  }
  if (axes.empty()) throw std::invalid_argument("expected the positioning of slides");
  return axes;
}

const char* sentence(CompositeStatus status) {
  switch (status) {
    case CompositeStatus::NoLaterRun:
      return "expected readings from several starts (start_h), seen one";
    case CompositeStatus::CurveNotDetermined:
      return "expected more targets than the degree of the cold curve";
    case CompositeStatus::SlopeNotDetermined:
      return "expected starts, one more than sensors, at which their temperatures part";
    default:
      return "expected a cold run";
  }
}

// ---- beliefs

/// The positioning of a slide, and how readings, which follow the command, turn into displacements
/// of the carriage along the bed.
struct Positioning {
  errors::ElementName element;
  double of_reading = 1.0;  ///< carriage's displacement for a reading of 1
  double of_travel = 1.0;   ///< carriage's own travel for a command of 1
};

Positioning positioning_of(char axis, const kinematics::Chain& nominal) {
  const kinematics::Joint& joint = nominal.joints()[std::size_t(*nominal.find(axis))];
  Index k = 0;
  if (!(joint.direction_b.cwiseAbs().maxCoeff(&k) > 1.0 - 1e-6))
    throw std::invalid_argument(fmt::format(
        "{}: expected a slide along an axis of the bed, seen direction {:.6g} {:.6g} {:.6g}", axis,
        joint.direction_b.x(), joint.direction_b.y(), joint.direction_b.z()));
  const double travel = kinematics::carriage_travel(joint.side, 1.0);
  return {{char('X' + k), axis, false}, joint.direction_b[k] > 0.0 ? travel : -travel, travel};
}

void add_cold(errors::GeometricErrors& cold, const Positioning& slide, const CompositeFit& fit) {
  VectorXd c = slide.of_reading * fit.geometric;
  for (Index k = 0; k < c.size(); ++k) c[k] *= std::pow(fit.curve_scale, double(k));
  const Index before = cold.covariance.matrix.rows(), n = c.size();
  for (Index k = 0; k < n; ++k)
    cold.covariance.of.push_back({int(cold.elements.size()), 0, int(k)});
  cold.covariance.matrix.conservativeResize(before + n, before + n);
  cold.covariance.matrix.topRightCorner(before, n).setZero();
  cold.covariance.matrix.bottomLeftCorner(n, before).setZero();
  cold.covariance.matrix.bottomRightCorner(n, n) = fit.curve.covariance;
  cold.elements.push_back({slide.element, {{errors::Polynomial{c, 0.0, fit.curve_scale}, "cold"}}});
}

/// The slope as a law of absolute temperatures, beta . (T - T_cold), so that a day which begins
/// warm is a warm day.
identification::ThermalModel slope_model(const AxisRuns& axis, const CompositeFit& fit,
                                         const CompositeIdentification& options, double sense) {
  const Index m = fit.thermal.size();
  identification::ThermalModel model;
  model.names = options.sensors;
  model.margin = options.margin;
  model.lowest = model.highest = axis.T_C.front();
  for (const VectorXd& T_C : axis.T_C) {
    model.lowest = model.lowest.cwiseMin(T_C);
    model.highest = model.highest.cwiseMax(T_C);
  }
  const VectorXd& cold_C = axis.T_C.front();
  identification::LinearLaw law{-sense * cold_C.dot(fit.thermal), sense * fit.thermal, {}};
  MatrixXd back(m + 1, m);
  back << -cold_C.transpose(), MatrixXd::Identity(m, m);
  const double variance = fit.slope_fit.residual_sd * fit.slope_fit.residual_sd;
  law.covariance = back * fit.slope_fit.covariance * back.transpose();
  if (variance > 0.0) law.covariance /= variance;
  model.law = std::move(law);
  model.sigma_from_runs = fit.slope_fit.degrees_of_freedom > 0;
  model.sigma = model.sigma_from_runs ? fit.slope_fit.press_rms : 0.0;
  return model;
}

// ---- what the law does not say

/// The slopes regressed with a constant as well: what the temperatures leave at dT = 0.
std::optional<Regression> with_constant(const AxisRuns& axis, const CompositeFit& fit) {
  const auto n = Index(fit.later.size()), m = fit.thermal.size();
  if (n < m + 2) return std::nullopt;
  MatrixXd dT(n, m);
  for (Index i = 0; i < n; ++i) dT.row(i) = axis.runs[std::size_t(fit.later[std::size_t(i)])].dT_K;
  Regression regression = identification::fit_regression(dT, fit.slope);
  if (regression.status != identification::RegressionStatus::Ok) return std::nullopt;
  return regression;
}

void add_warnings(std::vector<std::string>& warnings, const CompositeAxis& axis,
                  const Sensors& sensors) {
  const VectorXd& vif = axis.fit.slope_fit.vif;
  for (Index k = 0; k < vif.size(); ++k)
    if (vif[k] > 10.0)
      warnings.push_back(fmt::format("{}: {} says nearly what the other sensors say (VIF {:.0f})",
                                     axis.axis, sensors[std::size_t(k)], vif[k]));
  if (!axis.with_constant || axis.with_constant->degrees_of_freedom < 1) return;
  const double constant = axis.with_constant->constant,
               error = axis.with_constant->standard_error[0];
  if (std::abs(constant) > 4.0 * error && std::abs(constant) > 0.1 * per_m)
    warnings.push_back(fmt::format(
        "{}: by the later starts the slope is {:.3f} ({:.2g}) um/m where these temperatures are "
        "those of start 1, not 0: other temperatures matter, or the machine was not at rest there",
        axis.axis, constant / per_m, error / per_m));
}

}  // namespace

Composite identify_composite(const Readings& readings, const CompositeIdentification& options) {
  if (options.sensors.empty())
    throw std::invalid_argument("expected sensors to regress the slopes on");
  Composite result;
  result.thermal.since_start = false;
  for (const auto& [name, axis] : runs_of(readings, options.sensors)) {
    identification::CompositeOptions how;
    how.degree = options.degree;
    const CompositeFit fit = identification::separate(axis.runs, how);
    if (fit.status != CompositeStatus::Ok)
      throw std::invalid_argument(fmt::format("{}: {}", name, sentence(fit.status)));
    const Positioning slide = positioning_of(name, readings.nominal);
    add_cold(result.cold, slide, fit);
    result.thermal.terms.push_back(
        {slide.element, true, slope_model(axis, fit, options, slide.of_reading * slide.of_travel)});
    result.axes.push_back(
        {name, axis.time_s.front(), axis.T_C.front(), fit, with_constant(axis, fit)});
    add_warnings(result.warnings, result.axes.back(), options.sensors);
  }
  return result;
}

}  // namespace abbe::sim
