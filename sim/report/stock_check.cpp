#include "sim/report/stock_check.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cutting/stock/stock.h"
#include "cutting/stock/stock_mesh.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"
#include "sim/files/progress.h"
#include "sim/report/map_formats.h"

namespace abbe::sim {
namespace {

using cutting::Finding;
using cutting::FindingKind;
using cutting::Findings;
using nlohmann::ordered_json;

constexpr std::array kinds{FindingKind::Rest, FindingKind::Gouge, FindingKind::Undercut};
constexpr std::size_t max_listed = 3;  // findings of a kind in the text

/// Returns the design displaced by the alignment, so that the body is compared in the same pose as
/// the map.
cutting::Design compared_design(const Job& job, const Verdict& verdict) {
  if (job.scene.alignment == Alignment::None) return job.design_w;
  return cutting::transformed(
      job.design_w, kinematics::motion(verdict.alignment.displacement, verdict.alignment.point));
}

const Findings::Sums& finding_sums(const StockCheck& check, FindingKind kind) {
  return check.findings.sums[std::size_t(kind)];
}

/// Returns the indices of the listed findings of a kind.
std::vector<std::size_t> finding_indices(const StockCheck& check, FindingKind kind) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < check.findings.list.size(); ++i)
    if (check.findings.list[i].kind == kind) indices.push_back(i);
  return indices;
}

/// Returns the deepest listed finding of a kind; null if there is none.
const Finding* deepest_finding(const StockCheck& check, FindingKind kind) {
  const Finding* deepest = nullptr;
  for (const Finding& finding : check.findings.list)
    if (finding.kind == kind && (deepest == nullptr || finding.depth > deepest->depth))
      deepest = &finding;
  return deepest;
}

/// Returns the note on speckles: findings smaller than a cell of the grid, which may be errors of
/// its resolution.
std::string speckle_text(const Findings::Sums& sums) {
  if (sums.speckles == 0) return "";
  return fmt::format("; {} omitted as too small for the dexel grid, up to {:.3g} mm", sums.speckles,
                     sums.speckle_depth);
}

/// Returns the line on the findings that the text leaves out.
/// @param listed  number of findings in the text
std::string more_text(const Findings::Sums& sums, std::size_t listed) {
  if (sums.regions <= listed) return "";
  const std::size_t unlisted = sums.regions - sums.listed;
  std::string text = fmt::format("  {} more in summary.json", sums.regions - listed);
  if (unlisted > 0) text += fmt::format(", the smallest {} only as totals", unlisted);
  return text + "\n";
}

/// Returns the totals of one kind of finding, and its largest findings.
std::string kind_text(const StockCheck& check, FindingKind kind) {
  const Findings::Sums& sums = finding_sums(check, kind);
  if (sums.regions == 0)
    return sums.speckles == 0
               ? ""
               : fmt::format("{}: none of significant size{}\n", name_of(kind), speckle_text(sums));
  const std::vector<std::size_t> rows = finding_indices(check, kind);
  std::string text = fmt::format("{}: {} mm^3 in {}, {} {}{}\n", name_of(kind),
                                 volume_text(sums.volume), place_count_text(sums.regions),
                                 kind == FindingKind::Undercut ? "highest" : "deepest",
                                 finding_text(*deepest_finding(check, kind)), speckle_text(sums));
  if (rows.size() < 2) return text;
  const std::size_t listed = std::min(max_listed, rows.size());
  for (std::size_t i = 0; i < listed; ++i) {
    const Finding& finding = check.findings.list[rows[i]];
    text += fmt::format("  {}: {} mm^3, {}\n", rows[i] + 1, volume_text(finding.volume),
                        finding_text(finding));
  }
  return text + more_text(sums, listed);
}

