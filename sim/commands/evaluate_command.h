#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "sim/commands/command.h"
#include "sim/files/permissions.h"

namespace abbe::sim {

struct EvaluateOptions {
  std::filesystem::path folder;  ///< evaluation.json and pictures; empty: none are written
  Permissions permissions = {};
};

/// Evaluates readings (sim/calibration/evaluate.h) and writes what the options ask for.
/// @return the JSON of the evaluation with "pictures", the files of them
/// @throws BadInput, BadScene, OutputFailure
nlohmann::ordered_json evaluate(const std::filesystem::path& readings,
                                const EvaluateOptions& options = {});

/// The same as a person reads it: a table a test.
std::string evaluation_text(const nlohmann::ordered_json& evaluation);

/// `abbe evaluate`.
Command evaluate_command(Common& common);

}  // namespace abbe::sim
