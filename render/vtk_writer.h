#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

class vtkCellArray;
class vtkPolyData;
template <class T>
class vtkSmartPointer;

namespace abbe::render {

/// Writes a whole file and makes sure that the system took every byte.
/// @throws std::system_error with the path and the system's reason
void write_bytes(const std::filesystem::path& path, std::string_view bytes);

/// VTK's data of points alone, in double precision.
vtkSmartPointer<vtkPolyData> poly_data(const cutting::Points& points);

/// Cells of equal size from row-major indices, in 32-bit numbers.
vtkSmartPointer<vtkCellArray> cells(const int* indices, Eigen::Index count, int corners);

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
                      const Facts& facts = {}, const std::vector<PointArray>& triangle_arrays = {});

/// The same of a design and float64 arrays, each (n), NaN where there is no value.
/// @throws also if there is not one name an array
void write_point_data(const std::filesystem::path& path, const cutting::Design& design,
                      const std::vector<std::string>& names,
                      const std::vector<Eigen::VectorXd>& arrays);

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
