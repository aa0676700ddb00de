#include "sim/report/identification_page.h"

#include <cmath>

#include <fmt/format.h>

#include "errors/element.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"
#include "sim/files/output.h"
#include "sim/report/figures_page.h"
#include "sim/report/identification_report.h"

#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

#if ABBE_RENDER
namespace {

using errors::identification::CurveReadings;

/// Returns the panel of one identified curve with its readings. Its 95 % band is 1.96 standard
/// deviations to either side.
render::Panel curve_picture_panel(const CurveReadings& curve, const kinematics::Chain& nominal) {
  const bool is_rotational = curve.element.is_angle();
  const double unit = is_rotational ? units::urad : units::um;
  const int joint = errors::axis_joint(curve.element.axis, nominal, "a belief");
  const bool is_slide = nominal.joints()[std::size_t(joint)].motion == kinematics::Motion::Linear;
  const double position_unit = is_slide ? 1.0 : units::deg;
  render::Panel panel{to_string(curve.element),
                      fmt::format("{} / {}", curve.element.axis, is_slide ? "mm" : "deg"),
                      is_rotational ? "µrad" : "µm",
                      {},
                      {}};
  if (curve.reading.size() > 0)
    panel.series.push_back({"readings",
                            curve.reading_q / position_unit,
                            curve.reading / unit,
                            {},
                            {},
                            render::CurveStyle::Points,
                            1});
  panel.series.push_back({"identified, 95 % confidence", curve.q / position_unit,
                          curve.value / unit, (curve.value - 1.96 * curve.sigma) / unit,
                          (curve.value + 1.96 * curve.sigma) / unit, render::CurveStyle::Line, 0});
  return panel;
}

/// Returns file names without their folders, as many as fit on one line of the picture.
std::string file_names(const std::vector<std::filesystem::path>& files) {
  std::string names;
  for (std::size_t k = 0; k < files.size(); ++k) {
    const std::string name = files[k].filename().string();
    if (k > 0 && names.size() + name.size() > 140)
      return fmt::format("{} and {} more", names, files.size() - k);
    names += (k > 0 ? ", " : "") + name;
  }
  return names;
}

}  // namespace

void write_curves_picture(const ResultFile& file, const std::vector<CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings) {
  std::vector<render::Panel> panels;
  for (const CurveReadings& curve : curves) panels.push_back(curve_picture_panel(curve, nominal));
  if (panels.empty()) return;
  render::GridOptions options;
  options.title = "identified elements and the readings that determine them";
  options.caption = {file_names(readings)};
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_grid(temporary, panels, options);
  });
}
#else
void write_curves_picture(const ResultFile&,
                          const std::vector<errors::identification::CurveReadings>&,
                          const kinematics::Chain&, const std::vector<std::filesystem::path>&) {}
#endif

