#include "sim/report/saved_page.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "kinematics/text.h"
#include "sim/report/page_blocks.h"
#include "sim/report/saved_json.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

/// The file that has the figures.
path figures_file(const path& folder) {
  const path comparison = folder / "comparison.json";
  return std::filesystem::exists(comparison) ? comparison : folder / "summary.json";
}

ordered_json saved_figures_block(const std::vector<ordered_json>& cases, const char* name_key) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::vector<PageColumn> columns{{label_word("case"), ""}};
  for (const char* key : keys) columns.push_back({label_word(key), ""});
  columns.push_back({label_word("maps_uncut_percent"), ""});
  ordered_json rows = ordered_json::array();
  for (const ordered_json& one : cases) {
    ordered_json row = ordered_json::array();
    row.push_back(one.at(name_key).get<std::string>());
    for (const char* key : keys) row.push_back(figure_in(one.at("residual_um").at(key)));
    row.push_back(figure_in(one.at("uncut_percent")));
    rows.push_back(row);
  }
  return table_block("figures", label_word("figures"), columns, rows);
}

/// Pictures of the folder and of its cases, that of the comparison first.
std::vector<path> saved_pictures(const path& folder) {
  std::vector<path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().extension() == ".png")
      files.push_back(entry.path());
  std::ranges::sort(files, {}, [](const path& file) {
    return std::pair(std::distance(file.begin(), file.end()), file);
  });
  return files;
}

/// Figures and words of the JSON; a summary is of one case.
FiguresPage page_of_saved(const ordered_json& json) {
  FiguresPage page;
  page.title = json.at("scene").get<std::string>();
  if (json.contains("cases"))
    page.blocks.push_back(
        saved_figures_block({json.at("cases").begin(), json.at("cases").end()}, "name"));
  else
    page.blocks.push_back(saved_figures_block({json}, "case"));
  for (const char* key : {"scene", "seed", "vertices", "moves", "datum", "alignment"}) {
    const ordered_json& value = json.at(key);
    page.asked.push_back({key, value.is_string() ? value.get<std::string>() : value.dump()});
  }
  for (const ordered_json& one : json.at("warnings"))
    page.warnings.push_back(one.get<std::string>());
  const bool is_run = !json.contains("cases");
  page.command = is_run ? "abbe run scene.toml --report" : "abbe compare scene.toml --report";
  page.warnings.push_back(std::string("maps to turn and the machine in motion are left out of the "
                                      "report: saved results hold neither; abbe ") +
                          (is_run ? "run" : "compare") + " --report writes them");
  return page;
}

}  // namespace

bool holds_saved_cases(const path& folder) { return std::filesystem::exists(figures_file(folder)); }

FiguresPage saved_page(const path& folder) {
  const path file = figures_file(folder);
  FiguresPage page;
  with_saved_json(
      file, "the figures of cases as abbe run or abbe compare writes them",
      [&](const ordered_json& json, const std::string& text) {
        page = page_of_saved(json);
        if (const ordered_json pictures =
                pictures_block("pictures", label_word("pictures"), folder, saved_pictures(folder));
            !pictures.is_null())
          page.blocks.push_back(pictures);
        for (const path& scene : {folder / "scene.toml", folder / "uncompensated" / "scene.toml"})
          if (std::filesystem::exists(scene) && page.files.empty())
            page.files.push_back({"scene.toml", read_text(scene, most_saved_bytes)});
        page.files.push_back({file.filename().string(), text});
      });
  return page;
}

}  // namespace abbe::sim
