#include "sim/report/evaluate_page.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "errors/metrology/circular.h"
#include "errors/metrology/shares.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#include "sim/report/evaluation_report.h"
#include "sim/report/page_blocks.h"
#include "sim/report/saved_json.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;
using Eigen::Index;
using Eigen::VectorXd;
using nlohmann::ordered_json;

constexpr Index most_drift_points = 2000;

double chart_unit(bool is_angle) { return is_angle ? units::urad : units::um; }
const char* chart_unit_name(bool is_angle) { return is_angle ? "µrad" : "µm"; }

ordered_json list_of(const VectorXd& values) {
  ordered_json list = ordered_json::array();
  for (const double value : values)
    list.push_back(std::isfinite(value) ? ordered_json(value) : ordered_json());
  return list;
}

// --- the figures

/// Names of nested figures with their values, "causes: radius_um".
void flatten(const ordered_json& json, const std::string& within,
             std::vector<std::pair<std::string, ordered_json>>& figures) {
  for (const auto& [key, value] : json.items()) {
    if (within.empty() && (key == "name" || key == "standard" || key == "diagonals")) continue;
    const std::string name = within.empty() ? key : within + ": " + key;
    if (value.is_object())
      flatten(value, name, figures);
    else if (value.is_array()) {
      std::string text;
      for (const ordered_json& one : value)
        text +=
            (text.empty() ? "" : ", ") +
            (one.is_string() ? one.get<std::string>() : fmt::format("{:.6g}", one.get<double>()));
      figures.emplace_back(name, text);
    } else if (value.is_boolean()) {
      figures.emplace_back(name, label_word(value.get<bool>() ? "yes" : "no"));
    } else {
      figures.emplace_back(name, value);
    }
  }
}

