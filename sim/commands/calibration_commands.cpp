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

/// Instruments of a scene by what they measure.
struct InstrumentSelection {
  std::vector<InstrumentDescription> machine_instruments;
  std::vector<PartInstrumentDescription> part_instruments;
};

/// Returns the instruments of these names, or all instruments if there are none. An unknown name is
/// an input error.
InstrumentSelection select_instruments(const Scene& scene, const std::vector<std::string>& names) {
  if (names.empty()) return {scene.instruments, scene.part_instruments};
  InstrumentSelection result;
  for (const std::string& name : names) {
    if (auto part_instrument = find_part_instrument(scene, name))
      result.part_instruments.push_back(std::move(*part_instrument));
    else
      result.machine_instruments.push_back(find_instrument(scene, name));
  }
  return result;
}

/// The readings of a part, and the warnings of the cut that they were measured on.
struct PartMeasurement {
  PartReadingsFile file;
  std::vector<std::string> warnings;
};

/// Cuts the part in the case that the instrument names, and measures it.
PartMeasurement cut_and_measure(const Scene& scene, const PartInstrumentDescription& instrument,
                                const Progress& progress = {}) {
  const Job job = check_placement(prepare(scene, progress));
  const Cut finished_cut = cut_named_case(job, instrument.case_name, progress);
  check_cuts_part(job, finished_cut);
  return {measure_cut_part(job, finished_cut, instrument), warnings_of(job, finished_cut)};
}

/// Returns the stages of measuring. The machine takes a moment, a part the time of a cut.
std::vector<Stage> measuring_stages(const Scene& scene, const InstrumentSelection& selection) {
  std::vector<Stage> stages;
  if (!selection.machine_instruments.empty())
    stages = {{"machine", "measure", 0.1 * double(selection.machine_instruments.size())}};
  const WorkSize size = expected_size(scene);
  for (const PartInstrumentDescription& instrument : selection.part_instruments)
    stages =
        std::move(stages) + scene_preparation_stages(instrument.name, size) +
        (instrument.case_name == "error_free"
             ? error_free_stages(instrument.name, size)
             : cut_stages(instrument.name, size, scene, parse_compensator(instrument.case_name)));
  return stages;
}

/// Returns `file` unchanged. Throws BadInput if it has no readings.
MeasuredFile require_readings(MeasuredFile file, const Scene& scene,
                              const std::string& instrument) {
  if (file.readings == 0)
    throw BadInput(scene.file.string(), 0, 0, "readings of " + instrument, "none");
  return file;
}

}  // namespace

PartReadingsFile measure_cut_part(const Scene& scene, const PartInstrumentDescription& instrument) {
  return cut_and_measure(scene, instrument).file;
}

std::vector<MeasuredFile> measure(const std::filesystem::path& file,
                                  const MeasureOptions& options) {
  const Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const InstrumentSelection instruments = select_instruments(scene, options.instruments);
  if (instruments.machine_instruments.empty() && instruments.part_instruments.empty())
    throw BadInput(file.string(), 0, 0, "[[instrument]] tables, or --instrument NAME", "none");
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  // Files that must not be written are reported before anything is measured.
  for (const InstrumentDescription& description : instruments.machine_instruments)
    check_file(folder / (description.instrument.name + ".csv"));
  for (const PartInstrumentDescription& description : instruments.part_instruments)
    check_file(folder / (description.name + ".csv"));
  std::vector<MeasuredFile> measurements;
  ProgressLine progress(measuring_stages(scene, instruments));
  if (!instruments.machine_instruments.empty()) progress.begin("machine");
  const std::vector<Readings> readings_of_machine =
      measure_machine(scene, instruments.machine_instruments);
  for (std::size_t i = 0; i < readings_of_machine.size(); ++i) {
    const Readings& readings = readings_of_machine[i];
    const InstrumentDescription& description = instruments.machine_instruments[i];
    const ResultFile csv = folder / (description.instrument.name + ".csv");
    measurements.push_back(
        require_readings({csv.path(), readings.plan.measurements.size(),
                          readings.plan.set_ups.size(), readings.plan.duration_s},
                         scene, description.instrument.name));
    // Warnings of the scene are reported once, not for every instrument.
    if (i == 0) measurements.back().warnings = value_warnings(scene);
    write_table(csv, to_text(readings));
  }
  for (const PartInstrumentDescription& description : instruments.part_instruments) {
    progress.begin(description.name);
    const PartMeasurement part = cut_and_measure(scene, description, progress_function(progress));
    const ResultFile csv = folder / (description.name + ".csv");
    const Eigen::VectorXd& t = part.file.readings.time_s;
    measurements.push_back(
        require_readings({csv.path(), std::size_t(t.size()), 1,
                          t.size() > 0 ? t.maxCoeff() - t.minCoeff() : 0.0, part.warnings},
                         scene, description.name));
    write_table(csv, to_text(part.file));
  }
  return measurements;
}

