#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads RS274/NGC as LinuxCNC does, and G43.4 of abbe's own programs.
void read_linuxcnc(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordUse> linuxcnc_words();

}  // namespace abbe::sim::dialects
