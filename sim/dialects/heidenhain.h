#pragma once

#include <string_view>

#include "sim/dialects/program_run.h"

namespace abbe::sim::dialects {

/// Reads Klartext as a TNC 640 does.
void read_heidenhain(std::string_view text, ProgramRun& run);

}  // namespace abbe::sim::dialects
