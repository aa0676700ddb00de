#pragma once

#include "sim/compensation/machine_belief.h"
#include "sim/loop/seen.h"

/// The makers of corrections: a belief with a strategy, somebody's plug-in, a control's tables.
namespace abbe::sim {

/// Strategy of a case with a belief.
Corrector belief_corrector(const Seen& seen, const CaseDescription& compensator,
                           compensation::Belief belief);

/// A plug-in that the user trusts; where it answers with deviations, the strategy of the case.
/// @throws compensation::PlugInFailure from the corrector
Corrector plug_in_corrector(const Seen& seen, const CaseDescription& compensator,
                            compensation::ControlLog log);

/// Tables made of what a corrector does, as the format of the scene's control can hold them and
/// reads them back.
struct TableCorrector {
  Corrector corrector;
  std::vector<std::string> left_out;  ///< what the format cannot hold, in words
};
/// @param believed  for a volumetric format, which holds deviations and not corrections
/// @throws BadInput naming the scene where tables cannot be made
TableCorrector table_corrector(const Seen& seen, const Corrector& corrector,
                               const std::optional<errors::GeometricModel>& believed);

/// How tables of the scene are laid: over the travel, but of an axis that turns more than once, or
/// has no end, over what the program uses, since no table of so few points holds a hundred turns.
compensation::TableOptions table_options(const Seen& seen);

/// The tables that a corrector amounts to.
/// @throws BadInput naming the scene where they cannot be made
compensation::ParameterTables tables_of(const Seen& seen, const Corrector& corrector);

}  // namespace abbe::sim
