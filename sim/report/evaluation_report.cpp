#include "sim/report/evaluation_report.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <type_traits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "errors/metrology/circular.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/figures_page.h"

#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

namespace metrology = errors::metrology;

namespace {

using errors::metrology::EstimatedValue;
using errors::metrology::Figure;
using errors::metrology::FigureGroup;
using errors::metrology::TestResult;
using nlohmann::ordered_json;

/// Returns the key of a figure: its name with its unit.
std::string make_key(const Figure& figure) {
  return figure.unit.empty() ? figure.name : figure.name + "_" + figure.unit;
}

/// Returns the value of a figure; an estimate keeps its standard uncertainty.
ordered_json value_json(const Figure& figure) {
  return std::visit(
      [](const auto& value) -> ordered_json {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, std::monostate>)
          return nullptr;
        else if constexpr (std::is_same_v<Value, EstimatedValue>)
          return {{"value", value.value}, {"standard_uncertainty", value.u}};
        else if constexpr (std::is_same_v<Value, Eigen::Vector3d>)
          return {value.x(), value.y(), value.z()};
        else
          return value;
      },
      figure.value);
}

/// Adds figures and, as nested objects, groups of figures to a JSON object.
void add_figures(ordered_json& json, const std::vector<Figure>& figures,
                 const std::vector<FigureGroup>& groups) {
  for (const Figure& figure : figures) json[make_key(figure)] = value_json(figure);
  for (const FigureGroup& group : groups) {
    ordered_json inner = ordered_json::object();
    add_figures(inner, group.figures, group.groups);
    json[group.name] = std::move(inner);
  }
}

/// Returns all tests; the diagonals of a test are nested in it.
ordered_json tests_json(const std::vector<TestResult>& tests) {
  ordered_json list = ordered_json::array();
  for (const TestResult& test : tests) {
    ordered_json json{{"name", test.name}, {"standard", test.standard}};
    add_figures(json, test.figures, test.groups);
    if (!test.diagonals.empty()) json["diagonals"] = tests_json(test.diagonals);
    list.push_back(std::move(json));
  }
  return list;
}

/// Returns one line of text for a figure; estimates show their standard uncertainty.
std::string line(const Figure& figure, const std::string& label) {
  if (const auto* number = std::get_if<double>(&figure.value))
    return fmt::format("{:<40} {:>12.4f}\n", label, *number);
  if (const auto* estimate = std::get_if<EstimatedValue>(&figure.value))
    return fmt::format("{:<40} {:>12.4f}   u {:.4f}\n", label, estimate->value, estimate->u);
  if (const auto* texts = std::get_if<std::vector<std::string>>(&figure.value))
    if (texts->empty()) return {};
  if (const auto* text = std::get_if<std::string>(&figure.value))
    return fmt::format("{:<40} {:>12}\n", label, escaped(*text));
  if (std::holds_alternative<std::monostate>(figure.value))
    return fmt::format("{:<40} {:>12}\n", label, "-");
  return fmt::format("{:<40} {:>12}\n", label, escape_strings(value_json(figure)).dump());
}

/// Returns figures and, indented, groups of figures as lines of text.
std::string lines(const std::vector<Figure>& figures, const std::vector<FigureGroup>& groups,
                  std::size_t indent) {
  const std::string margin(indent, ' ');
  std::string text;
  for (const Figure& figure : figures) text += line(figure, margin + escaped(make_key(figure)));
  for (const FigureGroup& group : groups)
    text += margin + escaped(group.name) + "\n" + lines(group.figures, group.groups, indent + 2);
  return text;
}

}  // namespace

ordered_json to_json(const Evaluation& evaluation,
                     const std::vector<std::filesystem::path>& pictures) {
  ordered_json json{{"file", evaluation.file.string()},
                    {"kind", evaluation.kind},
                    {"tests", tests_json(evaluation.results)}};
  for (const Evaluation::Temperatures& range : evaluation.temperatures)
    json["temperatures"][range.sensor] = {{"min_C", range.min_C}, {"max_C", range.max_C}};
  json["warnings"] = evaluation.warnings;
  json["pictures"] = ordered_json::array();
  for (const std::filesystem::path& picture : pictures)
    json["pictures"].push_back(picture.string());
  return json;
}

