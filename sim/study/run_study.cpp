#include "sim/study/run_study.h"

#include <algorithm>
#include <cstdio>
#include <set>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/escape.h"
#include "sim/cut/stages.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/study/budget_of.h"
#include "sim/study/csv_field.h"
#include "sim/study/histories.h"
#include "sim/study/influence_files.h"
#include "sim/study/picture_names.h"
#include "sim/study/study_page.h"
#include "sim/study/words.h"

namespace abbe::sim::study {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

constexpr std::uint64_t most_input_cells = 2'000'000;
constexpr std::uint64_t inputs_at_once = 1024;

std::string journal_name(const StudyOptions& options) {
  if (!options.shard) return "journal.sqlite";
  return fmt::format("journal-{}-of-{}.sqlite", options.shard->index, options.shard->count);
}

/// Every journal of the folder: of one process, of shards.
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

Recorded recorded_of(const Study& study, const path& folder) {
  const std::vector<path> files = journals(folder);
  if (files.empty())
    throw BadInput(folder.string(), 0, 0, "a folder with a journal: the --out of `abbe study`",
                   "none");
  Recorded all = merged(files);
  if (all.identity != study.identity)
    throw BadInput(files.front().string(), 0, 0,
                   "the journal of this study: the same file, scene, --set and program",
                   "that of another one");
  return all;
}

std::uint64_t cases_in(const std::vector<Batch>& batches) {
  std::uint64_t count = 0;
  for (const Batch& batch : batches) count += batch.last - batch.first;
  return count;
}

/// Into how many shards the journals of a folder part a study; 1 if there are none.
int shards_of(const path& folder) {
  int most = 1;
  for (const path& file : journals(folder)) {
    int index = 0, count = 0;
    if (std::sscanf(file.filename().c_str(), "journal-%d-of-%d", &index, &count) == 2)
      most = std::max(most, count);
  }
  return most;
}

/// Which shards miss how many cases.
std::string missing_of_shards(const Plan& plan, const std::vector<Row>& rows, int shards) {
  std::vector<std::uint64_t> finished;
  for (const Row& row : rows) finished.push_back(row.index);
  const std::vector<Batch> batches = batches_of(plan);
  std::string text;
  for (int i = 0; i < shards; ++i) {
    const std::uint64_t missing = cases_in(unfinished(of_shard(batches, {i, shards}), finished));
    if (missing > 0) text += fmt::format(", {} missing of --shard {}/{}", missing, i, shards);
  }
  return text;
}

std::string response_head(const Study& study, const Arm& arm, Response response) {
  const std::string unit = unit_of(response) == std::string("%") ? "percent" : unit_of(response);
  const std::string figure = fmt::format("{}_{}", name_of(response), unit);
  return study.arms.size() == 1 ? figure : arm.name + " " + figure;
}

std::string table_head(const Study& study, bool with_inputs) {
  std::string head = "case,analysis,engine";
  for (const Input& input : study.inputs)
    if (with_inputs) head += "," + csv_field(input.name + " / " + unit_of(input));
  for (const Arm& arm : study.arms)
    for (const Response response : study.responses)
      head += "," + csv_field(response_head(study, arm, response));
  return head + ",fault\n";
}

/// What the journal of a folder says, block by block.
StudyResult state(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  ordered_json blocks = ordered_json::array();
  std::string text = fmt::format("{}: {} of {} cases are finished\n", escaped(study.title),
                                 rows.size(), plan.cases);
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

/// With every name on one line, for the terminal.
std::vector<HistoryResult> one_lined(std::vector<HistoryResult> results) {
  for (HistoryResult& one : results) {
    one.train = escaped(one.train);
    one.test = escaped(one.test);
    for (std::string& sensor : one.sensors) sensor = escaped(sensor);
  }
  return results;
}

// Seconds on two cores, of a vertex of an influence map: its rivals, an input's effect, a check, a
// case estimated from it, its pictures.
constexpr double s_of_vertex_rivalled = 6e-5, s_of_vertex_input = 2e-6, s_of_vertex_checked = 4e-5,
                 s_of_vertex_case = 4e-8, s_of_vertex_drawn = 2e-5;

bool has_maps(const Study& study) { return study.engine != Engine::Full && !study.inputs.empty(); }

/// Of the scenes of a study before they are prepared.
WorkSize size_of_scene(const Study& study) {
  return study.arms.empty() ? WorkSize{} : expected_size(scene_of(study, study.arms.front()));
}

/// Every arm made ready, as `ready_study` reports it.
std::vector<Stage> stages_of_making_ready(const Study& study) {
  const std::string part = "prepare " + study.title;
  const WorkSize size = size_of_scene(study);
  std::vector<Stage> stages;
  for (std::size_t i = 0; i < study.arms.size(); ++i) {
    stages = std::move(stages) + stages_of_preparing(part, size);
    if (study.machine_part) stages = std::move(stages) + stages_of_error_free(part, size);
  }
  const double inputs = double(study.inputs.size());
  for (std::size_t i = 0; has_maps(study) && i < study.arms.size(); ++i)
    stages = std::move(stages) +
             std::vector<Stage>{
                 {part, "rivals", s_of_vertex_rivalled * size.vertices},
                 {part, "inputs", s_of_vertex_input * size.vertices * inputs},
                 {part, "checks", s_of_vertex_checked * size.vertices * study.influence.checks}};
  return stages;
}

/// Cases that are left, tables, pictures, days.
std::vector<Stage> stages_of_cases(const Study& study, const std::string& part,
                                   const std::vector<Batch>& left, const Plan& plan,
                                   const WorkSize& size) {
  double seconds = 0.0;
  for (const Batch& batch : left) {
    const double cases = double(batch.last - batch.first) * double(study.arms.size());
    if (!block_of(plan, batch.first).full)
      seconds += cases * s_of_vertex_case * size.vertices;
    else
      for (const Stage& one : stages_of_cut(part, size)) seconds += cases * one.seconds;
  }
  return {{part, "cases", seconds}};
}

std::vector<Stage> stages_of_results(const Study& study, const WorkSize& size) {
  std::vector<Stage> stages;
  if (!study.inputs.empty())
    stages = {
        {"budget", "budget", 0.5 * double(study.arms.size())},
        {"pictures", "budget", 2.0},
        {"pictures", "maps",
         has_maps(study) ? s_of_vertex_drawn * size.vertices * double(study.arms.size()) : 0.0}};
  if (study.histories)
    stages.push_back({"histories", "thermal histories",
                      double(study.histories->train.size() * (1 + study.histories->test.size()))});
  return stages;
}

/// Tables and pictures of the finished cases.
class Results {
 public:
  Results(const Study& study, const ResultFolder& folder, std::string report_language,
          ProgressLine& progress)
      : study_(study),
        folder_(folder),
        report_language_(std::move(report_language)),
        progress_(progress) {}

  StudyResult write(const ReadyStudy& ready, const std::vector<Row>& rows) {
    StudyResult result{ordered_json::object(), ""};
    if (!study_.inputs.empty()) result = write_budget(ready, rows);
    if (study_.histories) {
      progress_.begin("histories");
      const auto results = histories(study_, to(progress_));
      write_histories(folder_, study_, results);
      result.json["histories"] = to_json(results);
      result.text += to_text(one_lined(results));
    }
    write_file(folder_ / "study.toml", study_.text);
    write_scenes(ready);
    write_json(folder_ / "budget.json", result.json);
    result.warnings = write_page();
    result.text += fmt::format("\nfiles in {}\n", escaped(folder_.path().string()));
    return result;
  }

 private:
  StudyResult write_budget(const ReadyStudy& ready, const std::vector<Row>& rows) {
    progress_.begin("budget");
    const Budget budget = budget_of(ready, rows, to(progress_));
    StudyResult result{to_json(budget), to_text(budget)};
    write_table(folder_ / "cases.csv", cases_csv(study_, ready.plan, rows));
    write_table(folder_ / "budget.csv", to_csv(budget));
    write_table(folder_ / "budget.md", to_markdown(budget));
    progress_.begin("pictures");
    write_pictures(folder_, budget, to(progress_));
    PictureNames names;
    for (std::size_t arm = 0; arm < ready.influences.size(); ++arm) {
      progress_.report("maps", double(arm) / double(ready.influences.size()));
      const std::string own_name =
          study_.arms.size() == 1 ? "" : names.unused({study_.arms[arm].name});
      const ResultFolder own = folder_.inside(own_name);
      result.json["arms"][arm].update(write_influence(own, ready, arm));
    }
    return result;
  }

  /// The scenes as they were understood, one of each variant.
  void write_scenes(const ReadyStudy& ready) {
    PictureNames names;
    std::set<std::string> written;
    for (const ReadyArm& arm : ready.arms) {
      const std::string& variant = arm.arm.variant;
      if (!written.insert(variant).second) continue;
      std::vector<std::string> parts{"scene"};
      if (!variant.empty()) parts.push_back(variant);
      write_file(folder_ / (names.unused(parts) + ".toml"), arm.scene.resolved);
    }
  }

  /// Where no page is asked for, that of an earlier run goes.
  /// @return what the page leaves out
  std::vector<std::string> write_page() {
    const ResultFile file = folder_ / "report.html";
    if (report_language_.empty()) {
      remove_file(file);
      return {};
    }
    const HtmlReport page = study_page(folder_.path(), report_language_);
    write_file(file, page.html);
    return page.warnings;
  }

  const Study& study_;
  const ResultFolder& folder_;
  std::string report_language_;
  ProgressLine& progress_;
};

/// A rank that computes for another one.
void serve(const Study& study, const std::vector<Batch>& left, const Ranks& ranks) {
  const ReadyStudy ready = left.empty() ? ReadyStudy{study, {}, {}, {}} : ready_study(study);
  farm(left, ranks, compute_of(ready), {});
}

}  // namespace

StudyResult run_study(const path& file, const StudyOptions& options, const Ranks& ranks) {
  const Study study = read_trusted_study(file, options.overrides, options.permissions);
  const Plan plan = plan_of(study);
  std::vector<Batch> batches = batches_of(plan);
  if (options.shard) batches = of_shard(batches, *options.shard);
  if (ranks.rank != 0) {
    serve(study, unfinished(batches, from_rank_0(ranks, {})), ranks);
    return {};
  }
  const ResultFolder folder(options.folder, {options.permissions, study.files});
  const ResultFile file_of_journal = folder / journal_name(options);
  claim(file_of_journal);
  Journal journal(file_of_journal.path(), study.identity);
  const std::vector<std::uint64_t> finished = from_rank_0(ranks, journal.finished());
  const std::vector<Batch> left = unfinished(batches, finished);

  const std::uint64_t all = cases_in(left);
  const std::string cases = fmt::format("{} of {} cases", all, cases_in(batches));
  const auto rest = [&](const WorkSize& size) {
    std::vector<Stage> stages = stages_of_cases(study, cases, left, plan, size);
    return options.shard ? stages : std::move(stages) + stages_of_results(study, size);
  };
  ProgressLine progress(stages_of_making_ready(study) + rest(size_of_scene(study)),
                        options.progress);
  progress.begin("prepare " + study.title);
  const bool computes = !left.empty() || !options.shard;
  const ReadyStudy ready =
      computes ? ready_study(study, to(progress)) : ReadyStudy{study, plan, {}, {}};
  if (!ready.arms.empty()) progress.replan(rest(size_of(ready.arms.front().job)));
  progress.begin(cases);
  std::uint64_t done = 0;
  farm(left, ranks, compute_of(ready), [&](const Batch&, const std::vector<Row>& rows) {
    journal.add(rows);
    done += rows.size();
    progress.report("cases", double(done) / double(all));
  });
  const Recorded made = recorded(file_of_journal.path());
  if (options.shard) return state(study, plan, made.rows);
  return Results(study, folder, options.report_language, progress).write(ready, made.rows);
}

StudyResult merge_study(const path& file, const StudyOptions& options) {
  const Study study = read_trusted_study(file, options.overrides, options.permissions);
  const Recorded all = recorded_of(study, options.folder);
  const Plan plan = plan_of(study);
  if (all.rows.size() != plan.cases)
    throw BadInput(options.folder.string(), 0, 0,
                   fmt::format("all {} cases; start the shards again, they go on where they "
                               "stopped",
                               plan.cases),
                   fmt::format("{} of them finished", all.rows.size()) +
                       missing_of_shards(plan, all.rows, shards_of(options.folder)));
  const ResultFolder folder(options.folder, {options.permissions, study.files});
  ProgressLine progress(
      stages_of_making_ready(study) + stages_of_results(study, size_of_scene(study)),
      options.progress);
  progress.begin("prepare " + study.title);
  const ReadyStudy ready = ready_study(study, to(progress));
  return Results(study, folder, options.report_language, progress).write(ready, all.rows);
}

StudyResult show_study(const path& file, const StudyOptions& options) {
  const Study study = read_study(file, options.overrides);
  const Plan plan = plan_of(study);
  const Recorded all = recorded_of(study, options.folder);
  StudyResult result = state(study, plan, all.rows);
  const Budget budget = budget_of(study, plan, all.rows);
  result.json["budget"] = to_json(budget);
  result.text += "\n" + to_text(budget);
  return result;
}

std::string cases_csv(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  const bool with_inputs = rows.size() * study.inputs.size() <= most_input_cells;
  std::string text;
  text += table_head(study, with_inputs);
  Eigen::MatrixXd x;  // of the cases from .. to - 1
  std::uint64_t from = 0, to = 0;
  for (const Row& row : rows) {
    if (with_inputs && row.index >= to) {
      from = row.index;
      to = std::min(plan.cases, from + inputs_at_once);
      x = inputs_of(study, plan, from, to);
    }
    const Block& block = block_of(plan, row.index);
    text +=
        fmt::format("{},{},{}", row.index, name_of(block.kind), block.full ? "full" : "influence");
    if (with_inputs)
      for (const double value : x.col(Eigen::Index(row.index - from)))
        text += fmt::format(",{}", value);
    for (std::size_t i = 0; i < row.answers.size(); ++i)
      text += fmt::format(
          ",{}", csv_field(in_unit(study.responses[i % study.responses.size()], row.answers[i])));
    text += fmt::format(",{}\n", csv_field(row.fault));
  }
  return text;
}

}  // namespace abbe::sim::study
