#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/mesh.h"

namespace abbe::render {

/// Values of the vertices, or of the triangles, under a name: float64, float32, uint8 or int32. A
/// view, the values are the caller's.
struct PointArray {
  std::string name;
  std::variant<std::span<const double>, std::span<const float>, std::span<const std::uint8_t>,
               std::span<const int>>
      values;
  int components = 1;  ///< of each
};

/// What a file says of itself: names and texts.
using Facts = std::vector<std::pair<std::string, std::string>>;

/// Writes a mesh (mm, float64) with point data that ParaView opens: VTK XML PolyData, little
/// endian, appended bytes, compressed by zlib; the first array is the active one. The same data
/// give the same bytes. Facts become field data. In names, quotes, angle brackets, ampersands and
/// control characters become "_".
/// @throws std::invalid_argument if an array has not one value a vertex, or two have one name
/// @throws std::system_error with the path if the file cannot be written
void write_point_data(const std::filesystem::path& path, const cutting::Points& vertices,
                      const cutting::Triangles& triangles, const std::vector<PointArray>& arrays,
                      const Facts& facts = {}, const std::vector<PointArray>& of_triangles = {});

/// The same of a design and float64 arrays, each (n), NaN where there is no value.
/// @throws also if there is not one name an array
void write_point_data(const std::filesystem::path& path, const cutting::Design& design,
                      const std::vector<std::string>& names,
                      const std::vector<Eigen::VectorXd>& arrays);

}  // namespace abbe::render
