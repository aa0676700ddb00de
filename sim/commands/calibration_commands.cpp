#include "sim/commands/calibration_commands.h"

#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "sim/commands/run_commands.h"
#include "sim/cut/placement.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/readings/readings_file.h"
#include "sim/report/evaluation_report.h"
#include "sim/report/identification_page.h"
#include "sim/report/identification_report.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {

namespace {

using errors::metrology::Readings;

/// Returns the compensator of a case; empty for a case without one.
std::optional<CaseDescription> part_compensator(const std::string& name) {
  if (name.empty() || name == "error_free" || name == "uncompensated") return std::nullopt;
  return parse_case(name);
}

/// Cuts the named case: error-free, uncompensated or with a compensator.
Cut cut_case(const Job& job, const std::string& name, const Progress& progress) {
  if (name == "error_free") return cut_error_free(job, progress);
  return cut(job, part_compensator(name), progress);
}

/// Instruments to use: those named, or all of the scene.
struct InstrumentSelection {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};

/// Returns the instruments of these names; an unknown name is an input error.
InstrumentSelection chosen(const Scene& scene, const std::vector<std::string>& names) {
  if (names.empty()) return {scene.instruments, scene.part_instruments};
  InstrumentSelection result;
  for (const std::string& name : names) {
    if (auto of_part = find_part_instrument(scene, name))
      result.of_part.push_back(std::move(*of_part));
    else
      result.of_machine.push_back(find_instrument(scene, name));
  }
  return result;
}

struct PartMeasurement {
  PartReadingsFile file;
  std::vector<std::string> warnings;  ///< of the cut
};

/// Cuts the part in the case that the instrument names, and measures it.
PartMeasurement cut_and_measure(const Scene& scene, const PartInstrumentDescription& instrument,
                                const Progress& progress = {}) {
  const Job job = placed(prepare(scene, progress));
  const Cut made = cut_case(job, instrument.case_name, progress);
  check_cuts_part(job, made);
  return {measured_part(job, made, instrument), warnings_of(job, made)};
}

/// Returns the stages of measuring: a moment for the machine, the time of a cut for a part.
std::vector<Stage> stages_of(const Scene& scene, const InstrumentSelection& chosen) {
  std::vector<Stage> stages;
  if (!chosen.of_machine.empty())
    stages = {{"machine", "measure", 0.1 * double(chosen.of_machine.size())}};
  const WorkSize size = expected_size(scene);
  for (const PartInstrumentDescription& one : chosen.of_part)
    stages = std::move(stages) + scene_preparation_stages(one.name, size) +
             (one.case_name == "error_free"
                  ? error_free_stages(one.name, size)
                  : cut_stages(one.name, size, scene, part_compensator(one.case_name)));
  return stages;
}

/// Returns the file of an instrument; an input error if it has no reading.
Measured whole(Measured one, const Scene& scene, const std::string& instrument) {
  if (one.readings == 0)
    throw BadInput(scene.file.string(), 0, 0, "readings of " + instrument, "none");
  return one;
}

}  // namespace

PartReadingsFile measured_part(const Scene& scene, const PartInstrumentDescription& instrument) {
  return cut_and_measure(scene, instrument).file;
}

