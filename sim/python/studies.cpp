#include "sim/python/studies.h"

#include <map>
#include <optional>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "sim/calibration/identify.h"
#include "sim/commands/identify_command.h"
#include "sim/python/conversions.h"
#include "sim/report/identify_json.h"
#include "sim/study/run_study.h"

namespace py = pybind11;
using std::filesystem::path;

namespace abbe::python {
namespace {

using Method = sim::IdentifyOptions::Method;

Method method_of(const std::string& word) {
  const std::map<std::string, Method> all = {{"chain", Method::Chain},
                                             {"step_diagonal", Method::StepDiagonal},
                                             {"composite", Method::Composite},
                                             {"thermal", Method::Thermal}};
  const auto found = all.find(word);
  if (found == all.end())
    throw py::value_error("method: expected chain, step_diagonal, composite or thermal, seen \"" +
                          word + "\"");
  return found->second;
}

py::object identify(const std::vector<path>& readings, const std::string& method,
                    const std::optional<int>& order, bool choose_orders,
                    const std::map<std::string, double>& pitch,
                    const std::vector<std::string>& elements,
                    const std::vector<std::string>& sensors, const std::optional<path>& out,
                    const py::object& callback) {
  if (readings.empty()) throw py::value_error("readings: expected one file at least");
  sim::IdentifyOptions options;
  options.method = method_of(method);
  if (order) options.model.order = *order;
  options.choose_orders = choose_orders;
  for (const auto& [axis, mm] : pitch) {
    if (axis.size() != 1) throw py::value_error("pitch: expected axes such as {\"X\": 16}");
    options.model.pitch.insert({axis[0], mm});
  }
  options.model.only = elements;
  options.sensors = sensors;
  options.out = out.value_or("belief.toml");
  const sim::Progress report = progress(callback);
  std::optional<nlohmann::ordered_json> json;
  {
    const py::gil_scoped_release free;
    json = sim::to_json(out ? sim::identify(readings, options, report)
                            : sim::identified(readings, options, report));
  }
  return to_python(*json);
}

py::object study(const path& file, const path& out, const py::object& set, bool trust, bool force,
                 const py::object& callback) {
  sim::study::StudyOptions options;
  options.overrides = overrides(set);
  options.folder = out;
  options.permissions.trust = trust;
  options.permissions.force = force;
  options.progress = progress(callback);
  std::optional<sim::study::StudyResult> made;
  {
    const py::gil_scoped_release free;
    made = sim::study::run_study(scene_file(file), options, {});
  }
  return to_python(made->json);
}

}  // namespace

void define_studies(py::module_& module) {
  module.def("identify", identify, py::arg("readings"), py::kw_only(), py::arg("method") = "chain",
             py::arg("order") = py::none(), py::arg("choose_orders") = false,
             py::arg("pitch") = std::map<std::string, double>{},
             py::arg("elements") = std::vector<std::string>{},
             py::arg("sensors") = std::vector<std::string>{}, py::arg("out") = py::none(),
             py::arg("progress") = py::none(),
             "Finds the errors of a machine from files of readings, as `abbe identify` does, and "
             "writes the belief file `out` where one is named.");
  module.def("study", study, py::arg("study"), py::arg("out"), py::arg("set") = py::none(),
             py::kw_only(), py::arg("trust") = false, py::arg("force") = false,
             py::arg("progress") = py::none(),
             "Does what is left of a study into its folder, and returns its budget.");
}

}  // namespace abbe::python
