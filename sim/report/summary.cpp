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
CaseStatistics case_statistics(const Job& job, const Verdict& verdict) {
  CaseStatistics result;
  result.name = verdict.cut.name;
  result.residual = verdict.residual;
  const cutting::Surface& surface = verdict.alignment.surface;
  // The figures of the vertices are reported separately, because the program may have been
  // generated to pass exactly over them.
  if (surface.interior_sample == cutting::Surface::InteriorSample::Random)
    result.without_triangle_samples = cutting::statistics(
        cutting::without_triangle_samples(surface), job.design_w, verdict.tolerance);
  result.machine = verdict.machine_contribution;
  result.form = verdict.form_statistics;
  result.texture = verdict.texture;
  result.form_cutoff = job.scene.part.form_cutoff;
  result.interpolation = verdict.cut.interpolation;
  result.tip_error = verdict.cut.tip_error;
  result.direction_error = verdict.cut.direction_error;
  result.chord_error = verdict.cut.chord_error;
  result.highest = verdict.highest;
  result.lowest = verdict.lowest;
  result.worst = verdict.worst;
  return result;
}

/// Returns the reduction of a figure in percent; empty if it was zero, or if one is missing.
std::optional<double> relative_reduction(const std::optional<double>& before,
                                         const std::optional<double>& after) {
  if (!before || !after || *before == 0.0) return std::nullopt;
  return 100.0 * (1.0 - *after / *before);
}

/// Return the reductions of PV and RMS in percent.
CaseStatistics::Reduction reduction(const cutting::Statistics& before,
                                    const cutting::Statistics& after) {
  return {relative_reduction(before.pv, after.pv), relative_reduction(before.rms, after.rms)};
}

std::optional<CaseStatistics::Reduction> reduction(
    const std::optional<cutting::Statistics>& before,
    const std::optional<cutting::Statistics>& after) {
  if (!before || !after) return std::nullopt;
  return reduction(*before, *after);
}

/// Returns the reductions of the texture parameters in percent; empty without texture.
std::optional<CaseStatistics::TextureReduction> texture_reduction(const Verdict& before,
                                                                  const Verdict& after) {
  if (!before.texture || !after.texture) return std::nullopt;
  return CaseStatistics::TextureReduction{
      relative_reduction(before.texture->Sa, after.texture->Sa),
      relative_reduction(before.texture->Sq, after.texture->Sq),
      relative_reduction(before.texture->Sz, after.texture->Sz)};
}

/// Returns the facet error of a mesh; empty if it is zero, as for a part without a mesh.
std::optional<Spread> facet_error(const cutting::Design& design) {
  if (design.facet_error.size() == 0 || design.facet_error.maxCoeff() <= 0.0) return std::nullopt;
  return Spread{std::sqrt(design.facet_error.squaredNorm() / double(design.facet_error.size())),
                design.facet_error.maxCoeff()};
}

/// Returns the temperature of every node at the start and the end of the program.
std::vector<Summary::NodeTemperature> node_temperatures(const errors::ThermalRun& run) {
  const Eigen::VectorXd start = errors::temperatures(run, 0.0);
  const Eigen::VectorXd end = errors::temperatures(run, run.knots.back().time_s);
  std::vector<Summary::NodeTemperature> nodes;
  for (std::size_t k = 0; k < run.network.nodes.size(); ++k)
    nodes.push_back({run.network.nodes[k].name, start[Eigen::Index(k)], end[Eigen::Index(k)]});
  return nodes;
}

