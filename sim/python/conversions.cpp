#include "sim/python/conversions.h"

#include <chrono>
#include <memory>
#include <mutex>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <nlohmann/json.hpp>

#include "sim/compensation/plug_in.h"
#include "sim/cut/collision_events.h"
#include "sim/files/output.h"
#include "sim/scene/cases.h"
#include "sim/scene/library.h"
#include "sim/scene/toml.h"

namespace py = pybind11;

namespace abbe::python {

namespace {

std::string to_toml(const py::handle& value) {
  // In Python bool is a subclass of int, so it is tested first.
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value)) return sim::to_toml_value(value.cast<std::string>());
  if (py::isinstance<py::int_>(value)) return py::str(value);
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    std::string text = "[";
    for (const py::handle element : value) text += (text.size() > 1 ? ", " : "") + to_toml(element);
    return text + "]";
  }
  if (py::hasattr(value, "__float__")) return sim::to_toml_value(value.cast<double>());
  throw py::type_error(fmt::format("expected a number, string, bool or list, seen {}",
                                   std::string(py::str(py::type::of(value)))));
}

/// Returns a shared pointer to a callback. Its deleter acquires the GIL, because the last owner may
/// be a thread without it.
std::shared_ptr<py::object> share_with_gil(const py::object& callback) {
  return {new py::object(callback), [](py::object* pointer) {
            const py::gil_scoped_acquire lock;
            delete pointer;
          }};
}

/// Passes reports to the callback, from one thread at a time and at most 20 times a second.
struct Reporter {
  std::shared_ptr<py::object> callback;
  std::mutex mutex;
  std::string stage;
  std::chrono::steady_clock::time_point last_report{};  // time of the last report

  void report(const std::string& text, double fraction) {
    constexpr std::chrono::milliseconds min_report_interval(50);
    // If another thread is reporting, the report is dropped. A thread that waited here could hold
    // the GIL for which the other one waits.
    const std::unique_lock lock(mutex, std::try_to_lock);
    if (!lock) return;
    const auto now = std::chrono::steady_clock::now();
    // A new stage is always reported, further progress of a stage only after the interval.
    if (fraction >= 0.0 && text == stage && now - last_report < min_report_interval) return;
    if (fraction >= 0.0) stage = text;
    last_report = now;
    const py::gil_scoped_acquire python;
    // Ctrl-C only sets a flag in Python, which long work must check.
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!callback->is_none()) (*callback)(text, fraction);
  }
};

/// Adds an exception class to the module. Like those of pybind11 it outlives the interpreter.
PyObject* add_exception_class(py::module_& module, const char* name, PyObject* base,
                              const char* text) {
  PyObject* exception_class =
      PyErr_NewExceptionWithDoc((std::string("abbe.") + name).c_str(), text, base, nullptr);
  module.add_object(name, exception_class);
  return exception_class;
}

PyObject *bad_input = nullptr, *bad_scene = nullptr, *output_failure = nullptr,
         *plug_in_failure = nullptr, *collision_stop = nullptr;

py::object make_exception(const BadInput& error) {
  py::object exception = py::handle(bad_input)(error.what());
  exception.attr("file") = error.file;
  exception.attr("line") = error.line;
  exception.attr("column") = error.column;
  exception.attr("expected") = error.expected;
  exception.attr("seen") = error.seen;
  return exception;
}

