#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/program_alone.h"

/// What a program asks of a machine, as text and as JSON.
namespace abbe::sim {

std::string to_text(const ProgramAlone& alone);
nlohmann::ordered_json to_json(const ProgramAlone& alone);
/// Returns a list of {text, key, option, line}, the option only where there is one.
nlohmann::ordered_json to_json(const std::vector<program::Assumption>& assumptions);

}  // namespace abbe::sim
