#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads the milling programs of Fanuc's controls (Series 16i to 30i), custom macro B among them.
void read_fanuc(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordUse> fanuc_words();

}  // namespace abbe::sim::dialects
