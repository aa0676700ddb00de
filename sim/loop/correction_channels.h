#pragma once

#include <span>

#include "sim/loop/control_view.h"
#include "sim/program/rewrite.h"

/// Channels by which a correction reaches the machine: a rewritten program, and channels that act
/// while the program runs.
namespace abbe::sim {

/// The program of one tool with its correction, before it is written.
struct CorrectedProgram {
  program::CorrectedPath points;  ///< one list for each block
  CorrectedCommands ideal;        ///< (samples) from which the points are selected
  Eigen::Vector3d measured_w;     ///< mm, shift of the datum that the control measures
  std::vector<std::string> warnings = {};
};

/// Returns a program with a correction, which is known at the samples. It keeps only as many of the
/// corrected samples as are needed for its path to pass the others within the scene's path
/// tolerance, both at the tip and along the tool axis up to the height at which the tool still
/// cuts. By default the tolerance equals the rounding of a program value (1 nm for a PVT program).
/// The rounding of the written values comes on top of it.
/// @param expected_w  mm, shift of the datum that the corrector expects the control to measure and
/// add
/// @param measured_w  mm, shift that the control measures
CorrectedProgram correct_program(const ControlView& view, const Corrector& corrector,
                                 const Eigen::Vector3d& expected_w,
                                 const Eigen::Vector3d& measured_w);

/// Returns the commands of a corrected program, rewritten as one program in the same dialect, as
/// the control reads and runs it.
/// @param parts    one for each tool, in the order of the program
/// @param path     program of all parts
/// @param control  state of the control before it reads the program
Commands run_corrected_program(std::span<const ControlView> parts,
                               std::span<const CorrectedProgram> corrected,
                               const program::Path& path, const program::NcOptions& control);

/// Returns the permitted distance between the rewritten program and the corrected samples, mm: that
/// of the scene, else the rounding of a value, or 1 nm for a PVT program.
double path_tolerance(const CompensationDescription& compensation, const program::Path& path);

/// Returns true if a program consists of positions, velocities and times.
bool is_pvt(const program::Path& path);

/// Returns the axis positions of the nominal machine at fraction u of a block, without the shift of
/// the datum.
kinematics::AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                                    const program::Block& block, double u);

/// Returns the commands with a correction that reaches the axes while the program runs. The channel
/// of the case transmits the ideal correction in its cycle, and the position loops follow it.
/// Additional samples represent the correction within a tenth of the chord tolerance.
/// @param commanded  (samples) uncorrected states of the program
/// @param ideal      (samples) corrected states
/// @throws BadInput naming the scene if the channel is not valid
Commands apply_real_time_channel(const ControlView& view, CaseDescription::Channel channel,
                                 const std::vector<kinematics::AxisState>& commanded,
                                 const std::vector<kinematics::AxisState>& ideal);

}  // namespace abbe::sim
