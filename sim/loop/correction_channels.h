#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sim/loop/control_view.h"
#include "sim/program/rewrite.h"

/// Channels by which a correction reaches the machine: a rewritten program, and channels that act
/// while the program runs.
namespace abbe::sim {

/// The program of one tool with its correction, before it is written.
struct CorrectedProgram {
  program::CorrectedPath points;  ///< one list for each block
  CorrectedCommands ideal;        ///< (samples) from which the points are selected; of a program in
                                  ///< several ranges without the states
  Eigen::Vector3d measured_w;     ///< mm, shift of the datum that the control measures
  std::vector<std::string> warnings = {};
};

/// Calls `use` for the ranges of a program in order. A range that continues another
/// (`sampling.continued_from`) begins with the last block of that one.
using RangeVisitor = std::function<void(const std::function<void(const ControlView& range)>& use)>;

/// Returns a program with a correction, which is known at the samples. It keeps only as many of the
/// corrected samples as are needed for its path to pass the others within the scene's path
/// tolerance, both at the tip and along the tool axis up to the height at which the tool still
/// cuts. By default the tolerance equals the rounding of a program value (1 nm for a PVT program).
/// The rounding of the written values comes on top of it. The result does not depend on the
/// division into ranges, unless the program consists of cubics, which needs a single range.
/// @param visit_ranges  called twice
/// @param expected_w  mm, shift of the datum that the corrector expects the control to measure and
/// add
/// @param measured_w  mm, shift that the control measures
CorrectedProgram correct_program(const RangeVisitor& visit_ranges, const Corrector& corrector,
                                 const Eigen::Vector3d& expected_w,
                                 const Eigen::Vector3d& measured_w);

/// A corrected program as the control reads it.
struct RewrittenPath {
  program::Path path;
  std::vector<program::LineOrigin> line_origins;  ///< (lines)
  std::string text;
};

/// Writes the corrected programs of all tools as one program in the same dialect.
/// @param corrected  one for each tool, in the order of the program
/// @param path       program of all tools
/// @param control    state of the control before it reads the program
RewrittenPath rewrite(std::span<const CorrectedProgram> corrected,
                      const CompensationDescription& compensation, const program::Path& path,
                      const program::NcOptions& control);

/// Returns the number of the first block of a rewritten program, `from` or a later one, that comes
/// from an original block or from one after it; the number of blocks if there is none.
/// @param original_block  its number in the program of all tools
std::size_t find_rewritten_block(const RewrittenPath& rewritten, std::size_t original_block,
                                 std::size_t from);

/// Returns the sampling of the rewritten program of a tool, from its beginning, with a limit of 20
/// times the samples of the original.
/// @param original_samples  of the program, or of its longest window
program::SampleOptions rewritten_sampling(const ControlView& view, std::size_t original_samples);

/// Returns the commands of a range of the rewritten program of a tool.
/// @param view         with the original program of the tool
/// @param path         of the range
/// @param sampling     of the tool, continued if the range continues another
/// @param first_block  number of the first block of that original program in the whole program
Commands rewritten_commands(const ControlView& view, program::Path path,
                            const program::SampleOptions& sampling,
                            const CorrectedProgram& corrected,
                            const std::vector<program::LineOrigin>& line_origins,
                            std::size_t first_block);

/// Returns the commands of a corrected program, rewritten as one program in the same dialect, as
/// the control reads and runs it. The arguments are those of `rewrite`.
Commands run_corrected_program(std::span<const ControlView> tools,
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
