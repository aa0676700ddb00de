#include "sim/calibration/thermal_identification.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "errors/element.h"
#include "errors/identification/thermal_epochs.h"
#include "errors/metrology/machine_tests.h"
#include "kinematics/chain.h"

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

/// Runs of one axis, one for each start.
struct AxisRuns {
  std::vector<CompositeRun> runs;
  std::vector<VectorXd> T_C;   ///< mean temperatures of the sensors during each run
  std::vector<double> time_s;  ///< time at which each run began
};

/// Returns the mean temperatures of sensors during a set-up.
VectorXd mean_temperatures_C(const Readings& readings, int set_up, const Sensors& sensors) {
  const std::vector<Index> columns = identification::sensor_columns(sensors, readings.sensors);
  VectorXd sum = VectorXd::Zero(Index(sensors.size()));
  int count = 0;
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    if (readings.plan.measurements[i].set_up != set_up) continue;
    ++count;
    sum += readings.T_C.row(Index(i))(columns).transpose();
  }
  return sum / count;
}

/// Returns the time of the first reading of a set-up.
double set_up_start_s(const Readings& readings, int set_up) {
  double first = INFINITY;
  for (const auto& measurement : readings.plan.measurements)
    if (measurement.set_up == set_up) first = std::min(first, measurement.state.time_s);
  return first;
}

/// Returns the positioning runs of every slide.
std::map<char, AxisRuns> axis_runs(const Readings& readings, const Sensors& sensors) {
  std::map<char, AxisRuns> axes;
  using errors::metrology::AxisTest;
  for (const Readings& start : identification::split_by_start(readings)) {
    const errors::metrology::MachineTests tests = classify_readings(start);
    for (const AxisTest& test : tests.axes) {
      if (test.test_kind != AxisTest::TestKind::Positioning || test.rotary) continue;
      AxisRuns& axis = axes[test.axis];
      const bool cold = axis.runs.empty();
      axis.T_C.push_back(mean_temperatures_C(start, test.set_up, sensors));
      axis.time_s.push_back(set_up_start_s(start, test.set_up));
      // The first run of an axis is the cold one, to which temperature changes refer.
      axis.runs.push_back(
          {test.runs.target, run_mean(test.runs), axis.T_C.back() - axis.T_C.front(), cold});
    }
  }
  if (axes.empty()) throw std::invalid_argument("expected positioning readings of slides");
  return axes;
}

const char* status_text(CompositeStatus status) {
  switch (status) {
    case CompositeStatus::NoLaterRun:
      return "expected readings from several starts (start_h), seen one start";
    case CompositeStatus::CurveNotDetermined:
      return "expected more targets than the degree of the cold curve";
    case CompositeStatus::SlopeNotDetermined:
      return "expected one more start than sensors, with different temperatures";
    default:
      return "expected a cold run";
  }
}

/// Positioning element of a slide. Readings follow the command; the factors convert them into
/// displacements of the carriage along the bed.
struct Positioning {
  errors::ElementName element;
  double displacement_per_reading = 1.0;  ///< displacement of the carriage for a reading of 1
  double travel_per_command = 1.0;        ///< travel of the carriage for a command of 1
};

/// Returns the positioning element of a slide and its conversion factors.
Positioning slide_positioning(char axis, const kinematics::Chain& nominal) {
  const kinematics::Joint& joint = nominal.joints()[std::size_t(*nominal.find(axis))];
  Index k = 0;
  // 1e-6: an element has the letter of a bed axis, so the slide must agree with one to 1.4 mrad.
  if (!(joint.direction_b.cwiseAbs().maxCoeff(&k) > 1.0 - 1e-6))
    throw std::invalid_argument(fmt::format(
        "{}: expected a slide parallel to a machine axis, seen direction {:.6g} {:.6g} {:.6g}",
        axis, joint.direction_b.x(), joint.direction_b.y(), joint.direction_b.z()));
  const double travel = kinematics::carriage_travel(joint.side, 1.0);
  return {{char('X' + k), axis, false}, joint.direction_b[k] > 0.0 ? travel : -travel, travel};
}

