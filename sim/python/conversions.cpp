#include "sim/python/conversions.h"

#include <chrono>
#include <memory>
#include <mutex>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <nlohmann/json.hpp>

#include "sim/compensation/plug_in_task.h"
#include "sim/cut/collision_events.h"
#include "sim/files/output.h"
#include "sim/scene/bad_scene.h"
#include "sim/scene/library.h"
#include "sim/scene/toml_text.h"

namespace py = pybind11;

namespace abbe::python {
namespace {

std::string toml(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value)) return sim::to_toml_value(value.cast<std::string>());
  if (py::isinstance<py::int_>(value)) return py::str(value);
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    std::string text = "[";
    for (const py::handle one : value) text += (text.size() > 1 ? ", " : "") + toml(one);
    return text + "]";
  }
  if (py::hasattr(value, "__float__")) return sim::to_toml_value(value.cast<double>());
  throw py::type_error(fmt::format("expected a number, text, bool or list, seen {}",
                                   std::string(py::str(py::type::of(value)))));
}

/// A callback that is let go of with Python's lock held, whoever does it last.
std::shared_ptr<py::object> shared(const py::object& callback) {
  return {new py::object(callback), [](py::object* held) {
            const py::gil_scoped_acquire lock;
            delete held;
          }};
}

/// What one thread at a time reports, and not more often than anybody can read.
struct Reporter {
  std::shared_ptr<py::object> callback;
  std::mutex mutex;
  std::string stage;
  std::chrono::steady_clock::time_point said{};

  void report(const std::string& text, double fraction) {
    constexpr std::chrono::milliseconds least_between(50);
    // who waited here for Python's lock could hold up the thread that has it
    const std::unique_lock lock(mutex, std::try_to_lock);
    if (!lock) return;
    const auto now = std::chrono::steady_clock::now();
    if (fraction >= 0.0 && text == stage && now - said < least_between) return;
    if (fraction >= 0.0) stage = text;
    said = now;
    const py::gil_scoped_acquire python;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!callback->is_none()) (*callback)(text, fraction);
  }
};

/// An exception of Python whose class outlives the interpreter, as pybind11's own do.
PyObject* new_class(py::module_& module, const char* name, PyObject* base, const char* text) {
  PyObject* made =
      PyErr_NewExceptionWithDoc((std::string("abbe.") + name).c_str(), text, base, nullptr);
  module.add_object(name, made);
  return made;
}

PyObject *bad_input = nullptr, *bad_scene = nullptr, *output_failure = nullptr,
         *plug_in_failure = nullptr, *collision_stop = nullptr;

py::object exception_of(const BadInput& fault) {
  py::object made = py::handle(bad_input)(fault.what());
  made.attr("file") = fault.file;
  made.attr("line") = fault.line;
  made.attr("column") = fault.column;
  made.attr("expected") = fault.expected;
  made.attr("seen") = fault.seen;
  return made;
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const sim::BadScene& faults) {
    py::object made = py::handle(bad_scene)(faults.what());
    py::list all;
    for (const BadInput& fault : faults.faults) all.append(exception_of(fault));
    made.attr("faults") = all;
    for (const char* key : {"file", "line", "column", "expected", "seen"})
      made.attr(key) = all[0].attr(key);
    PyErr_SetObject(bad_scene, made.ptr());
  } catch (const BadInput& fault) {
    PyErr_SetObject(bad_input, exception_of(fault).ptr());
  } catch (const sim::OutputFailure& failure) {
    PyErr_SetString(output_failure, failure.what());
  } catch (const sim::compensation::PlugInFailure& failure) {
    PyErr_SetString(plug_in_failure, failure.what());
  } catch (const sim::CollisionStop& stop) {
    PyErr_SetString(collision_stop, stop.what());
  } catch (const sim::Interrupted&) {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  }
}

}  // namespace

std::vector<sim::Override> overrides(const py::object& set) {
  std::vector<sim::Override> all;
  if (set.is_none()) return all;
  const py::object pairs = py::isinstance<py::dict>(set) ? set.attr("items")() : set;
  for (const py::handle pair : pairs) {
    if (!py::isinstance<py::sequence>(pair) || py::isinstance<py::str>(pair) || py::len(pair) != 2)
      throw py::type_error("set: expected a dict, or pairs such as (\"errors.scale\", 2), seen " +
                           std::string(py::repr(pair)));
    const auto [path, value] = pair.cast<std::pair<std::string, py::object>>();
    all.push_back({path, toml(value)});
  }
  return all;
}

sim::Progress progress(const py::object& callback) {
  auto reporter = std::make_shared<Reporter>();
  reporter->callback = shared(callback);
  return [reporter](const std::string& text, double fraction) { reporter->report(text, fraction); };
}

py::object to_python(const nlohmann::ordered_json& json) {
  return py::module_::import("json").attr("loads")(sim::json_text(json));
}

std::filesystem::path scene_file(const std::filesystem::path& name) {
  return name.string().starts_with(sim::library_prefix) ? sim::library_file(name) : name;
}

void define_exceptions(py::module_& module) {
  bad_input = new_class(module, "BadInput", PyExc_ValueError,
                        "What came from outside is refused: file, line, column, expected, seen.");
  bad_scene = new_class(module, "BadScene", bad_input,
                        "All faults of a scene at once, in faults; the first of them as BadInput.");
  output_failure = new_class(module, "OutputFailure", PyExc_OSError, "A file was not written.");
  plug_in_failure =
      new_class(module, "PlugInFailure", PyExc_RuntimeError, "A compensator did not answer.");
  collision_stop = new_class(module, "CollisionStop", PyExc_RuntimeError,
                             "Bodies touch, and the scene stops there.");
  py::register_exception_translator(translate);
}

}  // namespace abbe::python
