#pragma once

#include "sim/loop/control_view.h"

/// Channels by which a correction reaches the machine: the rewritten program, and those that act
/// while it runs.
namespace abbe::sim {

/// Returns the commands of a program with the correction written into it, in the same dialect, as
/// the control reads and runs it. The corrected path is known at the samples of the program; the
/// rewritten program keeps as many points as its blocks need to pass all others, tip and tool axis
/// up to the shaping height, within the path tolerance of the scene (if none is stated: one step of
/// a number, 1 nm for a PVT program). Numbers are rounded in addition.
/// @param expected_w  mm, shift of the datum that the corrector expects the control to measure and
///     add
/// @param found_w     mm, shift that the control measures
Commands apply_program_channel(const ControlView& view, const Corrector& corrector,
                               const Eigen::Vector3d& expected_w, const Eigen::Vector3d& found_w);

/// Returns the path tolerance, mm.
double path_tolerance(const CompensationDescription& compensation, const program::Path& path);

/// Returns true if a program consists of positions, velocities and times.
bool is_pvt(const program::Path& path);

/// Returns the axes of the nominal machine at fraction u of a block, without a shift of the datum.
kinematics::AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                                    const program::Block& block, double u);

/// Returns the commands with a correction that reaches the axes while the program runs: the ideal
/// correction as the channel of the case transmits it in its own cycle, then as the position loops
/// follow. Samples are added where the correction bends between those of the program, so that it is
/// followed within a tenth of the chord tolerance.
/// @param commanded  (samples) of the program, uncorrected
/// @param ideal      (samples) corrected
/// @throws BadInput naming the scene if the channel is not valid
Commands apply_real_time_channel(const ControlView& view, CaseDescription::Channel channel,
                                 const std::vector<kinematics::AxisState>& commanded,
                                 const std::vector<kinematics::AxisState>& ideal);

}  // namespace abbe::sim
