#include <cstdio>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "sim/commands/compare.h"
#include "sim/commands/evaluate_command.h"
#include "sim/commands/export_tables.h"
#include "sim/commands/identify_command.h"
#include "sim/commands/measure_command.h"
#include "sim/commands/pose_command.h"
#include "sim/commands/rewrite_command.h"
#include "sim/compensation/plug_in.h"
#include "sim/cut/reach.h"
#include "sim/files/one_lined.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/files/versions.h"
#include "sim/report/description_report.h"
#include "sim/report/evaluation_report.h"
#include "sim/report/identify_text.h"
#include "sim/report/pictures.h"
#include "sim/report/sensor_choices_text.h"
#include "sim/report/summary_report.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene_names.h"
#include "sim/scene/trust.h"
#include "sim/study/ranks.h"
#include "sim/study/run_study.h"
#include "sim/study/slurm.h"

namespace abbe::sim {
namespace {

enum Exit {
  ok = 0,
  limit_exceeded = 1,
  usage = 2,
  input = 3,
  numerical = 4,
  output = 5,
  plug_in = 6,
  interrupted = 130
};

/// What several commands take.
struct Common {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> set;
  std::optional<std::int64_t> seed;
  int threads = 0;
  bool json = false;
  Permissions permissions;
};

std::vector<Override> overrides(const Common& common) {
  std::vector<Override> all;
  for (const std::string& text : common.set) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw CLI::ValidationError("--set", "expected key=value, seen " + text);
    all.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  if (common.seed) all.emplace_back("seed", std::to_string(*common.seed));
  return all;
}

RunOptions run_options(const Common& common) {
  RunOptions options;
  options.overrides = overrides(common);
  options.folder =
      common.out.empty() ? std::filesystem::path("out") / common.scene.stem() : common.out;
  options.permissions = common.permissions;
  return options;
}

void add_force(CLI::App& command, Common& common) {
  command.add_flag(
      "--force", common.permissions.force,
      "write into a folder, or over a file, that abbe did not make; what the run reads "
      "is never touched");
}

void add_trust(CLI::App& command, Common& common) {
  command.add_flag(
      "--trust", common.permissions.trust,
      "run the programs that the file names (check lists those of a scene); folders to "
      "trust for good stand in ~/.config/abbe/trust");
}

void add_common(CLI::App& command, Common& common, bool writes) {
  command.add_option("SCENE", common.scene, "scene file (TOML); its format is in scenes/README.md")
      ->required();
  command
      .add_option("--set", common.set,
                  "change a value of the scene: --set errors.scale=2 (repeatable)")
      ->type_name("KEY=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  command.add_option("--seed", common.seed, "seed of everything that is random")
      ->check(CLI::Range(std::int64_t(0), std::numeric_limits<std::int64_t>::max()));
  command
      .add_option("--threads", common.threads,
                  "most threads to use (all); results do not depend on it")
      ->check(CLI::Range(1, 1024));
  command.add_flag("--json", common.json, "print JSON instead of text");
  if (!writes) return;
  command.add_option("--out", common.out,
                     "folder for every file (out/SCENE): new, empty, or of abbe's results");
  add_force(command, common);
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print(stderr, "abbe: warning: {}\n", warning);
}

int finish(const Common& common, const RunOptions& options, const Outcome& outcome) {
  const bool many = std::holds_alternative<Comparison>(outcome.figures);
  std::visit(
      [&](const auto& figures) {
        print("{}", Lines(common.json ? json_text(to_json(figures)) : to_text(figures)));
      },
      outcome.figures);
  if (!common.json)
    print("{}files in {}{}\n", Lines(many ? "\n" : ""), options.folder.string(),
          many && draws_pictures() ? "; comparison.png shows all cases on one scale" : "");
  if (!common.json && !outcome.sensors.is_null())
    print("{}", Lines(sensor_choices_text(one_lined(outcome.sensors))));
  std::visit([](const auto& figures) { print_warnings(figures.warnings); }, outcome.figures);
  if (!draws_pictures())
    print(stderr, "abbe: warning: this program was built without VTK: no pictures and no .vtp\n");
  for (const std::string& limit : outcome.exceeded) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : outcome.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!outcome.failed.empty()) return plug_in;
  return outcome.exceeded.empty() ? ok : limit_exceeded;
}

/// Files of plug-ins, each there and with a name that a folder can have.
std::vector<std::filesystem::path> plug_ins(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& file : files) {
    try {
      plug_in_case(file);
    } catch (const std::invalid_argument& fault) {
      throw CLI::ValidationError("--compensator", fault.what());
    }
  }
  return files;
}

int run_command(const Common& common, const std::string& case_name,
                const std::vector<std::filesystem::path>& compensators) {
  RunOptions options = run_options(common);
  options.case_name = case_name;
  options.plug_ins = plug_ins(compensators);
  if (options.plug_ins.size() > 1 || (!case_name.empty() && !options.plug_ins.empty()))
    throw CLI::ValidationError("--compensator", "expected one case, a --case or a --compensator");
  if (!case_name.empty() && case_name != "error_free" && case_name != "uncompensated") {
    try {
      parse_case(case_name);
    } catch (const std::invalid_argument& fault) {
      throw CLI::ValidationError("--case", fault.what());
    }
  }
  return finish(common, options, run(common.scene, options));
}

int compare_command(const Common& common, const std::vector<std::filesystem::path>& compensators) {
  RunOptions options = run_options(common);
  options.plug_ins = plug_ins(compensators);
  return finish(common, options, compare(common.scene, options));
}

int pose(const Common& common, PoseCommand command) {
  command.json = common.json;
  command.permissions = common.permissions;
  pose_command(read_scene(common.scene, overrides(common)), command);
  return ok;
}

int check_command(const Common& common, bool picture) {
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = prepare(scene);
  check_reaches_part(job);
  Description description = describe(job);
  description.programs = judged(scene.programs, common.permissions);
  if (picture) {
    const ResultFolder folder(run_options(common).folder, writer_of(scene, common.permissions));
    write_check_picture(folder / "check.png", job);
    print(stderr, "picture in {}\n", (folder / "check.png").path().string());
  }
  print("{}", Lines(common.json ? json_text(to_json(description)) : to_text(description)));
  print_warnings(description.warnings);
  return ok;
}

int measure_command(const Common& common, const std::vector<std::string>& instruments) {
  MeasureOptions options;
  options.overrides = overrides(common);
  options.instruments = instruments;
  options.folder = run_options(common).folder / (common.out.empty() ? "readings" : "");
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
    return ok;
  }
  print("{:>10} {:>9} {:>9}   file\n", "readings", "set-ups", "hours");
  for (const Measured& one : all)
    print("{:>10} {:>9} {:>9.2f}   {}\n", one.readings, one.set_ups, one.duration_s / 3600.0,
          one.file.string());
  print("\n{:.1f} hours on a real machine, setting up included\n", hours);
  return ok;
}