/// Adds the cold curve of a slide as a polynomial with its covariance.
void add_cold_curve(errors::GeometricErrors& cold, const Positioning& slide,
                    const CompositeFit& fit) {
  VectorXd c = slide.displacement_per_reading * fit.geometric;
  // c[k] is the factor of p^k in the fit, and of (p / curve_scale)^k in the polynomial.
  for (Index k = 0; k < c.size(); ++k) c[k] *= std::pow(fit.curve_scale, double(k));
  const Index previous_size = cold.covariance.matrix.rows(), n = c.size();
  for (Index k = 0; k < n; ++k)
    cold.covariance.of.push_back({int(cold.elements.size()), 0, int(k)});
  // Curves of different axes are fitted to different readings, so their covariance is zero.
  cold.covariance.matrix.conservativeResize(previous_size + n, previous_size + n);
  cold.covariance.matrix.topRightCorner(previous_size, n).setZero();
  cold.covariance.matrix.bottomLeftCorner(n, previous_size).setZero();
  cold.covariance.matrix.bottomRightCorner(n, n) = fit.curve.covariance;
  cold.elements.push_back({slide.element, {{errors::Polynomial{c, 0.0, fit.curve_scale}, "cold"}}});
}

/// Returns the slope as a law of absolute temperatures, beta . (T - T_cold): a machine that is
/// already warm in the morning counts as warm.
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
  // The constant is -beta . T_cold, so its variance follows from that of beta.
  MatrixXd constant_and_slopes(m + 1, m);
  constant_and_slopes << -cold_C.transpose(), MatrixXd::Identity(m, m);
  const double variance = fit.slope_fit.residual_sd * fit.slope_fit.residual_sd;
  law.covariance = constant_and_slopes * fit.slope_fit.covariance * constant_and_slopes.transpose();
  if (variance > 0.0) law.covariance /= variance;
  model.law = std::move(law);
  model.sigma_from_runs = fit.slope_fit.degrees_of_freedom > 0;
  model.sigma = model.sigma_from_runs ? fit.slope_fit.press_rms : 0.0;
  return model;
}

/// Returns the regression of the slopes with an additional constant: the slope at dT = 0 that the
/// temperatures do not explain. Returns nothing if there are too few starts.
std::optional<Regression> with_constant(const AxisRuns& axis, const CompositeFit& fit) {
  const auto n = Index(fit.warm_runs.size()), m = fit.thermal.size();
  if (n < m + 2) return std::nullopt;
  MatrixXd dT(n, m);
  for (Index i = 0; i < n; ++i)
    dT.row(i) = axis.runs[std::size_t(fit.warm_runs[std::size_t(i)])].dT_K;
  Regression regression = identification::fit_regression(dT, fit.slope);
  if (regression.status != identification::RegressionStatus::Ok) return std::nullopt;
  return regression;
}

void add_warnings(std::vector<std::string>& warnings, const CompositeAxis& axis,
                  const Sensors& sensors) {
  const VectorXd& vif = axis.fit.slope_fit.vif;
  for (Index k = 0; k < vif.size(); ++k)
    // 10 is the usual limit of the variance inflation of collinear inputs.
    if (vif[k] > 10.0)
      warnings.push_back(
          fmt::format("{}: {} is nearly collinear with the other sensors (VIF {:.0f})", axis.axis,
                      sensors[std::size_t(k)], vif[k]));
  if (!axis.with_constant || axis.with_constant->degrees_of_freedom < 1) return;
  const double constant = axis.with_constant->constant,
               error = axis.with_constant->standard_error[0];
  // A constant below four standard errors may be chance; below 0.1 um/m it does not matter.
  if (std::abs(constant) > 4.0 * error && std::abs(constant) > 0.1 * um_per_m)
    warnings.push_back(fmt::format(
        "{}: the later starts give a slope of {:.3f} ({:.2g}) um/m at the temperatures of start 1, "
        "not 0: other temperatures matter, or the machine was not in equilibrium there",
        axis.axis, constant / um_per_m, error / um_per_m));
}

}  // namespace

