#pragma once

#include <vector>

#include "sim/study/farm.h"
#include "sim/study/influence.h"
#include "sim/study/plan.h"

namespace abbe::sim::study {

/// A study made ready to compute its cases. Immutable once made.
struct ReadyStudy {
  Study study;
  Plan plan;
  std::vector<ReadyArm> arms;
  std::vector<InfluenceMap> influences;  ///< (arms) empty with the full engine
};

/// Prepares every arm and, unless every case is cut, its influence map.
/// @throws BadScene, BadInput
ReadyStudy ready_study(const Study& study, const Progress& progress = {});

/// Computes batches of a study, each the same rows whoever computes it. A machine that cannot cut
/// the program has a row that says why. Safe from many threads; `ready` outlives it.
Compute compute_of(const ReadyStudy& ready);

/// Column of a response in the answers of a row: arm by arm, response by response.
std::size_t column_of(const Study& study, std::size_t arm, std::size_t response);

}  // namespace abbe::sim::study
