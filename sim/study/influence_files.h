#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/study/engine.h"
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
nlohmann::ordered_json write_influence(const ResultFolder& folder, const ReadyStudy& ready,
                                       std::size_t arm);

/// `histories.csv` and `histories.png`.
/// @throws OutputFailure
void write_histories(const ResultFolder& folder, const Study& study,
                     const std::vector<HistoryResult>& results);

}  // namespace abbe::sim::study
