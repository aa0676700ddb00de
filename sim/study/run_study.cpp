#include "sim/study/run_study.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/table_reader.h"
#include "sim/study/budget_analysis.h"
#include "sim/study/configuration.h"
#include "sim/study/study_charts.h"
#include "sim/study/study_results.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {

namespace {

/// Returns the text quoted as one argument of the shell.
std::string quoted(const std::string& text) {
  if (matches(text, "[A-Za-z0-9_./+:,@-]+")) return text;
  std::string argument = "'";
  for (const char letter : text) argument += letter == '\'' ? "'\\''" : std::string(1, letter);
  return argument + "'";
}

std::string quoted(const std::filesystem::path& path) {
  return quoted(std::filesystem::absolute(path).lexically_normal().string());
}

/// Returns a job name that is valid in the directives of Slurm.
std::string job_name(const std::filesystem::path& study) {
  std::string name = "abbe-";
  for (const unsigned char letter : study.stem().string())
    name += std::isalnum(letter) != 0 || letter == '_' || letter == '-' ? char(letter) : '_';
  return name;
}

/// Returns the folder of Slurm's logs. It is beside the folder of results, since abbe refuses to
/// write into a folder with files of other programs.
std::filesystem::path log_folder(const SlurmOptions& options) {
  std::filesystem::path out = std::filesystem::absolute(options.out).lexically_normal();
  if (!out.has_filename()) out = out.parent_path();
  return out += "-logs";
}

/// Returns the quoted path of a log. Slurm replaces patterns such as %a by the number of the task,
/// so the % signs of the folder are doubled.
std::string log_name(const SlurmOptions& options, const std::string& name) {
  std::string folder;
  for (const char letter : log_folder(options).string())
    folder += letter == '%' ? "%%" : std::string(1, letter);
  return quoted(folder + "/" + name);
}

/// Throws std::invalid_argument if the options are invalid.
void check(const SlurmOptions& options) {
  if (options.shards < 1 || options.cpus < 1)
    throw std::invalid_argument("a job array needs at least one shard and one cpu");
  if (!matches(options.time, "[0-9]+(:[0-9]+){0,2}|[0-9]+-[0-9]+(:[0-9]+){0,2}"))
    throw std::invalid_argument(
        fmt::format("expected a Slurm time limit (90, 12:00:00, 2-00), seen {}", options.time));
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
# Finished cases are kept: after a failure or a time limit, submit the script again.
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

namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

// These are about 40 MB of text, since a double takes up to 18 characters.
constexpr std::uint64_t max_input_cells = 2'000'000;
// A call of a Sobol sequence takes about 0.5 us per dimension, independent of the number of cases.
constexpr std::uint64_t input_block = 1024;  // cases

/// Returns the name of the journal of a whole study or of a shard.
std::string journal_name(const StudyOptions& options) {
  if (!options.shard) return "journal.sqlite";
  return fmt::format("journal-{}-of-{}.sqlite", options.shard->index, options.shard->count);
}

/// Returns all journals of a folder, that of a single process and those of shards.
std::vector<path> journals(const path& folder) {
  std::vector<path> files;
  std::error_code failure;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failure)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("journal") && name.ends_with(".sqlite")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Returns the rows of all journals of a folder.
/// @throws BadInput if there are none, or if they belong to another study
JournalContents read_journals(const Study& study, const path& folder) {
  const std::vector<path> files = journals(folder);
  if (files.empty())
    throw BadInput(folder.string(), 0, 0, "a folder with a journal: the --out of `abbe study`",
                   "none");
  JournalContents contents = merge_journals(files);
  if (contents.identity != study.identity)
    throw BadInput(files.front().string(), 0, 0,
                   "the journal of this study: the same file, scene, --set and program",
                   "the journal of another study");
  return contents;
}

std::uint64_t case_count(const std::vector<Batch>& batches) {
  std::uint64_t count = 0;
  for (const Batch& batch : batches) count += batch.last - batch.first;
  return count;
}

/// Returns the number of shards of a study according to the names of its journals; 1 if there are
/// none.
int shard_count(const path& folder) {
  int max_count = 1;
  for (const path& file : journals(folder)) {
    int index = 0, count = 0;
    if (std::sscanf(file.filename().c_str(), "journal-%d-of-%d", &index, &count) == 2)
      max_count = std::max(max_count, count);
  }
  return max_count;
}

/// Returns the numbers of missing cases of all incomplete shards.
std::string missing_shards_text(const Plan& plan, const std::vector<Row>& rows, int shards) {
  std::vector<std::uint64_t> finished;
  for (const Row& row : rows) finished.push_back(row.index);
  const std::vector<Batch> batches = make_batches(plan);
  std::string text;
  for (int i = 0; i < shards; ++i) {
    const std::uint64_t missing =
        case_count(unfinished(shard_batches(batches, {i, shards}), finished));
    if (missing > 0) text += fmt::format(", {} missing of --shard {}/{}", missing, i, shards);
  }
  return text;
}

/// Returns the heading of the column of a response.
std::string response_head(const Study& study, const Configuration& configuration,
                          Response response) {
  const std::string unit = unit_of(response) == std::string("%") ? "percent" : unit_of(response);
  const std::string figure = fmt::format("{}_{}", name_of(response), unit);
  return study.configurations.size() == 1 ? figure : configuration.name + " " + figure;
}

/// Returns the header of the table of cases.
std::string table_head(const Study& study, bool with_inputs) {
  std::string head = "case,analysis,engine";
  for (const Input& input : study.inputs)
    if (with_inputs) head += "," + csv_field(input.name + " / " + unit_of(input));
  for (const Configuration& configuration : study.configurations)
    for (const Response response : study.responses)
      head += "," + csv_field(response_head(study, configuration, response));
  return head + ",fault\n";
}

/// Returns the progress of each analysis of a study.
StudyResult study_progress(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  ordered_json blocks = ordered_json::array();
  std::string text =
      fmt::format("{}: {} of {} cases finished\n", escaped(study.title), rows.size(), plan.cases);
  for (const Block& block : plan.blocks) {
    const auto begin =
        std::lower_bound(rows.begin(), rows.end(), block.first,
                         [](const Row& row, std::uint64_t index) { return row.index < index; });
    const auto end =
        std::lower_bound(begin, rows.end(), block.first + block.count,
                         [](const Row& row, std::uint64_t index) { return row.index < index; });
    const char* engine = block.full ? "full" : "influence";
    const auto finished = std::uint64_t(end - begin);
    blocks.push_back({{"analysis", name_of(block.kind)},
                      {"engine", engine},
                      {"finished", finished},
                      {"cases", block.count}});
    text += fmt::format("  {:<16} {:<10} {:>10} of {}\n", name_of(block.kind), engine, finished,
                        block.count);
  }
  return {{{"study", study.title},
           {"finished", rows.size()},
           {"cases", plan.cases},
           {"analyses", blocks}},
          std::move(text)};
}

/// Returns the results with escaped control characters in names, for the terminal.
std::vector<HistoryResult> with_escaped_names(std::vector<HistoryResult> results) {
  for (HistoryResult& result : results) {
    result.train = escaped(result.train);
    result.test = escaped(result.test);
    for (std::string& sensor : result.sensors) sensor = escaped(sensor);
  }
  return results;
}

// Computing times per vertex of an influence map on two cores, s.
constexpr double passes_s = 6e-5;   // finding the competing passes
constexpr double input_s = 2e-6;    // effect of one input
constexpr double check_s = 4e-5;    // cutting one machine in full
constexpr double case_s = 4e-8;     // one case by the map
constexpr double drawing_s = 2e-5;  // drawing the map

/// Returns true if the study uses influence maps.
bool has_maps(const Study& study) { return study.engine != Engine::Full && !study.inputs.empty(); }

/// Returns the expected work size of the study's scene, before it is prepared.
WorkSize scene_size(const Study& study) {
  return study.configurations.empty()
             ? WorkSize{}
             : expected_size(base_scene(study, study.configurations.front()));
}

/// Returns the stages of preparing every configuration, as `prepare_study` reports them.
std::vector<Stage> preparation_stages(const Study& study) {
  const std::string part = "prepare " + study.title;
  const WorkSize size = scene_size(study);
  std::vector<Stage> stages;
  for (std::size_t i = 0; i < study.configurations.size(); ++i) {
    stages = std::move(stages) + scene_preparation_stages(part, size);
    if (study.subtracts_error_free_map) stages = std::move(stages) + error_free_stages(part, size);
  }
  const double inputs = double(study.inputs.size());
  for (std::size_t i = 0; has_maps(study) && i < study.configurations.size(); ++i)
    stages = std::move(stages) +
             std::vector<Stage>{{part, "rivals", passes_s * size.vertices},
                                {part, "inputs", input_s * size.vertices * inputs},
                                {part, "checks", check_s * size.vertices * study.influence.checks}};
  return stages;
}

/// Returns the stage of the unfinished cases.
std::vector<Stage> case_stages(const Study& study, const std::string& part,
                               const std::vector<Batch>& remaining, const Plan& plan,
                               const WorkSize& size) {
  double seconds = 0.0;
  for (const Batch& batch : remaining) {
    const double cases = double(batch.last - batch.first) * double(study.configurations.size());
    if (!find_block(plan, batch.first).full)
      seconds += cases * case_s * size.vertices;
    else
      for (const Stage& stage : cut_stages(part, size)) seconds += cases * stage.seconds;
  }
  return {{part, "cases", seconds}};
}

/// Returns the stages of writing the results.
std::vector<Stage> result_stages(const Study& study, const WorkSize& size) {
  std::vector<Stage> stages;
  if (!study.inputs.empty())
    stages = {
        {"budget", "budget", 0.5 * double(study.configurations.size())},
        {"pictures", "budget", 2.0},
        {"pictures", "maps",
         has_maps(study) ? drawing_s * size.vertices * double(study.configurations.size()) : 0.0}};
  if (study.histories)
    stages.push_back({"histories", "thermal histories",
                      double(study.histories->train.size() * (1 + study.histories->test.size()))});
  return stages;
}

/// Writes tables and pictures of the finished cases.
class ResultWriter {
 public:
  ResultWriter(const Study& study, const ResultFolder& folder, std::string report_language,
               ProgressLine& progress)
      : study_(study),
        folder_(folder),
        report_language_(std::move(report_language)),
        progress_(progress) {}

  StudyResult write(const PreparedStudy& ready, const std::vector<Row>& rows) {
    StudyResult result{ordered_json::object(), ""};
    Budget budget;
    budget.study = study_;
    std::vector<ordered_json> maps;
    std::vector<HistoryResult> days;
    if (!study_.inputs.empty()) {
      budget = write_budget(ready, rows);
      maps = write_maps(ready);
      result = {to_json(budget), to_text(budget)};
      for (std::size_t i = 0; i < maps.size(); ++i) result.json["arms"][i].update(maps[i]);
    }
    if (study_.histories) {
      progress_.begin("histories");
      days = histories(study_, progress_function(progress_));
      write_histories(folder_, study_, days);
      result.json["histories"] = to_json(days);
      result.text += to_text(with_escaped_names(days));
    }
    write_file(folder_ / "study.toml", study_.text);
    write_scenes(ready);
    const FiguresPage page = study_page(budget, maps, days);
    write_json(folder_ / "page.json", to_json(page));
    write_json(folder_ / "budget.json", result.json);
    write_page(page);
    if (!report_language_.empty()) result.warnings = page_omissions(budget);
    result.text += fmt::format("\nfiles in {}\n", escaped(folder_.path().string()));
    return result;
  }

 private:
  Budget write_budget(const PreparedStudy& ready, const std::vector<Row>& rows) {
    progress_.begin("budget");
    Budget budget = compute_budget(ready, rows, progress_function(progress_));
    write_table(folder_ / "cases.csv", cases_csv(study_, ready.plan, rows));
    write_table(folder_ / "budget.csv", to_csv(budget));
    write_table(folder_ / "budget.md", to_markdown(budget));
    progress_.begin("pictures");
    write_pictures(folder_, budget, progress_function(progress_));
    return budget;
  }

  /// Writes the influence files of every configuration.
  /// @return their entries of `budget.json`
  std::vector<ordered_json> write_maps(const PreparedStudy& ready) {
    PictureNames names;
    std::vector<ordered_json> entries;
    for (std::size_t i = 0; i < ready.influences.size(); ++i) {
      progress_.report("maps", double(i) / double(ready.influences.size()));
      const std::string subfolder = study_.configurations.size() == 1
                                        ? ""
                                        : names.unique_name({study_.configurations[i].name});
      entries.push_back(write_influence(folder_.inside(subfolder), ready, i));
    }
    return entries;
  }

  /// Writes the scene of each variant with all its defaults and overrides.
  void write_scenes(const PreparedStudy& ready) {
    PictureNames names;
    std::set<std::string> written;
    for (const PreparedConfiguration& configuration : ready.configurations) {
      const std::string& variant = configuration.arm.variant;
      if (!written.insert(variant).second) continue;
      std::vector<std::string> parts{"scene"};
      if (!variant.empty()) parts.push_back(variant);
      write_file(folder_ / (names.unique_name(parts) + ".toml"), configuration.scene.resolved);
    }
  }

  /// Writes the HTML report. If none is requested, that of an earlier run is removed, because it
  /// does not match the new tables.
  void write_page(const FiguresPage& page) {
    const ResultFile file = folder_ / "report.html";
    if (report_language_.empty()) return remove_file(file);
    FiguresPage full_page = with_folder(page, folder_.path());
    full_page.language = report_language_;
    write_file(file, page_html(full_page));
  }

  const Study& study_;
  const ResultFolder& folder_;
  std::string report_language_;
  ProgressLine& progress_;
};

/// Computes batches that rank 0 distributes.
void compute_for_rank_0(const Study& study, const std::vector<Batch>& batches, const Ranks& ranks) {
  const PreparedStudy ready =
      batches.empty() ? PreparedStudy{study, {}, {}, {}} : prepare_study(study);
  farm(batches, ranks, batch_computation(ready), {});
}

}  // namespace

StudyResult run_study(const path& file, const StudyOptions& options, const Ranks& ranks) {
  const Study study = read_trusted_study(file, options.overrides, options.permissions);
  const Plan plan = make_plan(study);
  std::vector<Batch> batches = make_batches(plan);
  if (options.shard) batches = shard_batches(batches, *options.shard);
  if (ranks.rank != 0) {
    compute_for_rank_0(study, unfinished(batches, broadcast_from_rank_0(ranks, {})), ranks);
    return {};
  }
  const ResultFolder folder(options.folder, {options.permissions, study.files});
  const ResultFile journal_file = folder / journal_name(options);
  reserve_file(journal_file);
  Journal journal(journal_file.path(), study.identity);
  const std::vector<std::uint64_t> finished = broadcast_from_rank_0(ranks, journal.finished());
  const std::vector<Batch> remaining = unfinished(batches, finished);

  // Progress is planned twice, because the sizes of the jobs are known only after their
  // preparation.
  const std::uint64_t count = case_count(remaining);
  const std::string case_part = fmt::format("{} of {} cases", count, case_count(batches));
  const auto later_stages = [&](const WorkSize& size) {
    std::vector<Stage> stages = case_stages(study, case_part, remaining, plan, size);
    return options.shard ? stages : std::move(stages) + result_stages(study, size);
  };
  ProgressLine progress(preparation_stages(study) + later_stages(scene_size(study)),
                        options.progress);
  progress.begin("prepare " + study.title);
  const bool needs_preparation = !remaining.empty() || !options.shard;
  const PreparedStudy ready = needs_preparation ? prepare_study(study, progress_function(progress))
                                                : PreparedStudy{study, plan, {}, {}};
  if (!ready.configurations.empty())
    progress.replan(later_stages(work_size(ready.configurations.front().job)));
  progress.begin(case_part);
  std::uint64_t done = 0;
  farm(remaining, ranks, batch_computation(ready), [&](const Batch&, const std::vector<Row>& rows) {
    journal.add(rows);
    done += rows.size();
    progress.report("cases", double(done) / double(count));
  });
  const JournalContents contents = read_journal(journal_file.path());
  if (options.shard) return study_progress(study, plan, contents.rows);
  return ResultWriter(study, folder, options.report_language, progress).write(ready, contents.rows);
}

StudyResult merge_study(const path& file, const StudyOptions& options) {
  const Study study = read_trusted_study(file, options.overrides, options.permissions);
  const JournalContents contents = read_journals(study, options.folder);
  const Plan plan = make_plan(study);
  if (contents.rows.size() != plan.cases)
    throw BadInput(
        options.folder.string(), 0, 0,
        fmt::format("all {} cases (start the shards again; they continue where they stopped)",
                    plan.cases),
        fmt::format("{} finished", contents.rows.size()) +
            missing_shards_text(plan, contents.rows, shard_count(options.folder)));
  const ResultFolder folder(options.folder, {options.permissions, study.files});
  ProgressLine progress(preparation_stages(study) + result_stages(study, scene_size(study)),
                        options.progress);
  progress.begin("prepare " + study.title);
  const PreparedStudy ready = prepare_study(study, progress_function(progress));
  return ResultWriter(study, folder, options.report_language, progress).write(ready, contents.rows);
}

StudyResult show_study(const path& file, const StudyOptions& options) {
  const Study study = read_study(file, options.overrides);
  const Plan plan = make_plan(study);
  const JournalContents contents = read_journals(study, options.folder);
  StudyResult result = study_progress(study, plan, contents.rows);
  const Budget budget = compute_budget(study, plan, contents.rows);
  result.json["budget"] = to_json(budget);
  result.text += "\n" + to_text(budget);
  return result;
}

std::string cases_csv(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  const bool with_inputs = rows.size() * study.inputs.size() <= max_input_cells;
  std::string text;
  text += table_head(study, with_inputs);
  Eigen::MatrixXd x;  // of the cases from .. to - 1
  std::uint64_t from = 0, to = 0;
  for (const Row& row : rows) {
    if (with_inputs && row.index >= to) {
      from = row.index;
      to = std::min(plan.cases, from + input_block);
      x = case_inputs(study, plan, from, to);
    }
    const Block& block = find_block(plan, row.index);
    text +=
        fmt::format("{},{},{}", row.index, name_of(block.kind), block.full ? "full" : "influence");
    if (with_inputs)
      for (const double value : x.col(Eigen::Index(row.index - from)))
        text += fmt::format(",{}", value);
    for (std::size_t i = 0; i < row.response_values.size(); ++i)
      text += fmt::format(",{}", csv_field(in_unit(study.responses[i % study.responses.size()],
                                                   row.response_values[i])));
    text += fmt::format(",{}\n", csv_field(row.fault));
  }
  return text;
}

}  // namespace abbe::sim::study
