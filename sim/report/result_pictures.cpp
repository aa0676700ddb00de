#include "sim/report/result_pictures.h"

#if ABBE_RENDER

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/figures.h"

namespace abbe::sim {

using cutting::Finding;
using cutting::FindingKind;

render::StockField stock_field(const StockCheck& check) {
  render::StockField field;
  field.mesh = check.skin.mesh;
  field.deviation_um = check.part.deviation / units::um;
  field.largest_um = check.part.max_deviation / units::um;
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
  std::string omitted_effects;
  for (const std::string& effect : check.omitted_effects)
    omitted_effects += (omitted_effects.empty() ? "" : "; ") + effect;
  return {{"deviation_um",
           "machined body against the design: + material left, - gouged; mean over the points of a "
           "cell, nan where not compared"},
          {"left_out", omitted_effects.empty() ? "nothing shown in the map" : omitted_effects},
          {"largest_um", "the deviation of largest magnitude in the cell"},
          {"compared",
           "0 yes, 1 beyond the band, 2 no design surface nearby, 3 wall parallel to the dexels"},
          {"finding", "number of the region in summary.json, 0 for none"},
          {"kind", "0 none, 1 rest material, 2 gouge, 3 undercut"},
          {"frame", "workpiece, mm"},
          {"limits", fmt::format("rest material beyond {:.6g} um, gouges beyond {:.6g} um",
                                 check.limits.rest / units::um, check.limits.gouge / units::um)}};
}

namespace {

/// Returns the totals of one kind, such as "rest material 12.3 mm³ in 4 places".
std::string sum_text(const StockCheck& check, FindingKind kind) {
  const cutting::Findings::Sums& sums = check.findings.sums[std::size_t(kind)];
  if (sums.regions == 0) return fmt::format("no {}", name_of(kind));
  return fmt::format("{} {} mm³ in {}", name_of(kind), volume_text(sums.volume),
                     place_count_text(sums.regions));
}

/// Returns the depth of a finding; remaining material is positive.
std::string depth_text(const Finding& finding) {
  const std::string sign = finding.kind == FindingKind::Rest    ? "+"
                           : finding.kind == FindingKind::Gouge ? "−"
                                                                : "undercut ";
  return fmt::format("{}{}{:.3g} mm", finding.is_at_least ? "at least " : "", sign, finding.depth);
}

/// Returns the caption: totals, limits, scale and omitted effects.
std::vector<std::string> stock_caption(const Verdict& verdict, const StockCheck& check) {
  std::string sums =
      sum_text(check, FindingKind::Rest) + ", " + sum_text(check, FindingKind::Gouge);
  if (!check.is_turned) sums += ", " + sum_text(check, FindingKind::Undercut);
  std::vector<std::string> lines{
      fmt::format("{}; limits {:.3g} µm left, {:.3g} µm gouged", sums,
                  check.limits.rest / units::um, check.limits.gouge / units::um),
      fmt::format("machined body against the design, + material left; beyond {:.3g} mm in the end "
                  "colour; {:.5g} mm³ removed, stock grid {:.3g} mm",
                  check.band, totals(verdict.cut.process).removed, check.skin.spacing)};
  for (std::string effect : check.omitted_effects) {
    for (auto at = effect.find(" um"); at != std::string::npos; at = effect.find(" um", at))
      effect.replace(at, 3, " µm");
    lines.push_back(std::move(effect));
  }
  return lines;
}

}  // namespace

render::StockPicture stock_picture(const Job& job, const Verdict& verdict, const StockCheck& check,
                                   const render::StockField& field) {
  constexpr int max_marks = 8;  // per kind, for the largest findings; those in view are drawn
  const Eigen::Isometry3d T_mw = job.scene.part.T_wm.inverse();
  render::StockPicture picture;
  picture.title = job.scene.title + ": machined body of " + verdict.cut.name;
  picture.field = field;
  picture.field.mesh.vertices_w = (field.mesh.vertices_w * T_mw.linear().transpose()).rowwise() +
                                  T_mw.translation().transpose();
  std::array<int, cutting::finding_kinds> mark_count{};
  for (std::size_t i = 0; i < check.findings.list.size(); ++i) {
    const Finding& finding = check.findings.list[i];
    if (mark_count[std::size_t(finding.kind)]++ >= max_marks) continue;
    picture.marks.push_back({T_mw * finding.position_w,
                             fmt::format("{}: {}", i + 1, depth_text(finding)), int(finding.kind),
                             int(i) + 1});
  }
  picture.caption = stock_caption(verdict, check);
  picture.from = job.scene.view.from;
  picture.up = job.scene.view.up;
  return picture;
}

}  // namespace abbe::sim

