#include "cutting/stock/part_findings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "cutting/part/compensated_sum.h"
#include "cutting/part/design_points.h"
#include "cutting/part/index_sets.h"
#include "cutting/stock/part_volumes.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

/// The contribution of a vertex to its region.
struct VertexContribution {
  double volume = 0.0;  // of an undercut
  double depth = 0.0;
  Vector3d position_w = Vector3d::Zero();
  std::int32_t line = 0;  // as in DexelRun
  bool is_beyond_band = false;
};

/// A region with the sums over its vertices.
struct RegionAccumulator {
  Finding finding;
  CompensatedSum volume, area;
  std::int32_t line = 0;
};

/// The vertices of one kind of finding.
struct VertexSelection {
  FindingKind kind;
  std::vector<char> is_selected;                  // (n)
  std::vector<VertexContribution> contributions;  // (n)
};

/// Returns the connected regions of the selected vertices, and stores the region of every vertex;
/// -1 if the vertex is not selected.
std::vector<RegionAccumulator> collect_regions(const StockSkin& skin,
                                               const VertexSelection& selection,
                                               const Eigen::VectorXd& area,
                                               std::vector<int>& region_of) {
  DisjointSets sets(selection.is_selected.size());
  for (const auto& t : skin.mesh.triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (selection.is_selected[std::size_t(a)] && selection.is_selected[std::size_t(b)])
        sets.join(a, b);
    }
  std::vector<RegionAccumulator> regions;
  region_of.assign(selection.is_selected.size(), -1);
  for (std::size_t i = 0; i < selection.is_selected.size(); ++i) {
    if (!selection.is_selected[i]) continue;
    // The representative is the smallest vertex of the set, so its region already has a number.
    const auto representative = std::size_t(sets.representative(int(i)));
    if (representative == i) {
      region_of[i] = int(regions.size());
      regions.emplace_back();
      regions.back().finding.kind = selection.kind;
    }
    region_of[i] = region_of[representative];
    RegionAccumulator& region = regions[std::size_t(region_of[i])];
    const VertexContribution& contribution = selection.contributions[i];
    Finding& finding = region.finding;
    ++finding.vertices;
    region.volume.add(contribution.volume);
    region.area.add(area[Index(i)]);
    finding.extent_w.extend(contribution.position_w);
    finding.is_at_least = finding.is_at_least || contribution.is_beyond_band;
    if (finding.vertices > 1 && contribution.depth <= finding.depth) continue;
    finding.depth = contribution.depth;
    finding.position_w = contribution.position_w;
    region.line = contribution.line;
  }
  for (RegionAccumulator& region : regions) {
    region.finding.volume = region.volume.value();
    region.finding.area = region.area.value();
    region.finding.line = std::abs(region.line);
    region.finding.by_crash = region.line < 0;
  }
  return regions;
}

/// Appends the regions of one kind to the list and numbers their vertices.
void list_regions(const std::vector<RegionAccumulator>& regions, const std::vector<int>& region_of,
                  std::size_t max_count, Findings& findings, std::vector<int>& numbers) {
  std::vector<int> order;
  CompensatedSum volume, area, unlisted, speckles;
  for (std::size_t i = 0; i < regions.size(); ++i)
    // Smaller regions are counted as speckles below.
    if (regions[i].finding.vertices >= min_vertices) order.push_back(int(i));
  // Stable, so that regions of equal volume keep the order of their vertices.
  std::ranges::stable_sort(order, [&](int a, int b) {
    return regions[std::size_t(a)].finding.volume > regions[std::size_t(b)].finding.volume;
  });
  if (regions.empty()) return;
  Findings::Sums& sums = findings.sums[std::size_t(regions.front().finding.kind)];
  std::vector<int> number_of(regions.size(), 0);
  for (const int i : order) {
    const Finding& finding = regions[std::size_t(i)].finding;
    ++sums.regions;
    volume.add(finding.volume);
    area.add(finding.area);
    sums.depth = std::max(sums.depth, finding.depth);
    if (sums.listed < max_count) {
      ++sums.listed;
      findings.list.push_back(finding);
      number_of[std::size_t(i)] = int(findings.list.size());
    } else {
      unlisted.add(finding.volume);
    }
  }
  for (const RegionAccumulator& region : regions) {
    if (region.finding.vertices >= min_vertices) continue;
    ++sums.speckles;
    speckles.add(region.finding.volume);
    sums.speckle_depth = std::max(sums.speckle_depth, region.finding.depth);
  }
  sums.volume = volume.value();
  sums.area = area.value();
  sums.unlisted_volume = unlisted.value();
  sums.speckle_volume = speckles.value();
  for (std::size_t i = 0; i < region_of.size(); ++i)
    if (region_of[i] >= 0) numbers[i] = number_of[std::size_t(region_of[i])];
}

/// Returns the vertices of rest material (sign 1) or gouges (sign -1).
VertexSelection vertices_beyond_limit(const StockSkin& skin, const PartDeviation& deviation,
                                      double sign, double limit) {
  const std::size_t n = deviation.at.size();
  VertexSelection selection{sign > 0 ? FindingKind::Rest : FindingKind::Gouge,
                            std::vector<char>(n, 0), std::vector<VertexContribution>(n)};
  for (std::size_t i = 0; i < n; ++i) {
    const Index v = Index(i);
    if (deviation.at[i] < 0 || !(sign * deviation.max_deviation[v] > limit)) continue;
    const std::int32_t line = skin.line[std::size_t(deviation.at[i])];
    if (sign < 0 && line == 0) continue;  // skin of a blank that is too small
    selection.is_selected[i] = 1;
    selection.contributions[i] = {0.0, sign * deviation.max_deviation[v],
                                  skin.points_w.row(deviation.at[i]), line,
                                  deviation.status[i] == SkinStatus::BeyondBand};
  }
  return selection;
}

