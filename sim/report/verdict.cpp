#include "sim/report/verdict.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "cutting/map/areal_filter.h"
#include "kinematics/units.h"
#include "sim/cut/part_regions.h"
#include "sim/cut/scene_checks.h"

namespace abbe::sim {

namespace {

/// Returns the texture parameters of the residual minus its form. Vertices and sampled points are
/// weighted by the area that they represent. Empty if nothing is cut.
std::optional<errors::metrology::ArealParameters> areal_texture(const cutting::Design& design,
                                                                const cutting::Surface& surface,
                                                                const Eigen::VectorXd& form_map) {
  const cutting::Weights weights = cutting::weights(surface, design);
  std::vector<double> texture, area;
  for (Eigen::Index i = 0; i < form_map.size(); ++i) {
    if (!std::isfinite(form_map[i])) continue;
    texture.push_back(surface.residual[i] - form_map[i]);
    area.push_back(weights.vertex[i]);
  }
  Eigen::VectorXd within = surface.within;
  tbb::parallel_for(Eigen::Index(0), within.size(), [&](Eigen::Index t) {
    within[t] -= cutting::value_at_sample(surface.interior_sample, form_map, design.triangles, t);
  });
  for (Eigen::Index t = 0; t < weights.within.size(); ++t) {
    if (!(weights.within[t] > 0.0)) continue;
    texture.push_back(within[t]);
    area.push_back(weights.within[t]);
  }
  const auto n = Eigen::Index(texture.size());
  const Eigen::Map<const Eigen::VectorXd> heights(texture.data(), n), areas(area.data(), n);
  if (!(areas.sum() > 0.0)) return std::nullopt;
  return errors::metrology::areal(Eigen::MatrixX2d::Zero(n, 2), heights, areas,
                                  {.reference = errors::metrology::ArealReference::Mean});
}

}  // namespace

FormTextureSplit split_form_texture(const Job& job, const cutting::Surface& surface,
                                    const cutting::ToleranceBands& tolerance) {
  FormTextureSplit split;
  split.form_map = cutting::gaussian_form(job.design_w, surface, job.scene.part.form_cutoff);
  cutting::Surface form = surface;
  form.residual = split.form_map;
  form.interior_sample = cutting::Surface::InteriorSample::None;
  form.within.resize(0);  // the form is smooth, so its vertices suffice
  split.form_statistics = cutting::statistics(form, job.design_w, tolerance);
  // With too few random points the filter compares each with distant ones, so that their texture
  // would be meaningless.
  if (surface.interior_sample != cutting::Surface::InteriorSample::Random ||
      cutting::resolves_form(job.design_w, job.scene.part.form_cutoff))
    split.texture = areal_texture(job.design_w, surface, split.form_map);
  return split;
}

namespace {

/// Returns a vertex in the part frame. If it is gouged, its residual is the negative depth of the
/// gouge.
Verdict::ExtremePoint vertex_point(const Job& job, const cutting::Surface& surface, int vertex) {
  const Eigen::Vector3d p_w = job.design_w.vertices.row(vertex);
  Verdict::ExtremePoint point{surface.residual[vertex], job.scene.part.T_wm.inverse() * p_w,
                              surface.cut_line[std::size_t(vertex)], false};
  for (const cutting::Gouge& gouge : surface.gouges) {
    if (gouge.vertex != vertex) continue;
    point.residual = -gouge.depth;
    point.is_bound = gouge.continues_deeper;
  }
  return point;
}

/// Returns the sampled point of a triangle in the part frame. Its program line is that of the
/// nearest corner.
Verdict::ExtremePoint triangle_point(const Job& job, const cutting::Surface& surface,
                                     int triangle) {
  const cutting::Triangles& triangles = job.design_w.triangles;
  const Eigen::Vector3d p_w =
      cutting::value_at_sample(surface.interior_sample, job.design_w.vertices, triangles, triangle);
  const auto weights = cutting::sample_barycentric(surface.interior_sample, triangle);
  const auto nearest = std::max_element(weights.begin(), weights.end()) - weights.begin();
  const int corner = triangles(triangle, nearest);
  return {surface.within[triangle], job.scene.part.T_wm.inverse() * p_w,
          surface.cut_line[std::size_t(corner)], false};
}

/// Returns the vertex or sampled point of a sample in the part frame.
Verdict::ExtremePoint sample_point(const Job& job, const cutting::Surface& surface,
                                   const cutting::SampleValue& sample) {
  return sample.vertex >= 0 ? vertex_point(job, surface, sample.vertex)
                            : triangle_point(job, surface, sample.triangle);
}

/// Sets the extreme points of a verdict. A gouge deeper than the searched band is lower than any
/// cut vertex.
void find_extremes(const Job& job, Verdict& verdict) {
  const cutting::Surface& surface = verdict.alignment.surface;
  const cutting::Statistics& s = verdict.residual;
  if (s.highest) verdict.highest = sample_point(job, surface, *s.highest);
  if (s.deepest)
    verdict.lowest = vertex_point(job, surface, s.deepest->vertex);
  else if (s.lowest)
    verdict.lowest = sample_point(job, surface, *s.lowest);
  if (s.conformance && s.conformance->vertex >= 0)
    verdict.worst = vertex_point(job, surface, s.conformance->vertex);
  if (s.conformance && s.conformance->triangle >= 0)
    verdict.worst = triangle_point(job, surface, s.conformance->triangle);
}

/// Returns a warning if the facets of a mesh may deviate from the true surface by more than the PV
/// of the map; else empty.
std::string facet_warning(const Job& job, const cutting::Statistics& residual) {
  if (!std::holds_alternative<MeshFile>(job.scene.part.shape) || !residual.pv) return {};
  const double facet_error = cutting::coarseness(job.design_w).max_facet_error;
  if (facet_error <= *residual.pv) return {};
  return fmt::format(
      "the mesh is too coarse for this result: between judged vertices its facets deviate by up to "
      "{:.4g} um, and PV is {:.4g} um",
      facet_error / units::um, *residual.pv / units::um);
}

/// Returns a warning if a tolerance or limit is probably in the wrong unit, because it differs from
/// the PV of the uncompensated machine by a factor of more than 250; else empty. Machines without
/// errors and compensated cases are not checked, since a compensator may reduce PV to a thousandth.
std::string tolerance_warning(const Job& job, const Cut& cut, const cutting::Statistics& map) {
  // A wrong unit is a factor of 1000, of which a factor of 4 may be due to the machine.
  constexpr double max_ratio = 250.0;
  if (cut.case_name != "uncompensated" || !map.pv || !(cut.tip_error.max > 0.0)) return {};
  const double pv_um = *map.pv / units::um;
  const auto text = [&](const char* key, double width_um) -> std::string {
    if (width_um >= pv_um / max_ratio && width_um <= max_ratio * pv_um) return {};
    return fmt::format(
        "{} allows {:.4g} um, but PV without compensation is {:.4g} um: the key is in um, and the "
        "value may be in {}",
        key, width_um, pv_um, width_um < pv_um ? "mm" : "nm");
  };
  if (!(pv_um > 0.0)) return {};
  const std::optional<double> half_width = narrowest_half_width(job.scene.part);
  if (half_width && *half_width > 0.0)
    if (std::string warning = text("part.tolerance_um", 2.0 * *half_width / units::um);
        !warning.empty())
      return warning;
  const std::optional<double> limit = job.scene.limits.pv_um;
  return limit && *limit > 0.0 ? text("limits.pv_um", *limit) : "";
}

/// Returns the mean radius of each ring of the part, weighted by area.
std::vector<Verdict::Ring> ring_results(const Job& job, const cutting::Surface& surface) {
  if (job.scene.part.rings.empty()) return {};
  const cutting::Design part = cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
  const cutting::Weights weights = cutting::weights(surface, part);
  const auto radius = [&](Eigen::Index v, double residual) {
    return (part.vertices.row(v) + residual * part.normals.row(v)).head<2>().norm();
  };
  std::vector<Verdict::Ring> rings;
  for (const PartDescription::Ring& ring : job.scene.part.rings) {
    double weighted_sum = 0.0, area = 0.0;
    const auto add = [&](double z, double weight, double radius) {
      if (!(weight > 0.0) || std::abs(z - ring.z_middle) > 0.5 * ring.width) return;
      weighted_sum += weight * radius;
      area += weight;
    };
    for (Eigen::Index v = 0; v < weights.vertex.size(); ++v)
      add(part.vertices(v, 2), weights.vertex[v], radius(v, surface.residual[v]));
    for (Eigen::Index t = 0; t < weights.within.size(); ++t) {
      if (!(weights.within[t] > 0.0)) continue;
      const std::array<double, 3> corner_weights =
          cutting::sample_barycentric(surface.interior_sample, t);
      double z = 0.0, mean = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Index v = part.triangles(t, Eigen::Index(k));
        z += corner_weights[k] * part.vertices(v, 2);
        mean += corner_weights[k] * radius(v, surface.within[t]);
      }
      add(z, weights.within[t], mean);
    }
    rings.push_back({ring.name, std::nullopt});
    if (area > 0.0) rings.back().radius = weighted_sum / area;
  }
  return rings;
}

}  // namespace

