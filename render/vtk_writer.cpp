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
  const auto fail = [&](int reason) {
    throw std::system_error(reason, std::generic_category(), path.string());
  };
  std::FILE* stream = std::fopen(path.c_str(), "wb");
  if (stream == nullptr) fail(errno);
  // fwrite() need not set errno, so an old value must not appear as the reason.
  errno = 0;
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size();
  const int reason = errno;
  // A full disk may only be reported when the buffer is flushed.
  const bool closed = std::fclose(stream) == 0;
  if (!written) fail(reason != 0 ? reason : EIO);
  if (!closed) fail(errno);
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
  // VTK stores the start of each cell and the end of the last.
  for (Eigen::Index i = 0; i <= count; ++i) offsets->SetValue(i, vtkTypeInt32(i * corners));
  std::copy(indices, indices + count * corners, connectivity->GetPointer(0));
  auto array = vtkSmartPointer<vtkCellArray>::New();
  array->SetData(offsets, connectivity);
  return array;
}

namespace {

template <class Array, class Data>
void add_array(vtkDataSetAttributes& to, const PointArray& named, const Data& data) {
  vtkNew<Array> array;
  array->SetName(named.name.c_str());
  array->SetNumberOfComponents(named.components);
  array->SetNumberOfValues(static_cast<vtkIdType>(data.size()));
  std::copy(data.begin(), data.end(), array->GetPointer(0));
  to.AddArray(array);
}

void add(vtkDataSetAttributes& to, const PointArray& named, std::span<const double> values) {
  add_array<vtkDoubleArray>(to, named, values);
}
void add(vtkDataSetAttributes& to, const PointArray& named, std::span<const float> values) {
  add_array<vtkFloatArray>(to, named, values);
}
void add(vtkDataSetAttributes& to, const PointArray& named, std::span<const std::uint8_t> values) {
  add_array<vtkUnsignedCharArray>(to, named, values);
}
void add(vtkDataSetAttributes& to, const PointArray& named, std::span<const int> values) {
  add_array<vtkIntArray>(to, named, values);
}

void write_poly_data(const std::filesystem::path& path, vtkPolyData& mesh) {
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(&mesh);
  writer->SetByteOrderToLittleEndian();
  writer->SetHeaderTypeToUInt64();
  writer->SetDataModeToAppended();
  // Raw bytes instead of base64 make the file smaller by a quarter.
  writer->EncodeAppendedDataOff();
  writer->SetCompressorTypeToZLib();
  writer->SetCompressionLevel(1);  // half the time of VTK's default 5, and hardly larger
  // VTK reports success on a full disk, so it only fills a string and the file is written here.
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError) {
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  }
  write_bytes(path, writer->GetOutputString());
}

/// Returns a name that is valid in XML; VTK writes names unescaped.
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

/// Returns the arrays with valid names. Throws if sizes do not match or names coincide.
std::vector<PointArray> checked(std::vector<PointArray> arrays, Eigen::Index count) {
  std::set<std::string> names;
  for (PointArray& one : arrays) {
    const std::size_t size =
        std::visit([](const auto& values) { return values.size(); }, one.values);
    // VTK itself would read past the end of a shorter array.
    if (size != static_cast<std::size_t>(count) * std::size_t(one.components))
      throw std::invalid_argument(fmt::format("point data: {} values each of {} are needed in {}",
                                              one.components, count, one.name));
    one.name = escape_xml(one.name);
    // Two names may become equal by the escape, and VTK would then replace one array by the other.
    if (!names.insert(one.name).second)
      throw std::invalid_argument(fmt::format("point data: two arrays are called {}", one.name));
  }
  return arrays;
}

}  // namespace