std::string to_text(const Evaluation& evaluation,
                    const std::vector<std::filesystem::path>& pictures) {
  std::string text =
      fmt::format("{} ({})\n", escaped(evaluation.file.string()), escaped(evaluation.kind));
  for (const TestResult& test : evaluation.results) {
    text += fmt::format("\n{} -- {}\n", escaped(test.name), test.standard);
    text += lines(test.figures, test.groups, 2);
    for (const TestResult& diagonal : test.diagonals)
      text += "  diagonals: " + escaped(diagonal.name) + "\n" +
              lines(diagonal.figures, diagonal.groups, 4);
  }
  if (!evaluation.temperatures.empty()) text += "\ntemperatures, C\n";
  for (const Evaluation::Temperatures& range : evaluation.temperatures)
    text += fmt::format("  {:<38} {:>8.2f} .. {:.2f}\n", escaped(range.sensor), range.min_C,
                        range.max_C);
  for (const std::filesystem::path& picture : pictures)
    text += "\npicture " + escaped(picture.string());
  text += pictures.empty() ? "" : "\n";
  for (const std::string& warning : evaluation.warnings)
    text += "\nwarning: " + escaped(warning) + "\n";
  return text;
}

#if ABBE_RENDER
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t max_panels = 12;  // of one picture

/// Return the unit of deviations in pictures, and its name.
double picture_unit(bool angle) { return angle ? units::urad : units::um; }
const char* picture_unit_name(bool angle) { return angle ? "µrad" : "µm"; }

/// Returns a figure as text for a picture; empty if the test does not have it.
std::string figure_text(const char* name, const std::optional<double>& value, bool angle) {
  return value ? fmt::format("{} {:.2f} {}", name, *value / picture_unit(angle),
                             picture_unit_name(angle))
               : "";
}

/// Adds the mean of one direction of approach with its 2 s band, and the single runs.
void add_approach(render::Panel& panel, const char* name, const VectorXd& target,
                  const Eigen::MatrixXd& runs,
                  const std::optional<metrology::UnidirectionalPositioning>& positioning,
                  double unit, int colour) {
  if (!positioning) return;
  render::Series mean{
      name, target, positioning->mean / unit, {}, {}, render::CurveStyle::LineAndPoints, colour};
  if (positioning->s.size() > 0) {
    mean.lower = (positioning->mean - 2.0 * positioning->s) / unit;
    mean.upper = (positioning->mean + 2.0 * positioning->s) / unit;
  }
  panel.series.push_back(mean);
  VectorXd x(runs.size()), y(runs.size());
  for (Index k = 0; k < runs.cols(); ++k) {
    x.segment(k * runs.rows(), runs.rows()) = target;
    y.segment(k * runs.rows(), runs.rows()) = runs.col(k) / unit;
  }
  panel.series.push_back({"", x, y, {}, {}, render::CurveStyle::Points, colour});
}

/// Returns the panel of a positioning test with its figures by ISO 230-2.
render::Panel position_picture_panel(const std::string& name, const metrology::PositionRuns& runs,
                                     bool angle, bool is_positioning, const std::string& x_label,
                                     double x_unit) {
  const metrology::Positioning p = metrology::positioning(runs);
  render::Panel panel{
      name, x_label, fmt::format("deviation / {}", picture_unit_name(angle)), {}, {}};
  const VectorXd target = runs.target / x_unit;
  add_approach(panel, "up ± 2 s", target, runs.up, p.up, picture_unit(angle), 0);
  add_approach(panel, "down ± 2 s", target, runs.down, p.down, picture_unit(angle), 1);
  if (is_positioning) panel.note = {figure_text("A", p.A, angle), figure_text("E", p.E, angle)};
  panel.note.push_back(figure_text("R", p.R, angle));
  panel.note.push_back(figure_text("B", p.B, angle));
  std::erase(panel.note, std::string());
  return panel;
}

