#pragma once

#include <functional>
#include <variant>
#include <vector>

#include "cutting/mesh.h"
#include "sim/cut/force_loop.h"
#include "sim/machine/machine.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// What is followed: a program as it runs on some machine.
struct FollowedProgram {
  const program::Samples& samples;
  const program::Path& path;                  ///< from which the samples come
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples) where the tool should be: the feed
  PoseUnderLoad pose;                         ///< where it is
  const kinematics::Chain& chain;             ///< whose spindle line a turned part has
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
};

/// Follows the cut: engagement gives the force, the force moves the tool, the moved tool has
/// another engagement, until force and deflection agree. The first guess is the load of the step
/// before. Milling looks after every `step` of travel of the tip and of the flank's turning,
/// wherever the motion turns by more than 0.1 rad, and where rapid and feed meet; it takes the mean
/// force of a revolution, the feed as that of the corner's centre (of a flat end mill: of half its
/// flank). Turning looks once a revolution.
/// A rapid, or the shank, that takes material is a crash. Empty for a scene without [cutting].
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws BadInput naming the scene or the program line: a blank that cannot be, too many dexels,
///         a cut with a spindle that stands still or turns the other way, a feed per tooth beyond
///         the cutter's radius
Process follow(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
               const FollowedProgram& program, const std::function<void(double)>& progress = {});

}  // namespace abbe::sim
