#include <filesystem>
#include <memory>
#include <optional>

#include <dlfcn.h>

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <tbb/global_control.h>

#include "sim/commands/shell_files.h"
#include "sim/cut/scene_checks.h"
#include "sim/files/program_file.h"
#include "sim/python/conversions.h"
#include "sim/python/jobs.h"

namespace py = pybind11;

namespace abbe::python {
namespace {

/// Finds the executable that belongs to this module: next to it in a build, otherwise at its
/// installed path. The executable runs plug-ins in shared libraries. Does nothing if there is none;
/// plug-ins in shared libraries then fail.
void find_executable() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&find_executable), &info) == 0) return;
  std::error_code failure;
  const auto folder = std::filesystem::canonical(info.dli_fname, failure).parent_path();
  for (const auto& file : {folder / "abbe", folder / ABBE_PROGRAM_FROM_MODULE})
    if (std::filesystem::is_regular_file(file, failure))
      return sim::name_program_file(std::filesystem::canonical(file));
}

/// Limits the number of threads and the memory (GB) of all later jobs; None leaves a limit
/// unchanged.
void limit(const std::optional<int>& threads, const std::optional<double>& memory_gb) {
  using tbb::global_control;
  // The limit lasts as long as this object.
  static std::unique_ptr<global_control> thread_limit;
  if (threads && *threads < 1) throw py::value_error("threads: expected at least 1");
  if (memory_gb && !(*memory_gb > 0.0))
    throw py::value_error("memory_gb: expected a number greater than 0");
  if (threads)
    thread_limit = std::make_unique<global_control>(global_control::max_allowed_parallelism,
                                                    std::size_t(*threads));
  if (memory_gb) sim::limit_memory(*memory_gb * 1e9);
}

}  // namespace

PYBIND11_MODULE(abbe, module) {
  find_executable();
  module.doc() =
      "A virtual five-axis machine tool that is wrong on purpose.\n\njob = "
      "abbe.prepare(\"scenes/gantry_dome.toml\")\nresult = "
      "job.cut(\"perfect-iterated-ideal\")\nresult.residual_mm, result.figures\n\nLengths are mm, "
      "angles rad, times s, unless a name says otherwise. Arrays are read-only views of the memory "
      "of abbe.";
  module.attr("__version__") = sim::version();
  define_exceptions(module);
  define_compensators(module);
  define_results(module);
  define_jobs(module);
  define_studies(module);
  module.def("limit", limit, py::kw_only(), py::arg("threads") = py::none(),
             py::arg("memory_gb") = py::none(), "Same as the options --threads and --memory-gb.");
}

}  // namespace abbe::python