Composite identify_composite(const Readings& readings, const CompositeIdentification& options) {
  if (options.sensors.empty())
    throw std::invalid_argument("expected sensors for the regression of the slopes");
  Composite result;
  result.thermal.since_start = false;
  for (const auto& [name, axis] : axis_runs(readings, options.sensors)) {
    identification::CompositeOptions composite_options;
    composite_options.degree = options.degree;
    const CompositeFit fit = identification::fit_composite(axis.runs, composite_options);
    if (fit.status != CompositeStatus::Ok)
      throw std::invalid_argument(fmt::format("{}: {}", name, status_text(fit.status)));
    const Positioning slide = slide_positioning(name, readings.nominal);
    add_cold_curve(result.cold, slide, fit);
    result.thermal.terms.push_back(
        {slide.element, true,
         slope_model(axis, fit, options,
                     slide.displacement_per_reading * slide.travel_per_command)});
    result.axes.push_back(
        {name, axis.time_s.front(), axis.T_C.front(), fit, with_constant(axis, fit)});
    add_warnings(result.warnings, result.axes.back(), options.sensors);
  }
  return result;
}

namespace {

using identification::DayLog;
using identification::Estimate;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double mm_per_m = 1000.0;  // slopes are in mm or rad over a metre or a radian

/// Returns an element with a constant; the positioning of a slide that was read at several
/// positions has an offset and a slope.
errors::Element thermal_element(const errors::ElementName& name, const Chain& nominal,
                                const std::vector<DayLog>& logs) {
  const int joint_index = errors::axis_joint(name.axis, nominal, to_string(name));
  const Joint& joint = nominal.joints()[std::size_t(joint_index)];
  errors::check_meaning(name, nominal, joint_index);
  Index along = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&along);
  const bool is_positioning =
      joint.motion == Motion::Linear && !name.location && name.component() == int(along);
  if (!is_positioning || !identification::is_axis_varied(logs, joint_index))
    return {name, {{errors::Constant{}}}};
  errors::Curve curve{errors::Polynomial{VectorXd::Zero(2), 0.0, mm_per_m}};
  curve.argument = errors::Argument::Carriage;
  return {name, {curve}};
}

char axis_letter(int component) {
  return component < 3 ? char('X' + component) : char('A' + component - 3);
}

/// Returns the elements that heat may change, most important first: if readings cannot separate
/// elements, the first are identified.
std::vector<errors::ElementName> default_elements(const Chain& nominal) {
  std::vector<errors::ElementName> positioning, angles, location_elements, nose;
  for (const Joint& joint : nominal.joints()) {
    Index along = 0;
    joint.direction_b.cwiseAbs().maxCoeff(&along);
    for (int c = 0; c < 6; ++c) {
      const bool is_along = c % 3 == int(along);
      if (joint.motion == Motion::Linear && c == int(along))
        positioning.push_back({axis_letter(c), joint.name, false});
      else if (joint.motion == Motion::Linear && c >= 3)
        angles.push_back({axis_letter(c), joint.name, false});
      else if (joint.motion == Motion::Rotary && c < 3 && !is_along)
        location_elements.push_back({axis_letter(c), joint.name, true});
      else if (joint.motion == Motion::Spindle && !(c >= 3 && is_along))
        nose.push_back({axis_letter(c), 'S', false});
    }
  }
  std::vector<errors::ElementName> result = positioning;
  for (const auto* group : {&nose, &location_elements, &angles})
    result.insert(result.end(), group->begin(), group->end());
  return result;
}

/// Returns a model of the named elements, or of the default elements, with zero values.
errors::GeometricErrors thermal_model(const Chain& nominal, const std::vector<DayLog>& logs,
                                      const std::vector<std::string>& names) {
  std::vector<errors::ElementName> elements;
  for (const std::string& name : names) elements.push_back(errors::parse_element_name(name));
  if (names.empty()) elements = default_elements(nominal);
  errors::GeometricErrors model;
  for (const errors::ElementName& name : elements) {
    for (const errors::Element& other : model.elements)
      if (other.name == name)
        throw std::invalid_argument("expected each element only once, seen " + to_string(name) +
                                    " twice");
    model.elements.push_back(thermal_element(name, nominal, logs));
  }
  return model;
}

