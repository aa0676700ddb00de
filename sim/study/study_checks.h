#pragma once

#include <vector>

#include "sim/scene/table_reader.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// What engine, responses, inputs and questions ask of each other, before an hour's work: faults
/// are added to those of the reader.
/// @param scenes  of the arms
/// @param places  of the inputs
void check_together(const Study& study, const std::vector<Scene>& scenes,
                    const std::vector<Place>& places, TableReader& reader);

/// Every path is set once, with its input at its centre, on every arm, so that a mistake is
/// reported now and not when its case comes.
void try_paths(const Study& study, const std::vector<Scene>& scenes,
               const std::vector<Place>& places, Faults& faults);

/// Days are cut when all cases are done; a mistake in them is reported before.
void try_days(const Study& study, TableReader& reader);

}  // namespace abbe::sim::study
