#pragma once

#include <filesystem>

#include "sim/report/figures_page.h"

namespace abbe::sim {

/// Whether `run` or `compare` left a folder.
bool holds_saved_cases(const std::filesystem::path& folder);

/// The page of what `run` (summary.json) or `compare` (comparison.json) left: the figures of every
/// case, the pictures of its maps, its scene. Maps to turn and the machine in motion are not in it,
/// and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen
FiguresPage saved_page(const std::filesystem::path& folder);

}  // namespace abbe::sim
