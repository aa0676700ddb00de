#pragma once

#include <cstdint>
#include <vector>

#include <pybind11/numpy.h>

#include "kinematics/chain.h"

/// Arrays of NumPy that look at the memory of a result: nothing is copied, nothing can be written,
/// and the owner lives as long as they do.
namespace abbe::python {

template <typename T>
pybind11::array view(const T* data, std::vector<pybind11::ssize_t> shape,
                     std::vector<pybind11::ssize_t> strides, pybind11::handle owner) {
  pybind11::array_t<T> array(std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(pybind11::arg("write") = false);
  return array;
}

/// (n) numbers.
template <typename T>
pybind11::array view(const std::vector<T>& values, pybind11::handle owner) {
  return view(values.data(), {pybind11::ssize_t(values.size())}, {sizeof(T)}, owner);
}

/// A column, or a matrix in the order in which it is stored.
template <typename Matrix>
requires requires(const Matrix& m) { m.innerStride(); }
pybind11::array view(const Matrix& matrix, pybind11::handle owner) {
  using Scalar = typename Matrix::Scalar;
  constexpr pybind11::ssize_t size = sizeof(Scalar);
  if constexpr (Matrix::ColsAtCompileTime == 1)
    return view(matrix.data(), {matrix.size()}, {size}, owner);
  else
    return view(matrix.data(), {matrix.rows(), matrix.cols()},
                {size * (Matrix::IsRowMajor ? matrix.outerStride() : matrix.innerStride()),
                 size * (Matrix::IsRowMajor ? matrix.innerStride() : matrix.outerStride())},
                owner);
}

/// (n x 4 x 4) poses.
inline pybind11::array view(const std::vector<kinematics::Pose>& poses, pybind11::handle owner) {
  constexpr pybind11::ssize_t size = sizeof(double);
  const double* data = poses.empty() ? nullptr : poses.front().data();
  return view(data, {pybind11::ssize_t(poses.size()), 4, 4},
              {sizeof(kinematics::Pose), size, 4 * size}, owner);
}

}  // namespace abbe::python