/// Returns the region of each vertex; excludes vertices that cannot belong to a region.
SkinRegions skin_regions(const StockSkin& skin, const PartDeviation& deviation,
                         std::vector<int> region_of, double sign, double limit) {
  SkinRegions result{std::move(region_of), 0, limit};
  for (std::size_t i = 0; i < result.region.size(); ++i) {
    result.count = std::max(result.count, result.region[i] + 1);
    const bool is_blank = sign < 0.0 && deviation.at[i] >= 0 &&
                          deviation.max_deviation[Index(i)] < -limit &&
                          skin.line[std::size_t(deviation.at[i])] == 0;
    if (deviation.at[i] < 0 || is_blank) result.region[i] = SkinRegions::excluded;
  }
  return result;
}

/// Returns the vertices of cut skin that lie under other material.
VertexSelection undercut_vertices(const StockSkin& skin, const Points& directed_areas,
                                  const Vector3d& towards_tool) {
  const std::size_t n = skin.mesh.line.size();
  VertexSelection selection{FindingKind::Undercut, std::vector<char>(n, 0),
                            std::vector<VertexContribution>(n)};
  const TriangleTree tree(skin.mesh.vertices_w, skin.mesh.triangles);
  tbb::parallel_for(std::size_t(0), n, [&](std::size_t i) {
    if (skin.mesh.line[i] == 0) return;
    const Vector3d point = skin.mesh.vertices_w.row(Index(i));
    const Vector3d a = directed_areas.row(Index(i)), outward = a.normalized();
    // Start one spacing off the skin, so that a wall that leans by less counts as upright.
    const auto hit =
        tree.first_hit(point + skin.spacing * outward, towards_tool, TriangleTree::Side::Outer);
    if (!hit) return;
    // Measured from the skin itself, not from the displaced start.
    const double height = std::max(0.0, hit->along + skin.spacing * outward.dot(towards_tool));
    selection.is_selected[i] = 1;
    selection.contributions[i] = {height * std::max(0.0, a.dot(towards_tool)), height, point,
                                  skin.mesh.line[i], false};
  });
  return selection;
}

void sum_areas(const StockSkin& skin, const PartDeviation& deviation, const Eigen::VectorXd& area,
               double gouge_limit, Findings& findings) {
  CompensatedSum compared, beyond_band, no_design, unresolved, blank_too_small;
  for (std::size_t i = 0; i < deviation.status.size(); ++i) {
    const double vertex_area = area[Index(i)];
    switch (deviation.status[i]) {
      // Skin beyond the band is compared, too.
      case SkinStatus::BeyondBand:
        beyond_band.add(vertex_area);
        [[fallthrough]];
      case SkinStatus::Compared:
        compared.add(vertex_area);
        if (deviation.max_deviation[Index(i)] < -gouge_limit &&
            skin.line[std::size_t(deviation.at[i])] == 0)
          blank_too_small.add(vertex_area);
        break;
      case SkinStatus::NoDesign:
        no_design.add(vertex_area);
        break;
      case SkinStatus::Unresolved:
        unresolved.add(vertex_area);
    }
  }
  findings.compared = compared.value();
  findings.beyond_band = beyond_band.value();
  findings.no_design = no_design.value();
  findings.unresolved = unresolved.value();
  findings.blank_too_small = blank_too_small.value();
}

}  // namespace

Findings findings(const StockSkin& skin, const PartDeviation& deviation,
                  const DesignDistance& design, const FindingOptions& options) {
  const std::size_t n = std::size_t(skin.mesh.vertices_w.rows());
  if (deviation.at.size() != n || skin.first.size() != n + 1)
    throw std::invalid_argument("findings: expected one deviation per vertex");
  if (!(options.rest > 0.0) || !(options.gouge > 0.0))
    throw std::invalid_argument("findings: expected limits above 0");
  Findings result;
  result.number.assign(n, 0);
  result.undercut.assign(n, 0);
  const Points directed_areas = directed_area(skin.mesh);
  const Eigen::VectorXd area = vertex_area(skin.mesh.vertices_w, skin.mesh.triangles);
  std::vector<int> region_of;
  const auto find_regions = [&](double sign, double limit) {
    std::vector<RegionAccumulator> regions =
        collect_regions(skin, vertices_beyond_limit(skin, deviation, sign, limit), area, region_of);
    // Volumes are measured along lines through the part, not summed over vertices, which lie off
    // the skin at edges.
    const std::vector<double> volumes =
        volumes_between(skin, design, skin_regions(skin, deviation, region_of, sign, limit),
                        sign > 0.0 ? DeviationSide::Excess : DeviationSide::Missing);
    for (std::size_t i = 0; i < regions.size(); ++i) regions[i].finding.volume = volumes[i];
    list_regions(regions, region_of, options.max_listed, result, result.number);
  };
  find_regions(1.0, options.rest);
  find_regions(-1.0, options.gouge);
  if (options.undercut_along && n > 0) {
    const std::vector<RegionAccumulator> regions = collect_regions(
        skin, undercut_vertices(skin, directed_areas, *options.undercut_along), area, region_of);
    list_regions(regions, region_of, options.max_listed, result, result.undercut);
  }
  sum_areas(skin, deviation, area, options.gouge, result);
  return result;
}

}  // namespace abbe::cutting
