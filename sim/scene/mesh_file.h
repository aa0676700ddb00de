#pragma once

#include <filesystem>

namespace abbe::sim {

/// A design surface from a file.
struct MeshFile {
  std::filesystem::path file;
  double unit = 1.0;      ///< mm per unit of the file
  bool any_size = false;  ///< its size is meant: no doubt is cast on the unit
  bool open = false;      ///< a surface with a rim is meant
};

}  // namespace abbe::sim
