#include "sim/commands/run_commands.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/files/program_file.h"
#include "sim/files/terminal.h"
#include "sim/report/picture_files.h"
#include "sim/report/sensor_choice_report.h"
#include "sim/report/summary.h"
#include "sim/scene/cases.h"
#include "sim/study/farm.h"
#include "sim/study/run_study.h"

namespace abbe::sim {

namespace {

/// Quotes a word for a shell if necessary.
std::string shell_quoted(const std::string& word) {
  const bool is_plain = word.find_first_not_of(
                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                            "_-./=:,+") == std::string::npos;
  if (is_plain && !word.empty()) return word;
  std::string quoted_text = "'";
  for (const char c : word) quoted_text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted_text + "'";
}

/// Returns a warning without its numbers. Warnings with equal patterns have the same cause.
std::string warning_pattern(const std::string& warning) {
  std::string text;
  for (const char c : warning)
    if (std::string_view("0123456789.-").find(c) == std::string_view::npos) text += c;
  return text;
}

std::vector<std::string> distinct_warnings(const Summary& figures) { return figures.warnings; }

/// Returns the warnings of a comparison. Warnings of several cases with the same cause become one,
/// with the figures of the first case; the files contain all of them.
std::vector<std::string> distinct_warnings(const Comparison& comparison) {
  struct SharedWarning {
    std::string first, text;
    std::vector<std::string> others;
  };
  std::vector<std::string> lines;
  std::vector<SharedWarning> shared_warnings;
  for (const std::string& warning : comparison.warnings) {
    const std::size_t colon = std::min(warning.find(": "), warning.size());
    const std::string name = warning.substr(0, colon);
    if (std::ranges::find(comparison.cases, name, &CaseStatistics::name) ==
        comparison.cases.end()) {
      lines.push_back(warning);
      continue;
    }
    const std::string text = warning.substr(colon);
    const auto shared =
        std::ranges::find(shared_warnings, warning_pattern(text),
                          [](const SharedWarning& known) { return warning_pattern(known.text); });
    if (shared == shared_warnings.end())
      shared_warnings.push_back({name, text, {}});
    else
      shared->others.push_back(name);
  }
  for (const SharedWarning& shared_warning : shared_warnings) {
    const std::size_t n = shared_warning.others.size();
    const std::string others = n == 0   ? ""
                               : n == 1 ? " and " + shared_warning.others.front()
                                        : fmt::format(" and {} other cases", n);
    lines.push_back(shared_warning.first + others + shared_warning.text);
  }
  return lines;
}

}  // namespace

Option compensator_option(std::vector<std::filesystem::path>& files) {
  return {"--compensator", &files,
          "your own compensator: a program that exchanges JSON lines or a C library "
          "(sim/compensation/README.md)",
          TypeName{"FILE"}};
}

Option save_option(std::vector<std::string>& formats) {
  return {"--save", &formats,
          "formats of the map, residual.FORMAT (vtp): ply for MeshLab and CloudCompare, stl the "
          "machined surface, csv, npz for NumPy, json its description; track: pose of the tool at "
          "every sample, track.npz",
          OneOf{map_formats()}, CommaSeparated{}};
}

Option report_option(bool& report) {
  return {"--report", &report,
          "also write report.html: the maps and the machine in interactive 3-D"};
}

Option language_option(std::string& language) {
  return {"--language", &language, "language of the report", OneOf{{"en", "zh"}}};
}

void request_report(RunOptions& options, const CommonOptions& common, const std::string& command,
                    const std::string& language) {
  options.report_language = language;
  options.command = "abbe " + command + " " + shell_quoted(common.scene.string());
  for (const std::string& override_text : common.set)
    options.command += " --set " + shell_quoted(override_text);
  if (common.seed) options.command += " --seed " + std::to_string(*common.seed);
  for (const std::filesystem::path& file : options.plug_ins)
    options.command += " --compensator " + shell_quoted(file.string());
}

RunOptions run_options(const CommonOptions& common,
                       const std::vector<std::filesystem::path>& compensators,
                       const std::vector<std::string>& formats) {
  RunOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  options.plug_ins = compensators;
  if (!formats.empty()) options.formats = formats;
  for (const std::filesystem::path& file : compensators) {
    try {
      plug_in_case(file);
    } catch (const std::invalid_argument& error) {
      throw BadUsage("--compensator", error.what());
    }
  }
  return options;
}

Exit print_limits_and_failures(const std::vector<std::string>& exceeded_limits,
                               const std::vector<std::string>& failed) {
  for (const std::string& limit : exceeded_limits) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : failed) print(stderr, "abbe: {}\n", MultilineText(failure));
  // A failed plug-in takes precedence over an exceeded limit, because the result is incomplete.
  if (!failed.empty()) return Exit::PlugIn;
  return exceeded_limits.empty() ? Exit::Ok : Exit::LimitExceeded;
}

