#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "sim/report/page_data.h"
#include "sim/report/page_maps.h"

namespace abbe::sim {

/// What a page of maps shows (render/report/viewer.js).
struct MapsPage {
  std::string title;
  std::string language = "en";  ///< "en" or "zh", in which it opens
  PageData data;
  nlohmann::ordered_json cases;  ///< figures, as comparison.json has them
  std::string pictures;          ///< a section for browsers that turn no map, and for paper
  std::string words;             ///< below the figures
};

/// What a page holds of its maps.
/// @param tolerance_um  lower and upper, or null
/// @throws std::invalid_argument as `add_maps`
PageData maps_data(const PartMaps& maps, const nlohmann::ordered_json& tolerance_um);

/// One page that needs nothing besides itself.
std::string html_of(const MapsPage& page);

}  // namespace abbe::sim
