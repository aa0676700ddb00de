#include "sim/report/report.h"

#include <algorithm>

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/cut/program_warnings.h"
#include "sim/report/pictures.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

ordered_json in(double unit, const std::optional<double>& value) {
  return value ? ordered_json(*value / unit) : ordered_json();
}

ordered_json statistics_um(const cutting::Statistics& s) {
  return {{"pv", in(units::um, s.pv)},
          {"rms", in(units::um, s.rms)},
          {"mean", in(units::um, s.mean)},
          {"std", in(units::um, s.std_dev)},
          {"min", in(units::um, s.min)},
          {"max", in(units::um, s.max)},
          {"p95_abs", in(units::um, s.p95_abs)},
          {"in_tolerance_percent", in(1.0, s.in_tolerance_percent)}};
}

/// How many of the judged vertices are what, as summary and comparison tell it.
ordered_json vertex_counts(const cutting::Statistics& s) {
  const int judged = s.cut_vertices + s.uncut_vertices + s.gouged_vertices;
  return {
      {"vertices", s.vertices},
      {"cut_vertices", s.cut_vertices},
      {"uncut_vertices", s.uncut_vertices},
      {"uncut_percent",
       judged > 0 ? ordered_json(100.0 * s.uncut_vertices / judged) : ordered_json()},
      {"gouged_vertices", s.gouged_vertices},
      {"deepest_gouge_um", s.deepest ? ordered_json(s.deepest->depth / units::um) : ordered_json()},
      {"deepest_gouge_is_bound", s.deepest ? ordered_json(s.deepest->deeper) : ordered_json()},
      {"outside_vertices", s.outside_vertices}};
}

/// What the machine does not reach of a generated program; null where it reaches all.
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

/// Percentage by which a number fell; nothing where there is nothing to fall from.
ordered_json reduction(const std::optional<double>& before, const std::optional<double>& after) {
  if (!before || !after || *before == 0.0) return {};
  return 100.0 * (1.0 - *after / *before);
}

ordered_json facet_error(const cutting::Design& design) {
  if (design.facet_error.size() == 0 || design.facet_error.maxCoeff() <= 0.0) return {};
  return {{"rms", std::sqrt(design.facet_error.squaredNorm() / double(design.facet_error.size())) /
                      units::um},
          {"max", design.facet_error.maxCoeff() / units::um}};
}

/// Temperatures of the nodes when the program starts and ends.
ordered_json heat_C(const Job& job) {
  if (!job.truth.heat) return {};
  const errors::ThermalRun& run = job.truth.heat->run;
  const Eigen::VectorXd start = errors::temperatures(run, 0.0);
  const Eigen::VectorXd end = errors::temperatures(run, run.knots.back().time_s);
  ordered_json nodes = ordered_json::object();
  for (std::size_t k = 0; k < run.network.nodes.size(); ++k)
    nodes[run.network.nodes[k].name] = {{"start", start[Eigen::Index(k)]},
                                        {"end", end[Eigen::Index(k)]}};
  return nodes;
}

ordered_json process_figures(const Process& process) {
  if (process.steps.empty()) return {};
  const ProcessTotals all = totals(process);
  return {{"steps", process.steps.size()},
          {"removed_mm3", all.removed},
          {"force_max_N", all.force_max},
          {"force_mean_N",
           all.loaded > 0 ? ordered_json(all.force_sum / double(all.loaded)) : ordered_json()},
          {"torque_max_Nm", all.torque_max * 1e-3},
          {"power_max_W", all.power_max_W},
          {"iterations_max", all.iterations_max},
          {"contraction_max", all.contraction_max},
          {"not_converged", all.open},
          {"crash_lines", process.crash_lines}};
}

/// A file that only some cases have: where there is none, one of an earlier run goes.
void write_or_remove(const ResultFile& file, const std::string& text) {
  if (text.empty())
    remove_file(file);
  else
    write_file(file, text);
}

}  // namespace

