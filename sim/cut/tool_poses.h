#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim/cut/job.h"

/// Actual poses of the tool in the workpiece, tracks, and the chord error between samples.
namespace abbe::sim {

/// Calls `act`, and turns the exception of an error table left by the motion into an input error of
/// the scene.
template <typename Act>
auto check_table_range(const Job& job, const Act& act) {
  try {
    return act();
  } catch (const std::out_of_range& left) {
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors",
                   left.what());
  }
}

/// A commanded program on the machine with errors. Holds references to its arguments.
struct ActualRun {
  const Job& job;
  const Commands& commands;
  const std::vector<kinematics::Pose>& T_wt_target;
  std::vector<kinematics::AxisVector> acceleration = {};  ///< (samples) empty without inertia
  std::vector<double> wear = {};  ///< (samples) fraction of the stated wear; empty without wear
};
/// Prepares the run of commands, with accelerations and wear.
ActualRun actual_run(const Job& job, const Commands& commands);

/// Returns the actual pose T_wt of the tool at a sample under a cutting load.
kinematics::Pose actual_pose(const ActualRun& run, std::size_t sample, errors::Load load);

/// Returns the loads at every sample.
/// @return (samples), empty if nothing acts
std::vector<errors::Load> sample_loads(const ActualRun& run, const Process& process);

/// Returns the actual poses at some samples.
/// @param loads  (samples), empty for none
/// @param at     numbers of samples; empty: all
std::vector<kinematics::Pose> actual_poses(const ActualRun& run,
                                           const std::vector<errors::Load>& loads,
                                           std::span<const std::size_t> at);

/// Returns the actual poses T_wt of the tool at samples of the commanded program.
/// @param process  gives the forces; empty for none
/// @param at       numbers of samples; empty: all
/// @throws BadInput if the motion leaves a table of the errors
std::vector<kinematics::Pose> tool_poses(const Job& job, const Commands& commands,
                                         const Process& process,
                                         std::span<const std::size_t> at = {});

/// Nominal and actual tip and axis of a tool at every sample of a program, in the workpiece frame.
struct ToolTrack {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd time_s;  ///< (n)
  std::vector<int> line;   ///< (n) program line
  Rows q;                  ///< (n x axes) commanded, mm and rad
  Rows nominal_tip;        ///< (n x 3) mm
  Rows nominal_direction;  ///< (n x 3) unit, tool axis from the tip to the spindle
  Rows actual_tip;         ///< (n x 3) mm
  Rows actual_direction;   ///< (n x 3)
};

/// A part of a job with its nominal and actual poses.
struct TrackedPart {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples)
  const std::vector<kinematics::Pose>& T_wt;          ///< (samples)
};

/// Joins the tracks of the parts of one machine, in the order of time.
ToolTrack join_tracks(const std::vector<TrackedPart>& parts);

/// Returns a track in the part frame.
/// @param T_wm  the part frame in the workpiece frame
ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm);

/// Deviation of the actual path between samples from the straight lines that the sweep uses.
/// Samples are as dense as the commanded path needs; the errors of the machine may need more.
struct ChordError {
  std::size_t looked_at = 0;  ///< number of intervals in feed
  std::size_t beyond = 0;     ///< number of those that deviate by more than the tolerance
  double tolerance = 0.0;     ///< mm: 2 nm, or the chord tolerance if that is more
  double rms = 0.0;           ///< mm
  double max = 0.0;           ///< mm
  double step = 0.0;          ///< mm of tip travel in the interval with the largest deviation
  int line = 0;               ///< program line of that interval
};

/// Number of intervals of a program that are sampled.
inline constexpr std::size_t default_interval_count = 1000;

/// Returns the chord error of a program, from one interval of feed in each of at most `most` groups
/// with equal numbers of intervals. It compares the errors of position and time halfway and at 0.38
/// of an interval, at the tip and at the height up to which the tool cuts, with the line between
/// the samples. Loads, and intervals over which an axis reverses, are left out. An error that bends
/// the path in a few intervals of very many may be missed.
ChordError chord_error(const Job& job, const Commands& commands,
                       std::size_t most = default_interval_count);

/// Joins the chord errors of two parts.
ChordError joined(const ChordError& a, const ChordError& b);

/// Returns the warning for deviations beyond 50 nm, the tolerance, and a hundredth of the deviation
/// at the samples; it proposes a step to start with.
/// @param off  mm, RMS deviation of the tip
std::vector<std::string> chord_error_warnings(const ChordError& found, double off);

}  // namespace abbe::sim
