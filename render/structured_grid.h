#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "cutting/mesh.h"

namespace abbe::render {

/// Values at the points of a grid under a name: (n x components), one a scalar, three a vector.
struct GridArray {
  std::string name;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values;
};

/// Writes points in rows, layers and stacks with point data that ParaView opens (`.vts`): VTK XML
/// StructuredGrid, float64, little endian, appended base64 without compression; the first array is
/// the active one. The same data give the same bytes.
/// @param points  (n x 3) mm, the first index of `size` runs fastest
/// @throws std::invalid_argument unless n is the product of `size` and every array has n rows, at
///         least one column and a name of its own
/// @throws std::system_error with the path if the file cannot be written
void write_structured_grid(const std::filesystem::path& path, const cutting::Points& points,
                           const std::array<int, 3>& size, const std::vector<GridArray>& arrays);

}  // namespace abbe::render
