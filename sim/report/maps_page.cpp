#include "sim/report/maps_page.h"

#include <map>

#include <fmt/format.h>

#include "sim/report/html_text.h"
#include "sim/report/report_labels.h"
#include "sim/report/script_hash.h"
#include "sim/report/viewer_source.h"

namespace abbe::sim {
namespace {

using namespace html;
using nlohmann::ordered_json;

/// The figures of every case from the numbers of comparison.json, which stand whole beside those
/// that are seen.
std::string figures_table(const ordered_json& cases, const PageData& data) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::map<std::string, double> step_nm;
  for (const ordered_json& one : data.index["cases"])
    step_nm[one.at("name").get<std::string>()] = one.at("step_nm").get<double>();
  std::string text = "<table id=\"figures\"><caption data-label=\"figures\"></caption><thead><tr>" +
                     label("case", "th");
  for (const char* key : keys) text += label(key, "th");
  text += label("maps_uncut_percent", "th") + label("precision", "th") + "</tr></thead><tbody>";
  for (const ordered_json& one : cases) {
    const std::string name = one.at("name").get<std::string>();
    text += "<tr data-case=\"" + in_html(name) + "\"><td>" + in_html(name) + "</td>";
    for (const char* key : keys) {
      const ordered_json& value = one.at("residual_um").at(key);
      text += value.is_number() ? fmt::format("<td data-key=\"{}\" data-value=\"{}\">{:.4g}</td>",
                                              key, value.dump(), value.get<double>())
                                : std::string("<td>–</td>");
    }
    const ordered_json& uncut = one.at("uncut_percent");
    text += uncut.is_number() ? fmt::format("<td>{:.4g}</td>", uncut.get<double>())
                              : std::string("<td>–</td>");
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

}  // namespace

PageData maps_data(const PartMaps& maps, const ordered_json& tolerance_um) {
  PageData data{{{"cases", ordered_json::array()}, {"arrays", ordered_json::object()}}, {}};
  data.index["tolerance_um"] = tolerance_um;
  add_maps(data, maps);
  return data;
}

std::string html_of(const MapsPage& page) {
  const auto said = [&](std::string_view text) {
    return with_labels(text, report_labels(), page.language);
  };
  return filled(said(viewer_page()),
                {{"language", page.language},
                 {"title", in_html(page.title)},
                 {"style", std::string(viewer_style())},
                 {"script", viewer_script()},
                 {"script_hash", script_hash(viewer_script())},
                 {"labels", in_script(labels_json(report_labels()))},
                 {"figures", said(figures_table(page.cases, page.data))},
                 {"regions", said(regions_table(page.data))},
                 {"pictures", page.pictures},
                 {"words", said(page.words)},
                 {"data", "<script type=\"application/json\" id=\"index\">" +
                              in_script(page.data.index) + "</script>\n" + page.data.blocks}});
}

}  // namespace abbe::sim
