#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/collision_events.h"
#include "sim/cut/program_inspection.h"

/// What a program asks of a machine, as text and as JSON.
namespace abbe::sim {

std::string to_text(const ProgramInspection& alone);
nlohmann::ordered_json to_json(const ProgramInspection& alone);
/// Returns a list of {text, key, option, line}, the option only where there is one.
nlohmann::ordered_json to_json(const std::vector<program::Assumption>& assumptions);

/// Events with line, time, pair, depth and place, clearances of pairs and of blocks; lengths in mm.
nlohmann::ordered_json to_json(const Collisions& collisions);

/// The same as text for people, without the clearances of the blocks and with those of the nearest
/// pairs alone.
std::string to_text(const Collisions& collisions);

}  // namespace abbe::sim
