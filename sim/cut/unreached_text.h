#pragma once

#include <string>

#include "sim/program/generate.h"

namespace abbe::sim {

/// "12 of 40 passes are left out ..."; empty if all are reached.
std::string unreached_text(const program::Unreached& unreached);

}  // namespace abbe::sim
