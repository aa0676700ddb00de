#include "sim/report/summary.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/cut/process.h"
#include "sim/files/json_files.h"
#include "sim/files/program_file.h"
#include "sim/report/program_report.h"
#include "sim/report/stock_check.h"

namespace abbe::sim {

namespace {

/// Returns the figures that summary and comparison have in common.
CaseStatistics figures_of(const Job& job, const Verdict& verdict) {
  CaseStatistics figures;
  figures.name = verdict.cut.name;
  figures.residual = verdict.residual;
  const cutting::Surface& surface = verdict.aligned.surface;
  // The figures of the vertices are reported as well: the program may pass over them on purpose.
  if (surface.sampled_within == cutting::Surface::Within::Random)
    figures.at_vertices =
        cutting::statistics(cutting::at_vertices(surface), job.design_w, verdict.tolerance);
  figures.machine = verdict.machine;
  figures.form = verdict.form_part;
  figures.texture = verdict.texture;
  figures.form_cutoff = job.scene.part.form_cutoff;
  figures.interpolation = verdict.cut.interpolation;
  figures.tip_error = verdict.cut.tip_error;
  figures.direction_error = verdict.cut.direction_error;
  figures.chord_error = verdict.cut.chord_error;
  figures.highest = verdict.highest;
  figures.lowest = verdict.lowest;
  figures.worst = verdict.worst;
  return figures;
}

/// Returns the fall of a figure in percent; empty if it was zero or is missing.
std::optional<double> fall(const std::optional<double>& before,
                           const std::optional<double>& after) {
  if (!before || !after || *before == 0.0) return std::nullopt;
  return 100.0 * (1.0 - *after / *before);
}

CaseStatistics::Reduction reduction(const cutting::Statistics& before,
                                    const cutting::Statistics& after) {
  return {fall(before.pv, after.pv), fall(before.rms, after.rms)};
}

std::optional<CaseStatistics::Reduction> reduction(
    const std::optional<cutting::Statistics>& before,
    const std::optional<cutting::Statistics>& after) {
  if (!before || !after) return std::nullopt;
  return reduction(*before, *after);
}

std::optional<CaseStatistics::TextureReduction> texture_reduction(const Verdict& before,
                                                                  const Verdict& after) {
  if (!before.texture || !after.texture) return std::nullopt;
  return CaseStatistics::TextureReduction{fall(before.texture->Sa, after.texture->Sa),
                                          fall(before.texture->Sq, after.texture->Sq),
                                          fall(before.texture->Sz, after.texture->Sz)};
}

/// Returns the deviation of a mesh's facets; empty for a part without a mesh.
std::optional<Spread> facet_error(const cutting::Design& design) {
  if (design.facet_error.size() == 0 || design.facet_error.maxCoeff() <= 0.0) return std::nullopt;
  return Spread{std::sqrt(design.facet_error.squaredNorm() / double(design.facet_error.size())),
                design.facet_error.maxCoeff()};
}

/// Returns the temperature of every node at the start and the end of the program.
std::vector<Summary::NodeTemperature> temperatures_of(const errors::ThermalRun& run) {
  const Eigen::VectorXd start = errors::temperatures(run, 0.0);
  const Eigen::VectorXd end = errors::temperatures(run, run.knots.back().time_s);
  std::vector<Summary::NodeTemperature> nodes;
  for (std::size_t k = 0; k < run.network.nodes.size(); ++k)
    nodes.push_back({run.network.nodes[k].name, start[Eigen::Index(k)], end[Eigen::Index(k)]});
  return nodes;
}

/// Returns the assumptions of the program's reader; first the dialect, if it was recognised by its
/// content.
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
  // A program in windows is never sampled as a whole.
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
    // Warnings that variants share are reported once.
    for (const std::string& warning : one.job->warnings)
      if (std::find(all.warnings.begin(), all.warnings.end(), warning) == all.warnings.end())
        all.warnings.push_back(warning);
    for (const std::string& warning : verdict.cut.warnings)
      all.warnings.push_back(verdict.cut.name + ": " + warning);
    all.cases.push_back(figures_of(*one.job, verdict));
    if (!one.uncompensated) continue;
    const Verdict& before = cases[*one.uncompensated].verdict;
    CaseStatistics& figures = all.cases.back();
    figures.residual_reduction = reduction(before.residual, verdict.residual);
    figures.machine_reduction = reduction(before.machine, verdict.machine);
    figures.form_reduction = reduction(before.form_part, verdict.form_part);
    figures.texture_reduction = texture_reduction(before, verdict);
  }
  return all;
}

