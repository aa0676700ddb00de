#include "sim/report/summary.h"

#include <algorithm>
#include <cmath>

#include "sim/cut/cut_warnings.h"
#include "sim/report/stock_check.h"

namespace abbe::sim {
namespace {

CaseFigures figures_of(const Job& job, const Verdict& verdict) {
  CaseFigures figures;
  figures.name = verdict.cut.name;
  figures.residual = verdict.residual;
  const cutting::Surface& surface = verdict.aligned.surface;
  if (surface.looked_within == cutting::Surface::Within::Random)
    figures.at_vertices =
        cutting::statistics(cutting::at_vertices(surface), job.design_w, verdict.tolerance);
  figures.machine = verdict.machine;
  figures.form = verdict.form_part;
  figures.texture = verdict.texture;
  figures.form_cutoff = job.scene.part.form_cutoff;
  figures.interpolation = verdict.cut.interpolation;
  figures.tip_error = verdict.cut.tip_error;
  figures.direction_error = verdict.cut.direction_error;
  figures.between_samples = verdict.cut.between_samples;
  figures.highest = verdict.highest;
  figures.lowest = verdict.lowest;
  figures.worst = verdict.worst;
  return figures;
}

std::optional<double> fall(const std::optional<double>& before,
                           const std::optional<double>& after) {
  if (!before || !after || *before == 0.0) return std::nullopt;
  return 100.0 * (1.0 - *after / *before);
}

CaseFigures::Reduction reduction(const cutting::Statistics& before,
                                 const cutting::Statistics& after) {
  return {fall(before.pv, after.pv), fall(before.rms, after.rms)};
}

std::optional<CaseFigures::Reduction> reduction(const std::optional<cutting::Statistics>& before,
                                                const std::optional<cutting::Statistics>& after) {
  if (!before || !after) return std::nullopt;
  return reduction(*before, *after);
}

std::optional<CaseFigures::TextureReduction> texture_reduction(const Verdict& before,
                                                               const Verdict& after) {
  if (!before.texture || !after.texture) return std::nullopt;
  return CaseFigures::TextureReduction{fall(before.texture->Sa, after.texture->Sa),
                                       fall(before.texture->Sq, after.texture->Sq),
                                       fall(before.texture->Sz, after.texture->Sz)};
}

std::optional<Spread> facet_error(const cutting::Design& design) {
  if (design.facet_error.size() == 0 || design.facet_error.maxCoeff() <= 0.0) return std::nullopt;
  return Spread{std::sqrt(design.facet_error.squaredNorm() / double(design.facet_error.size())),
                design.facet_error.maxCoeff()};
}

std::vector<Summary::NodeTemperature> temperatures_of(const errors::ThermalRun& run) {
  const Eigen::VectorXd start = errors::temperatures(run, 0.0);
  const Eigen::VectorXd end = errors::temperatures(run, run.knots.back().time_s);
  std::vector<Summary::NodeTemperature> nodes;
  for (std::size_t k = 0; k < run.network.nodes.size(); ++k)
    nodes.push_back({run.network.nodes[k].name, start[Eigen::Index(k)], end[Eigen::Index(k)]});
  return nodes;
}

/// What the reader assumes; first of all whose program it is, where signs told that.
std::vector<program::Assumption> assumptions_of(const Job& job) {
  std::vector<program::Assumption> assumptions = job.path.assumptions;
  if (job.path.read_as.find(", as ") != std::string::npos)
    assumptions.insert(
        assumptions.begin(),
        program::Assumption{"the program is read as " + job.path.read_as, "program.dialect"});
  return assumptions;
}

}  // namespace

Summary summary(const Job& job, const Verdict& verdict) {
  const Cut& cut = verdict.cut;
  Summary s;
  s.scene = job.scene.title;
  s.seed = job.scene.seed;
  s.moves = job.path.motion_blocks;
  s.samples = job.windows ? job.windows->samples : job.samples.states.size();
  s.unreached = job.unreached;
  s.figures = figures_of(job, verdict);
  s.tolerance = job.scene.part.tolerance;
  s.sampling = job.sampled;
  s.recognised = job.recognised;
  s.point_left = cut.point_left;
  s.direction_left = cut.direction_left;
  s.facet_error = facet_error(job.design_w);
  s.datum = job.scene.datum.kind;
  s.alignment = job.scene.alignment;
  s.view = job.scene.view;
  if (s.alignment != Alignment::None)
    s.taken_out = {verdict.aligned.displacement, verdict.aligned.undetermined};
  s.form = verdict.form;
  s.rings = verdict.rings;
  if (job.truth.heat) s.temperatures = temperatures_of(job.truth.heat->run);
  if (!cut.process.steps.empty())
    s.cut = {cut.process.steps.size(), totals(cut.process), cut.process.crash_lines};
  s.stock = verdict.stock;
  s.timing_s.assign(job.timing_s.begin(), job.timing_s.end());
  s.timing_s.insert(s.timing_s.end(), cut.timing_s.begin(), cut.timing_s.end());
  if (s.stock) s.timing_s.emplace_back("findings", s.stock->seconds);
  s.wear = cut.wear;
  s.warnings = warnings_of(job, cut);
  s.assumptions = assumptions_of(job);
  if (s.stock) add_warnings(warnings_of(*s.stock), s.warnings);
  return s;
}

Comparison comparison(const Job& job, const std::vector<Compared>& cases,
                      const std::vector<FailedCase>& failed) {
  Comparison all{job.scene.title,
                 job.scene.seed,
                 job.design_w.vertices.rows(),
                 job.path.motion_blocks,
                 job.unreached,
                 job.scene.datum.kind,
                 job.scene.alignment,
                 job.scene.part.tolerance,
                 {},
                 failed,
                 {},
                 assumptions_of(job)};
  for (const Compared& one : cases) {
    const Verdict& verdict = one.verdict;
    for (const std::string& warning : one.job->warnings)  // of a scene and all its variants once
      if (std::find(all.warnings.begin(), all.warnings.end(), warning) == all.warnings.end())
        all.warnings.push_back(warning);
    for (const std::string& warning : verdict.cut.warnings)
      all.warnings.push_back(verdict.cut.name + ": " + warning);
    all.cases.push_back(figures_of(*one.job, verdict));
    if (!one.uncompensated) continue;
    const Verdict& before = cases[*one.uncompensated].verdict;
    CaseFigures& figures = all.cases.back();
    figures.residual_reduction = reduction(before.residual, verdict.residual);
    figures.machine_reduction = reduction(before.machine, verdict.machine);
    figures.form_reduction = reduction(before.form_part, verdict.form_part);
    figures.texture_reduction = texture_reduction(before, verdict);
  }
  return all;
}

}  // namespace abbe::sim
