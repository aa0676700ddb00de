#include "render/structured_grid.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkStructuredGrid.h>
#include <vtkXMLStructuredGridWriter.h>

#include "render/bytes.h"

namespace abbe::render {
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
  // VTK calls a full disk success, so it fills a string and the file is written here
  writer->WriteToOutputStringOn();
  if (writer->Write() == 0 || writer->GetErrorCode() != vtkErrorCode::NoError)
    throw std::runtime_error(
        fmt::format("{}: cannot be encoded: {}", path.string(),
                    vtkErrorCode::GetStringFromErrorCode(writer->GetErrorCode())));
  write_bytes(path, writer->GetOutputString());
}

}  // namespace abbe::render
