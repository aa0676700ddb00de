#pragma once

#include <filesystem>
#include <string>

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

}  // namespace abbe::sim::study
