#include "sim/report/html_report.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <tbb/parallel_invoke.h>
#include <nlohmann/json.hpp>

#include "sim/report/encode.h"
#include "sim/report/html_text.h"
#include "sim/report/page_data.h"
#include "sim/report/page_machine.h"
#include "sim/report/page_maps.h"
#include "sim/report/pictures.h"
#include "sim/report/report_labels.h"
#include "sim/report/summary_report.h"
#include "sim/report/viewer_source.h"

namespace abbe::sim {
namespace {

using namespace html;
using nlohmann::ordered_json;

std::string plain(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "–" : value.dump();
}

/// The figures of every case from the numbers of comparison.json, which stand whole beside those
/// that are seen.
std::string figures_table(const ordered_json& json, const PageData& data) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::map<std::string, double> step_nm;
  for (const ordered_json& one : data.index["cases"])
    step_nm[one.at("name").get<std::string>()] = one.at("step_nm").get<double>();
  std::string text = "<table id=\"figures\"><caption data-label=\"figures\"></caption><thead><tr>" +
                     label("case", "th");
  for (const char* key : keys) text += label(key, "th");
  text += label("precision", "th") + "</tr></thead><tbody>";
  for (const ordered_json& one : json.at("cases")) {
    const std::string name = one.at("name").get<std::string>();
    text += "<tr data-case=\"" + in_html(name) + "\"><td>" + in_html(name) + "</td>";
    for (const char* key : keys) {
      const ordered_json& value = one.at("residual_um").at(key);
      text += value.is_number() ? fmt::format("<td data-key=\"{}\" data-value=\"{}\">{:.4g}</td>",
                                              key, value.dump(), value.get<double>())
                                : std::string("<td>–</td>");
    }
    const auto step = step_nm.find(name);
    text +=
        "<td>" + (step == step_nm.end() ? "–" : fmt::format("{:.2g}", step->second)) + "</td></tr>";
  }
  return text + "</tbody></table>";
}

/// The figures of every region of the part by case; empty where it has none.
std::string regions_table(const PageData& data) {
  const ordered_json& regions = data.index["regions"];
  if (regions.empty()) return "";
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs", "in"};
  std::string text =
      "<table id=\"regions\"><caption data-label=\"region_figures\"></caption><thead><tr>" +
      label("region", "th") + label("case", "th");
  for (const char* key : keys)
    text += label(std::string_view(key) == "in" ? "in_percent" : key, "th");
  text += "</tr></thead><tbody>";
  for (const ordered_json& region : regions)
    for (const auto& [name, figures] : region.at("figures").items()) {
      text += "<tr><td>" + in_html(region.at("name").get<std::string>()) + "</td><td>" +
              in_html(name) + "</td>";
      for (const char* key : keys)
        text += figures.at(key).is_number()
                    ? fmt::format("<td>{:.4g}</td>", figures.at(key).get<double>())
                    : std::string("<td>–</td>");
      text += "</tr>";
    }
  return text + "</tbody></table>";
}

/// A still picture of every map, for a browser that cannot turn one, and for paper.
std::string pictures(const std::vector<Compared>& cases) {
  constexpr int width_px = 900;
  std::string text;
  for (const Compared& one : cases) {
    const std::string png = map_png(*one.job, one.verdict, width_px);
    if (png.empty()) continue;
    const std::string name = in_html(one.verdict.cut.name);
    text += fmt::format(
        "<figure><img width=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\"></figure>\n",
        width_px, name, base64(png));
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
  text += label("packed", "p");
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
  PageData data{{{"cases", ordered_json::array()}, {"arrays", ordered_json::object()}}, {}};
  data.index["tolerance_um"] = json.at("tolerance_um");
  std::string still;
  tbb::parallel_invoke([&] { still = pictures(cases); },
                       [&] {
                         report.warnings = add_maps(data, cases, json.at("cases"));
                         for (const std::string& one : add_machine(data, job))
                           report.warnings.push_back(one);
                       });
  const auto said = [&](std::string_view text) {
    return with_labels(text, report_labels(), asked.language);
  };
  report.html = filled(said(viewer_page()),
                       {{"language", asked.language},
                        {"title", in_html(comparison.scene)},
                        {"style", std::string(viewer_style())},
                        {"script", viewer_script()},
                        {"labels", in_script(labels_json(report_labels()))},
                        {"figures", said(figures_table(json, data))},
                        {"regions", said(regions_table(data))},
                        {"pictures", still},
                        {"words", said(words(cases, json, report.warnings, asked))},
                        {"data", "<script type=\"application/json\" id=\"index\">" +
                                     in_script(data.index) + "</script>\n" + data.blocks}});
  return report;
}

}  // namespace abbe::sim