/// Returns the assumptions of the reader of the program. If the dialect was recognised by the
/// content of the program, this is the first one.
std::vector<program::Assumption> program_assumptions(const Job& job) {
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
  // A program that is processed in windows is never sampled as a whole.
  s.samples = job.windows ? job.windows->samples : job.samples.states.size();
  s.unreached = job.unreached;
  s.figures = case_statistics(job, verdict);
  s.tolerance = job.scene.part.tolerance;
  s.sampling = job.sampled;
  s.recognised = job.recognised;
  s.remaining_point_error = cut.remaining_point_error;
  s.remaining_direction_error = cut.remaining_direction_error;
  s.facet_error = facet_error(job.design_w);
  s.datum = job.scene.datum.kind;
  s.alignment = job.scene.alignment;
  s.view = job.scene.view;
  if (s.alignment != Alignment::None)
    s.removed_alignment = {verdict.alignment.displacement, verdict.alignment.undetermined};
  s.form = verdict.form_deviations;
  s.rings = verdict.rings;
  if (job.truth.heat) s.temperatures = node_temperatures(job.truth.heat->run);
  if (!cut.process.steps.empty())
    s.cut = {cut.process.steps.size(), totals(cut.process), cut.process.crash_lines};
  s.stock = verdict.stock;
  s.timing_s.assign(job.timing_s.begin(), job.timing_s.end());
  s.timing_s.insert(s.timing_s.end(), cut.timing_s.begin(), cut.timing_s.end());
  if (s.stock) s.timing_s.emplace_back("findings", s.stock->seconds);
  s.wear = cut.wear;
  s.warnings = warnings_of(job, cut);
  s.assumptions = program_assumptions(job);
  if (s.stock) add_warnings(warnings_of(*s.stock), s.warnings);
  return s;
}

Comparison comparison(const Job& job, const std::vector<ComparedCase>& cases,
                      const std::vector<FailedCase>& failed) {
  Comparison result{job.scene.title,
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
                    program_assumptions(job)};
  for (const ComparedCase& compared : cases) {
    const Verdict& verdict = compared.verdict;
    // Warnings that variants share are reported once.
    for (const std::string& warning : compared.job->warnings)
      if (std::find(result.warnings.begin(), result.warnings.end(), warning) ==
          result.warnings.end())
        result.warnings.push_back(warning);
    for (const std::string& warning : verdict.cut.warnings)
      result.warnings.push_back(verdict.cut.name + ": " + warning);
    result.cases.push_back(case_statistics(*compared.job, verdict));
    if (!compared.uncompensated_index) continue;
    const Verdict& before = cases[*compared.uncompensated_index].verdict;
    CaseStatistics& figures = result.cases.back();
    figures.residual_reduction = reduction(before.residual, verdict.residual);
    figures.machine_reduction =
        reduction(before.machine_contribution, verdict.machine_contribution);
    figures.form_reduction = reduction(before.form_statistics, verdict.form_statistics);
    figures.texture_reduction = texture_reduction(before, verdict);
  }
  return result;
}

