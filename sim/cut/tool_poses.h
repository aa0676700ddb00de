#pragma once

#include <span>
#include <vector>

#include "sim/cut/job.h"

namespace abbe::sim {

/// A program as the axes are commanded, on the wrong machine. It refers to what it is made of.
struct ActualRun {
  const Job& job;
  const Commands& commands;
  const std::vector<kinematics::Pose>& T_wt_wanted;
  std::vector<kinematics::AxisVector> acceleration = {};  ///< (samples) empty without inertia
  std::vector<double> wear = {};                          ///< (samples) shares of it; empty without
};
ActualRun actual_run(const Job& job, const Commands& commands);

/// Where the tool is at a sample, T_wt, when the cut loads it so.
kinematics::Pose actual_pose(const ActualRun& run, std::size_t sample, errors::Load load);

/// What acts at every sample. @return (samples), empty where nothing does
std::vector<errors::Load> loads_of(const ActualRun& run, const Process& process);

/// @param loads  (samples), empty for none
/// @param at     numbers of samples; empty: all
std::vector<kinematics::Pose> poses_of(const ActualRun& run, const std::vector<errors::Load>& loads,
                                       std::span<const std::size_t> at);

/// Where the tool really is in the part at samples of a program as it is commanded, T_wt.
/// @param process  that cut, for its forces; empty for none
/// @param at       numbers of samples; empty: all of them
/// @throws BadInput where a table of the errors is left
std::vector<kinematics::Pose> tool_poses(const Job& job, const Commands& commands,
                                         const Process& process,
                                         std::span<const std::size_t> at = {});

}  // namespace abbe::sim
