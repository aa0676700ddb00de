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

/// `influence.vtp` of an arm: the design with the base map (less the error-free one where the study
/// asks for the machine's part), what every input does to it (um per unit
/// of the input) and where the maps are doubted; `influence-sheet.png`, one standard deviation of
/// every input, the largest first, 30 on a sheet, `influence-sheet-2.png` ..., eight at most;
/// `influence-NAME.png` of the inputs that the study names;
/// `uncertainty.vtp` and `uncertainty.png` where it asks for them.
/// @return what `budget.json` says of them: "influence" and "uncertainty"
/// @throws OutputFailure
nlohmann::ordered_json write_influence(const ResultFolder& folder, const PreparedStudy& ready,
                                       std::size_t arm);

/// `histories.csv` and `histories.png`.
/// @throws OutputFailure
void write_histories(const ResultFolder& folder, const Study& study,
                     const std::vector<HistoryResult>& results);

/// Whether a folder has the budget of a finished study.
bool has_study(const std::filesystem::path& folder);

/// The page of a finished study from what it left in `folder`: budget.json, the random machines of
/// cases.csv, study.toml and pictures of its maps. Of more than 20 000 random machines every n-th
/// by rank is in the page, and its warnings say so.
/// @param language  "en" or "zh", in which it opens
/// @throws BadInput naming the file, what was expected and what was seen: a folder without a
///         finished study, a budget or a table that is broken or of something else
HtmlReport study_page(const std::filesystem::path& folder, const std::string& language = "en");

}  // namespace abbe::sim::study
