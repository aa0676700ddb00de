#include "sim/python/jobs.h"

#include <memory>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "kinematics/letters.h"
#include "sim/commands/compare.h"
#include "sim/cut/pose.h"
#include "sim/loop/compensate.h"
#include "sim/python/arrays.h"
#include "sim/python/compensator.h"
#include "sim/python/conversions.h"
#include "sim/python/results.h"
#include "sim/scene/case_name.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace py = pybind11;

namespace abbe::python {
namespace {

using sim::Job;
using sim::Keep;

/// A job and what was changed in its scene, for machines with other errors.
struct Prepared {
  std::shared_ptr<Job> job;  ///< read alone, but for the plug-ins that are typed and so trusted
  std::vector<sim::Override> overrides;
};
using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;

sim::RunOptions options_of(const py::object& set, bool trust, const py::object& callback) {
  sim::RunOptions options;
  options.overrides = overrides(set);
  options.permissions.trust = trust;
  options.progress = progress(callback);
  return options;
}

Prepared prepare(const std::filesystem::path& scene, const py::object& set, bool trust,
                 const py::object& callback) {
  const sim::RunOptions options = options_of(set, trust, callback);
  const py::gil_scoped_release free;
  return {std::make_shared<Job>(sim::job_of(scene_file(scene), options)), options.overrides};
}

Prepared with_errors(const Prepared& prepared, const py::object& set) {
  std::vector<sim::Override> all = prepared.overrides;
  for (sim::Override& one : overrides(set)) {
    std::erase_if(all, [&](const sim::Override& old) { return old.path == one.path; });
    all.push_back(std::move(one));
  }
  const py::gil_scoped_release free;
  const Job& job = *prepared.job;
  sim::Scene scene = sim::read_scene(job.scene.file, all);
  scene.trusted = job.scene.trusted;
  return {std::make_shared<Job>(sim::with_errors(job, scene)), std::move(all)};
}

Result cut(const Prepared& prepared, const py::object& which, const std::string& answers,
           bool track, const py::object& callback) {
  const std::shared_ptr<Job>& job = prepared.job;
  const Keep keep = track ? Keep::Track : Keep::Map;
  const sim::Progress report = progress(callback);
  std::optional<sim::CaseDescription> compensator;
  bool error_free = false;
  if (py::isinstance<py::function>(which) || PyCallable_Check(which.ptr()) != 0) {
    compensator = case_of(py::reinterpret_borrow<py::function>(which), answers);
  } else {
    const std::string name = py::str(which);
    error_free = name == "error_free";
    if (!error_free && name != "uncompensated") compensator = sim::parse_case(name);
    if (compensator) sim::trust(job->scene, *compensator);
  }
  const py::gil_scoped_release free;
  if (error_free) return judged(job, sim::cut_error_free(*job, report, keep));
  return judged(job, sim::cut(*job, compensator, report, keep));
}

/// (n x axes) positions of an array, or of one row.
Rows positions(const Rows& q, Eigen::Index axes) {
  if (q.ndim() == 1 && q.shape(0) == axes) return Rows(q.attr("reshape")(1, axes));
  if (q.ndim() != 2 || q.shape(1) != axes)
    throw py::value_error("q: expected (n, " + std::to_string(axes) + ") positions, mm and rad");
  return q;
}

struct Poses {
  std::vector<kinematics::Pose> nominal, actual;
};

py::tuple poses(const std::filesystem::path& file, const Rows& given, const py::object& set,
                double time_s) {
  const std::vector<sim::Override> all = overrides(set);
  std::unique_ptr<const sim::IdleMachine> idle;
  {
    const py::gil_scoped_release free;
    idle = std::make_unique<const sim::IdleMachine>(
        sim::idle_machine(sim::read_scene(scene_file(file), all)));
  }
  const Rows q = positions(given, idle->machine.nominal.size());
  auto made = std::make_unique<Poses>();
  {
    const py::gil_scoped_release free;
    for (py::ssize_t i = 0; i < q.shape(0); ++i) {
      kinematics::AxisState state;
      state.q = Eigen::Map<const Eigen::VectorXd>(q.data(i, 0), q.shape(1));
      state.time_s = time_s;
      const sim::TipPose pose = sim::tip_pose(*idle, state);
      made->nominal.push_back(pose.nominal);
      made->actual.push_back(pose.actual);
    }
  }
  const Poses& both = *made;
  const py::capsule owner(made.release(), [](void* held) { delete static_cast<Poses*>(held); });
  return py::make_tuple(view(both.nominal, owner), view(both.actual, owner));
}

py::object compare(const std::filesystem::path& scene, const py::object& set,
                   const std::vector<py::object>& compensators, const std::string& answers,
                   bool track, bool trust, const py::object& callback) {
  sim::RunOptions options = options_of(set, trust, callback);
  if (track) options.formats.emplace_back(sim::saved_track);
  for (const py::object& one : compensators) {
    if (py::isinstance<py::str>(one) || py::hasattr(one, "__fspath__"))
      options.plug_ins.push_back(one.cast<std::filesystem::path>());
    else
      options.functions.push_back(case_of(py::function(one), answers));
  }
  std::optional<sim::CasesCut> made;
  {
    const py::gil_scoped_release free;
    made = sim::cases_cut(scene_file(scene), options);
  }
  return python_of(std::move(*made));
}

const Job& job_of(const py::object& self) { return *self.cast<const Prepared&>().job; }

const cutting::Design& design_of(const py::object& self) { return job_of(self).design_w; }

void define_job(py::module_& module) {
  py::class_<Prepared>(module, "Job",
                       "A scene made ready: its part, program and machine, which all cases share.")
      .def_property_readonly("title", [](const Prepared& p) { return p.job->scene.title; })
      .def_property_readonly(
          "axes",
          [](const Prepared& p) { return kinematics::letters(p.job->machine.nominal.joints()); },
          "a letter a joint, the columns of q")
      .def_property_readonly("cases",
                             [](const Prepared& p) {
                               std::vector<std::string> names{"error_free", "uncompensated"};
                               for (const sim::CaseDescription& one : p.job->scene.cases)
                                 names.push_back(one.name);
                               return names;
                             })
      .def_property_readonly(
          "vertices", [](const py::object& self) { return view(design_of(self).vertices, self); },
          "(n, 3) mm, workpiece frame")
      .def_property_readonly(
          "normals", [](const py::object& self) { return view(design_of(self).normals, self); })
      .def_property_readonly(
          "triangles", [](const py::object& self) { return view(design_of(self).triangles, self); })
      .def_property_readonly(
          "area_mm2", [](const py::object& self) { return view(design_of(self).area, self); },
          "(n) a third of the triangles around a vertex")
      .def_property_readonly(
          "q",
          [](const py::object& self) {
            const Job& job = job_of(self);
            const auto& states = job.samples.states;
            const double* data = states.empty() ? nullptr : states.front().q.data();
            return view(data, {py::ssize_t(states.size()), job.machine.nominal.size()},
                        {sizeof(kinematics::AxisState), sizeof(double)}, self);
          },
          "(samples, axes) as the program commands them, mm and rad")
      .def_property_readonly(
          "time_s",
          [](const py::object& self) {
            const auto& states = job_of(self).samples.states;
            const double* data = states.empty() ? nullptr : &states.front().time_s;
            return view(data, {py::ssize_t(states.size())}, {sizeof(kinematics::AxisState)}, self);
          })
      .def_property_readonly(
          "line", [](const py::object& self) { return view(job_of(self).samples.line, self); },
          "(samples) of the program")
      .def_property_readonly(
          "T_wt", [](const py::object& self) { return view(job_of(self).T_wt_nominal, self); },
          "(samples, 4, 4) where the tool should be in the workpiece")
      .def_property_readonly(
          "program", [](const Prepared& p) { return p.job->program_text; },
          "text of a generated program, else empty")
      .def_property_readonly(
          "scene", [](const Prepared& p) { return p.job->scene.resolved; },
          "the scene with every default filled in, TOML")
      .def_property_readonly("warnings", [](const Prepared& p) { return p.job->warnings; })
      .def_property_readonly("timing_s", [](const Prepared& p) { return p.job->timing_s; })
      .def("cut", cut, py::arg("case") = "uncompensated", py::kw_only(),
           py::arg("answers") = "correction", py::arg("track") = false,
           py::arg("progress") = py::none(),
           "Cuts a case by its name, a plug-in by its file, or what a function f(task, batch) "
           "corrects.")
      .def("with_errors", with_errors, py::arg("set"),
           "The same part and program on a machine with other errors: {\"errors.scale\": 2}.")
      .def("__repr__", [](const Prepared& p) { return "<abbe.Job " + p.job->scene.title + ">"; });
}

}  // namespace

void define_jobs(py::module_& module) {
  define_job(module);
  module.def("prepare", prepare, py::arg("scene"), py::arg("set") = py::none(), py::kw_only(),
             py::arg("trust") = false, py::arg("progress") = py::none(),
             "Reads a scene, its values changed as `--set` does, and makes its job.");
  module.def(
      "pose", poses, py::arg("scene"), py::arg("q"), py::arg("set") = py::none(), py::kw_only(),
      py::arg("time_s") = 0.0,
      "Nominal and actual poses (n, 4, 4) of the tool in the workpiece, the machine standing "
      "still at positions q (n, axes), mm and rad.");
  module.def("compare", compare, py::arg("scene"), py::arg("set") = py::none(), py::kw_only(),
             py::arg("compensators") = std::vector<py::object>{}, py::arg("answers") = "correction",
             py::arg("track") = false, py::arg("trust") = false, py::arg("progress") = py::none(),
             "Cuts every case of a scene, as `abbe compare` does; plug-ins by their files, "
             "functions as of Job.cut.");
}

}  // namespace abbe::python
