#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/collision_events.h"
#include "sim/cut/program_inspection.h"

/// Reports on the inspection of a program for a machine, and on its collisions, as text and JSON.
namespace abbe::sim {

/// Return moves, times, extents, travel, tools and NC words of a program.
std::string to_text(const ProgramInspection& inspection);
nlohmann::ordered_json to_json(const ProgramInspection& inspection);
/// Returns a list of {text, key, option, line}. The option is present only if there is one.
nlohmann::ordered_json to_json(const std::vector<program::Assumption>& assumptions);

/// Returns the events with line, time, pair, depth and position, and the clearances of pairs and of
/// blocks; lengths in mm.
nlohmann::ordered_json to_json(const Collisions& collisions);

/// Returns the events and the clearances of the nearest pairs as text.
std::string to_text(const Collisions& collisions);

}  // namespace abbe::sim
