#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/report/case_page.h"
#include "sim/study/case_plan.h"
#include "sim/study/histories.h"

namespace abbe::sim::study {

/// Writes the influence files of a configuration: `influence.vtp`, the design with the base map
/// (less the error-free map if the study requests it), the effect of every input (um per unit of
/// the input) and the doubt of the map; `influence-sheet.png`, one standard deviation of every
/// input, largest first, 30 on a sheet, `influence-sheet-2.png` ..., eight at most;
/// `influence-NAME.png` of the inputs that the study names; `uncertainty.vtp` and `uncertainty.png`
/// if requested.
/// @return the entries of `budget.json` for them: "influence" and "uncertainty"
/// @throws OutputFailure
nlohmann::ordered_json write_influence(const ResultFolder& folder, const PreparedStudy& ready,
                                       std::size_t arm);

/// Writes `histories.csv` and `histories.png`.
/// @throws OutputFailure
void write_histories(const ResultFolder& folder, const Study& study,
                     const std::vector<HistoryResult>& results);

/// Returns true if a folder holds the budget of a finished study.
bool has_study(const std::filesystem::path& folder);

/// Returns the HTML report of a finished study from the files in `folder`: budget.json, the random
/// machines of cases.csv, study.toml and pictures of its maps. Of more than 20 000 random machines
/// every n-th by rank is included, and a warning says so.
/// @param language  "en" or "zh", in which it opens
/// @throws BadInput naming the file, what was expected and what was found: a folder without a
/// finished study, or a budget or table that is damaged or belongs to something else
HtmlReport study_page(const std::filesystem::path& folder, const std::string& language = "en");

}  // namespace abbe::sim::study
