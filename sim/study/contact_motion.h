#pragma once

#include <array>

#include "sim/study/base_run.h"

/// How the tool's displacement becomes that of the place where a rival pass makes the surface.
namespace abbe::sim::study {

/// Small displacement of the tool in the workpiece frame, [translation of the tip | rotation
/// vector], mm and rad.
using Twist = kinematics::Deviation;

/// Displacement of the contact (mm, workpiece frame) by the tool's at the ends of the rival's move.
/// Where the workpiece turns, what is interpolated is the displacement as the spindle sees it.
Eigen::Vector3d displacement(const BaseRun& run, const cutting::Rival& rival,
                             const std::array<Twist, 2>& at_ends);

/// A machine at the ends of a rival's move.
struct Tool {
  std::array<kinematics::Pose, 2> T_wt;
  std::optional<SpindleLine> spindle;  ///< of this machine: another clamping puts it elsewhere
};

/// The tool in the workpiece at the instant of a rival, T_wt.
kinematics::Pose tool_at(const BaseRun& run, const cutting::Rival& rival, const Tool& tool);

/// Displacement of the contact from one machine's tool to another's (mm, workpiece frame), each
/// interpolated as the surface is made of it.
Eigen::Vector3d displacement(const BaseRun& run, const cutting::Rival& rival, const Tool& from,
                             const Tool& to);

}  // namespace abbe::sim::study
