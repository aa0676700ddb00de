#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/report/case_page.h"
#include "sim/study/case_plan.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Writes the influence files of a configuration:
///   `influence.vtp`: the design with the base map (minus the error-free map if the study requests
///       it), the effect of every input (um per unit of the input) and the doubt of the map
///   `influence-sheet.png`, `influence-sheet-2.png` and so on, at most eight: the effects of one
///       standard deviation of every input, largest first, 30 on a sheet
///   `influence-NAME.png`: that of each input that the study names
///   `uncertainty.vtp` and `uncertainty.png`, if requested
/// @param configuration  index of the configuration
/// @return their entries of `budget.json`, "influence" and "uncertainty"
/// @throws OutputFailure
nlohmann::ordered_json write_influence(const ResultFolder& folder, const PreparedStudy& ready,
                                       std::size_t configuration);

/// Writes `histories.csv` and `histories.png`.
/// @throws OutputFailure
void write_histories(const ResultFolder& folder, const Study& study,
                     const std::vector<HistoryResult>& results);

/// Returns true if a folder holds the budget of a finished study.
bool has_study(const std::filesystem::path& folder);

/// Returns the HTML report of a finished study from the files in `folder`: budget.json, the random
/// machines of cases.csv, study.toml and pictures of its maps. Of more than 20 000 random machines
/// only every n-th by rank is included; a warning says so.
/// @param language  language in which it opens, "en" or "zh"
/// @throws BadInput for a folder without a finished study, and for a budget or table that is
/// damaged or not that of a study; names the file, what was expected and what was found
HtmlReport study_page(const std::filesystem::path& folder, const std::string& language = "en");

}  // namespace abbe::sim::study
