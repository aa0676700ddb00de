#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace abbe::sim::study {

/// Responses of random machines, keyed by the head of their column in cases.csv, in its unit.
using MachineResponses = std::map<std::string, std::vector<double>>;

/// Returns the head of a response's column in cases.csv, from budget.json.
std::string response_column_head(const nlohmann::ordered_json& budget,
                                 const nlohmann::ordered_json& arm,
                                 const nlohmann::ordered_json& response);

/// Returns the tables and charts of a study (sim/report/figures_page.h) from its budget.json;
/// analyses that were not requested are left out. The figures are those of the budget, digit by
/// digit.
/// @throws nlohmann::json::exception or std::invalid_argument if `budget` is not a budget
nlohmann::ordered_json study_blocks(const nlohmann::ordered_json& budget,
                                    const MachineResponses& answers);

}  // namespace abbe::sim::study
