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

/// Returns the maps of cases as they were cut, with the regions of the part and the time intervals
/// of the first case's program.
/// @param cases    at least one
/// @param figures  of the cases, as in comparison.json
PartMaps compared_maps(const std::vector<Compared>& cases, const nlohmann::ordered_json& figures);

/// A saved case: its figures, with its name, and the folder that may hold its map.
struct SavedCase {
  nlohmann::ordered_json figures;
  std::filesystem::path folder;
};

/// Returns the maps that `run` or `compare` wrote as residual.vtp. Such files hold no regions:
/// regions of the scene are noted as an omission, and so are cases without a file.
/// @throws BadInput for a file that is damaged or holds more than a page can
PartMaps saved_maps(const std::vector<SavedCase>& cases);

namespace {

using nlohmann::ordered_json;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double ms = 1e-3;

/// Returns the time intervals in which the program runs each line.
LineIntervals stretches_of(const Job& job) {
  LineIntervals all;
  for (const Job& part : parts_of(job)) {
    const program::Samples& samples = part.samples;
    for (std::size_t k = 0; k < samples.line.size(); ++k) {
      if (k > 0 && samples.line[k] == samples.line[k - 1]) continue;
      all.line.push_back(samples.line[k]);
      // A sample belongs to the line that ends there.
      all.begin_ms.push_back(int(std::lround(samples.states[k > 0 ? k - 1 : 0].time_s / ms)));
    }
  }
  return all;
}

/// Returns the map of one region of the part, with the rest not judged.
cutting::Surface within_region(const cutting::Surface& surface, const cutting::Triangles& triangles,
                               const std::vector<int>& region, int number) {
  cutting::Surface inside = surface;
  std::vector<bool> is_out(region.size());
  for (std::size_t k = 0; k < region.size(); ++k) {
    is_out[k] = region[k] != number;
    if (!is_out[k]) continue;
    inside.status[k] = cutting::VertexStatus::Outside;
    inside.residual[Eigen::Index(k)] = nan;
  }
  for (Eigen::Index t = 0; t < inside.within.size(); ++t)
    // A triangle across the border of a region belongs to neither side.
    for (const int corner : triangles.row(t))
      if (is_out[std::size_t(corner)]) inside.within[t] = nan;
  std::erase_if(inside.gouges,
                [&](const cutting::Gouge& one) { return is_out[std::size_t(one.vertex)]; });
  return inside;
}

/// Returns the figures of one region, um; null where there are none.
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

/// Adds the region of every vertex, and the figures of all regions for the cases among the maps.
void add_regions(PartMaps& maps, const std::vector<const Compared*>& cases,
                 const cutting::Design& design) {
  const Job& job = *cases.front()->job;
  const auto& regions = job.scene.part.regions;
  if (regions.empty()) return;
  std::vector<int>& region = maps.region;
  for (Eigen::Index k = 0; k < design.vertices.rows(); ++k) {
    const PartRegion* one = region_at(job.scene.part, job.face_groups, region_point(design, k));
    region.push_back(one ? int(one - regions.data()) + 1 : 0);
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    ordered_json figures = ordered_json::object();
    for (const Compared* one : cases)
      figures[one->verdict.cut.name] = region_statistics(cutting::statistics(
          within_region(one->verdict.aligned.surface, design.triangles, region, int(r) + 1),
          one->job->design_w, one->verdict.tolerance));
    const std::optional<Tolerance>& tolerance =
        regions[r].tolerance ? regions[r].tolerance : job.scene.part.tolerance;
    maps.regions.push_back({{"name", regions[r].name},
                            {"judged", regions[r].judged},
                            {"tolerance_um", tolerance ? ordered_json{tolerance->lower / units::um,
                                                                      tolerance->upper / units::um}
                                                       : ordered_json()},
                            {"figures", figures}});
  }
}

}  // namespace

