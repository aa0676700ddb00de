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

/// Paths of keys that begin with a prefix, as `--set` takes them: "part.radius_mm", of every table
/// of a list "instrument.kind", of one where the prefix has its index or name, "instrument.0.kind".
/// Keys of a study begin with "study." and are listed for a prefix that does.
std::vector<std::string> keys_to_set(const std::string& prefix);

}  // namespace abbe::sim
