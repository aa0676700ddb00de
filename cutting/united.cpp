#include "cutting/united.h"

#include <algorithm>
#include <limits>
#include <map>

namespace abbe::cutting {

using Eigen::Index;

namespace {

/// Vertices that one tool cuts within the band and this one has gouged: which of them it has
/// removed at -band, and not only deeper.
std::vector<std::uint8_t> removed_at_band(const Design& design, const SurfaceOf& tool,
                                          const std::vector<std::uint8_t>& asked, double band) {
  constexpr double touch = 1e-6;  // mm
  Design below = design;
  below.triangles.resize(0, 3);
  below.vertices -= band * design.normals;
  below.judged = asked;
  const Surface there = tool(below, touch);
  std::vector<std::uint8_t> removed(asked.size(), 0);
  for (std::size_t i = 0; i < removed.size(); ++i)
    removed[i] = there.status[i] == VertexStatus::Cut || there.status[i] == VertexStatus::Gouged;
  return removed;
}

bool is_earlier(const Surface& a, const Surface& b, Index v) {
  if (a.residual[v] != b.residual[v]) return a.residual[v] < b.residual[v];
  return a.cut_time_s[v] < b.cut_time_s[v];
}

/// The cuts within the band alone, the least of all tools.
Surface least_cuts(const std::vector<Surface>& surfaces) {
  Surface least = surfaces.front();
  least.gouges.clear();
  for (VertexStatus& status : least.status)
    if (status == VertexStatus::Gouged) status = VertexStatus::Uncut;
  for (const Surface& one : surfaces)
    for (std::size_t i = 0; i < one.status.size(); ++i) {
      const auto v = Index(i);
      if (one.status[i] != VertexStatus::Cut) continue;
      if (least.status[i] == VertexStatus::Cut && !is_earlier(one, least, v)) continue;
      least.residual[v] = one.residual[v];
      least.cut_time_s[v] = one.cut_time_s[v];
      least.cut_line[i] = one.cut_line[i];
      least.status[i] = VertexStatus::Cut;
    }
  return least;
}

/// Vertices that are gouged although a tool cuts them within the band: 1 for each.
std::vector<std::uint8_t> buried_cuts(const Design& design, const std::vector<SurfaceOf>& tools,
                                      const std::vector<Surface>& surfaces, const Surface& cuts,
                                      double band) {
  std::vector<std::uint8_t> buried(cuts.status.size(), 0);
  for (std::size_t k = 0; k < tools.size(); ++k) {
    std::vector<std::uint8_t> asked(cuts.status.size(), 0);
    for (const Gouge& gouge : surfaces[k].gouges)
      asked[std::size_t(gouge.vertex)] =
          cuts.status[std::size_t(gouge.vertex)] == VertexStatus::Cut;
    if (std::find(asked.begin(), asked.end(), 1) == asked.end()) continue;
    const std::vector<std::uint8_t> removed = removed_at_band(design, tools[k], asked, band);
    for (std::size_t i = 0; i < buried.size(); ++i) buried[i] |= removed[i];
  }
  return buried;
}

/// Makes a vertex one that a tool has gouged; of several gouges the deepest stays.
void add_gouge(Surface& to, std::map<int, Gouge>& gouges, const Surface& from, const Gouge& gouge) {
  const auto [there, is_new] = gouges.emplace(gouge.vertex, gouge);
  if (!is_new && gouge.depth <= there->second.depth) return;
  there->second = gouge;
  to.status[std::size_t(gouge.vertex)] = VertexStatus::Gouged;
  to.residual[gouge.vertex] = std::numeric_limits<double>::quiet_NaN();
  to.cut_time_s[gouge.vertex] = from.cut_time_s[gouge.vertex];
  to.cut_line[std::size_t(gouge.vertex)] = from.cut_line[std::size_t(gouge.vertex)];
}

}  // namespace

Surface united(const Design& design_w, const std::vector<SurfaceOf>& tools, double band) {
  std::vector<Surface> surfaces;
  for (const SurfaceOf& tool : tools) surfaces.push_back(tool(design_w, band));
  const Surface cuts = least_cuts(surfaces);
  const std::vector<std::uint8_t> buried = buried_cuts(design_w, tools, surfaces, cuts, band);
  Surface all = cuts;
  std::map<int, Gouge> gouges;
  for (const Surface& one : surfaces)
    for (const Gouge& gouge : one.gouges) {
      const auto v = std::size_t(gouge.vertex);
      if (cuts.status[v] != VertexStatus::Cut || buried[v]) add_gouge(all, gouges, one, gouge);
    }
  for (const auto& [vertex, gouge] : gouges) all.gouges.push_back(gouge);
  return all;
}

}  // namespace abbe::cutting
