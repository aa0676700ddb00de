#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/scene/bad_scene.h"
#include "sim/scene/case_name.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Reads a scene strictly: unknown keys are refused with the nearest known one, types and units are
/// checked, and all faults are found before any is reported.
/// @param overrides  applied to the text before it is checked; a path that names nothing known is
/// refused
/// @throws BadScene with every fault
Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

}  // namespace abbe::sim
