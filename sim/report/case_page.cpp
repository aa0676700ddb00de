#include "sim/report/case_page.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/part_regions.h"
#include "sim/files/json_files.h"
#include "sim/report/figures_page.h"
#include "sim/report/map_formats.h"
#include "sim/report/maps_page.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"
#include "sim/report/picture_files.h"
#include "sim/report/summary.h"
#include "sim/report/verdict.h"

#if ABBE_RENDER
#include "render/residual_field.h"
#endif

namespace abbe::sim {

using std::filesystem::path;

/// A saved case: its figures, which contain its name, and the folder of its map.
struct SavedCase {
  nlohmann::ordered_json figures;
  std::filesystem::path folder;
};

/// Returns the maps that `run` or `compare` wrote as residual.vtp. These files do not store
/// regions: if the scene has regions, their omission is noted, as is every case without a file.
/// @throws BadInput for a file that is damaged or holds more than a page can
PartMaps saved_maps(const std::vector<SavedCase>& cases);

namespace {

using nlohmann::ordered_json;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double ms = 1e-3;

/// Returns the time intervals in which the program executes each line.
LineIntervals line_intervals(const Job& job) {
  LineIntervals intervals;
  for (const Segment& segment : job_segments(job)) {
    const program::Samples& samples = segment.samples;
    for (std::size_t k = 0; k < samples.line.size(); ++k) {
      if (k > 0 && samples.line[k] == samples.line[k - 1]) continue;
      intervals.line.push_back(samples.line[k]);
      // A sample belongs to the line that ends there.
      intervals.begin_ms.push_back(int(std::lround(samples.states[k > 0 ? k - 1 : 0].time_s / ms)));
    }
  }
  return intervals;
}

/// Returns the map with all vertices outside one region excluded from the figures.
cutting::Surface region_map(const cutting::Surface& surface, const cutting::Triangles& triangles,
                            const std::vector<int>& region, int number) {
  cutting::Surface map = surface;
  std::vector<bool> is_outside(region.size());
  for (std::size_t k = 0; k < region.size(); ++k) {
    is_outside[k] = region[k] != number;
    if (!is_outside[k]) continue;
    map.status[k] = cutting::VertexStatus::Outside;
    map.residual[Eigen::Index(k)] = nan;
  }
  for (Eigen::Index t = 0; t < map.within.size(); ++t)
    // A triangle across the border of a region has vertices of two regions and counts for neither.
    for (const int corner : triangles.row(t))
      if (is_outside[std::size_t(corner)]) map.within[t] = nan;
  std::erase_if(map.gouges,
                [&](const cutting::Gouge& gouge) { return is_outside[std::size_t(gouge.vertex)]; });
  return map;
}

/// Returns the figures of one region in um, null for figures that do not exist.
ordered_json region_statistics(const cutting::Statistics& s) {
  const auto um = [](const std::optional<double>& mm) {
    return mm ? ordered_json(*mm / units::um) : ordered_json();
  };
  return {{"pv", um(s.pv)},
          {"rms", um(s.rms)},
          {"mean", um(s.mean)},
          {"std", um(s.std_dev)},
          {"min", um(s.min)},
          {"max", um(s.max)},
          {"p95_abs", um(s.p95_abs)},
          {"cut", s.cut_vertices},
          {"in", s.conformance ? ordered_json(s.conformance->in) : ordered_json()}};
}

/// Adds the region of every vertex, and the figures of every region for the cases on the page.
void add_regions(PartMaps& maps, const std::vector<const ComparedCase*>& cases,
                 const cutting::Design& design) {
  const Job& job = *cases.front()->job;
  const auto& regions = job.scene.part.regions;
  if (regions.empty()) return;
  std::vector<int>& numbers = maps.region;
  for (Eigen::Index k = 0; k < design.vertices.rows(); ++k) {
    const PartRegion* match = region_at(job.scene.part, job.face_groups, region_point(design, k));
    numbers.push_back(match ? int(match - regions.data()) + 1 : 0);
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    ordered_json figures = ordered_json::object();
    for (const ComparedCase* compared : cases)
      figures[compared->verdict.cut.name] = region_statistics(cutting::statistics(
          region_map(compared->verdict.alignment.surface, design.triangles, numbers, int(r) + 1),
          compared->job->design_w, compared->verdict.tolerance));
    const std::optional<Tolerance>& tolerance =
        regions[r].tolerance ? regions[r].tolerance : job.scene.part.tolerance;
    maps.regions.push_back({{"name", regions[r].name},
                            {"judged", regions[r].judged},
                            {"tolerance_um", tolerance_um(tolerance)},
                            {"figures", figures}});
  }
}

/// Returns the maps of cases that were just cut, with the regions of the part and the time
/// intervals of the first case's program.
/// @param cases    at least one
/// @param figures  of the cases, as in comparison.json
PartMaps compared_maps(const std::vector<ComparedCase>& cases, const ordered_json& figures) {
  PartMaps maps;
  std::vector<const ComparedCase*> mapped_cases;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    ResultMap map = result_map(*cases[i].job, cases[i].verdict);
    CaseMap case_map{map.facts.case_name,     std::move(map.residual_um),
                     std::move(map.form_um),  std::move(map.cut_time_s),
                     std::move(map.cut_line), displayed_figures(figures.at(i))};
    if (add_case(maps, map.design, std::move(case_map))) mapped_cases.push_back(&cases[i]);
  }
  const Job& job = *cases.front().job;
  maps.line_intervals = line_intervals(job);
  add_regions(maps, mapped_cases,
              cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()));
  return maps;
}