std::vector<Measured> measure(const std::filesystem::path& file, const MeasureOptions& options) {
  const Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const InstrumentSelection instruments = chosen(scene, options.instruments);
  if (instruments.of_machine.empty() && instruments.of_part.empty())
    throw BadInput(file.string(), 0, 0, "[[instrument]] tables, or --instrument NAME", "none");
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  // A file that may not be written is reported before anything is measured.
  for (const InstrumentDescription& one : instruments.of_machine)
    check_file(folder / (one.instrument.name + ".csv"));
  for (const PartInstrumentDescription& one : instruments.of_part)
    check_file(folder / (one.name + ".csv"));
  std::vector<Measured> written;
  ProgressLine progress(stages_of(scene, instruments));
  if (!instruments.of_machine.empty()) progress.begin("machine");
  const std::vector<Readings> all = measured(scene, instruments.of_machine);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Readings& readings = all[i];
    const InstrumentDescription& one = instruments.of_machine[i];
    const ResultFile csv = folder / (one.instrument.name + ".csv");
    written.push_back(whole({csv.path(), readings.plan.measurements.size(),
                             readings.plan.set_ups.size(), readings.plan.duration_s},
                            scene, one.instrument.name));
    // Warnings of the scene are reported once, not for every instrument.
    if (i == 0) written.back().warnings = value_warnings(scene);
    write_table(csv, to_text(readings));
  }
  for (const PartInstrumentDescription& one : instruments.of_part) {
    progress.begin(one.name);
    const PartMeasurement part = cut_and_measure(scene, one, to(progress));
    const ResultFile csv = folder / (one.name + ".csv");
    const Eigen::VectorXd& t = part.file.readings.time_s;
    written.push_back(whole({csv.path(), std::size_t(t.size()), 1,
                             t.size() > 0 ? t.maxCoeff() - t.minCoeff() : 0.0, part.warnings},
                            scene, one.name));
    write_table(csv, to_text(part.file));
  }
  return written;
}

namespace {

/// Measures and prints the files written. Warnings go to stderr, so that JSON stays valid.
Exit print_measurements(const CommonOptions& common, const std::vector<std::string>& instruments) {
  MeasureOptions options;
  options.overrides = overrides(common);
  options.instruments = instruments;
  options.folder = result_folder(common) / (common.out.empty() ? "readings" : "");
  options.permissions = common.permissions;
  const std::vector<Measured> all = measure(common.scene, options);
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  double hours = 0.0;
  for (const Measured& one : all) {
    json.push_back({{"file", one.file.string()},
                    {"readings", one.readings},
                    {"set_ups", one.set_ups},
                    {"hours", one.duration_s / 3600.0},
                    {"warnings", one.warnings}});
    print_warnings(one.warnings);
    hours += one.duration_s / 3600.0;
  }
  if (common.json) {
    print("{}", Lines(json_text(json)));
    return Exit::Ok;
  }
  print("{:>10} {:>9} {:>9}   file\n", "readings", "set-ups", "hours");
  for (const Measured& one : all)
    print("{:>10} {:>9} {:>9.2f}   {}\n", one.readings, one.set_ups, one.duration_s / 3600.0,
          one.file.string());
  print("\n{:.1f} hours on a real machine, setting up included\n", hours);
  return Exit::Ok;
}

}  // namespace

Command measure_command(CommonOptions& common) {
  const auto instruments = std::make_shared<std::vector<std::string>>();
  return {
      "measure",
      "Measure the machine of a scene with virtual instruments",
      {"abbe measure scenes/gantry_calibration.toml --out out/calibration",
       "abbe measure scenes/gantry_calibration.toml --instrument ball_bar --seed 7 --out "
       "out/ball_bar"},
      scene_options(common, {{"--out", &common.out, "folder for the readings (out/SCENE/readings)"},
                             force_option(common),
                             trust_option(common),
                             {"--instrument", instruments.get(),
                              "name of an [[instrument]] of the scene, or a kind such as laser, "
                              "ball_bar, r_test (repeatable; all of the scene)"}}),
      [instruments, &common] { return print_measurements(common, *instruments); }};
}