Exit print_outcome(const CommonOptions& common, const RunOptions& options, const Outcome& outcome) {
  const bool is_comparison = std::holds_alternative<Comparison>(outcome.figures);
  std::visit(
      [&](const auto& figures) {
        print("{}", MultilineText(common.json ? json_text(to_json(figures)) : to_text(figures)));
      },
      outcome.figures);
  if (!common.json)
    print("{}files in {}{}\n", MultilineText(is_comparison ? "\n" : ""), options.folder.string(),
          is_comparison && can_draw_pictures() ? "; comparison.png shows all cases on one scale"
                                               : "");
  if (!common.json && outcome.sensors)
    print("{}", MultilineText(sensor_choices_text(*outcome.sensors)));
  std::visit(
      [](const auto& figures) {
        print_assumptions(figures.assumptions);
        print_warnings(distinct_warnings(figures));
      },
      outcome.figures);
  if (!can_draw_pictures())
    print(stderr, "abbe: warning: this program was built without VTK: no pictures and no .vtp\n");
  const std::string font =
      std::visit([](const auto& figures) { return font_warning(figures.scene); }, outcome.figures);
  if (!font.empty()) print(stderr, "abbe: warning: {}\n", font);
  return print_limits_and_failures(outcome.exceeded_limits, outcome.failed);
}

namespace {

/// Arguments of `abbe run` and, without a case, of `abbe compare`.
struct RunArguments {
  std::string case_name;
  std::vector<std::filesystem::path> compensators;
  std::vector<std::string> formats;
  bool report = false;
  std::string language = "en";
};

/// Runs one case. A plug-in is a case, so --case and --compensator exclude each other.
Exit run(const CommonOptions& common, const RunArguments& arguments) {
  RunOptions options = run_options(common, arguments.compensators, arguments.formats);
  options.case_name = arguments.case_name;
  if (options.plug_ins.size() > 1 || (!options.case_name.empty() && !options.plug_ins.empty()))
    throw BadUsage("--compensator", "expected one case, either --case or --compensator");
  if (!options.case_name.empty() && options.case_name != "error_free" &&
      options.case_name != "uncompensated")
    check_case(options.case_name);
  if (arguments.report)
    request_report(options, common,
                   arguments.case_name.empty() ? "run" : "run --case " + arguments.case_name,
                   arguments.language);
  return print_outcome(common, options, run(common.scene, options));
}

}  // namespace

Command run_command(CommonOptions& common) {
  const auto arguments = std::make_shared<RunArguments>();
  return {"run",
          "Cut one case of a scene (default: uncompensated)",
          {"abbe run scenes/gantry_dome.toml --case perfect-iterated-ideal --out out/best",
           "abbe run scenes/gantry_dome.toml --set errors.scale=2 --out out/twice",
           "abbe run scenes/gantry_dome.toml --save vtp,ply,npz --out out/saved"},
          scene_options(common, {result_folder_option(common),
                                 force_option(common),
                                 memory_option(common),
                                 {"--case", &arguments->case_name,
                                  "error_free, uncompensated or belief-strategy-channel"},
                                 trust_option(common),
                                 compensator_option(arguments->compensators),
                                 save_option(arguments->formats),
                                 report_option(arguments->report),
                                 language_option(arguments->language)}),
          [arguments, &common] { return run(common, *arguments); }};
}

Command compare_command(CommonOptions& common) {
  const auto arguments = std::make_shared<RunArguments>();
  return {"compare",
          "Cut error-free, uncompensated and every compensator of the scene",
          {"abbe compare scenes/gantry_dome.toml --out out/dome",
           "abbe compare scenes/gantry_dome.toml --compensator scenes/compensators/table.py --out "
           "out/own",
           "abbe compare scenes/gantry_dome.toml --save csv,json --out out/tables"},
          scene_options(common,
                        {result_folder_option(common), force_option(common), memory_option(common),
                         trust_option(common), compensator_option(arguments->compensators),
                         save_option(arguments->formats), report_option(arguments->report),
                         language_option(arguments->language)}),
          [arguments, &common] {
            RunOptions options = run_options(common, arguments->compensators, arguments->formats);
            if (arguments->report) request_report(options, common, "compare", arguments->language);
            return print_outcome(common, options, compare(common.scene, options));
          }};
}

