#pragma once

#include "sim/cut/cut.h"

namespace abbe::sim {

/// The correction written into a program of the same dialect, which the control then reads and
/// runs. The corrected path is known at the job's samples; of them the program keeps so many points
/// that its blocks pass all others, tip and tool axis up to the shaping height, within the scene's
/// path tolerance (none told: a word's step, of a PVT program 1 nm), its words rounded besides.
/// @param offset_w  mm, shift of the datum that the corrector expects the control to find and add
Compensated through_program(const Job& job, const Corrector& corrector,
                            const Eigen::Vector3d& offset_w);

/// That tolerance. @return mm
double path_tolerance(const Job& job);

/// Whether a program is one of positions, velocities and times.
bool is_pvt(const program::Path& path);

/// Axes of the nominal machine at fraction u of a block, without any shift of the datum.
kinematics::AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                                    const program::Block& block, double u);

}  // namespace abbe::sim
