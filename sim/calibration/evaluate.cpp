#include "sim/calibration/evaluate.h"

#include "errors/metrology/machine_results.h"
#include "errors/metrology/part_results.h"
#include "errors/metrology/position_file.h"
#include "errors/metrology/reading_diagnostics.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/bad_scene.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;

metrology::Tests tests_of_sets(const std::vector<metrology::PositionSet>& sets,
                               const std::string& stem) {
  metrology::Tests tests;
  for (const metrology::PositionSet& set : sets) {
    metrology::AxisTest test;
    test.name = set.name.empty() ? stem : set.name;
    test.angle = test.rotary = set.rotary;
    test.runs = set.runs;
    tests.axes.push_back(std::move(test));
  }
  return tests;
}

std::vector<Evaluation::Temperatures> temperatures_of(const metrology::Readings& readings) {
  std::vector<Evaluation::Temperatures> all;
  if (readings.plan.looks.empty()) return all;
  for (std::size_t k = 0; k < readings.sensors.size(); ++k) {
    const auto column = readings.T_C.col(Eigen::Index(k));
    all.push_back({readings.sensors[k], column.minCoeff(), column.maxCoeff()});
  }
  return all;
}

/// A file by what it holds, not evaluated yet.
Evaluation read(const std::filesystem::path& file) {
  Evaluation found{file, {}, {}, {}, {}, {}, {}};
  metrology::ReadingDiagnostics diagnostics;
  const std::string text = read_text(file, std::size_t(256) << 20);
  if (holds_part_readings(text)) {
    found.part = read_part_readings(text, file.string());
    if (found.part->readings.deviation.size() < 3)
      throw BadInput(file.string(), 0, 0, "at least 3 points of a part", "fewer");
    found.kind = found.part->kind;
    diagnostics = metrology::diagnose(found.part->readings);
  } else if (holds_readings(text)) {
    const metrology::Readings readings = read_readings(text, file.string());
    found.kind = readings.plan.kind;
    if (readings.value.size() > 0) found.tests = tests_of(readings);
    found.temperatures = temperatures_of(readings);
    diagnostics = metrology::diagnose(readings);
  } else {
    found.kind = "position file";
    found.tests =
        tests_of_sets(metrology::read_positions(text, file.string()), file.stem().string());
    diagnostics = metrology::diagnose(found.tests.axes);
  }
  std::vector<BadInput> errors;
  for (const std::string& error : diagnostics.errors)
    errors.emplace_back(file.string(), 0, 0, "readings of a working instrument", error);
  if (!errors.empty()) throw BadScene(std::move(errors));
  found.warnings = std::move(diagnostics.warnings);
  return found;
}

}  // namespace

Evaluation evaluation_of(const std::filesystem::path& file) {
  Evaluation evaluation = read(file);
  try {
    evaluation.results =
        evaluation.part ? results_of(evaluation.part->readings) : results_of(evaluation.tests);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(file.string(), 0, 0, "readings that a standard can evaluate", fault.what());
  }
  return evaluation;
}

}  // namespace abbe::sim
