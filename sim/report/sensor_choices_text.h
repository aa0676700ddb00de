#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// The choices as a person reads them, a few lines each.
std::string sensor_choices_text(const nlohmann::ordered_json& choices);

}  // namespace abbe::sim
