#include "sim/report/figures_page.h"

#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/files/versions.h"
#include "sim/report/chart_labels.h"
#include "sim/report/encode.h"
#include "sim/report/html_text.h"
#include "sim/report/script_hash.h"
#include "sim/report/viewer_source.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

std::vector<ReportLabel> all_labels() {
  std::vector<ReportLabel> all(report_labels().begin(), report_labels().end());
  all.insert(all.end(), chart_labels().begin(), chart_labels().end());
  return all;
}

/// Words of the blocks are { label } or text; a label that is missing would stop the page.
void check_labels(const ordered_json& json, const std::set<std::string>& known) {
  if (json.is_object() && json.contains("label")) {
    const auto key = json.at("label").get<std::string>();
    if (!known.count(key)) throw std::invalid_argument("the page names no label " + key);
  }
  if (json.is_structured())
    for (const ordered_json& one : json) check_labels(one, known);
}

std::string download(const PageFile& file) {
  const std::string name = html::in_html(file.name);
  return "<li><a download=\"" + name + "\" href=\"data:application/octet-stream;base64," +
         base64(file.text) + "\">" + name + "</a></li>";
}

}  // namespace

std::string closing_words(const FiguresPage& page) {
  using namespace html;
  const ordered_json all_versions = versions();
  std::string text = label("asked", "h2") + "<dl>";
  for (const auto& [key, value] : page.asked) text += row(key.c_str(), value);
  text +=
      "</dl>" + label("warnings", "h2") + list(page.warnings) + label("versions", "h2") + "<dl>";
  for (const auto& [name, version] : all_versions.items())
    text += "<dt>" + in_html(name) + "</dt><dd>" + in_html(version.get<std::string>()) + "</dd>";
  text += "</dl>" + label("repeat", "h2") + "<p><code>" + in_html(page.command) + "</code></p><ul>";
  for (const PageFile& file : page.files) text += download(file);
  return text + "</ul>";
}

std::string html_of(const FiguresPage& page) {
  const std::vector<ReportLabel> labels = all_labels();
  std::set<std::string> known;
  for (const ReportLabel& one : labels) known.insert(std::string(one.key));
  check_labels(page.blocks, known);
  for (const auto& [key, value] : page.asked) check_labels({{"label", key}}, known);
  return html::filled(charts_page(),
                      {{"language", page.language},
                       {"title", html::in_html(page.title)},
                       {"style", std::string(charts_style())},
                       {"script", charts_script()},
                       {"script_hash", script_hash(charts_script())},
                       {"labels", html::in_script(html::labels_json(labels))},
                       {"words", closing_words(page)},
                       {"data", "<script type=\"application/json\" id=\"index\">" +
                                    html::in_script({{"blocks", page.blocks}}) + "</script>"}});
}

}  // namespace abbe::sim