#endif

#if ABBE_RENDER

#include <algorithm>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "sim/cut/bodies.h"

namespace abbe::sim {
namespace {

constexpr render::Colour red{0.82, 0.16, 0.12}, grey{0.78, 0.82, 0.88};

}  // namespace

const Collision* first_event(const Collisions& collisions) {
  const Collision* nearest = nullptr;
  for (const Collision& event : collisions.list) {
    if (event.contact) return &event;
    if (nearest == nullptr || event.distance < nearest->distance) nearest = &event;
  }
  return nearest;
}

render::MachinePicture collision_picture(const Job& job, const Collisions& collisions,
                                         const Collision& event) {
  const Segment& segment = job_segments(job)[event.part];
  const std::vector<kinematics::Pose> T = carrier_poses(
      segment.truth.actual, event.state.q, deviations(segment.truth, event.state).joints);
  render::MachinePicture picture;
  picture.title = fmt::format("{}: {} and {}", job.scene.title, event.a, event.b);
  for (const SolidBody& solid : segment_bodies(job, segment)) {
    const bool is_involved = solid.name == event.a || solid.name == event.b;
    const kinematics::Pose& T_b = T[std::size_t(solid.frame)];
    if (solid.kind == SolidBody::Kind::Part) {
      // The stock at the moment of the event is drawn, not the finished part.
      const cutting::ClosedMesh& shape = event.stock ? *event.stock : solid.mesh;
      picture.part_vertices = cutting::transformed_mesh(shape, T_b).vertices;
      picture.part_triangles = shape.triangles;
      if (event.stock) picture.part_name = "stock";
      if (is_involved || event.stock) picture.part_colour = red;
      continue;
    }
    render::Body body;
    body.label = solid.name;
    body.T = T_b;
    body.shape = render::SolidShape{solid.mesh.vertices, solid.mesh.triangles};
    body.colour = is_involved ? red : grey;
    body.opacity = is_involved ? 1.0 : 0.35;
    // The close-up view shows the two bodies and the whole tool.
    body.in_close_up = is_involved || solid.frame == Carriers{segment.truth.actual.size()}.tool();
    picture.bodies.push_back(std::move(body));
  }
  const Eigen::Vector3d &w = event.position_w, &b = event.place_b;
  picture.caption = {
      fmt::format("{}, case {}; the two in red", event_text(event, collisions),
                  collisions.commands),
      fmt::format("{} at ({:.2f}, {:.2f}, {:.2f}) mm of the workpiece, ({:.2f}, {:.2f}, {:.2f}) mm "
                  "of the bed",
                  event.contact ? "at first contact," : "where they are closest,", w.x(), w.y(),
                  w.z(), b.x(), b.y(), b.z())};
  return picture;
}

namespace {

/// Returns the pairs that are the nearest pair of some block, sorted by the number of contacts,
/// then by the number of blocks.
std::vector<int> plotted_pairs(const std::vector<BlockClearance>& blocks) {
  // Number of contacts, number of blocks.
  std::map<int, std::pair<std::size_t, std::size_t>> counts_by_pair;
  for (const BlockClearance& block : blocks) {
    if (block.pair < 0) continue;
    counts_by_pair[block.pair].first += block.min_clearance == 0.0;
    ++counts_by_pair[block.pair].second;
  }
  std::vector<int> pairs;
  for (const auto& [pair, counts] : counts_by_pair) pairs.push_back(pair);
  std::ranges::stable_sort(pairs, std::greater<>{},
                           [&](int pair) { return counts_by_pair.at(pair); });
  return pairs;
}

/// Returns the clearance of a pair as a step per block, with gaps for blocks in which another pair
/// is nearer.
render::Series clearance_steps(const std::vector<BlockClearance>& blocks, int pair) {
  const auto n = Eigen::Index(blocks.size());
  render::Series series;
  series.x.resize(2 * n);
  series.y.resize(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const BlockClearance& block = blocks[std::size_t(i)];
    series.x.segment<2>(2 * i) << block.place.time_s, block.end_s;
    series.y.segment<2>(2 * i).setConstant(
        block.pair == pair ? block.min_clearance : std::numeric_limits<double>::quiet_NaN());
  }
  return series;
}

/// Returns a point for every block with contact, because the step of a short one is invisible.
render::Series contact_points(const std::vector<BlockClearance>& blocks, int pair) {
  std::vector<double> times_s;
  for (const BlockClearance& block : blocks)
    if (block.pair == pair && block.min_clearance == 0.0)
      times_s.push_back(0.5 * (block.place.time_s + block.end_s));
  render::Series series;
  series.curve_style = render::CurveStyle::Points;
  series.x = Eigen::Map<const Eigen::VectorXd>(times_s.data(), Eigen::Index(times_s.size()));
  series.y = Eigen::VectorXd::Zero(series.x.size());
  return series;
}

}  // namespace

render::Panel clearance_panel(const Collisions& collisions) {
  constexpr std::size_t max_pairs = 6;
  std::vector<int> pairs = plotted_pairs(collisions.blocks);
  const std::size_t pair_count = pairs.size();
  if (pair_count > max_pairs) pairs.resize(max_pairs);
  render::Panel panel;
  panel.x_label = "time / s";
  panel.y_label = "minimum clearance / mm";
  for (const int pair : pairs) {
    const Clearance& clearance = collisions.clearances[std::size_t(pair)];
    panel.series.push_back(clearance_steps(collisions.blocks, pair));
    panel.series.back().name = clearance.a + " - " + clearance.b;
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    render::Series points = contact_points(collisions.blocks, pairs[i]);
    points.colour = int(i);
    if (points.x.size() > 0) panel.series.push_back(std::move(points));
  }
  if (pair_count > pairs.size())
    panel.note.push_back(fmt::format("and {} more {}", pair_count - pairs.size(),
                                     pair_count - pairs.size() == 1 ? "pair" : "pairs"));
  return panel;
}

std::vector<std::string> clearance_caption(const Collisions& collisions) {
  std::vector<std::string> lines = {
      "a lower bound for every block, for its closest pair: the true clearance is at most 5 % or "
      "0.01 mm more; 0 is contact"};
  const auto has_pair = [&](ClearanceScope in_blocks, bool is_with_stock) {
    return std::ranges::any_of(collisions.clearances, [&](const Clearance& pair) {
      return pair.in_blocks == in_blocks && (pair.b == "stock") == is_with_stock;
    });
  };
  if (has_pair(ClearanceScope::WhenNear, true))
    lines.push_back(
        fmt::format("the stock is included only in blocks with contact or a clearance below {:g} "
                    "mm; otherwise its clearance is known only for the whole program",
                    collisions.clearance));
  if (has_pair(ClearanceScope::WhenInContact, false) ||
      has_pair(ClearanceScope::WhenInContact, true))
    lines.push_back(
        "cutter and shank with the part or the stock, which they may touch, are included only in "
        "blocks with contact");
  return lines;
}

}  // namespace abbe::sim

#endif
