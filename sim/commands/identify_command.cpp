#include "sim/commands/identify_command.h"

#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "sim/commands/outcome_text.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/report/belief_text.h"
#include "sim/report/identify_json.h"
#include "sim/report/identify_page.h"
#include "sim/report/identify_pictures.h"
#include "sim/report/identify_text.h"

namespace abbe::sim {
namespace {

std::vector<std::filesystem::path> all_of(const BeliefFiles& files) {
  std::vector<std::filesystem::path> all{files.belief, files.report, files.picture};
  if (files.thermal) all.push_back(*files.thermal);
  return all;
}

/// By the bytes of the readings, of which a row has about sixty.
std::vector<Stage> stages_of(const std::vector<std::filesystem::path>& files,
                             const IdentifyOptions& options) {
  constexpr double s_of_row_read = 1e-5, s_of_row_fitted = 4e-4, s_of_order_tried = 2e-4;
  double rows = 0.0;
  for (const std::filesystem::path& file : files) {
    std::error_code failure;
    const auto bytes = std::filesystem::file_size(file, failure);
    if (!failure) rows += double(bytes) / 60.0;
  }
  std::vector<Stage> stages{{"identify", "read", s_of_row_read * rows}};
  if (options.choose_orders)
    stages.push_back({"identify", "orders", s_of_order_tried * options.orders.most * rows});
  stages.push_back({"identify", "fit", s_of_row_fitted * rows});
  stages.push_back({"write", "draw", 2.0});
  return stages;
}

}  // namespace

Identified identify(const std::vector<std::filesystem::path>& files, const IdentifyOptions& options,
                    const Progress& instead) {
  const Writer writer{options.permissions, files};  // readings are never written over
  const BeliefFiles out = belief_files(options);
  for (const std::filesystem::path& file : all_of(out)) check_file(file, writer);
  ProgressLine progress(stages_of(files, options), instead);
  progress.begin("identify");
  Identified found = identified(files, options, to(progress));
  progress.begin("write");
  progress.report("draw", 0.0);
  write_table(result_file(out.belief, writer), belief_text(found));
  write_json(result_file(out.report, writer), to_json(found));
  if (out.thermal) write_table(result_file(*out.thermal, writer), thermal_half_text(found));
  const auto* fit = std::get_if<ChainFit>(&found.fit);
  if (!fit || fit->curves.empty()) return found;
  write_curves_picture(result_file(out.picture, writer), fit->curves, found.nominal, files);
  return found;
}

namespace {

/// What stands on the command line.
struct IdentifyWords {
  std::vector<std::filesystem::path> readings;
  std::string basis = "legendre";
  std::string method = "chain";
  std::vector<std::string> pitch;
  IdentifyOptions options;
  bool report = false;
  std::string language = "en";
};

/// "X=16": the pitch of an axis's screw.
std::pair<char, double> parse_pitch(const std::string& text) {
  const auto period = text.size() > 2 && text[1] == '=' ? number_of(text.substr(2)) : std::nullopt;
  if (!period || *period <= 0.0)
    throw BadUsage("--pitch", "expected AXIS=MM such as X=16, seen " + text);
  return {text[0], *period};
}

/// An option that the method does not use would be without effect.
void check_options(const IdentifyWords& words) {
  const IdentifyOptions defaults;
  const IdentifyOptions& options = words.options;
  const auto needs = [&](bool is_given, const char* option, std::string_view methods) {
    if (is_given && methods.find(words.method) == std::string_view::npos)
      throw BadUsage(option, fmt::format("expected --method {}, seen {}", methods, words.method));
  };
  needs(!options.sensors.empty(), "--sensors", "step_diagonal, composite or thermal");
  needs(options.sensor_count != defaults.sensor_count, "--sensor-count", "thermal");
  needs(options.margin != defaults.margin, "--margin", "thermal or composite");
  needs(options.model.order != defaults.model.order, "--order", "chain or composite");
  needs(options.choose_orders, "--choose-orders", "chain");
  needs(!words.pitch.empty(), "--pitch", "chain");
  needs(options.estimate.outlier_limit != defaults.estimate.outlier_limit, "--outliers", "chain");
}

Exit print_identified(const Common& common, IdentifyWords words) {
  using errors::identification::Basis;
  check_options(words);
  words.options.model.slides = words.basis == "polynomial" ? Basis::Polynomial
                               : words.basis == "spline"   ? Basis::Spline
                                                           : Basis::Legendre;
  for (const std::string& one : words.pitch) words.options.model.pitch.insert(parse_pitch(one));
  words.options.model.placement = words.options.model.constants;
  words.options.method = words.method == "step_diagonal" ? IdentifyOptions::Method::StepDiagonal
                         : words.method == "composite"   ? IdentifyOptions::Method::Composite
                         : words.method == "thermal"     ? IdentifyOptions::Method::Thermal
                                                         : IdentifyOptions::Method::Chain;
  const bool thermal = words.options.method == IdentifyOptions::Method::Thermal;
  words.options.out = file_of_out(common.out.empty() ? "out" : common.out,
                                  thermal ? "belief_thermal.txt" : "belief.toml");
  for (const char* taken : {".json", ".png", ".csv", ".html"})
    if (words.options.out.extension() == taken)
      throw BadUsage(
          "--out",
          fmt::format("expected a belief file such as belief.toml (report and picture stand "
                      "beside it), seen {}",
                      words.options.out.string()));
  for (const std::filesystem::path& readings : words.readings) {
    std::error_code ignored;
    if (std::filesystem::equivalent(readings, words.options.out, ignored))
      throw BadUsage("--out", "expected another file than the readings");
  }
  words.options.permissions = common.permissions;
  const std::filesystem::path page =
      std::filesystem::path(words.options.out).replace_extension(".html");
  const Writer writer{common.permissions, words.readings};
  if (words.report) check_file(page, writer);
  const Identified found = identify(words.readings, words.options);
  if (words.report) {
    FiguresPage figures = identify_page(found);
    figures.language = words.language;
    figures.command = common.permissions.command;
    write_file(result_file(page, writer), html_of(figures));
  } else {
    remove_file(result_file(page, writer));  // that of an earlier identification
  }
  print("{}", Lines(common.json ? json_text(to_json(found)) : identify_text(found)));
  return Exit::Ok;
}

std::vector<Option> identify_options(Common& common, IdentifyWords& words) {
  IdentifyOptions& options = words.options;
  return {
      {"READINGS", &words.readings, "files that measure wrote"},
      {"--basis", &words.basis, "curves of the slides (legendre)",
       OneOf{{"legendre", "polynomial", "spline"}}},
      {"--order", &options.model.order, "of those curves (4)", Between{0, 60}},
      {"--harmonics", &options.model.harmonics, "of rotary axes, per turn (3)", Between{0, 60}},
      {"--choose-orders", &options.choose_orders, "choose every order by cross-validation"},
      {"--most", &options.orders.most, "highest order that is tried (10)", Between{1, 60}},
      {"--elements", &options.model.only, "find these alone: EXX,EYX,EC0Y", Commas{}},
      {"--pitch", &words.pitch, "pitch of screws, mm: X=16,Y=16; two harmonics in the positioning",
       Commas{}},
      {"--constants", &options.model.constants,
       "constants of error motions too, and what only places the workpiece on a table: "
       "each hides in a zero or a place"},
      {"--outliers", &options.estimate.outlier_limit,
       "leave out readings beyond this many standard deviations (0: none)", Between{0, 1000000}},
      {"--method", &words.method,
       "chain: any readings, on the exact machine; step_diagonal: the published one; "
       "composite: positioning from several starts, a cold curve and NAME_thermal.txt; "
       "thermal: a day of readings, for [belief.thermal]",
       OneOf{{"chain", "step_diagonal", "composite", "thermal"}}},
      {"--sensors", &options.sensors,
       "with step_diagonal, composite or thermal: regress what several starts read on "
       "these (thermal: a choice)",
       Commas{}},
      {"--sensor-count", &options.sensor_count,
       "with thermal: how many sensors are chosen where none are named (4)", Between{1, 100}},
      {"--margin", &options.margin,
       "with thermal or composite: part of its trained range by which a sensor may leave it (0.1)",
       Between{0, 2}},
      json_option(common),
      {"--out", &common.out,
       "belief file, or folder for it (out/belief.toml; thermal: out/belief_thermal.txt; composite "
       "writes NAME_thermal.txt beside NAME.toml)"},
      {"--report", &words.report,
       "besides, NAME.html: curves, residuals and numbers with the values under the cursor"},
      language_option(words.language),
      force_option(common),
      threads_option(common, "most threads to use")};
}

}  // namespace

Command identify_command(Common& common) {
  const auto words = std::make_shared<IdentifyWords>();
  return {"identify",
          "Find the errors of a machine from readings; write a belief file",
          {"abbe identify out/calibration/*.csv --choose-orders --pitch X=16,Y=16,Z=12 --out "
           "out/belief.toml",
           "abbe identify out/day/drift.csv --method thermal --sensor-count 4 --out "
           "out/belief_thermal.txt"},
          identify_options(common, *words),
          [words, &common] { return print_identified(common, *words); }};
}

}  // namespace abbe::sim