PartMaps compared_maps(const std::vector<Compared>& cases, const ordered_json& figures) {
  PartMaps maps;
  std::vector<const Compared*> shown;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    ResultMap map = result_map(*cases[i].job, cases[i].verdict);
    CaseMap one{map.facts.case_name,     std::move(map.residual_um),
                std::move(map.form_um),  std::move(map.cut_time_s),
                std::move(map.cut_line), displayed_figures(figures.at(i))};
    if (add_case(maps, map.design, std::move(one))) shown.push_back(&cases[i]);
  }
  const Job& job = *cases.front().job;
  maps.stretches = stretches_of(job);
  add_regions(maps, shown, cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()));
  return maps;
}

namespace {

using namespace html;

/// Returns a JSON value as text; null as a dash.
std::string plain(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "–" : value.dump();
}

/// Adds the time series of every case that is among the maps.
void add_time_series(PageData& data, const std::vector<Compared>& cases) {
  for (std::size_t number = 0; number < data.index["cases"].size(); ++number)
    for (const Compared& one : cases)
      if (one.verdict.cut.name == data.index["cases"][number].at("name"))
        add_case_time_series(data, one, number);
}

/// Returns a still picture of every map, for browsers that cannot turn one, and for print.
std::string pictures(const std::vector<Compared>& cases) {
  constexpr int width_px = 900;
  std::vector<std::string> png(cases.size());
  // One picture is prepared and another compressed while a third is drawn.
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

/// Returns the verdicts on tolerances, and the limits that cases exceed, as a list.
std::string verdicts(const std::vector<Compared>& cases) {
  std::vector<std::string> lines;
  for (const Compared& one : cases) {
    const std::string verdict =
        tolerance_verdict(one.verdict.residual.conformance, one.verdict.worst);
    if (!verdict.empty()) lines.push_back(one.verdict.cut.name + ": " + verdict);
    for (const std::string& limit : exceeded_limits(one.job->scene.limits, one.verdict))
      lines.push_back(limit);
  }
  return list(lines);
}

/// Returns direction and point of every axis as a list.
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

/// Returns the text below the maps: request, axes, verdicts, warnings, versions and the command to
/// repeat it.
std::string words(const std::vector<Compared>& cases, const ordered_json& json,
                  const std::vector<std::string>& left_out, const PageOptions& asked) {
  const Job& job = *cases.front().job;
  std::string text = label("asked", "h2") + "<dl>";
  for (const char* key :
       {"scene", "seed", "vertices", "moves", "datum", "alignment", "tolerance_um"})
    text += row(key, plain(json.at(key)));
  text += row("program", job.path.file) +
          row("duration",
              fmt::format("{:.1f}",
                          job.samples.states.empty() ? 0.0 : job.samples.states.back().time_s)) +
          "</dl>" + label("machine_axes", "h2") + machine_section(job) + label("verdicts", "h2") +
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
    text += "<dt>" + html_escaped(name) + "</dt><dd>" + html_escaped(plain(version)) + "</dd>";
  return text + "</dl>" + label("repeat", "h2") + "<p><code>" + html_escaped(asked.command) +
         "</code></p><p><a download=\"scene.toml\" href=\"data:application/toml;base64," +
         base64(job.scene.resolved) + "\">scene.toml</a> " + label("download") + "</p>";
}

}  // namespace

/// Pictures and maps are made in parallel: both take seconds and share nothing but the cases.
HtmlReport html_report(const std::vector<Compared>& cases, const Comparison& comparison,
                       const PageOptions& asked) {
  const Job& job = *cases.front().job;
  const ordered_json json = to_json(comparison);
  HtmlReport report;
  MapsPage page{comparison.scene, asked.language, {}, json.at("cases"), {}, {}};
  tbb::parallel_invoke([&] { page.pictures = pictures(cases); },
                       [&] {
                         const PartMaps maps = compared_maps(cases, json.at("cases"));
                         report.warnings = maps.left_out;
                         page.data = maps_data(maps, json.at("tolerance_um"));
                         add_time_series(page.data, cases);
                         for (const std::string& one : add_machine(page.data, job))
                           report.warnings.push_back(one);
                       });
  page.words = words(cases, json, report.warnings, asked);
  report.html = page_html(page);
  return report;
}

#if ABBE_RENDER

namespace {

/// Throws an input error if a map cannot be shown on a page.
void check_fits(const path& file, const render::Field& field, const CaseMap& one) {
  if (field.design.triangles.rows() == 0)
    throw BadInput(file.string(), 0, 0, "the triangles of a part", "none");
  if (const auto what = packing_limit(one))
    throw BadInput(file.string(), 0, 0, "a map that a page can hold", *what + " beyond that");
}

/// Throws an input error if a map does not belong to the figures: both are written together.
/// @param highest  mm, of the vertices and of the samples within triangles; both count in the
/// figures
void check_has_figures(const path& file, const std::optional<double>& highest,
                       const nlohmann::ordered_json& figures) {
  const auto& written = figures.at("residual_um").at("max");
  if (!written.is_number() || !highest) return;
  const double expected_um = written.get<double>(), highest_um = *highest / units::um;
  // The file and the JSON are rounded differently: 1 nm, or 1e-5 of a large value.
  if (std::abs(highest_um - expected_um) > 1e-3 + 1e-5 * std::abs(expected_um))
    throw BadInput(file.string(), 0, 0,
                   fmt::format("the map of the figures, which reaches {:.6g} um", expected_um),
                   fmt::format("one that reaches {:.6g} um", highest_um));
}

/// Returns true if the file exists; a folder that cannot be read is an input error.
bool is_there(const path& file) {
  std::error_code fault;
  const bool found = std::filesystem::exists(file, fault);
  if (fault) throw BadInput(file.string(), 0, 0, "a file", fault.message());
  return found;
}

/// Adds a saved map to the page after checking that it belongs to the figures.
void add_saved(PartMaps& maps, const SavedCase& one, const path& file) {
  render::Field field = render::read_residual(file);
  const std::optional<double> highest = render::statistics(field).max;
  const std::string name = one.figures.at("name").get<std::string>();
  CaseMap map{name,
              std::move(field.deviation_um),
              std::move(field.form_um),
              std::move(field.cut_time_s),
              std::move(field.cut_line),
              displayed_figures(one.figures)};
  check_fits(file, field, map);
  check_has_figures(file, highest, one.figures);
  if (map.form_um.size() == 0)
    maps.left_out.push_back(fmt::format(
        "form and texture are left out of the maps: {} holds no form_um", file.string()));
  add_case(maps, field.design, std::move(map));
}

/// Returns true if the scene saved with a case has regions.
bool has_regions(const SavedCase& one) {
  const path scene = one.folder / "scene.toml";
  return is_there(scene) &&
         read_text(scene, max_saved_bytes).find("[[part.region]]") != std::string::npos;
}

}  // namespace

PartMaps saved_maps(const std::vector<SavedCase>& cases) {
  PartMaps maps;
  for (const SavedCase& one : cases) {
    const path file = one.folder / "residual.vtp";
    if (is_there(file))
      add_saved(maps, one, file);
    else
      maps.left_out.push_back(
          fmt::format("{} is in the table and not among the maps: {}, which --save vtp writes, is "
                      "not there",
                      one.figures.at("name").get<std::string>(), file.string()));
  }
  if (std::ranges::any_of(cases, has_regions))
    maps.left_out.push_back(
        "the regions of the part are left out of the report: saved maps do not hold them");
  return maps;
}

#else

PartMaps saved_maps(const std::vector<SavedCase>&) {
  PartMaps maps;
  maps.left_out.push_back(
      "maps to turn are left out of the report: this abbe was built without ABBE_RENDER, which "
      "reads them");
  return maps;
}

#endif

namespace {

/// Returns the file that holds the figures of a folder.
path figures_file(const path& folder) {
  const path comparison = folder / "comparison.json";
  return std::filesystem::exists(comparison) ? comparison : folder / "summary.json";
}

/// Returns the folder that `compare` wrote for a case. A name from a file must not lead outside the
/// results.
path saved_case_folder(const path& folder, const std::string& name) {
  const path inside = path(name).lexically_normal();
  if (inside.empty() || inside == "." || inside.is_absolute() || *inside.begin() == "..")
    throw std::invalid_argument("the case \"" + name + "\", which names no folder in it");
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
  if (json.at("cases").empty()) throw std::invalid_argument("no case");
  for (const ordered_json& one : json.at("cases")) {
    const std::string name = one.at("name").get<std::string>();
    cases.push_back({one, saved_case_folder(folder, name)});
    const auto same = [&](const SavedCase& other) { return other.folder == cases.back().folder; };
    if (std::ranges::count_if(cases, same) > 1)
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
  for (const SavedCase& saved : cases) {
    const ordered_json& one = saved.figures;
    ordered_json row = ordered_json::array();
    row.push_back(one.at("name").get<std::string>());
    for (const char* key : keys) row.push_back(figure_in(one.at("residual_um").at(key)));
    row.push_back(figure_in(one.at("uncut_percent")));
    rows.push_back(row);
  }
  return table_block("figures", label_text("figures"), columns, rows);
}

/// Returns the pictures of the folder and of its cases, the picture of the comparison first.
std::vector<path> saved_pictures(const path& folder) {
  std::vector<path> files = saved_files(folder);
  std::erase_if(files, [](const path& file) { return file.extension() != ".png"; });
  // Paths with fewer parts come first.
  std::ranges::sort(files, {}, [](const path& file) {
    return std::pair(std::distance(file.begin(), file.end()), file);
  });
  return files;
}

/// Returns the page with the texts of the JSON.
FiguresPage saved_page_header(const ordered_json& json) {
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

/// The saved results as far as they are text.
struct Saved {
  FiguresPage page;
  std::vector<SavedCase> cases;
  ordered_json tolerance_um;
};

/// Reads the JSON of a folder, and the scene to be offered for download.
Saved read_saved(const path& folder) {
  const path file = figures_file(folder);
  Saved saved;
  read_saved_json(
      file, "the figures of cases as abbe run or abbe compare writes them",
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

/// Returns the section of the pictures for a page of maps.
std::string section_of(const ordered_json& block) {
  if (block.is_null()) return "";
  std::string text = "<section id=\"pictures\" class=\"saved\">";
  for (const ordered_json& one : block.at("pictures")) {
    const std::string name = html::html_escaped(one.at("name").get<std::string>());
    text +=
        fmt::format("<figure><figcaption>{0}</figcaption><img alt=\"{0}\" src=\"{1}\"></figure>\n",
                    name, one.at("src").get<std::string>());
  }
  return text + "</section>";
}

/// Returns the verdicts of all cases whose part has a tolerance.
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

/// Returns the packed maps. Too large a value in a saved file is an input error.
PageData data_of(const Saved& saved, const PartMaps& maps, const path& folder) {
  try {
    return maps_data(maps, saved.tolerance_um);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(folder.string(), 0, 0, "maps that a page can hold", fault.what());
  }
}

/// Returns the page with maps to turn; without any map the figures stand alone.
std::string maps_page_html(const Saved& saved, PageData data, const ordered_json& pictures) {
  MapsPage page{saved.page.title,
                saved.page.language,
                std::move(data),
                ordered_json::array(),
                section_of(pictures),
                verdicts(saved.cases) + closing_section(saved.page) + html::label("packed", "p")};
  for (const SavedCase& one : saved.cases) page.cases.push_back(one.figures);
  return page_html(page);
}

}  // namespace

bool has_saved_cases(const path& folder) { return std::filesystem::exists(figures_file(folder)); }

HtmlReport saved_page(const path& folder, const std::string& language) {
  Saved saved = read_saved(folder);
  FiguresPage& page = saved.page;
  page.language = language;
  const PartMaps maps = saved_maps(saved.cases);
  page.warnings.insert(page.warnings.end(), maps.left_out.begin(), maps.left_out.end());
  const ordered_json pictures =
      pictures_block("pictures", label_text("pictures"), folder, saved_pictures(folder));
  if (!maps.cases.empty())
    return {maps_page_html(saved, data_of(saved, maps, folder), pictures), page.warnings};
  if (!pictures.is_null()) page.blocks.push_back(pictures);
  return {page_html(page), page.warnings};
}

}  // namespace abbe::sim