namespace {

using nlohmann::ordered_json;

/// Returns statistics in um; null where there are none.
ordered_json statistics_um(const cutting::Statistics& s) {
  return {
      {"pv", number(s.pv, units::um)},
      {"rms", number(s.rms, units::um)},
      {"mean", number(s.mean, units::um)},
      {"std", number(s.std_dev, units::um)},
      {"min", number(s.min, units::um)},
      {"max", number(s.max, units::um)},
      {"p95_abs", number(s.p95_abs, units::um)},
      {"in_tolerance_percent", s.conformance ? ordered_json(s.conformance->in) : ordered_json()}};
}

ordered_json statistics_um(const std::optional<cutting::Statistics>& s) {
  return s ? statistics_um(*s) : ordered_json();
}

ordered_json tolerance_um(const std::optional<Tolerance>& tolerance) {
  if (!tolerance) return {};
  return {tolerance->lower / units::um, tolerance->upper / units::um};
}

/// Returns null if there is no point.
ordered_json place(const std::optional<Verdict::Place>& one) {
  if (!one) return {};
  return {{"residual_um", one->residual / units::um},
          {"is_bound", one->bound},
          {"at_mm", numbers(one->at_m)},
          {"line", one->line}};
}

/// Returns the conformance with the tolerance in percent of the judged area; null without a
/// tolerance.
ordered_json conformance(const CaseStatistics& one) {
  const auto& c = one.residual.conformance;
  if (!c) return {};
  ordered_json json = {{"verdict", tolerance_verdict(c, one.worst)},
                       {"passes", c->passes()},
                       {"in_percent", c->in},
                       {"over_percent", c->over},
                       {"under_percent", c->under},
                       {"uncut_percent", c->uncut}};
  json["excess_um"] = one.worst ? ordered_json(c->excess / units::um) : ordered_json();
  json["worst"] = place(one.worst);
  return json;
}

/// Returns the percentage of the judged vertices that are not cut.
std::optional<double> uncut_percent(const cutting::Statistics& s) {
  const int judged = s.cut_vertices + s.uncut_vertices + s.gouged_vertices;
  if (judged == 0) return std::nullopt;
  return 100.0 * s.uncut_vertices / judged;
}

/// Returns the number of judged vertices by status.
ordered_json vertex_counts(const cutting::Statistics& s) {
  return {
      {"vertices", s.vertices},
      {"cut_vertices", s.cut_vertices},
      {"uncut_vertices", s.uncut_vertices},
      {"uncut_percent", number(uncut_percent(s))},
      {"gouged_vertices", s.gouged_vertices},
      {"deepest_gouge_um", s.deepest ? ordered_json(s.deepest->depth / units::um) : ordered_json()},
      {"deepest_gouge_is_bound", s.deepest ? ordered_json(s.deepest->deeper) : ordered_json()},
      {"outside_vertices", s.outside_vertices}};
}

/// Returns the unreached passes and points of a generated program; null if there are none.
ordered_json unreached(const program::Unreached& u) {
  if (u.points == 0) return {};
  return {{"passes", u.passes},
          {"broken_passes", u.broken_passes},
          {"all_passes", u.all_passes},
          {"points", u.points},
          {"all_points", u.all_points}};
}

ordered_json spread(const Spread& s, double unit) {
  return {{"rms", s.rms / unit}, {"max", s.max / unit}};
}

/// Returns the figures of the cutting process; torque in N m, from N mm.
ordered_json cut_json(const CutStatistics& cut) {
  const ProcessTotals& all = cut.totals;
  // The mean force is over the steps with a load.
  return {{"steps", cut.steps},
          {"removed_mm3", all.removed},
          {"force_max_N", all.force_max},
          {"force_mean_N",
           all.loaded > 0 ? ordered_json(all.force_sum / double(all.loaded)) : ordered_json()},
          {"torque_max_Nm", all.torque_max * 1e-3},
          {"power_max_W", all.power_max_W},
          {"iterations_max", all.iterations_max},
          {"contraction_max", all.contraction_max},
          {"not_converged", all.open},
          {"crash_lines", cut.crash_lines}};
}

/// Returns the displacement that the alignment removed, in um and urad.
ordered_json alignment_json(const Summary::RemovedAlignment& alignment) {
  return {{"translation_um", numbers(alignment.displacement.head<3>() / units::um)},
          {"rotation_urad", numbers(alignment.displacement.tail<3>() / units::urad)},
          {"undetermined", alignment.undetermined}};
}

/// Returns the height parameters of ISO 25178-2 for wavelengths below the cut-off.
ordered_json texture_um(const std::optional<errors::metrology::Areal>& t) {
  if (!t) return {};
  return {{"Sa", t->Sa / units::um}, {"Sq", t->Sq / units::um}, {"Sz", t->Sz / units::um},
          {"Sp", t->Sp / units::um}, {"Sv", t->Sv / units::um}, {"Ssk", number(t->Ssk)},
          {"Sku", number(t->Sku)}};
}

/// Returns the error of linear interpolation between the vertices of the map.
ordered_json interpolation(const std::optional<cutting::InterpolationError>& error) {
  if (!error) return {};
  return {{"probes", error->places},
          {"resolution_um", error->resolution / units::um},
          {"worst_um", error->worst / units::um},
          {"rms_um", error->rms / units::um},
          {"mean_um", error->mean / units::um},
          {"unresolved_percent", 100.0 * error->unresolved}};
}

/// Returns the deviation of the actual path from the chords between samples, which the cut uses.
ordered_json chord_error(const ChordError& found) {
  if (found.looked_at == 0) return {};
  return {{"intervals", found.looked_at},
          {"max_nm", found.max / units::nm},
          {"rms_nm", found.rms / units::nm},
          {"line", found.line},
          {"step_mm", found.step}};
}

/// Returns the sampling of the part: its resolution, and the areas that are excluded from
/// judgement.
ordered_json sampling(const SampledSurface& sampled) {
  return {{"given_vertices", sampled.given},
          {"resolution_um", sampled.resolution / units::um},
          {"reached_um", sampled.reached > 0.0 && std::isfinite(sampled.reached)
                             ? ordered_json(sampled.reached / units::um)
                             : ordered_json()},
          {"judged_area_mm2", sampled.judged_area},
          {"unmeant_area_mm2", sampled.excluded_area.area()},
          {"unreached_area_mm2", sampled.excluded_area.unreached},
          {"corner_area_mm2", sampled.excluded_area.corner},
          {"run_out_area_mm2", sampled.excluded_area.lead_out}};
}

/// Returns the form that each face of a mesh was recognised as, with its deviation.
ordered_json recognised(const std::vector<cutting::AnalyticPatch>& patches) {
  constexpr const char* names[] = {"plane", "sphere", "cylinder", "cone", "torus"};
  ordered_json list = ordered_json::array();
  for (const cutting::AnalyticPatch& one : patches)
    list.push_back({{"form", names[std::size_t(one.form)]},
                    {"area_mm2", one.area},
                    {"off_um", one.off / units::um}});
  return list;
}

/// Returns the reductions by the compensator in percent; null for other cases.
ordered_json reduction_percent(const CaseStatistics& one) {
  if (!one.residual_reduction) return nullptr;
  ordered_json json{{"pv", number(one.residual_reduction->pv)},
                    {"rms", number(one.residual_reduction->rms)}};
  const auto put = [&](const std::string& of,
                       const std::optional<CaseStatistics::Reduction>& fall) {
    if (!fall) return;
    json[of + "_pv"] = number(fall->pv);
    json[of + "_rms"] = number(fall->rms);
  };
  put("machine", one.machine_reduction);
  put("form", one.form_reduction);
  if (!one.texture_reduction) return json;
  json["texture_sa"] = number(one.texture_reduction->Sa);
  json["texture_sq"] = number(one.texture_reduction->Sq);
  json["texture_sz"] = number(one.texture_reduction->Sz);
  return json;
}

ordered_json case_json(const CaseStatistics& one) {
  ordered_json json = {{"name", one.name},
                       {"residual_um", statistics_um(one.residual)},
                       {"at_vertices_um", statistics_um(one.at_vertices)},
                       {"machine_um", statistics_um(one.machine)},
                       {"form_cutoff_mm", one.form_cutoff},
                       {"form_um", statistics_um(one.form)},
                       {"texture_um", texture_um(one.texture)},
                       {"interpolation", interpolation(one.interpolation)},
                       {"reduction_percent", reduction_percent(one)},
                       {"tip_error_um", spread(one.tip_error, units::um)},
                       {"direction_error_urad", spread(one.direction_error, units::urad)},
                       {"between_samples", chord_error(one.chord_error)},
                       {"highest", place(one.highest)},
                       {"lowest", place(one.lowest)},
                       {"conformance", conformance(one)}};
  json.update(vertex_counts(one.residual));
  return json;
}

/// Returns the head of the table of residuals.
std::string residual_header() {
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", "residual in um", "PV",
                     "RMS", "min", "max", "uncut %", "gouged");
}