/// Coefficients of a model over the epochs.
struct CoefficientSeries {
  MatrixXd value;  ///< (epochs x p) mm or rad; slopes over a metre
  MatrixXd sigma;  ///< (epochs x p) 0: not identified at that epoch
  std::vector<identification::ConfoundedCoefficient> confounded;  ///< at the last epoch

  bool is_determined(Index coefficient) const {
    return (sigma.col(coefficient).array() > 0.0).all();
  }
  /// RMS over the epochs after the first, in standard uncertainties.
  double signal(Index coefficient) const {
    const Index later_epochs = value.rows() - 1;
    const VectorXd z = value.col(coefficient)
                           .tail(later_epochs)
                           .cwiseQuotient(sigma.col(coefficient).tail(later_epochs));
    return std::sqrt(z.squaredNorm() / double(later_epochs));
  }
};

/// Returns the standard uncertainties of the coefficients; 0 for those not determined.
VectorXd standard_uncertainties(const Estimate& estimate,
                                const std::vector<errors::Coefficient>& coefficients) {
  VectorXd sigma = VectorXd::Zero(Index(coefficients.size()));
  const errors::Covariance& covariance = estimate.belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto column = std::ranges::find(coefficients, covariance.of[i]) - coefficients.begin();
    sigma[column] = std::sqrt(std::max(0.0, covariance.matrix(Index(i), Index(i))));
  }
  return sigma;
}

/// Estimates the coefficients at every epoch.
CoefficientSeries coefficient_series(const errors::GeometricErrors& model,
                                     const std::vector<std::vector<Readings>>& changes) {
  const auto list = errors::coefficients(model.elements);
  const auto n = Index(changes.size()), p = Index(list.size());
  CoefficientSeries series{MatrixXd(n, p), MatrixXd(n, p), {}};
  std::vector<Estimate> estimates(changes.size());
  tbb::parallel_for(std::size_t(0), changes.size(), [&](std::size_t k) {
    estimates[k] = identification::estimate(model, changes[k]);
  });
  for (Index k = 0; k < n; ++k) {
    const Estimate& estimate = estimates[std::size_t(k)];
    series.value.row(k) = estimate.value;
    series.sigma.row(k) = standard_uncertainties(estimate, list);
  }
  series.confounded = estimates.back().confounded;
  return series;
}

/// Returns the model with coefficients held at their values, by a prior variance of zero.
errors::GeometricErrors with_held_coefficients(errors::GeometricErrors model,
                                               const std::set<Index>& held_columns) {
  const auto list = errors::coefficients(model.elements);
  for (const Index j : held_columns) model.covariance.of.push_back(list[std::size_t(j)]);
  const auto m = Index(held_columns.size());
  model.covariance.matrix = MatrixXd::Zero(m, m);
  return model;
}

/// Estimates the coefficients that exceed the noise. The weakest coefficient is held and the others
/// are estimated again, until all remaining ones reach `min_signal`.
CoefficientSeries significant_series(const errors::GeometricErrors& model,
                                     const std::vector<std::vector<Readings>>& changes,
                                     double min_signal) {
  std::set<Index> held_columns;
  while (true) {
    CoefficientSeries series =
        coefficient_series(with_held_coefficients(model, held_columns), changes);
    std::optional<Index> weakest;
    for (Index j = 0; j < series.value.cols(); ++j)
      if (series.is_determined(j) && (!weakest || series.signal(j) < series.signal(*weakest)))
        weakest = j;
    if (!weakest)
      throw std::invalid_argument(
          "expected thermal deformation above the noise of the instruments, seen none");
    // Only one is held at a time, since the others are then determined better and may exceed the
    // noise.
    if (series.signal(*weakest) >= min_signal) return series;
    held_columns.insert(*weakest);
  }
}

