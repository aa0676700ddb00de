#include "sim/study/study_page.h"

#include <algorithm>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/files/result_mark.h"
#include "sim/report/figures_page.h"
#include "sim/report/page_blocks.h"
#include "sim/report/saved_json.h"
#include "sim/study/study_blocks.h"

namespace abbe::sim::study {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

constexpr std::size_t most_shown_machines = 20000;  // of one response

/// Takes the fields of a CSV file (RFC 4180) record by record.
class CsvRecords {
 public:
  explicit CsvRecords(const path& file) : file_(file), in_(file, std::ios::binary) {
    if (!in_) throw BadInput(file.string(), 0, 0, "a table that can be read", "none");
  }

  /// @return false at the end of the file
  bool next(std::vector<std::string>& fields) {
    fields.assign(1, "");
    bool quoted = false, any = false;
    for (int c = in_.get(); c != EOF; c = in_.get()) {
      any = true;
      if (c == '"' && quoted && in_.peek() == '"')
        fields.back() += char(in_.get());
      else if (c == '"')
        quoted = !quoted;
      else if (c == ',' && !quoted)
        fields.emplace_back();
      else if (c == '\n' && !quoted)
        break;
      else if (c != '\r' || quoted)
        fields.back() += char(c);
    }
    if (any) ++number_;
    if (quoted) refuse("a quoted field that ends", "the end of the file");
    return any;
  }

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen) const {
    throw BadInput(file_.string(), number_, 0, expected, seen);
  }

 private:
  path file_;
  std::ifstream in_;
  int number_ = 0;
};

/// The answers of random machines, those without an answer left out.
MachineAnswers machine_answers(const path& file, const std::vector<std::string>& heads) {
  CsvRecords records(file);
  std::vector<std::string> fields;
  if (!records.next(fields)) records.refuse("the head of a table of cases", "nothing");
  const std::vector<std::string> names = fields;
  const auto column = [&](const std::string& name) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) records.refuse("a column " + name, "none of that name");
    return std::size_t(at - names.begin());
  };
  const std::size_t analysis = column("analysis");
  std::vector<std::size_t> at;
  for (const std::string& head : heads) at.push_back(column(head));
  MachineAnswers answers;
  while (records.next(fields)) {
    if (fields.size() != names.size())
      records.refuse(fmt::format("{} fields", names.size()), std::to_string(fields.size()));
    if (fields[analysis] != "monte_carlo") continue;
    for (std::size_t k = 0; k < at.size(); ++k) {
      if (fields[at[k]].empty()) continue;
      const auto value = number_of(fields[at[k]]);
      if (!value) records.refuse("a number", in_quotes(fields[at[k]]));
      answers[heads[k]].push_back(*value);
    }
  }
  return answers;
}

/// Those that a page shows.
std::vector<double> by_rank(std::vector<double> values) {
  if (values.size() <= most_shown_machines) return values;
  std::ranges::sort(values);
  std::vector<double> few;
  for (std::size_t k = 0; k < most_shown_machines; ++k)
    few.push_back(values[k * (values.size() - 1) / (most_shown_machines - 1)]);
  return few;
}

/// Heads of the columns that hold random machines.
std::vector<std::string> heads_of(const ordered_json& budget) {
  std::vector<std::string> heads;
  if (!budget.contains("arms")) return heads;
  for (const ordered_json& arm : budget.at("arms"))
    for (const ordered_json& one : arm.at("responses"))
      if (!one.at("monte_carlo").is_null()) heads.push_back(answers_head(budget, arm, one));
  return heads;
}

MachineAnswers shown_answers(const path& folder, const ordered_json& budget,
                             std::vector<std::string>& warnings) {
  const std::vector<std::string> heads = heads_of(budget);
  if (heads.empty()) return {};
  const path file = folder / "cases.csv";
  if (!std::filesystem::exists(file)) {
    warnings.push_back(
        "the distribution of random machines is left out of the report: the folder has no "
        "cases.csv");
    return {};
  }
  MachineAnswers answers = machine_answers(file, heads);
  for (auto& [head, values] : answers) {
    const std::size_t all = values.size();
    values = by_rank(std::move(values));
    if (values.size() < all)
      warnings.push_back(
          fmt::format("of the {} random machines of {} the report holds {}, every "
                      "{:.3g}th by rank",
                      all, head, values.size(), double(all) / double(values.size())));
  }
  return answers;
}

