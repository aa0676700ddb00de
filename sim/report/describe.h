#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/cut.h"

namespace abbe::sim {

/// What `abbe check` prints: chain, low-order body array, axes, every element with value and slope
/// at zero and the line on which it was measured, heat, compliance, cut, part, program.
nlohmann::ordered_json describe(const Job& job);

/// The same as text for people.
std::string to_text(const nlohmann::ordered_json& description);

}  // namespace abbe::sim
