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

/// How a study is spread over a cluster that Slurm runs.
struct SlurmOptions {
  std::filesystem::path study;
  std::filesystem::path out;      ///< on a disk that all computers see
  std::filesystem::path program;  ///< likewise
  int shards = 8;                 ///< as many jobs of an array
  int cpus = 4;                   ///< of each
  std::string time = "24:00:00";  ///< limit of each, in words of Slurm: minutes, h:m:s, days-h ...
  bool trust = false;             ///< the jobs run the programs that the study names
};

/// A script for the shell. Run by `sh` it submits itself as a job array, in which task i does shard
/// i of the study, counted from 0, and a job that merges the shards when all are done; run again
/// after a failure it resumes. Slurm logs in the folder OUT-logs beside that of the results. Paths
/// are made absolute and quoted.
/// @throws std::invalid_argument for shards or cpus below 1, or a time that Slurm cannot read
std::string slurm_script(const SlurmOptions& options);

struct StudyOptions {
  std::vector<Override> overrides;  ///< of the study file
  std::filesystem::path folder;     ///< every file goes there
  std::optional<Shard> shard;       ///< of a job array: only its cases, no tables
  Permissions permissions;
  Progress progress = {};       ///< called instead of what is said on stderr
  std::string report_language;  ///< of report.html, "en" or "zh"; empty: none is written
};

/// What a command says.
struct StudyResult {
  nlohmann::ordered_json json;
  std::string text;                        ///< for a person
  std::vector<std::string> warnings = {};  ///< of the page: what it leaves out
};

/// Does what is left of a study, case by case into its journal, then writes tables and pictures,
/// and the page of them (study_page.h) where it is asked for:
/// the same bytes whether it was interrupted or not, and whoever did the cases.
/// @return `budget.json` and `budget.md`, of a shard what `show` tells; on ranks but 0 nothing
/// @throws BadScene, BadInput, OutputFailure, Interrupted
StudyResult run_study(const std::filesystem::path& file, const StudyOptions& options,
                      const Ranks& ranks);

/// Tables and pictures from the journals of all shards.
/// @throws BadInput also if cases are missing, saying how many of which shard
StudyResult merge_study(const std::filesystem::path& file, const StudyOptions& options);

/// How far a study has come and what it says so far, also while it runs; computes nothing.
StudyResult show_study(const std::filesystem::path& file, const StudyOptions& options);

/// Every case as CSV: number, analysis, inputs, answers. Inputs are left out where they would be
/// more than two million numbers; the journal's study knows them anyway.
std::string cases_csv(const Study& study, const Plan& plan, const std::vector<Row>& rows);

}  // namespace abbe::sim::study
