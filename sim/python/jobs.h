#pragma once

#include <pybind11/pybind11.h>

namespace abbe::python {

/// Registers Job, `prepare`, `pose` and `compare`.
void define_jobs(pybind11::module_& module);

}  // namespace abbe::python
