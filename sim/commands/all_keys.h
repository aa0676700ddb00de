#pragma once

#include <string>
#include <vector>

#include "sim/scene/key.h"

namespace abbe::sim {

/// Every key of a scene, and the keys of a study below `study`.
std::vector<Key> all_keys();

/// Keys of the table at a dotted path: "machine", "study.input".
/// @throws BadUsage if there is none
std::vector<Key> keys_of(const std::string& section);

}  // namespace abbe::sim
