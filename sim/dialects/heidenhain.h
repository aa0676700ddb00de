#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads Klartext as a TNC 640 does.
void read_heidenhain(std::string_view text, ProgramRun& run);

/// Its words; those of several parts have no-break spaces between them, as TOOL CALL.
std::span<const WordUse> heidenhain_words();

}  // namespace abbe::sim::dialects
