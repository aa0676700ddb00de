#pragma once

#include <string>
#include <vector>

#include "sim/files/progress.h"
#include "sim/study/budget.h"
#include "sim/study/case_plan.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Returns the effect of each coefficient that the readings did not identify: the change of the map
/// of a configuration, in the alignment of the scene, if the coefficient and those that hide it
/// change together by one of its standard deviations. Empty if influence maps cannot represent the
/// configuration.
std::vector<UnidentifiedEffect> unidentified_effects(const Study& study,
                                                     const PreparedConfiguration& ready,
                                                     const Progress& progress = {});

/// Returns the warning about coefficients that were not identified and have no prior: "every figure
/// of uncompensated leaves out ...: the map feels EY0A by 1.4 um RMS per 20 um, ...". If their
/// effects are not known, the warning only counts them. Empty if there are none, or if together
/// they change the map by less than 1 nm RMS.
std::string unidentified_warning(const Study& study, const ConfigurationBudget& arm);

/// Computes the budget from the finished cases of a study. Analyses with unfinished cases give only
/// those results that the finished cases allow.
/// @param rows  results of the finished cases, by ascending case number
Budget compute_budget(const Study& study, const Plan& plan, const std::vector<Row>& rows);

/// Computes the same budget and adds the results of influence maps: contributions to the map, worst
/// corners of the inputs, tolerances.
Budget compute_budget(const PreparedStudy& ready, const std::vector<Row>& rows,
                      const Progress& progress = {});

}  // namespace abbe::sim::study
