#include "sim/report/verdict.h"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

std::optional<double> tolerance(const Job& job) {
  return job.scene.part.tolerance > 0.0 ? std::optional(job.scene.part.tolerance) : std::nullopt;
}

/// A mesh whose facets sag by more than all that is found on it.
std::string coarse_warning(const Job& job, const cutting::Statistics& residual) {
  if (!std::holds_alternative<MeshFile>(job.scene.part.shape) || !residual.pv) return {};
  const double facet_error = cutting::coarseness(job.design_w).facet_error;
  if (facet_error <= *residual.pv) return {};
  return fmt::format(
      "the mesh is coarse beside what is found on it: between judged vertices its facets sag by up "
      "to {:.4g} um, PV is {:.4g} um",
      facet_error / units::um, *residual.pv / units::um);
}

/// Mean radius of each ring of the part by area.
std::vector<Verdict::Ring> rings_of(const Job& job, const cutting::Surface& surface) {
  std::vector<Verdict::Ring> rings;
  const kinematics::Pose T_mw = job.scene.part.T_wm.inverse();
  for (const PartDescription::Ring& ring : job.scene.part.rings) {
    double weighted = 0.0, area = 0.0;
    for (Eigen::Index i = 0; i < job.design_w.vertices.rows(); ++i) {
      if (surface.status[std::size_t(i)] != cutting::VertexStatus::Cut) continue;
      const Eigen::Vector3d p_m = T_mw * job.design_w.vertices.row(i).transpose();
      if (std::abs(p_m.z() - ring.along) > 0.5 * ring.width) continue;
      const Eigen::Vector3d n_m = T_mw.linear() * job.design_w.normals.row(i).transpose();
      weighted += job.design_w.area[i] * (p_m + surface.residual[i] * n_m).head<2>().norm();
      area += job.design_w.area[i];
    }
    rings.push_back({ring.name, std::nullopt});
    if (area > 0.0) rings.back().radius = weighted / area;
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
  verdict.aligned = cutting::aligned(cut.surface, job.design_w, {job.scene.alignment});
  verdict.residual = cutting::statistics(verdict.aligned.surface, job.design_w, tolerance(job));
  if (error_free != nullptr) {
    verdict.machine = cutting::statistics(
        cutting::minus(verdict.aligned.surface, error_free->aligned.surface), job.design_w);
  }
  if (const std::string coarse = coarse_warning(job, verdict.residual); !coarse.empty())
    cut.warnings.push_back(coarse);
  verdict.rings = rings_of(job, verdict.aligned.surface);
  for (const Verdict::Ring& ring : verdict.rings)
    if (!ring.radius) cut.warnings.push_back("no cut vertex lies on the ring " + ring.name);
  if (const auto* primitive = std::get_if<cutting::Primitive>(&job.scene.part.shape))
    verdict.form = cutting::form(
        *primitive, cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()), cut.surface);
  verdict.cut = std::move(cut);
  return verdict;
}

std::vector<std::string> exceeded(const Limits& limits, const Verdict& verdict) {
  std::vector<std::string> all;
  const auto look = [&](const char* what, const std::optional<double>& limit_um,
                        std::optional<double> value) {
    if (limit_um && !value)
      all.push_back(fmt::format(
          "{}: {} is unknown, since nothing was cut within the band; the scene allows {:.4f} um",
          verdict.cut.name, what, *limit_um));
    if (limit_um && value && *value / units::um > *limit_um)
      all.push_back(fmt::format("{}: {} is {:.4f} um, the scene allows {:.4f} um", verdict.cut.name,
                                what, *value / units::um, *limit_um));
  };
  const cutting::Statistics& s = verdict.residual;
  const bool limited = limits.pv_um || limits.rms_um || limits.max_abs_um;
  if (limited && s.deepest)
    all.push_back(fmt::format(
        "{}: {} vertices are gouged deeper than the search allows, the deepest by {}{:.1f} um, "
        "which no limit allows",
        verdict.cut.name, s.gouged_vertices, s.deepest->deeper ? "more than " : "",
        s.deepest->depth / units::um));
  look("PV", limits.pv_um, s.pv);
  look("RMS", limits.rms_um, s.rms);
  look("largest deviation", limits.max_abs_um,
       s.min && s.max ? std::optional(std::max(-*s.min, *s.max)) : std::nullopt);
  return all;
}

}  // namespace abbe::sim
