#include "cutting/first_cuts.h"

#include <algorithm>
#include <limits>

namespace abbe::cutting {

using Eigen::Index;

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

}  // namespace

FirstCut cut_of(const Removal& removal, const CutterMotion& motion) {
  const Index next = std::min<Index>(removal.move + 1, motion.tip.rows() - 1);
  const double start = motion.time_s[removal.move];
  return {removal.s, start + removal.t * (motion.time_s[next] - start), motion.line[next]};
}

std::optional<FirstCut> first_cut(const SweepTree& tree, const CutterMotion& motion,
                                  const Ray& ray) {
  SweepTree::Hint hint;
  const std::optional<Removal> removal = tree.first_removal(ray, hint);
  return removal ? std::optional(cut_of(*removal, motion)) : std::nullopt;
}

std::vector<std::optional<FirstCut>> first_cuts(const SweepTree& tree, const CutterMotion& motion,
                                                const Design& design,
                                                std::span<const Index> vertices, double band) {
  SweepTree::Hint hint;
  std::vector<Ray> rays;
  rays.reserve(vertices.size());
  for (const Index v : vertices)
    rays.push_back({design.vertices.row(v), design.normals.row(v), band});
  std::vector<std::optional<Removal>> removals(rays.size());
  tree.first_removals(rays, removals, hint);
  std::vector<std::optional<FirstCut>> cuts(rays.size());
  for (std::size_t i = 0; i < cuts.size(); ++i)
    if (removals[i]) cuts[i] = cut_of(*removals[i], motion);
  return cuts;
}

Surface nothing_cut(const Design& design, std::span<const Index> judged) {
  const Index n = design.vertices.rows();
  Surface surface{.residual = Eigen::VectorXd::Constant(n, none),
                  .cut_time_s = Eigen::VectorXd::Constant(n, none),
                  .cut_line = std::vector<int>(std::size_t(n), 0),
                  .status = std::vector<VertexStatus>(std::size_t(n), VertexStatus::Outside)};
  for (const Index v : judged) surface.status[std::size_t(v)] = VertexStatus::Uncut;
  return surface;
}

void keep_first(Surface& surface, Index vertex, const FirstCut& cut, double band) {
  VertexStatus& status = surface.status[std::size_t(vertex)];
  if (status == VertexStatus::Cut && surface.residual[vertex] <= cut.s) return;
  const bool gouged = !(cut.s > -band);
  status = gouged ? VertexStatus::Gouged : VertexStatus::Cut;
  surface.residual[vertex] = gouged ? none : cut.s;
  surface.cut_time_s[vertex] = gouged ? none : cut.time_s;
  surface.cut_line[std::size_t(vertex)] = gouged ? 0 : cut.line;
}

}  // namespace abbe::cutting
