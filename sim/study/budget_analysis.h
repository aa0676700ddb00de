#pragma once

#include <string>
#include <vector>

#include "sim/files/progress.h"
#include "sim/study/budget.h"
#include "sim/study/case_plan.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Returns what a standard deviation of each unidentified number does to the map of an arm, as the
/// scene aligns it, the numbers that hide it moved along; empty where influence maps cannot follow
/// the arm.
std::vector<UnidentifiedEffect> unidentified_effects(const Study& study,
                                                     const PreparedConfiguration& ready,
                                                     const Progress& progress = {});

/// "Every figure of uncompensated leaves out ...: the map feels EY0A by 1.4 um RMS per 20 um, ..."
/// of the numbers that have no prior and change the map by 1 nm or more together; else empty.
std::string unidentified_warning(const Study& study, const ConfigurationBudget& arm);

/// What the finished cases of a study say so far; of an analysis that has begun only what its cases
/// can say.
/// @param rows  ascending
Budget compute_budget(const Study& study, const Plan& plan, const std::vector<Row>& rows);

/// The same, and what the influence maps say: contributions to the map, worst corners, tolerances.
Budget compute_budget(const PreparedStudy& ready, const std::vector<Row>& rows,
                      const Progress& progress = {});

}  // namespace abbe::sim::study