/// Pictures of maps in the folder and in those of its arms, by name.
std::vector<path> map_pictures(const path& folder) {
  std::vector<path> files;
  const auto look = [&](const path& inside) {
    for (const auto& entry : std::filesystem::directory_iterator(inside)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file() && name.ends_with(".png") &&
          (name.starts_with("influence") || name == "uncertainty.png"))
        files.push_back(entry.path());
    }
  };
  look(folder);
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_directory()) look(entry.path());
  std::ranges::sort(files);
  return files;
}

std::string plain_text(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

void add_asked(FiguresPage& page, const ordered_json& budget, const path& folder) {
  page.asked.push_back({"study", page.title});
  for (const char* key : {"engine", "seed", "cases", "failed_cases"})
    if (budget.contains(key))
      page.asked.push_back({"study_" + std::string(key), plain_text(budget.at(key))});
  if (budget.contains("inputs"))
    page.asked.push_back({"study_inputs", std::to_string(budget.at("inputs").size())});
  page.asked.push_back({"folder", std::filesystem::absolute(folder).lexically_normal().string()});
}

/// Whether an arm of the budget is cut in a variant of the scene.
bool has_variants(const ordered_json& budget) {
  if (!budget.contains("arms")) return true;
  return std::ranges::any_of(budget.at("arms"), [](const ordered_json& arm) {
    return !arm.at("variant").get<std::string>().empty();
  });
}

/// The files and the command that uses them; a scene with variants stays where it was.
void add_files(FiguresPage& page, const ordered_json& budget, const path& folder) {
  for (const char* name : {"study.toml", "scene.toml", "budget.json", "budget.csv", "budget.md"})
    if (std::filesystem::exists(folder / name))
      page.files.push_back({name, read_text(folder / name, most_saved_bytes)});
  const bool has_scene = std::filesystem::exists(folder / "scene.toml") && !has_variants(budget);
  page.command = std::string("abbe study study.toml") +
                 (has_scene ? " --set scene=scene.toml" : "") + " --report";
}

void add_warnings(FiguresPage& page, const ordered_json& budget, const path& folder) {
  if (budget.contains("warnings"))
    for (const ordered_json& one : budget.at("warnings"))
      page.warnings.push_back(one.get<std::string>());
  if (budget.contains("histories"))
    for (const ordered_json& one : budget.at("histories"))
      for (const ordered_json& warning : one.at("warnings"))
        page.warnings.push_back(warning.get<std::string>());
  const Mark mark = read_mark(folder);
  if (!writer_in(mark, folder / "budget.json"))
    page.warnings.push_back(
        "budget.json is not as abbe study wrote it, or the mark of its folder is missing");
}

HtmlReport page_of_budget(const ordered_json& budget, const path& folder,
                          const std::string& language) {
  if (!budget.is_object() || !(budget.contains("arms") || budget.contains("histories")))
    throw std::invalid_argument("JSON of something else");
  HtmlReport report;
  FiguresPage page;
  page.language = language;
  page.title = budget.contains("study") ? budget.at("study").get<std::string>()
                                        : std::filesystem::absolute(folder).filename().string();
  page.blocks = study_blocks(budget, shown_answers(folder, budget, report.warnings));
  ordered_json maps =
      pictures_block("influence-maps", label_word("influence_maps"), folder, map_pictures(folder));
  if (!maps.is_null()) {
    maps["note"] = label_word("influence_maps_note");
    page.blocks.insert(
        page.blocks.begin() + std::ptrdiff_t(std::min<std::size_t>(page.blocks.size(), 2)), maps);
  }
  add_asked(page, budget, folder);
  add_warnings(page, budget, folder);
  page.warnings.insert(page.warnings.end(), report.warnings.begin(), report.warnings.end());
  add_files(page, budget, folder);
  report.html = html_of(page);
  return report;
}

}  // namespace

bool holds_study(const path& folder) { return std::filesystem::exists(folder / "budget.json"); }

HtmlReport study_page(const path& folder, const std::string& language) {
  const path file = folder / "budget.json";
  if (!std::filesystem::exists(file))
    throw BadInput(folder.string(), 0, 0, "the folder of a finished study, with its budget.json",
                   "none of that name");
  HtmlReport report;
  with_saved_json(file, "the budget of a study as abbe study writes it, with arms or histories",
                  [&](const ordered_json& budget, const std::string&) {
                    report = page_of_budget(budget, folder, language);
                  });
  return report;
}

}  // namespace abbe::sim::study
