#pragma once

#include <string>
#include <vector>

#include "kinematics/units.h"
#include "sim/machine/machine.h"
#include "sim/program/path_meter.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// rad, of the axis that is free at a pole: less than that is nothing to be said.
inline constexpr double pole_turn_said = 10.0 * units::deg;

/// What is to be said of a program that passes a pole of the machine: how close, where, and how far
/// and how fast the axis that is free there turns. Empty where it turns by less than
/// `pole_turn_said`.
/// @param within  rad, what was near  @param more_files  as Path has them
std::string pole_text(const program::NearPole& pole, const kinematics::Chain& chain, double within,
                      const std::vector<std::string>& more_files);

/// The same of a scene whose program is a file. @param machine  compiled from it
std::vector<std::string> pole_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

}  // namespace abbe::sim
