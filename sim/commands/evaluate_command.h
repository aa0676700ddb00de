#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/calibration/evaluate.h"
#include "sim/commands/command.h"
#include "sim/files/permissions.h"

namespace abbe::sim {

struct EvaluateOptions {
  std::filesystem::path folder;  ///< evaluation.json and pictures; empty: none are written
  Permissions permissions = {};
  std::string report_language = {};  ///< of report.html, "en" or "zh"; empty: none is written
};

/// An evaluation and the pictures that were written of it.
struct Evaluated {
  Evaluation evaluation;
  std::vector<std::filesystem::path> pictures;
};

/// Evaluates readings (sim/calibration/evaluate.h) and writes what the options ask for.
/// @throws BadInput, BadScene, OutputFailure
Evaluated evaluate(const std::filesystem::path& readings, const EvaluateOptions& options = {});

/// `abbe evaluate`.
Command evaluate_command(Common& common);

}  // namespace abbe::sim