/// Returns a row of the table, with the part of the area that its figures leave out.
std::string residual_line(const CaseStatistics& one) {
  const cutting::Statistics& s = one.residual;
  const auto um = [](const std::optional<double>& mm) {
    return mm ? fmt::format("{:.4f}", *mm / units::um) : "-";
  };
  const std::optional<double> uncut = uncut_percent(s);
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", escaped(one.name), um(s.pv),
                     um(s.rms), um(s.min), um(s.max), uncut ? fmt::format("{:.2f}", *uncut) : "-",
                     s.gouged_vertices);
}

/// Returns a row for the vertices alone if the figures include random points between them: the
/// program may pass over the vertices on purpose.
std::string vertices_line(const CaseStatistics& one) {
  if (!one.at_vertices) return {};
  const cutting::Statistics& s = *one.at_vertices;
  const auto um = [](const std::optional<double>& mm) {
    return mm ? fmt::format("{:.4f}", *mm / units::um) : "-";
  };
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12}\n",
                     fmt::format("  at its {} vertices alone", s.vertices - s.outside_vertices),
                     um(s.pv), um(s.rms), um(s.min), um(s.max));
}

/// Returns the table of form and texture; the last column is the change by the compensator.
std::string form_texture_table(const std::vector<CaseStatistics>& cases) {
  if (std::none_of(cases.begin(), cases.end(),
                   [](const CaseStatistics& one) { return one.form && one.form->rms; }))
    return {};
  std::string text =
      fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>12} {:>10}\n", "form and texture in um",
                  "form PV", "form RMS", "texture Sa", "Sq", "Sz", "cut-off mm");
  for (const CaseStatistics& one : cases) {
    const auto um = [](const std::optional<double>& mm) {
      return mm ? fmt::format("{:.4f}", *mm / units::um) : "-";
    };
    const auto of = [&](double errors::metrology::Areal::*figure) {
      return one.texture ? um((*one.texture).*figure) : "-";
    };
    using errors::metrology::Areal;
    text += fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>12} {:>10.4g}", escaped(one.name),
                        one.form ? um(one.form->pv) : "-", one.form ? um(one.form->rms) : "-",
                        of(&Areal::Sa), of(&Areal::Sq), of(&Areal::Sz), one.form_cutoff);
    if (one.form_reduction && one.form_reduction->rms)
      text += fmt::format("   form RMS {:+.2f} %", -*one.form_reduction->rms);
    if (one.texture_reduction && one.texture_reduction->Sq)
      text += fmt::format(", Sq {:+.2f} %", -*one.texture_reduction->Sq);
    text += "\n";
  }
  return text;
}