namespace {

/// Measures and prints a list of the files. Warnings go to stderr, so that JSON stays valid.
Exit print_measurements(const CommonOptions& common, const std::vector<std::string>& instruments) {
  MeasureOptions options;
  options.overrides = overrides(common);
  options.instruments = instruments;
  options.folder = result_folder(common) / (common.out.empty() ? "readings" : "");
  options.permissions = common.permissions;
  const std::vector<MeasuredFile> files = measure(common.scene, options);
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  double hours = 0.0;
  for (const MeasuredFile& measured_file : files) {
    json.push_back({{"file", measured_file.file.string()},
                    {"readings", measured_file.readings},
                    {"set_ups", measured_file.set_ups},
                    {"hours", measured_file.duration_s / 3600.0},
                    {"warnings", measured_file.warnings}});
    print_warnings(measured_file.warnings);
    hours += measured_file.duration_s / 3600.0;
  }
  if (common.json) {
    print("{}", MultilineText(json_text(json)));
    return Exit::Ok;
  }
  print("{:>10} {:>9} {:>9}   file\n", "readings", "set-ups", "hours");
  for (const MeasuredFile& measured_file : files)
    print("{:>10} {:>9} {:>9.2f}   {}\n", measured_file.readings, measured_file.set_ups,
          measured_file.duration_s / 3600.0, measured_file.file.string());
  print("\n{:.1f} hours on a real machine, including set-up time\n", hours);
  return Exit::Ok;
}

}  // namespace

Command measure_command(CommonOptions& common) {
  const auto instruments = std::make_shared<std::vector<std::string>>();
  return {"measure",
          "Measure the machine of a scene with virtual instruments",
          {"abbe measure scenes/gantry_calibration.toml --out out/calibration",
           "abbe measure scenes/gantry_calibration.toml --instrument ball_bar --seed 7 --out "
           "out/ball_bar"},
          scene_options(common,
                        {{"--out", &common.out, "folder for the readings (out/SCENE/readings)"},
                         force_option(common),
                         trust_option(common),
                         {"--instrument", instruments.get(),
                          "name of an [[instrument]] of the scene, or a kind such as laser, "
                          "ball_bar, r_test (repeatable; default: all instruments of the scene)"}}),
          [instruments, &common] { return print_measurements(common, *instruments); }};
}

namespace {

/// Returns all files that an identification writes.
std::vector<std::filesystem::path> output_files(const BeliefFiles& files) {
  std::vector<std::filesystem::path> paths{files.belief, files.report, files.picture,
                                           identification_page_file(files.report)};
  if (files.thermal) paths.push_back(*files.thermal);
  return paths;
}

/// Returns the stages of an identification. They are predicted from the size of the files, with
/// about 60 bytes a row.
std::vector<Stage> identification_stages(const std::vector<std::filesystem::path>& files,
                                         const IdentificationOptions& options) {
  // Times on an average computer; the progress line corrects them by measurement.
  constexpr double read_s_per_row = 1e-5, fit_s_per_row = 4e-4, order_s_per_row = 2e-4;
  double rows = 0.0;
  for (const std::filesystem::path& file : files) {
    std::error_code failure;
    const auto bytes = std::filesystem::file_size(file, failure);
    if (!failure) rows += double(bytes) / 60.0;
  }
  std::vector<Stage> stages{{"identify", "read", read_s_per_row * rows}};
  if (options.choose_orders)
    stages.push_back({"identify", "orders", order_s_per_row * options.orders.max_order * rows});
  stages.push_back({"identify", "fit", fit_s_per_row * rows});
  stages.push_back({"write", "draw", 2.0});
  return stages;
}

}  // namespace

