#pragma once

#include <string>
#include <vector>

#include "sim/files/progress.h"
#include "sim/study/budget.h"
#include "sim/study/case_plan.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Returns the effect of one standard deviation of each unidentified coefficient on the map of a
/// configuration, aligned as the scene says; the coefficients that hide it change along with it.
/// Empty if influence maps cannot represent the configuration.
std::vector<UnidentifiedEffect> unidentified_effects(const Study& study,
                                                     const PreparedConfiguration& ready,
                                                     const Progress& progress = {});

/// Returns a warning "Every figure of uncompensated leaves out ...: the map feels EY0A by 1.4 um
/// RMS per 20 um, ..." about the coefficients that have no prior and together change the map by 1
/// nm or more; empty if there are none.
std::string unidentified_warning(const Study& study, const ConfigurationBudget& arm);

/// Computes the budget from the finished cases of a study; an incomplete analysis contributes what
/// its finished cases allow.
/// @param rows  ascending
Budget compute_budget(const Study& study, const Plan& plan, const std::vector<Row>& rows);

/// Computes the same budget with the results of the influence maps: contributions to the map, worst
/// corners, tolerances.
Budget compute_budget(const PreparedStudy& ready, const std::vector<Row>& rows,
                      const Progress& progress = {});

}  // namespace abbe::sim::study
