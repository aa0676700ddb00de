#pragma once

#include <string>
#include <vector>

#include "sim/report/page_data.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Packs the mesh of the part and the map of every case: residual and form in steps of 2 nm or
/// finer, positions to 1/65534 of the largest extent, instants of cutting to 0.02 s, lines of the
/// program and regions as they are.
/// @param cases    at least one
/// @param figures  of them, as comparison.json has them
/// @return what is left out: cases of a variant whose part has other vertices
std::vector<std::string> add_maps(PageData& data, const std::vector<Compared>& cases,
                                  const nlohmann::ordered_json& figures);

}  // namespace abbe::sim