using namespace html;

/// Returns a JSON value as text; null becomes a dash.
std::string plain_text(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "–" : value.dump();
}

/// Adds the time series of every case that has a map on the page.
void add_time_series(PageData& data, const std::vector<ComparedCase>& cases) {
  for (std::size_t number = 0; number < data.index["cases"].size(); ++number)
    for (const ComparedCase& compared : cases)
      if (compared.verdict.cut.name == data.index["cases"][number].at("name"))
        add_case_time_series(data, compared, number);
}

/// Returns the section with a still picture of every map, for printing and for browsers without
/// WebGL.
std::string pictures_section(const std::vector<ComparedCase>& cases) {
  constexpr int width_px = 900;
  std::vector<std::string> png(cases.size());
  // Drawing is serial, but other pictures can be prepared and compressed meanwhile.
  tbb::parallel_for(std::size_t(0), cases.size(), [&](std::size_t i) {
    png[i] = map_png(*cases[i].job, cases[i].verdict, width_px);
  });
  std::string text;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (png[i].empty()) continue;
    const std::string name = html_escaped(cases[i].verdict.cut.name);
    text += fmt::format(
        "<figure><img width=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\"></figure>\n",
        width_px, name, base64(png[i]));
  }
  return text.empty() ? "" : "<section id=\"pictures\">" + text + "</section>";
}

/// Returns a list of the tolerance verdicts and of the limits that cases exceed.
std::string verdict_list(const std::vector<ComparedCase>& cases) {
  std::vector<std::string> lines;
  for (const ComparedCase& compared : cases) {
    const std::string verdict =
        tolerance_verdict(compared.verdict.residual.conformance, compared.verdict.worst);
    if (!verdict.empty()) lines.push_back(compared.verdict.cut.name + ": " + verdict);
    for (const std::string& limit : exceeded_limits(compared.job->scene.limits, compared.verdict))
      lines.push_back(limit);
  }
  return list(lines);
}

/// Returns a list with the direction and a point of every axis.
std::string machine_section(const Job& job) {
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

/// Returns the text below the maps: verdicts, failed cases and axes, then request, warnings,
/// versions, and the command and scene that reproduce the page.
std::string details_section(const std::vector<ComparedCase>& cases, const Comparison& comparison,
                            const std::vector<std::string>& omissions, const PageOptions& options) {
  const Job& job = *cases.front().job;
  const auto& states = job.samples.states;
  FiguresPage page;
  page.request = {{"scene", comparison.scene},
                  {"seed", std::to_string(comparison.seed)},
                  {"vertices", std::to_string(comparison.vertices)},
                  {"moves", std::to_string(comparison.moves)},
                  {"datum", name_of(comparison.datum)},
                  {"alignment", name_of(comparison.alignment)},
                  {"tolerance_um", plain_text(tolerance_um(comparison.tolerance))},
                  {"program", job.path.file},
                  {"duration", fmt::format("{:.1f}", states.empty() ? 0.0 : states.back().time_s)}};
  page.warnings = comparison.warnings;
  page.warnings.insert(page.warnings.end(), omissions.begin(), omissions.end());
  page.command = options.command;
  page.files = {{"scene.toml", job.scene.resolved}};
  std::vector<std::string> failed;
  for (const FailedCase& failure : comparison.failed)
    failed.push_back(failure.name + ": " + failure.reason);
  return label("verdicts", "h2") + verdict_list(cases) +
         (failed.empty() ? "" : label("failed", "h2") + list(failed)) +
         label("machine_axes", "h2") + machine_section(job) + closing_section(page) +
         label("packed", "p") + label("packed_motion", "p");
}

}  // namespace

