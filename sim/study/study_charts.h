#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/report/figures_page.h"
#include "sim/study/budget.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Returns the page of a study without the files of its folder: tables and charts of all analyses
/// that were requested, request, warnings and command. The figures have the same digits as in
/// budget.json.
/// @param maps  (configurations) figures of influence and uncertainty maps, from write_influence()
FiguresPage study_page(const Budget& budget, const std::vector<nlohmann::ordered_json>& maps,
                       const std::vector<HistoryResult>& histories);

/// Returns the warnings about random machines that the page leaves out: of more than 20 000 it
/// shows only every n-th by rank.
std::vector<std::string> page_omissions(const Budget& budget);

}  // namespace abbe::sim::study