namespace {

using nlohmann::ordered_json;

/// Returns statistics in um; null for values that do not exist.
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

/// Returns an extreme point; null if there is none.
ordered_json point_json(const std::optional<Verdict::ExtremePoint>& point) {
  if (!point) return {};
  return {{"residual_um", point->residual / units::um},
          {"is_bound", point->is_bound},
          {"at_mm", numbers(point->position_m)},
          {"line", point->line}};
}

/// Returns the conformance in percent of the judged area; null without a tolerance.
ordered_json conformance(const CaseStatistics& figures) {
  const auto& c = figures.residual.conformance;
  if (!c) return {};
  ordered_json json = {{"verdict", tolerance_verdict(c, figures.worst)},
                       {"passes", c->passes()},
                       {"in_percent", c->in},
                       {"over_percent", c->over},
                       {"under_percent", c->under},
                       {"uncut_percent", c->uncut}};
  json["excess_um"] = figures.worst ? ordered_json(c->excess / units::um) : ordered_json();
  json["worst"] = point_json(figures.worst);
  return json;
}

/// Returns the percentage of the judged vertices that are not cut.
std::optional<double> uncut_percent(const cutting::Statistics& s) {
  const int judged = s.cut_vertices + s.uncut_vertices + s.gouged_vertices;
  if (judged == 0) return std::nullopt;
  return 100.0 * s.uncut_vertices / judged;
}

/// Returns the numbers of vertices by status.
ordered_json vertex_counts(const cutting::Statistics& s) {
  return {
      {"vertices", s.vertices},
      {"cut_vertices", s.cut_vertices},
      {"uncut_vertices", s.uncut_vertices},
      {"uncut_percent", number(uncut_percent(s))},
      {"gouged_vertices", s.gouged_vertices},
      {"deepest_gouge_um", s.deepest ? ordered_json(s.deepest->depth / units::um) : ordered_json()},
      {"deepest_gouge_is_bound",
       s.deepest ? ordered_json(s.deepest->continues_deeper) : ordered_json()},
      {"outside_vertices", s.outside_vertices}};
}

/// Returns the numbers of unreached passes and points of a generated program; null if all are
/// reached.
ordered_json unreached(const program::UnreachedPoints& u) {
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

/// Returns the figures of the cutting process; the torque is converted from N mm to N m.
ordered_json cut_json(const CutStatistics& cut) {
  const ProcessTotals& total = cut.totals;
  // The mean force is that of the steps with a load.
  return {{"steps", cut.steps},
          {"removed_mm3", total.removed},
          {"force_max_N", total.max_force},
          {"force_mean_N", total.loaded_steps > 0
                               ? ordered_json(total.force_sum / double(total.loaded_steps))
                               : ordered_json()},
          {"torque_max_Nm", total.max_torque * 1e-3},
          {"power_max_W", total.max_power_W},
          {"iterations_max", total.max_iterations},
          {"contraction_max", total.max_loop_gain},
          {"not_converged", total.unconverged_steps},
          {"crash_lines", cut.crash_lines}};
}

/// Returns the displacement that the alignment removed, in um and urad.
ordered_json alignment_json(const Summary::RemovedAlignment& alignment) {
  return {{"translation_um", numbers(alignment.displacement.head<3>() / units::um)},
          {"rotation_urad", numbers(alignment.displacement.tail<3>() / units::urad)},
          {"undetermined", alignment.undetermined}};
}

/// Returns the height parameters of ISO 25178-2 for wavelengths below the cut-off.
ordered_json texture_um(const std::optional<errors::metrology::ArealParameters>& t) {
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

/// Returns the deviation of the actual path from the chords between samples, along which the tool
/// cuts.
ordered_json chord_error(const ChordError& error) {
  if (error.interval_count == 0) return {};
  return {{"intervals", error.interval_count},
          {"max_nm", error.max / units::nm},
          {"rms_nm", error.rms / units::nm},
          {"line", error.line},
          {"step_mm", error.step}};
}

/// Returns the sampling of the part: its resolution, and the judged and excluded areas.
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
          {"run_out_area_mm2", sampled.excluded_area.lead_out_area}};
}

/// Returns the analytic surfaces that were recognised as faces of a mesh, with their deviations.
ordered_json recognised(const std::vector<cutting::AnalyticPatch>& patches) {
  constexpr const char* names[] = {"plane", "sphere", "cylinder", "cone", "torus"};
  ordered_json list = ordered_json::array();
  for (const cutting::AnalyticPatch& patch : patches)
    list.push_back({{"form", names[std::size_t(patch.form)]},
                    {"area_mm2", patch.area},
                    {"off_um", patch.off / units::um}});
  return list;
}

/// Returns the reductions by the compensator in percent; null for a case without one.
ordered_json reduction_percent(const CaseStatistics& figures) {
  if (!figures.residual_reduction) return nullptr;
  ordered_json json{{"pv", number(figures.residual_reduction->pv)},
                    {"rms", number(figures.residual_reduction->rms)}};
  const auto add_reduction = [&](const std::string& name,
                                 const std::optional<CaseStatistics::Reduction>& reduction) {
    if (!reduction) return;
    json[name + "_pv"] = number(reduction->pv);
    json[name + "_rms"] = number(reduction->rms);
  };
  add_reduction("machine", figures.machine_reduction);
  add_reduction("form", figures.form_reduction);
  if (!figures.texture_reduction) return json;
  json["texture_sa"] = number(figures.texture_reduction->Sa);
  json["texture_sq"] = number(figures.texture_reduction->Sq);
  json["texture_sz"] = number(figures.texture_reduction->Sz);
  return json;
}

/// Returns the figures of a case for comparison.json.
ordered_json case_json(const CaseStatistics& figures) {
  ordered_json json = {{"name", figures.name},
                       {"residual_um", statistics_um(figures.residual)},
                       {"at_vertices_um", statistics_um(figures.without_triangle_samples)},
                       {"machine_um", statistics_um(figures.machine)},
                       {"form_cutoff_mm", figures.form_cutoff},
                       {"form_um", statistics_um(figures.form)},
                       {"texture_um", texture_um(figures.texture)},
                       {"interpolation", interpolation(figures.interpolation)},
                       {"reduction_percent", reduction_percent(figures)},
                       {"tip_error_um", spread(figures.tip_error, units::um)},
                       {"direction_error_urad", spread(figures.direction_error, units::urad)},
                       {"between_samples", chord_error(figures.chord_error)},
                       {"highest", point_json(figures.highest)},
                       {"lowest", point_json(figures.lowest)},
                       {"conformance", conformance(figures)}};
  json.update(vertex_counts(figures.residual));
  return json;
}

/// Returns a length in um; "-" if it does not exist.
std::string um_text(const std::optional<double>& mm) {
  return mm ? fmt::format("{:.4f}", *mm / units::um) : "-";
}

/// Returns the header of the table of residuals.
std::string residual_header() {
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", "residual in um", "PV",
                     "RMS", "min", "max", "uncut %", "gouged");
}

