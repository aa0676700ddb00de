#pragma once

#include <span>

#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// The words of Klartext; those of several parts have no-break spaces between them, as TOOL CALL.
std::span<const WordUse> heidenhain_words();

}  // namespace abbe::sim::dialects
