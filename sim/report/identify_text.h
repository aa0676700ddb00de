#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// The report as a person reads it.
std::string identify_text(const nlohmann::ordered_json& report);

}  // namespace abbe::sim
