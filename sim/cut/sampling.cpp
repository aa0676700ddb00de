#include "sim/cut/sampling.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/interpolation.h"
#include "cutting/refine.h"
#include "cutting/residual.h"
#include "cutting/subdivide.h"
#include "kinematics/units.h"
#include "sim/cut/meant.h"
#include "sim/cut/part.h"
#include "sim/cut/stopwatch.h"
#include "sim/cut/sweep.h"

namespace abbe::sim {
namespace {

using cutting::Design;
using cutting::VertexStatus;

/// Vertices that were put on crests do not stand for what is around them, and those of a map that
/// they do not resolve make waves of their own.
cutting::Surface::Within where_within(const Job& job, const Sweep& sweep,
                                      const cutting::Surface& nominal) {
  const cutting::InterpolationError error =
      cutting::interpolation_error(job.design_w, nominal, on_surface(job), sweep.surface,
                                   {.seed = job.scene.seed, .resolution = job.sampled->resolution});
  if (error.unresolved > unresolved_most) return cutting::Surface::Within::Random;
  return job.scene.part.sampling.kind == PartSampling::Kind::Adaptive
             ? cutting::Surface::Within::Middle
             : cutting::Surface::Within::None;
}

/// The gouges of a surface of which the statuses are known.
std::vector<cutting::Gouge> gouges_of(Design design, const cutting::Surface& surface,
                                      const Sweep& sweep) {
  bool any = false;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    design.judged[i] = surface.status[i] == VertexStatus::Gouged;
    any = any || design.judged[i];
  }
  return any ? sweep.surface(design).gouges : std::vector<cutting::Gouge>{};
}

cutting::Refined refined_for(const Job& job, const Sweep& sweep, SampledSurface& sampled,
                             const Progress& progress) {
  const PartSampling& wanted = job.scene.part.sampling;
  cutting::RefineOptions options;
  options.resolution = sampled.resolution;
  options.floor = wanted.finest;
  options.points = wanted.points;
  constexpr double nearly_all = 0.999;
  options.may_flip = std::holds_alternative<cutting::Primitive>(job.scene.part.shape) ||
                     job.recognised_share > nearly_all;
  if (progress) options.progress = [&](double fraction) { progress("sampling", fraction); };
  cutting::Refined refined = cutting::refined(
      job.design_w, on_surface(job),
      [&](const Design& places) {
        cutting::Surface surface = sweep.surface(places);
        cutting::Contacts contacts = sweep.contacts(places, surface);
        return cutting::Sounding{std::move(surface), std::move(contacts)};
      },
      options);
  sampled.reached = refined.reached;
  refined.surface.gouges = gouges_of(refined.design, refined.surface, sweep);
  return refined;
}

std::string spacing_text(const Design& design, const PartSampling& wanted) {
  double longest = 0.0;
  for (const auto& t : design.triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (design.judged[std::size_t(a)] && design.judged[std::size_t(b)])
        longest = std::max(longest, (design.vertices.row(a) - design.vertices.row(b)).norm());
    }
  if (!(longest > wanted.spacing)) return {};
  return fmt::format(
      "part.points = {} do not suffice for part.spacing_mm = {:.4g}: {:.4g} mm reached",
      wanted.points, wanted.spacing, longest);
}

/// A mesh that shows less of its surface than the map of it would resolve.
std::string coarse_facets_text(const Job& job) {
  const double resolution = job.sampled->resolution;
  Eigen::Index worst = 0;
  double most = 0.0;
  for (Eigen::Index v = 0; v < job.facet_miss.size(); ++v) {
    if (!job.design_w.judged[std::size_t(v)] || !(job.facet_miss[v] > resolution)) continue;
    if (job.facet_miss[v] > most) worst = v;
    most = std::max(most, job.facet_miss[v]);
  }
  if (!(most > 0.0)) return {};
  const Eigen::RowVector3d at = job.design_w.vertices.row(worst);
  return fmt::format(
      "where the mesh is no plane, sphere, cylinder, cone or torus its facets leave the surface "
      "that they stand for by up to about {:.3g} um, at ({:.4g}, {:.4g}, {:.4g}) of the workpiece: "
      "residuals below this are the mesh's; export it with finer facets",
      most / units::um, at.x(), at.y(), at.z());
}

}  // namespace

double usual_range(const cutting::Surface& surface, const Design& design) {
  constexpr double outer = 0.01;
  std::vector<std::pair<double, double>> values;  // residual, area
  double all = 0.0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    if (surface.status[i] != VertexStatus::Cut) continue;
    values.emplace_back(surface.residual[Eigen::Index(i)], design.area[Eigen::Index(i)]);
    all += values.back().second;
  }
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  double upto = 0.0, low = values.front().first, high = values.back().first;
  for (const auto& [value, area] : values) {
    if (upto <= outer * all) low = value;
    if (upto <= (1.0 - outer) * all) high = value;
    upto += area;
  }
  return high - low;
}

cutting::OnSurface on_surface(const Job& job) {
  return between_vertices(job.scene.part, job.recognised, job.scene.part.T_wm);
}

Job sampled(Job job, const Progress& progress) {
  Stopwatch watch;
  const Sweep sweep = error_free_sweep(job, options_of(job, {}));
  job.sampled = SampledSurface{.given = job.design_w.vertices.rows()};
  if (job.design_w.judged.empty())
    job.design_w.judged.assign(std::size_t(job.design_w.vertices.rows()), 1);
  cutting::Surface nominal = sweep.surface(job.design_w);
  std::vector<WhyUnmeant> why = leave_out_unmeant(job, nominal, {});
  const PartSampling& wanted = job.scene.part.sampling;
  job.sampled->resolution =
      wanted.resolution.value_or(cutting::usual_resolution(usual_range(nominal, job.design_w)));
  if (wanted.kind == PartSampling::Kind::Adaptive) {
    cutting::Refined refined = refined_for(job, sweep, *job.sampled, progress);
    job.design_w = std::move(refined.design);
    nominal = std::move(refined.surface);
  }
  if (wanted.kind == PartSampling::Kind::Spacing) {
    job.design_w =
        cutting::subdivided(job.design_w, on_surface(job), {wanted.spacing, wanted.points});
    if (std::string text = spacing_text(job.design_w, wanted); !text.empty())
      job.warnings.push_back(std::move(text));
    nominal = sweep.surface(job.design_w);
  }
  if (wanted.kind != PartSampling::Kind::Vertices)  // also of what was added between
    why = leave_out_unmeant(job, nominal, std::move(why));
  const MeantAreas areas = meant_areas(job, nominal, why);
  job.sampled->judged_area = areas.judged;
  job.sampled->unmeant = areas.unmeant;
  if (wanted.kind != PartSampling::Kind::Vertices)
    if (std::string text = coarse_facets_text(job); !text.empty())
      job.warnings.push_back(std::move(text));
  job.sampled->within = where_within(job, sweep, nominal);
  job.sampled->error_free = std::make_shared<const cutting::Surface>(std::move(nominal));
  if (job.sampled->unmeant.area() > 0.0) job.warnings.push_back(unmeant_text(*job.sampled));
  job.timing_s["sampling"] = watch.lap();
  return job;
}

}  // namespace abbe::sim