/// Determined coefficient, with its weight in the choice of sensors.
struct TermCoefficient {
  errors::ElementName name;
  bool slope = false;
  Index column = 0;  ///< column of the series
  double per_unit =
      1.0;  ///< value of the term per unit of the coefficient; slopes are per mm or rad
  double tip_effect = 1.0;  ///< mm, approximate effect on the tip of one unit of the coefficient
};

/// Returns a coefficient with its effect on the tip.
TermCoefficient term_coefficient(const errors::Coefficient& coefficient, Index column,
                                 const errors::GeometricErrors& model, const Chain& nominal) {
  TermCoefficient term;
  term.name = model.elements[std::size_t(coefficient.element)].name;
  term.slope = coefficient.number == 1;
  term.column = column;
  const Joint& joint =
      nominal
          .joints()[std::size_t(errors::axis_joint(term.name.axis, nominal, to_string(term.name)))];
  if (term.slope) {
    term.per_unit = 1.0 / mm_per_m;
    // Half of the travel is the largest distance from its middle.
    term.tip_effect = 0.5 * (joint.max - joint.min) / mm_per_m;
  } else if (term.name.is_angle()) {
    const double arm = (nominal.T_bt_home().translation() - joint.point_b).norm();
    // The lever arm from the axis to the tip, at least 1 mm if the axis passes through the tip.
    term.tip_effect = std::max(arm, 1.0);
  }
  return term;
}

std::vector<TermCoefficient> determined_coefficients(const CoefficientSeries& series,
                                                     const errors::GeometricErrors& model,
                                                     const Chain& nominal) {
  const auto list = errors::coefficients(model.elements);
  std::vector<TermCoefficient> terms;
  for (std::size_t j = 0; j < list.size(); ++j)
    if (series.is_determined(Index(j)))
      terms.push_back(term_coefficient(list[j], Index(j), model, nominal));
  if (terms.empty())
    throw std::invalid_argument("expected readings that determine at least one element, seen none");
  return terms;
}

/// Chooses one set of sensors for all terms.
identification::SensorChoice choose_term_sensors(
    const CoefficientSeries& series, const std::vector<TermCoefficient>& terms,
    const std::vector<std::string>& sensors, const MatrixXd& dT_K,
    const identification::SensorChoiceOptions& options) {
  std::vector<identification::ThermalData> errors;
  for (const TermCoefficient& term : terms) {
    // All coefficients are converted to mm at the tip, so that their effects determine the sensors.
    const VectorXd y = term.tip_effect * series.value.col(term.column);
    if (y.maxCoeff() > y.minCoeff())
      errors.push_back({sensors, dT_K, y, std::vector<int>(std::size_t(y.size()), 0)});
  }
  if (errors.empty())
    throw std::invalid_argument("expected elements that change while the machine warms up");
  auto choice = identification::choose_sensors(errors, options);
  if (choice.status != identification::GreyStatus::Ok || choice.chosen.empty())
    throw std::invalid_argument("expected temperatures from which sensors can be chosen, seen " +
                                std::string(to_string(choice.status)));
  return choice;
}

/// Regresses a term on the temperatures of the chosen sensors.
identification::ThermalFit fit_term(const TermCoefficient& term, const CoefficientSeries& series,
                                    const identification::ThermalData& inputs, double margin) {
  identification::ThermalModelOptions options;
  options.margin = margin;
  identification::ThermalData data = inputs;
  data.y = term.per_unit * series.value.col(term.column);
  // One epoch more than coefficients leaves a degree of freedom for the residual.
  if (std::size_t(data.y.size()) <= data.names.size() + 1)
    throw std::invalid_argument(
        fmt::format("expected more epochs than {} sensors and a constant, seen {}",
                    data.names.size(), data.y.size()));
  auto fitted = identification::fit(data, options);
  if (!fitted.model)
    throw std::invalid_argument("expected linearly independent sensors, seen " +
                                identification::describe(fitted.confounded, data.names));
  return fitted;
}