/// Returns a row of the table of residuals, with the area that its figures leave out.
std::string residual_line(const CaseStatistics& figures) {
  const cutting::Statistics& s = figures.residual;
  const std::optional<double> uncut = uncut_percent(s);
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", escaped(figures.name),
                     um_text(s.pv), um_text(s.rms), um_text(s.min), um_text(s.max),
                     uncut ? fmt::format("{:.2f}", *uncut) : "-", s.gouged_vertices);
}

/// Returns a row for the vertices alone; empty if the map has no random points between them.
std::string vertices_line(const CaseStatistics& figures) {
  if (!figures.without_triangle_samples) return {};
  const cutting::Statistics& s = *figures.without_triangle_samples;
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12}\n",
                     fmt::format("  at its {} vertices only", s.vertices - s.outside_vertices),
                     um_text(s.pv), um_text(s.rms), um_text(s.min), um_text(s.max));
}

/// Returns the table of form and texture, with the change by the compensator at the end of a row.
std::string form_texture_table(const std::vector<CaseStatistics>& cases) {
  if (std::none_of(cases.begin(), cases.end(),
                   [](const CaseStatistics& figures) { return figures.form && figures.form->rms; }))
    return {};
  std::string text =
      fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>12} {:>10}\n", "form and texture in um",
                  "form PV", "form RMS", "texture Sa", "Sq", "Sz", "cut-off mm");
  for (const CaseStatistics& figures : cases) {
    const auto texture_um_text = [&](double errors::metrology::ArealParameters::*figure) {
      return figures.texture ? um_text((*figures.texture).*figure) : "-";
    };
    using errors::metrology::ArealParameters;
    text +=
        fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>12} {:>10.4g}", escaped(figures.name),
                    figures.form ? um_text(figures.form->pv) : "-",
                    figures.form ? um_text(figures.form->rms) : "-",
                    texture_um_text(&ArealParameters::Sa), texture_um_text(&ArealParameters::Sq),
                    texture_um_text(&ArealParameters::Sz), figures.form_cutoff);
    if (figures.form_reduction && figures.form_reduction->rms)
      text += fmt::format("   form RMS {:+.2f} %", -*figures.form_reduction->rms);
    if (figures.texture_reduction && figures.texture_reduction->Sq)
      text += fmt::format(", Sq {:+.2f} %", -*figures.texture_reduction->Sq);
    text += "\n";
  }
  return text;
}

/// Returns a line on the passes of a generated program that the machine does not reach; empty if
/// all are reached.
std::string unreached_line(const program::UnreachedPoints& u) {
  if (u.points == 0) return {};
  return fmt::format("out of reach of the machine: {} of {} passes, parts of {}\n", u.passes,
                     u.all_passes, u.broken_passes);
}

/// Returns the RMS of the machine's contribution with its change; empty without an error-free map.
std::string machine_text(const CaseStatistics& figures) {
  if (!figures.machine || !figures.machine->rms) return {};
  std::string text = fmt::format("{:.6f}", *figures.machine->rms / units::um);
  if (figures.machine_reduction && figures.machine_reduction->rms)
    text += fmt::format("  ({:+.2f} %)", -*figures.machine_reduction->rms);
  return text;
}

