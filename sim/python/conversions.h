#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <nlohmann/json_fwd.hpp>

#include "kinematics/chain.h"
#include "sim/files/progress.h"
#include "sim/scene/cases.h"
#include "sim/scene/document.h"

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

// What Python says in words of abbe, and back.

/// {"errors.scale": 2.0, "part.vertices": 20000}, or a list of such pairs, as `--set` has them.
/// @throws pybind11::type_error for a value that TOML has not
std::vector<sim::Override> overrides(const pybind11::object& set);

/// A callback `progress(text, fraction)`, below zero a remark, or None. In either case Ctrl-C ends
/// the work, and what the callback raises does.
sim::Progress progress(const pybind11::object& callback);

/// A dict of dicts, lists and numbers.
pybind11::object to_python(const nlohmann::ordered_json& json);

/// The file that a name means, which may be one of the library.
std::filesystem::path scene_file(const std::filesystem::path& name);

/// Registers what abbe throws.
void define_exceptions(pybind11::module_& module);

/// A case that Python computes: `function(task, batch)` returns (samples x joints) corrections, or
/// (samples x 6) deviations.
/// @param answers  "correction" or "deviation"
/// @throws pybind11::value_error for another word, or a function without a usable name
sim::CaseDescription compensator_case(const pybind11::function& function,
                                      const std::string& answers);

/// Registers Task, Joint and Batch.
void define_compensators(pybind11::module_& module);

}  // namespace abbe::python
