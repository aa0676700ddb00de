#pragma once

#include <pybind11/pybind11.h>

namespace abbe::python {

/// Registers `identify` and `study`.
void define_studies(pybind11::module_& module);

}  // namespace abbe::python
