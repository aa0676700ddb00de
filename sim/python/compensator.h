#pragma once

#include <string>

#include <pybind11/pybind11.h>

#include "sim/scene/case_description.h"

namespace abbe::python {

/// A case that Python computes: `function(task, batch)` returns (samples x joints) corrections, or
/// (samples x 6) deviations.
/// @param answers  "correction" or "deviation"
/// @throws pybind11::value_error for another word, or a function without a usable name
sim::CaseDescription case_of(const pybind11::function& function, const std::string& answers);

/// Registers Task, Joint and Batch.
void define_compensators(pybind11::module_& module);

}  // namespace abbe::python