const char* name_of(DatumDescription::Kind kind) {
  switch (kind) {
    case DatumDescription::Kind::None:
      return "none";
    case DatumDescription::Kind::Ideal:
      return "ideal";
    case DatumDescription::Kind::TouchOff:
      return "touch_off";
  }
  return "";
}

const char* name_of(Alignment alignment) {
  switch (alignment) {
    case Alignment::None:
      return "none";
    case Alignment::Offset:
      return "offset";
    case Alignment::Rigid:
      return "rigid";
  }
  return "";
}

Verdict judge(const Job& job, Cut cut, const Verdict* error_free) {
  Verdict verdict;
  verdict.alignment = cutting::aligned(cut.surface, job.design_w, {job.scene.alignment});
  verdict.tolerance = tolerance_bands(job.scene.part, job.face_groups, job.design_w);
  verdict.residual =
      cutting::statistics(verdict.alignment.surface, job.design_w, verdict.tolerance);
  find_extremes(job, verdict);
  FormTextureSplit split = split_form_texture(job, verdict.alignment.surface, verdict.tolerance);
  verdict.form_map = std::move(split.form_map);
  verdict.form_statistics = std::move(split.form_statistics);
  verdict.texture = split.texture;
  if (error_free != nullptr) {
    verdict.machine_contribution = cutting::statistics(
        cutting::minus(verdict.alignment.surface, error_free->alignment.surface), job.design_w);
  }
  for (std::string text :
       {facet_warning(job, verdict.residual), tolerance_warning(job, cut, verdict.residual)})
    if (!text.empty()) cut.warnings.push_back(std::move(text));
  verdict.rings = ring_results(job, verdict.alignment.surface);
  for (const Verdict::Ring& ring : verdict.rings)
    if (!ring.radius) cut.warnings.push_back("no cut vertices on the ring " + ring.name);
  if (const auto* primitive = std::get_if<cutting::Primitive>(&job.scene.part.shape))
    verdict.form_deviations = cutting::form(
        *primitive, cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()), cut.surface);
  verdict.cut = std::move(cut);
  return verdict;
}