/// Draws the pictures and packs the maps in parallel: both take seconds and only read the cases.
HtmlReport html_report(const std::vector<ComparedCase>& cases, const Comparison& comparison,
                       const PageOptions& options) {
  const Job& job = *cases.front().job;
  const ordered_json figures = to_json(comparison.cases);
  HtmlReport report;
  MapsPage page{comparison.scene, options.language, {}, figures, {}, {}};
  tbb::parallel_invoke([&] { page.pictures = pictures_section(cases); },
                       [&] {
                         const PartMaps maps = compared_maps(cases, figures);
                         report.warnings = maps.omissions;
                         page.data = maps_data(maps, tolerance_um(comparison.tolerance));
                         add_time_series(page.data, cases);
                         for (const std::string& omission : add_machine(page.data, job))
                           report.warnings.push_back(omission);
                       });
  page.details = details_section(cases, comparison, report.warnings, options);
  report.html = page_html(page);
  return report;
}

#if ABBE_RENDER

namespace {

/// Throws BadInput if a map has no triangles or its values are too large to be packed.
void check_map_fits_page(const path& file, const render::Field& field, const CaseMap& case_map) {
  if (field.design.triangles.rows() == 0)
    throw BadInput(file.string(), 0, 0, "a part with triangles", "none");
  if (const auto limit = packing_limit(case_map))
    throw BadInput(file.string(), 0, 0, "a map that fits into a page", *limit + " out of range");
}

/// Throws BadInput if the maximum of the map differs from that of the figures: the files then are
/// not of the same run.
/// @param map_max  mm, of the vertices and of the samples within triangles; the figures include
/// both
void check_matches_figures(const path& file, const std::optional<double>& map_max,
                           const nlohmann::ordered_json& figures) {
  const auto& recorded = figures.at("residual_um").at("max");
  if (!recorded.is_number() || !map_max) return;
  const double recorded_max_um = recorded.get<double>(), map_max_um = *map_max / units::um;
  // The file and the JSON are rounded differently: by 1 nm, or by 1e-5 of a large value.
  if (std::abs(map_max_um - recorded_max_um) > 1e-3 + 1e-5 * std::abs(recorded_max_um))
    throw BadInput(
        file.string(), 0, 0,
        fmt::format("the map of these figures, with a maximum of {:.6g} um", recorded_max_um),
        fmt::format("a maximum of {:.6g} um", map_max_um));
}

/// Returns true if the file exists. Throws BadInput if its folder cannot be read.
bool file_exists(const path& file) {
  std::error_code error;
  const bool is_present = std::filesystem::exists(file, error);
  if (error) throw BadInput(file.string(), 0, 0, "a file", error.message());
  return is_present;
}

/// Adds a saved map to the page after checking that it belongs to the figures.
void add_saved_map(PartMaps& maps, const SavedCase& saved_case, const path& file) {
  render::Field field = render::read_residual(file);
  const std::optional<double> map_max = render::statistics(field).max;
  const std::string name = saved_case.figures.at("name").get<std::string>();
  CaseMap case_map{name,
                   std::move(field.deviation_um),
                   std::move(field.form_um),
                   std::move(field.cut_time_s),
                   std::move(field.cut_line),
                   displayed_figures(saved_case.figures)};
  check_map_fits_page(file, field, case_map);
  check_matches_figures(file, map_max, saved_case.figures);
  if (case_map.form_um.size() == 0)
    maps.omissions.push_back(fmt::format(
        "form and texture are omitted from the maps: {} has no form_um", file.string()));
  add_case(maps, field.design, std::move(case_map));
}

/// Returns true if the scene saved with a case has regions.
bool has_regions(const SavedCase& saved_case) {
  const path scene_file = saved_case.folder / "scene.toml";
  return file_exists(scene_file) &&
         read_text(scene_file, max_saved_bytes).find("[[part.region]]") != std::string::npos;
}

}  // namespace

