#pragma once

#include <filesystem>
#include <string>

#include "sim/report/html_report.h"

namespace abbe::sim::study {

/// Whether a folder has the budget of a finished study.
bool holds_study(const std::filesystem::path& folder);

/// The page of a finished study from what it left in `folder`: budget.json, the random machines of
/// cases.csv, study.toml and pictures of its maps. Of more than 20 000 random machines every n-th
/// by rank is in the page, and its warnings say so.
/// @param language  "en" or "zh", in which it opens
/// @throws BadInput naming the file, what was expected and what was seen: a folder without a
///         finished study, a budget or a table that is broken or of something else
HtmlReport study_page(const std::filesystem::path& folder, const std::string& language = "en");

}  // namespace abbe::sim::study
