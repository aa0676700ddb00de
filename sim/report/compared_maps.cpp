#include "sim/report/compared_maps.h"

#include <cmath>
#include <limits>
#include <utility>

#include "kinematics/units.h"
#include "sim/cut/regions.h"
#include "sim/report/result_map.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double ms = 1e-3;

LineStretches stretches_of(const Job& job) {
  LineStretches all;
  for (const Job& part : parts_of(job)) {
    const program::Samples& samples = part.samples;
    for (std::size_t k = 0; k < samples.line.size(); ++k) {
      if (k > 0 && samples.line[k] == samples.line[k - 1]) continue;
      all.line.push_back(samples.line[k]);
      // a sample belongs to what ends there
      all.begin_ms.push_back(int(std::lround(samples.states[k > 0 ? k - 1 : 0].time_s / ms)));
    }
  }
  return all;
}

/// The map of what a region of the part holds, the rest not judged.
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
    for (const int corner : triangles.row(t))
      if (is_out[std::size_t(corner)]) inside.within[t] = nan;
  std::erase_if(inside.gouges,
                [&](const cutting::Gouge& one) { return is_out[std::size_t(one.vertex)]; });
  return inside;
}

ordered_json figures_of_region(const cutting::Statistics& s) {
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

/// The region of every vertex and the figures of all, of cases that are among the maps.
void add_regions(PartMaps& maps, const std::vector<const Compared*>& cases,
                 const cutting::Design& design) {
  const Job& job = *cases.front()->job;
  const auto& regions = job.scene.part.regions;
  if (regions.empty()) return;
  std::vector<int>& region = maps.region;
  for (Eigen::Index k = 0; k < design.vertices.rows(); ++k) {
    const PartRegion* one = region_at(job.scene.part, job.face_groups, region_place(design, k));
    region.push_back(one ? int(one - regions.data()) + 1 : 0);
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    ordered_json figures = ordered_json::object();
    for (const Compared* one : cases)
      figures[one->verdict.cut.name] = figures_of_region(cutting::statistics(
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
                std::move(map.cut_line), shown_figures(figures.at(i))};
    if (add_case(maps, map.design, std::move(one))) shown.push_back(&cases[i]);
  }
  const Job& job = *cases.front().job;
  maps.stretches = stretches_of(job);
  add_regions(maps, shown, cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()));
  return maps;
}

}  // namespace abbe::sim
