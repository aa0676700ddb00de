#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "sim/report/encode.h"

namespace abbe::sim {

/// What a page holds besides words: the index of its arrays, and their texts.
struct PageData {
  nlohmann::ordered_json index;
  std::string blocks;
};

void add_block(PageData& data, const std::string& name, const std::string& text);

/// An array by its name.
struct PageArray {
  std::string name;
  bool on_mesh = false;                 ///< rows are the vertices of the mesh
  std::vector<std::string> references = {};  ///< what its packing was offered
};
void add(PageData& data, const PageArray& array, const Packed& packed);

/// A rigid pose, column after column.
nlohmann::ordered_json to_json(const Eigen::Isometry3d& T);
nlohmann::ordered_json to_json(const Eigen::Vector3d& v);

}  // namespace abbe::sim
