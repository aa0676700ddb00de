#pragma once

#include <vector>

#include "cutting/surface/surface.h"
#include "kinematics/chain.h"
#include "sim/machine/machine.h"
#include "sim/program/sample.h"

namespace abbe::sim {

/// Line about which the workpiece turns, seen from the workpiece of a chain.
struct SpindleLine {
  Eigen::Vector3d point_w;
  Eigen::Vector3d direction_w;
};
SpindleLine spindle_line(const kinematics::Chain& chain, int joint);

/// The tool turned back by the spindle, so that only slow motion is left to interpolate.
kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt);

/// Poses of a program as the sweep of a milling cutter. @param T_wt  (samples)
cutting::CutterMotion cutter_motion(const std::vector<kinematics::Pose>& T_wt,
                                    const program::Samples& samples);

/// Number of the first sample at or after an instant; the last where there is none.
std::size_t sample_at(const program::Samples& samples, double time_s);

/// Samples at instants of their own: a reversal is sampled twice, and a turning tool takes the
/// first. (motion) numbers of samples, ascending
std::vector<std::size_t> distinct_instants(const program::Samples& samples);

/// The same of a turning tool, at its distinct instants; with slow poses the turning itself is
/// exact.
/// @param spindle  joint that turns the workpiece
cutting::NoseMotion nose_motion(const std::vector<kinematics::Pose>& T_wt,
                                const program::Samples& samples, const SpindleLine& line,
                                int spindle);

/// Accelerations of the axes at every sample, mm/s^2 and rad/s^2: the mean speed over the 20 ms
/// after less that over the 20 ms before, per 20 ms, since blocks meet at corners.
/// @return (samples)
std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples);

/// Refuses the line of the program on which an axis first leaves its travel; spindles have none.
/// @throws BadInput
void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples);

}  // namespace abbe::sim
