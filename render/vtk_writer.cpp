#include "render/vtk_writer.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataSetAttributes.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkStringArray.h>
#include <vtkStructuredGrid.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkXMLPolyDataWriter.h>
#include <vtkXMLStructuredGridWriter.h>

namespace abbe::render {

void write_bytes(const std::filesystem::path& path, std::string_view bytes) {
  const auto throw_system_error = [&](int reason) {
    throw std::system_error(reason, std::generic_category(), path.string());
  };
  std::FILE* stream = std::fopen(path.c_str(), "wb");
  if (stream == nullptr) throw_system_error(errno);
  // fwrite() may fail without setting errno, and an old value must not be reported.
  errno = 0;
  const bool is_written = std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size();
  const int reason = errno;
  // A full disk may be reported only when the buffer is flushed.
  const bool is_closed = std::fclose(stream) == 0;
  if (!is_written) throw_system_error(reason != 0 ? reason : EIO);
  if (!is_closed) throw_system_error(errno);
}

vtkSmartPointer<vtkPolyData> poly_data(const cutting::Points& points) {
  vtkNew<vtkDoubleArray> coordinates;
  coordinates->SetNumberOfComponents(3);
  coordinates->SetNumberOfTuples(points.rows());
  std::copy(points.data(), points.data() + points.size(), coordinates->GetPointer(0));
  vtkNew<vtkPoints> vertices;
  vertices->SetData(coordinates);
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(vertices);
  return data;
}

vtkSmartPointer<vtkCellArray> cells(const int* indices, Eigen::Index count, int corners) {
  vtkNew<vtkTypeInt32Array> offsets;
  vtkNew<vtkTypeInt32Array> connectivity;
  offsets->SetNumberOfValues(count + 1);
  connectivity->SetNumberOfValues(count * corners);
  // VTK stores the start of each cell and the end of the last one.
  for (Eigen::Index i = 0; i <= count; ++i) offsets->SetValue(i, vtkTypeInt32(i * corners));
  std::copy(indices, indices + count * corners, connectivity->GetPointer(0));
  auto array = vtkSmartPointer<vtkCellArray>::New();
  array->SetData(offsets, connectivity);
  return array;
}

namespace {

template <class Array, class Data>
void add_array(vtkDataSetAttributes& attributes, const PointArray& point_array, const Data& data) {
  vtkNew<Array> array;
  array->SetName(point_array.name.c_str());
  array->SetNumberOfComponents(point_array.components);
  array->SetNumberOfValues(static_cast<vtkIdType>(data.size()));
  std::copy(data.begin(), data.end(), array->GetPointer(0));
  attributes.AddArray(array);
}

void add(vtkDataSetAttributes& attributes, const PointArray& point_array,
         std::span<const double> values) {
  add_array<vtkDoubleArray>(attributes, point_array, values);
}
void add(vtkDataSetAttributes& attributes, const PointArray& point_array,
         std::span<const float> values) {
  add_array<vtkFloatArray>(attributes, point_array, values);
}
void add(vtkDataSetAttributes& attributes, const PointArray& point_array,
         std::span<const std::uint8_t> values) {
  add_array<vtkUnsignedCharArray>(attributes, point_array, values);
}
void add(vtkDataSetAttributes& attributes, const PointArray& point_array,
         std::span<const int> values) {
  add_array<vtkIntArray>(attributes, point_array, values);
}

void write_poly_data(const std::filesystem::path& path, vtkPolyData& mesh) {
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(&mesh);
  writer->SetByteOrderToLittleEndian();
  writer->SetHeaderTypeToUInt64();
  writer->SetDataModeToAppended();
  // Raw bytes make the file smaller by a quarter than base64.
  writer->EncodeAppendedDataOff();
  writer->SetCompressorTypeToZLib();
  writer->SetCompressionLevel(1);  // half the time of the default level 5, and hardly larger
  // On a full disk VTK reports success, so it only fills a string, and write_bytes() writes it.
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError) {
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  }
  write_bytes(path, writer->GetOutputString());
}

/// Replaces characters of a name that are invalid in XML, because VTK does not escape them.
std::string escape_xml(std::string name) {
  for (char& c : name)
    if (static_cast<unsigned char>(c) < 0x20 ||
        std::string_view("\"'<>&").find(c) != std::string_view::npos)
      c = '_';
  return name.empty() ? "_" : name;
}

void add_facts(vtkPolyData& mesh, const Facts& facts) {
  for (const auto& [name, text] : facts) {
    vtkNew<vtkStringArray> array;
    array->SetName(escape_xml(name).c_str());
    array->InsertNextValue(text);
    mesh.GetFieldData()->AddArray(array);
  }
}

/// Returns the arrays with names that are valid in XML.
/// @throws std::invalid_argument if a size does not match or two names are equal
std::vector<PointArray> validated(std::vector<PointArray> arrays, Eigen::Index count) {
  std::set<std::string> names;
  for (PointArray& array : arrays) {
    const std::size_t size =
        std::visit([](const auto& values) { return values.size(); }, array.values);
    if (size != static_cast<std::size_t>(count) * std::size_t(array.components))
      throw std::invalid_argument(
          fmt::format("point data: expected {} values for each of {} points in {}",
                      array.components, count, array.name));
    array.name = escape_xml(array.name);
    // Replaced characters may make two names equal; VTK would keep only one of the arrays.
    if (!names.insert(array.name).second)
      throw std::invalid_argument(fmt::format("point data: two arrays are named {}", array.name));
  }
  return arrays;
}

}  // namespace

