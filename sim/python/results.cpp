#include "sim/python/results.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/cut/reach.h"
#include "sim/python/arrays.h"
#include "sim/python/conversions.h"
#include "sim/report/case_files.h"
#include "sim/report/html_text.h"
#include "sim/report/pictures.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary_report.h"
#include "sim/scene/trust.h"

namespace py = pybind11;

namespace abbe::python {
namespace {

using sim::Keep;

struct Compared {
  std::shared_ptr<const sim::CasesCut> cases;
  py::dict by_name() const {
    py::dict all;
    for (const sim::Compared& one : cases->cases)
      all[py::str(one.verdict.cut.name)] =
          Result{{cases, one.job}, {cases, &one.verdict}};  // each keeps all of them
    return all;
  }
};

const cutting::Surface& surface_of(const py::object& self) {
  return self.cast<const Result&>().verdict->aligned.surface;
}

py::object figures_of(const Result& result) {
  return to_python(sim::to_json(sim::summary(*result.job, *result.verdict)));
}

void save(const Result& result, const std::filesystem::path& folder,
          const std::vector<std::string>& formats, bool force) {
  const auto known = sim::map_formats();
  for (const std::string& one : formats)
    if (std::ranges::find(known, one) == known.end())
      throw py::value_error(
          fmt::format("formats: expected some of {}, seen \"{}\"", fmt::join(known, ", "), one));
  const bool tracked = result.verdict->cut.track.has_value();
  if (sim::kept_for(formats) == Keep::Track && !tracked)
    throw py::value_error("expected a result cut with track=True to save its track");
  const py::gil_scoped_release free;
  sim::Permissions permissions;
  permissions.command = "import abbe";
  permissions.force = force;
  const sim::ResultFolder into(folder, sim::writer_of(result.job->scene, permissions));
  sim::Verdict verdict = *result.verdict;
  verdict.stock = sim::stock_check(*result.job, verdict);
  sim::write_program(into, *result.job);
  sim::write_case(into, *result.job, verdict, formats);
}

constexpr int picture_width = 900;  // px

/// Empty where abbe was built without pictures.
py::bytes picture(const Result& result, int width) {
  if (width < 1 || width > 10000) throw py::value_error("width: expected 1 to 10000 pixels");
  std::string png;
  {
    const py::gil_scoped_release free;
    png = sim::map_png(*result.job, *result.verdict, width);
  }
  return py::bytes(png);
}

std::string preformatted(const std::string& text) {
  std::string lines;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    lines += sim::html::in_html(escaped(text.substr(from, end - from))) + "\n";
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

std::string text_of(const Result& result) {
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
      module, "Track", "Where the tool was at every sample, in the workpiece frame.")
      .def("__len__", [](const ToolTrack& t) { return t.time_s.size(); })
      .def_property_readonly(
          "time_s",
          [](const py::object& self) { return view(self.cast<const ToolTrack&>().time_s, self); })
      .def_property_readonly(
          "line",
          [](const py::object& self) { return view(self.cast<const ToolTrack&>().line, self); },
          "of the program")
      .def_property_readonly("q", rows(&ToolTrack::q), "(n, axes) as commanded, mm and rad")
      .def_property_readonly("nominal_tip", rows(&ToolTrack::nominal_tip), "(n, 3) mm")
      .def_property_readonly("nominal_direction", rows(&ToolTrack::nominal_direction),
                             "(n, 3) from the tip to the spindle")
      .def_property_readonly("actual_tip", rows(&ToolTrack::actual_tip), "(n, 3) mm")
      .def_property_readonly("actual_direction", rows(&ToolTrack::actual_direction), "(n, 3)");
}

void define_result(py::module_& module) {
  py::class_<Result>(module, "Result", "One case: its map on the design, and its figures.")
      .def_property_readonly("name", [](const Result& r) { return r.verdict->cut.name; })
      .def_property_readonly(
          "residual_mm",
          [](const py::object& self) { return view(surface_of(self).residual, self); },
          "(n) along the outward normal, + material left, - gouged; NaN where not cut")
      .def_property_readonly(
          "form_mm",
          [](const py::object& self) {
            return view(self.cast<const Result&>().verdict->filtered, self);
          },
          "(n) the residual through the areal Gaussian filter")
      .def_property_readonly(
          "status",
          [](const py::object& self) {
            const auto& status = surface_of(self).status;
            return view(reinterpret_cast<const std::uint8_t*>(status.data()),
                        {py::ssize_t(status.size())}, {1}, self);
          },
          "(n) 0 cut, 1 uncut, 2 not judged, 3 gouged deeper than the band")
      .def_property_readonly(
          "cut_time_s",
          [](const py::object& self) { return view(surface_of(self).cut_time_s, self); })
      .def_property_readonly(
          "cut_line", [](const py::object& self) { return view(surface_of(self).cut_line, self); },
          "(n) line of the program that made the surface there, 0 where none did")
      .def_property_readonly(
          "signals",
          [](const py::object& self) {
            const sim::Signals& signals = self.cast<const Result&>().verdict->cut.signals;
            py::dict all;
            for (std::size_t k = 0; k < signals.columns.size(); ++k)
              all[py::str(signals.columns[k])] =
                  view(signals.rows.data() + Eigen::Index(k) * signals.rows.outerStride(),
                       {signals.rows.rows()}, {py::ssize_t(sizeof(double))}, self);
            return all;
          },
          "time lines by name, such as T_nut_C; empty without heat, force or channels")
      .def_property_readonly(
          "track",
          [](const Result& r) -> py::object {
            if (!r.verdict->cut.track) return py::none();
            return py::cast(std::make_shared<sim::ToolTrack>(*r.verdict->cut.track));
          },
          "where the tool was; None unless it was cut with track=True")
      .def_property_readonly("figures", figures_of, "as summary.json has them")
      .def_property_readonly(
          "warnings", [](const Result& r) { return sim::warnings_of(*r.job, r.verdict->cut); })
      .def_property_readonly("timing_s", [](const Result& r) { return r.verdict->cut.timing_s; })
      .def("save", save, py::arg("folder"), py::arg("formats") = sim::usual_map_formats(),
           py::arg("force") = false,
           "Writes the files of the case, as `abbe run` does, with its map in these formats.")
      .def("picture", picture, py::arg("width") = picture_width, "The map as a PNG file, bytes.")
      .def("__str__", text_of)
      .def("__repr__",
           [](const Result& r) {
             return fmt::format("<abbe.Result {} of {}>", r.verdict->cut.name, r.job->scene.title);
           })
      .def("_repr_html_", [](const Result& r) {
        return image(picture(r, picture_width)) + preformatted(text_of(r));
      });
}

}  // namespace

Result judged(std::shared_ptr<const sim::Job> job, sim::Cut cut) {
  sim::check_cuts_part(*job, cut);
  sim::Verdict verdict = sim::judge(*job, std::move(cut), nullptr);
  return {std::move(job), std::make_shared<const sim::Verdict>(std::move(verdict))};
}

void define_results(py::module_& module) {
  define_track(module);
  define_result(module);
  py::class_<Compared>(module, "Comparison", "The cases of a scene beside each other.")
      .def_property_readonly("cases", &Compared::by_name, "by name, in the order of the table")
      .def("__getitem__",
           [](const Compared& c, const std::string& name) {
             return c.by_name().attr("__getitem__")(name);
           })
      .def_property_readonly(
          "figures", [](const Compared& c) { return to_python(sim::to_json(c.cases->comparison)); },
          "as comparison.json has them")
      .def_property_readonly("warnings",
                             [](const Compared& c) { return c.cases->comparison.warnings; })
      .def_property_readonly(
          "failed",
          [](const Compared& c) {
            py::dict all;
            for (const sim::FailedCase& one : c.cases->failed) all[py::str(one.name)] = one.reason;
            return all;
          },
          "why, of compensators that failed, by name")
      .def("__str__", [](const Compared& c) { return sim::to_text(c.cases->comparison); })
      .def("_repr_html_",
           [](const Compared& c) { return preformatted(sim::to_text(c.cases->comparison)); });
}

py::object python_of(sim::CasesCut cases) {
  return py::cast(Compared{std::make_shared<const sim::CasesCut>(std::move(cases))});
}

}  // namespace abbe::python