/// Words of `identify`.
struct IdentifyWords {
  std::vector<std::filesystem::path> readings;
  std::string basis = "legendre";
  std::string method = "chain";
  std::vector<std::string> pitch;
  IdentifyOptions options;
};

/// "X=16": the pitch of an axis's screw.
std::pair<char, double> parse_pitch(const std::string& text) {
  const auto period = text.size() > 2 && text[1] == '=' ? number_of(text.substr(2)) : std::nullopt;
  if (!period || *period <= 0.0)
    throw CLI::ValidationError("--pitch", "expected AXIS=MM such as X=16, seen " + text);
  return {text[0], *period};
}

int identify_command(const Common& common, IdentifyWords words) {
  using errors::identification::Basis;
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
  words.options.out = common.out.empty() ? std::filesystem::path(thermal ? "out/belief_thermal.txt"
                                                                         : "out/belief.toml")
                                         : common.out;
  for (const char* taken : {".json", ".png", ".csv"})
    if (words.options.out.extension() == taken)
      throw CLI::ValidationError(
          "--out",
          fmt::format("expected a belief file such as belief.toml (report and picture stand "
                      "beside it), seen {}",
                      words.options.out.string()));
  for (const std::filesystem::path& readings : words.readings) {
    std::error_code ignored;
    if (std::filesystem::equivalent(readings, words.options.out, ignored))
      throw CLI::ValidationError("--out", "expected another file than the readings");
  }
  words.options.permissions = common.permissions;
  const nlohmann::ordered_json report = identify(words.readings, words.options);
  print("{}", Lines(common.json ? json_text(report) : identify_text(one_lined(report))));
  return ok;
}