/// Returns the areas of the skin that were not compared, in percent; empty if all of it was
/// compared.
std::string excluded_text(const StockCheck& check) {
  const Findings& findings = check.findings;
  const double total = findings.compared + findings.no_design + findings.unresolved;
  if (!(total > 0.0)) return "";
  std::string text;
  const auto add = [&](double area, const char* description) {
    // Less than 0.05 % is negligible.
    if (!(area > 5e-4 * total)) return;
    text +=
        fmt::format("{}{:.3g} % {}", text.empty() ? "" : ", ", 100.0 * area / total, description);
  };
  add(findings.no_design, "has no design surface nearby");
  add(findings.unresolved, "is wall parallel to the dexels");
  add(findings.blank_too_small, "is where the blank is too small for the part");
  return text.empty() ? "" : "of the machined surface " + text + "\n";
}

/// Returns the effects of a case that its stock does not show. The stock loses material that
/// springs back to the shank above the flank, and it is cut by a cutter without wear.
std::vector<std::string> omitted_effects(const Job& job, const Verdict& verdict) {
  const auto map_note = [&] {
    const auto& max = verdict.residual.max;
    return max && *max > 0.0
               ? fmt::format("; the map has up to {:.4g} um of material left", *max / units::um)
               : std::string();
  };
  std::vector<std::string> effects;
  const Process& process = verdict.cut.process;
  const bool is_loaded = std::ranges::any_of(
      process.steps, [](const ProcessStep& step) { return !step.load.tool_wrench_t.isZero(0.0); });
  const bool is_compliant = job.truth.compliance && verdict.cut.case_name != "error_free";
  if (process.stock && is_loaded && is_compliant)
    effects.push_back(
        fmt::format("the body does not show material that springs back from the flank of the "
                    "cutter: the shank, which has the same radius, removes up to {:.3g} mm of it{}",
                    cutting::rubbing, map_note()));
  if (!verdict.cut.wear.empty())
    effects.push_back("the body does not show wear: it is cut with an unworn cutter" + map_note());
  return effects;
}

ordered_json finding_json(const Finding& finding, std::size_t number) {
  return {{"number", number},
          {"volume_mm3", finding.volume},
          {"area_mm2", finding.area},
          {"depth_mm", finding.depth},
          {"is_at_least", finding.is_at_least},
          {"at_mm", numbers(finding.position_w)},
          {"line", finding.line},
          {"by_crash", finding.by_crash},
          {"extent_mm", {numbers(finding.extent_w.min()), numbers(finding.extent_w.max())}},
          {"vertices", finding.vertices}};
}

/// Returns the totals and the listed findings of a kind.
ordered_json kind_json(const StockCheck& check, FindingKind kind) {
  const Findings::Sums& sums = finding_sums(check, kind);
  ordered_json list = ordered_json::array();
  for (const std::size_t i : finding_indices(check, kind))
    list.push_back(finding_json(check.findings.list[i], i + 1));
  return {{"regions", sums.regions},
          {"volume_mm3", sums.volume},
          {"area_mm2", sums.area},
          {"depth_mm", sums.depth},
          {"unlisted", sums.regions - sums.listed},
          {"unlisted_volume_mm3", sums.unlisted_volume},
          {"speckles", sums.speckles},
          {"speckle_volume_mm3", sums.speckle_volume},
          {"speckle_depth_mm", sums.speckle_depth},
          {"list", list}};
}

}  // namespace

const char* name_of(FindingKind kind) {
  constexpr std::array names{"rest material", "gouge", "undercut"};
  return names[std::size_t(kind)];
}

std::string volume_text(double mm3) {
  return mm3 < 1000.0 ? fmt::format("{:.3g}", mm3) : fmt::format("{:.0f}", mm3);
}

std::string place_count_text(std::size_t count) {
  return fmt::format("{} {}", count, count == 1 ? "place" : "places");
}

std::string finding_text(const Finding& finding) {
  const Eigen::Vector3d& p = finding.position_w;
  return fmt::format(
      "{}{:.3g} mm at ({:.2f}, {:.2f}, {:.2f}) of the workpiece, {}",
      finding.is_at_least ? "at least " : "", finding.depth, p.x(), p.y(), p.z(),
      finding.line == 0
          ? std::string("never cut")
          : fmt::format("{}line {}", finding.by_crash ? "crash on " : "", finding.line));
}

