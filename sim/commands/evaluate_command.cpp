#include "sim/commands/evaluate_command.h"

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/files/progress.h"
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
  return evaluated;
}

}  // namespace abbe::sim
