#pragma once

#include <cstddef>
#include <vector>

#include "cutting/engagement.h"
#include "sim/cut/tool_motion.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// How a program is followed through a blank that turns: the blank, and the places at which it is
/// looked at.
namespace abbe::sim {

/// The turned blank of a scene with [cutting] about a spindle line.
/// @throws std::invalid_argument for another blank or one that cannot be, std::length_error for one
///         of too many nodes
cutting::TurnedStock turned_blank(const Scene& scene, const SpindleLine& line);

/// Samples between which material is taken away: once a revolution, where rapid and feed meet, and
/// after every 0.1 mm of travel of a rapid or with the spindle at rest. The first is 0.
/// @param T_wt     (samples)
/// @param spindle  joint that turns the workpiece, about the line
std::vector<std::size_t> turning_looks(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, int spindle,
                                       const SpindleLine& line);

}  // namespace abbe::sim