/// Returns the name of a test and the component that was subtracted from it.
std::string panel_title(const metrology::AxisTest& test) {
  if (test.test_kind == metrology::AxisTest::TestKind::Straightness)
    return test.name + ", minus its reference line";
  if (test.test_kind == metrology::AxisTest::TestKind::ErrorMotion && !test.axial &&
      !is_hidden_by_centring(test))
    return test.name + ", minus order 1";
  return test.name;
}

/// Returns a panel for every axis test and every diagonal.
std::vector<render::Panel> line_panels(const metrology::MachineTests& tests) {
  std::vector<render::Panel> panels;
  for (const metrology::AxisTest& test : tests.axes)
    panels.push_back(
        position_picture_panel(panel_title(test), form_runs(test), test.angle,
                               test.test_kind == metrology::AxisTest::TestKind::Positioning,
                               fmt::format("{} / {}", test.axis, test.rotary ? "deg" : "mm"),
                               test.rotary ? units::deg : 1.0));
  for (const metrology::DiagonalTest& test : tests.diagonals)
    panels.push_back(position_picture_panel(test.name, test.runs.runs, false, true,
                                            "along the diagonal / mm", 1.0));
  return panels;
}

/// Returns the deviations for one sense of rotation about a centre; a full circle ends at its first
/// point.
render::PolarTrace polar_trace(const char* name, const metrology::CircularTrace& trace,
                               const metrology::CircularRuns& runs, const Eigen::Vector2d& centre) {
  VectorXd angle = trace.angle;
  VectorXd deviation = trace.radius.array() - runs.nominal_radius;
  // The eccentricity of the centre is subtracted to first order, which suffices because the
  // deviations are small against the radius.
  for (Index i = 0; i < deviation.size(); ++i)
    deviation[i] -= centre.x() * std::cos(angle[i]) + centre.y() * std::sin(angle[i]);
  if (metrology::is_full_turn(angle)) {
    angle.conservativeResize(angle.size() + 1);
    deviation.conservativeResize(angle.size());
    angle.tail<1>() = angle.head<1>();
    deviation.tail<1>() = deviation.head<1>();
  }
  return {name, angle, deviation / units::um};
}

/// Draws both senses of rotation of a circular test about the centre that its standard prescribes.
void write_circle(const std::filesystem::path& file, const metrology::CircleTest& test,
                  const std::string& from) {
  const metrology::CircularResult circle = metrology::circular(test.runs);
  std::vector<render::PolarTrace> traces;
  if (circle.anticlockwise)
    traces.push_back(
        polar_trace("anticlockwise", test.runs.anticlockwise, test.runs, circle.centre));
  if (circle.clockwise)
    traces.push_back(polar_trace("clockwise", test.runs.clockwise, test.runs, circle.centre));
  render::PolarOptions options;
  const bool least_squares = circle.centre_kind == metrology::CircleCentre::LeastSquares;
  options.title = test.name + (least_squares ? ", about its least-squares centre"
                                             : ", about the set-up centre");
  options.first_axis = test.plane.substr(0, 1);
  options.second_axis = test.plane.substr(1, 1);
  const auto& figures = circle.both            ? circle.both
                        : circle.anticlockwise ? circle.anticlockwise
                                               : circle.clockwise;
  options.caption = {from};
  options.note = {figure_text("G", figures->G_lsq, false)};
  if (circle.H) options.note.push_back(figure_text("H", circle.H, false));
  if (test.is_zero_known) {
    options.note.push_back(figure_text("F max", figures->F_max, false));
    options.note.push_back(figure_text("F min", figures->F_min, false));
  }
  options.note.push_back(fmt::format("radius {:.1f} mm", test.runs.nominal_radius));
  render::write_polar(file, traces, options);
}

