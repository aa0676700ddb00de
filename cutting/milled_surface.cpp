#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/gouge.h"
#include "cutting/surface.h"
#include "cutting/surface_input.h"
#include "cutting/sweep_tree.h"

namespace abbe::cutting {

using Eigen::Index;

namespace {

constexpr int first_cut_block = 512;  // vertices that share their hints

FirstCut cut_of(const Removal& removal, const CutterMotion& motion) {
  const Index next = std::min<Index>(removal.move + 1, motion.tip.rows() - 1);
  const double start = motion.time_s[removal.move];
  return {removal.s, start + removal.t * (motion.time_s[next] - start), motion.line[next]};
}

void record(Surface& surface, Index i, const FirstCut& cut) {
  surface.residual[i] = cut.s;
  surface.cut_time_s[i] = cut.time_s;
  surface.cut_line[i] = cut.line;
  surface.status[i] = VertexStatus::Cut;
}

Surface searched(const SweepTree& tree, const CutterMotion& motion, const Design& design_w,
                 const SurfaceOptions& options) {
  const Index n = design_w.vertices.rows();
  const double none = std::numeric_limits<double>::quiet_NaN();
  Surface surface{.residual = Eigen::VectorXd::Constant(n, none),
                  .cut_time_s = Eigen::VectorXd::Constant(n, none),
                  .cut_line = std::vector<int>(n, 0),
                  .status = std::vector<VertexStatus>(n, VertexStatus::Outside)};
  const std::vector<Index> order = judged_in_order(design_w);
  for (const Index i : order) surface.status[i] = VertexStatus::Uncut;

  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), first_cut_block);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    SweepTree::Hint hint;
    std::vector<Ray> rays;
    rays.reserve(range.size());
    for (std::size_t k = range.begin(); k < range.end(); ++k)
      rays.push_back(
          {design_w.vertices.row(order[k]), design_w.normals.row(order[k]), options.band});
    std::vector<std::optional<Removal>> found(rays.size());
    tree.first_removals(rays, found, hint);
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Index i = order[k];
      const std::optional<Removal>& removal = found[k - range.begin()];
      if (!removal) continue;
      if (removal->s > -options.band)
        record(surface, i, cut_of(*removal, motion));
      else
        surface.status[i] = VertexStatus::Gouged;
    }
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return with_gouges(std::move(surface), design_w, options,
                     [&](const Ray& ray) -> std::optional<FirstCut> {
                       SweepTree::Hint hint;
                       const std::optional<Removal> removal = tree.first_removal(ray, hint);
                       return removal ? std::optional(cut_of(*removal, motion)) : std::nullopt;
                     });
}

}  // namespace

std::function<Surface(const Design& design_w)> milled_search(const Cutter& cutter,
                                                             const CutterMotion& motion,
                                                             const SurfaceOptions& options) {
  check_milled(Design{}, cutter, motion, options.band);
  const auto tree = std::make_shared<const SweepTree>(cutter, motion);
  return [tree, &motion, options](const Design& design_w) {
    check_design(design_w);
    return searched(*tree, motion, design_w, options);
  };
}

Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options) {
  check_milled(design_w, cutter, motion, options.band);
  return searched(SweepTree(cutter, motion), motion, design_w, options);
}

}  // namespace abbe::cutting
