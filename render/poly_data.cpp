#include "render/poly_data.h"

#include <algorithm>

#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkTypeInt32Array.h>

namespace abbe::render {

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
  for (Eigen::Index i = 0; i <= count; ++i) offsets->SetValue(i, vtkTypeInt32(i * corners));
  std::copy(indices, indices + count * corners, connectivity->GetPointer(0));
  auto array = vtkSmartPointer<vtkCellArray>::New();
  array->SetData(offsets, connectivity);
  return array;
}

}  // namespace abbe::render
