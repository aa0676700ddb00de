#include "sim/report/stock_pictures.h"

#if ABBE_RENDER

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/label.h"

namespace abbe::sim {

using cutting::Finding;
using cutting::FindingKind;

render::StockField stock_field(const StockCheck& check) {
  render::StockField field;
  field.mesh = check.skin.mesh;
  field.deviation_um = check.part.deviation / units::um;
  field.largest_um = check.part.largest / units::um;
  for (const cutting::SkinStatus status : check.part.status)
    field.compared.push_back(std::uint8_t(status));
  field.finding = check.findings.number;
  field.undercut = check.findings.undercut;
  for (std::size_t i = 0; i < field.finding.size(); ++i) {
    const int number = field.finding[i] > 0 ? field.finding[i] : field.undercut[i];
    field.kind.push_back(
        number == 0 ? 0 : std::uint8_t(1 + int(check.findings.list[std::size_t(number - 1)].kind)));
  }
  return field;
}

render::Facts stock_facts(const StockCheck& check) {
  std::string left_out;
  for (const std::string& effect : check.left_out)
    left_out += (left_out.empty() ? "" : "; ") + effect;
  return {{"deviation_um",
           "machined body against the design: + material left, - gouged; mean of "
           "the places of a cell, nan where not compared"},
          {"left_out", left_out.empty() ? "nothing that the map shows" : left_out},
          {"largest_um", "the same, of greatest magnitude in the cell"},
          {"compared", "0 yes, 1 beyond the band, 2 no design there, 3 wall along the dexels"},
          {"finding", "number of the region in summary.json, 0: none"},
          {"kind", "0 none, 1 rest material, 2 gouge, 3 undercut"},
          {"frame", "workpiece, mm"},
          {"limits", fmt::format("rest material beyond {:.6g} um, gouges beyond {:.6g} um",
                                 check.limits.rest / units::um, check.limits.gouge / units::um)}};
}

namespace {

/// A sum of a kind: "rest material 12.3 mm³ in 4 places".
std::string sum_text(const StockCheck& check, FindingKind kind) {
  const cutting::Findings::Sums& sums = check.findings.sums[std::size_t(kind)];
  if (sums.regions == 0) return fmt::format("no {}", name_of(kind));
  return fmt::format("{} {} mm³ in {}", name_of(kind), volume_text(sums.volume),
                     places_text(sums.regions));
}

std::string depth_text(const Finding& one) {
  const std::string sign = one.kind == FindingKind::Rest    ? "+"
                           : one.kind == FindingKind::Gouge ? "−"
                                                            : "undercut ";
  return fmt::format("{}{}{:.3g} mm", one.is_at_least ? "at least " : "", sign, one.depth);
}

std::vector<std::string> caption_of(const Verdict& verdict, const StockCheck& check) {
  std::string sums =
      sum_text(check, FindingKind::Rest) + ", " + sum_text(check, FindingKind::Gouge);
  if (!check.is_turned) sums += ", " + sum_text(check, FindingKind::Undercut);
  std::vector<std::string> lines{
      fmt::format("{}; limits {:.3g} µm left, {:.3g} µm gouged", sums,
                  check.limits.rest / units::um, check.limits.gouge / units::um),
      fmt::format("machined body against the design, + material left; beyond {:.3g} mm in the "
                  "colour of the end; {:.5g} mm³ removed, stock followed every {:.3g} mm",
                  check.band, totals(verdict.cut.process).removed, check.skin.spacing)};
  for (std::string effect : check.left_out) {
    for (auto at = effect.find(" um"); at != std::string::npos; at = effect.find(" um", at))
      effect.replace(at, 3, " µm");
    lines.push_back(std::move(effect));
  }
  return lines;
}

}  // namespace

render::StockPicture stock_picture(const Job& job, const Verdict& verdict, const StockCheck& check,
                                   const render::StockField& field) {
  constexpr int most_tried = 8;  // of a kind: the largest, of which those in view are shown
  const Eigen::Isometry3d T_mw = job.scene.part.T_wm.inverse();
  render::StockPicture picture;
  picture.title = job.scene.title + ": what " + verdict.cut.name + " leaves of the blank";
  picture.field = field;
  picture.field.mesh.vertices_w = (field.mesh.vertices_w * T_mw.linear().transpose()).rowwise() +
                                  T_mw.translation().transpose();
  std::array<int, cutting::finding_kinds> tried{};
  for (std::size_t i = 0; i < check.findings.list.size(); ++i) {
    const Finding& one = check.findings.list[i];
    if (tried[std::size_t(one.kind)]++ >= most_tried) continue;
    picture.marks.push_back({T_mw * one.place_w, fmt::format("{}: {}", i + 1, depth_text(one)),
                             int(one.kind), int(i) + 1});
  }
  picture.caption = caption_of(verdict, check);
  picture.from = job.scene.view.from;
  picture.up = job.scene.view.up;
  return picture;
}

}  // namespace abbe::sim

#endif
