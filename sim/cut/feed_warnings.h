#pragma once

#include <string>
#include <vector>

#include "sim/machine/machine.h"
#include "sim/program/path.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Returns what no operator would let a program do: feed while the spindle stands or turns against
/// the teeth, at less than 5 mm/min or 0.5 um a turn, by more than half the cutter a turn, or at
/// more than five times the speed at which a vibration is stated. One sentence each, with the first
/// line. Programs of pvt tables, which bear no spindle, and blocks under G93 or with turning axes,
/// whose feed is not that of the tip, are left out.
std::vector<std::string> feed_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

}  // namespace abbe::sim
