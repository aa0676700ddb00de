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

/// Returns the table of the figures of the fit. Each method reports some of these keys.
ordered_json findings_block(const ordered_json& report) {
  ordered_json rows = ordered_json::array();
  for (const char* key : {"count", "hours", "unknowns", "found", "reduced_chi_square",
                          "degrees_of_freedom", "condition"}) {
    if (!report.contains(key)) continue;
    ordered_json row = ordered_json::array();
    row.push_back(label_text("fit_" + std::string(key)));
    row.push_back(require_figure(report.at(key)));
    rows.push_back(row);
  }
  return table_block("fit", label_text("fit_title"),
                     {{label_text("figure"), ""}, {label_text("value"), ""}}, rows);
}

/// Returns the table of readings files, with their residuals if the fit is not null.
ordered_json sources_block(const ordered_json& report, const ChainFit* fit) {
  std::vector<PageColumn> columns{{label_text("file"), ""},    {label_text("instrument"), ""},
                                  {label_text("kind"), ""},    {label_text("fit_count"), ""},
                                  {label_text("set_ups"), ""}, {label_text("fit_hours"), ""}};
  if (fit) {
    columns.push_back({label_text("residual_rms"), ""});
    columns.push_back({label_text("residual_largest"), ""});
  }
  ordered_json rows = ordered_json::array();
  for (std::size_t file = 0; file < report.at("readings").size(); ++file) {
    const ordered_json& source = report.at("readings")[file];
    ordered_json row = ordered_json::array();
    for (const char* key : {"file", "instrument", "kind"})
      row.push_back(source.at(key).get<std::string>());
    for (const char* key : {"readings", "set_ups", "hours"})
      row.push_back(require_figure(source.at(key)));
    if (fit) {
      const Eigen::VectorXd& residual = fit->residual_sd[file];
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
std::string confounder_list(const ordered_json& confounded) {
  std::string text;
  for (const auto& [name, amount] : confounded.at("hidden_by").items())
    text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", name, amount.get<double>());
  return text;
}

/// Returns the table of all coefficients. The remark on a coefficient that the readings do not
/// determine names those that hide it.
ordered_json numbers_block(const ordered_json& report) {
  const auto remark_on = [&](const std::string& name) -> PageText {
    for (const ordered_json& confounded : report.at("confounded"))
      if (confounded.at("name").get<std::string>() == name) {
        const std::string confounders = confounder_list(confounded);
        return confounders.empty() ? label_text("not_read")
                                   : phrase({label_text("hidden_by"), " ", confounders});
      }
    return "";
  };
  ordered_json rows = ordered_json::array();
  for (const ordered_json& coefficient : report.at("numbers")) {
    const ordered_json &value = require_figure(coefficient.at("value")),
                       &u = require_figure(coefficient.at("standard_uncertainty"));
    ordered_json row = ordered_json::array();
    row.push_back(coefficient.at("name").get<std::string>());
    row.push_back(page_unit(coefficient.at("unit").get<std::string>()));
    row.push_back(value);
    row.push_back(u);
    const bool has_both = value.is_number() && u.is_number() && u.get<double>() > 0.0;
    row.push_back(has_both ? ordered_json(std::abs(value.get<double>()) / u.get<double>())
                           : ordered_json());
    const PageText remark = remark_on(coefficient.at("name").get<std::string>());
    row.push_back(u.is_null() && remark == "" ? label_text("not_found") : remark);
    rows.push_back(row);
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
ordered_json confounded_block(const ordered_json& report) {
  ordered_json rows = ordered_json::array();
  for (const ordered_json& coefficient : report.at("confounded")) {
    const std::string confounders = confounder_list(coefficient);
    ordered_json row = ordered_json::array();
    row.push_back(coefficient.at("name").get<std::string>());
    row.push_back(confounders.empty() ? label_text("not_read") : PageText(confounders));
    rows.push_back(row);
  }
  if (rows.empty()) return {};
  ordered_json block = table_block("confounded", label_text("confounded"),
                                   {{label_text("name"), ""}, {label_text("hidden_by"), ""}}, rows);
  block["note"] = label_text("confounded_note");
  return block;
}

/// Returns the table of the readings that were excluded as outliers, with their residuals.
ordered_json outliers_block(const ordered_json& report) {
  if (!report.contains("outliers") || report.at("outliers").empty()) return {};
  ordered_json rows = ordered_json::array();
  for (const ordered_json& outlier : report.at("outliers")) {
    ordered_json row = ordered_json::array();
    row.push_back(outlier.at("file").get<std::string>());
    row.push_back(require_figure(outlier.at("row")));
    row.push_back(require_figure(outlier.at("residual_sd")));
    rows.push_back(row);
  }
  return table_block(
      "outliers", label_text("outliers"),
      {{label_text("file"), ""}, {label_text("row"), ""}, {label_text("residual_sd"), ""}}, rows);
}

/// Returns the table of the orders that cross-validation chose.
ordered_json orders_block(const ordered_json& report) {
  if (!report.contains("orders")) return {};
  ordered_json rows = ordered_json::array();
  for (const auto& [name, order] : report.at("orders").items()) {
    ordered_json row = ordered_json::array();
    row.push_back(name);
    row.push_back(require_figure(order));
    rows.push_back(row);
  }
  return table_block("orders", label_text("orders"),
                     {{label_text("element"), ""}, {label_text("chosen_order"), ""}}, rows);
}

/// Adds a row for every sensor: the slope with its uncertainty.
/// @param values         { sensor: slope }
/// @param uncertainties  { sensor: standard uncertainty }
void add_slopes(ordered_json& rows, const PageText& name, const std::string& unit,
                const ordered_json& values, const ordered_json& uncertainties) {
  for (const auto& [sensor, value] : values.items()) {
    ordered_json row = ordered_json::array();
    row.push_back(name);
    row.push_back(sensor);
    row.push_back(unit);
    row.push_back(require_figure(value));
    row.push_back(uncertainties.contains(sensor) ? require_figure(uncertainties.at(sensor))
                                                 : ordered_json());
    rows.push_back(row);
  }
}

/// Returns the table of the slopes of coefficients by temperature, which some of the methods
/// identify.
ordered_json sensor_slopes_block(const ordered_json& report) {
  ordered_json rows = ordered_json::array();
  if (report.contains("per_K"))
    for (const ordered_json& coefficient : report.at("per_K"))
      add_slopes(rows, coefficient.at("name").get<std::string>(),
                 coefficient.at("unit").get<std::string>(), coefficient.at("per_K"),
                 coefficient.at("standard_uncertainty"));
  if (report.contains("composite"))
    for (const ordered_json& coefficient : report.at("composite"))
      add_slopes(rows, coefficient.at("axis").get<std::string>(), "µm/m/K",
                 coefficient.at("slope_um_per_m_K"), coefficient.at("standard_error_um_per_m_K"));
  if (report.contains("thermal"))
    for (const ordered_json& term : report.at("thermal").at("terms")) {
      ordered_json values = ordered_json::object(), errors = ordered_json::object();
      for (const auto& [sensor, slope] : term.at("per_K").items()) {
        values[sensor] = slope.at("value");
        errors[sensor] = slope.at("standard_error");
      }
      add_slopes(rows, term.at("name").get<std::string>(),
                 page_unit(term.at("unit").get<std::string>()) + "/K", values, errors);
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
ordered_json starts_block(const ordered_json& report) {
  if (!report.contains("composite")) return {};
  ordered_json block = page_block("panels", "starts", label_text("slopes_by_start"));
  block["panels"] = ordered_json::array();
  for (const ordered_json& axis : report.at("composite")) {
    ordered_json x = ordered_json::array(), y = x, low = x, high = x;
    for (const ordered_json& start_slope : axis.at("slopes")) {
      const double value = start_slope.at("slope_um_per_m").get<double>();
      const double band = 1.96 * start_slope.at("standard_error").get<double>();
      x.push_back(start_slope.at("start"));
      y.push_back(value);
      low.push_back(value - band);
      high.push_back(value + band);
    }
    ordered_json panel, series = chart_series(label_text("slope_with_band"), x, y, "both");
    series["low"] = low;
    series["high"] = high;
    panel["title"] = axis.at("axis").get<std::string>();
    panel["x"] = label_text("start");
    panel["y"] = phrase({label_text("slope"), " / µm/m"});
    panel["series"] = ordered_json::array();
    panel["series"].push_back(series);
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the charts of the thermal contribution to the elements over a day.
ordered_json day_block(const ordered_json& report) {
  if (!report.contains("thermal")) return {};
  const ordered_json& day = report.at("thermal");
  ordered_json block = page_block("panels", "day", label_text("terms_by_hour"));
  block["panels"] = ordered_json::array();
  for (const ordered_json& term : day.at("terms")) {
    ordered_json panel;
    panel["title"] = term.at("name").get<std::string>();
    panel["note"] = ordered_json::array();
    panel["note"].push_back(fmt::format("R² {:.3f}", term.at("r_squared").get<double>()));
    panel["x"] = phrase({label_text("time"), " / h"});
    panel["y"] = page_unit(term.at("unit").get<std::string>());
    panel["series"] = ordered_json::array();
    panel["series"].push_back(
        chart_series(term.at("name"), day.at("epochs_h"), term.at("at_epochs"), "both"));
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
ordered_json residuals_block(const ChainFit& fit, const ordered_json& report) {
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
        block["series"].push_back({{"name", report.at("readings").at(f).at("instrument")},
                                   {"values", rounded_list(fit.residual_sd[f])}});
  return block;
}

/// Returns the page of a report, with curves and residuals if `identified` is not null.
FiguresPage identification_document(const ordered_json& report,
                                    const IdentificationResult* identified) {
  const ChainFit* fit = identified ? std::get_if<ChainFit>(&identified->fit) : nullptr;
  FiguresPage page;
  page.title = report.at("machine").get<std::string>();
  const auto add = [&](const ordered_json& block) {
    if (!block.is_null()) page.blocks.push_back(block);
  };
  add(findings_block(report));
  if (fit) add(curves_block(*fit, identified->nominal));
  add(day_block(report));
  add(starts_block(report));
  add(sensor_slopes_block(report));
  add(numbers_block(report));
  add(confounded_block(report));
  add(sources_block(report, fit));
  if (fit) add(residuals_block(*fit, report));
  add(outliers_block(report));
  add(orders_block(report));
  page.request = {{"machine_name", page.title}, {"method", report.at("method").get<std::string>()}};
  for (const ordered_json& warning : report.at("warnings"))
    page.warnings.push_back(warning.get<std::string>());
  for (const ordered_json& assumption : report.value("assumptions", ordered_json::array()))
    page.warnings.push_back("assumed: " + assumption.get<std::string>());
  return page;
}

/// Offers a file for download if it exists.
void add_file(FiguresPage& page, const std::filesystem::path& file) {
  if (std::filesystem::exists(file))
    page.files.push_back({file.filename().string(), read_text(file, max_saved_bytes)});
}

}  // namespace

FiguresPage identification_page(const IdentificationResult& identified) {
  const ordered_json report = to_json(identified);
  FiguresPage page = identification_document(report, &identified);
  for (const ReadingsSource& source : identified.sources) add_file(page, source.file);
  add_file(page, identified.files.belief);
  add_file(page, identified.files.report);
  if (identified.files.thermal) add_file(page, *identified.files.thermal);
  return page;
}

FiguresPage identification_page(const std::filesystem::path& file) {
  FiguresPage page;
  read_saved_json(
      file, "the report of an identification (NAME.json) written by abbe identify",
      [&](const ordered_json& report, const std::string&) {
        page = identification_document(report, nullptr);
        page.warnings.push_back(
            "curves of the elements, readings and residuals are omitted from the report: a "
            "finished identification does not contain them; abbe identify --report writes them");
        add_file(page, file);
        add_file(page, std::filesystem::path(file).replace_extension(".toml"));
      });
  return page;
}

}  // namespace abbe::sim
