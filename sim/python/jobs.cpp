#include "sim/python/jobs.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/calibration/calibration.h"
#include "sim/commands/calibration_commands.h"
#include "sim/commands/scene_runs.h"
#include "sim/cut/idle_machine.h"
#include "sim/cut/placement.h"
#include "sim/loop/compensate.h"
#include "sim/python/conversions.h"
#include "sim/report/identification_report.h"
#include "sim/report/page_template.h"
#include "sim/report/picture_files.h"
#include "sim/report/result_files.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary.h"
#include "sim/scene/cases.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"
#include "sim/study/run_study.h"

namespace py = pybind11;
using std::filesystem::path;

namespace abbe::python {

namespace {

using sim::Retention;

/// A comparison as Python sees it.
struct PythonComparison {
  std::shared_ptr<const sim::CaseResults> cases;
  py::dict by_name() const {
    py::dict cases_by_name;
    for (const sim::ComparedCase& compared : cases->cases)
      cases_by_name[py::str(compared.verdict.cut.name)] = Result{
          {cases, compared.job}, {cases, &compared.verdict}};  // every result keeps all cases alive
    return cases_by_name;
  }
};

const cutting::Surface& surface(const py::object& self) {
  return self.cast<const Result&>().verdict->alignment.surface;
}

py::object figures(const Result& result) {
  return to_python(sim::to_json(sim::summary(*result.job, *result.verdict)));
}

void save(const Result& result, const std::filesystem::path& folder,
          const std::vector<std::string>& formats, bool force) {
  const auto known_formats = sim::map_formats();
  for (const std::string& format : formats)
    if (std::ranges::find(known_formats, format) == known_formats.end())
      throw py::value_error(fmt::format("formats: expected some of {}, seen \"{}\"",
                                        fmt::join(known_formats, ", "), format));
  const bool is_tracked = result.verdict->cut.track.has_value();
  // Checked before the folder is created.
  if (sim::required_retention(formats) == Retention::Track && !is_tracked)
    throw py::value_error("expected track=True in the cut to save the track");
  // Other Python threads can run while files are written.
  const py::gil_scoped_release release;
  sim::Permissions permissions;
  permissions.command = "import abbe";
  permissions.force = force;
  const sim::ResultFolder result_folder(folder, sim::make_writer(result.job->scene, permissions));
  sim::Verdict verdict = *result.verdict;
  verdict.stock = sim::stock_check(*result.job, verdict);
  sim::write_program(result_folder, *result.job);
  sim::write_case(result_folder, *result.job, verdict, formats);
}

constexpr int picture_width = 900;  // px

/// Returns the map as a PNG file; nothing if abbe was built without pictures.
py::bytes picture(const Result& result, int width) {
  if (width < 1 || width > 10000) throw py::value_error("width: expected 1 to 10000 pixels");
  // The GIL is released while drawing, and held again to create the Python object.
  std::string png;
  {
    const py::gil_scoped_release release;
    png = sim::map_png(*result.job, *result.verdict, width);
  }
  return py::bytes(png);
}

std::string preformatted(const std::string& text) {
  std::string lines;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    lines += sim::html::html_escaped(escaped(text.substr(from, end - from))) + "\n";
    from = end + 1;
  }
  return "<pre>" + lines + "</pre>";
}

std::string image(const py::bytes& png) {
  if (py::len(png) == 0) return "";
  const auto text = py::module_::import("base64").attr("b64encode")(png).attr("decode")();
  return "<img style=\"max-width:100%\" alt=\"residual map\" src=\"data:image/png;base64," +
         text.cast<std::string>() + "\">";
}

std::string summary_text(const Result& result) {
  return sim::to_text(sim::summary(*result.job, *result.verdict));
}

void define_track(py::module_& module) {
  using sim::ToolTrack;
  const auto rows = [](ToolTrack::Rows ToolTrack::*member) {
    return [member](const py::object& self) {
      return view(self.cast<const ToolTrack&>().*member, self);
    };
  };
  py::class_<ToolTrack, std::shared_ptr<ToolTrack>>(
      module, "Track", "Actual pose of the tool at every sample, in the workpiece frame.")
      .def("__len__", [](const ToolTrack& t) { return t.time_s.size(); })
      .def_property_readonly(
          "time_s",
          [](const py::object& self) { return view(self.cast<const ToolTrack&>().time_s, self); })
      .def_property_readonly(
          "line",
          [](const py::object& self) { return view(self.cast<const ToolTrack&>().line, self); },
          "time in the program, s")
      .def_property_readonly("q", rows(&ToolTrack::q), "(n, axes) commanded, mm and rad")
      .def_property_readonly("nominal_tip", rows(&ToolTrack::nominal_tip), "(n, 3) mm")
      .def_property_readonly("nominal_direction", rows(&ToolTrack::nominal_direction),
                             "(n, 3) unit vectors from the tip to the spindle")
      .def_property_readonly("actual_tip", rows(&ToolTrack::actual_tip), "(n, 3) mm")
      .def_property_readonly("actual_direction", rows(&ToolTrack::actual_direction), "(n, 3)");
}

void define_result(py::module_& module) {
  py::class_<Result>(module, "Result", "One case: its map on the design surface, and its figures.")
      .def_property_readonly("name", [](const Result& r) { return r.verdict->cut.name; })
      .def_property_readonly(
          "residual_mm", [](const py::object& self) { return view(surface(self).residual, self); },
          "(n) along the outward normal, + material left, - gouged; NaN where not cut")
      .def_property_readonly(
          "form_mm",
          [](const py::object& self) {
            return view(self.cast<const Result&>().verdict->form_map, self);
          },
          "(n) the residual through the areal Gaussian filter")
      .def_property_readonly(
          "status",
          [](const py::object& self) {
            const auto& status = surface(self).status;
            return view(reinterpret_cast<const std::uint8_t*>(status.data()),
                        {py::ssize_t(status.size())}, {1}, self);
          },
          "(n) 0 cut, 1 uncut, 2 not judged, 3 gouged deeper than the band")
      .def_property_readonly(
          "cut_time_s", [](const py::object& self) { return view(surface(self).cut_time_s, self); })
      .def_property_readonly(
          "cut_line", [](const py::object& self) { return view(surface(self).cut_line, self); },
          "(n) program line that cut the surface there, 0 where none did")
      .def_property_readonly(
          "signals",
          [](const py::object& self) {
            const sim::Signals& signals = self.cast<const Result&>().verdict->cut.signals;
            py::dict columns;
            for (std::size_t k = 0; k < signals.columns.size(); ++k)
              columns[py::str(signals.columns[k])] =
                  view(signals.rows.data() + Eigen::Index(k) * signals.rows.outerStride(),
                       {signals.rows.rows()}, {py::ssize_t(sizeof(double))}, self);
            return columns;
          },
          "time series by name, such as T_nut_C; empty without heat, force or channels")
      .def_property_readonly(
          "track",
          [](const Result& r) -> py::object {
            if (!r.verdict->cut.track) return py::none();
            // A copy, because the view needs an owner.
            return py::cast(std::make_shared<sim::ToolTrack>(*r.verdict->cut.track));
          },
          "actual poses of the tool; None unless cut with track=True")
      .def_property_readonly("figures", figures, "as in summary.json")
      .def_property_readonly(
          "warnings", [](const Result& r) { return sim::warnings_of(*r.job, r.verdict->cut); })
      .def_property_readonly("timing_s", [](const Result& r) { return r.verdict->cut.timing_s; })
      .def("save", save, py::arg("folder"), py::arg("formats") = sim::default_map_formats(),
           py::arg("force") = false,
           "Writes the files of the case, as `abbe run` does, with its map in these formats.")
      .def("picture", picture, py::arg("width") = picture_width, "The map as a PNG file, bytes.")
      .def("__str__", summary_text)
      .def("__repr__",
           [](const Result& r) {
             return fmt::format("<abbe.Result {} of {}>", r.verdict->cut.name, r.job->scene.title);
           })
      .def("_repr_html_", [](const Result& r) {
        return image(picture(r, picture_width)) + preformatted(summary_text(r));
      });
}

}  // namespace

