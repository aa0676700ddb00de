#include "sim/report/result_files.h"

#include <algorithm>
#include <future>
#include <map>

#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/report/map_formats.h"
#include "sim/report/picture_files.h"
#include "sim/report/program_report.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary.h"
#include "sim/scene/toml.h"

#if ABBE_RENDER
#include "render/residual_field.h"
#endif

namespace abbe::sim {

namespace {

/// A case to be written and the requested formats.
struct SaveRequest {
  const Job& job;
  const Verdict& verdict;
  const std::vector<std::string>& formats;
  ResultMap map;
};

/// Returns the file name of a format.
std::string map_file_name(const std::string& format) {
  return format == track_format ? "track.npz" : "residual." + format;
}

/// Returns the facts, the figures of the map, and the list of its files.
nlohmann::ordered_json map_metadata_json(const SaveRequest& request) {
  nlohmann::ordered_json json = to_json(request.map.facts);
  const nlohmann::ordered_json figures = to_json(summary(request.job, request.verdict));
  for (const char* key : {"residual_um", "machine_um", "form_um", "texture_um", "vertices",
                          "cut_vertices", "uncut_vertices", "uncut_percent", "gouged_vertices",
                          "deepest_gouge_um", "deepest_gouge_is_bound", "outside_vertices"})
    json[key] = figures.at(key);
  json["triangles"] = request.map.design.triangles.rows();
  json["fields"] = {{"area_mm2", "a third of the triangles around a vertex"},
                    {"middle_um",
                     "deviation at the middle of a triangle (vtp, npz): it stands for three "
                     "quarters of the triangle in the statistics and a corner for a twelfth; where "
                     "it is nan, or there are none, a corner stands for a third"},
                    {"random_um",
                     "deviation at a place of a triangle at random, of maps that their vertices do "
                     "not resolve: it stands for the whole triangle"},
                    {"residual_um", "deviation along the normal, nan where not cut"},
                    {"form_um", "the residual through the areal Gaussian filter"},
                    {"texture_um", "the residual minus the form"},
                    {"status", json["status"]},
                    {"cut_time_s", "when the surface was made there"},
                    {"cut_line", "line of the program that made it, 0 where none did"}};
  json["files"] = nlohmann::ordered_json::array();
  for (const std::string& format : map_formats())
    if (std::ranges::find(request.formats, format) != request.formats.end())
      json["files"].push_back(map_file_name(format));
  return json;
}

using FormatWriter = void (*)(const ResultFile&, const SaveRequest&);

/// Returns the writers of all formats.
const std::map<std::string, FormatWriter>& format_writers() {
  static const std::map<std::string, FormatWriter> writers = {
#if ABBE_RENDER
    {"vtp",
     [](const ResultFile& file, const SaveRequest& request) {
       const ResultMap& map = request.map;
       write_file(file, [&](const std::filesystem::path& path) {
         render::write_residual(
             path,
             {map.design, map.residual_um, map.status, map.cut_time_s, map.cut_line,
              map.interior_sample, map.within_um, map.form_um, map.tolerance_um},
             fact_texts(map.facts));
       });
     }},
#endif
    {"ply", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_ply(request.map)); }},
    {"stl", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_stl(request.map)); }},
    {"csv", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_csv(request.map)); }},
    {"npz", [](const ResultFile& file,
               const SaveRequest& request) { write_file(file, to_npz(request.map)); }},
    {"json", [](const ResultFile& file,
                const SaveRequest& request) { write_json(file, map_metadata_json(request)); }},
    {track_format,
     [](const ResultFile& file, const SaveRequest& request) {
       const Job& job = request.job;
       write_file(file,
                  to_npz(in_part_frame(request.verdict.cut.track.value(), job.scene.part.T_wm),
                         kinematics::letters(job.machine.nominal.joints()), request.map.facts));
     }},
  };
  return writers;
}

}  // namespace

std::vector<std::string> map_formats() {
  std::vector<std::string> names;
  for (const char* name : {"vtp", "ply", "stl", "csv", "npz", "json", track_format})
    if (format_writers().contains(name)) names.emplace_back(name);
  return names;
}

std::vector<std::string> default_map_formats() {
  return format_writers().contains("vtp") ? std::vector<std::string>{"vtp"}
                                          : std::vector<std::string>{};
}

Retention required_retention(const std::vector<std::string>& formats) {
  return std::ranges::find(formats, track_format) == formats.end() ? Retention::Map
                                                                   : Retention::Track;
}

void write_map_files(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                     const std::vector<std::string>& formats, const Progress& progress) {
  const SaveRequest request{job, verdict, formats, result_map(job, verdict)};
  double written_count = 0.0;
  for (const auto& [format, write] : format_writers()) {
    if (progress) progress("write", written_count / double(format_writers().size()));
    written_count += 1.0;
    const ResultFile file = folder / map_file_name(format);
    if (std::ranges::find(formats, format) != formats.end())
      write(file, request);
    else
      // A file that an earlier run left would not belong to this case.
      remove_file(file);
  }
}

namespace {

/// Writes a file that only some cases have. If the text is empty, the file of an earlier run is
/// removed.
void write_or_remove(const ResultFile& file, const std::string& text) {
  if (text.empty())
    remove_file(file);
  else
    write_file(file, text);
}

/// Writes the collisions of a cut, or removes the file of an earlier run.
void write_collisions(const ResultFile& file, const Cut& cut) {
  if (!cut.collisions) return remove_file(file);
  Collisions collisions = *cut.collisions;
  collisions.commands = cut.name;
  write_json(file, to_json(collisions));
}

/// Writes the machined body as STL; its picture and ParaView file are written with the pictures.
void write_stock_mesh(const ResultFile& file, const Job& job, const Verdict& verdict) {
  if (!verdict.stock) return remove_file(file);
  write_file(file, to_stl(*verdict.stock, job, verdict));
}

}  // namespace

void write_program(const ResultFolder& folder, const Job& job) {
  if (job.program_text.empty()) return;
  write_file(folder / job.path.file, job.program_text);
}

void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress) {
  // Both threads use the manifest of the folder, which has a lock, and nothing else in common.
  std::future<void> files =
      std::async(std::launch::async, [&] { write_map_files(folder, job, verdict, formats, {}); });
  write_case_pictures(folder, job, verdict, progress);
  write_source_pictures(folder, job, verdict);
  write_or_remove(folder / "signals.csv", verdict.cut.signals.columns.empty()
                                              ? ""
                                              : escape_keeping_lines(to_csv(verdict.cut.signals)));
  write_file(folder / "scene.toml",
             "case = " + to_toml_value(verdict.cut.case_name) + "\n" + job.scene.resolved);
  const ResultFile rewritten_file =
      folder / ("rewritten" + std::filesystem::path(job.path.file).extension().string());
  write_or_remove(rewritten_file, verdict.cut.rewritten_program);
  write_stock_mesh(folder / "stock.stl", job, verdict);
  write_collisions(folder / "collisions.json", verdict.cut);
  files.get();
  // The summary is written last, so that its presence marks a finished case.
  write_json(folder / "summary.json", to_json(summary(job, verdict)));
}

}  // namespace abbe::sim
