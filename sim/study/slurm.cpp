#include "sim/study/slurm.h"

#include <cctype>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/files/matches.h"

namespace abbe::sim::study {
namespace {

/// As one word of the shell.
std::string quoted(const std::string& text) {
  if (matches(text, "[A-Za-z0-9_./+:,@-]+")) return text;
  std::string word = "'";
  for (const char letter : text) word += letter == '\'' ? "'\\''" : std::string(1, letter);
  return word + "'";
}

std::string quoted(const std::filesystem::path& path) {
  return quoted(std::filesystem::absolute(path).lexically_normal().string());
}

/// A name that Slurm's own lines can hold.
std::string job_name(const std::filesystem::path& study) {
  std::string name = "abbe-";
  for (const unsigned char letter : study.stem().string())
    name += std::isalnum(letter) != 0 || letter == '_' || letter == '-' ? char(letter) : '_';
  return name;
}

/// Where Slurm logs: beside the folder of results, in which nobody else writes.
std::filesystem::path log_folder(const SlurmOptions& options) {
  std::filesystem::path out = std::filesystem::absolute(options.out).lexically_normal();
  if (!out.has_filename()) out = out.parent_path();
  return out += "-logs";
}

/// Slurm puts the number of the task and the like in place of %a in the name of a log.
std::string log_name(const SlurmOptions& options, const std::string& name) {
  std::string folder;
  for (const char letter : log_folder(options).string())
    folder += letter == '%' ? "%%" : std::string(1, letter);
  return quoted(folder + "/" + name);
}

void check(const SlurmOptions& options) {
  if (options.shards < 1 || options.cpus < 1)
    throw std::invalid_argument("a job array needs at least one shard and one cpu");
  if (!matches(options.time, "[0-9]+(:[0-9]+){0,2}|[0-9]+-[0-9]+(:[0-9]+){0,2}"))
    throw std::invalid_argument(fmt::format(
        "expected a time as Slurm reads it (90, 12:00:00, 2-00), seen {}", options.time));
}

}  // namespace

std::string slurm_script(const SlurmOptions& options) {
  check(options);
  const std::string command =
      fmt::format("{} study {} --out {}{}", quoted(options.program), quoted(options.study),
                  quoted(options.out), options.trust ? " --trust" : "");
  return fmt::format(
      R"(#!/bin/sh
#SBATCH --job-name={name}
#SBATCH --array=0-{last}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={cpus}
#SBATCH --time={time}
#SBATCH --requeue
#SBATCH --open-mode=append
# Submit with:  sh THIS_FILE
# Cases that are done are kept: after a failure or a time limit, submit it again.
set -eu

if [ -n "${{SLURM_ARRAY_TASK_ID:-}}" ]; then
  exec {command} --threads {cpus} --shard "$SLURM_ARRAY_TASK_ID/{shards}"
fi

mkdir -p {logs}
shards=$(sbatch --parsable --output={shard_log} "$0")
sbatch --dependency="afterok:${{shards%%;*}}" --kill-on-invalid-dep=yes --job-name={name}-merge \
  --ntasks=1 --cpus-per-task={cpus} --time={time} --output={merge_log} \
  --wrap={merge}
)",
      fmt::arg("name", job_name(options.study)), fmt::arg("last", options.shards - 1),
      fmt::arg("cpus", options.cpus), fmt::arg("time", options.time), fmt::arg("command", command),
      fmt::arg("shards", options.shards), fmt::arg("logs", quoted(log_folder(options))),
      fmt::arg("shard_log", log_name(options, "shard-%a.log")),
      fmt::arg("merge_log", log_name(options, "merge.log")),
      fmt::arg("merge", quoted(fmt::format("{} --threads {} --merge", command, options.cpus))));
}

}  // namespace abbe::sim::study