/// Returns warnings about collinear sensors, large terms and poorly explained terms.
std::vector<std::string> day_warnings(const ThermalDay& day) {
  std::vector<std::string> warnings;
  const VectorXd& vif = day.terms.front().regression.vif;
  for (Index k = 0; k < vif.size(); ++k)
    // 10 is the usual limit of the variance inflation of collinear inputs.
    if (vif[k] > 10.0)
      warnings.push_back(
          fmt::format("{} is nearly collinear with the other sensors on this day (VIF {:.0f})",
                      day.sensors[std::size_t(k)], vif[k]));
  constexpr double large_mm = 1.0, large_rad = 0.01;  // no machine moves so much in a day
  for (const RegressedTerm& term : day.terms) {
    const double range = term.at_epochs.maxCoeff() - term.at_epochs.minCoeff();
    if (range >= (term.name.is_angle() ? large_rad : large_mm))
      warnings.push_back(
          fmt::format("{} changes by {:.4g} {}, which is implausible for one day: check unit and "
                      "order of the readings",
                      name_of(term), range * (term.name.is_angle() ? 1e3 : 1.0),
                      term.name.is_angle() ? "mrad" : "mm"));
  }
  for (const RegressedTerm& term : day.terms)
    // Below 0.9 more than a tenth of the variance is not explained.
    if (const double r_squared = term.regression.r_squared; r_squared < 0.9)
      warnings.push_back(fmt::format("{}: these temperatures explain {:.0f} % of its variation",
                                     name_of(term), 100.0 * std::max(0.0, r_squared)));
  return warnings;
}

void check(std::span<const Readings> readings) {
  if (readings.empty()) throw std::invalid_argument("expected readings");
  for (const Readings& file_readings : readings) {
    if (file_readings.plan.measurements.empty())
      throw std::invalid_argument("expected readings of " + file_readings.plan.instrument +
                                  ", seen none");
    if (kinematics::letters(file_readings.nominal.joints()) !=
        kinematics::letters(readings.front().nominal.joints()))
      throw std::invalid_argument(
          "expected readings of one machine, seen a different machine in readings of " +
          file_readings.plan.instrument);
  }
}

}  // namespace

std::string name_of(const RegressedTerm& term) {
  return to_string(term.name) + (term.slope ? " slope" : " offset");
}

ThermalIdentificationResult identify_thermal(std::span<const Readings> readings,
                                             const ThermalIdentification& options) {
  check(readings);
  std::vector<DayLog> logs;
  for (const Readings& file_readings : readings)
    logs.push_back(identification::day_log(file_readings));
  const Chain& nominal = readings.front().nominal;
  ThermalIdentificationResult result;
  ThermalDay& day = result.day;
  day.epochs = identification::split_into_epochs(logs);
  const auto changes = identification::changes_since_first(logs, day.epochs);
  const errors::GeometricErrors model = thermal_model(nominal, logs, options.elements);
  const CoefficientSeries series = options.elements.empty()
                                       ? significant_series(model, changes, options.min_signal)
                                       : coefficient_series(model, changes);
  const std::vector<TermCoefficient> determined = determined_coefficients(series, model, nominal);

  const std::vector<std::string> logged = identification::common_sensors(logs);
  const MatrixXd logged_dT_K = identification::temperature_rise_K(logs, day.epochs, logged);
  day.sensors = options.sensors;
  if (day.sensors.empty()) {
    day.chosen = {logged,
                  choose_term_sensors(series, determined, logged, logged_dT_K, options.choice)};
    for (const int i : day.chosen->choice.chosen) day.sensors.push_back(logged[std::size_t(i)]);
  }
  day.dT_K = logged_dT_K(Eigen::all, identification::sensor_columns(day.sensors, logged));
  day.margin = options.margin;
  const identification::ThermalData inputs{
      day.sensors, day.dT_K, {}, std::vector<int>(day.epochs.size(), 0)};
  for (const TermCoefficient& term : determined) {
    const identification::ThermalFit fit = fit_term(term, series, inputs, options.margin);
    result.belief.terms.push_back({term.name, term.slope, *fit.model});
    day.terms.push_back({term.name, term.slope, series.value.col(term.column),
                         series.sigma.col(term.column), *fit.regression});
  }
  result.confounded = series.confounded;
  result.warnings = day_warnings(day);
  return result;
}

}  // namespace abbe::sim