Result judge_cut(std::shared_ptr<const sim::Job> job, sim::Cut cut) {
  sim::check_cuts_part(*job, cut);
  sim::Verdict verdict = sim::judge(*job, std::move(cut), nullptr);
  return {std::move(job), std::make_shared<const sim::Verdict>(std::move(verdict))};
}

void define_results(py::module_& module) {
  define_track(module);
  define_result(module);
  py::class_<PythonComparison>(module, "Comparison", "The cases of a scene, side by side.")
      .def_property_readonly("cases", &PythonComparison::by_name,
                             "by name, in the order of the table")
      .def("__getitem__",
           [](const PythonComparison& c, const std::string& name) {
             return c.by_name().attr("__getitem__")(name);
           })
      .def_property_readonly(
          "figures",
          [](const PythonComparison& c) { return to_python(sim::to_json(c.cases->comparison)); },
          "as in comparison.json")
      .def_property_readonly("warnings",
                             [](const PythonComparison& c) { return c.cases->comparison.warnings; })
      .def_property_readonly(
          "failed",
          [](const PythonComparison& c) {
            py::dict reasons;
            for (const sim::FailedCase& failure : c.cases->failed)
              reasons[py::str(failure.name)] = failure.reason;
            return reasons;
          },
          "error messages of failed compensators, by name")
      .def("__str__", [](const PythonComparison& c) { return sim::to_text(c.cases->comparison); })
      .def("_repr_html_", [](const PythonComparison& c) {
        return preformatted(sim::to_text(c.cases->comparison));
      });
}

