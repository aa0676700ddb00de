#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/report/summary.h"

namespace abbe::sim {

/// `summary.json` of a case and `comparison.json` of all; the keys are a promise to scripts.
nlohmann::ordered_json to_json(const Summary& summary);
nlohmann::ordered_json to_json(const Comparison& comparison);

/// A table of residuals, a line a case.
std::string to_text(const Summary& summary);
std::string to_text(const Comparison& comparison);

}  // namespace abbe::sim
