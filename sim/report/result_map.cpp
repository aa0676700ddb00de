#include "sim/report/result_map.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/files/versions.h"

namespace abbe::sim {

ResultMap result_map(const Job& job, const Verdict& verdict) {
  const cutting::Surface& surface = verdict.aligned.surface;
  ResultMap map;
  map.facts = {job.scene.title, verdict.cut.name, job.scene.seed, job.scene.part.form_cutoff, {}};
  map.facts.tolerance = job.scene.part.tolerance;
  map.design = cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
  map.residual_um = surface.residual / units::um;
  map.looked_within = surface.looked_within;
  map.within_um = surface.within / units::um;
  map.form_um = verdict.filtered / units::um;
  map.texture_um = map.residual_um - map.form_um;
  if (std::ranges::any_of(job.scene.part.regions,
                          [](const PartRegion& region) { return region.tolerance.has_value(); }))
    map.tolerance_um = verdict.tolerance / units::um;
  for (const cutting::VertexStatus one : surface.status) map.status.push_back(std::uint8_t(one));
  map.cut_time_s = surface.cut_time_s;
  map.cut_line = surface.cut_line;
  return map;
}

nlohmann::ordered_json to_json(const MapFacts& facts) {
  using nlohmann::ordered_json;
  return {{"unit", "mm"},
          {"residual_unit", "um"},
          {"sign", "+ material left, - gouged; along the outward normal of the design"},
          {"status", "0 cut, 1 uncut, 2 not judged, 3 gouged deeper than the band"},
          {"frame", "part"},
          {"scene", facts.scene},
          {"case", facts.case_name},
          {"seed", facts.seed},
          {"version", version()},
          {"form_cutoff_mm", facts.form_cutoff},
          {"tolerance_um", facts.tolerance ? ordered_json{facts.tolerance->lower / units::um,
                                                          facts.tolerance->upper / units::um}
                                           : ordered_json()}};
}

std::vector<std::pair<std::string, std::string>> fact_texts(const MapFacts& facts) {
  std::vector<std::pair<std::string, std::string>> texts;
  const nlohmann::ordered_json json = to_json(facts);  // items() is a view
  for (const auto& [name, value] : json.items())
    texts.emplace_back(name, escaped(value.is_string() ? value.get<std::string>()
                                     : value.is_null() ? "none"
                                                       : value.dump()));
  return texts;
}

}  // namespace abbe::sim