std::shared_ptr<const StockCheck> stock_check(const Job& job, const Verdict& verdict) {
  const Process& process = verdict.cut.process;
  if (!process.stock && !process.turned) return nullptr;
  Stopwatch watch;
  auto check = std::make_shared<StockCheck>();
  check->skin =
      process.stock ? cutting::stock_skin(*process.stock) : cutting::stock_skin(*process.turned);
  check->is_turned = !process.stock;
  check->has_design = job.design_w.triangles.rows() > 0;
  check->omitted_effects = omitted_effects(job, verdict);
  if (const auto& settings = job.scene.cutting) {
    check->limits.rest = settings->rest;
    check->limits.gouge = settings->gouge;
  }
  // Undercuts are searched along the z axis of the part frame.
  check->limits.undercut_along = job.scene.part.T_wm.linear().col(2);
  if (check->is_turned) check->limits.undercut_along.reset();
  cutting::DeviationOptions options;
  options.smooth = !job.scene.part.flat_facets;
  check->band = options.band;
  const cutting::DesignDistance design(compared_design(job, verdict), options);
  check->is_closed = design.is_closed();
  check->part = cutting::part_deviation(check->skin, design, options);
  check->findings = cutting::findings(check->skin, check->part, design, check->limits);
  check->seconds = watch.lap();
  return check;
}

std::string to_text(const StockCheck& check) {
  std::string text;
  for (const FindingKind kind : kinds) text += kind_text(check, kind);
  if (text.empty() && check.findings.compared > 0.0)
    text = fmt::format(
        "machined body: no rest material beyond {:.3g} um, no gouge beyond {:.3g} "
        "um{}\n",
        check.limits.rest / units::um, check.limits.gouge / units::um,
        check.is_turned ? "" : ", no undercut");
  text += excluded_text(check);
  for (const std::string& effect : check.omitted_effects) text += effect + "\n";
  return text;
}

ordered_json to_json(const StockCheck& check) {
  const Findings& f = check.findings;
  return {{"frame", "workpiece"},
          {"design", !check.has_design ? "none"
                     : check.is_closed ? "closed"
                                       : "open"},
          {"spacing_mm", check.skin.spacing},
          {"rest_um", check.limits.rest / units::um},
          {"gouge_um", check.limits.gouge / units::um},
          {"band_mm", check.band},
          {"compared_mm2", f.compared},
          {"beyond_band_mm2", f.beyond_band},
          {"no_design_mm2", f.no_design},
          {"unresolved_mm2", f.unresolved},
          {"blank_too_small_mm2", f.blank_too_small},
          {"undercuts_looked_for", !check.is_turned},
          {"left_out", check.omitted_effects},
          {"rest", kind_json(check, FindingKind::Rest)},
          {"gouges", kind_json(check, FindingKind::Gouge)},
          {"undercuts", kind_json(check, FindingKind::Undercut)}};
}

std::vector<std::string> warnings_of(const StockCheck& check) {
  std::vector<std::string> warnings;
  if (const Finding* gouge = deepest_finding(check, FindingKind::Gouge))
    warnings.push_back(fmt::format(
        "the machined body is gouged in {}, deepest {}",
        place_count_text(finding_sums(check, FindingKind::Gouge).regions), finding_text(*gouge)));
  const Findings& f = check.findings;
  if (f.compared == 0.0 && f.no_design + f.unresolved > 0.0)
    warnings.push_back(
        "no part of the machined body is near the design surface: rest material and gouges are "
        "unknown");
  return warnings;
}

std::string to_stl(const StockCheck& check, const Job& job, const Verdict& verdict) {
  return to_stl(check.skin.mesh.vertices_w, check.skin.mesh.triangles,
                fmt::format("machined body, mm, workpiece frame, seed {}, {}: {}", job.scene.seed,
                            verdict.cut.case_name, job.scene.title));
}

}  // namespace abbe::sim
