#include "sim/commands/report_command.h"

#include <memory>
#include <utility>

#include <nlohmann/json.hpp>

#include "sim/commands/outcome_text.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/evaluate_page.h"
#include "sim/report/html_report.h"
#include "sim/report/identify_page.h"
#include "sim/report/saved_json.h"
#include "sim/report/saved_page.h"
#include "sim/study/run_study.h"
#include "sim/study/study_page.h"

namespace abbe::sim {
namespace {

struct ReportWords {
  std::vector<std::filesystem::path> compensators;
  std::filesystem::path file;
  std::string language = "en";
};

/// A page that was written.
Exit print_written(const Common& common, const std::filesystem::path& file, std::size_t bytes,
                   const std::vector<std::string>& warnings) {
  if (common.json)
    print("{}",
          Lines(json_text({{"file", file.string()}, {"bytes", bytes}, {"warnings", warnings}})));
  else
    print("{}: {:.2f} MB\n", file.string(), double(bytes) * 1e-6);
  print_warnings(warnings);
  return Exit::Ok;
}

/// A study is computed, or what is left of it, as `abbe study` does.
Exit report_study(const Common& common, const ReportWords& words) {
  study::StudyOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  if (words.file.empty()) options.report_language = words.language;
  const study::StudyResult result = study::run_study(common.scene, options, {});
  const std::filesystem::path beside = options.folder / "report.html";
  if (words.file.empty())
    return print_written(common, beside, std::filesystem::file_size(beside), result.warnings);
  const HtmlReport page = study::study_page(options.folder, words.language);
  write_file(result_file(words.file, {common.permissions, {common.scene}}), page.html);
  return print_written(common, words.file, page.html.size(), page.warnings);
}

/// The page of what a command left, read from there.
HtmlReport page_of_results(const std::filesystem::path& results, const ReportWords& words) {
  if (std::filesystem::is_directory(results) && study::holds_study(results))
    return study::study_page(results, words.language);
  if (std::filesystem::is_directory(results) && holds_saved_cases(results))
    return saved_page(results, words.language);
  const bool is_evaluation = std::filesystem::is_directory(results);
  FiguresPage page = is_evaluation ? evaluate_page(results) : identify_page(results);
  page.language = words.language;
  page.command =
      is_evaluation ? "abbe evaluate READINGS --report" : "abbe identify READINGS --report";
  return {html_of(page), page.warnings};
}

/// What a page is made of, which it must not replace.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& results) {
  if (!std::filesystem::is_directory(results)) return {results};
  std::vector<std::filesystem::path> files = saved_files(results);
  std::erase_if(files, [](const auto& file) { return file.extension() == ".html"; });
  return files;
}

/// Beside the results, unless another place is named.
Exit report_results(const Common& common, const ReportWords& words) {
  if (!common.set.empty() || common.seed)
    throw BadUsage(common.set.empty() ? "--seed" : "--set",
                   "expected a scene or a study, seen results, which nothing changes");
  const std::filesystem::path& results = common.scene;
  const bool is_folder = std::filesystem::is_directory(results);
  const std::filesystem::path beside =
      is_folder ? results / "report.html"
                : std::filesystem::path(results).replace_extension(".html");
  const std::filesystem::path file = !words.file.empty()  ? words.file
                                     : common.out.empty() ? beside
                                                          : common.out / beside.filename();
  const HtmlReport page = page_of_results(results, words);
  write_file(result_file(file, {common.permissions, files_of(results)}), page.html);
  return print_written(common, file, page.html.size(), page.warnings);
}

void check_is_known(const std::filesystem::path& folder) {
  if (study::holds_study(folder) || holds_saved_cases(folder) ||
      std::filesystem::exists(folder / "evaluation.json"))
    return;
  throw BadUsage("SCENE",
                 "expected a scene, a study, or what run, compare, study, identify or evaluate "
                 "left, seen the folder " +
                     folder.string() +
                     " without comparison.json, summary.json, budget.json or evaluation.json");
}

Exit report(const Common& common, const ReportWords& words) {
  if (std::filesystem::is_directory(common.scene)) check_is_known(common.scene);
  if (std::filesystem::is_directory(common.scene) || common.scene.extension() == ".json")
    return report_results(common, words);
  if (study::is_study(common.scene)) return report_study(common, words);
  RunOptions options = run_options(common, words.compensators, {});
  ask_report(options, common, "report", words.language);
  const std::filesystem::path file =
      words.file.empty() ? result_folder(common) / "report.html" : words.file;
  const Reported reported = report(common.scene, options, file);
  print_written(common, file, reported.bytes, reported.warnings);
  for (const std::string& limit : reported.exceeded) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : reported.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!reported.failed.empty()) return Exit::PlugIn;
  return reported.exceeded.empty() ? Exit::Ok : Exit::LimitExceeded;
}

}  // namespace

Command report_command(Common& common) {
  const auto words = std::make_shared<ReportWords>();
  return {
      "report",
      "Write a scene's cases, a study or other results as one HTML file: maps, machine, charts",
      {"abbe report scenes/gantry_dome.toml -o out/dome.html",
       "abbe report scenes/studies/gantry_dome_budget.toml --out out/budget",
       "abbe report out/budget --language zh", "abbe report out/belief.json -o out/belief.html",
       "abbe report scenes/gantry_dome.toml --set errors.scale=2 --language zh --out out/twice"},
      scene_options(common,
                    {{"--out", &common.out,
                      "the page, or folder for it (out/SCENE/report.html; of results beside them)"},
                     force_option(common),
                     memory_option(common),
                     trust_option(common),
                     compensator_option(words->compensators),
                     language_option(words->language)}),
      [words, &common] {
        // the rest of what a page comes from stays where it is without --out
        Common own = common;
        ReportWords page = *words;
        if (own.out.extension() == ".html" && file_of_out(own.out, "report.html") == own.out)
          page.file = std::exchange(own.out, {});
        return report(own, page);
      }};
}

}  // namespace abbe::sim