/// Words of `export`.
struct ExportWords {
  std::string format;
  ExportOptions options;
};

int export_command(const Common& common, ExportWords words) {
  words.options.overrides = overrides(common);
  words.options.folder = run_options(common).folder / (common.out.empty() ? "tables" : "");
  words.options.permissions = common.permissions;
  using compensation::ControlFormat;
  for (const ControlFormat one : {ControlFormat::LinuxCnc, ControlFormat::Isg,
                                  ControlFormat::Siemens, ControlFormat::Heidenhain})
    if (words.format == compensation::to_string(one)) words.options.format = one;
  try {
    parse_case(words.options.case_name);
  } catch (const std::invalid_argument& fault) {
    throw CLI::ValidationError("--case", fault.what());
  }
  const nlohmann::ordered_json json = export_tables(common.scene, words.options);
  if (common.json) {
    print("{}", Lines(json_text(json)));
    return ok;
  }
  for (const auto& file : json["files"]) print("{}\n", file.get<std::string>());
  for (const auto& one : json["notes"]) print("{}\n", one.get<std::string>());
  for (const auto& one : json["left_out"])
    print(stderr, "abbe: warning: left out: {}\n", one.get<std::string>());
  return ok;
}

int rewrite_command(const Common& common, const std::string& case_name) {
  RewriteCommandOptions options;
  options.overrides = overrides(common);
  options.case_name = case_name;
  options.out = common.out;
  options.permissions = common.permissions;
  const nlohmann::ordered_json report = rewrite(common.scene, options);
  for (const auto& warning : report["warnings"])
    print(stderr, "abbe: warning: {}\n", warning.get<std::string>());
  print("{}", Lines(common.json ? json_text(report) : rewrite_text(one_lined(report))));
  return ok;
}

int evaluate_command(const Common& common, const std::filesystem::path& readings) {
  EvaluateOptions options;
  options.folder = common.out.empty() ? std::filesystem::path("out") / readings.stem() : common.out;
  options.permissions = common.permissions;
  const Evaluated done = evaluate(readings, options);
  print("{}", Lines(common.json ? json_text(to_json(done.evaluation, done.pictures))
                                : to_text(done.evaluation, done.pictures)));
  return ok;
}

/// What `study` takes besides.
struct StudyWords {
  bool show = false;
  bool merge = false;
  bool resume = true;
  bool slurm = false;
  std::string shard;
  study::SlurmOptions job;
};

study::Shard parse_shard(const std::string& text) {
  study::Shard shard;
  int end = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard.index, &shard.count, &end) != 2 ||
      std::size_t(end) != text.size() || shard.index < 0 || shard.count < 1 ||
      shard.index >= shard.count)
    throw CLI::ValidationError("--shard", "expected i/n with i from 0 to n - 1, seen " + text);
  return shard;
}

int print_slurm_script(const Common& common, const StudyWords& words,
                       const study::StudyOptions& options) {
  study::SlurmOptions job = words.job;
  job.study = common.scene;
  job.out = options.folder;
  job.program = std::filesystem::read_symlink("/proc/self/exe");
  job.trust = common.permissions.trust;
  // a mistake is reported now, not by every shard
  study::read_trusted_study(common.scene, options.overrides, common.permissions);
  print("{}", Lines(study::slurm_script(job)));
  return ok;
}

