#include "sim/report/saved_maps.h"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/report/saved_json.h"

#if ABBE_RENDER
#include "render/field.h"
#include "render/surface_scene.h"
#endif

namespace abbe::sim {

using std::filesystem::path;

#if ABBE_RENDER

namespace {

/// What a file of a map must be besides a field to stand in a page.
void check_fits(const path& file, const render::Field& field, const CaseMap& one) {
  if (field.design.triangles.rows() == 0)
    throw BadInput(file.string(), 0, 0, "the triangles of a part", "none");
  if (const auto what = too_large_to_pack(one))
    throw BadInput(file.string(), 0, 0, "a map that a page can hold", *what + " beyond that");
}

/// The figures and the map of a case are written together; one of another case is refused.
void check_has_figures(const path& file, const render::Tally& counts,
                       const nlohmann::ordered_json& figures) {
  // a file has the vertices; where points between them count as well, theirs stand apart
  const auto vertices = figures.find("at_vertices_um");
  const bool apart = vertices != figures.end() && vertices->is_object();
  const auto& written = (apart ? *vertices : figures.at("residual_um")).at("max");
  const double highest = counts.highest_um;
  if (!written.is_number() || counts.cut == 0) return;
  const double wanted = written.get<double>();
  if (std::abs(highest - wanted) > 1e-3 + 1e-5 * std::abs(wanted))
    throw BadInput(file.string(), 0, 0,
                   fmt::format("the map of the figures, which reaches {:.6g} um", wanted),
                   fmt::format("one that reaches {:.6g} um", highest));
}

bool is_there(const path& file) {
  std::error_code fault;
  const bool found = std::filesystem::exists(file, fault);
  if (fault) throw BadInput(file.string(), 0, 0, "a file", fault.message());
  return found;
}

void add_saved(PartMaps& maps, const SavedCase& one, const path& file) {
  render::Field field = render::read_residual(file);
  const render::Tally counts = render::tally(field, 0.0);
  const std::string name = one.figures.at("name").get<std::string>();
  CaseMap map{name,
              std::move(field.deviation_um),
              std::move(field.form_um),
              std::move(field.cut_time_s),
              std::move(field.cut_line),
              shown_figures(one.figures)};
  check_fits(file, field, map);
  check_has_figures(file, counts, one.figures);
  if (map.form_um.size() == 0)
    maps.left_out.push_back(fmt::format(
        "form and texture are left out of the maps: {} holds no form_um", file.string()));
  add_case(maps, field.design, std::move(map));
}

bool has_regions(const SavedCase& one) {
  const path scene = one.folder / "scene.toml";
  return is_there(scene) &&
         read_text(scene, most_saved_bytes).find("[[part.region]]") != std::string::npos;
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

}  // namespace abbe::sim