PartMaps saved_maps(const std::vector<SavedCase>& cases) {
  PartMaps maps;
  for (const SavedCase& saved_case : cases) {
    const path file = saved_case.folder / "residual.vtp";
    if (file_exists(file))
      add_saved_map(maps, saved_case, file);
    else
      maps.omissions.push_back(
          fmt::format("{} is in the table but has no map: {} is missing (--save vtp writes it)",
                      saved_case.figures.at("name").get<std::string>(), file.string()));
  }
  if (std::ranges::any_of(cases, has_regions))
    maps.omissions.push_back(
        "the regions of the part are omitted from the report: saved maps do not contain them");
  return maps;
}

#else

PartMaps saved_maps(const std::vector<SavedCase>&) {
  PartMaps maps;
  maps.omissions.push_back(
      "interactive maps are omitted from the report: this program was built without ABBE_RENDER, "
      "which is needed to read them");
  return maps;
}

#endif

namespace {

/// Returns the file with the figures of a folder: that of `compare` if it exists, else of `run`.
path figures_file(const path& folder) {
  const path comparison = folder / "comparison.json";
  return std::filesystem::exists(comparison) ? comparison : folder / "summary.json";
}

/// Returns the folder that `compare` wrote for a case. The name comes from a file, so it must not
/// lead outside the results.
/// @throws std::invalid_argument
path saved_case_folder(const path& folder, const std::string& name) {
  const path inside = path(name).lexically_normal();
  if (inside.empty() || inside == "." || inside.is_absolute() || *inside.begin() == "..")
    throw std::invalid_argument("the case \"" + name +
                                "\", which is not the name of a folder in it");
  return folder / inside;
}

/// Returns the cases of the JSON; a summary describes one case, in the folder itself.
std::vector<SavedCase> saved_cases(const ordered_json& json, const path& folder) {
  std::vector<SavedCase> cases;
  if (!json.contains("cases")) {
    cases.push_back({json, folder});
    cases.back().figures["name"] = json.at("case");
    return cases;
  }
  if (json.at("cases").empty()) throw std::invalid_argument("no cases");
  for (const ordered_json& entry : json.at("cases")) {
    const std::string name = entry.at("name").get<std::string>();
    cases.push_back({entry, saved_case_folder(folder, name)});
    const auto has_same_folder = [&](const SavedCase& other) {
      return other.folder == cases.back().folder;
    };
    if (std::ranges::count_if(cases, has_same_folder) > 1)
      throw std::invalid_argument("the case \"" + name + "\" twice");
  }
  return cases;
}

/// Returns the table of the figures of all cases.
ordered_json saved_figures_block(const std::vector<SavedCase>& cases) {
  const char* keys[] = {"pv", "rms", "mean", "std", "min", "max", "p95_abs"};
  std::vector<PageColumn> columns{{label_text("case"), ""}};
  for (const char* key : keys) columns.push_back({label_text(key), ""});
  columns.push_back({label_text("maps_uncut_percent"), ""});
  ordered_json rows = ordered_json::array();
  for (const SavedCase& saved_case : cases) {
    const ordered_json& figures = saved_case.figures;
    ordered_json row = ordered_json::array();
    row.push_back(figures.at("name").get<std::string>());
    for (const char* key : keys) row.push_back(require_figure(figures.at("residual_um").at(key)));
    row.push_back(require_figure(figures.at("uncut_percent")));
    rows.push_back(row);
  }
  return table_block("figures", label_text("figures"), columns, rows);
}

/// Returns the pictures of the folder and of its cases, the picture of the comparison first.
std::vector<path> saved_pictures(const path& folder) {
  std::vector<path> files = files_below(folder);
  std::erase_if(files, [](const path& file) { return file.extension() != ".png"; });
  // Paths with fewer parts come first.
  std::ranges::sort(files, {}, [](const path& file) {
    return std::pair(std::distance(file.begin(), file.end()), file);
  });
  return files;
}

/// Returns a page with the title, request, warnings and command of the saved results, without
/// blocks.
FiguresPage saved_page_header(const ordered_json& json) {
  FiguresPage page;
  page.title = json.at("scene").get<std::string>();
  for (const char* key :
       {"scene", "seed", "vertices", "moves", "datum", "alignment", "tolerance_um"}) {
    page.request.push_back({key, plain_text(json.at(key))});
  }
  for (const ordered_json& warning : json.at("warnings"))
    page.warnings.push_back(warning.get<std::string>());
  const char* command = json.contains("cases") ? "compare" : "run";
  page.command = fmt::format("abbe {} scene.toml --report", command);
  page.warnings.push_back(
      fmt::format("the moving machine and its signals are omitted from the report: saved results "
                  "do not contain them; abbe {} --report writes them",
                  command));
  return page;
}

/// Saved results of a folder, without maps and pictures.
struct SavedResults {
  FiguresPage page;
  std::vector<SavedCase> cases;
  ordered_json tolerance_um;
};

/// Reads the figures of a folder, and the scene that the page offers for download.
SavedResults read_saved_results(const path& folder) {
  const path file = figures_file(folder);
  SavedResults saved;
  read_saved_json(
      file, "the figures of cases as written by abbe run or abbe compare",
      [&](const ordered_json& json, const std::string& text) {
        saved = {saved_page_header(json), saved_cases(json, folder), json.at("tolerance_um")};
        saved.page.blocks.push_back(saved_figures_block(saved.cases));
        for (const path& scene : {folder / "scene.toml", folder / "uncompensated" / "scene.toml"})
          if (std::filesystem::exists(scene) && saved.page.files.empty())
            saved.page.files.push_back({"scene.toml", read_text(scene, max_saved_bytes)});
        saved.page.files.push_back({file.filename().string(), text});
      });
  return saved;
}

/// Returns the section of the saved pictures for a page of maps; empty without pictures.
/// @param block  as `pictures_block` returns it
std::string saved_pictures_section(const ordered_json& block) {
  if (block.is_null()) return "";
  std::string text = "<section id=\"pictures\" class=\"saved\">";
  for (const ordered_json& picture : block.at("pictures")) {
    const std::string name = html::html_escaped(picture.at("name").get<std::string>());
    text +=
        fmt::format("<figure><figcaption>{0}</figcaption><img alt=\"{0}\" src=\"{1}\"></figure>\n",
                    name, picture.at("src").get<std::string>());
  }
  return text + "</section>";
}

/// Returns the section with the verdicts of all cases whose part has a tolerance.
std::string saved_verdicts_section(const std::vector<SavedCase>& cases) {
  std::vector<std::string> lines;
  for (const SavedCase& saved_case : cases) {
    const ordered_json conformance = saved_case.figures.value("conformance", ordered_json());
    if (conformance.is_object() && conformance.contains("verdict") &&
        conformance.at("verdict").is_string())
      lines.push_back(saved_case.figures.at("name").get<std::string>() + ": " +
                      conformance.at("verdict").get<std::string>());
  }
  return html::label("verdicts", "h2") + html::list(lines);
}

/// Returns the packed maps. Throws BadInput if a saved value is too large to be packed.
PageData pack_saved_maps(const SavedResults& saved, const PartMaps& maps, const path& folder) {
  try {
    return maps_data(maps, saved.tolerance_um);
  } catch (const std::invalid_argument& error) {
    throw BadInput(folder.string(), 0, 0, "maps that fit into a page", error.what());
  }
}

/// Returns the page of the saved results with their maps.
std::string maps_page_html(const SavedResults& saved, PageData data, const ordered_json& pictures) {
  MapsPage page{saved.page.title,
                saved.page.language,
                std::move(data),
                ordered_json::array(),
                saved_pictures_section(pictures),
                saved_verdicts_section(saved.cases) + closing_section(saved.page) +
                    html::label("packed", "p")};
  for (const SavedCase& saved_case : saved.cases) page.cases.push_back(saved_case.figures);
  return page_html(page);
}

}  // namespace

bool has_saved_cases(const path& folder) { return std::filesystem::exists(figures_file(folder)); }

HtmlReport saved_results_page(const path& folder, const std::string& language) {
  SavedResults saved = read_saved_results(folder);
  FiguresPage& page = saved.page;
  page.language = language;
  const PartMaps maps = saved_maps(saved.cases);
  page.warnings.insert(page.warnings.end(), maps.omissions.begin(), maps.omissions.end());
  const ordered_json pictures =
      pictures_block("pictures", label_text("pictures"), folder, saved_pictures(folder));
  if (!maps.cases.empty())
    return {maps_page_html(saved, pack_saved_maps(saved, maps, folder), pictures), page.warnings};
  if (!pictures.is_null()) page.blocks.push_back(pictures);
  return {page_html(page), page.warnings};
}

}  // namespace abbe::sim
