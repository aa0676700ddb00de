#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"
#include "sim/study/case_plan.h"
#include "sim/study/farm.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Options of a script that runs a study as a Slurm job array.
struct SlurmOptions {
  std::filesystem::path study;
  std::filesystem::path out;      ///< on a disk that all computers can access
  std::filesystem::path program;  ///< path of abbe, on such a disk too
  int shards = 8;                 ///< number of jobs of the array
  int cpus = 4;                   ///< of each job
  std::string time = "24:00:00";  ///< limit of each job in a format of Slurm: minutes, h:m:s,
                                  ///< days-h ...
  bool trust = false;             ///< true: the jobs run the programs that the study names
};

/// Returns a shell script. When it is run by `sh`, it submits itself as a job array, in which task
/// i computes shard i of the study, counted from 0, and a job that merges the shards when all are
/// finished. When it is run again after a failure, the study is resumed. Slurm writes its logs to
/// the folder OUT-logs beside the folder of results. Paths are absolute and quoted.
/// @throws std::invalid_argument for shards or cpus below 1, or a time that Slurm cannot read
std::string slurm_script(const SlurmOptions& options);

/// Options of `abbe study`.
struct StudyOptions {
  std::vector<Override> overrides;  ///< of the study file
  std::filesystem::path folder;     ///< folder of all written files
  std::optional<Shard> shard;       ///< of a job array: only its cases are computed, no tables
  Permissions permissions;
  Progress progress = {};       ///< called instead of the progress display on stderr
  std::string report_language;  ///< language of report.html, "en" or "zh"; empty: none is written
};

/// Output of a study command.
struct StudyResult {
  nlohmann::ordered_json json;
  std::string text;                        ///< for the terminal
  std::vector<std::string> warnings = {};  ///< omissions of the HTML report
};

/// Computes the unfinished cases of a study and adds them to its journal, then writes tables,
/// pictures and, if requested, the HTML report (study_results.h). The bytes of the files do not
/// depend on interruptions of the study, nor on the processes that computed the cases.
/// @return contents of `budget.json` and `budget.md`; for a shard the result of `show_study`;
/// nothing on ranks above 0
/// @throws BadScene, BadInput, OutputFailure, Interrupted
StudyResult run_study(const std::filesystem::path& file, const StudyOptions& options,
                      const Ranks& ranks);

/// Writes tables and pictures from the journals of all shards.
/// @throws BadInput also if cases are missing; the message has their number in every shard
StudyResult merge_study(const std::filesystem::path& file, const StudyOptions& options);

/// Returns the progress of a study and its results so far, also while it runs. No cases are
/// computed.
StudyResult show_study(const std::filesystem::path& file, const StudyOptions& options);

/// Returns a CSV table of all cases: number, analysis, inputs, responses. The inputs are left out
/// if they are more than two million numbers; they can be recomputed from the study.
std::string cases_csv(const Study& study, const Plan& plan, const std::vector<Row>& rows);

}  // namespace abbe::sim::study