void write_point_data(const std::filesystem::path& path, const cutting::Points& vertices,
                      const cutting::Triangles& triangles, const std::vector<PointArray>& arrays,
                      const Facts& facts, const std::vector<PointArray>& triangle_arrays) {
  const std::vector<PointArray> named = checked(arrays, vertices.rows());
  const auto mesh = poly_data(vertices);
  mesh->SetPolys(cells(triangles.data(), triangles.rows(), 3));
  for (const PointArray& one : named)
    std::visit([&](const auto& values) { add(*mesh->GetPointData(), one, values); }, one.values);
  for (const PointArray& one : checked(triangle_arrays, triangles.rows()))
    std::visit([&](const auto& values) { add(*mesh->GetCellData(), one, values); }, one.values);
  // Viewers open the file coloured by the active scalars.
  if (!named.empty()) mesh->GetPointData()->SetActiveScalars(named.front().name.c_str());
  add_facts(*mesh, facts);
  write_poly_data(path, *mesh);
}

void write_point_data(const std::filesystem::path& path, const cutting::Design& design,
                      const std::vector<std::string>& names,
                      const std::vector<Eigen::VectorXd>& arrays) {
  if (names.size() != arrays.size())
    throw std::invalid_argument("point data: one name an array is needed");
  std::vector<PointArray> views;
  for (std::size_t i = 0; i < names.size(); ++i)
    views.push_back({names[i], std::span<const double>(arrays[i].data(), arrays[i].size())});
  write_point_data(path, design.vertices, design.triangles, views);
}

namespace {

void require_grid(bool good, const std::string& what) {
  if (!good) throw std::invalid_argument("structured grid: " + what);
}

void check(const cutting::Points& points, const std::array<int, 3>& size,
           const std::vector<GridArray>& arrays) {
  require_grid(size[0] > 0 && size[1] > 0 && size[2] > 0, "every size must be positive");
  require_grid(Eigen::Index(size[0]) * size[1] * size[2] == points.rows(),
               "sizes must say how many points there are");
  std::set<std::string> names;
  for (const GridArray& one : arrays) {
    require_grid(one.values.rows() == points.rows() && one.values.cols() > 0,
                 "one row a point is needed in " + one.name);
    require_grid(names.insert(one.name).second, "two arrays are called " + one.name);
    require_grid(!one.name.empty() && one.name.find_first_of("\"'<>&") == std::string::npos,
                 "a name that XML can hold is needed");
  }
}

vtkNew<vtkDoubleArray> array(const double* values, Eigen::Index rows, Eigen::Index columns) {
  vtkNew<vtkDoubleArray> result;
  result->SetNumberOfComponents(int(columns));
  result->SetNumberOfTuples(rows);
  std::copy(values, values + rows * columns, result->GetPointer(0));
  return result;
}

}  // namespace

void write_structured_grid(const std::filesystem::path& path, const cutting::Points& points,
                           const std::array<int, 3>& size, const std::vector<GridArray>& arrays) {
  check(points, size, arrays);
  vtkNew<vtkStructuredGrid> grid;
  grid->SetDimensions(size[0], size[1], size[2]);
  vtkNew<vtkPoints> places;
  places->SetData(array(points.data(), points.rows(), 3));
  grid->SetPoints(places);
  vtkPointData& data = *grid->GetPointData();
  for (const GridArray& one : arrays) {
    const auto values = array(one.values.data(), one.values.rows(), one.values.cols());
    values->SetName(one.name.c_str());
    data.AddArray(values);
  }
  if (!arrays.empty()) {
    const std::string& first = arrays.front().name;
    // Viewers select the active array, and glyphs need it to be marked as vectors.
    if (arrays.front().values.cols() == 3)
      data.SetActiveVectors(first.c_str());
    else
      data.SetActiveScalars(first.c_str());
  }
  vtkNew<vtkXMLStructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetByteOrderToLittleEndian();
  writer->SetHeaderTypeToUInt64();
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOn();
  writer->SetCompressorTypeToNone();
  // VTK reports success on a full disk, so it only fills a string and the file is written here.
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError)
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  write_bytes(path, writer->GetOutputString());
}

}  // namespace abbe::render
