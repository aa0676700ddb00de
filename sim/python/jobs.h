#pragma once

#include <memory>
#include <optional>
#include <string>

#include <pybind11/pybind11.h>

#include "sim/commands/scene_runs.h"

/// The classes and functions of the module.
namespace abbe::python {

/// A judged case and its job.
struct Result {
  std::shared_ptr<const sim::Job> job;
  std::shared_ptr<const sim::Verdict> verdict;
};

/// Judges a single case, as `abbe run` does.
Result judge_cut(std::shared_ptr<const sim::Job> job, sim::Cut cut);

/// Registers Track, Result and Comparison.
void define_results(pybind11::module_& module);

/// Returns a comparison as a Python object.
pybind11::object comparison_to_python(sim::CaseResults cases);

/// Registers Job, `prepare`, `pose` and `compare`.
void define_jobs(pybind11::module_& module);

/// Registers `identify` and `study`.
void define_studies(pybind11::module_& module);

}  // namespace abbe::python
