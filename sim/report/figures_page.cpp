#include "sim/report/figures_page.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/files/json_files.h"
#include "sim/files/program_file.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"

namespace abbe::sim {

using nlohmann::ordered_json;

PageText label_text(const std::string& key) {
  PageText word = PageText::object();
  word["label"] = key;
  return word;
}

PageText phrase(const std::vector<PageText>& words) {
  PageText list = PageText::array();
  for (const PageText& one : words) list.push_back(one);
  return list;
}

const ordered_json& figure_in(const ordered_json& json) {
  const auto is_number = [](const ordered_json& one) { return one.is_number() || one.is_null(); };
  // An estimate is drawn with its interval.
  const bool is_banded = json.is_object() && json.size() == 3 && json.contains("value") &&
                         json.contains("low") && json.contains("high") &&
                         std::all_of(json.begin(), json.end(), is_number);
  if (!is_number(json) && !is_banded)
    throw std::invalid_argument("no figure: " + json.dump().substr(0, 60));
  return json;
}

ordered_json page_block(const std::string& type, const std::string& id, const PageText& title,
                        const std::string& group) {
  ordered_json block{{"type", type}, {"id", id}, {"title", title}};
  if (!group.empty()) block["group"] = group;
  return block;
}

ordered_json table_block(const std::string& id, const PageText& title,
                         const std::vector<PageColumn>& columns, const ordered_json& rows,
                         const std::string& group) {
  ordered_json block = page_block("table", id, title, group);
  block["columns"] = ordered_json::array();
  for (const PageColumn& one : columns)
    block["columns"].push_back({{"head", one.head}, {"unit", one.unit}});
  block["rows"] = rows;
  return block;
}

ordered_json pictures_block(const std::string& id, const PageText& title,
                            const std::filesystem::path& folder,
                            const std::vector<std::filesystem::path>& files) {
  if (files.empty()) return {};
  ordered_json block = page_block("pictures", id, title);
  block["pictures"] = ordered_json::array();
  for (const std::filesystem::path& file : files) {
    std::filesystem::path name = std::filesystem::relative(file, folder);
    ordered_json one;
    one["name"] = name.replace_extension().generic_string();
    one["src"] = "data:image/png;base64," + base64(read_text(file, max_saved_bytes));
    block["pictures"].push_back(one);
  }
  return block;
}

ReadingSubset reading_subset(const std::string& title, Eigen::Index count, Eigen::Index most) {
  ReadingSubset drawn{std::max<Eigen::Index>(1, (count + most - 1) / most), title};
  if (drawn.every > 1)
    drawn.title = phrase({title + ", ", label_text("readings"),
                          fmt::format(" {} / {}", (count - 1) / drawn.every + 1, count)});
  return drawn;
}

ordered_json series_of(const PageText& name, const ordered_json& x, const ordered_json& y,
                       const std::string& mark) {
  ordered_json series;
  series["name"] = name;
  series["x"] = x;
  series["y"] = y;
  series["mark"] = mark;
  return series;
}

namespace {

/// Returns the labels of both kinds of pages, since charts use both.
std::vector<ReportLabel> all_labels() {
  std::vector<ReportLabel> all(report_labels().begin(), report_labels().end());
  all.insert(all.end(), chart_labels().begin(), chart_labels().end());
  return all;
}

/// Throws if a block uses an unknown label, at which the script of the page would stop. Labels of
/// blocks are { label } or text.
void check_labels(const ordered_json& json, const std::set<std::string>& known) {
  if (json.is_object() && json.contains("label")) {
    const auto key = json.at("label").get<std::string>();
    if (!known.count(key)) throw std::invalid_argument("the page names no label " + key);
  }
  if (json.is_structured())
    for (const ordered_json& one : json) check_labels(one, known);
}

/// Returns a list item with which a file can be saved from the page.
std::string download(const PageFile& file) {
  const std::string name = html::html_escaped(file.name);
  return "<li><a download=\"" + name + "\" href=\"data:application/octet-stream;base64," +
         base64(file.text) + "\">" + name + "</a></li>";
}

}  // namespace

std::string closing_section(const FiguresPage& page) {
  using namespace html;
  const ordered_json all_versions = versions();
  std::string text = label("asked", "h2") + "<dl>";
  for (const auto& [key, value] : page.asked) text += row(key.c_str(), value);
  text +=
      "</dl>" + label("warnings", "h2") + list(page.warnings) + label("versions", "h2") + "<dl>";
  for (const auto& [name, version] : all_versions.items())
    text += "<dt>" + html_escaped(name) + "</dt><dd>" + html_escaped(version.get<std::string>()) +
            "</dd>";
  text += "</dl>" + label("repeat", "h2") + "<p><code>" + html_escaped(page.command) +
          "</code></p><ul>";
  for (const PageFile& file : page.files) text += download(file);
  return text + "</ul>";
}

std::string page_html(const FiguresPage& page) {
  const std::vector<ReportLabel> labels = all_labels();
  std::set<std::string> known;
  for (const ReportLabel& one : labels) known.insert(std::string(one.key));
  check_labels(page.blocks, known);
  for (const auto& [key, value] : page.asked) check_labels({{"label", key}}, known);
  return html::filled(charts_page(),
                      {{"language", page.language},
                       {"title", html::html_escaped(page.title)},
                       {"style", std::string(charts_style())},
                       {"script", charts_script()},
                       {"script_hash", script_hash(charts_script())},
                       {"labels", html::in_script(html::labels_json(labels))},
                       {"words", closing_section(page)},
                       {"data", "<script type=\"application/json\" id=\"index\">" +
                                    html::in_script({{"blocks", page.blocks}}) + "</script>"}});
}

}  // namespace abbe::sim
