#include "sim/commands/evaluate_command.h"

#include <memory>

#include <fmt/format.h>

#include "sim/calibration/evaluate.h"
#include "sim/files/one_lined.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/report/evaluate_pictures.h"

namespace abbe::sim {
namespace {

using Json = nlohmann::ordered_json;

void print(std::string& text, const Json& values, int indent) {
  for (const auto& [key, value] : values.items()) {
    if (key == "name" || key == "standard") continue;
    const std::string label = std::string(std::size_t(indent), ' ') + key;
    if (value.is_object() && value.contains("standard_uncertainty"))
      text += fmt::format("{:<40} {:>12.4f}   u {:.4f}\n", label, value["value"].get<double>(),
                          value["standard_uncertainty"].get<double>());
    else if (value.is_object()) {
      text += label + "\n";
      print(text, value, indent + 2);
    } else if (value.is_array() && !value.empty() && value.front().is_object()) {
      for (const Json& one : value) {
        text += label + ": " + one["name"].get<std::string>() + "\n";
        print(text, one, indent + 2);
      }
    } else if (value.is_number_float())
      text += fmt::format("{:<40} {:>12.4f}\n", label, value.get<double>());
    else if (value.is_null())
      text += fmt::format("{:<40} {:>12}\n", label, "-");
    else if (!(value.is_array() && value.empty()))
      text += fmt::format("{:<40} {:>12}\n", label,
                          value.is_string() ? value.get<std::string>() : value.dump());
  }
}

}  // namespace

Json evaluate(const std::filesystem::path& file, const EvaluateOptions& options) {
  const Evaluation source = evaluation_of(file);
  Json evaluation = source.json;
  evaluation["pictures"] = Json::array();
  if (options.folder.empty()) return evaluation;
  const ResultFolder folder(options.folder, {options.permissions, {file}});
  stop_if_interrupted();
  const ResultFile json = folder / "evaluation.json";
  write_json(json, evaluation);
  const auto pictures = source.part ? write_part_picture(folder, *source.part, file.string())
                                    : write_test_pictures(folder, source.tests, file.string());
  for (const std::filesystem::path& picture : pictures)
    evaluation["pictures"].push_back(picture.string());
  write_json(json, evaluation);
  return evaluation;
}

std::string evaluation_text(const Json& evaluation) {
  std::string text = fmt::format("{} ({})\n", evaluation["file"].get<std::string>(),
                                 evaluation["kind"].get<std::string>());
  for (const Json& test : evaluation["tests"]) {
    text += fmt::format("\n{} -- {}\n", test["name"].get<std::string>(),
                        test["standard"].get<std::string>());
    print(text, test, 2);
  }
  if (evaluation.contains("temperatures")) {
    text += "\ntemperatures, C\n";
    for (const auto& [name, one] : evaluation["temperatures"].items())
      text += fmt::format("  {:<38} {:>8.2f} .. {:.2f}\n", name, one["min_C"].get<double>(),
                          one["max_C"].get<double>());
  }
  for (const Json& picture : evaluation["pictures"])
    text += "\npicture " + picture.get<std::string>();
  return text + (evaluation["pictures"].empty() ? "" : "\n");
}

namespace {

Exit print_evaluation(const Common& common, const std::filesystem::path& readings) {
  EvaluateOptions options;
  options.folder = common.out.empty() ? std::filesystem::path("out") / readings.stem() : common.out;
  options.permissions = common.permissions;
  const nlohmann::ordered_json evaluation = evaluate(readings, options);
  print("{}", Lines(common.json ? json_text(evaluation) : evaluation_text(one_lined(evaluation))));
  return Exit::Ok;
}

}  // namespace

Command evaluate_command(Common& common) {
  const auto readings = std::make_shared<std::filesystem::path>();
  return {"evaluate",
          "Evaluate readings by the standards (ISO 230, 25178)",
          {{"READINGS", readings.get(),
            "a file that measure wrote, position readings as CSV, or a laser's position file"},
           json_option(common),
           {"--out", &common.out, "folder for report and pictures (out/NAME)"},
           force_option(common)},
          [readings, &common] { return print_evaluation(common, *readings); }};
}

}  // namespace abbe::sim