ordered_json summary(const Job& job, const Verdict& verdict) {
  const cutting::Statistics& s = verdict.residual;
  ordered_json form = ordered_json::object();
  for (const cutting::FormNumber& number : verdict.form)
    form[number.name + "_um"] = number.value_mm / units::um;
  ordered_json timing = job.timing_s;
  for (const auto& [stage, seconds] : verdict.cut.timing_s) timing[stage] = seconds;
  ordered_json json = {
      {"scene", job.scene.title},
      {"case", verdict.cut.name},
      {"seed", job.scene.seed},
      {"moves", job.path.motion_blocks},
      {"samples", job.samples.states.size()},
      {"unreached", unreached(job.unreached)},
      {"residual_um", statistics_um(s)},
      {"machine_um", verdict.machine ? statistics_um(*verdict.machine) : ordered_json()},
      {"tip_error_um", spread(verdict.cut.tip_error, units::um)},
      {"direction_error_urad", spread(verdict.cut.direction_error, units::urad)},
      {"point_left_um", verdict.cut.point_left / units::um},
      {"direction_left_urad", verdict.cut.direction_left / units::urad},
      {"facet_error_um", facet_error(job.design_w)},
      {"datum", name_of(job.scene.datum.kind)},
      {"alignment", name_of(job.scene.alignment)},
      {"form", form},
      {"timing_s", timing},
      {"warnings", warnings_of(job, verdict.cut)},
      {"versions", versions()},
  };
  json.update(vertex_counts(s));
  if (job.truth.heat) json["temperature_C"] = heat_C(job);
  if (!verdict.cut.process.steps.empty()) json["cut"] = process_figures(verdict.cut.process);
  for (const Verdict::Ring& ring : verdict.rings)
    json["radii_um"][ring.name] = in(units::um, ring.radius);
  if (job.scene.alignment != Alignment::None) {
    const auto& D = verdict.aligned.displacement;
    json["aligned_by"] = {
        {"translation_um", {D[0] / units::um, D[1] / units::um, D[2] / units::um}},
        {"rotation_urad", {D[3] / units::urad, D[4] / units::urad, D[5] / units::urad}},
        {"undetermined", verdict.aligned.undetermined}};
  }
  return json;
}

void write_program(const ResultFolder& folder, const Job& job) {
  if (job.program_text.empty()) return;
  write_file(folder / job.path.file, job.program_text);
}

void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict) {
  write_case_pictures(folder, job, verdict);
  write_source_pictures(folder, job, verdict);
  write_or_remove(folder / "signals.csv", verdict.cut.signals.columns.empty()
                                              ? ""
                                              : escaped_lines(to_csv(verdict.cut.signals)));
  write_file(folder / "scene.toml",
             "case = " + to_toml_value(verdict.cut.case_name) + "\n" + job.scene.resolved);
  const ResultFile rewritten =
      folder / ("rewritten" + std::filesystem::path(job.path.file).extension().string());
  write_or_remove(rewritten, verdict.cut.rewritten_program);
  // last, so that a summary stands for a finished case
  write_json(folder / "summary.json", summary(job, verdict));
}

ordered_json comparison(const Job& job, const std::vector<Compared>& cases,
                        const std::vector<FailedCase>& failed) {
  ordered_json all = ordered_json::array(), warnings = ordered_json::array();
  for (const Compared& one : cases) {
    const Verdict& verdict = one.verdict;
    for (const std::string& warning : one.job->warnings)  // of a scene and all its variants once
      if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
        warnings.push_back(warning);
    for (const std::string& warning : verdict.cut.warnings)
      warnings.push_back(verdict.cut.name + ": " + warning);
    ordered_json entry = {
        {"name", verdict.cut.name},
        {"residual_um", statistics_um(verdict.residual)},
        {"machine_um", verdict.machine ? statistics_um(*verdict.machine) : ordered_json()},
        {"reduction_percent", nullptr},
        {"tip_error_um", spread(verdict.cut.tip_error, units::um)},
        {"direction_error_urad", spread(verdict.cut.direction_error, units::urad)}};
    if (one.uncompensated) {
      const Verdict& before = cases[*one.uncompensated].verdict;
      entry["reduction_percent"] = {{"pv", reduction(before.residual.pv, verdict.residual.pv)},
                                    {"rms", reduction(before.residual.rms, verdict.residual.rms)}};
      if (before.machine && verdict.machine) {
        entry["reduction_percent"]["machine_pv"] =
            reduction(before.machine->pv, verdict.machine->pv);
        entry["reduction_percent"]["machine_rms"] =
            reduction(before.machine->rms, verdict.machine->rms);
      }
    }
    entry.update(vertex_counts(verdict.residual));
    all.push_back(entry);
  }
  ordered_json json = {{"scene", job.scene.title},
                       {"seed", job.scene.seed},
                       {"vertices", job.design_w.vertices.rows()},
                       {"moves", job.path.motion_blocks},
                       {"unreached", unreached(job.unreached)},
                       {"datum", name_of(job.scene.datum.kind)},
                       {"alignment", name_of(job.scene.alignment)},
                       {"cases", all}};
  if (!failed.empty()) {
    json["failed"] = ordered_json::array();
    for (const FailedCase& one : failed)
      json["failed"].push_back({{"name", one.name}, {"reason", one.reason}});
  }
  json["warnings"] = warnings;
  json["versions"] = versions();
  return json;
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
