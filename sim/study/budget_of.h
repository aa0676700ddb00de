#pragma once

#include "sim/study/budget.h"
#include "sim/study/engine.h"

namespace abbe::sim::study {

/// What the finished cases of a study say so far; of an analysis that has begun only what its cases
/// can say.
/// @param rows  ascending
Budget budget_of(const Study& study, const Plan& plan, const std::vector<Row>& rows);

/// The same, and what the influence maps say: contributions to the map, worst corners, tolerances.
Budget budget_of(const ReadyStudy& ready, const std::vector<Row>& rows,
                 const Progress& progress = {});

}  // namespace abbe::sim::study