IdentificationResult identify(const std::vector<std::filesystem::path>& files,
                              const IdentificationOptions& options, const Progress& observer) {
  const Writer writer{options.permissions, files};  // readings are never overwritten
  const BeliefFiles outputs = belief_files(options);
  // All outputs are checked before a long fit begins.
  for (const std::filesystem::path& file : output_files(outputs)) check_file(file, writer);
  ProgressLine progress(identification_stages(files, options), observer);
  progress.begin("identify");
  IdentificationResult result = identified(files, options, progress_function(progress));
  progress.begin("write");
  progress.report("draw", 0.0);
  write_table(result_file(outputs.belief, writer), belief_file_text(result));
  write_json(result_file(outputs.report, writer), to_json(result));
  if (outputs.thermal)
    write_table(result_file(*outputs.thermal, writer), thermal_half_file_text(result));
  FiguresPage page = identification_page(result);
  page.command = options.permissions.command;
  write_json(result_file(identification_page_file(outputs.report), writer), to_json(page));
  // Only the chain method fits curves.
  const auto* fit = std::get_if<ChainFit>(&result.fit);
  if (!fit || fit->curves.empty()) return result;
  write_curves_picture(result_file(outputs.picture, writer), fit->curves, result.nominal, files);
  return result;
}

namespace {

/// Arguments of `abbe identify`.
struct IdentifyArguments {
  std::vector<std::filesystem::path> readings;
  std::string basis = "legendre";
  std::string method = "chain";
  std::vector<std::string> pitch;
  IdentificationOptions options;
  bool report = false;
  std::string language = "en";
};

/// Parses the pitch of the screw of an axis, such as "X=16".
std::pair<char, double> parse_pitch(const std::string& text) {
  const auto pitch_mm =
      text.size() > 2 && text[1] == '=' ? number_of(text.substr(2)) : std::nullopt;
  if (!pitch_mm || *pitch_mm <= 0.0)
    throw BadUsage("--pitch", "expected AXIS=MM such as X=16, seen " + text);
  return {text[0], *pitch_mm};
}

/// Throws BadUsage for an option that the method would ignore.
void check_options(const IdentifyArguments& arguments) {
  const IdentificationOptions defaults;
  const IdentificationOptions& options = arguments.options;
  const auto require_method = [&](bool is_given, const char* option, std::string_view methods) {
    if (is_given && methods.find(arguments.method) == std::string_view::npos)
      throw BadUsage(option,
                     fmt::format("expected --method {}, seen {}", methods, arguments.method));
  };
  require_method(!options.sensors.empty(), "--sensors", "step_diagonal, composite or thermal");
  require_method(options.sensor_count != defaults.sensor_count, "--sensor-count", "thermal");
  require_method(options.margin != defaults.margin, "--margin", "thermal or composite");
  require_method(options.model.order != defaults.model.order, "--order", "chain or composite");
  require_method(options.choose_orders, "--choose-orders", "chain");
  require_method(!arguments.pitch.empty(), "--pitch", "chain");
  require_method(options.estimate.outlier_limit != defaults.estimate.outlier_limit, "--outliers",
                 "chain");
}

/// Checks the arguments, identifies and prints the result. All output paths are checked first, so
/// that the result of a long fit is not lost.
Exit print_identification(const CommonOptions& common, IdentifyArguments arguments) {
  using errors::identification::Basis;
  check_options(arguments);
  arguments.options.model.slides = arguments.basis == "polynomial" ? Basis::Polynomial
                                   : arguments.basis == "spline"   ? Basis::Spline
                                                                   : Basis::Legendre;
  for (const std::string& pitch : arguments.pitch)
    arguments.options.model.pitch.insert(parse_pitch(pitch));
  // --constants frees the constants of error motions and the placement of the workpiece. Each of
  // them is indistinguishable from a zero or a position of a set-up.
  arguments.options.model.placement = arguments.options.model.constants;
  arguments.options.method =
      arguments.method == "step_diagonal" ? IdentificationOptions::Method::StepDiagonal
      : arguments.method == "composite"   ? IdentificationOptions::Method::Composite
      : arguments.method == "thermal"     ? IdentificationOptions::Method::Thermal
                                          : IdentificationOptions::Method::Chain;
  const bool is_thermal = arguments.options.method == IdentificationOptions::Method::Thermal;
  arguments.options.out = output_file(common.out.empty() ? "out" : common.out,
                                      is_thermal ? "belief_thermal.txt" : "belief.toml");
  // The report and the picture have the name of the belief file with these extensions.
  for (const char* extension : {".json", ".png", ".csv", ".html"})
    if (arguments.options.out.extension() == extension)
      throw BadUsage("--out", fmt::format("expected a belief file such as belief.toml (report and "
                                          "picture are written next to it), seen {}",
                                          arguments.options.out.string()));
  // A file may have two names, so the files are compared, not the paths.
  for (const std::filesystem::path& readings : arguments.readings) {
    std::error_code ignored;
    if (std::filesystem::equivalent(readings, arguments.options.out, ignored))
      throw BadUsage("--out", "expected a file other than the readings");
  }
  arguments.options.permissions = common.permissions;
  const std::filesystem::path page =
      std::filesystem::path(arguments.options.out).replace_extension(".html");
  const Writer writer{common.permissions, arguments.readings};
  if (arguments.report) check_file(page, writer);
  const IdentificationResult identified = identify(arguments.readings, arguments.options);
  if (arguments.report) {
    FiguresPage figures = identification_page(identified);
    figures.language = arguments.language;
    figures.command = common.permissions.command;
    write_file(result_file(page, writer), page_html(figures));
  } else {
    remove_file(result_file(page, writer));  // an earlier page would describe another belief
  }
  print("{}", MultilineText(common.json ? json_text(to_json(identified))
                                        : identification_text(identified)));
  return Exit::Ok;
}

/// Returns the options of the command. Values that need no parsing are stored directly in the
/// options of the identification.
std::vector<Option> identify_options(CommonOptions& common, IdentifyArguments& arguments) {
  IdentificationOptions& options = arguments.options;
  return {
      {"READINGS", &arguments.readings, "files written by abbe measure"},
      {"--basis", &arguments.basis, "basis functions of the slides (legendre)",
       OneOf{{"legendre", "polynomial", "spline"}}},
      {"--order", &options.model.order, "order of these functions (4)", NumberRange{0, 60}},
      {"--harmonics", &options.model.harmonics, "harmonics of rotary axes, per revolution (3)",
       NumberRange{0, 60}},
      {"--choose-orders", &options.choose_orders, "choose all orders by cross-validation"},
      {"--most", &options.orders.max_order, "highest order to try (10)", NumberRange{1, 60}},
      {"--elements", &options.model.only, "identify only these: EXX,EYX,EC0Y", CommaSeparated{}},
      {"--pitch", &arguments.pitch,
       "pitch of the ball screws, mm: X=16,Y=16; adds two harmonics to the positioning",
       CommaSeparated{}},
      {"--constants", &options.model.constants,
       "also identify the constants of error motions and the location of the workpiece on a table; "
       "each is confounded with an axis zero or a set-up position"},
      {"--outliers", &options.estimate.outlier_limit,
       "reject readings beyond this many standard deviations (0: none)", NumberRange{0, 1000000}},
      {"--method", &arguments.method,
       "chain: any readings, with the exact kinematic chain; step_diagonal: the published method; "
       "composite: positioning measured at several starts, gives a cold curve and "
       "NAME_thermal.txt; thermal: a day of readings, for [belief.thermal]",
       OneOf{{"chain", "step_diagonal", "composite", "thermal"}}},
      {"--sensors", &options.sensors,
       "with step_diagonal, composite or thermal: temperature sensors for the regression over "
       "several starts (thermal: chosen automatically)",
       CommaSeparated{}},
      {"--sensor-count", &options.sensor_count,
       "with thermal: number of sensors to choose if --sensors is not given (4)",
       NumberRange{1, 100}},
      {"--margin", &options.margin,
       "with thermal or composite: fraction of its trained range by which a sensor may exceed it "
       "(0.1)",
       NumberRange{0, 2}},
      json_option(common),
      {"--out", &common.out,
       "belief file, or folder for it (out/belief.toml; thermal: out/belief_thermal.txt; composite "
       "writes NAME_thermal.txt next to NAME.toml)"},
      {"--report", &arguments.report,
       "also write NAME.html: curves, residuals and coefficients, with values under the cursor"},
      language_option(arguments.language),
      force_option(common),
      threads_option(common, "maximum number of threads")};
}

}  // namespace

