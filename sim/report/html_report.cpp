#include "sim/report/html_report.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <nlohmann/json.hpp>

#include "sim/report/compared_maps.h"
#include "sim/report/encode.h"
#include "sim/report/html_text.h"
#include "sim/report/maps_page.h"
#include "sim/report/page_machine.h"
#include "sim/report/pictures.h"
#include "sim/report/summary_report.h"

namespace abbe::sim {
namespace {

using namespace html;
using nlohmann::ordered_json;

std::string plain(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "–" : value.dump();
}

void add_courses(PageData& data, const std::vector<Compared>& cases) {
  for (std::size_t number = 0; number < data.index["cases"].size(); ++number)
    for (const Compared& one : cases)
      if (one.verdict.cut.name == data.index["cases"][number].at("name"))
        add_course(data, one, number);
}

/// A still picture of every map, for a browser that cannot turn one, and for paper.
std::string pictures(const std::vector<Compared>& cases) {
  constexpr int width_px = 900;
  std::vector<std::string> png(cases.size());
  // one is prepared and another compressed while a third is drawn
  tbb::parallel_for(std::size_t(0), cases.size(), [&](std::size_t i) {
    png[i] = map_png(*cases[i].job, cases[i].verdict, width_px);
  });
  std::string text;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (png[i].empty()) continue;
    const std::string name = in_html(cases[i].verdict.cut.name);
    text += fmt::format(
        "<figure><img width=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\"></figure>\n",
        width_px, name, base64(png[i]));
  }
  return text.empty() ? "" : "<section id=\"pictures\">" + text + "</section>";
}

std::string verdicts(const std::vector<Compared>& cases) {
  std::vector<std::string> lines;
  for (const Compared& one : cases) {
    const std::string verdict =
        tolerance_verdict(one.verdict.residual.conformance, one.verdict.worst);
    if (!verdict.empty()) lines.push_back(one.verdict.cut.name + ": " + verdict);
    for (const std::string& limit : exceeded(one.job->scene.limits, one.verdict))
      lines.push_back(limit);
  }
  return list(lines);
}

std::string machine_words(const Job& job) {
  std::vector<std::string> lines;
  for (const kinematics::Joint& joint : job.machine.nominal.joints()) {
    const Eigen::Vector3d& u = joint.direction_b;
    const Eigen::Vector3d& p = joint.point_b;
    lines.push_back(fmt::format("{}{}: ({:.6g}, {:.6g}, {:.6g}), ({:.6g}, {:.6g}, {:.6g}) mm",
                                joint.name, joint.side == kinematics::Side::Workpiece ? "'" : "",
                                u.x(), u.y(), u.z(), p.x(), p.y(), p.z()));
  }
  return list(lines);
}

std::string words(const std::vector<Compared>& cases, const ordered_json& json,
                  const std::vector<std::string>& left_out, const HtmlAsked& asked) {
  const Job& job = *cases.front().job;
  std::string text = label("asked", "h2") + "<dl>";
  for (const char* key :
       {"scene", "seed", "vertices", "moves", "datum", "alignment", "tolerance_um"})
    text += row(key, plain(json.at(key)));
  text += row("program", job.path.file) +
          row("duration",
              fmt::format("{:.1f}",
                          job.samples.states.empty() ? 0.0 : job.samples.states.back().time_s)) +
          "</dl>" + label("machine_axes", "h2") + machine_words(job) + label("verdicts", "h2") +
          verdicts(cases);
  std::vector<std::string> warnings = json.at("warnings").get<std::vector<std::string>>();
  warnings.insert(warnings.end(), left_out.begin(), left_out.end());
  text += label("warnings", "h2") + list(warnings);
  if (json.contains("failed")) {
    std::vector<std::string> failed;
    for (const ordered_json& one : json.at("failed"))
      failed.push_back(plain(one.at("name")) + ": " + plain(one.at("reason")));
    text += label("failed", "h2") + list(failed);
  }
  text += label("packed", "p") + label("packed_motion", "p");
  text += label("versions", "h2") + "<dl>";
  for (const auto& [name, version] : json.at("versions").items())
    text += "<dt>" + in_html(name) + "</dt><dd>" + in_html(plain(version)) + "</dd>";
  return text + "</dl>" + label("repeat", "h2") + "<p><code>" + in_html(asked.command) +
         "</code></p><p><a download=\"scene.toml\" href=\"data:application/toml;base64," +
         base64(job.scene.resolved) + "\">scene.toml</a> " + label("download") + "</p>";
}

}  // namespace

HtmlReport html_report(const std::vector<Compared>& cases, const Comparison& comparison,
                       const HtmlAsked& asked) {
  const Job& job = *cases.front().job;
  const ordered_json json = to_json(comparison);
  HtmlReport report;
  MapsPage page{comparison.scene, asked.language, {}, json.at("cases"), {}, {}};
  tbb::parallel_invoke([&] { page.pictures = pictures(cases); },
                       [&] {
                         const PartMaps maps = compared_maps(cases, json.at("cases"));
                         report.warnings = maps.left_out;
                         page.data = maps_data(maps, json.at("tolerance_um"));
                         add_courses(page.data, cases);
                         for (const std::string& one : add_machine(page.data, job))
                           report.warnings.push_back(one);
                       });
  page.words = words(cases, json, report.warnings, asked);
  report.html = html_of(page);
  return report;
}

}  // namespace abbe::sim
