#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "sim/report/page_maps.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// The maps of cases as they were cut, with the regions of the part and the stretches of the first
/// case's program.
/// @param cases    at least one
/// @param figures  of them, as comparison.json has them
PartMaps compared_maps(const std::vector<Compared>& cases, const nlohmann::ordered_json& figures);

}  // namespace abbe::sim