int study_command(int& argc, char**& argv, const Common& common, const StudyWords& words) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder =
      common.out.empty() ? std::filesystem::path("out") / common.scene.stem() : common.out;
  options.permissions = common.permissions;
  if (!words.shard.empty()) options.shard = parse_shard(words.shard);
  if (words.slurm) return print_slurm_script(common, words, options);
  const auto tell = [&](const study::StudyTold& told) {
    if (common.json)
      print("{}", Lines(json_text(told.json)));
    else
      print("{}", Lines(told.text));
    return ok;
  };
  if (words.show) return tell(study::show_study(common.scene, options));
  if (words.merge) return tell(study::merge_study(common.scene, options));
  const study::Ranks ranks = study::ranks(argc, argv);
  if (ranks.rank == 0) return tell(study::run_study(common.scene, options, ranks));
  try {
    study::run_study(common.scene, options, ranks);
    return ok;
  } catch (const std::exception&) {
    return numerical;  // rank 0 tells it, and ends all with its own code
  }
}

/// Everything that can stand on the command line.
struct CommandLine {
  Common common;
  std::vector<std::string> instruments;
  IdentifyWords identify;
  ExportWords exporting;
  std::filesystem::path readings;
  std::string case_name;
  std::vector<std::filesystem::path> compensators;
  PoseCommand pose;
  bool picture = false;
  RenderOptions rendering;
  StudyWords study;
};

void add_scene_commands(CLI::App& app, CommandLine& line) {
  CLI::App& run_app =
      *app.add_subcommand("run", "Cut one case of a scene (uncompensated unless --case)");
  add_common(run_app, line.common, true);
  run_app.add_option("--case", line.case_name,
                     "error_free, uncompensated or belief-strategy-channel");

  CLI::App& compare_app = *app.add_subcommand(
      "compare", "Cut error-free, uncompensated and every compensator of the scene");
  add_common(compare_app, line.common, true);
  for (CLI::App* one : {&run_app, &compare_app}) {
    add_trust(*one, line.common);
    one->add_option("--compensator", line.compensators,
                    "one of your own: a program that speaks JSON lines or a C library "
                    "(sim/compensation/README.md)")
        ->type_name("FILE")
        ->take_all()
        ->allow_extra_args(false);
  }

  CLI::App& check_app =
      *app.add_subcommand("check", "Validate a scene and say how it was understood; cut nothing");
  add_common(check_app, line.common, true);
  add_trust(check_app, line.common);
  check_app.add_flag("--picture", line.picture, "draw machine, part and path, errors magnified");
}

void add_pose_command(CLI::App& app, CommandLine& line) {
  CLI::App& pose_app =
      *app.add_subcommand("pose", "Where the tool is and should be: at a pose, many, everywhere");
  add_common(pose_app, line.common, false);
  add_force(pose_app, line.common);
  add_pose_options(pose_app, line.pose);
}

void add_render_command(CLI::App& app, CommandLine& line) {
  CLI::App& render_app =
      *app.add_subcommand("render", "Draw a finished result again, or a difference of two");
  render_app.add_option("RESULT", line.rendering.result, "residual.vtp or a folder that has one")
      ->required();
  render_app.add_option("--minus", line.rendering.minus,
                        "another result, taken away vertex by vertex");
  render_app
      .add_option("--line", line.rendering.line, "profile along x, y or radius instead of the map")
      ->check(CLI::IsMember({"x", "y", "radius"}));
  render_app.add_option("--out", line.rendering.out, "folder for the pictures (that of RESULT)");
  add_force(render_app, line.common);
  render_app.add_option("--threads", line.common.threads, "most threads to use")
      ->check(CLI::Range(1, 1024));
}

void add_measure_command(CLI::App& app, CommandLine& line) {
  CLI::App& measure_app =
      *app.add_subcommand("measure", "Measure the machine of a scene with virtual instruments");
  add_common(measure_app, line.common, false);
  measure_app.add_option("--out", line.common.out, "folder for the readings (out/SCENE/readings)");
  add_force(measure_app, line.common);
  add_trust(measure_app, line.common);
  measure_app
      .add_option("--instrument", line.instruments,
                  "name of an [[instrument]] of the scene, or a kind such as laser, ball_bar, "
                  "r_test (repeatable; all of the scene)")
      ->take_all()
      ->allow_extra_args(false);
}