std::string tolerance_verdict(const std::optional<cutting::Conformance>& conformance,
                              const std::optional<Verdict::ExtremePoint>& worst) {
  if (!conformance) return {};
  if (conformance->passes()) return "PASS";
  if (!worst)
    return fmt::format("FAIL: {:.2g} % of the judged area is not cut", conformance->uncut);
  return fmt::format("FAIL by {}{:.4g} um at ({:.1f}, {:.1f}, {:.1f}) of the part, line {}",
                     worst->is_bound ? "more than " : "", conformance->excess / units::um,
                     worst->position_m.x(), worst->position_m.y(), worst->position_m.z(),
                     worst->line);
}

std::vector<std::string> exceeded_limits(const Limits& limits, const Verdict& verdict) {
  std::vector<std::string> messages;
  const auto check = [&](const char* figure_name, const std::optional<double>& limit_um,
                         std::optional<double> value) {
    // A limit on an unknown value counts as exceeded, so that no case passes unchecked.
    if (limit_um && !value)
      messages.push_back(fmt::format(
          "{}: {} is unknown, because nothing was cut within the band; the scene allows {:.4f} um",
          verdict.cut.name, figure_name, *limit_um));
    if (limit_um && value && *value / units::um > *limit_um)
      messages.push_back(fmt::format("{}: {} is {:.4f} um, the scene allows {:.4f} um",
                                     verdict.cut.name, figure_name, *value / units::um, *limit_um));
  };
  if (verdict.cut.collisions && !is_clear(*verdict.cut.collisions))
    messages.push_back(
        fmt::format("{}: {} collisions", verdict.cut.name, contacts(*verdict.cut.collisions)));
  const cutting::Statistics& s = verdict.residual;
  const bool has_limit = limits.pv_um || limits.rms_um || limits.max_abs_um || limits.form_pv_um ||
                         limits.form_rms_um || limits.texture_sa_um || limits.texture_sq_um ||
                         limits.texture_sz_um;
  // The figures do not include gouges beyond the searched band, so such a gouge violates any limit.
  if (has_limit && s.deepest)
    messages.push_back(
        fmt::format("{}: {} vertices are gouged deeper than the search band, the deepest by "
                    "{}{:.1f} um, which violates every limit",
                    verdict.cut.name, s.gouged_vertices,
                    s.deepest->continues_deeper ? "more than " : "", s.deepest->depth / units::um));
  check("PV", limits.pv_um, s.pv);
  check("RMS", limits.rms_um, s.rms);
  check("largest deviation", limits.max_abs_um,
        s.min && s.max ? std::optional(std::max(-*s.min, *s.max)) : std::nullopt);
  using errors::metrology::ArealParameters;
  const auto texture_figure = [&](double ArealParameters::*figure) {
    return verdict.texture ? std::optional((*verdict.texture).*figure) : std::nullopt;
  };
  const cutting::Statistics form = verdict.form_statistics.value_or(cutting::Statistics{});
  check("PV of form", limits.form_pv_um, form.pv);
  check("RMS of form", limits.form_rms_um, form.rms);
  check("Sa of texture", limits.texture_sa_um, texture_figure(&ArealParameters::Sa));
  check("Sq of texture", limits.texture_sq_um, texture_figure(&ArealParameters::Sq));
  check("Sz of texture", limits.texture_sz_um, texture_figure(&ArealParameters::Sz));
  const std::string conformance = tolerance_verdict(s.conformance, verdict.worst);
  if (limits.tolerance && !(s.conformance && s.conformance->passes()))
    messages.push_back(
        verdict.cut.name + ": " +
        (conformance.empty() ? "no verdict, because no vertices are judged" : conformance));
  return messages;
}

}  // namespace abbe::sim
