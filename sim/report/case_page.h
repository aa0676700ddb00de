#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/report/summary.h"

namespace abbe::sim {

/// Options of an HTML report.
struct PageOptions {
  std::string language = "en";  ///< language in which the page opens, "en" or "zh"
  std::string command;          ///< command that reproduces the report
};

/// An HTML page and its warnings.
struct HtmlReport {
  std::string html;
  std::vector<std::string> warnings;  ///< messages on what the page leaves out; for saved results
                                      ///< also the warnings saved with them
};

/// Returns one self-contained page: maps of the cases that can be rotated in a browser, the machine
/// along the program, the figures of `comparison` with its warnings, and a still picture of every
/// map. Map values are rounded to a step that the page states, 2 nm or less for residual and form
/// (see maps_page.h).
/// @param cases  at least one; a case whose part has different vertices from that of the first case
///               gets no map
HtmlReport html_report(const std::vector<ComparedCase>& cases, const Comparison& comparison,
                       const PageOptions& options);

/// Returns true if `run` or `compare` wrote the folder.
bool has_saved_cases(const std::filesystem::path& folder);

/// Returns the page of a folder written by `run` (summary.json) or `compare` (comparison.json): the
/// figures of every case, its map if residual.vtp exists, its pictures and its scene. The motion of
/// the machine is not saved; a warning on the page says so.
/// @param language  language in which the page opens, "en" or "zh"
/// @throws BadInput that names the file, what was expected and what was found
HtmlReport saved_results_page(const std::filesystem::path& folder, const std::string& language);

}  // namespace abbe::sim
