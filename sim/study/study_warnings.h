#pragma once

#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns one warning for each number of a study that is hardly intended:
/// - an input whose spread looks like a number in another unit than that of its path, or like
///   percent where it is a factor or of a logarithm;
/// - limits `low` and `high` that leave less than a fifth of the spread;
/// - a centre more than three spreads from the number that the scene states;
/// - two inputs that change one element;
/// - a sweep that ends more than ten spreads from the centre;
/// - limits, steps, reaches and coverages in another unit;
/// - fewer than 100 random cases, whose P95 and P99 are extremes of a few.
/// @param scene  of the arm that is judged, before any input
std::vector<std::string> study_warnings(const Study& study, const Scene& scene);

}  // namespace abbe::sim::study
