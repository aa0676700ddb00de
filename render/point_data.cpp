#include "render/point_data.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string_view>

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
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkStringArray.h>
#include <vtkUnsignedCharArray.h>
#include <vtkXMLPolyDataWriter.h>

#include "render/bytes.h"
#include "render/poly_data.h"

namespace abbe::render {
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
  writer->EncodeAppendedDataOff();
  writer->SetCompressorTypeToZLib();
  writer->SetCompressionLevel(1);  // half the time of VTK's 5, and hardly larger
  // VTK calls it success when the disk is full, so it only fills a string and the file is written
  // here
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError) {
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  }
  write_bytes(path, writer->GetOutputString());
}

/// VTK writes names as they are, whatever XML makes of them.
std::string in_xml(std::string name) {
  for (char& c : name)
    if (static_cast<unsigned char>(c) < 0x20 ||
        std::string_view("\"'<>&").find(c) != std::string_view::npos)
      c = '_';
  return name.empty() ? "_" : name;
}

void add_facts(vtkPolyData& mesh, const Facts& facts) {
  for (const auto& [name, text] : facts) {
    vtkNew<vtkStringArray> array;
    array->SetName(in_xml(name).c_str());
    array->InsertNextValue(text);
    mesh.GetFieldData()->AddArray(array);
  }
}

/// The arrays under names that can be written.
std::vector<PointArray> checked(std::vector<PointArray> arrays, Eigen::Index count) {
  std::set<std::string> names;
  for (PointArray& one : arrays) {
    const std::size_t size =
        std::visit([](const auto& values) { return values.size(); }, one.values);
    if (size != static_cast<std::size_t>(count) * std::size_t(one.components))
      throw std::invalid_argument(fmt::format("point data: {} values each of {} are needed in {}",
                                              one.components, count, one.name));
    one.name = in_xml(one.name);
    if (!names.insert(one.name).second)
      throw std::invalid_argument(fmt::format("point data: two arrays are called {}", one.name));
  }
  return arrays;
}

}  // namespace

void write_point_data(const std::filesystem::path& path, const cutting::Points& vertices,
                      const cutting::Triangles& triangles, const std::vector<PointArray>& arrays,
                      const Facts& facts, const std::vector<PointArray>& of_triangles) {
  const std::vector<PointArray> named = checked(arrays, vertices.rows());
  const auto mesh = poly_data(vertices);
  mesh->SetPolys(cells(triangles.data(), triangles.rows(), 3));
  for (const PointArray& one : named)
    std::visit([&](const auto& values) { add(*mesh->GetPointData(), one, values); }, one.values);
  for (const PointArray& one : checked(of_triangles, triangles.rows()))
    std::visit([&](const auto& values) { add(*mesh->GetCellData(), one, values); }, one.values);
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

}  // namespace abbe::render
