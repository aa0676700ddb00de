#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/report/summary.h"

namespace abbe::sim {

/// Options of an HTML report.
struct PageOptions {
  std::string language = "en";  ///< language in which it opens, "en" or "zh"
  std::string command;          ///< command that reproduces the report
};

/// An HTML page with the warnings of its creation.
struct HtmlReport {
  std::string html;
  std::vector<std::string> warnings;  ///< omissions of the page, by name
};

/// Returns one self-contained page: the maps of the cases to turn in a browser, the machine along
/// the program, the figures of `comparison` with its warnings, a still picture of every map. Values
/// are packed to within half of the step that the page states, residual and form in steps of 2 nm
/// or finer (maps_page.h).
/// @param cases  at least one; cases of a variant whose part has other vertices are left out of the
/// maps
HtmlReport html_report(const std::vector<Compared>& cases, const Comparison& comparison,
                       const PageOptions& asked);

/// Returns true if `run` or `compare` wrote the folder.
bool has_saved_cases(const std::filesystem::path& folder);

/// Returns the page of a folder written by `run` (summary.json) or `compare` (comparison.json): the
/// figures of every case, its map to turn if residual.vtp exists, its pictures, its scene. The
/// machine in motion is left out, and a warning says so.
/// @throws BadInput naming the file, what was expected and what was found
HtmlReport saved_page(const std::filesystem::path& folder, const std::string& language);

}  // namespace abbe::sim
