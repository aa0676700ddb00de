#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim/cut/job.h"

/// Actual poses of the tool in the workpiece, tracks, and the chord error between samples.
namespace abbe::sim {

/// Returns the result of `action`. Throws an input error of the scene if the motion leaves an error
/// table.
template <typename Action>
auto check_table_range(const Segment& segment, const Action& action) {
  try {
    return action();
  } catch (const std::out_of_range& range_error) {
    throw BadInput(segment.scene.file.string(), 0, 0, "a program within the error tables",
                   range_error.what());
  }
}

/// A commanded program on the machine with errors. Holds references to its arguments.
struct ActualRun {
  const Segment& segment;
  const Commands& commands;
  const std::vector<kinematics::Pose>& T_wt_target;
  std::vector<kinematics::AxisVector> acceleration = {};  ///< (samples) empty without inertia
  std::vector<double> wear = {};  ///< (samples) fraction of the stated wear; empty without wear
};
/// Prepares the run of commands, with accelerations and wear.
ActualRun actual_run(const Segment& segment, const Commands& commands);

/// Returns the actual pose T_wt of the tool at a sample under a cutting load.
kinematics::Pose actual_pose(const ActualRun& run, std::size_t sample, errors::Load load);

/// Returns (samples) the loads; empty if there are none or they have no effect.
std::vector<errors::Load> sample_loads(const ActualRun& run, const Process& process);

/// Returns the actual poses at some samples.
/// @param loads           (samples), empty for none
/// @param sample_numbers  empty: all samples
std::vector<kinematics::Pose> actual_poses(const ActualRun& run,
                                           const std::vector<errors::Load>& loads,
                                           std::span<const std::size_t> sample_numbers);

/// Returns the actual poses T_wt of the tool at samples of the commanded program.
/// @param process         gives the forces; empty for none
/// @param sample_numbers  empty: all samples
/// @throws BadInput if the motion leaves a table of the errors
std::vector<kinematics::Pose> tool_poses(const Segment& segment, const Commands& commands,
                                         const Process& process,
                                         std::span<const std::size_t> sample_numbers = {});

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

/// A segment with its nominal and actual poses.
struct TrackedSegment {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples)
  const std::vector<kinematics::Pose>& T_wt;          ///< (samples)
};

/// Joins the tracks of the segments of a job, in order of time.
ToolTrack join_tracks(const std::vector<TrackedSegment>& segments);

/// Returns a track in the part frame.
/// @param T_wm  the part frame in the workpiece frame
ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm);

/// The deviation of the actual path between samples from the straight lines that the sweep uses.
/// Samples are as dense as the commanded path requires; the errors of the machine may require more.
struct ChordError {
  std::size_t interval_count = 0;   ///< number of sampled intervals in feed
  std::size_t exceeding_count = 0;  ///< number of those that deviate by more than the tolerance
  double tolerance = 0.0;           ///< mm: the chord tolerance, at least 2 nm
  double rms = 0.0;                 ///< mm
  double max = 0.0;                 ///< mm
  double step = 0.0;  ///< travel of the tip in the interval with the largest deviation, mm
  int line = 0;       ///< program line of that interval
};

/// Number of intervals of a program that are sampled.
inline constexpr std::size_t default_interval_count = 1000;

/// Returns the chord error of a program, from an interval of feed in each of at most
/// `max_intervals` groups with equal numbers of intervals. In the middle and at 0.38 of an interval
/// it compares the deviations of the tip, and of the tool at the height up to which it cuts, with
/// the line between those at the samples. Loads, and intervals over which an axis reverses, are
/// left out. An error that bends the path in a few intervals of very many may be missed.
ChordError chord_error(const Segment& segment, const Commands& commands,
                       std::size_t max_intervals = default_interval_count);

/// Joins the chord errors of two segments.
ChordError joined(const ChordError& a, const ChordError& b);

/// Returns the warning about a chord error beyond 50 nm, the tolerance, and a hundredth of the
/// deviation at the samples. It proposes a first value of the step.
/// @param tip_rms  RMS deviation of the tip, mm
std::vector<std::string> chord_error_warnings(const ChordError& chord_error, double tip_rms);

}  // namespace abbe::sim