py::object comparison_to_python(sim::CaseResults cases) {
  return py::cast(PythonComparison{std::make_shared<const sim::CaseResults>(std::move(cases))});
}

namespace {

using sim::Job;

/// A job and the overrides of its scene, which `with_errors` extends.
struct PreparedJob {
  std::shared_ptr<Job> job;  ///< read only, except that plug-ins named by the user become trusted
  std::vector<sim::Override> overrides;
};
using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;

sim::RunOptions make_run_options(const py::object& set, bool trust, const py::object& callback) {
  sim::RunOptions options;
  options.overrides = overrides(set);
  options.permissions.trust = trust;
  options.progress = progress(callback);
  return options;
}

PreparedJob prepare(const std::filesystem::path& scene, const py::object& set, bool trust,
                    const py::object& callback) {
  const sim::RunOptions options = make_run_options(set, trust, callback);
  const py::gil_scoped_release release;
  return {std::make_shared<Job>(sim::job_of(scene_file(scene), options)), options.overrides};
}

PreparedJob replace_errors(const PreparedJob& prepared, const py::object& set) {
  std::vector<sim::Override> merged = prepared.overrides;
  // A later value of a key replaces an earlier one.
  for (sim::Override& new_override : overrides(set)) {
    std::erase_if(
        merged, [&](const sim::Override& existing) { return existing.path == new_override.path; });
    merged.push_back(std::move(new_override));
  }
  const py::gil_scoped_release release;
  const Job& job = *prepared.job;
  sim::Scene scene = sim::read_scene(job.scene.file, merged);
  scene.trusted = job.scene.trusted;
  return {std::make_shared<Job>(sim::replace_errors(job, scene)), std::move(merged)};
}

Result cut(const PreparedJob& prepared, const py::object& case_or_function,
           const std::string& answers, bool track, const py::object& callback) {
  const std::shared_ptr<Job>& job = prepared.job;
  const Retention retention = track ? Retention::Track : Retention::Map;
  const sim::Progress report = progress(callback);
  // A callable object is a compensator, any other argument the name of a case.
  std::optional<sim::CaseDescription> compensator;
  bool is_error_free = false;
  if (py::isinstance<py::function>(case_or_function) ||
      PyCallable_Check(case_or_function.ptr()) != 0) {
    compensator = compensator_case(py::reinterpret_borrow<py::function>(case_or_function), answers);
  } else {
    const std::string name = py::str(case_or_function);
    is_error_free = name == "error_free";
    if (!is_error_free && name != "uncompensated") compensator = sim::parse_case(name);
    // The user who names a plug-in trusts it.
    if (compensator) sim::trust(job->scene, *compensator);
  }
  const py::gil_scoped_release release;
  if (is_error_free) return judge_cut(job, sim::cut_error_free(*job, report, retention));
  return judge_cut(job, sim::cut(*job, compensator, report, retention));
}

/// Returns (n x axes) positions; a single row of positions becomes (1 x axes).
Rows position_rows(const Rows& q, Eigen::Index axes) {
  if (q.ndim() == 1 && q.shape(0) == axes) return Rows(q.attr("reshape")(1, axes));
  if (q.ndim() != 2 || q.shape(1) != axes)
    throw py::value_error("q: expected (n, " + std::to_string(axes) + ") positions, mm and rad");
  return q;
}

struct Poses {
  std::vector<kinematics::Pose> nominal, actual;
};

py::tuple poses(const std::filesystem::path& file, const Rows& requested_q, const py::object& set,
                double time_s) {
  const std::vector<sim::Override> scene_overrides = overrides(set);
  std::unique_ptr<const sim::IdleMachine> idle;
  {
    const py::gil_scoped_release release;
    idle = std::make_unique<const sim::IdleMachine>(
        sim::idle_machine(sim::read_scene(scene_file(file), scene_overrides)));
  }
  // Checked while the GIL is held, because the check uses Python objects.
  const Rows q = position_rows(requested_q, idle->machine.nominal.size());
  auto computed = std::make_unique<Poses>();
  {
    const py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < q.shape(0); ++i) {
      kinematics::AxisState state;
      state.q = Eigen::Map<const Eigen::VectorXd>(q.data(i, 0), q.shape(1));
      state.time_s = time_s;
      const sim::TipPose pose = sim::tip_pose(*idle, state);
      computed->nominal.push_back(pose.nominal);
      computed->actual.push_back(pose.actual);
    }
  }
  const Poses& result_poses = *computed;
  // Both arrays share one owner.
  const py::capsule owner(computed.release(),
                          [](void* pointer) { delete static_cast<Poses*>(pointer); });
  return py::make_tuple(view(result_poses.nominal, owner), view(result_poses.actual, owner));
}