/// A table of all tests by one standard: figures down, tests across.
ordered_json standard_block(const std::vector<const ordered_json*>& tests, std::size_t number) {
  std::vector<PageColumn> columns{{label_word("figure"), ""}};
  std::vector<std::string> names;
  std::vector<std::vector<std::pair<std::string, ordered_json>>> all;
  for (const ordered_json* test : tests) {
    columns.push_back({test->at("name").get<std::string>(), ""});
    flatten(*test, "", all.emplace_back());
    for (const auto& [name, value] : all.back())
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  ordered_json rows = ordered_json::array();
  for (const std::string& name : names) {
    ordered_json row = ordered_json::array();
    row.push_back(name);
    for (const auto& figures : all) {
      const auto at =
          std::ranges::find(figures, name, &std::pair<std::string, ordered_json>::first);
      row.push_back(at == figures.end() ? ordered_json() : at->second);
    }
    rows.push_back(row);
  }
  return table_block("standard-" + std::to_string(number),
                     tests.front()->at("standard").get<std::string>(), columns, rows);
}

/// At most so many tests stand beside each other.
void add_standards(ordered_json& blocks, const ordered_json& tests) {
  constexpr std::size_t most_across = 8;
  std::vector<std::string> standards;
  for (const ordered_json& one : tests) {
    const auto name = one.at("standard").get<std::string>();
    if (std::ranges::find(standards, name) == standards.end()) standards.push_back(name);
  }
  std::size_t number = 0;
  for (const std::string& standard : standards) {
    std::vector<const ordered_json*> all;
    for (const ordered_json& one : tests)
      if (one.at("standard").get<std::string>() == standard) all.push_back(&one);
    for (std::size_t first = 0; first < all.size(); first += most_across) {
      const auto count = std::min(most_across, all.size() - first);
      blocks.push_back(standard_block(
          {all.begin() + std::ptrdiff_t(first), all.begin() + std::ptrdiff_t(first + count)},
          number++));
    }
  }
  for (const ordered_json& one : tests)
    if (one.contains("diagonals")) {
      std::vector<const ordered_json*> each;
      for (const ordered_json& diagonal : one.at("diagonals")) each.push_back(&diagonal);
      if (!each.empty()) blocks.push_back(standard_block(each, number++));
    }
}

void add_temperatures(ordered_json& blocks, const ordered_json& evaluation) {
  if (!evaluation.contains("temperatures")) return;
  ordered_json rows = ordered_json::array();
  for (const auto& [sensor, range] : evaluation.at("temperatures").items()) {
    ordered_json row = ordered_json::array();
    row.push_back(sensor);
    row.push_back(figure_in(range.at("min_C")));
    row.push_back(figure_in(range.at("max_C")));
    rows.push_back(row);
  }
  blocks.push_back(table_block("temperatures", label_word("temperatures"),
                               {{label_word("sensor"), ""},
                                {label_word("machines_min"), "°C"},
                                {label_word("machines_max"), "°C"}},
                               rows));
}

// --- charts of what was evaluated

/// One way of approach: its mean with the band of 2 s, and every run.
void add_one_way(ordered_json& panel, const char* name, const VectorXd& target,
                 const Eigen::MatrixXd& runs,
                 const std::optional<metrology::OneWayPositioning>& way, double unit, int colour) {
  if (!way) return;
  ordered_json mean =
      series_of(label_word(name), list_of(target), list_of(way->mean / unit), "both");
  mean["colour"] = colour;
  if (way->s.size() > 0) {
    mean["low"] = list_of((way->mean - 2.0 * way->s) / unit);
    mean["high"] = list_of((way->mean + 2.0 * way->s) / unit);
  }
  panel["series"].push_back(mean);
  ordered_json points =
      series_of(label_word("single_runs"), list_of(target.replicate(runs.cols(), 1)),
                list_of(runs.reshaped() / unit), "points");
  points["colour"] = colour;
  panel["series"].push_back(points);
}

ordered_json position_panel(const std::string& name, const metrology::PositionRuns& runs,
                            bool is_angle, const PageWord& x, double x_unit) {
  const metrology::Positioning p = metrology::positioning(runs);
  ordered_json panel;
  panel["title"] = name;
  panel["x"] = x;
  panel["y"] = phrase({label_word("deviation_read"), " / ", chart_unit_name(is_angle)});
  panel["series"] = ordered_json::array();
  const VectorXd target = runs.target / x_unit;
  add_one_way(panel, "up_2s", target, runs.up, p.up, chart_unit(is_angle), 0);
  add_one_way(panel, "down_2s", target, runs.down, p.down, chart_unit(is_angle), 1);
  return panel;
}

void add_positions(ordered_json& blocks, const metrology::Tests& tests) {
  ordered_json block = page_block("panels", "positions", label_word("over_position"));
  block["note"] = label_word("over_position_note");
  block["columns"] = 2;
  block["panels"] = ordered_json::array();
  for (const metrology::AxisTest& test : tests.axes)
    block["panels"].push_back(
        position_panel(test.name, form_of(test), test.angle,
                       fmt::format("{} / {}", test.axis, test.rotary ? "°" : "mm"),
                       test.rotary ? units::deg : 1.0));
  for (const metrology::DiagonalTest& test : tests.diagonals)
    block["panels"].push_back(position_panel(test.name, test.runs.runs, false,
                                             phrase({label_word("along_diagonal"), " / mm"}), 1.0));
  if (!block["panels"].empty()) blocks.push_back(block);
}

/// A sense about a centre; one that goes all the way round ends where it began.
ordered_json circle_series(const char* name, const metrology::CircularTrace& trace,
                           double nominal_radius, const Eigen::Vector2d& centre) {
  ordered_json series;
  series["name"] = label_word(name);
  series["angle"] = series["deviation"] = ordered_json::array();
  const Index n = trace.angle.size();
  for (Index i = 0; i < n + (metrology::goes_round(trace.angle) ? 1 : 0); ++i) {
    const double angle = trace.angle[i % n];
    const double deviation = trace.radius[i % n] - nominal_radius - centre.x() * std::cos(angle) -
                             centre.y() * std::sin(angle);
    series["angle"].push_back(angle / units::deg);
    series["deviation"].push_back(deviation / units::um);
  }
  return series;
}

void add_circles(ordered_json& blocks, const metrology::Tests& tests) {
  ordered_json block = page_block("polar", "circles", label_word("circles"));
  block["unit"] = "µm";
  block["panels"] = ordered_json::array();
  for (const metrology::CircleTest& test : tests.circles) {
    const metrology::Circular circle = metrology::circular(test.runs);
    ordered_json panel;
    panel["title"] = test.name;
    panel["axes"] = {test.plane.substr(0, 1), test.plane.substr(1, 1)};
    panel["note"] = ordered_json::array();
    panel["note"].push_back(label_word(circle.centre_is == metrology::CircleCentre::LeastSquares
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

void add_drifts(ordered_json& blocks, const metrology::Tests& tests) {
  ordered_json block = page_block("panels", "drifts", label_word("drifts"));
  block["columns"] = 2;
  block["panels"] = ordered_json::array();
  for (const metrology::DriftTest& test : tests.drifts) {
    const VectorXd hours = (test.log.time_s.array() - test.log.time_s[0]) / 3600.0;
    const ReadingsDrawn readings = readings_drawn(test.name, hours.size(), most_drift_points);
    const auto few = Eigen::seq(0, Eigen::indexing::last, readings.every);
    for (const bool is_angle : {false, true}) {
      ordered_json panel;
      panel["title"] = readings.title;
      panel["x"] = phrase({label_word("time"), " / h"});
      panel["y"] = phrase({label_word("drift"), " / ", chart_unit_name(is_angle)});
      panel["series"] = ordered_json::array();
      for (std::size_t c = 0; c < test.log.names.size(); ++c)
        if (test.angle[c] == is_angle) {
          ordered_json line =
              series_of(test.log.names[c], list_of(hours(few)),
                        list_of(test.log.values.col(Index(c))(few) / chart_unit(is_angle)), "line");
          line["colour"] = c;  // the same in both panels
          panel["series"].push_back(line);
        }
      if (!panel["series"].empty()) block["panels"].push_back(panel);
    }
  }
  if (!block["panels"].empty()) blocks.push_back(block);
}

void add_part(ordered_json& blocks, const PartReadingsFile& part) {
  ordered_json block = page_block("histogram", "part", label_word("part_deviations"));
  block["x"] = label_word("deviation_read");
  block["y"] = label_word("share_of_readings");
  block["unit"] = "µm";
  block["series"] = ordered_json::array();
  ordered_json series;
  series["name"] = part.instrument;
  series["values"] = list_of(part.readings.deviation / units::um);
  block["series"].push_back(series);
  blocks.push_back(block);
}

FiguresPage page_of_evaluation(const ordered_json& evaluation) {
  FiguresPage page;
  page.title = evaluation.at("file").get<std::string>();
  page.asked = {{"file", page.title}, {"kind", evaluation.at("kind").get<std::string>()}};
  add_standards(page.blocks, evaluation.at("tests"));
  add_temperatures(page.blocks, evaluation);
  if (evaluation.contains("warnings"))
    for (const ordered_json& warning : evaluation.at("warnings"))
      page.warnings.push_back(warning.get<std::string>());
  return page;
}

std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().extension() == ".png")
      files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

}  // namespace

FiguresPage evaluate_page(const Evaluation& evaluation) {
  const ordered_json json = to_json(evaluation, {});
  FiguresPage page = page_of_evaluation(json);
  add_positions(page.blocks, evaluation.tests);
  add_circles(page.blocks, evaluation.tests);
  add_drifts(page.blocks, evaluation.tests);
  if (evaluation.part) add_part(page.blocks, *evaluation.part);
  page.files.push_back(
      {evaluation.file.filename().string(), read_text(evaluation.file, most_saved_bytes)});
  page.files.push_back({"evaluation.json", json_text(json)});
  return page;
}

FiguresPage evaluate_page(const std::filesystem::path& folder) {
  FiguresPage page;
  with_saved_json(
      folder / "evaluation.json", "an evaluation as abbe evaluate writes it",
      [&](const ordered_json& evaluation, const std::string& text) {
        page = page_of_evaluation(evaluation);
        if (const ordered_json pictures =
                pictures_block("pictures", label_word("pictures"), folder, pictures_in(folder));
            !pictures.is_null())
          page.blocks.push_back(pictures);
        page.warnings.push_back(
            "charts of the readings are left out of the report, its pictures stand in their place: "
            "a finished evaluation does not hold the readings; abbe evaluate --report writes them");
        page.files.push_back({"evaluation.json", text});
      });
  return page;
}

}  // namespace abbe::sim