namespace {

/// Arguments of `study`, besides the common options.
struct StudyArguments {
  bool show = false;
  bool merge = false;
  bool resume = true;
  bool slurm = false;
  bool report = false;
  std::string language = "en";
  std::string shard;
  study::SlurmOptions job;
};

/// Parses a shard such as "3/8". %n ensures that no text follows.
study::Shard parse_shard(const std::string& text) {
  study::Shard shard;
  int end = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard.index, &shard.count, &end) != 2 ||
      std::size_t(end) != text.size() || shard.index < 0 || shard.count < 1 ||
      shard.index >= shard.count)
    throw BadUsage("--shard", "expected i/n with i from 0 to n - 1, seen " + text);
  return shard;
}

Exit print_slurm_script(const CommonOptions& common, const StudyArguments& arguments,
                        const study::StudyOptions& options) {
  study::SlurmOptions job = arguments.job;
  job.study = common.scene;
  job.out = options.folder;
  job.program = std::filesystem::canonical(program_file());
  job.trust = common.permissions.trust;
  // Input errors of the study are reported here, not by every shard.
  study::read_trusted_study(common.scene, options.overrides, common.permissions);
  print("{}", MultilineText(study::slurm_script(job)));
  return Exit::Ok;
}

/// Runs, shows or merges a study, or prints its Slurm script. Only rank 0 prints.
Exit run_study_command(const CommonOptions& common, const StudyArguments& arguments, int& argc,
                       char**& argv) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  if (arguments.report) options.report_language = arguments.language;
  if (!arguments.shard.empty()) options.shard = parse_shard(arguments.shard);
  if (arguments.slurm) return print_slurm_script(common, arguments, options);
  const auto print_text = [&](const study::StudyResult& result) {
    if (common.json)
      print("{}", MultilineText(json_text(result.json)));
    else
      print("{}", MultilineText(result.text));
    print_warnings(result.warnings);
    return Exit::Ok;
  };
  if (arguments.show) return print_text(study::show_study(common.scene, options));
  if (arguments.merge) return print_text(study::merge_study(common.scene, options));
  const study::Ranks ranks = study::ranks(argc, argv);
  if (ranks.rank == 0) return print_text(study::run_study(common.scene, options, ranks));
  try {
    study::run_study(common.scene, options, ranks);
    return Exit::Ok;
  } catch (const std::exception&) {
    return Exit::Numerical;  // rank 0 reports the error and ends all ranks with its own exit code
  }
}

}  // namespace

Command study_command(CommonOptions& common, int& argc, char**& argv) {
  const auto arguments = std::make_shared<StudyArguments>();
  study::SlurmOptions& job = arguments->job;
  return {
      "study",
      "Study thousands of machines: error budgets, sensitivities, tolerances (scenes/studies)",
      {"abbe study scenes/studies/gantry_dome_budget.toml --out out/budget",
       "abbe study scenes/studies/gantry_dome_budget.toml --out out/budget --show"},
      {{"STUDY", &common.scene, "study file (TOML); see scenes/studies/README.md for the format"},
       set_option(common, "change a value of the study: --set monte_carlo.cases=100 (repeatable)"),
       seed_option(common, "seed of all random numbers of the study"),
       threads_option(common, "maximum number of threads (all); results do not depend on it"),
       memory_option(common),
       json_option(common),
       {"--out", &common.out,
        "folder for all files (out/STUDY); cases in its journal are not computed again"},
       force_option(common),
       trust_option(common),
       {"--resume", &arguments->resume,
        "continue where the journal ends (the default; use a new --out to start over)"},
       {"--shard", &arguments->shard,
        "compute part i of n, counted from 0, in a job array; then use --merge"},
       {"--merge", &arguments->merge, "write the tables of all shards in --out",
        Excludes{{"--shard"}}},
       {"--show", &arguments->show,
        "print the progress and the results so far, without computing anything",
        Excludes{{"--shard", "--merge"}}},
       {"--report", &arguments->report,
        "also write report.html: tables and charts, with values under the cursor",
        Excludes{{"--shard", "--show"}}},
       language_option(arguments->language),
       {"--slurm", &arguments->slurm, "print a Slurm script that runs the study as a job array",
        Excludes{{"--shard", "--merge", "--show", "--report"}}},
       {"--shards", &job.shards, "with --slurm: number of jobs in the array (8)",
        NumberRange{1, 100000}, RequiresOption{"--slurm"}},
       {"--cpus", &job.cpus, "with --slurm: processors per job (4)", NumberRange{1, 1024},
        RequiresOption{"--slurm"}},
       {"--time", &job.time, "with --slurm: time limit per job (24:00:00)",
        RequiresOption{"--slurm"}}},
      [arguments, &common, &argc, &argv] {
        return run_study_command(common, *arguments, argc, argv);
      },
      "Several machines:  mpirun -n 8 abbe study STUDY.toml   or   --slurm"};
}

}  // namespace abbe::sim
