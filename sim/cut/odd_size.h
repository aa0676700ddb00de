#pragma once

#include <string>

#include "cutting/mesh.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// What part.unit calls a unit of so many mm; empty if it has no name.
std::string unit_word(double unit_mm);

/// What is to be said of the extents of a mesh: below 1 mm, beyond the travel of the slides. Empty
/// of others, and of a mesh of part.any_size.
std::string odd_size(const Scene& scene, const cutting::Design& design_w);

}  // namespace abbe::sim
