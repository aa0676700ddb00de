#include "sim/report/identify_json.h"

#include <nlohmann/json.hpp>

#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/report/identified_figures.h"
#include "sim/report/sensor_choices_json.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

Json optional_json(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json numbers_json(const errors::GeometricErrors& belief) {
  Json numbers = Json::array();
  for (const NumberFigure& one : number_figures(belief))
    numbers.push_back({{"name", one.name},
                       {"unit", one.unit},
                       {"value", one.value},
                       {"standard_uncertainty", optional_json(one.standard_uncertainty)}});
  return numbers;
}

Json confounded_json(const std::vector<errors::identification::Confounded>& list) {
  Json result = Json::array();
  for (const auto& one : list) {
    Json with = Json::object();
    for (const auto& [name, share] : one.with) with[name] = share;
    result.push_back({{"name", one.name}, {"hidden_by", with}});
    if (one.standard_deviation)
      result.back()["standard_deviation"] =
          *one.standard_deviation / errors::identification::shown_unit(one.name);
  }
  return result;
}

/// What every method reports, confounded and numbers.
void add_findings(Json& report, const Identified& identified) {
  report["confounded"] = confounded_json(identified.confounded);
  report["numbers"] = numbers_json(identified.belief);
}

void add(Json& report, const Identified& identified, const ChainFit& fit) {
  if (fit.orders) report["orders"] = *fit.orders;
  report["method"] = method_of(identified);
  report["unknowns"] = fit.unknowns;
  report["found"] = identified.belief.covariance.of.size();
  report["reduced_chi_square"] = fit.reduced_chi_square;
  report["degrees_of_freedom"] = fit.degrees_of_freedom;
  report["condition"] = fit.condition;
  Json outliers = Json::array();
  for (const ChainFit::Outlier& one : fit.outliers)
    outliers.push_back(
        {{"file", one.file.string()}, {"row", one.row}, {"residual_sd", one.residual_sd}});
  report["outliers"] = outliers;
  add_findings(report, identified);
  report["assumptions"] = identified.assumptions;
  report["warnings"] = identified.warnings;
}

void add(Json& report, const Identified& identified, const StepDiagonalFit& fit) {
  report["method"] = method_of(identified);
  report["found"] = identified.belief.covariance.of.size();
  report["reduced_chi_square"] = fit.reduced_chi_square;
  add_findings(report, identified);
  report["warnings"] = identified.warnings;
  if (!fit.trend) return;
  Json list = Json::array();
  for (const TrendFigures& one : trend_figures(fit)) {
    Json per_K = Json::object(), sigma = Json::object();
    for (std::size_t k = 0; k < fit.sensors.size(); ++k) {
      per_K[fit.sensors[k]] = one.per_K[Index(k)];
      if (one.standard_uncertainty.size() > 0)
        sigma[fit.sensors[k]] = one.standard_uncertainty[Index(k)];
    }
    list.push_back({{"name", one.name},
                    {"unit", one.unit},
                    {"per_K", per_K},
                    {"standard_uncertainty", sigma}});
  }
  report["per_K"] = list;
}

Json axis_json(const CompositeAxis& axis, const std::vector<std::string>& sensors) {
  const errors::identification::CompositeFit& fit = axis.fit;
  Json slopes = Json::array(), per_K = Json::object(), error = Json::object(),
       cold_C = Json::object();
  for (Index i = 0; i < fit.slope.size(); ++i)
    slopes.push_back({{"start", fit.later[std::size_t(i)] + 1},
                      {"slope_um_per_m", fit.slope[i] / um_per_m},
                      {"standard_error", fit.slope_error[i] / um_per_m},
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

void add(Json& report, const Identified& identified, const CompositeFits& fit) {
  report["method"] = method_of(identified);
  add_findings(report, identified);
  report["composite"] = Json::array();
  for (const CompositeAxis& axis : fit.axes)
    report["composite"].push_back(axis_json(axis, fit.sensors));
  report["beliefs"] = {{"identified", identified.files.belief.string()},
                       {"thermal", identified.files.thermal->string()}};
  report["warnings"] = identified.warnings;
}

Json term_json(const RegressedTerm& term, const std::vector<std::string>& sensors) {
  const TermFigures figures = term_figures(term);
  Json per_K = Json::object();
  for (std::size_t k = 0; k < sensors.size(); ++k)
    per_K[sensors[k]] = {{"value", figures.per_K[Index(k)]},
                         {"standard_error", figures.standard_error[Index(k)]},
                         {"vif", term.regression.vif[Index(k)]}};
  return {{"name", figures.name},
          {"unit", figures.unit},
          {"range", figures.range},
          {"standard_uncertainty_at_an_epoch", figures.standard_uncertainty},
          {"constant", figures.constant},
          {"per_K", per_K},
          {"r_squared", term.regression.r_squared},
          {"residual_sd", figures.residual_sd},
          {"at_epochs", std::vector<double>(figures.at_epochs.begin(), figures.at_epochs.end())}};
}

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

void add(Json& report, const Identified& identified, const ThermalDay& day) {
  report["method"] = method_of(identified);
  add_findings(report, identified);
  report["thermal"] = day_json(day);
  report["warnings"] = identified.warnings;
}

}  // namespace

Json to_json(const Identified& identified) {
  Json sources = Json::array();
  for (const ReadingsSource& one : identified.sources)
    sources.push_back({{"file", one.file.string()},
                       {"instrument", one.instrument},
                       {"kind", one.kind},
                       {"readings", one.readings},
                       {"set_ups", one.set_ups},
                       {"hours", one.duration_s / 3600.0}});
  Json report{{"machine", machine_of(identified)},
              {"readings", sources},
              {"count", readings_of(identified)},
              {"hours", hours_of(identified)}};
  std::visit([&](const auto& fit) { add(report, identified, fit); }, identified.fit);
  return report;
}

}  // namespace abbe::sim