Command identify_command(CommonOptions& common) {
  const auto arguments = std::make_shared<IdentifyArguments>();
  return {"identify",
          "Identify the errors of a machine from readings and write a belief file",
          {"abbe identify out/calibration/*.csv --choose-orders --pitch X=16,Y=16,Z=12 --out "
           "out/belief.toml",
           "abbe identify out/day/drift.csv --method thermal --sensor-count 4 --out "
           "out/belief_thermal.txt"},
          identify_options(common, *arguments),
          [arguments, &common] { return print_identification(common, *arguments); }};
}

EvaluationOutcome evaluate(const std::filesystem::path& file, const EvaluateOptions& options) {
  EvaluationOutcome outcome{evaluate_readings(file), {}};
  if (options.folder.empty()) return outcome;
  const Evaluation& evaluation = outcome.evaluation;
  const ResultFolder folder(options.folder, {options.permissions, {file}});
  stop_if_interrupted();
  const ResultFile json = folder / "evaluation.json";
  // The JSON is written first, so that its figures are not lost if a picture fails.
  write_json(json, to_json(evaluation));
  outcome.pictures = evaluation.part ? write_part_picture(folder, *evaluation.part, file.string())
                                     : write_test_pictures(folder, evaluation.tests, file.string());
  write_json(json, to_json(evaluation, outcome.pictures));
  FiguresPage page = evaluation_page(evaluation);
  page.command = options.permissions.command;
  write_json(folder / "page.json", to_json(page));
  if (options.report_language.empty()) {
    remove_file(folder / "report.html");  // an earlier page would show other readings
    return outcome;
  }
  page.language = options.report_language;
  page.files = page_files({file, json.path()});
  write_file(folder / "report.html", page_html(page));
  return outcome;
}

