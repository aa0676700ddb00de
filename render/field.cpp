#include "render/field.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkUnsignedCharArray.h>
#include <vtkXMLPolyDataWriter.h>

#include "kinematics/units.h"
#include "render/bytes.h"

namespace abbe::render {
namespace {

void require(bool good, const char* what) {
  if (!good) throw std::invalid_argument(std::string("residual: ") + what);
}

void check_sizes(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  const auto count = static_cast<std::size_t>(n);
  require(field.deviation_um.size() == n, "one deviation a vertex is needed");
  require(field.cut_time_s.size() == n, "one cut time a vertex is needed");
  require(field.status.size() == count, "one status a vertex is needed");
  require(field.cut_line.size() == count, "one program line a vertex is needed");
}

template <class Array, class Data>
void add_point_data(vtkPolyData& mesh, const char* name, const Data& data) {
  vtkNew<Array> array;
  array->SetName(name);
  array->SetNumberOfValues(static_cast<vtkIdType>(data.size()));
  std::copy(data.data(), data.data() + data.size(), array->GetPointer(0));
  mesh.GetPointData()->AddArray(array);
}

void add_mesh(vtkPolyData& mesh, const cutting::Points& vertices, const cutting::Triangles& faces) {
  vtkNew<vtkDoubleArray> coordinates;
  coordinates->SetNumberOfComponents(3);
  coordinates->SetNumberOfTuples(vertices.rows());
  std::copy(vertices.data(), vertices.data() + vertices.size(), coordinates->GetPointer(0));
  vtkNew<vtkPoints> points;
  points->SetData(coordinates);
  mesh.SetPoints(points);

  const Eigen::Index m = faces.rows();
  vtkNew<vtkIdTypeArray> offsets;
  vtkNew<vtkIdTypeArray> connectivity;
  offsets->SetNumberOfValues(m + 1);
  connectivity->SetNumberOfValues(3 * m);
  for (Eigen::Index i = 0; i <= m; ++i) offsets->SetValue(i, 3 * i);
  std::copy(faces.data(), faces.data() + faces.size(), connectivity->GetPointer(0));
  vtkNew<vtkCellArray> triangles;
  triangles->SetData(offsets, connectivity);
  mesh.SetPolys(triangles);
}

void write_poly_data(const std::filesystem::path& path, vtkPolyData& mesh) {
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(&mesh);
  writer->SetByteOrderToLittleEndian();
  writer->SetHeaderTypeToUInt64();
  writer->SetIdTypeToInt64();
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOn();
  writer->SetCompressorTypeToNone();
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

}  // namespace

Field field(const cutting::Design& design, const cutting::Surface& surface) {
  Field result{design, surface.residual / units::um, {}, surface.cut_time_s, surface.cut_line};
  result.status.reserve(surface.status.size());
  for (const cutting::VertexStatus s : surface.status) {
    result.status.push_back(static_cast<std::uint8_t>(s));
  }
  check_sizes(result);
  return result;
}

void write_residual(const std::filesystem::path& path, const Field& field) {
  check_sizes(field);
  vtkNew<vtkPolyData> mesh;
  add_mesh(*mesh, field.design.vertices, field.design.triangles);
  add_point_data<vtkDoubleArray>(*mesh, "deviation_um", field.deviation_um);
  add_point_data<vtkUnsignedCharArray>(*mesh, "status", field.status);
  add_point_data<vtkDoubleArray>(*mesh, "cut_time_s", field.cut_time_s);
  add_point_data<vtkIntArray>(*mesh, "cut_line", field.cut_line);
  mesh->GetPointData()->SetActiveScalars("deviation_um");

  write_poly_data(path, *mesh);
}

void write_stock(const std::filesystem::path& path, const cutting::StockMesh& stock) {
  vtkNew<vtkPolyData> mesh;
  add_mesh(*mesh, stock.vertices_w, stock.triangles);
  std::vector<std::uint8_t> status;
  std::vector<int> line;
  for (const std::int32_t cut : stock.line) {
    status.push_back(cut > 0 ? 0 : (cut == 0 ? 1 : 2));
    line.push_back(std::abs(cut));
  }
  add_point_data<vtkUnsignedCharArray>(*mesh, "status", status);
  add_point_data<vtkIntArray>(*mesh, "cut_line", line);
  mesh->GetPointData()->SetActiveScalars("status");
  write_poly_data(path, *mesh);
}

void write_residual(const std::filesystem::path& path, const cutting::Design& design,
                    const cutting::Surface& surface) {
  write_residual(path, field(design, surface));
}

}  // namespace abbe::render
