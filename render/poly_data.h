#pragma once

#include "cutting/mesh.h"

class vtkCellArray;
class vtkPolyData;
template <class T>
class vtkSmartPointer;

namespace abbe::render {

/// VTK's data of points alone, in double precision.
vtkSmartPointer<vtkPolyData> poly_data(const cutting::Points& points);

/// Cells of equal size from row-major indices, in 32-bit numbers.
vtkSmartPointer<vtkCellArray> cells(const int* indices, Eigen::Index count, int corners);

}  // namespace abbe::render