namespace {

using errors::identification::ConfoundedCoefficient;
using nlohmann::ordered_json;

// More readings of one element could not be told apart in its chart and would slow the page.
constexpr Eigen::Index max_curve_readings = 1500;

/// Returns a unit for display: "um" becomes "µm", "urad" becomes "µrad".
std::string page_unit(const std::string& unit) {
  return unit == "um" ? "µm" : unit == "urad" ? "µrad" : unit;
}

/// Returns values rounded to 1e-4 of the largest, which makes the page smaller and is finer than
/// the resolution of a chart. NaN becomes null.
ordered_json rounded_list(const Eigen::VectorXd& values) {
  const double max_abs = values.size() > 0 ? values.cwiseAbs().maxCoeff() : 0.0;
  const double step = max_abs > 0.0 ? std::pow(10.0, std::floor(std::log10(max_abs)) - 4.0) : 1.0;
  ordered_json list = ordered_json::array();
  for (const double value : values) {
    // Parsing the short text avoids the digits that a binary number would be written with.
    if (std::isfinite(value))
      list.push_back(ordered_json::parse(fmt::format("{:.6g}", std::round(value / step) * step)));
    else
      list.push_back(nullptr);
  }
  return list;
}

/// Returns the table of the figures of the fit. Each method has some of them.
ordered_json findings_block(const IdentificationResult& identified) {
  ordered_json rows = ordered_json::array();
  const auto add = [&](const char* key, const ordered_json& value) {
    rows.push_back(ordered_json::array({label_text(key), value}));
  };
  const std::size_t found = identified.belief.covariance.of.size();
  add("fit_count", reading_count(identified));
  add("fit_hours", machine_hours(identified));
  if (const auto* fit = std::get_if<ChainFit>(&identified.fit)) {
    add("fit_unknowns", fit->unknowns);
    add("fit_found", found);
    add("fit_reduced_chi_square", fit->reduced_chi_square);
    add("fit_degrees_of_freedom", fit->degrees_of_freedom);
    add("fit_condition", fit->condition);
  } else if (const auto* diagonals = std::get_if<StepDiagonalFit>(&identified.fit)) {
    add("fit_found", found);
    add("fit_reduced_chi_square", diagonals->reduced_chi_square);
  }
  return table_block("fit", label_text("fit_title"),
                     {{label_text("figure"), ""}, {label_text("value"), ""}}, rows);
}

/// Returns the table of readings files, with their residuals if the fit is not null.
ordered_json sources_block(const std::vector<ReadingsSource>& sources, const ChainFit* fit) {
  std::vector<PageColumn> columns{{label_text("file"), ""},    {label_text("instrument"), ""},
                                  {label_text("kind"), ""},    {label_text("fit_count"), ""},
                                  {label_text("set_ups"), ""}, {label_text("fit_hours"), ""}};
  if (fit) {
    columns.push_back({label_text("residual_rms"), ""});
    columns.push_back({label_text("residual_largest"), ""});
  }
  ordered_json rows = ordered_json::array();
  for (std::size_t k = 0; k < sources.size(); ++k) {
    const ReadingsSource& source = sources[k];
    ordered_json row =
        ordered_json::array({source.file.string(), source.instrument, source.kind, source.readings,
                             source.set_ups, source.duration_s / 3600.0});
    if (fit) {
      const Eigen::VectorXd& residual = fit->residual_sd[k];
      const bool has_residuals = residual.size() > 0;
      row.push_back(has_residuals
                        ? ordered_json(std::sqrt(residual.squaredNorm() / double(residual.size())))
                        : ordered_json());
      row.push_back(has_residuals ? ordered_json(residual.cwiseAbs().maxCoeff()) : ordered_json());
    }
    rows.push_back(row);
  }
  return table_block("readings", label_text("readings_title"), columns, rows);
}

/// Returns the coefficients that hide another one, such as "EX0C -1.00, EY0C 0.20".
std::string confounder_list(const ConfoundedCoefficient& confounded) {
  // Unknowns of set-ups have the same name in several starts; the report has the last of them.
  nlohmann::ordered_map<std::string, double> amounts;
  for (const auto& [name, amount] : confounded.with) amounts[name] = amount;
  std::string text;
  for (const auto& [name, amount] : amounts)
    text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", name, amount);
  return text;
}

/// Returns the table of all coefficients. The remark on a coefficient that the readings do not
/// determine names those that hide it.
ordered_json numbers_block(const IdentificationResult& identified) {
  const auto remark_on = [&](const ParameterEstimate& parameter) -> PageText {
    const auto confounded =
        std::ranges::find(identified.confounded, parameter.name, &ConfoundedCoefficient::name);
    if (confounded == identified.confounded.end())
      return parameter.standard_uncertainty ? PageText("") : label_text("not_found");
    const std::string confounders = confounder_list(*confounded);
    return confounders.empty() ? label_text("not_read")
                               : phrase({label_text("hidden_by"), " ", confounders});
  };
  ordered_json rows = ordered_json::array();
  for (const ParameterEstimate& parameter : parameter_estimates(identified.belief)) {
    const std::optional<double>& u = parameter.standard_uncertainty;
    rows.push_back(ordered_json::array(
        {parameter.name, page_unit(parameter.unit), parameter.value, number(u),
         u && *u > 0.0 ? ordered_json(std::abs(parameter.value) / *u) : ordered_json(),
         remark_on(parameter)}));
  }
  if (rows.empty()) return {};
  ordered_json block = table_block("numbers", label_text("numbers"),
                                   {{label_text("name"), ""},
                                    {label_text("unit"), ""},
                                    {label_text("value"), ""},
                                    {label_text("standard_uncertainty"), ""},
                                    {label_text("value_by_uncertainty"), ""},
                                    {label_text("remark"), ""}},
                                   rows);
  block["note"] = label_text("numbers_note");
  return block;
}

/// Returns the table of the coefficients that were not identified, with those that hide them.
ordered_json confounded_block(const std::vector<ConfoundedCoefficient>& confounded) {
  ordered_json rows = ordered_json::array();
  for (const ConfoundedCoefficient& coefficient : confounded) {
    const std::string confounders = confounder_list(coefficient);
    rows.push_back(ordered_json::array(
        {coefficient.name, confounders.empty() ? label_text("not_read") : PageText(confounders)}));
  }
  if (rows.empty()) return {};
  ordered_json block = table_block("confounded", label_text("confounded"),
                                   {{label_text("name"), ""}, {label_text("hidden_by"), ""}}, rows);
  block["note"] = label_text("confounded_note");
  return block;
}

/// Returns the table of the readings that were excluded as outliers, with their residuals.
ordered_json outliers_block(const ChainFit& fit) {
  if (fit.outliers.empty()) return {};
  ordered_json rows = ordered_json::array();
  for (const ChainFit::Outlier& outlier : fit.outliers)
    rows.push_back(ordered_json::array({outlier.file.string(), outlier.row, outlier.residual_sd}));
  return table_block(
      "outliers", label_text("outliers"),
      {{label_text("file"), ""}, {label_text("row"), ""}, {label_text("residual_sd"), ""}}, rows);
}

/// Returns the table of the orders that cross-validation chose.
ordered_json orders_block(const ChainFit& fit) {
  if (!fit.orders) return {};
  ordered_json rows = ordered_json::array();
  for (const auto& [name, order] : *fit.orders) rows.push_back(ordered_json::array({name, order}));
  return table_block("orders", label_text("orders"),
                     {{label_text("element"), ""}, {label_text("chosen_order"), ""}}, rows);
}

/// Adds a row for every sensor: the slope with its uncertainty.
/// @param uncertainties  empty if they are not known
void add_slopes(ordered_json& rows, const std::string& name, const std::string& unit,
                const std::vector<std::string>& sensors, const Eigen::VectorXd& slopes,
                const Eigen::VectorXd& uncertainties) {
  for (std::size_t k = 0; k < sensors.size(); ++k)
    rows.push_back(
        ordered_json::array({name, sensors[k], unit, slopes[Eigen::Index(k)],
                             uncertainties.size() > 0 ? ordered_json(uncertainties[Eigen::Index(k)])
                                                      : ordered_json()}));
}

/// Returns the table of the slopes of coefficients by temperature, which some of the methods
/// identify; null if there are none.
ordered_json sensor_slopes_block(const IdentificationResult& identified) {
  ordered_json rows = ordered_json::array();
  if (const auto* diagonals = std::get_if<StepDiagonalFit>(&identified.fit))
    for (const TrendEstimate& trend : trend_estimates(*diagonals))
      add_slopes(rows, trend.name, trend.unit, diagonals->sensors, trend.per_K,
                 trend.standard_uncertainty);
  if (const auto* composite = std::get_if<CompositeFits>(&identified.fit))
    for (const CompositeAxis& axis : composite->axes)
      add_slopes(rows, std::string(1, axis.axis), "µm/m/K", composite->sensors,
                 axis.fit.thermal / um_per_m, axis.fit.slope_fit.standard_error / um_per_m);
  if (const auto* day = std::get_if<ThermalDay>(&identified.fit))
    for (const RegressedTerm& term : day->terms) {
      const TermEstimate estimate = term_estimate(term);
      add_slopes(rows, estimate.name, page_unit(estimate.unit) + "/K", day->sensors, estimate.per_K,
                 estimate.standard_error);
    }
  if (rows.empty()) return {};
  return table_block("sensors", label_text("sensor_slopes"),
                     {{label_text("name"), ""},
                      {label_text("sensor"), ""},
                      {label_text("unit"), ""},
                      {label_text("slope_per_K"), ""},
                      {label_text("standard_uncertainty"), ""}},
                     rows);
}

/// Returns the charts of the slopes of a composite belief over its starts, with 1.96 standard
/// errors to either side.
ordered_json starts_block(const CompositeFits& composite) {
  ordered_json block = page_block("panels", "starts", label_text("slopes_by_start"));
  block["panels"] = ordered_json::array();
  for (const CompositeAxis& axis : composite.axes) {
    ordered_json x = ordered_json::array(), y = x, low = x, high = x;
    for (Eigen::Index i = 0; i < axis.fit.slope.size(); ++i) {
      const double value = axis.fit.slope[i] / um_per_m;
      const double band = 1.96 * (axis.fit.slope_standard_error[i] / um_per_m);
      x.push_back(axis.fit.warm_runs[std::size_t(i)] + 1);
      y.push_back(value);
      low.push_back(value - band);
      high.push_back(value + band);
    }
    ordered_json panel, series = chart_series(label_text("slope_with_band"), x, y, "both");
    series["low"] = low;
    series["high"] = high;
    panel["title"] = std::string(1, axis.axis);
    panel["x"] = label_text("start");
    panel["y"] = phrase({label_text("slope"), " / µm/m"});
    panel["series"] = ordered_json::array({series});
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the charts of the thermal contribution to the elements over a day.
ordered_json day_block(const ThermalDay& day) {
  ordered_json block = page_block("panels", "day", label_text("terms_by_hour"));
  block["panels"] = ordered_json::array();
  ordered_json hours = ordered_json::array();
  for (const auto& epoch : day.epochs) hours.push_back(0.5 * (epoch.from_s + epoch.to_s) / 3600.0);
  for (const RegressedTerm& term : day.terms) {
    const TermEstimate estimate = term_estimate(term);
    ordered_json panel;
    panel["title"] = estimate.name;
    panel["note"] = ordered_json::array({fmt::format("R² {:.3f}", term.regression.r_squared)});
    panel["x"] = phrase({label_text("time"), " / h"});
    panel["y"] = page_unit(estimate.unit);
    panel["series"] = ordered_json::array({chart_series(
        estimate.name, hours,
        std::vector<double>(estimate.at_epochs.begin(), estimate.at_epochs.end()), "both")});
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the chart of one identified curve with its 95 % band and its readings.
ordered_json curve_panel(const CurveReadings& curve, const kinematics::Chain& nominal) {
  const bool is_angle = curve.element.is_angle();
  const double unit = is_angle ? units::urad : units::um;
  const int joint = errors::axis_joint(curve.element.axis, nominal, "a belief");
  const bool is_slide = nominal.joints()[std::size_t(joint)].motion == kinematics::Motion::Linear;
  const double position_unit = is_slide ? 1.0 : units::deg;
  ordered_json panel;
  panel["title"] = to_string(curve.element);
  panel["x"] = fmt::format("{} / {}", curve.element.axis, is_slide ? "mm" : "°");
  panel["y"] = is_angle ? "µrad" : "µm";
  panel["series"] = ordered_json::array();
  ordered_json line =
      chart_series(label_text("identified_band"), rounded_list(curve.q / position_unit),
                   rounded_list(curve.value / unit), "line");
  line["low"] = rounded_list((curve.value - 1.96 * curve.sigma) / unit);
  line["high"] = rounded_list((curve.value + 1.96 * curve.sigma) / unit);
  panel["series"].push_back(line);
  if (curve.reading_q.size() > 0) {
    const ReadingSubset readings =
        reading_subset(to_string(curve.element), curve.reading_q.size(), max_curve_readings);
    const auto subset = Eigen::seq(0, Eigen::indexing::last, readings.every);
    panel["title"] = readings.title;
    panel["series"].push_back(chart_series(label_text("readings"),
                                           rounded_list(curve.reading_q(subset) / position_unit),
                                           rounded_list(curve.reading(subset) / unit), "points"));
  }
  return panel;
}

/// Returns the charts of all identified curves; null if there are none.
ordered_json curves_block(const ChainFit& fit, const kinematics::Chain& nominal) {
  if (fit.curves.empty()) return {};
  ordered_json block = page_block("panels", "curves", label_text("curves"));
  block["note"] = label_text("curves_note");
  block["most"] = 48;
  block["panels"] = ordered_json::array();
  for (const CurveReadings& curve : fit.curves)
    block["panels"].push_back(curve_panel(curve, nominal));
  return block;
}

/// Returns the histogram of residuals in standard deviations, for all readings and for each file.
ordered_json residuals_block(const ChainFit& fit, const std::vector<ReadingsSource>& sources) {
  ordered_json block = page_block("histogram", "residuals", label_text("residuals"));
  block["x"] = label_text("residual_sd");
  block["unit"] = "";
  block["y"] = label_text("share_of_readings");
  block["one_at_a_time"] = true;
  block["note"] = label_text("residuals_note");
  block["series"] = ordered_json::array();
  Eigen::Index count = 0;
  for (const Eigen::VectorXd& residuals : fit.residual_sd) count += residuals.size();
  Eigen::VectorXd all_residuals(count);
  Eigen::Index begin = 0;
  for (const Eigen::VectorXd& residuals : fit.residual_sd) {
    all_residuals.segment(begin, residuals.size()) = residuals;
    begin += residuals.size();
  }
  if (count == 0) return {};
  block["series"].push_back(
      {{"name", label_text("all_readings")}, {"values", rounded_list(all_residuals)}});
  // The selection list of the chart is unusable with more files.
  if (fit.residual_sd.size() > 1 && fit.residual_sd.size() <= 24)
    for (std::size_t f = 0; f < fit.residual_sd.size(); ++f)
      if (fit.residual_sd[f].size() > 0)
        block["series"].push_back(
            {{"name", sources[f].instrument}, {"values", rounded_list(fit.residual_sd[f])}});
  return block;
}

}  // namespace

FiguresPage identification_page(const IdentificationResult& identified) {
  const auto* fit = std::get_if<ChainFit>(&identified.fit);
  FiguresPage page;
  page.title = machine_code(identified);
  const auto add = [&](const ordered_json& block) {
    if (!block.is_null()) page.blocks.push_back(block);
  };
  add(findings_block(identified));
  if (fit) add(curves_block(*fit, identified.nominal));
  if (const auto* day = std::get_if<ThermalDay>(&identified.fit)) add(day_block(*day));
  if (const auto* composite = std::get_if<CompositeFits>(&identified.fit))
    add(starts_block(*composite));
  add(sensor_slopes_block(identified));
  add(numbers_block(identified));
  add(confounded_block(identified.confounded));
  add(sources_block(identified.sources, fit));
  if (fit) {
    add(residuals_block(*fit, identified.sources));
    add(outliers_block(*fit));
    add(orders_block(*fit));
  }
  page.request = {{"machine_name", page.title}, {"method", method_text(identified)}};
  page.warnings = identified.warnings;
  for (const std::string& assumption : identified.assumptions)
    page.warnings.push_back("assumed: " + assumption);
  std::vector<std::filesystem::path> files;
  for (const ReadingsSource& source : identified.sources) files.push_back(source.file);
  const BeliefFiles& own = identified.files;
  files.insert(files.end(), {own.belief, own.report, own.thermal.value_or("")});
  page.files = page_files(files);
  return page;
}

std::filesystem::path identification_page_file(const std::filesystem::path& report) {
  return report.parent_path() / (report.stem().string() + "_page.json");
}

FiguresPage saved_identification_page(const std::filesystem::path& report) {
  return read_page(identification_page_file(report),
                   {report, std::filesystem::path(report).replace_extension(".toml")});
}

}  // namespace abbe::sim
