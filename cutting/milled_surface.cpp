#include <algorithm>
#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/first_cuts.h"
#include "cutting/gouge.h"
#include "cutting/surface.h"
#include "cutting/surface_input.h"

namespace abbe::cutting {

using Eigen::Index;

namespace {

Surface searched(std::span<const SweepTree> trees, const CutterMotion& motion,
                 const Design& design_w, const SurfaceOptions& options) {
  const std::vector<Index> order = judged_in_order(design_w);
  Surface surface = nothing_cut(design_w, order);
  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), first_cut_block);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    const std::span<const Index> vertices(&order[range.begin()], range.size());
    const auto cuts = first_cuts(trees, motion, design_w, vertices, options.band);
    for (std::size_t k = 0; k < vertices.size(); ++k)
      if (cuts[k]) keep_first(surface, vertices[k], *cuts[k], options.band);
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return with_gouges(std::move(surface), design_w, options,
                     [&](const Ray& ray) { return first_cut(trees, motion, ray); });
}

}  // namespace

std::function<Surface(const Design& design_w)> milled_search(const Cutter& cutter,
                                                             const CutterMotion& motion,
                                                             const SurfaceOptions& options) {
  check_milled(Design{}, cutter, motion, options.band);
  const auto trees = std::make_shared<const std::vector<SweepTree>>(sweep_trees(cutter, motion));
  return [trees, &motion, options](const Design& design_w) {
    check_design(design_w);
    return searched(*trees, motion, design_w, options);
  };
}

Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options) {
  check_milled(design_w, cutter, motion, options.band);
  return searched(sweep_trees(cutter, motion), motion, design_w, options);
}

}  // namespace abbe::cutting
