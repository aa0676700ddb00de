#pragma once

#include <string>

#include "sim/calibration/identify.h"

namespace abbe::sim {

/// What was identified, as a person reads it; foreign text in it stays on its line.
std::string identify_text(const Identified& identified);

}  // namespace abbe::sim
