#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/collision_events.h"

namespace abbe::sim {

/// Events with line, time, pair, depth and place, clearances of pairs and of blocks; lengths in mm.
nlohmann::ordered_json to_json(const Collisions& collisions);

/// The same as text for people, without the clearances of the blocks and with those of the nearest
/// pairs alone.
std::string to_text(const Collisions& collisions);

}  // namespace abbe::sim
