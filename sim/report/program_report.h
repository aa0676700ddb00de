#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/collision_events.h"
#include "sim/cut/program_inspection.h"

/// Reports of a program inspected on a machine, and of its collisions, as text and JSON.
namespace abbe::sim {

/// Return moves, times, extents, travel, tools and words of a program.
std::string to_text(const ProgramInspection& alone);
nlohmann::ordered_json to_json(const ProgramInspection& alone);
/// Returns a list of {text, key, option, line}, the option only if there is one.
nlohmann::ordered_json to_json(const std::vector<program::Assumption>& assumptions);

/// Returns events with line, time, pair, depth and position, clearances of pairs and of blocks;
/// lengths in mm.
nlohmann::ordered_json to_json(const Collisions& collisions);

/// Returns the same as text, without the clearances of the blocks and with those of the nearest
/// pairs only.
std::string to_text(const Collisions& collisions);

}  // namespace abbe::sim
