#pragma once

#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/progress.h"
#include "sim/report.h"

namespace abbe::sim {

struct RunOptions {
  std::vector<Override> overrides;
  std::filesystem::path folder;     ///< every file goes there
  std::optional<CaseDescription> only;  ///< `run`: this compensator; none: uncompensated
  bool error_free = false;              ///< `run --case error_free`
};

/// What a command leaves besides its files.
struct Outcome {
  nlohmann::ordered_json json;         ///< summary or comparison
  std::vector<std::string> exceeded;   ///< acceptance limits that a judged case breaks
};

/// Cuts one case of a scene and writes every file of it.
/// @throws BadScene, BadInput, OutputFailure, Interrupted
Outcome run(const std::filesystem::path& scene, const RunOptions& options);

/// Cuts the error-free machine, the uncompensated one and every compensator of the scene, for every
/// variant, and writes a folder a case, `comparison.json` and `comparison.png`.
Outcome compare(const std::filesystem::path& scene, const RunOptions& options);

}  // namespace abbe::sim
