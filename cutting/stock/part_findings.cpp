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
struct VertexShare {
  double volume = 0.0;  // of an undercut
  double depth = 0.0;
  Vector3d place_w = Vector3d::Zero();
  std::int32_t line = 0;  // as in DexelRun
  bool is_cut_off = false;
};

/// A region while it is collected.
struct FoundRegion {
  Finding finding;
  Sum volume, area;
  std::int32_t line = 0;
};

/// The vertices of one kind.
struct MarkedVertices {
  FindingKind kind;
  std::vector<char> has;            // (n)
  std::vector<VertexShare> shares;  // (n)
};

std::vector<FoundRegion> regions(const StockSkin& skin, const MarkedVertices& kind,
                                 const Eigen::VectorXd& area, std::vector<int>& region_of) {
  DisjointSets sets(kind.has.size());
  for (const auto& t : skin.mesh.triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (kind.has[std::size_t(a)] && kind.has[std::size_t(b)]) sets.join(a, b);
    }
  std::vector<FoundRegion> all;
  region_of.assign(kind.has.size(), -1);
  for (std::size_t i = 0; i < kind.has.size(); ++i) {
    if (!kind.has[i]) continue;
    // the least vertex of the set, so its region already has a number
    const auto name = std::size_t(sets.name_of(int(i)));
    if (name == i) {
      region_of[i] = int(all.size());
      all.emplace_back();
      all.back().finding.kind = kind.kind;
    }
    region_of[i] = region_of[name];
    FoundRegion& region = all[std::size_t(region_of[i])];
    const VertexShare& share = kind.shares[i];
    Finding& finding = region.finding;
    ++finding.vertices;
    region.volume.add(share.volume);
    region.area.add(area[Index(i)]);
    finding.extent_w.extend(share.place_w);
    finding.is_at_least = finding.is_at_least || share.is_cut_off;
    if (finding.vertices > 1 && share.depth <= finding.depth) continue;
    finding.depth = share.depth;
    finding.place_w = share.place_w;
    region.line = share.line;
  }
  for (FoundRegion& region : all) {
    region.finding.volume = region.volume.value();
    region.finding.area = region.area.value();
    region.finding.line = std::abs(region.line);
    region.finding.by_crash = region.line < 0;
  }
  return all;
}

