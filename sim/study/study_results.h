#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/report/figures_page.h"
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

/// Adds to the page of a study what its folder holds: pictures of maps, files for download, and the
/// name of the folder.
/// @throws BadInput if a file cannot be read
FiguresPage with_folder(FiguresPage page, const std::filesystem::path& folder);

/// Returns the page of a finished study from `page.json` and the other files in `folder`.
/// @throws BadInput as read_page()
FiguresPage saved_study_page(const std::filesystem::path& folder);

}  // namespace abbe::sim::study
