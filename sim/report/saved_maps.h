#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/report/page_maps.h"

namespace abbe::sim {

/// A case that was saved: its figures, with its name, and the folder that may hold its map.
struct SavedCase {
  nlohmann::ordered_json figures;
  std::filesystem::path folder;
};

/// The maps that `run` or `compare` left as residual.vtp. Regions are not in such files, nor are
/// they invented: that the scene of a case has some is among what is left out, and so are cases
/// without a file.
/// @throws BadInput for a file that is damaged or holds more than a page can
PartMaps saved_maps(const std::vector<SavedCase>& cases);

}  // namespace abbe::sim
