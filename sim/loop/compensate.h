#pragma once

#include <vector>

#include "sim/cut/cut.h"

namespace abbe::sim {

/// What corrects the program of a case, after all passes from which it learns.
struct Learnt {
  Corrector corrector;
  Corrector at_datum;  ///< acts while the datum is found; none: `corrector`. What a part showed
                       ///< counts from the datum from which it was cut, and moves no datum
  std::optional<errors::GeometricModel> geometric;  ///< what is believed of the geometry alone
  std::vector<std::string> warnings;
};
/// @throws as `compensate`
Learnt learnt(const Job& job, const CaseDescription& compensator, const Progress& progress = {});

/// A compensator of the scene acting on the commands.
/// @throws BadInput where the scene does not give what the case wants,
///         compensation::PlugInFailure
Compensated compensate(const Job& job, const CaseDescription& compensator,
                       const Progress& progress = {});

/// The program on the wrong machine, with a compensator if there is one.
/// @throws as `compensate`, and as `cut` of commands
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress = {});

}  // namespace abbe::sim