/// Returns the verdict on the tolerance of a case; empty without a tolerance.
std::string verdict_line(const CaseStatistics& figures) {
  const auto& c = figures.residual.conformance;
  if (!c) return {};
  std::string areas = fmt::format("{:.2f} % of the area in tolerance", c->in);
  const auto add = [&](double percent, const char* status) {
    if (percent > 0.0) areas += fmt::format(", {:.2f} % {}", percent, status);
  };
  add(c->over, "over");
  add(c->under, "under");
  add(c->uncut, "not cut");
  return fmt::format("{:<36} {}; {}\n", escaped(figures.name), tolerance_verdict(c, figures.worst),
                     areas);
}

/// Returns the wear of the tools at the end of the program, with the assumption about it.
ordered_json wear_json(const std::vector<WornTool>& tools) {
  ordered_json list = ordered_json::array();
  for (const WornTool& worn : tools)
    list.push_back(
        {{"tool", worn.tool},
         {"assumed",
          "linear in cutting time or distance at feed; stock and force of an unworn cutter"},
         {"cut_min", worn.use.time_s / 60.0},
         {"way_mm", worn.use.distance},
         {"radius_lost_um", worn.radius / units::um},
         {"length_lost_um", worn.length / units::um},
         {"followed_within_nm", worn.within / units::nm}});
  return list;
}

}  // namespace

ordered_json tolerance_um(const std::optional<Tolerance>& tolerance) {
  if (!tolerance) return {};
  return {tolerance->lower / units::um, tolerance->upper / units::um};
}

ordered_json to_json(const Summary& s) {
  ordered_json form = ordered_json::object(), timing = ordered_json::object();
  for (const cutting::FormNumber& deviation : s.form)
    form[deviation.name + "_um"] = deviation.value_mm / units::um;
  for (const auto& [stage, seconds] : s.timing_s) timing[stage] = seconds;
  ordered_json json = {
      {"scene", s.scene},
      {"case", s.figures.name},
      {"seed", s.seed},
      {"moves", s.moves},
      {"samples", s.samples},
      {"unreached", unreached(s.unreached)},
      {"residual_um", statistics_um(s.figures.residual)},
      {"at_vertices_um", statistics_um(s.figures.without_triangle_samples)},
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
      {"highest", point_json(s.figures.highest)},
      {"lowest", point_json(s.figures.lowest)},
      {"tolerance_um", tolerance_um(s.tolerance)},
      {"conformance", conformance(s.figures)},
      {"point_left_um", s.remaining_point_error / units::um},
      {"direction_left_urad", s.remaining_direction_error / units::urad},
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
    for (const Summary::NodeTemperature& node : *s.temperatures)
      json["temperature_C"][node.node] = {{"start", node.start_C}, {"end", node.end_C}};
  }
  if (s.cut) json["cut"] = cut_json(*s.cut);
  if (s.stock) json["stock"] = to_json(*s.stock);
  for (const Verdict::Ring& ring : s.rings)
    json["radii_um"][ring.name] = number(ring.radius, units::um);
  if (!s.wear.empty()) json["tool_wear"] = wear_json(s.wear);
  if (s.removed_alignment) json["aligned_by"] = alignment_json(*s.removed_alignment);
  return json;
}

ordered_json to_json(const std::vector<CaseStatistics>& cases) {
  ordered_json list = ordered_json::array();
  for (const CaseStatistics& figures : cases) list.push_back(case_json(figures));
  return list;
}

ordered_json to_json(const Comparison& c) {
  ordered_json json = {{"scene", c.scene},
                       {"seed", c.seed},
                       {"vertices", c.vertices},
                       {"moves", c.moves},
                       {"unreached", unreached(c.unreached)},
                       {"datum", name_of(c.datum)},
                       {"alignment", name_of(c.alignment)},
                       {"tolerance_um", tolerance_um(c.tolerance)},
                       {"cases", to_json(c.cases)}};
  for (const FailedCase& failure : c.failed)
    json["failed"].push_back({{"name", failure.name}, {"reason", failure.reason}});
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
  for (const CaseStatistics& figures : c.cases)
    text += residual_line(figures) + "   " + machine_text(figures) + "\n" + vertices_line(figures);
  text += "\n" + form_texture_table(c.cases);
  for (const CaseStatistics& figures : c.cases) text += verdict_line(figures);
  return text + unreached_line(c.unreached);
}

}  // namespace abbe::sim
