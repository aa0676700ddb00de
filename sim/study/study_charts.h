#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace abbe::sim::study {

/// Answers of random machines by the head of their column in cases.csv, in its unit.
using MachineResponses = std::map<std::string, std::vector<double>>;

/// The head of a response in cases.csv, from budget.json.
std::string response_column_head(const nlohmann::ordered_json& budget,
                                 const nlohmann::ordered_json& arm,
                                 const nlohmann::ordered_json& response);

/// Tables and charts of a study (sim/report/figures_page.h) from its budget.json; what no analysis
/// asked is left out. The figures are those of the budget, digit by digit.
/// @throws nlohmann::json::exception or std::invalid_argument if `budget` is none
nlohmann::ordered_json study_blocks(const nlohmann::ordered_json& budget,
                                    const MachineResponses& answers);

}  // namespace abbe::sim::study
