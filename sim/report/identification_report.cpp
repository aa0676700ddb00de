#include "sim/report/identification_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "errors/coefficients.h"
#include "errors/identification/model.h"
#include "kinematics/axes.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/calibration/calibration.h"
#include "sim/files/program_file.h"
#include "sim/readings/belief_file.h"
#include "sim/report/sensor_choice_report.h"
#include "sim/scene/error_tables.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

using Eigen::Index;

constexpr double per_metre = 1000.0;  // mm: slopes of a day are stated over one metre

}  // namespace

std::string machine_code(const IdentificationResult& identified) {
  return kinematics::to_string(kinematics::chain_topology(identified.nominal.joints()));
}

std::string method_text(const IdentificationResult& identified) {
  constexpr std::array names{
      "least squares on the exact chain", "step diagonal as published: 12 elements of translation",
      "composite: cold curve, and slopes regressed on temperatures",
      "thermal: elements at every start on the exact chain, regressed on temperatures"};
  static_assert(names.size() == std::variant_size_v<decltype(IdentificationResult::fit)>);
  return names.at(identified.fit.index());
}

std::size_t reading_count(const IdentificationResult& identified) {
  std::size_t count = 0;
  for (const ReadingsSource& source : identified.sources) count += source.readings;
  return count;
}

double machine_hours(const IdentificationResult& identified) {
  double hours = 0.0;
  for (const ReadingsSource& source : identified.sources) hours += source.duration_s / 3600.0;
  return hours;
}

std::vector<ParameterEstimate> parameter_estimates(const errors::GeometricErrors& belief) {
  std::map<std::string, double> sigma;
  const errors::Covariance& covariance = belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i)
    sigma[errors::name_of(covariance.of[i], belief.elements)] =
        std::sqrt(std::max(0.0, covariance.matrix(Index(i), Index(i))));
  std::vector<ParameterEstimate> estimates;
  const auto numbers = errors::coefficients(belief.elements);
  const Eigen::VectorXd values = errors::values(belief.elements);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const errors::ElementName& element = belief.elements[std::size_t(numbers[i].element)].name;
    const double unit = element.is_angle() ? units::urad : units::um;
    estimates.push_back({errors::name_of(numbers[i], belief.elements),
                         to_string(element),
                         element.is_angle() ? "urad" : "um",
                         values[Index(i)] / unit,
                         {}});
    const auto uncertainty = sigma.find(estimates.back().name);
    if (uncertainty != sigma.end())
      estimates.back().standard_uncertainty = uncertainty->second / unit;
  }
  return estimates;
}

TermEstimate term_estimate(const RegressedTerm& term) {
  const bool is_angle = term.name.is_angle();
  const double unit = term.slope ? um_per_m : is_angle ? units::urad : units::um;
  const double scale = (term.slope ? 1.0 / per_metre : 1.0) / unit;
  const errors::identification::Regression& regression = term.regression;
  TermEstimate estimate;
  estimate.name = name_of(term);
  estimate.unit = std::string(is_angle ? "urad" : "um") + (term.slope ? "/m" : "");
  estimate.at_epochs = scale * term.at_epochs;
  estimate.range = estimate.at_epochs.maxCoeff() - estimate.at_epochs.minCoeff();
  const Eigen::VectorXd sigma = scale * term.sigma;
  estimate.standard_uncertainty = sigma.mean();
  estimate.constant = regression.constant / unit;
  estimate.per_K = regression.beta / unit;
  estimate.standard_error = regression.standard_error.tail(regression.beta.size()) / unit;
  estimate.residual_sd = regression.residual_sd / unit;
  return estimate;
}

std::vector<TrendEstimate> trend_estimates(const StepDiagonalFit& fit) {
  std::vector<TrendEstimate> estimates;
  if (!fit.trend) return estimates;
  for (std::size_t v = 0; v < fit.trend->names.size(); ++v) {
    const bool is_length = fit.trend->is_length[v];
    // Slopes are in um/m, squareness is in urad; both are 1e-6.
    const double unit = is_length ? units::um : um_per_m;
    estimates.push_back({fit.trend->names[v],
                         is_length ? "um/K" : "um/m/K or urad/K",
                         fit.trend->per_K.row(Index(v)) / unit,
                         {}});
    if (fit.trend->per_K_sigma.size() > 0)
      estimates.back().standard_uncertainty = fit.trend->per_K_sigma.row(Index(v)) / unit;
  }
  return estimates;
}