void translate(std::exception_ptr exception) {
  try {
    if (exception) std::rethrow_exception(exception);
    // Derived classes come first, because the first matching handler is used.
  } catch (const sim::BadScene& input_errors) {
    py::object python_exception = py::handle(bad_scene)(input_errors.what());
    py::list input_error_list;
    for (const BadInput& error : input_errors.input_errors)
      input_error_list.append(make_exception(error));
    python_exception.attr("faults") = input_error_list;
    for (const char* key : {"file", "line", "column", "expected", "seen"})
      python_exception.attr(key) = input_error_list[0].attr(key);
    PyErr_SetObject(bad_scene, python_exception.ptr());
  } catch (const BadInput& error) {
    PyErr_SetObject(bad_input, make_exception(error).ptr());
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
  std::vector<sim::Override> result;
  if (set.is_none()) return result;
  const py::object pairs = py::isinstance<py::dict>(set) ? set.attr("items")() : set;
  for (const py::handle pair : pairs) {
    // A string of two letters is a sequence of length 2 too.
    if (!py::isinstance<py::sequence>(pair) || py::isinstance<py::str>(pair) || py::len(pair) != 2)
      throw py::type_error("set: expected a dict, or pairs such as (\"errors.scale\", 2), seen " +
                           std::string(py::repr(pair)));
    const auto [path, value] = pair.cast<std::pair<std::string, py::object>>();
    result.push_back({path, to_toml(value)});
  }
  return result;
}

sim::Progress progress(const py::object& callback) {
  auto reporter = std::make_shared<Reporter>();
  reporter->callback = share_with_gil(callback);
  return [reporter](const std::string& text, double fraction) { reporter->report(text, fraction); };
}

py::object to_python(const nlohmann::ordered_json& json) {
  // Converted as text, so that the objects equal those read from a file by json.load.
  return py::module_::import("json").attr("loads")(sim::json_text(json));
}

std::filesystem::path scene_file(const std::filesystem::path& name) {
  return name.string().starts_with(sim::library_prefix) ? sim::library_file(name) : name;
}

void define_exceptions(py::module_& module) {
  bad_input = add_exception_class(module, "BadInput", PyExc_ValueError,
                                  "An input error: file, line, column, expected, seen.");
  bad_scene = add_exception_class(
      module, "BadScene", bad_input,
      "All input errors of a scene, in faults; the attributes of BadInput describe the first.");
  output_failure =
      add_exception_class(module, "OutputFailure", PyExc_OSError, "A file could not be written.");
  plug_in_failure = add_exception_class(module, "PlugInFailure", PyExc_RuntimeError,
                                        "A compensator failed or did not respond.");
  collision_stop = add_exception_class(module, "CollisionStop", PyExc_RuntimeError,
                                       "Bodies collide, and the scene stops at collisions.");
  py::register_exception_translator(translate);
}

namespace {

using sim::compensation::PlugInBatch;
using sim::compensation::PlugInFunction;
using sim::compensation::PlugInTask;

Eigen::MatrixXd call_function(const py::function& function, const PlugInTask& task,
                              const PlugInBatch& batch) {
  // Copies are passed, because Python may keep them.
  const py::object returned =
      function(std::make_shared<PlugInTask>(task), std::make_shared<PlugInBatch>(batch));
  using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;
  const Rows rows = Rows::ensure(returned);
  if (!rows) throw py::error_already_set();
  if (rows.ndim() != 2)
    throw py::value_error("expected an array with one row per sample, seen one of " +
                          std::to_string(rows.ndim()) + " dimensions");
  return Eigen::Map<const PlugInBatch::Rows>(rows.data(), rows.shape(0), rows.shape(1));
}

const char* motion_name(kinematics::Motion motion) {
  return motion == kinematics::Motion::Linear   ? "linear"
         : motion == kinematics::Motion::Rotary ? "rotary"
                                                : "spindle";
}

}  // namespace

sim::CaseDescription compensator_case(const py::function& function, const std::string& answers) {
  using sim::compensation::PlugInOutput;
  if (answers != "correction" && answers != "deviation")
    throw py::value_error("answers: expected \"correction\" or \"deviation\", seen \"" + answers +
                          "\"");
  const std::string name = py::hasattr(function, "__name__")
                               ? function.attr("__name__").cast<std::string>()
                               : std::string(py::str(py::type::of(function).attr("__name__")));
  sim::CaseDescription description = sim::plug_in_case(name == "<lambda>" ? "lambda" : name);
  description.plug_in = description.name;  // a function has no file
  // The deleter acquires the GIL, because the last owner may be a thread without it.
  const std::shared_ptr<py::function> shared_function(new py::function(function),
                                                      [](py::function* pointer) {
                                                        const py::gil_scoped_acquire lock;
                                                        delete pointer;
                                                      });
  description.function = std::make_shared<const PlugInFunction>(
      PlugInFunction{answers == "correction" ? PlugInOutput::Correction : PlugInOutput::Deviation,
                     [shared_function](const PlugInTask& task, const PlugInBatch& batch) {
                       const py::gil_scoped_acquire lock;
                       return call_function(*shared_function, task, batch);
                     }});
  return description;
}

void define_compensators(py::module_& module) {
  using kinematics::Joint;
  py::class_<Joint>(module, "Joint",
                    "A joint of the machine in the bed frame, with all axes at zero.")
      .def_property_readonly("name", [](const Joint& j) { return std::string(1, j.name); })
      .def_property_readonly("side",
                             [](const Joint& j) {
                               return j.side == kinematics::Side::Workpiece ? "workpiece" : "tool";
                             })
      .def_property_readonly("motion", [](const Joint& j) { return motion_name(j.motion); })
      .def_property_readonly(
          "direction",
          [](const py::object& self) { return view(self.cast<const Joint&>().direction_b, self); })
      .def_property_readonly(
          "point",
          [](const py::object& self) { return view(self.cast<const Joint&>().point_b, self); })
      .def_readonly("min", &Joint::min, "mm or rad, limit of travel")
      .def_readonly("max", &Joint::max);
  using Task = std::shared_ptr<PlugInTask>;
  py::class_<PlugInTask, Task>(module, "Task", "The machine, and the signals its control can read.")
      .def_readonly("structure", &PlugInTask::structure)
      .def_readonly("joints", &PlugInTask::joints)
      .def_readonly("tool", &PlugInTask::tool)
      .def_readonly("tool_length", &PlugInTask::tool_length, "mm")
      .def_property_readonly(
          "readings", [](const PlugInTask& t) { return t.log.names; },
          "names with their units, the columns of log and of Batch.readings")
      .def_property_readonly("log_time_s",
                             [](const py::object& self) {
                               return view(self.cast<const PlugInTask&>().log.time_s, self);
                             })
      .def_property_readonly("log", [](const py::object& self) {
        return view(self.cast<const PlugInTask&>().log.values, self);
      });
  const auto column = [](Eigen::VectorXd PlugInBatch::*member) {
    return [member](const py::object& self) {
      return view(self.cast<const PlugInBatch&>().*member, self);
    };
  };
  const auto rows = [](PlugInBatch::Rows PlugInBatch::*member) {
    return [member](const py::object& self) {
      return view(self.cast<const PlugInBatch&>().*member, self);
    };
  };
  py::class_<PlugInBatch, std::shared_ptr<PlugInBatch>>(module, "Batch",
                                                        "Samples in chronological order.")
      .def("__len__", [](const PlugInBatch& b) { return b.time_s.size(); })
      .def_property_readonly("time_s", column(&PlugInBatch::time_s))
      .def_property_readonly("q", rows(&PlugInBatch::q), "(n, joints) commands, mm and rad")
      .def_property_readonly("direction", rows(&PlugInBatch::direction),
                             "(n, joints) +1 up, -1 down, 0 not moved yet")
      .def_property_readonly("spindle_rpm", column(&PlugInBatch::spindle_rpm))
      .def_property_readonly(
          "T_wt",
          [](const py::object& self) {
            const auto& T = self.cast<const PlugInBatch&>().T_wt;
            constexpr py::ssize_t size = sizeof(double);
            // A view of rows of 12 numbers as 3 x 4 matrices, without a copy.
            return view(T.data(), {T.rows(), 3, 4}, {12 * size, 4 * size, size}, self);
          },
          "(n, 3, 4) nominal pose of the tool: tip [:, :, 3], axis [:, :, 2]")
      .def_property_readonly("readings", rows(&PlugInBatch::readings), "(n, readings)");
}

}  // namespace abbe::python
