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

/// Options for running a study as a Slurm job array.
struct SlurmOptions {
  std::filesystem::path study;
  std::filesystem::path out;      ///< on a disk that all computers can access
  std::filesystem::path program;  ///< likewise
  int shards = 8;                 ///< number of jobs of the array
  int cpus = 4;                   ///< of each job
  std::string time = "24:00:00";  ///< limit of each job in a format of Slurm: minutes, h:m:s,
                                  ///< days-h ...
  bool trust = false;             ///< the jobs run the programs that the study names
};

/// Returns a shell script. Run by `sh`, it submits itself as a job array in which task i computes
/// shard i of the study, counted from 0, and a job that merges the shards when all are done; run
/// again after a failure, it resumes. Slurm logs into the folder OUT-logs beside the folder of
/// results. Paths are made absolute and quoted.
/// @throws std::invalid_argument for shards or cpus below 1, or a time that Slurm cannot read
std::string slurm_script(const SlurmOptions& options);

/// Options of `abbe study`.
struct StudyOptions {
  std::vector<Override> overrides;  ///< of the study file
  std::filesystem::path folder;     ///< all files are written there
  std::optional<Shard> shard;       ///< shard of a job array: only its cases, no tables
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

/// Computes the unfinished cases of a study into its journal, then writes tables and pictures, and
/// the HTML report (study_results.h) if requested. The files are the same bytes whether the study
/// was interrupted or not, and whichever processes computed the cases.
/// @return `budget.json` and `budget.md`; for a shard the result of `show_study`; on ranks above 0
/// nothing
/// @throws BadScene, BadInput, OutputFailure, Interrupted
StudyResult run_study(const std::filesystem::path& file, const StudyOptions& options,
                      const Ranks& ranks);

/// Writes tables and pictures from the journals of all shards.
/// @throws BadInput also if cases are missing, with their number for every shard
StudyResult merge_study(const std::filesystem::path& file, const StudyOptions& options);

/// Returns the progress of a study and its results so far, also while it runs; computes no cases.
StudyResult show_study(const std::filesystem::path& file, const StudyOptions& options);

/// Returns all cases as CSV: number, analysis, inputs, responses. Inputs are left out if they would
/// be more than two million numbers; they can be recomputed from the study.
std::string cases_csv(const Study& study, const Plan& plan, const std::vector<Row>& rows);

}  // namespace abbe::sim::study
