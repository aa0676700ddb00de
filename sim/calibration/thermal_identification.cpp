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

constexpr double per_m = 1e-6;  // um/m

/// The runs of one axis, one for each start.
struct AxisRuns {
  std::vector<CompositeRun> runs;
  std::vector<VectorXd> T_C;   ///< temperatures of the sensors during each run
  std::vector<double> time_s;  ///< time at which each run began
};

/// Returns the mean temperatures of some sensors during a set-up.
VectorXd mean_C(const Readings& readings, int set_up, const Sensors& sensors) {
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

double start_s(const Readings& readings, int set_up) {
  double first = INFINITY;
  for (const auto& measurement : readings.plan.measurements)
    if (measurement.set_up == set_up) first = std::min(first, measurement.state.time_s);
  return first;
}

std::map<char, AxisRuns> runs_of(const Readings& readings, const Sensors& sensors) {
  std::map<char, AxisRuns> axes;
  using errors::metrology::AxisTest;
  for (const Readings& start : identification::split_by_start(readings)) {
    const errors::metrology::Tests tests = classify_readings(start);
    for (const AxisTest& test : tests.axes) {
      if (test.what != AxisTest::TestKind::Positioning || test.rotary) continue;
      AxisRuns& axis = axes[test.axis];
      const bool cold = axis.runs.empty();
      axis.T_C.push_back(mean_C(start, test.set_up, sensors));
      axis.time_s.push_back(start_s(start, test.set_up));
      axis.runs.push_back(
          // the first run of an axis is the cold one, from which temperatures count
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

// Beliefs

/// The positioning of a slide, and the conversion of readings, which follow the command, into
/// displacements of the carriage along the bed.
struct Positioning {
  errors::ElementName element;
  double of_reading = 1.0;  ///< displacement of the carriage for a reading of 1
  double of_travel = 1.0;   ///< travel of the carriage for a command of 1
};

Positioning positioning_of(char axis, const kinematics::Chain& nominal) {
  const kinematics::Joint& joint = nominal.joints()[std::size_t(*nominal.find(axis))];
  Index k = 0;
  // 1e-6: an element has the letter of a bed axis, so the slide must lie along one within 1.4 mrad
  if (!(joint.direction_b.cwiseAbs().maxCoeff(&k) > 1.0 - 1e-6))
    throw std::invalid_argument(fmt::format(
        "{}: expected a slide along an axis of the bed, seen direction {:.6g} {:.6g} {:.6g}", axis,
        joint.direction_b.x(), joint.direction_b.y(), joint.direction_b.z()));
  const double travel = kinematics::carriage_travel(joint.side, 1.0);
  return {{char('X' + k), axis, false}, joint.direction_b[k] > 0.0 ? travel : -travel, travel};
}

// Adds the cold curve of a slide as a polynomial, with its covariance.
void add_cold(errors::GeometricErrors& cold, const Positioning& slide, const CompositeFit& fit) {
  VectorXd c = slide.of_reading * fit.geometric;
  // c[k] belongs to p^k in the fit and to (p / curve_scale)^k in the polynomial
  for (Index k = 0; k < c.size(); ++k) c[k] *= std::pow(fit.curve_scale, double(k));
  const Index before = cold.covariance.matrix.rows(), n = c.size();
  for (Index k = 0; k < n; ++k)
    cold.covariance.of.push_back({int(cold.elements.size()), 0, int(k)});
  // Curves of different axes come from different readings: their covariance is zero.
  cold.covariance.matrix.conservativeResize(before + n, before + n);
  cold.covariance.matrix.topRightCorner(before, n).setZero();
  cold.covariance.matrix.bottomLeftCorner(n, before).setZero();
  cold.covariance.matrix.bottomRightCorner(n, n) = fit.curve.covariance;
  cold.elements.push_back({slide.element, {{errors::Polynomial{c, 0.0, fit.curve_scale}, "cold"}}});
}

/// Returns the slope as a law of absolute temperatures, beta . (T - T_cold), so that a machine that
/// is already warm in the morning is treated as warm.
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

// Checks of the law

/// Returns the regression of the slopes with an additional constant, which is what the temperatures
/// do not explain at dT = 0; none if there are too few starts.
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
    // A variance inflation factor above 10 is the usual limit of collinearity.
    if (vif[k] > 10.0)
      warnings.push_back(fmt::format("{}: {} says nearly what the other sensors say (VIF {:.0f})",
                                     axis.axis, sensors[std::size_t(k)], vif[k]));
  if (!axis.with_constant || axis.with_constant->degrees_of_freedom < 1) return;
  const double constant = axis.with_constant->constant,
               error = axis.with_constant->standard_error[0];
  // Four standard errors and 0.1 um/m: a smaller constant may be chance, or does not matter.
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
    const CompositeFit fit = identification::fit_composite(axis.runs, how);
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

namespace {

using identification::DayLog;
using identification::Estimate;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double per_metre = 1000.0;  // mm: slopes are in mm or rad over a metre or a radian

// Elements

// Returns an element with a constant, or for the positioning of a slide that moved an offset and a
// slope.
errors::Element element_of(const errors::ElementName& name, const Chain& nominal,
                           const std::vector<DayLog>& logs) {
  const int at = errors::joint_of(name.axis, nominal, to_string(name));
  const Joint& joint = nominal.joints()[std::size_t(at)];
  errors::check_meaning(name, nominal, at);
  Index along = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&along);
  const bool positions =
      joint.motion == Motion::Linear && !name.location && name.component() == int(along);
  if (!positions || !identification::is_axis_varied(logs, at)) return {name, {{errors::Constant{}}}};
  errors::Curve curve{errors::Polynomial{VectorXd::Zero(2), 0.0, per_metre}};
  curve.argument = errors::Argument::Carriage;
  return {name, {curve}};
}

char letter(int component) {
  return component < 3 ? char('X' + component) : char('A' + component - 3);
}

/// Returns the elements that heat may move, in the order in which they are kept if readings cannot
/// separate them.
std::vector<errors::ElementName> candidates(const Chain& nominal) {
  std::vector<errors::ElementName> positioning, angles, places, nose;
  for (const Joint& joint : nominal.joints()) {
    Index along = 0;
    joint.direction_b.cwiseAbs().maxCoeff(&along);
    for (int c = 0; c < 6; ++c) {
      const bool is_along = c % 3 == int(along);
      if (joint.motion == Motion::Linear && c == int(along))
        positioning.push_back({letter(c), joint.name, false});
      else if (joint.motion == Motion::Linear && c >= 3)
        angles.push_back({letter(c), joint.name, false});
      else if (joint.motion == Motion::Rotary && c < 3 && !is_along)
        places.push_back({letter(c), joint.name, true});
      else if (joint.motion == Motion::Spindle && !(c >= 3 && is_along))
        nose.push_back({letter(c), 'S', false});
    }
  }
  std::vector<errors::ElementName> all = positioning;
  for (const auto* more : {&nose, &places, &angles})
    all.insert(all.end(), more->begin(), more->end());
  return all;
}

errors::GeometricErrors model_of(const Chain& nominal, const std::vector<DayLog>& logs,
                                 const std::vector<std::string>& names) {
  std::vector<errors::ElementName> elements;
  for (const std::string& name : names) elements.push_back(errors::parse_element_name(name));
  if (names.empty()) elements = candidates(nominal);
  errors::GeometricErrors model;
  for (const errors::ElementName& name : elements) {
    for (const errors::Element& other : model.elements)
      if (other.name == name)
        throw std::invalid_argument("expected each element once, seen " + to_string(name) +
                                    " twice");
    model.elements.push_back(element_of(name, nominal, logs));
  }
  return model;
}

// Numbers over the day

/// The coefficients of a model over the epochs.
struct Series {
  MatrixXd value;  ///< (epochs x p) mm or rad; slopes over a metre
  MatrixXd sigma;  ///< (epochs x p) 0: not identified at that epoch
  std::vector<identification::Confounded> confounded;  ///< at the last epoch

  bool is_found(Index number) const { return (sigma.col(number).array() > 0.0).all(); }
  /// RMS over the epochs after the first, in standard uncertainties.
  double signal(Index number) const {
    const Index later = value.rows() - 1;
    const VectorXd z = value.col(number).tail(later).cwiseQuotient(sigma.col(number).tail(later));
    return std::sqrt(z.squaredNorm() / double(later));
  }
};

// Returns the standard uncertainties of the coefficients, 0 for those that were not determined.
VectorXd sigma_of(const Estimate& estimate, const std::vector<errors::Coefficient>& numbers) {
  VectorXd sigma = VectorXd::Zero(Index(numbers.size()));
  const errors::Covariance& covariance = estimate.belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto at = std::ranges::find(numbers, covariance.of[i]) - numbers.begin();
    sigma[at] = std::sqrt(std::max(0.0, covariance.matrix(Index(i), Index(i))));
  }
  return sigma;
}

Series series_of(const errors::GeometricErrors& model,
                 const std::vector<std::vector<Readings>>& changes) {
  const auto numbers = errors::coefficients(model.elements);
  const auto n = Index(changes.size()), p = Index(numbers.size());
  Series series{MatrixXd(n, p), MatrixXd(n, p), {}};
  std::vector<Estimate> estimates(changes.size());
  tbb::parallel_for(std::size_t(0), changes.size(), [&](std::size_t k) {
    estimates[k] = identification::estimate(model, changes[k]);
  });
  for (Index k = 0; k < n; ++k) {
    const Estimate& estimate = estimates[std::size_t(k)];
    series.value.row(k) = estimate.value;
    series.sigma.row(k) = sigma_of(estimate, numbers);
  }
  series.confounded = estimates.back().confounded;
  return series;
}

errors::GeometricErrors with_held_numbers(errors::GeometricErrors model,
                                          const std::set<Index>& held) {
  const auto numbers = errors::coefficients(model.elements);
  for (const Index j : held) model.covariance.of.push_back(numbers[std::size_t(j)]);
  const auto m = Index(held.size());
  model.covariance.matrix = MatrixXd::Zero(m, m);
  return model;
}

/// Fits with fewer and fewer coefficients, leaving out the weakest, until all that remain stand out
/// of the noise.
Series signals_of(const errors::GeometricErrors& model,
                  const std::vector<std::vector<Readings>>& changes, double min_signal) {
  std::set<Index> held;
  while (true) {
    Series series = series_of(with_held_numbers(model, held), changes);
    std::optional<Index> weakest;
    for (Index j = 0; j < series.value.cols(); ++j)
      if (series.is_found(j) && (!weakest || series.signal(j) < series.signal(*weakest)))
        weakest = j;
    if (!weakest)
      throw std::invalid_argument(
          "expected a machine that heat moves beyond the noise of its "
          "instruments, seen one that stands");
    // One at a time: without the weakest the others are determined better and may stand out.
    if (series.signal(*weakest) >= min_signal) return series;
    held.insert(*weakest);
  }
}

// Terms

// A determined coefficient, with its weight in the choice of sensors.
struct Number {
  errors::ElementName name;
  bool slope = false;
  Index column = 0;         ///< column of the series
  double per_unit = 1.0;    ///< term for one unit of the coefficient: slopes are per mm or rad
  double tip_effect = 1.0;  ///< mm, approximate effect on the tip of one unit of the coefficient
};

Number number_of(const errors::Coefficient& coefficient, Index column,
                 const errors::GeometricErrors& model, const Chain& nominal) {
  Number number;
  number.name = model.elements[std::size_t(coefficient.element)].name;
  number.slope = coefficient.number == 1;
  number.column = column;
  const Joint& joint = nominal.joints()[std::size_t(
      errors::joint_of(number.name.axis, nominal, to_string(number.name)))];
  if (number.slope) {
    number.per_unit = 1.0 / per_metre;
    // half of the travel, the largest distance from its middle
    number.tip_effect = 0.5 * (joint.max - joint.min) / per_metre;
  } else if (number.name.is_angle()) {
    const double arm = (nominal.T_bt_home().translation() - joint.point_b).norm();
    // the arm from the axis to the tip, or 1 mm where the axis passes through the tip
    number.tip_effect = std::max(arm, 1.0);
  }
  return number;
}

std::vector<Number> determined_numbers(const Series& series, const errors::GeometricErrors& model,
                                       const Chain& nominal) {
  const auto all = errors::coefficients(model.elements);
  std::vector<Number> numbers;
  for (std::size_t j = 0; j < all.size(); ++j)
    if (series.is_found(Index(j))) numbers.push_back(number_of(all[j], Index(j), model, nominal));
  if (numbers.empty())
    throw std::invalid_argument("expected readings that determine one of the elements, seen none");
  return numbers;
}

identification::SensorChoice choice_of(const Series& series, const std::vector<Number>& numbers,
                                       const std::vector<std::string>& sensors,
                                       const MatrixXd& dT_K,
                                       const identification::SensorChoiceOptions& options) {
  std::vector<identification::ThermalData> errors;
  for (const Number& number : numbers) {
    // All coefficients in mm at the tip, so that one set of sensors serves them by their effect.
    const VectorXd y = number.tip_effect * series.value.col(number.column);
    if (y.maxCoeff() > y.minCoeff())
      errors.push_back({sensors, dT_K, y, std::vector<int>(std::size_t(y.size()), 0)});
  }
  if (errors.empty())
    throw std::invalid_argument("expected elements that move while the machine warms");
  auto choice = identification::choose_sensors(errors, options);
  if (choice.status != identification::GreyStatus::Ok || choice.chosen.empty())
    throw std::invalid_argument("expected temperatures from which sensors can be chosen, seen " +
                                std::string(to_string(choice.status)));
  return choice;
}

identification::ThermalFit fit_of(const Number& number, const Series& series,
                                  const identification::ThermalData& warmed, double margin) {
  identification::ThermalModelOptions options;
  options.margin = margin;
  identification::ThermalData data = warmed;
  data.y = number.per_unit * series.value.col(number.column);
  // one more epoch than coefficients leaves a degree of freedom for the residual
  if (std::size_t(data.y.size()) <= data.names.size() + 1)
    throw std::invalid_argument(
        fmt::format("expected more epochs than {} sensors and a constant, seen {}",
                    data.names.size(), data.y.size()));
  auto fitted = identification::fit(data, options);
  if (!fitted.model)
    throw std::invalid_argument("expected sensors that say different things, seen " +
                                identification::describe(fitted.confounded, data.names));
  return fitted;
}

std::vector<std::string> warnings_of(const ThermalDay& day) {
  std::vector<std::string> warnings;
  const VectorXd& vif = day.terms.front().regression.vif;
  for (Index k = 0; k < vif.size(); ++k)
    // A variance inflation factor above 10 is the usual limit of collinearity.
    if (vif[k] > 10.0)
      warnings.push_back(
          fmt::format("{} says nearly what the other sensors say on this day (VIF {:.0f})",
                      day.sensors[std::size_t(k)], vif[k]));
  constexpr double large_mm = 1.0, large_rad = 0.01;  // no day moves a machine that far
  for (const RegressedTerm& term : day.terms) {
    const double range = term.at_epochs.maxCoeff() - term.at_epochs.minCoeff();
    if (range >= (term.name.is_angle() ? large_rad : large_mm))
      warnings.push_back(fmt::format(
          "{} moves by {:.4g} {}, and no day moves a machine that far: readings may be in another "
          "unit or order",
          name_of(term), range * (term.name.is_angle() ? 1e3 : 1.0),
          term.name.is_angle() ? "mrad" : "mm"));
  }
  for (const RegressedTerm& term : day.terms)
    // below 0.9 more than a tenth of the variance is not explained
    if (const double r_squared = term.regression.r_squared; r_squared < 0.9)
      warnings.push_back(fmt::format("{}: these temperatures tell {:.0f} % of how it moved",
                                     name_of(term), 100.0 * std::max(0.0, r_squared)));
  return warnings;
}

void check(std::span<const Readings> readings) {
  if (readings.empty()) throw std::invalid_argument("expected readings");
  for (const Readings& one : readings) {
    if (one.plan.measurements.empty())
      throw std::invalid_argument("expected readings of " + one.plan.instrument + ", seen none");
    if (kinematics::letters(one.nominal.joints()) !=
        kinematics::letters(readings.front().nominal.joints()))
      throw std::invalid_argument("expected readings of one machine, seen those of another by " +
                                  one.plan.instrument);
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
  for (const Readings& one : readings) logs.push_back(identification::day_log(one));
  const Chain& nominal = readings.front().nominal;
  ThermalIdentificationResult result;
  ThermalDay& day = result.day;
  day.epochs = identification::split_into_epochs(logs);
  const auto changes = identification::changes_of(logs, day.epochs);
  const errors::GeometricErrors model = model_of(nominal, logs, options.elements);
  const Series series = options.elements.empty() ? signals_of(model, changes, options.min_signal)
                                                 : series_of(model, changes);
  const std::vector<Number> numbers = determined_numbers(series, model, nominal);

  const std::vector<std::string> logged = identification::common_sensors(logs);
  const MatrixXd logged_dT_K = identification::temperature_rise_K(logs, day.epochs, logged);
  day.sensors = options.sensors;
  if (day.sensors.empty()) {
    day.chosen = {logged, choice_of(series, numbers, logged, logged_dT_K, options.choice)};
    for (const int i : day.chosen->choice.chosen) day.sensors.push_back(logged[std::size_t(i)]);
  }
  day.dT_K = logged_dT_K(Eigen::all, identification::sensor_columns(day.sensors, logged));
  day.margin = options.margin;
  const identification::ThermalData warmed{
      day.sensors, day.dT_K, {}, std::vector<int>(day.epochs.size(), 0)};
  for (const Number& number : numbers) {
    const identification::ThermalFit fitted = fit_of(number, series, warmed, options.margin);
    result.belief.terms.push_back({number.name, number.slope, *fitted.model});
    day.terms.push_back({number.name, number.slope, series.value.col(number.column),
                         series.sigma.col(number.column), *fitted.regression});
  }
  result.confounded = series.confounded;
  result.warnings = warnings_of(day);
  return result;
}

}  // namespace abbe::sim