/// Returns a line about passes of a generated program that the machine does not reach.
std::string unreached_line(const program::Unreached& u) {
  if (u.points == 0) return {};
  return fmt::format("not reached by the machine: {} of {} passes, parts of {}\n", u.passes,
                     u.all_passes, u.broken_passes);
}

/// Returns the RMS of the machine's part with its change; empty if there is no error-free map.
std::string machine_text(const CaseStatistics& one) {
  if (!one.machine || !one.machine->rms) return {};
  std::string text = fmt::format("{:.6f}", *one.machine->rms / units::um);
  if (one.machine_reduction && one.machine_reduction->rms)
    text += fmt::format("  ({:+.2f} %)", -*one.machine_reduction->rms);
  return text;
}

/// Returns the verdict on the tolerance of a case; empty without a tolerance.
std::string verdict_line(const CaseStatistics& one) {
  const auto& c = one.residual.conformance;
  if (!c) return {};
  std::string shares = fmt::format("{:.2f} % of the area in tolerance", c->in);
  const auto add = [&](double percent, const char* what) {
    if (percent > 0.0) shares += fmt::format(", {:.2f} % {}", percent, what);
  };
  add(c->over, "over");
  add(c->under, "under");
  add(c->uncut, "not cut");
  return fmt::format("{:<36} {}; {}\n", escaped(one.name), tolerance_verdict(c, one.worst), shares);
}

/// Returns the assumptions about wear, and its amount at the end.
ordered_json wear_json(const std::vector<WornTool>& tools) {
  ordered_json all = ordered_json::array();
  for (const WornTool& one : tools)
    all.push_back({{"tool", one.tool},
                   {"assumed", "linear in what it cuts at feed; stock and force of a fresh cutter"},
                   {"cut_min", one.use.time_s / 60.0},
                   {"way_mm", one.use.way},
                   {"radius_lost_um", one.radius / units::um},
                   {"length_lost_um", one.length / units::um},
                   {"followed_within_nm", one.within / units::nm}});
  return all;
}

}  // namespace

