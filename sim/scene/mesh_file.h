#pragma once

#include <filesystem>

#include "sim/scene/toml_tree.h"

namespace abbe::sim {

/// A surface from a file: of a part, a blank, or a body.
struct MeshFile {
  std::filesystem::path file;
  double unit = 1.0;      ///< mm per unit of the file
  bool any_size = false;  ///< its size is meant: no doubt is cast on the unit
  bool open = false;      ///< a surface with a rim is meant
  Place place = {};       ///< in the scene, where it is named
};

}  // namespace abbe::sim
