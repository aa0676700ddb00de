#pragma once

#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns one warning for each input whose spread looks like a number in another unit than that of
/// its path, or like percent where it is a factor; for limits in another unit; and for a random
/// study of fewer than 100 cases, whose P95 and P99 are extremes of a few.
std::vector<std::string> spread_warnings(const Study& study);

}  // namespace abbe::sim::study
