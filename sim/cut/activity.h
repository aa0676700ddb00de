#pragma once

#include <vector>

#include "errors/thermal.h"
#include "sim/cut/process.h"
#include "sim/machine/machine.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// What a machine with heat does from the beginning of its history to the end of its program: the
/// phases of the history as they are described, then the program in stretches of the scene's
/// interval with the mean speeds and the mean cutting power of each, at last the machine at rest.
/// Two knots a stretch, since speeds jump. Empty for a scene without heat.
/// @param process  of the nominal machine, for the cutting power; empty where nothing is cut
std::vector<errors::Activity> activity(const Scene& scene, const Machine& machine,
                                       const program::Samples& samples, const Process& process);

}  // namespace abbe::sim
