#include "sim/report/summary_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/files/versions.h"
#include "sim/report/json_numbers.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

// ---- JSON

ordered_json statistics_um(const cutting::Statistics& s) {
  return {{"pv", number(s.pv, units::um)},
          {"rms", number(s.rms, units::um)},
          {"mean", number(s.mean, units::um)},
          {"std", number(s.std_dev, units::um)},
          {"min", number(s.min, units::um)},
          {"max", number(s.max, units::um)},
          {"p95_abs", number(s.p95_abs, units::um)},
          {"in_tolerance_percent", number(s.in_tolerance_percent)}};
}

ordered_json statistics_um(const std::optional<cutting::Statistics>& s) {
  return s ? statistics_um(*s) : ordered_json();
}

/// Of the judged vertices.
std::optional<double> uncut_percent(const cutting::Statistics& s) {
  const int judged = s.cut_vertices + s.uncut_vertices + s.gouged_vertices;
  if (judged == 0) return std::nullopt;
  return 100.0 * s.uncut_vertices / judged;
}

/// How many of the judged vertices are what.
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

ordered_json cut_json(const CutFigures& cut) {
  const ProcessTotals& all = cut.totals;
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

ordered_json aligned_by(const Summary::TakenOut& alignment) {
  return {{"translation_um", numbers(alignment.displacement.head<3>() / units::um)},
          {"rotation_urad", numbers(alignment.displacement.tail<3>() / units::urad)},
          {"undetermined", alignment.undetermined}};
}

ordered_json reduction_percent(const CaseFigures& one) {
  if (!one.residual_reduction) return nullptr;
  ordered_json json{{"pv", number(one.residual_reduction->pv)},
                    {"rms", number(one.residual_reduction->rms)}};
  if (!one.machine_reduction) return json;
  json["machine_pv"] = number(one.machine_reduction->pv);
  json["machine_rms"] = number(one.machine_reduction->rms);
  return json;
}

ordered_json case_json(const CaseFigures& one) {
  ordered_json json = {{"name", one.name},
                       {"residual_um", statistics_um(one.residual)},
                       {"machine_um", statistics_um(one.machine)},
                       {"reduction_percent", reduction_percent(one)},
                       {"tip_error_um", spread(one.tip_error, units::um)},
                       {"direction_error_urad", spread(one.direction_error, units::urad)}};
  json.update(vertex_counts(one.residual));
  return json;
}

// ---- text

/// The head of a table of residuals.
std::string residual_head() {
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", "residual in um", "PV",
                     "RMS", "min", "max", "uncut %", "gouged");
}

/// A line of it, with how much of the part the figures leave out.
std::string residual_line(const CaseFigures& one) {
  const cutting::Statistics& s = one.residual;
  const auto um = [](const std::optional<double>& mm) {
    return mm ? fmt::format("{:.4f}", *mm / units::um) : "-";
  };
  const std::optional<double> uncut = uncut_percent(s);
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", escaped(one.name), um(s.pv),
                     um(s.rms), um(s.min), um(s.max), uncut ? fmt::format("{:.2f}", *uncut) : "-",
                     s.gouged_vertices);
}

/// The line below the table where the machine does not reach all of a generated program.
std::string unreached_line(const program::Unreached& u) {
  if (u.points == 0) return {};
  return fmt::format("not reached by the machine: {} of {} passes, parts of {}\n", u.passes,
                     u.all_passes, u.broken_passes);
}

std::string machine_text(const CaseFigures& one) {
  if (!one.machine || !one.machine->rms) return {};
  std::string text = fmt::format("{:.6f}", *one.machine->rms / units::um);
  if (one.machine_reduction && one.machine_reduction->rms)
    text += fmt::format("  ({:+.2f} %)", -*one.machine_reduction->rms);
  return text;
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
      {"machine_um", statistics_um(s.figures.machine)},
      {"tip_error_um", spread(s.figures.tip_error, units::um)},
      {"direction_error_urad", spread(s.figures.direction_error, units::urad)},
      {"point_left_um", s.point_left / units::um},
      {"direction_left_urad", s.direction_left / units::urad},
      {"facet_error_um", s.facet_error ? spread(*s.facet_error, units::um) : ordered_json()},
      {"datum", name_of(s.datum)},
      {"alignment", name_of(s.alignment)},
      {"form", form},
      {"timing_s", timing},
      {"warnings", s.warnings},
      {"versions", versions()}};
  json.update(vertex_counts(s.figures.residual));
  if (s.temperatures) {
    json["temperature_C"] = ordered_json::object();
    for (const Summary::NodeTemperature& one : *s.temperatures)
      json["temperature_C"][one.node] = {{"start", one.start_C}, {"end", one.end_C}};
  }
  if (s.cut) json["cut"] = cut_json(*s.cut);
  for (const Verdict::Ring& ring : s.rings)
    json["radii_um"][ring.name] = number(ring.radius, units::um);
  if (s.taken_out) json["aligned_by"] = aligned_by(*s.taken_out);
  return json;
}

ordered_json to_json(const Comparison& c) {
  ordered_json all = ordered_json::array();
  for (const CaseFigures& one : c.cases) all.push_back(case_json(one));
  ordered_json json = {{"scene", c.scene},
                       {"seed", c.seed},
                       {"vertices", c.vertices},
                       {"moves", c.moves},
                       {"unreached", unreached(c.unreached)},
                       {"datum", name_of(c.datum)},
                       {"alignment", name_of(c.alignment)},
                       {"cases", all}};
  for (const FailedCase& one : c.failed)
    json["failed"].push_back({{"name", one.name}, {"reason", one.reason}});
  json["warnings"] = c.warnings;
  json["versions"] = versions();
  return json;
}

std::string to_text(const Summary& s) {
  return residual_head() + "\n" + residual_line(s.figures) + "\n" + unreached_line(s.unreached);
}

std::string to_text(const Comparison& c) {
  std::string text = residual_head() + "   machine's part, RMS\n";
  for (const CaseFigures& one : c.cases)
    text += residual_line(one) + "   " + machine_text(one) + "\n";
  return text + unreached_line(c.unreached);
}

}  // namespace abbe::sim
