#include "sim/report/saved_page.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/report/figures_page.h"
#include "sim/report/html_text.h"
#include "sim/report/maps_page.h"
#include "sim/report/page_blocks.h"
#include "sim/report/saved_json.h"
#include "sim/report/saved_maps.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

/// The file that has the figures.
path figures_file(const path& folder) {
  const path comparison = folder / "comparison.json";
  return std::filesystem::exists(comparison) ? comparison : folder / "summary.json";
}

/// What compare called a folder of its own.
path folder_of_case(const path& folder, const std::string& name) {
  const path inside = path(name).lexically_normal();
  if (inside.empty() || inside == "." || inside.is_absolute() || *inside.begin() == "..")
    throw std::invalid_argument("the case \"" + name + "\", which names no folder in it");
  return folder / inside;
}

/// The cases of the JSON; a summary is of one, which lies in the folder itself.
std::vector<SavedCase> saved_cases(const ordered_json& json, const path& folder) {
  std::vector<SavedCase> cases;
  if (!json.contains("cases")) {
    cases.push_back({json, folder});
    cases.back().figures["name"] = json.at("case");
    return cases;
  }
  if (json.at("cases").empty()) throw std::invalid_argument("no case");
  for (const ordered_json& one : json.at("cases")) {
    const std::string name = one.at("name").get<std::string>();
    cases.push_back({one, folder_of_case(folder, name)});
    const auto same = [&](const SavedCase& other) { return other.folder == cases.back().folder; };
    if (std::ranges::count_if(cases, same) > 1)
      throw std::invalid_argument("the case \"" + name + "\" twice");
  }
  return cases;
}

ordered_json saved_figures_block(const std::vector<SavedCase>& cases) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::vector<PageColumn> columns{{label_word("case"), ""}};
  for (const char* key : keys) columns.push_back({label_word(key), ""});
  columns.push_back({label_word("maps_uncut_percent"), ""});
  ordered_json rows = ordered_json::array();
  for (const SavedCase& saved : cases) {
    const ordered_json& one = saved.figures;
    ordered_json row = ordered_json::array();
    row.push_back(one.at("name").get<std::string>());
    for (const char* key : keys) row.push_back(figure_in(one.at("residual_um").at(key)));
    row.push_back(figure_in(one.at("uncut_percent")));
    rows.push_back(row);
  }
  return table_block("figures", label_word("figures"), columns, rows);
}

/// Pictures of the folder and of its cases, that of the comparison first.
std::vector<path> saved_pictures(const path& folder) {
  std::vector<path> files = saved_files(folder);
  std::erase_if(files, [](const path& file) { return file.extension() != ".png"; });
  std::ranges::sort(files, {}, [](const path& file) {
    return std::pair(std::distance(file.begin(), file.end()), file);
  });
  return files;
}

/// Words of the JSON.
FiguresPage words_of_saved(const ordered_json& json) {
  FiguresPage page;
  page.title = json.at("scene").get<std::string>();
  for (const char* key :
       {"scene", "seed", "vertices", "moves", "datum", "alignment", "tolerance_um"}) {
    const ordered_json& value = json.at(key);
    page.asked.push_back({key, value.is_string() ? value.get<std::string>()
                               : value.is_null() ? "–"
                                                 : value.dump()});
  }
  for (const ordered_json& one : json.at("warnings"))
    page.warnings.push_back(one.get<std::string>());
  const char* command = json.contains("cases") ? "compare" : "run";
  page.command = fmt::format("abbe {} scene.toml --report", command);
  page.warnings.push_back(
      fmt::format("the machine in motion and its signals are left out of the report: saved "
                  "results do not hold them; abbe {} --report writes them",
                  command));
  return page;
}

/// What was saved, as far as it is text.
struct Saved {
  FiguresPage page;
  std::vector<SavedCase> cases;
  ordered_json tolerance_um;
};

Saved read_saved(const path& folder) {
  const path file = figures_file(folder);
  Saved saved;
  with_saved_json(
      file, "the figures of cases as abbe run or abbe compare writes them",
      [&](const ordered_json& json, const std::string& text) {
        saved = {words_of_saved(json), saved_cases(json, folder), json.at("tolerance_um")};
        saved.page.blocks.push_back(saved_figures_block(saved.cases));
        for (const path& scene : {folder / "scene.toml", folder / "uncompensated" / "scene.toml"})
          if (std::filesystem::exists(scene) && saved.page.files.empty())
            saved.page.files.push_back({"scene.toml", read_text(scene, most_saved_bytes)});
        saved.page.files.push_back({file.filename().string(), text});
      });
  return saved;
}

/// Pictures of a block as they stand in a page of maps.
std::string section_of(const ordered_json& block) {
  if (block.is_null()) return "";
  std::string text = "<section id=\"pictures\" class=\"saved\">";
  for (const ordered_json& one : block.at("pictures")) {
    const std::string name = html::in_html(one.at("name").get<std::string>());
    text +=
        fmt::format("<figure><figcaption>{0}</figcaption><img alt=\"{0}\" src=\"{1}\"></figure>\n",
                    name, one.at("src").get<std::string>());
  }
  return text + "</section>";
}

/// Of every case whose part has a tolerance.
std::string verdicts(const std::vector<SavedCase>& cases) {
  std::vector<std::string> lines;
  for (const SavedCase& one : cases) {
    const ordered_json judged = one.figures.value("conformance", ordered_json());
    if (judged.is_object() && judged.contains("verdict") && judged.at("verdict").is_string())
      lines.push_back(one.figures.at("name").get<std::string>() + ": " +
                      judged.at("verdict").get<std::string>());
  }
  return html::label("verdicts", "h2") + html::list(lines);
}

PageData data_of(const Saved& saved, const PartMaps& maps, const path& folder) {
  try {
    return maps_data(maps, saved.tolerance_um);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(folder.string(), 0, 0, "maps that a page can hold", fault.what());
  }
}

std::string page_with_maps(const Saved& saved, PageData data, const ordered_json& pictures) {
  MapsPage page{saved.page.title,
                saved.page.language,
                std::move(data),
                ordered_json::array(),
                section_of(pictures),
                verdicts(saved.cases) + closing_words(saved.page) + html::label("packed", "p")};
  for (const SavedCase& one : saved.cases) page.cases.push_back(one.figures);
  return html_of(page);
}

}  // namespace

bool holds_saved_cases(const path& folder) { return std::filesystem::exists(figures_file(folder)); }

HtmlReport saved_page(const path& folder, const std::string& language) {
  Saved saved = read_saved(folder);
  FiguresPage& page = saved.page;
  page.language = language;
  const PartMaps maps = saved_maps(saved.cases);
  page.warnings.insert(page.warnings.end(), maps.left_out.begin(), maps.left_out.end());
  const ordered_json pictures =
      pictures_block("pictures", label_word("pictures"), folder, saved_pictures(folder));
  if (!maps.cases.empty())
    return {page_with_maps(saved, data_of(saved, maps, folder), pictures), page.warnings};
  if (!pictures.is_null()) page.blocks.push_back(pictures);
  return {html_of(page), page.warnings};
}

}  // namespace abbe::sim
