#pragma once

#include <string>
#include <vector>

#include "sim/machine/truth.h"

namespace abbe::sim {

/// Returns what no machine does: a node that leaves -40 to 150 deg C, a spindle that runs more than
/// five times as fast as the speed at which its heat is stated or, in its history, less than a
/// thirtieth of it, a datum found before the history or after the program. One sentence each; empty
/// without heat.
std::vector<std::string> heat_warnings(const DatumDescription& datum, const Truth& truth);

}  // namespace abbe::sim
