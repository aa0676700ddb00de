#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/evaluate.h"

namespace abbe::sim {

/// {"file", "kind", "tests": [{"name", "standard", ...}], "temperatures", "pictures"}; the key of a
/// figure is its name and its unit.
nlohmann::ordered_json to_json(const Evaluation& evaluation,
                               const std::vector<std::filesystem::path>& pictures = {});

/// The same as a person reads it: a table a test.
std::string to_text(const Evaluation& evaluation,
                    const std::vector<std::filesystem::path>& pictures = {});

}  // namespace abbe::sim