void add_rewrite_command(CLI::App& app, CommandLine& line) {
  CLI::App& rewrite_app = *app.add_subcommand(
      "rewrite", "Write the program of a scene with a compensator's corrections in it");
  add_common(rewrite_app, line.common, false);
  rewrite_app.add_option("--out", line.common.out, "file for the program (out/SCENE/rewritten.*)");
  add_force(rewrite_app, line.common);
  add_trust(rewrite_app, line.common);
  rewrite_app.add_option("--case", line.case_name,
                         "belief-strategy-program (the first such case of the scene)");
}

void add_export_command(CLI::App& app, CommandLine& line) {
  CLI::App& export_app = *app.add_subcommand(
      "export", "Write the compensation tables of a scene as a control reads them");
  add_common(export_app, line.common, false);
  export_app.add_option("--out", line.common.out, "folder for the tables (out/SCENE/tables)");
  add_force(export_app, line.common);
  add_trust(export_app, line.common);
  export_app
      .add_option("--format", line.exporting.format,
                  "of which control (that of [compensation.table], else linuxcnc)")
      ->check(CLI::IsMember({"linuxcnc", "isg", "siemens", "heidenhain"}));
  export_app.add_option("--case", line.exporting.options.case_name,
                        "what the tables are made from (identified-position-table)");
}

void add_identify_command(CLI::App& app, CommandLine& line) {
  CLI::App& identify_app = *app.add_subcommand(
      "identify", "Find the errors of a machine from readings; write a belief file");
  IdentifyWords& words = line.identify;
  identify_app.add_option("READINGS", words.readings, "files that measure wrote")->required();
  identify_app.add_option("--basis", words.basis, "curves of the slides (legendre)")
      ->check(CLI::IsMember({"legendre", "polynomial", "spline"}));
  identify_app.add_option("--order", words.options.model.order, "of those curves (4)")
      ->check(CLI::Range(0, 60));
  identify_app
      .add_option("--harmonics", words.options.model.harmonics, "of rotary axes, per turn (3)")
      ->check(CLI::Range(0, 60));
  identify_app.add_flag("--choose-orders", words.options.choose_orders,
                        "choose every order by cross-validation");
  identify_app.add_option("--most", words.options.orders.most, "highest order that is tried (10)")
      ->check(CLI::Range(1, 60));
  identify_app.add_option("--elements", words.options.model.only, "find these alone: EXX,EYX,EC0Y")
      ->delimiter(',');
  identify_app
      .add_option("--pitch", words.pitch,
                  "pitch of screws, mm: X=16,Y=16; two harmonics in the positioning")
      ->delimiter(',');
  identify_app.add_flag(
      "--constants", words.options.model.constants,
      "constants of error motions too, and what only places the workpiece on a table: "
      "each hides in a zero or a place");
  identify_app
      .add_option("--outliers", words.options.estimate.outlier_limit,
                  "leave out readings beyond this many standard deviations (0: none)")
      ->check(CLI::Range(0.0, 1e6));
  identify_app
      .add_option("--method", words.method,
                  "chain: any readings, on the exact machine; step_diagonal: the published one; "
                  "composite: positioning from several starts, a cold curve and NAME_thermal.txt; "
                  "thermal: a day of readings, for [belief.thermal]")
      ->check(CLI::IsMember({"chain", "step_diagonal", "composite", "thermal"}));
  identify_app
      .add_option("--sensors", words.options.sensors,
                  "with step_diagonal, composite or thermal: regress what several starts read on "
                  "these (thermal: a choice)")
      ->delimiter(',');
  identify_app
      .add_option("--sensor-count", words.options.sensor_count,
                  "with thermal: how many sensors are chosen where none are named (4)")
      ->check(CLI::Range(1, 100));
  identify_app
      .add_option(
          "--margin", words.options.margin,
          "with thermal or composite: part of its trained range by which a sensor may leave "
          "it (0.1)")
      ->check(CLI::Range(0.0, 10.0));
  identify_app.add_flag("--json", line.common.json, "print JSON instead of text");
  identify_app.add_option(
      "--out", line.common.out,
      "belief file (out/belief.toml; thermal: out/belief_thermal.txt; composite "
      "writes NAME_thermal.txt beside NAME.toml)");
  add_force(identify_app, line.common);
  identify_app.add_option("--threads", line.common.threads, "most threads to use")
      ->check(CLI::Range(1, 1024));
}