namespace {

using errors::identification::coefficient_element;

/// Returns a line for every element with its coefficients and their standard uncertainties.
std::string numbers_text(const errors::GeometricErrors& belief) {
  if (belief.elements.empty()) return "";
  std::string text = "\nelements in um and urad, with standard uncertainties", element;
  for (const ParameterEstimate& parameter : parameter_estimates(belief)) {
    const std::optional<double>& u = parameter.standard_uncertainty;
    if ((u ? *u : std::abs(parameter.value)) <= 0.0) continue;  // zero by convention
    if (parameter.element != element) {
      element = parameter.element;
      text += fmt::format("\n{:<5}", element);
    }
    const std::string index =
        parameter.name.size() > element.size() ? parameter.name.substr(element.size()) + " " : "";
    text += fmt::format("  {}{:.3f}", index, parameter.value);
    if (u) text += fmt::format(" ({:.2g})", *u);
  }
  return text + "\n";
}

/// Returns the coefficients that hide another one. Unknowns of set-ups (zeros and positions) are
/// only counted.
std::string confounders_text(const errors::identification::ConfoundedCoefficient& coefficient) {
  std::string text;
  std::set<std::string> set_ups;  // several starts use the same names
  for (const auto& [other, amount] : coefficient.with) {
    if (other.find(": ") != std::string::npos)
      set_ups.insert(other);
    else
      text += fmt::format("{}{:.4g} {}", text.empty() ? "" : ", ", amount, escaped(other));
  }
  if (!set_ups.empty())
    text += fmt::format("{}{} unknown{} of set-ups", text.empty() ? "" : " and ", set_ups.size(),
                        set_ups.size() > 1 ? "s" : "");
  return text;
}

/// Returns the standard uncertainty of a coefficient and, in brackets, the typical deviation of
/// machines: "ECS cos 1 to 500 urad (10)".
std::string weak_parameter_text(const errors::identification::ConfoundedCoefficient& coefficient) {
  const double unit = errors::identification::display_unit(coefficient.name);
  return fmt::format(
      "{} to {:.2g} {} ({:.2g})", escaped(coefficient.name), *coefficient.standard_deviation / unit,
      unit == units::um ? "um" : "urad",
      errors::identification::typical_deviation(coefficient_element(coefficient.name)) / unit);
}

/// Returns the coefficients that were not identified: first those hidden by others, then those
/// determined too poorly, then, counted by element, those on which no reading depends.
std::string confounded_text(
    const std::vector<errors::identification::ConfoundedCoefficient>& confounded) {
  std::map<std::string, int> unobservable;
  std::string text, weak;
  for (const auto& coefficient : confounded)
    if (coefficient.standard_deviation)
      weak += (weak.empty() ? "" : ", ") + weak_parameter_text(coefficient);
    else if (coefficient.with.empty())
      ++unobservable[coefficient_element(escaped(coefficient.name))];
    else
      text += fmt::format("\n{} is left at 0: one unit of it gives the same readings as {}",
                          escaped(coefficient.name), confounders_text(coefficient));
  if (!weak.empty())
    text +=
        "\nleft at 0, because their uncertainty is far larger than the typical deviation of new "
        "machines (in brackets): " +
        weak;
  std::string names;
  for (const auto& [element, count] : unobservable)
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", element, count);
  if (!names.empty()) text += "\nunobservable, omitted (number of coefficients): " + names;
  return text;
}

/// Returns the composite fit of one axis: its cold curve, the slopes of the starts, and the slopes
/// by temperature.
std::string composite_axis_text(const CompositeAxis& axis,
                                const std::vector<std::string>& sensors) {
  const errors::identification::CompositeFit& fit = axis.fit;
  std::string text =
      fmt::format("\n{}: cold curve of start 1 at {:.2f} h, RMS {:.3f} um about the fit\n",
                  axis.axis, axis.cold_s / 3600.0, fit.rms / units::um);
  for (std::size_t k = 0; k < sensors.size(); ++k)
    text += fmt::format("  dT = 0 at                    {:>9.2f} C  {}\n", axis.cold_C[Index(k)],
                        escaped(sensors[k]));
  for (Index i = 0; i < fit.slope.size(); ++i)
    text += fmt::format("  slope from start {:<11} {:>9.4f} ({:.2g}) um/m\n",
                        fit.warm_runs[std::size_t(i)] + 1, fit.slope[i] / um_per_m,
                        fit.slope_standard_error[i] / um_per_m);
  for (std::size_t k = 0; k < sensors.size(); ++k)
    text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m/K\n", escaped(sensors[k]),
                        fit.thermal[Index(k)] / um_per_m,
                        fit.slope_fit.standard_error[Index(k)] / um_per_m);
  if (axis.with_constant)
    text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m, from the later starts only\n",
                        "slope at dT = 0", axis.with_constant->constant / um_per_m,
                        axis.with_constant->standard_error[0] / um_per_m);
  return text;
}