py::object compare(const std::filesystem::path& scene, const py::object& set,
                   const std::vector<py::object>& compensators, const std::string& answers,
                   bool track, bool trust, const py::object& callback) {
  sim::RunOptions options = make_run_options(set, trust, callback);
  if (track) options.formats.emplace_back(sim::track_format);
  for (const py::object& compensator : compensators) {
    // A path is a plug-in; any other object must be a function.
    if (py::isinstance<py::str>(compensator) || py::hasattr(compensator, "__fspath__"))
      options.plug_ins.push_back(compensator.cast<std::filesystem::path>());
    else
      options.functions.push_back(compensator_case(py::function(compensator), answers));
  }
  std::optional<sim::CaseResults> cases;
  {
    const py::gil_scoped_release release;
    cases = sim::cut_scene_cases(scene_file(scene), options);
  }
  return comparison_to_python(std::move(*cases));
}

const Job& job_of(const py::object& self) { return *self.cast<const PreparedJob&>().job; }

const cutting::Design& design(const py::object& self) { return job_of(self).design_w; }

void define_job(py::module_& module) {
  py::class_<PreparedJob>(module, "Job",
                          "A prepared scene: its part, program and machine, shared by all cases.")
      .def_property_readonly("title", [](const PreparedJob& p) { return p.job->scene.title; })
      .def_property_readonly(
          "axes",
          [](const PreparedJob& p) { return kinematics::letters(p.job->machine.nominal.joints()); },
          "one letter per joint, the columns of q")
      .def_property_readonly("cases",
                             [](const PreparedJob& p) {
                               std::vector<std::string> names{"error_free", "uncompensated"};
                               for (const sim::CaseDescription& description : p.job->scene.cases)
                                 names.push_back(description.name);
                               return names;
                             })
      .def_property_readonly(
          "vertices", [](const py::object& self) { return view(design(self).vertices, self); },
          "(n, 3) mm, workpiece frame")
      .def_property_readonly(
          "normals", [](const py::object& self) { return view(design(self).normals, self); })
      .def_property_readonly(
          "triangles", [](const py::object& self) { return view(design(self).triangles, self); })
      .def_property_readonly(
          "area_mm2", [](const py::object& self) { return view(design(self).area, self); },
          "(n) mm^2, a third of the triangles around each vertex")
      .def_property_readonly(
          "q",
          [](const py::object& self) {
            const Job& job = job_of(self);
            const auto& states = job.samples.states;
            const double* data = states.empty() ? nullptr : states.front().q.data();
            return view(data, {py::ssize_t(states.size()), job.machine.nominal.size()},
                        // The stride is that of the samples, of which the view shows the positions.
                        {sizeof(kinematics::AxisState), sizeof(double)}, self);
          },
          "(samples, axes) commanded by the program, mm and rad")
      .def_property_readonly(
          "time_s",
          [](const py::object& self) {
            const auto& states = job_of(self).samples.states;
            const double* data = states.empty() ? nullptr : &states.front().time_s;
            return view(data, {py::ssize_t(states.size())}, {sizeof(kinematics::AxisState)}, self);
          })
      .def_property_readonly(
          "line", [](const py::object& self) { return view(job_of(self).samples.line, self); },
          "(samples) time in the program, s")
      .def_property_readonly(
          "T_wt", [](const py::object& self) { return view(job_of(self).T_wt_nominal, self); },
          "(samples, 4, 4) nominal pose of the tool in the workpiece")
      .def_property_readonly(
          "program", [](const PreparedJob& p) { return p.job->program_text; },
          "text of the program if it was generated, else empty")
      .def_property_readonly(
          "scene", [](const PreparedJob& p) { return p.job->scene.resolved; },
          "TOML text of the scene with all defaults filled in")
      .def_property_readonly("warnings", [](const PreparedJob& p) { return p.job->warnings; })
      .def_property_readonly("timing_s", [](const PreparedJob& p) { return p.job->timing_s; })
      .def("cut", cut, py::arg("case") = "uncompensated", py::kw_only(),
           py::arg("answers") = "correction", py::arg("track") = false,
           py::arg("progress") = py::none(),
           "Cuts a case by name, a plug-in by file, or with the corrections of a function f(task, "
           "batch).")
      .def("with_errors", replace_errors, py::arg("set"),
           "The same part and program on a machine with other errors: {\"errors.scale\": 2}.")
      .def("__repr__",
           [](const PreparedJob& p) { return "<abbe.Job " + p.job->scene.title + ">"; });
}

}  // namespace

