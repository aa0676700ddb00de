#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads programs of Siemens 840D.
void read_siemens(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordUse> siemens_words();

}  // namespace abbe::sim::dialects
