#pragma once

#include "sim/machine/machine.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// A machine compiled from its description, with its tool mounted.
/// @throws BadInput naming the scene if the description makes no chain
Machine compile(const Scene& scene);

/// The same as built: tool and clamping as they really are, before any error.
/// @throws as `compile`
kinematics::Chain compile_as_built(const Scene& scene);

}  // namespace abbe::sim
