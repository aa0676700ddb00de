#pragma once

#include <string>
#include <vector>

#include "sim/files/progress.h"
#include "sim/study/arm.h"
#include "sim/study/budget.h"

namespace abbe::sim::study {

/// Returns what a standard deviation of each unidentified number does to the map of an arm, as the
/// scene aligns it, the numbers that hide it moved along; empty where influence maps cannot follow
/// the arm.
std::vector<UnidentifiedEffect> unidentified_effects(const Study& study, const ReadyArm& ready,
                                                     const Progress& progress = {});

/// "Every figure of uncompensated leaves out ...: the map feels EY0A by 1.4 um RMS per 20 um, ..."
/// of the numbers that have no prior and change the map by 1 nm or more together; else empty.
std::string unidentified_warning(const Study& study, const ArmBudget& arm);

}  // namespace abbe::sim::study
