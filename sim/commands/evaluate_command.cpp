#include "sim/commands/evaluate_command.h"

#include <memory>

#include <nlohmann/json.hpp>

#include "sim/commands/outcome_text.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/report/evaluate_page.h"
#include "sim/report/evaluate_pictures.h"
#include "sim/report/evaluation_report.h"

namespace abbe::sim {

Evaluated evaluate(const std::filesystem::path& file, const EvaluateOptions& options) {
  Evaluated evaluated{evaluation_of(file), {}};
  if (options.folder.empty()) return evaluated;
  const Evaluation& evaluation = evaluated.evaluation;
  const ResultFolder folder(options.folder, {options.permissions, {file}});
  stop_if_interrupted();
  const ResultFile json = folder / "evaluation.json";
  write_json(json, to_json(evaluation));
  evaluated.pictures = evaluation.part
                           ? write_part_picture(folder, *evaluation.part, file.string())
                           : write_test_pictures(folder, evaluation.tests, file.string());
  write_json(json, to_json(evaluation, evaluated.pictures));
  if (options.report_language.empty()) {
    remove_file(folder / "report.html");  // that of an earlier evaluation
    return evaluated;
  }
  FiguresPage page = evaluate_page(evaluation);
  page.language = options.report_language;
  page.command = options.permissions.command;
  write_file(folder / "report.html", html_of(page));
  return evaluated;
}

namespace {

struct EvaluateWords {
  std::filesystem::path readings;
  bool report = false;
  std::string language = "en";
};

Exit print_evaluation(const Common& common, const EvaluateWords& words) {
  const std::filesystem::path& readings = words.readings;
  EvaluateOptions options;
  if (words.report) options.report_language = words.language;
  options.folder = common.out.empty() ? std::filesystem::path("out") / readings.stem() : common.out;
  options.permissions = common.permissions;
  const Evaluated done = evaluate(readings, options);
  print("{}", Lines(common.json ? json_text(to_json(done.evaluation, done.pictures))
                                : to_text(done.evaluation, done.pictures)));
  return Exit::Ok;
}

}  // namespace

Command evaluate_command(Common& common) {
  const auto words = std::make_shared<EvaluateWords>();
  return {"evaluate",
          "Evaluate readings by the standards (ISO 230, 25178)",
          {"abbe evaluate out/calibration/laser.csv --out out/laser",
           "abbe evaluate out/calibration/ball_bar.csv --json"},
          {{"READINGS", &words->readings,
            "a file that measure wrote, position readings as CSV, or a laser's position file"},
           json_option(common),
           {"--out", &common.out, "folder for report and pictures (out/NAME)"},
           {"--report", &words->report,
            "besides, report.html: tables and charts with the values under the cursor"},
           language_option(words->language),
           force_option(common)},
          [words, &common] { return print_evaluation(common, *words); }};
}

}  // namespace abbe::sim
