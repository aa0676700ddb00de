#pragma once

#include <string_view>

#include "sim/dialects/program_run.h"

namespace abbe::sim::dialects::cl {

/// Whether the first line that says something is of numbers, or the head of a table.
bool is_table(std::string_view text);

/// Reads cutter locations of a table.
void read_table(std::string_view text, ProgramRun& run);

}  // namespace abbe::sim::dialects::cl
