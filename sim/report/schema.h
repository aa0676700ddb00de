#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/scene/key.h"

namespace abbe::sim {

/// JSON Schema (draft 7) of a file whose top has these keys, for editors: completion, sentences and
/// a mark where something is wrong. It holds types, ranges, required keys, the keys that a word
/// brings, and units by the names of keys; what keys ask of each other beyond that `abbe check`
/// knows.
nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title);

}  // namespace abbe::sim
