#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim/cut/job.h"

namespace abbe::sim {

/// What a table of the errors that is left says, as a fault of the scene.
template <typename Act>
auto check_table_range(const Job& job, const Act& act) {
  try {
    return act();
  } catch (const std::out_of_range& left) {
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors",
                   left.what());
  }
}

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
std::vector<errors::Load> sample_loads(const ActualRun& run, const Process& process);

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

/// Where the tool of a case was at every sample of its program, in the workpiece frame.
struct ToolTrack {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd time_s;  ///< (n)
  std::vector<int> line;   ///< (n) of the program
  Rows q;                  ///< (n x axes) as they were commanded, mm and rad
  Rows nominal_tip;        ///< (n x 3) mm, where the tip should be
  Rows nominal_direction;  ///< (n x 3) of the tool axis, from the tip to the spindle
  Rows actual_tip;         ///< (n x 3) mm, where it was
  Rows actual_direction;   ///< (n x 3)
};

/// A part of a job as it went.
struct TrackedPart {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples)
  const std::vector<kinematics::Pose>& T_wt;          ///< (samples)
};

/// Parts of one machine, one after the other in time.
ToolTrack join_tracks(const std::vector<TrackedPart>& parts);

/// @param T_wm  the part frame in the workpiece frame
ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm);

/// How far the errors of a machine bend what the cut takes as straight: the tool moves from sample
/// to sample along lines, and samples are as dense as the commanded path asks for.
struct ChordError {
  std::size_t looked_at = 0;  ///< intervals of feeds
  std::size_t beyond = 0;     ///< of them, bent by more than the tolerance
  double tolerance = 0.0;     ///< mm: 2 nm, or that of the chord where it is more
  double rms = 0.0;           ///< mm
  double max = 0.0;           ///< mm
  double step = 0.0;          ///< mm of tip travel of the interval with the largest
  int line = 0;               ///< program line of it
};

/// Intervals of a whole program that are looked at.
inline constexpr std::size_t default_interval_count = 1000;

/// Looks midway between samples and at 0.38 of the way, at one interval of feed in each of at most
/// `most` stretches that hold as many intervals each: how far the errors of position and time
/// there, at the tip and as far above it as the tool cuts, are off the line between those at both
/// samples. Loads are left out, and intervals over which an axis reverses. What bends the path in a
/// few intervals of very many may be missed.
ChordError chord_error(const Job& job, const Commands& commands,
                       std::size_t most = default_interval_count);

/// Of both.
ChordError joined(const ChordError& a, const ChordError& b);

/// Bends beyond 50 nm, the tolerance and a hundredth of what the machine is off at the samples; the
/// step to begin with.
/// @param off  mm, RMS of the tip
std::vector<std::string> chord_error_warnings(const ChordError& found, double off);

}  // namespace abbe::sim