ordered_json to_json(const Summary& s) {
  ordered_json form = ordered_json::object(), timing = ordered_json::object();
  for (const cutting::FormNumber& one : s.form) form[one.name + "_um"] = one.value_mm / units::um;
  for (const auto& [stage, seconds] : s.timing_s) timing[stage] = seconds;
  ordered_json json = {
      {"scene", s.scene},
      {"case", s.figures.name},
      {"seed", s.seed},
      {"moves", s.moves},
      {"samples", s.samples},
      {"unreached", unreached(s.unreached)},
      {"residual_um", statistics_um(s.figures.residual)},
      {"at_vertices_um", statistics_um(s.figures.at_vertices)},
      {"machine_um", statistics_um(s.figures.machine)},
      {"form_cutoff_mm", s.figures.form_cutoff},
      {"form_um", statistics_um(s.figures.form)},
      {"texture_um", texture_um(s.figures.texture)},
      {"sampling", s.sampling ? sampling(*s.sampling) : ordered_json()},
      {"recognised", recognised(s.recognised)},
      {"interpolation", interpolation(s.figures.interpolation)},
      {"tip_error_um", spread(s.figures.tip_error, units::um)},
      {"direction_error_urad", spread(s.figures.direction_error, units::urad)},
      {"between_samples", chord_error(s.figures.chord_error)},
      {"highest", place(s.figures.highest)},
      {"lowest", place(s.figures.lowest)},
      {"tolerance_um", tolerance_um(s.tolerance)},
      {"conformance", conformance(s.figures)},
      {"point_left_um", s.point_left / units::um},
      {"direction_left_urad", s.direction_left / units::urad},
      {"facet_error_um", s.facet_error ? spread(*s.facet_error, units::um) : ordered_json()},
      {"datum", name_of(s.datum)},
      {"alignment", name_of(s.alignment)},
      {"view", {{"from", numbers(s.view.from)}, {"up", numbers(s.view.up)}}},
      {"form", form},
      {"timing_s", timing},
      {"assumptions", to_json(s.assumptions)},
      {"warnings", s.warnings},
      {"versions", versions()}};
  json.update(vertex_counts(s.figures.residual));
  if (s.temperatures) {
    json["temperature_C"] = ordered_json::object();
    for (const Summary::NodeTemperature& one : *s.temperatures)
      json["temperature_C"][one.node] = {{"start", one.start_C}, {"end", one.end_C}};
  }
  if (s.cut) json["cut"] = cut_json(*s.cut);
  if (s.stock) json["stock"] = to_json(*s.stock);
  for (const Verdict::Ring& ring : s.rings)
    json["radii_um"][ring.name] = number(ring.radius, units::um);
  if (!s.wear.empty()) json["tool_wear"] = wear_json(s.wear);
  if (s.taken_out) json["aligned_by"] = alignment_json(*s.taken_out);
  return json;
}

ordered_json to_json(const Comparison& c) {
  ordered_json all = ordered_json::array();
  for (const CaseStatistics& one : c.cases) all.push_back(case_json(one));
  ordered_json json = {{"scene", c.scene},
                       {"seed", c.seed},
                       {"vertices", c.vertices},
                       {"moves", c.moves},
                       {"unreached", unreached(c.unreached)},
                       {"datum", name_of(c.datum)},
                       {"alignment", name_of(c.alignment)},
                       {"tolerance_um", tolerance_um(c.tolerance)},
                       {"cases", all}};
  for (const FailedCase& one : c.failed)
    json["failed"].push_back({{"name", one.name}, {"reason", one.reason}});
  json["assumptions"] = to_json(c.assumptions);
  json["warnings"] = c.warnings;
  json["versions"] = versions();
  return json;
}

std::string to_text(const Summary& s) {
  return residual_header() + "\n" + residual_line(s.figures) + "\n" + vertices_line(s.figures) +
         form_texture_table({s.figures}) + verdict_line(s.figures) + unreached_line(s.unreached) +
         (s.stock ? to_text(*s.stock) : std::string());
}

std::string to_text(const Comparison& c) {
  std::string text = residual_header() + "   machine's part, RMS\n";
  for (const CaseStatistics& one : c.cases)
    text += residual_line(one) + "   " + machine_text(one) + "\n" + vertices_line(one);
  text += "\n" + form_texture_table(c.cases);
  for (const CaseStatistics& one : c.cases) text += verdict_line(one);
  return text + unreached_line(c.unreached);
}

}  // namespace abbe::sim
