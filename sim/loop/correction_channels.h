#pragma once

#include "sim/loop/control_view.h"

namespace abbe::sim {

/// The correction written into a program of the same dialect, which the control then reads and
/// runs. The corrected path is known at the samples of the program; of them the program keeps so
/// many points that its blocks pass all others, tip and tool axis up to the shaping height, within
/// the scene's path tolerance (none stated: a word's step, of a PVT program 1 nm), its words
/// rounded besides.
/// @param expected_w  mm, shift of the datum that the corrector expects the control to find and add
/// @param found_w     mm, the shift that it finds
Commands apply_program_channel(const ControlView& view, const Corrector& corrector,
                               const Eigen::Vector3d& expected_w, const Eigen::Vector3d& found_w);

/// That tolerance. @return mm
double path_tolerance(const CompensationDescription& compensation, const program::Path& path);

/// Whether a program is one of positions, velocities and times.
bool is_pvt(const program::Path& path);

/// Axes of the nominal machine at fraction u of a block, without any shift of the datum.
kinematics::AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                                    const program::Block& block, double u);

/// A correction that reaches the axes while the program runs: the ideal one as the channel of the
/// case lets it through at its own cycle, then as the position loops follow. Samples are added
/// where it bends between those of the program, so that it is met within a tenth of the chord
/// tolerance.
/// @param commanded  (samples) of the program, uncorrected
/// @param ideal      (samples) corrected
/// @throws BadInput naming the scene for a channel that cannot be
Commands apply_real_time_channel(const ControlView& view, CaseDescription::Channel channel,
                                 const std::vector<kinematics::AxisState>& commanded,
                                 const std::vector<kinematics::AxisState>& ideal);

}  // namespace abbe::sim