void define_jobs(py::module_& module) {
  define_job(module);
  module.def("prepare", prepare, py::arg("scene"), py::arg("set") = py::none(), py::kw_only(),
             py::arg("trust") = false, py::arg("progress") = py::none(),
             "Reads a scene, with values changed as by `--set`, and returns its job.");
  module.def("pose", poses, py::arg("scene"), py::arg("q"), py::arg("set") = py::none(),
             py::kw_only(), py::arg("time_s") = 0.0,
             "Nominal and actual poses (n, 4, 4) of the tool in the workpiece, with the machine at "
             "standstill at positions q (n, axes), mm and rad.");
  module.def("compare", compare, py::arg("scene"), py::arg("set") = py::none(), py::kw_only(),
             py::arg("compensators") = std::vector<py::object>{}, py::arg("answers") = "correction",
             py::arg("track") = false, py::arg("trust") = false, py::arg("progress") = py::none(),
             "Cuts every case of a scene, as `abbe compare` does; compensators are plug-in files "
             "or functions as for Job.cut.");
}

namespace {

using Method = sim::IdentificationOptions::Method;

Method parse_method(const std::string& name) {
  const std::map<std::string, Method> methods = {{"chain", Method::Chain},
                                                 {"step_diagonal", Method::StepDiagonal},
                                                 {"composite", Method::Composite},
                                                 {"thermal", Method::Thermal}};
  const auto entry = methods.find(name);
  if (entry == methods.end())
    throw py::value_error("method: expected chain, step_diagonal, composite or thermal, seen \"" +
                          name + "\"");
  return entry->second;
}

py::object identify(const std::vector<path>& readings, const std::string& method,
                    const std::optional<int>& order, bool choose_orders,
                    const std::map<std::string, double>& pitch,
                    const std::vector<std::string>& elements,
                    const std::vector<std::string>& sensors, const std::optional<path>& out,
                    const py::object& callback) {
  if (readings.empty()) throw py::value_error("readings: expected at least one file");
  sim::IdentificationOptions options;
  options.method = parse_method(method);
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
    const py::gil_scoped_release release;
    // Files are written only if `out` is stated.
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
  std::optional<sim::study::StudyResult> result;
  {
    const py::gil_scoped_release release;
    result = sim::study::run_study(scene_file(file), options, {});
  }
  return to_python(result->json);
}

}  // namespace

void define_studies(py::module_& module) {
  module.def("identify", identify, py::arg("readings"), py::kw_only(), py::arg("method") = "chain",
             py::arg("order") = py::none(), py::arg("choose_orders") = false,
             py::arg("pitch") = std::map<std::string, double>{},
             py::arg("elements") = std::vector<std::string>{},
             py::arg("sensors") = std::vector<std::string>{}, py::arg("out") = py::none(),
             py::arg("progress") = py::none(),
             "Identifies the errors of a machine from files of readings, as `abbe identify` does, "
             "and writes the belief file `out` if given.");
  module.def("study", study, py::arg("study"), py::arg("out"), py::arg("set") = py::none(),
             py::kw_only(), py::arg("trust") = false, py::arg("force") = false,
             py::arg("progress") = py::none(),
             "Computes the remaining cases of a study in its folder, and returns its budget.");
}

}  // namespace abbe::python