/// Draws the readings of a drift test over time.
void write_drift(const std::filesystem::path& file, const metrology::DriftTest& test,
                 const std::string& from) {
  std::vector<render::Panel> panels;
  const VectorXd& time_s = test.log.time_s;
  // Above two hours the axis is labelled in hours.
  const bool long_log = time_s[time_s.size() - 1] - time_s[0] > 7200.0;
  const VectorXd x = (time_s.array() - time_s[0]) / (long_log ? 3600.0 : 60.0);
  // Displacements and tilts have panels of their own, because their units differ.
  for (const bool angle : {false, true}) {
    render::Panel panel{angle ? "tilts" : "displacements",
                        long_log ? "time / h" : "time / min",
                        fmt::format("drift / {}", picture_unit_name(angle)),
                        {},
                        {}};
    for (std::size_t c = 0; c < test.log.names.size(); ++c)
      if (test.angle[c] == angle)
        panel.series.push_back(
            {test.log.names[c], x, test.log.values.col(Index(c)) / picture_unit(angle), {}, {}});
    if (!panel.series.empty()) panels.push_back(std::move(panel));
  }
  render::CurvesOptions options;
  options.title = test.name;
  options.caption = {from};
  render::write_curves(file, panels, options);
}

/// Returns the name of a set-up as part of a file name, other characters replaced by underscores.
std::string file_name_part(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '+') c = '_';
  return name;
}

}  // namespace

std::vector<std::filesystem::path> write_test_pictures(const ResultFolder& folder,
                                                       const metrology::MachineTests& tests,
                                                       const std::string& from) {
  std::vector<std::filesystem::path> files;
  const auto add = [&](const std::string& name, const auto& draw) {
    std::string file = name + ".png";
    // Two tests may have the same name.
    for (int k = 2; std::find(files.begin(), files.end(), folder.path() / file) != files.end(); ++k)
      file = fmt::format("{}-{}.png", name, k);
    files.push_back(folder.path() / file);
    write_file(folder / file, [&](const std::filesystem::path& temporary) { draw(temporary); });
  };
  const std::vector<render::Panel> panels = line_panels(tests);
  for (std::size_t first = 0; first < panels.size(); first += max_panels) {
    const auto begin = panels.begin() + std::ptrdiff_t(first);
    const auto count = std::min(max_panels, panels.size() - first);
    add("axes", [&](const std::filesystem::path& file) {
      render::CurvesOptions options;
      options.title = "deviations against commanded position; points: single readings";
      options.caption = {from,
                         "actual minus target; linear axes relative to the target nearest to 0"};
      options.columns = count > 3 ? 2 : 1;
      options.width = options.columns == 2 ? 2600 : 1600;
      render::write_curves(file, {begin, begin + std::ptrdiff_t(count)}, options);
    });
  }
  for (const metrology::CircleTest& test : tests.circles)
    add(file_name_part(test.name),
        [&](const std::filesystem::path& file) { write_circle(file, test, from); });
  for (const metrology::DriftTest& test : tests.drifts)
    add(file_name_part(test.name),
        [&](const std::filesystem::path& file) { write_drift(file, test, from); });
  return files;
}

std::vector<std::filesystem::path> write_part_picture(const ResultFolder& folder,
                                                      const PartReadingsFile& part,
                                                      const std::string& from) {
  const VectorXd deviation_um = part.readings.deviation / units::um;
  render::HistogramOptions options;
  options.title = part.part + ", read by " + part.instrument;
  options.caption = {from, "along the normals of the design, + material left"};
  write_file(folder / "part.png", [&](const std::filesystem::path& file) {
    render::write_histogram(file, deviation_um, VectorXd::Ones(deviation_um.size()), options);
  });
  return {folder.path() / "part.png"};
}
#else
std::vector<std::filesystem::path> write_part_picture(const ResultFolder&, const PartReadingsFile&,
                                                      const std::string&) {
  return {};
}
std::vector<std::filesystem::path> write_test_pictures(const ResultFolder&,
                                                       const metrology::MachineTests&,
                                                       const std::string&) {
  return {};
}
#endif

