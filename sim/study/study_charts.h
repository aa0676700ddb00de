#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace abbe::sim::study {

/// Responses of random machines by the heading of their column in cases.csv, in its unit.
using MachineResponses = std::map<std::string, std::vector<double>>;

/// Returns the heading of a response's column in cases.csv.
/// @param budget         contents of budget.json
/// @param configuration  configuration, from the budget
/// @param response       from the configuration
std::string response_column_head(const nlohmann::ordered_json& budget,
                                 const nlohmann::ordered_json& configuration,
                                 const nlohmann::ordered_json& response);

/// Returns the tables and charts of a study (sim/report/figures_page.h) from its budget.json, for
/// all analyses that were requested. The figures have the same digits as in the budget.
/// @throws nlohmann::json::exception or std::invalid_argument if `budget` is not a budget
nlohmann::ordered_json study_blocks(const nlohmann::ordered_json& budget,
                                    const MachineResponses& responses);

}  // namespace abbe::sim::study
