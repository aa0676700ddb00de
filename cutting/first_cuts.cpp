#include "cutting/first_cuts.h"

#include <algorithm>
#include <limits>
#include <tuple>

namespace abbe::cutting {

using Eigen::Index;

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

void take_earlier(std::optional<FirstCut>& first, const FirstCut& cut) {
  if (!first || std::tuple(cut.s, cut.time_s) < std::tuple(first->s, first->time_s)) first = cut;
}

}  // namespace

FirstCut cut_of(const Removal& removal, const CutterMotion& motion) {
  const Index next = std::min<Index>(removal.move + 1, motion.tip.rows() - 1);
  const double start = motion.time_s[removal.move];
  return {removal.s, start + removal.t * (motion.time_s[next] - start), motion.line[next]};
}

std::vector<SweepTree> sweep_trees(const Cutter& cutter, const CutterMotion& motion) {
  std::vector<SweepTree> trees;
  for (const Cutter& part : convex_parts(cutter)) trees.emplace_back(part, motion);
  return trees;
}

std::optional<FirstCut> first_cut(std::span<const SweepTree> trees, const CutterMotion& motion,
                                  const Ray& ray) {
  std::optional<FirstCut> first;
  for (const SweepTree& tree : trees) {
    SweepTree::Hint hint;
    if (const std::optional<Removal> removal = tree.first_removal(ray, hint))
      take_earlier(first, cut_of(*removal, motion));
  }
  return first;
}

std::vector<std::optional<FirstCut>> first_cuts(std::span<const SweepTree> trees,
                                                const CutterMotion& motion, const Design& design,
                                                std::span<const Index> vertices, double band) {
  std::vector<Ray> rays;
  rays.reserve(vertices.size());
  for (const Index v : vertices)
    rays.push_back({design.vertices.row(v), design.normals.row(v), band});
  std::vector<std::optional<FirstCut>> cuts(rays.size());
  for (const SweepTree& tree : trees) {
    SweepTree::Hint hint;
    std::vector<std::optional<Removal>> removals(rays.size());
    tree.first_removals(rays, removals, hint);
    for (std::size_t i = 0; i < cuts.size(); ++i)
      if (removals[i]) take_earlier(cuts[i], cut_of(*removals[i], motion));
  }
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