/// Returns the results of a composite belief and the scene keys for its two files.
std::string fit_text(const IdentificationResult& identified, const CompositeFits& fit) {
  std::string text;
  for (const CompositeAxis& axis : fit.axes) text += composite_axis_text(axis, fit.sensors);
  return text + fmt::format("[belief] identified: {}\n[belief] thermal: {}\n",
                            escaped(identified.files.belief.string()),
                            escaped(identified.files.thermal->string()));
}

/// Returns the thermal terms of a day with the trained range of every sensor.
std::string fit_text(const IdentificationResult&, const ThermalDay& day) {
  std::string text = fmt::format("\nthermal terms, from {} epochs\n", day.epochs.size());
  for (const RegressedTerm& term : day.terms) {
    const TermEstimate estimate = term_estimate(term);
    text +=
        fmt::format("{:<12} range {:.3f} {}, residual {:.2g} (R^2 {:.3f})\n", estimate.name,
                    estimate.range, estimate.unit, estimate.residual_sd, term.regression.r_squared);
    for (std::size_t k = 0; k < day.sensors.size(); ++k)
      text +=
          fmt::format("  {:<28} {:>9.4f} ({:.2g}) {}/K\n", escaped(day.sensors[k]),
                      estimate.per_K[Index(k)], estimate.standard_error[Index(k)], estimate.unit);
  }
  for (std::size_t k = 0; k < day.sensors.size(); ++k)
    text += fmt::format("{:<30} trained from {:.2f} to {:.2f} K\n", escaped(day.sensors[k]),
                        day.dT_K.col(Index(k)).minCoeff(), day.dT_K.col(Index(k)).maxCoeff());
  return text;
}

/// Slope of a coefficient by the temperature of one sensor.
struct Trend {
  std::string name, sensor, unit;
  double value = 0.0;
  std::optional<double> u;  ///< standard uncertainty; empty if there are no more starts than
                            ///< unknowns
  /// Returns the ratio of the value to its standard uncertainty; infinite if that is not known.
  double significance() const {
    return !u ? HUGE_VAL : (*u > 0.0 ? std::abs(value) / *u : (value != 0.0 ? HUGE_VAL : 0.0));
  }
};

/// Returns the slopes of every coefficient by every sensor.
std::vector<Trend> sensor_trends(const StepDiagonalFit& fit) {
  std::vector<Trend> trends;
  for (const TrendEstimate& estimate : trend_estimates(fit))
    for (std::size_t k = 0; k < fit.sensors.size(); ++k) {
      trends.push_back(
          {estimate.name, escaped(fit.sensors[k]), estimate.unit, estimate.per_K[Index(k)], {}});
      if (estimate.standard_uncertainty.size() > 0)
        trends.back().u = estimate.standard_uncertainty[Index(k)];
    }
  return trends;
}