void write_point_data(const std::filesystem::path& path, const cutting::Points& vertices,
                      const cutting::Triangles& triangles, const std::vector<PointArray>& arrays,
                      const Facts& facts, const std::vector<PointArray>& triangle_arrays) {
  const std::vector<PointArray> vertex_arrays = validated(arrays, vertices.rows());
  const auto mesh = poly_data(vertices);
  mesh->SetPolys(cells(triangles.data(), triangles.rows(), 3));
  for (const PointArray& array : vertex_arrays)
    std::visit([&](const auto& values) { add(*mesh->GetPointData(), array, values); },
               array.values);
  for (const PointArray& array : validated(triangle_arrays, triangles.rows()))
    std::visit([&](const auto& values) { add(*mesh->GetCellData(), array, values); }, array.values);
  // Viewers colour the mesh by the active scalars.
  if (!vertex_arrays.empty())
    mesh->GetPointData()->SetActiveScalars(vertex_arrays.front().name.c_str());
  add_facts(*mesh, facts);
  write_poly_data(path, *mesh);
}

void write_point_data(const std::filesystem::path& path, const cutting::Design& design,
                      const std::vector<std::string>& names,
                      const std::vector<Eigen::VectorXd>& arrays) {
  if (names.size() != arrays.size())
    throw std::invalid_argument("point data: expected one name per array");
  std::vector<PointArray> views;
  for (std::size_t i = 0; i < names.size(); ++i)
    views.push_back({names[i], std::span<const double>(arrays[i].data(), arrays[i].size())});
  write_point_data(path, design.vertices, design.triangles, views);
}

namespace {

void require_grid(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("structured grid: " + message);
}

void check_grid(const cutting::Points& points, const std::array<int, 3>& size,
                const std::vector<GridArray>& arrays) {
  require_grid(size[0] > 0 && size[1] > 0 && size[2] > 0, "every size must be positive");
  require_grid(Eigen::Index(size[0]) * size[1] * size[2] == points.rows(),
               "the product of the sizes must be the number of points");
  std::set<std::string> names;
  for (const GridArray& array : arrays) {
    require_grid(array.values.rows() == points.rows() && array.values.cols() > 0,
                 "expected one row per point in " + array.name);
    require_grid(names.insert(array.name).second, "two arrays are named " + array.name);
    require_grid(!array.name.empty() && array.name.find_first_of("\"'<>&") == std::string::npos,
                 "expected a name that is valid in XML");
  }
}

vtkNew<vtkDoubleArray> double_array(const double* values, Eigen::Index rows, Eigen::Index columns) {
  vtkNew<vtkDoubleArray> result;
  result->SetNumberOfComponents(int(columns));
  result->SetNumberOfTuples(rows);
  std::copy(values, values + rows * columns, result->GetPointer(0));
  return result;
}

}  // namespace

void write_structured_grid(const std::filesystem::path& path, const cutting::Points& points,
                           const std::array<int, 3>& size, const std::vector<GridArray>& arrays) {
  check_grid(points, size, arrays);
  vtkNew<vtkStructuredGrid> grid;
  grid->SetDimensions(size[0], size[1], size[2]);
  vtkNew<vtkPoints> grid_points;
  grid_points->SetData(double_array(points.data(), points.rows(), 3));
  grid->SetPoints(grid_points);
  vtkPointData& data = *grid->GetPointData();
  for (const GridArray& array : arrays) {
    const auto values = double_array(array.values.data(), array.values.rows(), array.values.cols());
    values->SetName(array.name.c_str());
    data.AddArray(values);
  }
  if (!arrays.empty()) {
    const std::string& first_name = arrays.front().name;
    // Viewers show the active array; for glyphs it must be set as vectors.
    if (arrays.front().values.cols() == 3)
      data.SetActiveVectors(first_name.c_str());
    else
      data.SetActiveScalars(first_name.c_str());
  }
  vtkNew<vtkXMLStructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetByteOrderToLittleEndian();
  writer->SetHeaderTypeToUInt64();
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOn();
  writer->SetCompressorTypeToNone();
  // On a full disk VTK reports success, so it only fills a string, and write_bytes() writes it.
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError)
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  write_bytes(path, writer->GetOutputString());
}

}  // namespace abbe::render
