#pragma once

#include <memory>
#include <optional>
#include <string>

#include <pybind11/pybind11.h>

#include "sim/commands/scene_runs.h"

namespace abbe::python {

/// One case judged, with the job that it was cut of.
struct Result {
  std::shared_ptr<const sim::Job> job;
  std::shared_ptr<const sim::Verdict> verdict;
};

/// A case alone, as `abbe run` judges it.
Result judged(std::shared_ptr<const sim::Job> job, sim::Cut cut);

/// Registers Track, Result and Comparison.
void define_results(pybind11::module_& module);

/// A comparison as Python has it.
pybind11::object comparison_to_python(sim::CaseResults cases);

/// Registers Job, `prepare`, `pose` and `compare`.
void define_jobs(pybind11::module_& module);

/// Registers `identify` and `study`.
void define_studies(pybind11::module_& module);

}  // namespace abbe::python