void add_evaluate_command(CLI::App& app, CommandLine& line) {
  CLI::App& evaluate_app =
      *app.add_subcommand("evaluate", "Evaluate readings by the standards (ISO 230, 25178)");
  evaluate_app
      .add_option("READINGS", line.readings,
                  "a file that measure wrote, position readings as CSV, or a laser's position file")
      ->required();
  evaluate_app.add_flag("--json", line.common.json, "print JSON instead of text");
  evaluate_app.add_option("--out", line.common.out, "folder for report and pictures (out/NAME)");
  add_force(evaluate_app, line.common);
}

void add_study_command(CLI::App& app, CommandLine& line) {
  CLI::App& study_app = *app.add_subcommand(
      "study",
      "Try thousands of machines: error budgets, sensitivities, tolerances (scenes/studies)");
  StudyWords& words = line.study;
  study_app
      .add_option("STUDY", line.common.scene,
                  "study file (TOML); its format is in scenes/studies/README.md")
      ->required();
  study_app
      .add_option("--set", line.common.set,
                  "change a value of the study: --set monte_carlo.cases=100 (repeatable)")
      ->type_name("KEY=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  study_app.add_option("--seed", line.common.seed, "seed of everything that the study draws")
      ->check(CLI::Range(std::int64_t(0), std::numeric_limits<std::int64_t>::max()));
  study_app
      .add_option("--threads", line.common.threads,
                  "most threads to use (all); results do not depend on it")
      ->check(CLI::Range(1, 1024));
  study_app.add_flag("--json", line.common.json, "print JSON instead of text");
  study_app.add_option("--out", line.common.out,
                       "folder for every file (out/STUDY); cases that are in its journal are not "
                       "computed again");
  add_force(study_app, line.common);
  add_trust(study_app, line.common);
  study_app.add_flag("--resume", words.resume,
                     "go on where the journal ends; the default, another --out starts from the "
                     "beginning");
  CLI::Option* shard = study_app.add_option(
      "--shard", words.shard, "compute part i of n, i from 0: for job arrays; then --merge");
  CLI::Option* merge =
      study_app.add_flag("--merge", words.merge, "write the tables of all shards in --out");
  CLI::Option* show = study_app.add_flag(
      "--show", words.show, "print how far it is and what it says so far; computes nothing");
  CLI::Option* slurm = study_app.add_flag(
      "--slurm", words.slurm, "print a script for Slurm that runs the study as a job array");
  shard->excludes(merge)->excludes(show)->excludes(slurm);
  merge->excludes(show)->excludes(slurm);
  show->excludes(slurm);
  study_app.add_option("--shards", words.job.shards, "with --slurm: jobs of the array (8)")
      ->check(CLI::Range(1, 100000))
      ->needs(slurm);
  study_app.add_option("--cpus", words.job.cpus, "with --slurm: processors of each (4)")
      ->check(CLI::Range(1, 1024))
      ->needs(slurm);
  study_app.add_option("--time", words.job.time, "with --slurm: limit of each (24:00:00)")
      ->needs(slurm);
  study_app.footer("Several machines:  mpirun -n 8 abbe study STUDY.toml   or   --slurm");
}

int dispatch(const CLI::App& app, CommandLine& line, int& argc, char**& argv) {
  std::optional<tbb::global_control> limit;
  if (line.common.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(line.common.threads));
  if (app.got_subcommand("run")) return run_command(line.common, line.case_name, line.compensators);
  if (app.got_subcommand("compare")) return compare_command(line.common, line.compensators);
  if (app.got_subcommand("pose")) return pose(line.common, line.pose);
  if (app.got_subcommand("check")) return check_command(line.common, line.picture);
  if (app.got_subcommand("measure")) return measure_command(line.common, line.instruments);
  if (app.got_subcommand("identify")) return identify_command(line.common, line.identify);
  if (app.got_subcommand("rewrite")) return rewrite_command(line.common, line.case_name);
  if (app.got_subcommand("export")) return export_command(line.common, line.exporting);
  if (app.got_subcommand("study")) return study_command(argc, argv, line.common, line.study);
  if (app.got_subcommand("evaluate")) return evaluate_command(line.common, line.readings);
  line.rendering.permissions = line.common.permissions;
  print("picture in {}\n", render_result(line.rendering).string());
  return ok;
}

/// The command for the marks of results.
std::string as_typed(int argc, char** argv) {
  std::string text = "abbe";
  for (int i = 1; i < argc; ++i) text += " " + std::string(argv[i]);
  return text;
}

int command_line(int argc, char** argv) {
  CLI::App app{
      "abbe: a virtual five-axis machine tool that is wrong on purpose.\n"
      "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
      "what they\ndid, with and without a compensator.\n\n"
      "Start with:  abbe compare scenes/gantry_dome.toml"};
  app.set_version_flag("--version", versions()["abbe"].get<std::string>());
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
      "4 numerical, 5 output, 6 plug-in, 130 interrupted.");
  CommandLine line;
  line.common.permissions.command = as_typed(argc, argv);
  add_scene_commands(app, line);
  add_render_command(app, line);
  add_pose_command(app, line);
  add_measure_command(app, line);
  add_identify_command(app, line);
  add_evaluate_command(app, line);
  add_rewrite_command(app, line);
  add_export_command(app, line);
  add_study_command(app, line);
  const auto say = [&](const CLI::ParseError& why) {
    std::ostringstream out, errors;
    const int code = app.exit(why, out, errors);
    print("{}", Lines(out.str()));
    print(stderr, "{}", Lines(errors.str()));
    return code;
  };
  try {
    app.parse(argc, argv);
    return dispatch(app, line, argc, argv);
  } catch (const CLI::Success& asked) {
    return say(asked);
  } catch (const CLI::ValidationError& fault) {
    print(stderr, "abbe: {}\n", fault.what());
  } catch (const CLI::ParseError& fault) {
    say(fault);
  }
  return usage;
}

}  // namespace
}  // namespace abbe::sim