namespace {

struct EvaluateArguments {
  std::filesystem::path readings;
  bool report = false;
  std::string language = "en";
};

Exit print_evaluation(const CommonOptions& common, const EvaluateArguments& arguments) {
  const std::filesystem::path& readings = arguments.readings;
  EvaluateOptions options;
  if (arguments.report) options.report_language = arguments.language;
  // The default folder is named after the readings.
  options.folder = common.out.empty() ? std::filesystem::path("out") / readings.stem() : common.out;
  options.permissions = common.permissions;
  const EvaluationOutcome outcome = evaluate(readings, options);
  print("{}", MultilineText(common.json ? json_text(to_json(outcome.evaluation, outcome.pictures))
                                        : to_text(outcome.evaluation, outcome.pictures)));
  return Exit::Ok;
}

}  // namespace

Command evaluate_command(CommonOptions& common) {
  const auto arguments = std::make_shared<EvaluateArguments>();
  return {"evaluate",
          "Evaluate readings to the standards (ISO 230, 25178)",
          {"abbe evaluate out/calibration/laser.csv --out out/laser",
           "abbe evaluate out/calibration/ball_bar.csv --json"},
          {{"READINGS", &arguments->readings,
            "a file written by abbe measure, position readings as CSV, or the position file of a "
            "laser"},
           json_option(common),
           {"--out", &common.out, "folder for report and pictures (out/NAME)"},
           {"--report", &arguments->report,
            "also write report.html: tables and charts, with values under the cursor"},
           language_option(arguments->language),
           force_option(common)},
          [arguments, &common] { return print_evaluation(common, *arguments); }};
}

}  // namespace abbe::sim