/// Returns the most significant trends and the number of the others.
std::string trends_text(const StepDiagonalFit& fit) {
  constexpr std::size_t max_shown = 12;
  std::vector<Trend> trends = sensor_trends(fit);
  const std::size_t count = trends.size(), shown_count = std::min(count, max_shown);
  if (count > max_shown)
    std::stable_sort(trends.begin(), trends.end(), [](const Trend& a, const Trend& b) {
      return std::pair(a.significance(), std::abs(a.value)) >
             std::pair(b.significance(), std::abs(b.value));
    });
  std::string text;
  for (std::size_t i = 0; i < shown_count; ++i) {
    const Trend& trend = trends[i];
    text += fmt::format("\n{:<12} {:>10.4f} ({}) {} by {}", trend.name, trend.value,
                        trend.u ? fmt::format("{:.2g}", *trend.u) : "-", trend.unit, trend.sensor);
  }
  if (shown_count == count) return text;
  const double max_significance = trends[shown_count].significance();
  return text + fmt::format("\nand {} more temperature trends{}; all are in the report",
                            count - shown_count,
                            std::isfinite(max_significance)
                                ? fmt::format(", each at most {:.3g} times its "
                                              "standard uncertainty",
                                              max_significance)
                                : "");
}

/// Returns the trends and the chi-square of a step diagonal.
std::string fit_text(const IdentificationResult&, const StepDiagonalFit& fit) {
  return trends_text(fit) + fmt::format("\nreduced chi-square {:.3f}", fit.reduced_chi_square);
}

/// Returns the number of outliers and the chi-square of a fit on the exact chain.
std::string fit_text(const IdentificationResult&, const ChainFit& fit) {
  std::string text;
  if (!fit.outliers.empty())
    text = fmt::format("\n{} readings rejected as outliers; they are in the report",
                       fit.outliers.size());
  return text + fmt::format("\nreduced chi-square {:.3f}", fit.reduced_chi_square);
}

}  // namespace

std::string identification_text(const IdentificationResult& identified) {
  std::string text = fmt::format("machine {}\n\n{:>10} {:>9} {:>9}   file\n",
                                 escaped(machine_code(identified)), "readings", "set-ups", "hours");
  for (const ReadingsSource& source : identified.sources)
    text += fmt::format("{:>10} {:>9} {:>9.2f}   {}\n", source.readings, source.set_ups,
                        source.duration_s / 3600.0, escaped(source.file.string()));
  text += numbers_text(identified.belief) + confounded_text(identified.confounded);
  text += std::visit([&](const auto& fit) { return fit_text(identified, fit); }, identified.fit);
  text += fmt::format("\n{:.1f} hours on a real machine\n", machine_hours(identified));
  for (const std::string& assumption : identified.assumptions)
    text += "assumed: " + escaped(assumption) + "\n";
  for (const std::string& warning : identified.warnings)
    text += "warning: " + escaped(warning) + "\n";
  return text;
}

