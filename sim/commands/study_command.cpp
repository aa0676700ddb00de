#include "sim/commands/study_command.h"

#include <cstdio>
#include <memory>

#include <nlohmann/json.hpp>

#include "sim/commands/outcome_text.h"
#include "sim/files/output.h"
#include "sim/files/program_file.h"
#include "sim/files/terminal.h"
#include "sim/study/ranks.h"
#include "sim/study/run_study.h"
#include "sim/study/slurm.h"

namespace abbe::sim {
namespace {

/// What `study` takes besides what is common.
struct StudyWords {
  bool show = false;
  bool merge = false;
  bool resume = true;
  bool slurm = false;
  bool report = false;
  std::string language = "en";
  std::string shard;
  study::SlurmOptions job;
};

study::Shard parse_shard(const std::string& text) {
  study::Shard shard;
  int end = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard.index, &shard.count, &end) != 2 ||
      std::size_t(end) != text.size() || shard.index < 0 || shard.count < 1 ||
      shard.index >= shard.count)
    throw BadUsage("--shard", "expected i/n with i from 0 to n - 1, seen " + text);
  return shard;
}

Exit print_slurm_script(const Common& common, const StudyWords& words,
                        const study::StudyOptions& options) {
  study::SlurmOptions job = words.job;
  job.study = common.scene;
  job.out = options.folder;
  job.program = std::filesystem::canonical(program_file());
  job.trust = common.permissions.trust;
  // a mistake is reported now, not by every shard
  study::read_trusted_study(common.scene, options.overrides, common.permissions);
  print("{}", Lines(study::slurm_script(job)));
  return Exit::Ok;
}

Exit execute(const Common& common, const StudyWords& words, int& argc, char**& argv) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  if (words.report) options.report_language = words.language;
  if (!words.shard.empty()) options.shard = parse_shard(words.shard);
  if (words.slurm) return print_slurm_script(common, words, options);
  const auto print_text = [&](const study::StudyResult& result) {
    if (common.json)
      print("{}", Lines(json_text(result.json)));
    else
      print("{}", Lines(result.text));
    print_warnings(result.warnings);
    return Exit::Ok;
  };
  if (words.show) return print_text(study::show_study(common.scene, options));
  if (words.merge) return print_text(study::merge_study(common.scene, options));
  const study::Ranks ranks = study::ranks(argc, argv);
  if (ranks.rank == 0) return print_text(study::run_study(common.scene, options, ranks));
  try {
    study::run_study(common.scene, options, ranks);
    return Exit::Ok;
  } catch (const std::exception&) {
    return Exit::Numerical;  // rank 0 reports it, and ends all with its own code
  }
}

}  // namespace

Command study_command(Common& common, int& argc, char**& argv) {
  const auto words = std::make_shared<StudyWords>();
  study::SlurmOptions& job = words->job;
  return {
      "study",
      "Try thousands of machines: error budgets, sensitivities, tolerances (scenes/studies)",
      {"abbe study scenes/studies/gantry_dome_budget.toml --out out/budget",
       "abbe study scenes/studies/gantry_dome_budget.toml --out out/budget --show"},
      {{"STUDY", &common.scene, "study file (TOML); its format is in scenes/studies/README.md"},
       set_option(common, "change a value of the study: --set monte_carlo.cases=100 (repeatable)"),
       seed_option(common, "seed of everything that the study draws"),
       threads_option(common, "most threads to use (all); results do not depend on it"),
       memory_option(common),
       json_option(common),
       {"--out", &common.out,
        "folder for every file (out/STUDY); cases that are in its journal are not computed again"},
       force_option(common),
       trust_option(common),
       {"--resume", &words->resume,
        "go on where the journal ends; the default, another --out starts from the beginning"},
       {"--shard", &words->shard, "compute part i of n, i from 0: for job arrays; then --merge"},
       {"--merge", &words->merge, "write the tables of all shards in --out", Excludes{{"--shard"}}},
       {"--show", &words->show, "print how far it is and what it says so far; computes nothing",
        Excludes{{"--shard", "--merge"}}},
       {"--report", &words->report,
        "besides, report.html: tables and charts with the values under the cursor",
        Excludes{{"--shard", "--show"}}},
       language_option(words->language),
       {"--slurm", &words->slurm, "print a script for Slurm that runs the study as a job array",
        Excludes{{"--shard", "--merge", "--show", "--report"}}},
       {"--shards", &job.shards, "with --slurm: jobs of the array (8)", Between{1, 100000},
        Needs{"--slurm"}},
       {"--cpus", &job.cpus, "with --slurm: processors of each (4)", Between{1, 1024},
        Needs{"--slurm"}},
       {"--time", &job.time, "with --slurm: limit of each (24:00:00)", Needs{"--slurm"}}},
      [words, &common, &argc, &argv] { return execute(common, *words, argc, argv); },
      "Several machines:  mpirun -n 8 abbe study STUDY.toml   or   --slurm"};
}

}  // namespace abbe::sim
