#include "sim/report/figures_page.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/files/json_files.h"
#include "sim/files/output.h"
#include "sim/files/program_file.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"

namespace abbe::sim {

using nlohmann::ordered_json;

PageText label_text(const std::string& key) {
  PageText label = PageText::object();
  label["label"] = key;
  return label;
}

PageText phrase(const std::vector<PageText>& texts) {
  PageText list = PageText::array();
  for (const PageText& text : texts) list.push_back(text);
  return list;
}

const ordered_json& require_figure(const ordered_json& json) {
  const auto is_number = [](const ordered_json& value) {
    return value.is_number() || value.is_null();
  };
  // An estimate has the limits of its confidence interval.
  const bool is_banded = json.is_object() && json.size() == 3 && json.contains("value") &&
                         json.contains("low") && json.contains("high") &&
                         std::all_of(json.begin(), json.end(), is_number);
  if (!is_number(json) && !is_banded)
    throw std::invalid_argument("not a figure: " + json.dump().substr(0, 60));
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
  for (const PageColumn& column : columns)
    block["columns"].push_back({{"head", column.head}, {"unit", column.unit}});
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
    ordered_json picture;
    picture["name"] = name.replace_extension().generic_string();
    picture["src"] = "data:image/png;base64," + base64(read_text(file, max_saved_bytes));
    block["pictures"].push_back(picture);
  }
  return block;
}

ReadingSubset reading_subset(const std::string& title, Eigen::Index count, Eigen::Index max_count) {
  ReadingSubset subset{std::max<Eigen::Index>(1, (count + max_count - 1) / max_count), title};
  if (subset.every > 1)
    subset.title = phrase({title + ", ", label_text("readings"),
                           fmt::format(" {} / {}", (count - 1) / subset.every + 1, count)});
  return subset;
}

ordered_json chart_series(const PageText& name, const ordered_json& x, const ordered_json& y,
                          const std::string& mark) {
  ordered_json series;
  series["name"] = name;
  series["x"] = x;
  series["y"] = y;
  series["mark"] = mark;
  return series;
}

namespace {

/// Returns the labels of maps and of charts: a page of charts uses both.
std::vector<ReportLabel> all_labels() {
  std::vector<ReportLabel> labels(report_labels().begin(), report_labels().end());
  labels.insert(labels.end(), chart_labels().begin(), chart_labels().end());
  return labels;
}

/// Throws std::invalid_argument for an unknown label, at which the script of the page would stop,
/// and for text in place of a figure or a picture, which the script would insert unescaped.
void check_block(const ordered_json& json, const std::set<std::string>& known_labels) {
  if (json.is_object() && json.contains("label")) {
    const auto key = json.at("label").get<std::string>();
    if (!known_labels.count(key)) throw std::invalid_argument("the page has no label " + key);
  }
  if (json.is_object() && json.contains("value")) require_figure(json.at("value"));
  if (json.is_object() && json.contains("src") &&
      json.at("src").get<std::string>().find('"') != std::string::npos)
    throw std::invalid_argument("a picture with a quotation mark in its source");
  if (json.is_structured())
    for (const ordered_json& element : json) check_block(element, known_labels);
}

/// Throws std::invalid_argument for a type of block that the script of the page does not draw, or
/// one without the lists that it reads.
void check_lists(const ordered_json& block) {
  static const std::map<std::string, std::vector<std::string>> lists{
      {"table", {"columns", "rows"}}, {"pictures", {"pictures"}}, {"bars", {"series", "rows"}},
      {"panels", {"panels"}},         {"histogram", {"series"}},  {"polar", {"panels"}}};
  const auto type = lists.find(block.at("type").get<std::string>());
  if (type == lists.end()) throw std::invalid_argument("the page has no block of this type");
  if (block.at("title").is_primitive() && !block.at("title").is_string())
    throw std::invalid_argument("a block without a title");
  for (const std::string& key : type->second)
    if (!block.at(key).is_array()) throw std::invalid_argument("a block without its list " + key);
}

/// Throws std::invalid_argument if a page has no valid blocks or request.
void check_page(const FiguresPage& page) {
  if (!page.blocks.is_array()) throw std::invalid_argument("blocks that are no list");
  std::set<std::string> known_labels;
  for (const ReportLabel& label : all_labels()) known_labels.insert(std::string(label.key));
  for (const ordered_json& block : page.blocks) {
    block.at("id").get<std::string>();
    check_lists(block);
    check_block(block, known_labels);
  }
  for (const auto& [key, value] : page.request) check_block({{"label", key}}, known_labels);
}

/// Returns a list item with the download link of a file.
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
  for (const auto& [key, value] : page.request) text += row(key.c_str(), value);
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

std::vector<PageFile> page_files(const std::vector<std::filesystem::path>& files) {
  std::vector<PageFile> contents;
  for (const std::filesystem::path& file : files)
    if (std::error_code ignored; std::filesystem::exists(file, ignored))
      contents.push_back({file.filename().string(), read_text(file, max_saved_bytes)});
  return contents;
}

ordered_json to_json(const FiguresPage& page) {
  return {{"title", page.title},
          {"request", page.request},
          {"warnings", page.warnings},
          {"command", page.command},
          {"blocks", page.blocks}};
}

FiguresPage read_page(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& files) {
  const std::string expected =
      "a page saved by abbe study, identify or evaluate; run that command again (a study with "
      "another --out)";
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored))
    throw BadInput(file.string(), 0, 0, expected, "no such file, as in results of older versions");
  FiguresPage page;
  read_saved_json(file, expected, [&](const ordered_json& json, const std::string&) {
    page.title = json.at("title");
    page.request = json.at("request");
    page.warnings = json.at("warnings");
    page.command = json.at("command");
    page.blocks = json.at("blocks");
    check_page(page);
  });
  page.files = page_files(files);
  std::vector<std::filesystem::path> written = files;
  written.insert(written.begin(), file);
  for (const std::filesystem::path& path : written)
    if (std::filesystem::exists(path, ignored) &&
        !writing_command(read_manifest(path.parent_path()), path))
      page.warnings.push_back(fmt::format(
          "{} was changed after abbe wrote it, or the manifest of its folder is missing",
          path.filename().string()));
  return page;
}

std::string page_html(const FiguresPage& page) {
  check_page(page);
  return html::filled(charts_page(),
                      {{"language", page.language},
                       {"title", html::html_escaped(page.title)},
                       {"style", std::string(charts_style())},
                       {"script", charts_script()},
                       {"script_hash", script_hash(charts_script())},
                       {"labels", html::in_script(html::labels_json(all_labels()))},
                       {"words", closing_section(page)},
                       {"data", "<script type=\"application/json\" id=\"index\">" +
                                    html::in_script({{"blocks", page.blocks}}) + "</script>"}});
}

}  // namespace abbe::sim