namespace {

constexpr Index max_drift_points = 2000;

/// Return the unit of deviations in charts, and its name.
double chart_unit(bool is_angle) { return is_angle ? units::urad : units::um; }
const char* chart_unit_name(bool is_angle) { return is_angle ? "µrad" : "µm"; }

/// Returns values as a list; JSON has no NaN, so missing values are null.
ordered_json json_list(const VectorXd& values) {
  ordered_json list = ordered_json::array();
  for (const double value : values)
    list.push_back(std::isfinite(value) ? ordered_json(value) : ordered_json());
  return list;
}

/// Collects figures under names such as "causes: radius_um".
void add_rows(const std::vector<Figure>& figures, const std::vector<FigureGroup>& groups,
              const std::string& within, std::vector<std::pair<std::string, ordered_json>>& rows) {
  for (const Figure& figure : figures) {
    const std::string name = within + make_key(figure);
    if (const auto* estimate = std::get_if<EstimatedValue>(&figure.value)) {
      rows.emplace_back(name + ": value", estimate->value);
      rows.emplace_back(name + ": standard_uncertainty", estimate->u);
    } else if (const auto* texts = std::get_if<std::vector<std::string>>(&figure.value)) {
      rows.emplace_back(name, fmt::format("{}", fmt::join(*texts, ", ")));
    } else if (const auto* vector = std::get_if<Eigen::Vector3d>(&figure.value)) {
      rows.emplace_back(name, fmt::format("{:.6g}", fmt::join(*vector, ", ")));
    } else if (const auto* answer = std::get_if<bool>(&figure.value)) {
      rows.emplace_back(name, label_text(*answer ? "yes" : "no"));
    } else {
      rows.emplace_back(name, value_json(figure));
    }
  }
  for (const FigureGroup& group : groups)
    add_rows(group.figures, group.groups, within + group.name + ": ", rows);
}

/// Returns a table of tests by one standard, with a row for each figure and a column for each test.
ordered_json standard_block(std::span<const TestResult> tests, std::size_t number) {
  std::vector<PageColumn> columns{{label_text("figure"), ""}};
  std::vector<std::string> names;
  std::vector<std::vector<std::pair<std::string, ordered_json>>> figures_by_test;
  for (const TestResult& test : tests) {
    columns.push_back({test.name, ""});
    add_rows(test.figures, test.groups, "", figures_by_test.emplace_back());
    for (const auto& [name, value] : figures_by_test.back())
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  ordered_json rows = ordered_json::array();
  for (const std::string& name : names) {
    ordered_json row = ordered_json::array();
    row.push_back(name);
    for (const auto& figures : figures_by_test) {
      const auto match =
          std::ranges::find(figures, name, &std::pair<std::string, ordered_json>::first);
      row.push_back(match == figures.end() ? ordered_json() : match->second);
    }
    rows.push_back(row);
  }
  return table_block("standard-" + std::to_string(number), tests.front().standard, columns, rows);
}

/// Adds the tables of all standards. A table wider than the page is continued in another one.
void add_standards(ordered_json& blocks, const std::vector<TestResult>& tests) {
  constexpr std::size_t max_columns = 8;
  std::vector<std::string> standards;
  for (const TestResult& test : tests)
    if (std::ranges::find(standards, test.standard) == standards.end())
      standards.push_back(test.standard);
  std::size_t number = 0;
  for (const std::string& standard : standards) {
    std::vector<TestResult> matches;
    std::ranges::copy_if(tests, std::back_inserter(matches),
                         [&](const TestResult& test) { return test.standard == standard; });
    for (std::size_t first = 0; first < matches.size(); first += max_columns)
      blocks.push_back(standard_block(
          std::span(matches).subspan(first, std::min(max_columns, matches.size() - first)),
          number++));
  }
  for (const TestResult& test : tests)
    if (!test.diagonals.empty()) blocks.push_back(standard_block(test.diagonals, number++));
}

/// Adds the table of the temperature ranges during the readings.
void add_temperatures(ordered_json& blocks, const std::vector<Evaluation::Temperatures>& ranges) {
  if (ranges.empty()) return;
  ordered_json rows = ordered_json::array();
  for (const Evaluation::Temperatures& range : ranges)
    rows.push_back(ordered_json::array({range.sensor, range.min_C, range.max_C}));
  blocks.push_back(table_block("temperatures", label_text("temperatures"),
                               {{label_text("sensor"), ""},
                                {label_text("machines_min"), "°C"},
                                {label_text("machines_max"), "°C"}},
                               rows));
}

/// Adds one direction of approach: its mean with the 2 s band, and every run as points.
void add_approach_series(ordered_json& panel, const char* name, const VectorXd& target,
                         const Eigen::MatrixXd& runs,
                         const std::optional<metrology::UnidirectionalPositioning>& positioning,
                         double unit, int colour) {
  if (!positioning) return;
  ordered_json mean = chart_series(label_text(name), json_list(target),
                                   json_list(positioning->mean / unit), "both");
  mean["colour"] = colour;
  if (positioning->s.size() > 0) {
    mean["low"] = json_list((positioning->mean - 2.0 * positioning->s) / unit);
    mean["high"] = json_list((positioning->mean + 2.0 * positioning->s) / unit);
  }
  panel["series"].push_back(mean);
  ordered_json points =
      chart_series(label_text("single_runs"), json_list(target.replicate(runs.cols(), 1)),
                   json_list(runs.reshaped() / unit), "points");
  points["colour"] = colour;
  panel["series"].push_back(points);
}

/// Returns the panel of one axis or diagonal: deviations over the position.
ordered_json position_panel(const std::string& name, const metrology::PositionRuns& runs,
                            bool is_angle, const PageText& x, double x_unit) {
  const metrology::Positioning p = metrology::positioning(runs);
  ordered_json panel;
  panel["title"] = name;
  panel["x"] = x;
  panel["y"] = phrase({label_text("deviation_read"), " / ", chart_unit_name(is_angle)});
  panel["series"] = ordered_json::array();
  const VectorXd target = runs.target / x_unit;
  add_approach_series(panel, "up_2s", target, runs.up, p.up, chart_unit(is_angle), 0);
  add_approach_series(panel, "down_2s", target, runs.down, p.down, chart_unit(is_angle), 1);
  return panel;
}

/// Adds the panels of all axis tests and diagonals.
void add_positions(ordered_json& blocks, const metrology::MachineTests& tests) {
  ordered_json block = page_block("panels", "positions", label_text("over_position"));
  block["note"] = label_text("over_position_note");
  block["columns"] = 2;
  block["panels"] = ordered_json::array();
  for (const metrology::AxisTest& test : tests.axes)
    block["panels"].push_back(
        position_panel(test.name, form_runs(test), test.angle,
                       fmt::format("{} / {}", test.axis, test.rotary ? "°" : "mm"),
                       test.rotary ? units::deg : 1.0));
  for (const metrology::DiagonalTest& test : tests.diagonals)
    block["panels"].push_back(position_panel(test.name, test.runs.runs, false,
                                             phrase({label_text("along_diagonal"), " / mm"}), 1.0));
  if (!block["panels"].empty()) blocks.push_back(block);
}

/// Returns the deviations for one sense of rotation about a centre; a full circle ends at its first
/// point.
ordered_json circle_series(const char* name, const metrology::CircularTrace& trace,
                           double nominal_radius, const Eigen::Vector2d& centre) {
  ordered_json series;
  series["name"] = label_text(name);
  series["angle"] = series["deviation"] = ordered_json::array();
  const Index n = trace.angle.size();
  for (Index i = 0; i < n + (metrology::is_full_turn(trace.angle) ? 1 : 0); ++i) {
    const double angle = trace.angle[i % n];
    const double deviation = trace.radius[i % n] - nominal_radius - centre.x() * std::cos(angle) -
                             centre.y() * std::sin(angle);
    series["angle"].push_back(angle / units::deg);
    series["deviation"].push_back(deviation / units::um);
  }
  return series;
}

/// Adds the circular tests as polar charts.
void add_circles(ordered_json& blocks, const metrology::MachineTests& tests) {
  ordered_json block = page_block("polar", "circles", label_text("circles"));
  block["unit"] = "µm";
  block["panels"] = ordered_json::array();
  for (const metrology::CircleTest& test : tests.circles) {
    const metrology::CircularResult circle = metrology::circular(test.runs);
    ordered_json panel;
    panel["title"] = test.name;
    panel["axes"] = {test.plane.substr(0, 1), test.plane.substr(1, 1)};
    panel["note"] = ordered_json::array();
    panel["note"].push_back(label_text(circle.centre_kind == metrology::CircleCentre::LeastSquares
                                           ? "least_squares_centre"
                                           : "centre_as_set"));
    panel["series"] = ordered_json::array();
    if (circle.anticlockwise)
      panel["series"].push_back(circle_series("anticlockwise", test.runs.anticlockwise,
                                              test.runs.nominal_radius, circle.centre));
    if (circle.clockwise)
      panel["series"].push_back(
          circle_series("clockwise", test.runs.clockwise, test.runs.nominal_radius, circle.centre));
    block["panels"].push_back(panel);
  }
  if (!block["panels"].empty()) blocks.push_back(block);
}

/// Adds the drift tests over time. A log may have thousands of readings, so only a subset is drawn.
void add_drifts(ordered_json& blocks, const metrology::MachineTests& tests) {
  ordered_json block = page_block("panels", "drifts", label_text("drifts"));
  block["columns"] = 2;
  block["panels"] = ordered_json::array();
  for (const metrology::DriftTest& test : tests.drifts) {
    const VectorXd hours = (test.log.time_s.array() - test.log.time_s[0]) / 3600.0;
    const ReadingSubset readings = reading_subset(test.name, hours.size(), max_drift_points);
    const auto subset = Eigen::seq(0, Eigen::indexing::last, readings.every);
    for (const bool is_angle : {false, true}) {
      ordered_json panel;
      panel["title"] = readings.title;
      panel["x"] = phrase({label_text("time"), " / h"});
      panel["y"] = phrase({label_text("drift"), " / ", chart_unit_name(is_angle)});
      panel["series"] = ordered_json::array();
      for (std::size_t c = 0; c < test.log.names.size(); ++c)
        if (test.angle[c] == is_angle) {
          ordered_json line = chart_series(
              test.log.names[c], json_list(hours(subset)),
              json_list(test.log.values.col(Index(c))(subset) / chart_unit(is_angle)), "line");
          line["colour"] = c;  // the same sensor has the same colour in both panels
          panel["series"].push_back(line);
        }
      if (!panel["series"].empty()) block["panels"].push_back(panel);
    }
  }
  if (!block["panels"].empty()) blocks.push_back(block);
}

/// Adds the histogram of the deviations of a part's points.
void add_part(ordered_json& blocks, const PartReadingsFile& part) {
  ordered_json block = page_block("histogram", "part", label_text("part_deviations"));
  block["x"] = label_text("deviation_read");
  block["y"] = label_text("share_of_readings");
  block["unit"] = "µm";
  block["series"] = ordered_json::array();
  ordered_json series;
  series["name"] = part.instrument;
  series["values"] = json_list(part.readings.deviation / units::um);
  block["series"].push_back(series);
  blocks.push_back(block);
}

}  // namespace

FiguresPage evaluation_page(const Evaluation& evaluation) {
  FiguresPage page;
  page.title = evaluation.file.string();
  page.request = {{"file", page.title}, {"kind", evaluation.kind}};
  page.warnings = evaluation.warnings;
  add_standards(page.blocks, evaluation.results);
  add_temperatures(page.blocks, evaluation.temperatures);
  add_positions(page.blocks, evaluation.tests);
  add_circles(page.blocks, evaluation.tests);
  add_drifts(page.blocks, evaluation.tests);
  if (evaluation.part) add_part(page.blocks, *evaluation.part);
  return page;
}

}  // namespace abbe::sim
