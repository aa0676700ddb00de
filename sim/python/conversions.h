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

/// Conversions between C++ and Python. Arrays are read-only NumPy views of the memory of a result.
/// They copy nothing and keep the owner of the memory alive.
namespace abbe::python {

/// Returns a read-only view of memory that `owner` keeps alive.
template <typename T>
pybind11::array view(const T* data, std::vector<pybind11::ssize_t> shape,
                     std::vector<pybind11::ssize_t> strides, pybind11::handle owner) {
  pybind11::array_t<T> array(std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(pybind11::arg("write") = false);
  return array;
}

/// Returns a view of a vector, (n).
template <typename T>
pybind11::array view(const std::vector<T>& values, pybind11::handle owner) {
  return view(values.data(), {pybind11::ssize_t(values.size())}, {sizeof(T)}, owner);
}

/// Returns a view of a column, or of a matrix in its storage order.
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

/// Returns a view of (n x 4 x 4) poses.
inline pybind11::array view(const std::vector<kinematics::Pose>& poses, pybind11::handle owner) {
  constexpr pybind11::ssize_t size = sizeof(double);
  const double* data = poses.empty() ? nullptr : poses.front().data();
  return view(data, {pybind11::ssize_t(poses.size()), 4, 4},
              {sizeof(kinematics::Pose), size, 4 * size}, owner);
}

// Conversion of arguments and results.

/// Converts a dict such as {"errors.scale": 2.0, "part.vertices": 20000}, or a list of such pairs,
/// to overrides, as `--set` does.
/// @throws pybind11::type_error for a value that TOML cannot represent
std::vector<sim::Override> overrides(const pybind11::object& set);

/// Converts a Python callback `progress(text, fraction)`, or None, to a progress function. A
/// negative fraction marks the text as a remark. Ctrl-C or an exception of the callback ends the
/// work.
sim::Progress progress(const pybind11::object& callback);

/// Converts JSON to Python dicts, lists, texts and numbers.
pybind11::object to_python(const nlohmann::ordered_json& json);

/// Returns the path of a scene, which may be named `library:NAME`.
std::filesystem::path scene_file(const std::filesystem::path& name);

/// Registers the exception classes of abbe.
void define_exceptions(pybind11::module_& module);

/// Returns a case whose compensator is a Python function: `function(task, batch)` returns (samples
/// x joints) corrections or (samples x 6) deviations.
/// @param answers  "correction" or "deviation"
/// @throws pybind11::value_error for any other value, or a function without a usable name
sim::CaseDescription compensator_case(const pybind11::function& function,
                                      const std::string& answers);

/// Registers Task, Joint and Batch.
void define_compensators(pybind11::module_& module);

}  // namespace abbe::python
