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

/// Writes a file and checks that the system has accepted every byte.
/// @throws std::system_error with the path and the reason
void write_bytes(const std::filesystem::path& path, std::string_view bytes);

/// Returns VTK data with points in double precision and no cells.
vtkSmartPointer<vtkPolyData> poly_data(const cutting::Points& points);

/// Returns cells with the same number of corners, with 32-bit indices.
/// @param indices  (count x corners) row by row
vtkSmartPointer<vtkCellArray> cells(const int* indices, Eigen::Index count, int corners);

/// Named values of the vertices or the triangles: float64, float32, uint8 or int32. The caller owns
/// the values.
struct PointArray {
  std::string name;
  std::variant<std::span<const double>, std::span<const float>, std::span<const std::uint8_t>,
               std::span<const int>>
      values;
  int components = 1;  ///< number of values per vertex or triangle
};

/// Metadata of a file, as names and texts.
using Facts = std::vector<std::pair<std::string, std::string>>;

/// Writes a mesh (mm, float64) with point data for ParaView: VTK XML PolyData, little endian,
/// appended bytes, compressed by zlib. The first array is the active one; facts become field data.
/// In names, quotes, angle brackets, ampersands and control characters become "_". The same data
/// give the same bytes.
/// @throws std::invalid_argument if the size of an array does not match, or if two arrays have the
///         same name
/// @throws std::system_error with the path if the file cannot be written
void write_point_data(const std::filesystem::path& path, const cutting::Points& vertices,
                      const cutting::Triangles& triangles, const std::vector<PointArray>& arrays,
                      const Facts& facts = {}, const std::vector<PointArray>& triangle_arrays = {});

/// Writes a design with float64 arrays, each (n), NaN for vertices without value.
/// @throws std::invalid_argument also if the numbers of names and arrays differ
void write_point_data(const std::filesystem::path& path, const cutting::Design& design,
                      const std::vector<std::string>& names,
                      const std::vector<Eigen::VectorXd>& arrays);

/// Named values at the points of a grid: (n x components), one component for scalars, three for
/// vectors.
struct GridArray {
  std::string name;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values;
};

/// Writes a structured grid of points with point data for ParaView (`.vts`): VTK XML
/// StructuredGrid, float64, little endian, appended base64 without compression. The first array is
/// the active one. The same data give the same bytes.
/// @param points  (n x 3) mm; the first index of `size` varies fastest
/// @throws std::invalid_argument unless n is the product of `size` and every array has n rows, at
///         least one column and a unique name
/// @throws std::system_error with the path if the file cannot be written
void write_structured_grid(const std::filesystem::path& path, const cutting::Points& points,
                           const std::array<int, 3>& size, const std::vector<GridArray>& arrays);

}  // namespace abbe::render
