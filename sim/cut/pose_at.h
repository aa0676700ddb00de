#pragma once

#include <string>
#include <vector>

#include "sim/cut/pose_table.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Where the tool is and should be at one pose.
struct PoseAt {
  TipPose pose;
  std::vector<PoseTable::Six> wished;  ///< what is computed beside it
  std::vector<std::string> heads;      ///< (6 x wished) as in a table of poses
  std::vector<double> numbers;         ///< (heads)
  std::vector<std::string> warnings;
};

enum class Within { Travel, Anything };

/// Numbers for axes as words have them, "X=100 A=30" (mm, degrees); zero for axes not named.
/// @param option  that refusals name
/// @throws BadInput for an axis that the machine lacks, a number that is none, an axis twice, and
///         one beyond the travel where that is asked for
kinematics::AxisVector positions_in(const std::string& words, const kinematics::Chain& chain,
                                    const std::string& option, Within within);

/// The pose with the axes at "X=100 A=30" (mm, degrees; axes not named stand at zero, moving
/// nowhere).
/// @throws BadInput for an axis that the machine lacks, a number that is none or beyond the travel,
///         an axis twice, an element that the machine lacks
PoseAt pose_at(const Scene& scene, const std::string& at, const PoseWishes& wishes = {});

}  // namespace abbe::sim
