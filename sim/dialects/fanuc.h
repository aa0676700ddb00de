#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads programs of Fanuc's controls (Series 16i to 30i), custom macro B among them: of milling
/// controls, or of turning controls with G-code system A, as `run.turning()` says.
void read_fanuc(std::string_view text, ProgramRun& run);

/// Words of milling controls, and of turning controls.
std::span<const WordUse> fanuc_words();
std::span<const WordUse> fanuc_lathe_words();

}  // namespace abbe::sim::dialects
