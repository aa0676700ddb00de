#pragma once

#include "sim/machine/machine.h"
#include "sim/program/sample.h"

namespace abbe::sim {

/// Refuses the line of the program on which an axis first leaves its travel; spindles have none.
/// @throws BadInput
void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples);

}  // namespace abbe::sim
