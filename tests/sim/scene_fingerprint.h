#pragma once

#include "sim/scene/scene_fields.h"
#include "tests/test.h"

namespace abbe::sim {

/// All that a scene says but where it came from: two scenes are equal if their texts are.
inline std::string fingerprint(const Scene& scene) { return to_toml(to_table(scene)); }

}  // namespace abbe::sim