namespace {

int exit_code(int argc, char** argv) {
  using namespace abbe;
  try {
    return sim::command_line(argc, argv);
  } catch (const sim::Interrupted&) {
    sim::print(stderr, "abbe: interrupted\n");
    return 130;
  } catch (const sim::BadScene& faults) {
    for (const BadInput& fault : faults.faults) sim::print(stderr, "abbe: {}\n", fault.what());
    return sim::input;
  } catch (const BadInput& fault) {
    sim::print(stderr, "abbe: {}\n", fault.what());
    return sim::input;
  } catch (const sim::compensation::PlugInFailure& failure) {
    sim::print(stderr, "abbe: {}\n", sim::Lines(failure.what()));
    return sim::plug_in;
  } catch (const sim::OutputFailure& failure) {
    sim::print(stderr, "abbe: {}\n", failure.what());
    return sim::output;
  } catch (const std::bad_alloc&) {
    sim::print(stderr, "abbe: not enough memory for this scene\n");
    return sim::numerical;
  } catch (const std::exception& failure) {
    sim::print(stderr, "abbe: {}\n", failure.what());
    return sim::numerical;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto host = abbe::sim::compensation::plug_in_host(argc, argv)) return *host;
  abbe::sim::watch_interrupts();
  const int code = exit_code(argc, argv);
  abbe::sim::study::leave_ranks(code);
  return code;
}
