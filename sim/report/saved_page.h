#pragma once

#include <filesystem>
#include <string>

#include "sim/report/html_report.h"

namespace abbe::sim {

/// Whether `run` or `compare` left a folder.
bool holds_saved_cases(const std::filesystem::path& folder);

/// The page of what `run` (summary.json) or `compare` (comparison.json) left: the figures of every
/// case, its map to turn where residual.vtp is there, its pictures, its scene. The machine in
/// motion is not in it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen
HtmlReport saved_page(const std::filesystem::path& folder, const std::string& language);

}  // namespace abbe::sim