/// Appends the regions of a kind to the list and numbers their vertices.
void list_regions(const std::vector<FoundRegion>& all, const std::vector<int>& region_of,
                  std::size_t most, Findings& found, std::vector<int>& number) {
  std::vector<int> order;
  Sum volume, area, unlisted, speckles;
  for (std::size_t i = 0; i < all.size(); ++i)
    // Smaller regions are summed as speckles below.
    if (all[i].finding.vertices >= min_vertices) order.push_back(int(i));
  // Stable, so that regions of equal volume keep the order of their vertices.
  std::ranges::stable_sort(order, [&](int a, int b) {
    return all[std::size_t(a)].finding.volume > all[std::size_t(b)].finding.volume;
  });
  if (all.empty()) return;
  Findings::Sums& sums = found.sums[std::size_t(all.front().finding.kind)];
  std::vector<int> number_of(all.size(), 0);
  for (const int i : order) {
    const Finding& one = all[std::size_t(i)].finding;
    ++sums.regions;
    volume.add(one.volume);
    area.add(one.area);
    sums.depth = std::max(sums.depth, one.depth);
    if (sums.listed < most) {
      ++sums.listed;
      found.list.push_back(one);
      number_of[std::size_t(i)] = int(found.list.size());
    } else {
      unlisted.add(one.volume);
    }
  }
  for (const FoundRegion& region : all) {
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
    if (region_of[i] >= 0) number[i] = number_of[std::size_t(region_of[i])];
}

/// Returns the vertices of rest material (sign 1) or gouges (sign -1).
MarkedVertices vertices_beyond_limit(const StockSkin& skin, const PartDeviation& part, double sign,
                                     double limit) {
  const std::size_t n = part.at.size();
  MarkedVertices kind{sign > 0 ? FindingKind::Rest : FindingKind::Gouge, std::vector<char>(n, 0),
                      std::vector<VertexShare>(n)};
  for (std::size_t i = 0; i < n; ++i) {
    const Index v = Index(i);
    if (part.at[i] < 0 || !(sign * part.largest[v] > limit)) continue;
    const std::int32_t line = skin.line[std::size_t(part.at[i])];
    if (sign < 0 && line == 0) continue;  // skin of a blank that is too small
    kind.has[i] = 1;
    kind.shares[i] = {0.0, sign * part.largest[v], skin.places_w.row(part.at[i]), line,
                      part.status[i] == SkinStatus::CutOff};
  }
  return kind;
}

/// Returns the region of each vertex, with those marked that cannot belong to any.
SkinRegions skin_regions(const StockSkin& skin, const PartDeviation& part,
                         std::vector<int> region_of, double sign, double limit) {
  SkinRegions all{std::move(region_of), 0, limit};
  for (std::size_t i = 0; i < all.of.size(); ++i) {
    all.count = std::max(all.count, all.of[i] + 1);
    const bool is_blank = sign < 0.0 && part.at[i] >= 0 && part.largest[Index(i)] < -limit &&
                          skin.line[std::size_t(part.at[i])] == 0;
    if (part.at[i] < 0 || is_blank) all.of[i] = SkinRegions::never;
  }
  return all;
}

MarkedVertices undercut_vertices(const StockSkin& skin, const Points& area, const Vector3d& along) {
  const std::size_t n = skin.mesh.line.size();
  MarkedVertices kind{FindingKind::Undercut, std::vector<char>(n, 0), std::vector<VertexShare>(n)};
  const TriangleTree tree(skin.mesh.vertices_w, skin.mesh.triangles);
  tbb::parallel_for(std::size_t(0), n, [&](std::size_t i) {
    if (skin.mesh.line[i] == 0) return;
    const Vector3d place = skin.mesh.vertices_w.row(Index(i));
    const Vector3d a = area.row(Index(i)), outward = a.normalized();
    // Start one spacing off the skin: a wall that leans by less counts as upright.
    const auto above =
        tree.first_hit(place + skin.spacing * outward, along, TriangleTree::Side::Outer);
    if (!above) return;
    // From the skin itself, not from the displaced start.
    const double height = std::max(0.0, above->along + skin.spacing * outward.dot(along));
    kind.has[i] = 1;
    kind.shares[i] = {height * std::max(0.0, a.dot(along)), height, place, skin.mesh.line[i],
                      false};
  });
  return kind;
}

void sum_areas(const StockSkin& skin, const PartDeviation& part, const Eigen::VectorXd& area,
               double gouge, Findings& found) {
  Sum compared, cut_off, no_design, unresolved, too_small;
  for (std::size_t i = 0; i < part.status.size(); ++i) {
    const double one = area[Index(i)];
    switch (part.status[i]) {
      // A limited deviation is compared too.
      case SkinStatus::CutOff:
        cut_off.add(one);
        [[fallthrough]];
      case SkinStatus::Compared:
        compared.add(one);
        if (part.largest[Index(i)] < -gouge && skin.line[std::size_t(part.at[i])] == 0)
          too_small.add(one);
        break;
      case SkinStatus::NoDesign:
        no_design.add(one);
        break;
      case SkinStatus::Unresolved:
        unresolved.add(one);
    }
  }
  found.compared = compared.value();
  found.cut_off = cut_off.value();
  found.no_design = no_design.value();
  found.unresolved = unresolved.value();
  found.too_small = too_small.value();
}

}  // namespace

Findings findings(const StockSkin& skin, const PartDeviation& part, const DesignDistance& design,
                  const FindingOptions& options) {
  const std::size_t n = std::size_t(skin.mesh.vertices_w.rows());
  if (part.at.size() != n || skin.first.size() != n + 1)
    throw std::invalid_argument("findings: a deviation of every vertex is needed");
  if (!(options.rest > 0.0) || !(options.gouge > 0.0))
    throw std::invalid_argument("findings: expected limits > 0");
  Findings found;
  found.number.assign(n, 0);
  found.undercut.assign(n, 0);
  const Points directed = directed_area(skin.mesh);
  const Eigen::VectorXd area = vertex_area(skin.mesh.vertices_w, skin.mesh.triangles);
  std::vector<int> region_of;
  const auto take_beyond = [&](double sign, double limit) {
    std::vector<FoundRegion> all =
        regions(skin, vertices_beyond_limit(skin, part, sign, limit), area, region_of);
    // Measured along lines through the part and not summed over vertices, which lie off the skin at
    // edges.
    const std::vector<double> volumes =
        volumes_between(skin, design, skin_regions(skin, part, region_of, sign, limit),
                        sign > 0.0 ? Between::Left : Between::Lost);
    for (std::size_t i = 0; i < all.size(); ++i) all[i].finding.volume = volumes[i];
    list_regions(all, region_of, options.most, found, found.number);
  };
  take_beyond(1.0, options.rest);
  take_beyond(-1.0, options.gouge);
  if (options.undercut_along && n > 0) {
    const std::vector<FoundRegion> all =
        regions(skin, undercut_vertices(skin, directed, *options.undercut_along), area, region_of);
    list_regions(all, region_of, options.most, found, found.undercut);
  }
  sum_areas(skin, part, area, options.gouge, found);
  return found;
}

}  // namespace abbe::cutting