namespace {

using Json = nlohmann::ordered_json;

Json optional_json(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

/// Returns all coefficients of a belief with their standard uncertainties.
Json numbers_json(const errors::GeometricErrors& belief) {
  Json numbers = Json::array();
  for (const ParameterEstimate& parameter : parameter_estimates(belief))
    numbers.push_back({{"name", parameter.name},
                       {"unit", parameter.unit},
                       {"value", parameter.value},
                       {"standard_uncertainty", optional_json(parameter.standard_uncertainty)}});
  return numbers;
}

/// Returns the coefficients that were not identified, with those that hide them.
Json confounded_json(const std::vector<errors::identification::ConfoundedCoefficient>& confounded) {
  Json list = Json::array();
  for (const auto& coefficient : confounded) {
    Json hidden_by = Json::object();
    for (const auto& [name, amount] : coefficient.with) hidden_by[name] = amount;
    list.push_back({{"name", coefficient.name}, {"hidden_by", hidden_by}});
    if (coefficient.standard_deviation)
      list.back()["standard_deviation"] =
          *coefficient.standard_deviation / errors::identification::display_unit(coefficient.name);
  }
  return list;
}

/// Adds the results that all methods have: confounded coefficients and all estimates.
void add_common_results(Json& report, const IdentificationResult& identified) {
  report["confounded"] = confounded_json(identified.confounded);
  report["numbers"] = numbers_json(identified.belief);
}

/// Adds the results of a fit on the exact chain.
void add(Json& report, const IdentificationResult& identified, const ChainFit& fit) {
  if (fit.orders) report["orders"] = *fit.orders;
  report["method"] = method_text(identified);
  report["unknowns"] = fit.unknowns;
  report["found"] = identified.belief.covariance.of.size();
  report["reduced_chi_square"] = fit.reduced_chi_square;
  report["degrees_of_freedom"] = fit.degrees_of_freedom;
  report["condition"] = fit.condition;
  Json outliers = Json::array();
  for (const ChainFit::Outlier& outlier : fit.outliers)
    outliers.push_back({{"file", outlier.file.string()},
                        {"row", outlier.row},
                        {"residual_sd", outlier.residual_sd}});
  report["outliers"] = outliers;
  add_common_results(report, identified);
  report["assumptions"] = identified.assumptions;
  report["warnings"] = identified.warnings;
}

/// Adds the results of the published step-diagonal method.
void add(Json& report, const IdentificationResult& identified, const StepDiagonalFit& fit) {
  report["method"] = method_text(identified);
  report["found"] = identified.belief.covariance.of.size();
  report["reduced_chi_square"] = fit.reduced_chi_square;
  add_common_results(report, identified);
  report["warnings"] = identified.warnings;
  if (!fit.trend) return;
  Json list = Json::array();
  for (const TrendEstimate& estimate : trend_estimates(fit)) {
    Json per_K = Json::object(), sigma = Json::object();
    for (std::size_t k = 0; k < fit.sensors.size(); ++k) {
      per_K[fit.sensors[k]] = estimate.per_K[Index(k)];
      if (estimate.standard_uncertainty.size() > 0)
        sigma[fit.sensors[k]] = estimate.standard_uncertainty[Index(k)];
    }
    list.push_back({{"name", estimate.name},
                    {"unit", estimate.unit},
                    {"per_K", per_K},
                    {"standard_uncertainty", sigma}});
  }
  report["per_K"] = list;
}

/// Returns the composite fit of one axis. Temperature changes dT count from start 1.
Json composite_axis_json(const CompositeAxis& axis, const std::vector<std::string>& sensors) {
  const errors::identification::CompositeFit& fit = axis.fit;
  Json slopes = Json::array(), per_K = Json::object(), error = Json::object(),
       cold_C = Json::object();
  for (Index i = 0; i < fit.slope.size(); ++i)
    slopes.push_back({{"start", fit.warm_runs[std::size_t(i)] + 1},
                      {"slope_um_per_m", fit.slope[i] / um_per_m},
                      {"standard_error", fit.slope_standard_error[i] / um_per_m},
                      {"offset_um", fit.offset[i] / units::um}});
  for (std::size_t k = 0; k < sensors.size(); ++k) {
    per_K[sensors[k]] = fit.thermal[Index(k)] / um_per_m;
    error[sensors[k]] = fit.slope_fit.standard_error[Index(k)] / um_per_m;
    cold_C[sensors[k]] = axis.cold_C[Index(k)];
  }
  Json json{{"axis", std::string(1, axis.axis)},
            {"zero_of_dT", "start 1"},
            {"zero_of_dT_h", axis.cold_s / 3600.0},
            {"zero_of_dT_C", cold_C},
            {"slopes", slopes},
            {"slope_um_per_m_K", per_K},
            {"standard_error_um_per_m_K", error},
            {"rms_um", fit.rms / units::um},
            {"slope_at_zero_of_dT_um_per_m", nullptr}};
  if (axis.with_constant)
    json["slope_at_zero_of_dT_um_per_m"] = {
        {"value", axis.with_constant->constant / um_per_m},
        {"standard_error", axis.with_constant->standard_error[0] / um_per_m}};
  return json;
}

/// Adds the results of a composite belief with its two files.
void add(Json& report, const IdentificationResult& identified, const CompositeFits& fit) {
  report["method"] = method_text(identified);
  add_common_results(report, identified);
  report["composite"] = Json::array();
  for (const CompositeAxis& axis : fit.axes)
    report["composite"].push_back(composite_axis_json(axis, fit.sensors));
  report["beliefs"] = {{"identified", identified.files.belief.string()},
                       {"thermal", identified.files.thermal->string()}};
  report["warnings"] = identified.warnings;
}

/// Returns a thermal term. A variance inflation factor (vif) far above 1 means that the
/// temperatures of the sensors are nearly dependent.
Json term_json(const RegressedTerm& term, const std::vector<std::string>& sensors) {
  const TermEstimate estimate = term_estimate(term);
  Json per_K = Json::object();
  for (std::size_t k = 0; k < sensors.size(); ++k)
    per_K[sensors[k]] = {{"value", estimate.per_K[Index(k)]},
                         {"standard_error", estimate.standard_error[Index(k)]},
                         {"vif", term.regression.vif[Index(k)]}};
  return {{"name", estimate.name},
          {"unit", estimate.unit},
          {"range", estimate.range},
          {"standard_uncertainty_at_an_epoch", estimate.standard_uncertainty},
          {"constant", estimate.constant},
          {"per_K", per_K},
          {"r_squared", term.regression.r_squared},
          {"residual_sd", estimate.residual_sd},
          {"at_epochs", std::vector<double>(estimate.at_epochs.begin(), estimate.at_epochs.end())}};
}

/// Returns the thermal terms of a day. The time of an epoch is its middle.
Json day_json(const ThermalDay& day) {
  Json json, trained = Json::object(), terms = Json::array(), hours = Json::array();
  if (day.chosen) json["choice"] = choice_json(day.chosen->choice, day.chosen->logged);
  for (std::size_t k = 0; k < day.sensors.size(); ++k)
    trained[day.sensors[k]] = {day.dT_K.col(Index(k)).minCoeff(),
                               day.dT_K.col(Index(k)).maxCoeff()};
  for (const RegressedTerm& term : day.terms) terms.push_back(term_json(term, day.sensors));
  for (const auto& epoch : day.epochs) hours.push_back(0.5 * (epoch.from_s + epoch.to_s) / 3600.0);
  json["sensors"] = day.sensors;
  json["trained_K"] = trained;
  json["margin"] = day.margin;
  json["terms"] = terms;
  json["epochs_h"] = hours;
  return json;
}

/// Adds the results of an identification over a day.
void add(Json& report, const IdentificationResult& identified, const ThermalDay& day) {
  report["method"] = method_text(identified);
  add_common_results(report, identified);
  report["thermal"] = day_json(day);
  report["warnings"] = identified.warnings;
}

}  // namespace

Json to_json(const IdentificationResult& identified) {
  Json sources = Json::array();
  for (const ReadingsSource& source : identified.sources)
    sources.push_back({{"file", source.file.string()},
                       {"instrument", source.instrument},
                       {"kind", source.kind},
                       {"readings", source.readings},
                       {"set_ups", source.set_ups},
                       {"hours", source.duration_s / 3600.0}});
  Json report{{"machine", machine_code(identified)},
              {"readings", sources},
              {"count", reading_count(identified)},
              {"hours", machine_hours(identified)}};
  std::visit([&](const auto& fit) { add(report, identified, fit); }, identified.fit);
  return report;
}

namespace {

using errors::identification::display_unit;
using Comments = std::vector<std::string>;

std::string origin_text() { return "identified from readings by abbe " + version() + "."; }

/// Returns machine, number of readings and method as a sentence for the head of a belief file.
std::string basis_text(const IdentificationResult& identified) {
  return fmt::format("Machine {}, {} readings; {}.", machine_code(identified),
                     reading_count(identified), method_text(identified));
}

void add_sources(Comments& comments, const IdentificationResult& identified) {
  for (const ReadingsSource& source : identified.sources)
    comments.push_back("from " + to_toml_value(source.file.string()));
}

/// Returns the belief with the unidentified curves, whose values are zero, appended.
errors::GeometricErrors completed(const IdentificationResult& identified) {
  errors::GeometricErrors errors = identified.belief;
  for (const errors::Element& element : identified.undetermined_curves) {
    const auto same = std::ranges::find(errors.elements, element.name, &errors::Element::name);
    if (same == errors.elements.end())
      errors.elements.push_back(element);
    else
      same->curves.insert(same->curves.end(), element.curves.begin(), element.curves.end());
  }
  return errors;
}

/// Returns the unidentified coefficients with those that hide them. Unknowns of set-ups are left
/// out, since they are not properties of the machine.
std::vector<UnidentifiedNumber> unidentified_numbers(const IdentificationResult& identified) {
  std::vector<UnidentifiedNumber> numbers;
  for (const auto& confounded : identified.confounded) {
    if (confounded.name.find(": ") != std::string::npos) continue;
    UnidentifiedNumber number{confounded.name, {}};
    for (const auto& [other, amount] : confounded.with)
      if (other.find(": ") == std::string::npos)
        number.hidden_by.emplace_back(other,
                                      amount * display_unit(confounded.name) / display_unit(other));
    numbers.push_back(std::move(number));
  }
  return numbers;
}

/// Returns the errors file of a belief. Its head lists the coefficients that were not identified,
/// so that their zeros are not mistaken for results.
std::string geometric_text(const IdentificationResult& identified) {
  Comments comments{"Belief about a machine, " + origin_text(), basis_text(identified)};
  add_sources(comments, identified);
  for (const auto& coefficient : identified.confounded)
    comments.push_back("not identified by these readings: " + coefficient.name);
  for (const std::string& assumption : identified.assumptions)
    comments.push_back("assumed: " + assumption);
  std::string text;
  for (const std::string& comment : comments) text += "# " + comment + "\n";
  text += fmt::format("machine = {}\n", to_toml_value(machine_code(identified)));
  text += unidentified_lines(unidentified_numbers(identified));
  return text + errors_file_text(completed(identified), identified.nominal.joints());
}

/// Returns the thermal belief of a day. Its head states the trained range, outside of which the
/// belief is held constant.
std::string day_text(const IdentificationResult& identified, const ThermalDay& day) {
  Comments comments{"Thermal errors of a machine as functions of temperatures; " + origin_text(),
                    basis_text(identified),
                    "Temperature changes are relative to the first row that a control reads."};
  add_sources(comments, identified);
  for (std::size_t k = 0; k < day.sensors.size(); ++k)
    comments.push_back(fmt::format(
        "trained: {} from {:.2f} to {:.2f} K, held constant {:.0f} % beyond", day.sensors[k],
        day.dT_K.col(Index(k)).minCoeff(), day.dT_K.col(Index(k)).maxCoeff(), 100.0 * day.margin));
  for (const RegressedTerm& term : day.terms) {
    const TermEstimate estimate = term_estimate(term);
    comments.push_back(
        fmt::format("{}: range {:.3g} {}, residual after regression on these temperatures {:.2g} "
                    "(standard deviation)",
                    estimate.name, estimate.range, estimate.unit, estimate.residual_sd));
  }
  return to_text(identified.thermal, comments);
}

}  // namespace

std::string belief_file_text(const IdentificationResult& identified) {
  const auto* day = std::get_if<ThermalDay>(&identified.fit);
  return day ? day_text(identified, *day) : geometric_text(identified);
}

std::string thermal_half_file_text(const IdentificationResult& composite) {
  const auto& fit = std::get<CompositeFits>(composite.fit);
  Comments comments{
      "Slopes of positioning as functions of temperatures, the thermal half of a composite "
      "belief; " +
          origin_text(),
      "The cold half is " + composite.files.belief.filename().string() +
          ", which contains the cold slope; these slopes are zero at the temperatures of its "
          "start."};
  for (const CompositeAxis& axis : fit.axes) {
    std::string cold;
    for (std::size_t k = 0; k < fit.sensors.size(); ++k)
      cold += fmt::format("{}{} {:.2f} C", cold.empty() ? "" : ", ", fit.sensors[k],
                          axis.cold_C[Index(k)]);
    comments.push_back(
        fmt::format("{}: cold at start 1, {:.2f} h: {}", axis.axis, axis.cold_s / 3600.0, cold));
  }
  add_sources(comments, composite);
  return to_text(composite.thermal, comments);
}

}  // namespace abbe::sim
