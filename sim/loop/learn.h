#pragma once

#include "sim/files/progress.h"
#include "sim/loop/control_view.h"
#include "sim/loop/correction_channels.h"
#include "sim/loop/correctors.h"

/// Learning of a correction in passes, and its application through a channel.
namespace abbe::sim {

/// Correction of a case, after all passes in which it learns.
struct LearnedCorrection {
  Corrector corrector;
  /// Corrector that acts while the datum is measured; empty: `corrector`. The deviation of a
  /// measured part is relative to the datum from which it was cut, so it must not shift the datum.
  Corrector at_datum;
  std::optional<errors::GeometricModel> geometric;  ///< geometric belief alone
  std::vector<std::string> warnings;
  /// Tables of the machine, which act whichever tool runs. Without them the channel `table` makes
  /// them for the tool that runs.
  std::optional<ControlTables> tables = {};
};

/// Learns the correction of a case from runs and measured parts.
/// @throws BadInput if the scene lacks a section that the case needs
/// @throws compensation::PlugInFailure if a plug-in fails
LearnedCorrection learn_correction(const ControlView& view, const MachineAccess& machine_access,
                                   const CaseDescription& compensator,
                                   const Progress& progress = {});

/// Learns the correction of a case and returns its commands through its channel.
/// @throws BadInput, compensation::PlugInFailure  as `learn_correction`
Commands compensated_commands(const ControlView& view, const MachineAccess& machine_access,
                              const CaseDescription& compensator, const Progress& progress = {});

/// Learns the correction of a case with the channel `program`, and returns the corrected program of
/// one tool before it is written.
/// @throws BadInput, compensation::PlugInFailure  as `learn_correction`
CorrectedProgram corrected_program(const ControlView& view, const MachineAccess& machine_access,
                                   const CaseDescription& compensator,
                                   const Progress& progress = {});
/// Returns the same with a given correction, for a program in ranges.
/// @param view  of the tool
/// @throws BadInput if the correction does not cover the program
CorrectedProgram corrected_program(const RangeVisitor& visit_ranges, const ControlView& view,
                                   const MachineAccess& machine_access,
                                   const CaseDescription& compensator,
                                   const LearnedCorrection& correction);

/// Returns the commands of a case with a given correction.
/// @throws BadInput if the correction does not cover the program
Commands compensated_commands(const ControlView& view, const MachineAccess& machine_access,
                              const CaseDescription& compensator,
                              const LearnedCorrection& correction);

}  // namespace abbe::sim
