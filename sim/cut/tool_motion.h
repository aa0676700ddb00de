#pragma once

#include <vector>

#include "cutting/surface/surface.h"
#include "kinematics/chain.h"
#include "sim/machine/machine.h"
#include "sim/program/sample.h"

/// Motions of tools, derived from the samples of a program.
namespace abbe::sim {

/// The axis about which a spindle turns the workpiece, in the workpiece frame.
struct SpindleLine {
  Eigen::Vector3d point_w;
  Eigen::Vector3d direction_w;
  /// Returns the vector from the axis to a point, at right angles to the axis, mm.
  Eigen::Vector3d radial(const Eigen::Vector3d& p_w) const;
};
/// Returns the axis of the joint that turns the workpiece.
SpindleLine spindle_line(const kinematics::Chain& chain, int joint);

/// Returns the pose of the tool turned back by the spindle angle. It changes slowly and can be
/// interpolated.
kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt);

/// Returns the motion of a milling cutter for its sweep.
/// @param T_wt  (samples)
cutting::CutterMotion cutter_motion(const std::vector<kinematics::Pose>& T_wt,
                                    const program::Samples& samples);

/// Returns true if a sample ends or lies in a block in feed.
/// @param path  with the blocks of the samples
bool is_feed_sample(const program::Path& path, const program::Samples& samples, std::size_t sample);

/// Returns the number of the first sample at or after an instant; that of the last if there is
/// none.
std::size_t sample_at(const program::Samples& samples, double time_s);

/// Returns the numbers of the samples with distinct times, ascending. Of the two samples of a
/// reversal, which have the same time, it is the first.
std::vector<std::size_t> distinct_instants(const program::Samples& samples);

/// Returns the motion of a turning tool at its distinct instants. It consists of slow poses, so
/// that the rotation of the workpiece is exact.
/// @param spindle  joint that turns the workpiece
cutting::NoseMotion nose_motion(const std::vector<kinematics::Pose>& T_wt,
                                const program::Samples& samples, const SpindleLine& line,
                                int spindle);

/// Returns (samples) the accelerations of the axes, mm/s^2 and rad/s^2: the difference of the mean
/// speeds over the 20 ms after and before a sample, divided by 20 ms. Means are needed since speeds
/// jump where blocks meet.
std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples);

/// Throws BadInput with the first program line on which an axis leaves its travel; spindles have
/// none.
void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples);

}  // namespace abbe::sim
