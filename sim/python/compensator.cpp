#include "sim/python/compensator.h"

#include <memory>

#include <pybind11/stl.h>

#include "sim/python/arrays.h"
#include "sim/scene/case_name.h"

namespace py = pybind11;

namespace abbe::python {
namespace {

using sim::compensation::PlugInBatch;
using sim::compensation::PlugInFunction;
using sim::compensation::PlugInTask;

Eigen::MatrixXd answer(const py::function& function, const PlugInTask& task,
                       const PlugInBatch& batch) {
  // copies, since Python may keep what it is given
  const py::object answered =
      function(std::make_shared<PlugInTask>(task), std::make_shared<PlugInBatch>(batch));
  using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;
  const Rows rows = Rows::ensure(answered);
  if (!rows) throw py::error_already_set();
  if (rows.ndim() != 2)
    throw py::value_error("expected an array with a row a sample, seen one of " +
                          std::to_string(rows.ndim()) + " dimensions");
  return Eigen::Map<const PlugInBatch::Rows>(rows.data(), rows.shape(0), rows.shape(1));
}

const char* word(kinematics::Motion motion) {
  return motion == kinematics::Motion::Linear   ? "linear"
         : motion == kinematics::Motion::Rotary ? "rotary"
                                                : "spindle";
}

}  // namespace

sim::CaseDescription case_of(const py::function& function, const std::string& answers) {
  using sim::compensation::Answers;
  if (answers != "correction" && answers != "deviation")
    throw py::value_error("answers: expected \"correction\" or \"deviation\", seen \"" + answers +
                          "\"");
  const std::string name = py::hasattr(function, "__name__")
                               ? function.attr("__name__").cast<std::string>()
                               : std::string(py::str(py::type::of(function).attr("__name__")));
  sim::CaseDescription description = sim::plug_in_case(name == "<lambda>" ? "lambda" : name);
  description.plug_in = description.name;  // there is no file
  const std::shared_ptr<py::function> held(new py::function(function), [](py::function* one) {
    const py::gil_scoped_acquire lock;
    delete one;
  });
  description.function = std::make_shared<const PlugInFunction>(
      PlugInFunction{answers == "correction" ? Answers::Correction : Answers::Deviation,
                     [held](const PlugInTask& task, const PlugInBatch& batch) {
                       const py::gil_scoped_acquire lock;
                       return answer(*held, task, batch);
                     }});
  return description;
}

void define_compensators(py::module_& module) {
  using kinematics::Joint;
  py::class_<Joint>(module, "Joint", "A joint of the machine in the bed frame, all axes at zero.")
      .def_property_readonly("name", [](const Joint& j) { return std::string(1, j.name); })
      .def_property_readonly("side",
                             [](const Joint& j) {
                               return j.side == kinematics::Side::Workpiece ? "workpiece" : "tool";
                             })
      .def_property_readonly("motion", [](const Joint& j) { return word(j.motion); })
      .def_property_readonly(
          "direction",
          [](const py::object& self) { return view(self.cast<const Joint&>().direction_b, self); })
      .def_property_readonly(
          "point",
          [](const py::object& self) { return view(self.cast<const Joint&>().point_b, self); })
      .def_readonly("min", &Joint::min, "mm or rad, of the travel")
      .def_readonly("max", &Joint::max);
  using Task = std::shared_ptr<PlugInTask>;
  py::class_<PlugInTask, Task>(module, "Task", "The machine, and what its control could read.")
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
                                                        "Some samples in the order of time.")
      .def("__len__", [](const PlugInBatch& b) { return b.time_s.size(); })
      .def_property_readonly("time_s", column(&PlugInBatch::time_s))
      .def_property_readonly("q", rows(&PlugInBatch::q), "(n, joints) commands, mm and rad")
      .def_property_readonly("direction", rows(&PlugInBatch::direction),
                             "(n, joints) +1 up, -1 down, 0 has not moved yet")
      .def_property_readonly("spindle_rpm", column(&PlugInBatch::spindle_rpm))
      .def_property_readonly(
          "T_wt",
          [](const py::object& self) {
            const auto& T = self.cast<const PlugInBatch&>().T_wt;
            constexpr py::ssize_t size = sizeof(double);
            return view(T.data(), {T.rows(), 3, 4}, {12 * size, 4 * size, size}, self);
          },
          "(n, 3, 4) where the tool should be: tip [:, :, 3], axis [:, :, 2]")
      .def_property_readonly("readings", rows(&PlugInBatch::readings), "(n, readings)");
}

}  // namespace abbe::python
