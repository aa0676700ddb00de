#pragma once

#include "sim/files/progress.h"
#include "sim/loop/control_view.h"

namespace abbe::sim {

/// What corrects the program of a case, after all passes from which it learns.
struct LearnedCorrection {
  Corrector corrector;
  Corrector at_datum;  ///< acts while the datum is found; none: `corrector`. What a part showed
                       ///< counts from the datum from which it was cut, and moves no datum
  std::optional<errors::GeometricModel> geometric;  ///< what is believed of the geometry alone
  std::vector<std::string> warnings;
};

/// Learns what the case says by runs and parts in the workshop.
/// @throws BadInput where the scene does not give what the case wants,
///         compensation::PlugInFailure
LearnedCorrection learned_correction(const ControlView& view, const MachineAccess& machine_access,
                                     const CaseDescription& compensator,
                                     const Progress& progress = {});

/// The commands of a case: what it learnt, brought to the machine through its channel.
/// @throws as `learned_correction`
Commands compensated(const ControlView& view, const MachineAccess& machine_access,
                     const CaseDescription& compensator, const Progress& progress = {});

/// The same of a case that has learnt.
/// @throws BadInput where what it learnt does not reach
Commands compensated(const ControlView& view, const MachineAccess& machine_access,
                     const CaseDescription& compensator,
                     const LearnedCorrection& learned_correction);

}  // namespace abbe::sim
