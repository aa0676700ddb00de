#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/report/summary.h"

namespace abbe::sim {

/// What a report is to be.
struct PageOptions {
  std::string language = "en";  ///< "en" or "zh", in which it opens
  std::string command;          ///< that makes it again
};

struct HtmlReport {
  std::string html;
  std::vector<std::string> warnings;  ///< what the page leaves out, by name
};

/// One page that needs nothing besides itself: the maps of the cases as a browser turns them, the
/// machine along the program, the figures of `comparison` and its warnings, a still picture of
/// every map. Values are packed to within half of the step that the page states, residual and form
/// in steps of 2 nm or finer; see page_maps.h and page_machine.h.
/// @param cases  at least one; those of a variant whose part has other vertices are left out of
///               the maps
HtmlReport html_report(const std::vector<Compared>& cases, const Comparison& comparison,
                       const PageOptions& asked);

/// Whether `run` or `compare` left a folder.
bool has_saved_cases(const std::filesystem::path& folder);

/// The page of what `run` (summary.json) or `compare` (comparison.json) left: the figures of every
/// case, its map to turn where residual.vtp is there, its pictures, its scene. The machine in
/// motion is not in it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen
HtmlReport saved_page(const std::filesystem::path& folder, const std::string& language);

}  // namespace abbe::sim