namespace {

/// Returns all files that an identification writes.
std::vector<std::filesystem::path> all_of(const BeliefFiles& files) {
  std::vector<std::filesystem::path> all{files.belief, files.report, files.picture};
  if (files.thermal) all.push_back(*files.thermal);
  return all;
}

/// Returns the stages of an identification, by the size of the readings; a row has about 60 bytes.
std::vector<Stage> stages_of(const std::vector<std::filesystem::path>& files,
                             const IdentifyOptions& options) {
  // Seconds for a row on an average computer; the progress line corrects them by its own
  // measurements.
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
  const Writer writer{options.permissions, files};  // readings are never overwritten
  const BeliefFiles out = belief_files(options);
  // All outputs are checked before a long fit begins.
  for (const std::filesystem::path& file : all_of(out)) check_file(file, writer);
  ProgressLine progress(stages_of(files, options), instead);
  progress.begin("identify");
  Identified found = identified(files, options, to(progress));
  progress.begin("write");
  progress.report("draw", 0.0);
  write_table(result_file(out.belief, writer), belief_text(found));
  write_json(result_file(out.report, writer), to_json(found));
  if (out.thermal) write_table(result_file(*out.thermal, writer), thermal_half_text(found));
  // Only the chain method fits curves.
  const auto* fit = std::get_if<ChainFit>(&found.fit);
  if (!fit || fit->curves.empty()) return found;
  write_curves_picture(result_file(out.picture, writer), fit->curves, found.nominal, files);
  return found;
}

namespace {

/// Arguments of the command line.
struct IdentifyArguments {
  std::vector<std::filesystem::path> readings;
  std::string basis = "legendre";
  std::string method = "chain";
  std::vector<std::string> pitch;
  IdentifyOptions options;
  bool report = false;
  std::string language = "en";
};

/// Parses "X=16", the pitch of an axis's screw.
std::pair<char, double> parse_pitch(const std::string& text) {
  const auto period = text.size() > 2 && text[1] == '=' ? number_of(text.substr(2)) : std::nullopt;
  if (!period || *period <= 0.0)
    throw BadUsage("--pitch", "expected AXIS=MM such as X=16, seen " + text);
  return {text[0], *period};
}

/// Throws if an option is given that the method does not use and would ignore.
void check_options(const IdentifyArguments& words) {
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

/// Checks the arguments, identifies and prints the result. All output paths are checked first,
/// because a long fit must not be lost.
Exit print_identification(const CommonOptions& common, IdentifyArguments words) {
  using errors::identification::Basis;
  check_options(words);
  words.options.model.slides = words.basis == "polynomial" ? Basis::Polynomial
                               : words.basis == "spline"   ? Basis::Spline
                                                           : Basis::Legendre;
  for (const std::string& one : words.pitch) words.options.model.pitch.insert(parse_pitch(one));
  // --constants frees both the constants of error motions and the placement of the workpiece, each
  // of which hides in a zero or a position of a set-up.
  words.options.model.placement = words.options.model.constants;
  words.options.method = words.method == "step_diagonal" ? IdentifyOptions::Method::StepDiagonal
                         : words.method == "composite"   ? IdentifyOptions::Method::Composite
                         : words.method == "thermal"     ? IdentifyOptions::Method::Thermal
                                                         : IdentifyOptions::Method::Chain;
  const bool thermal = words.options.method == IdentifyOptions::Method::Thermal;
  words.options.out = output_file(common.out.empty() ? "out" : common.out,
                                  thermal ? "belief_thermal.txt" : "belief.toml");
  // The report and the picture have the name of the belief file with these extensions.
  for (const char* taken : {".json", ".png", ".csv", ".html"})
    if (words.options.out.extension() == taken)
      throw BadUsage(
          "--out",
          fmt::format("expected a belief file such as belief.toml (report and picture stand "
                      "beside it), seen {}",
                      words.options.out.string()));
  // The same file may have two names, so they are compared by what they refer to.
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
    write_file(result_file(page, writer), page_html(figures));
  } else {
    remove_file(result_file(page, writer));  // a page of an earlier identification would describe
                                             // another belief
  }
  print("{}", Lines(common.json ? json_text(to_json(found)) : identify_text(found)));
  return Exit::Ok;
}

/// Returns the options of the command; values go directly into the options of the identification
/// where they need no parsing.
std::vector<Option> identify_options(CommonOptions& common, IdentifyArguments& words) {
  IdentifyOptions& options = words.options;
  return {
      {"READINGS", &words.readings, "files that measure wrote"},
      {"--basis", &words.basis, "curves of the slides (legendre)",
       OneOf{{"legendre", "polynomial", "spline"}}},
      {"--order", &options.model.order, "of those curves (4)", Between{0, 60}},
      {"--harmonics", &options.model.harmonics, "of rotary axes, per turn (3)", Between{0, 60}},
      {"--choose-orders", &options.choose_orders, "choose every order by cross-validation"},
      {"--most", &options.orders.most, "highest order that is tried (10)", Between{1, 60}},
      {"--elements", &options.model.only, "find these alone: EXX,EYX,EC0Y", CommaSeparated{}},
      {"--pitch", &words.pitch, "pitch of screws, mm: X=16,Y=16; two harmonics in the positioning",
       CommaSeparated{}},
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
       CommaSeparated{}},
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

Command identify_command(CommonOptions& common) {
  const auto words = std::make_shared<IdentifyArguments>();
  return {"identify",
          "Find the errors of a machine from readings; write a belief file",
          {"abbe identify out/calibration/*.csv --choose-orders --pitch X=16,Y=16,Z=12 --out "
           "out/belief.toml",
           "abbe identify out/day/drift.csv --method thermal --sensor-count 4 --out "
           "out/belief_thermal.txt"},
          identify_options(common, *words),
          [words, &common] { return print_identification(common, *words); }};
}

EvaluationOutcome evaluate(const std::filesystem::path& file, const EvaluateOptions& options) {
  EvaluationOutcome evaluated{evaluate_readings(file), {}};
  if (options.folder.empty()) return evaluated;
  const Evaluation& evaluation = evaluated.evaluation;
  const ResultFolder folder(options.folder, {options.permissions, {file}});
  stop_if_interrupted();
  const ResultFile json = folder / "evaluation.json";
  // The JSON is written first, so that a failing picture does not lose the figures.
  write_json(json, to_json(evaluation));
  evaluated.pictures = evaluation.part
                           ? write_part_picture(folder, *evaluation.part, file.string())
                           : write_test_pictures(folder, evaluation.tests, file.string());
  write_json(json, to_json(evaluation, evaluated.pictures));
  if (options.report_language.empty()) {
    remove_file(folder / "report.html");  // a page of an earlier evaluation would show other
                                          // readings
    return evaluated;
  }
  FiguresPage page = evaluate_page(evaluation);
  page.language = options.report_language;
  page.command = options.permissions.command;
  write_file(folder / "report.html", page_html(page));
  return evaluated;
}

namespace {

struct EvaluateArguments {
  std::filesystem::path readings;
  bool report = false;
  std::string language = "en";
};

Exit print_evaluation(const CommonOptions& common, const EvaluateArguments& words) {
  const std::filesystem::path& readings = words.readings;
  EvaluateOptions options;
  if (words.report) options.report_language = words.language;
  // The default folder has the name of the readings.
  options.folder = common.out.empty() ? std::filesystem::path("out") / readings.stem() : common.out;
  options.permissions = common.permissions;
  const EvaluationOutcome done = evaluate(readings, options);
  print("{}", Lines(common.json ? json_text(to_json(done.evaluation, done.pictures))
                                : to_text(done.evaluation, done.pictures)));
  return Exit::Ok;
}

}  // namespace

Command evaluate_command(CommonOptions& common) {
  const auto words = std::make_shared<EvaluateArguments>();
  return {"evaluate",
          "Evaluate readings by the standards (ISO 230, 25178)",
          {"abbe evaluate out/calibration/laser.csv --out out/laser",
           "abbe evaluate out/calibration/ball_bar.csv --json"},
          {{"READINGS", &words->readings,
            "a file that measure wrote, position readings as CSV, or a laser's position file"},
           json_option(common),
           {"--out", &common.out, "folder for report and pictures (out/NAME)"},
           {"--report", &words->report,
            "besides, report.html: tables and charts with the values under the cursor"},
           language_option(words->language),
           force_option(common)},
          [words, &common] { return print_evaluation(common, *words); }};
}

}  // namespace abbe::sim
