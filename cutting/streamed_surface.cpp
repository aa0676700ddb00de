#include "cutting/streamed_surface.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/first_cuts.h"
#include "cutting/surface_input.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;
using Box = Eigen::AlignedBox3d;

namespace {

struct Streamed {
  const Design& design;
  const Cutter& cutter;
  const SurfaceOptions& options;
};

bool ends_where(const CutterMotion& first, const CutterMotion& second) {
  const Index last = first.tip.rows() - 1;
  return first.tip.row(last) == second.tip.row(0) && first.axis.row(last) == second.axis.row(0) &&
         first.time_s[last] == second.time_s[0];
}

/// The last sample of a motion alone.
CutterMotion end_of(const CutterMotion& motion) {
  const Index last = motion.tip.rows() - 1;
  return {motion.tip.row(last),
          motion.axis.row(last),
          motion.time_s.tail(1),
          {motion.line[std::size_t(last)]}};
}

void check_block(const Streamed& with, const CutterMotion& motion,
                 const std::optional<CutterMotion>& before, int number) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument(fmt::format("{}, in block {} of the motion", what, number));
  };
  try {
    check_milled(Design{}, with.cutter, motion, with.options.band);
  } catch (const std::invalid_argument& fault) {
    refuse(fault.what());
  }
  if (motion.tip.rows() == 0) refuse("milled surface: no sample");
  if (before && !ends_where(*before, motion))
    refuse("milled surface: the first sample is not the last of the block before");
}

/// Every block that moves; a lone sample, which cuts as well, only where the motion has no other.
template <class Use>
void each_block(const Streamed& with, const MotionBlocks& next, const Use& use) {
  std::optional<CutterMotion> before;
  bool moves = false;
  int number = 1;
  while (const std::optional<MotionBlock> block = next()) {
    check_block(with, block->motion, before, number++);
    before = end_of(block->motion);
    if (block->motion.tip.rows() == 1) continue;
    moves = true;
    use(*block);
  }
  if (before && !moves) use(MotionBlock{std::move(*before), 1.0});
}

/// A box that the cutter does not leave in a block. Between two samples a point of it is as far
/// from the line between its two places as an arc is from its chord.
Box reach_of(const Cutter& cutter, const CutterMotion& motion) {
  constexpr double against_rounding = 1e-6;  // mm
  Box reach;
  double most_chord2 = 0.0;
  for (Index i = 0; i < motion.tip.rows(); ++i) {
    const Vector3d tip = motion.tip.row(i), axis = motion.axis.row(i);
    const Vector3d around = cutter.radius * (1.0 - axis.array().square()).max(0.0).sqrt().matrix();
    for (const Vector3d& end : {tip, Vector3d(tip + cutter.flank_length * axis)}) {
      reach.extend(end - around);
      reach.extend(end + around);
    }
    if (i > 0)
      most_chord2 =
          std::max(most_chord2, (motion.axis.row(i) - motion.axis.row(i - 1)).squaredNorm());
  }
  const double far = std::hypot(cutter.radius, cutter.flank_length);
  const double arc = far * (1.0 - std::sqrt(std::max(0.0, 1.0 - 0.25 * most_chord2)));
  reach.min().array() -= arc + against_rounding;
  reach.max().array() += arc + against_rounding;
  return reach;
}

bool may_meet(const Box& reach, const Ray& ray) {
  return reach.squaredExteriorDistance(ray.point) <= ray.band * ray.band;
}

/// Vertices beside each other, and all of their rays.
struct Neighbours {
  std::span<const Index> vertices;
  Box rays;
};

std::vector<Neighbours> neighbours_in(const std::vector<Index>& order, const Streamed& with) {
  std::vector<Neighbours> all;
  for (std::size_t from = 0; from < order.size(); from += first_cut_block) {
    const std::size_t count = std::min(first_cut_block, order.size() - from);
    Neighbours one{{&order[from], count}, {}};
    for (const Index v : one.vertices) one.rays.extend(with.design.vertices.row(v).transpose());
    one.rays.min().array() -= with.options.band;
    one.rays.max().array() += with.options.band;
    all.push_back(one);
  }
  return all;
}

void keep_firsts(const Streamed& with, const CutterMotion& motion,
                 const std::vector<Neighbours>& neighbours, Surface& surface) {
  const std::vector<SweepTree> trees = sweep_trees(with.cutter, motion);
  const Box reach = reach_of(with.cutter, motion);
  const double band = with.options.band;
  tbb::parallel_for(std::size_t(0), neighbours.size(), [&](std::size_t i) {
    if (!neighbours[i].rays.intersects(reach)) return;
    std::vector<Index> open;
    for (const Index v : neighbours[i].vertices)
      if (surface.status[std::size_t(v)] != VertexStatus::Gouged) open.push_back(v);
    const auto cuts = first_cuts(trees, motion, with.design, open, band);
    for (std::size_t k = 0; k < open.size(); ++k)
      if (cuts[k]) keep_first(surface, open[k], *cuts[k], band);
  });
}

/// The first cuts along so many rays: of equal ones that of the earlier block.
std::vector<std::optional<FirstCut>> cuts_along(const Streamed& with, const MotionBlocks& next,
                                                std::size_t count,
                                                const std::function<Ray(std::size_t)>& ray_of) {
  std::vector<std::optional<FirstCut>> cuts(count);
  each_block(with, next, [&](const MotionBlock& block) {
    const std::vector<SweepTree> trees = sweep_trees(with.cutter, block.motion);
    const Box reach = reach_of(with.cutter, block.motion);
    const auto all = tbb::blocked_range<std::size_t>(0, count, 64);
    tbb::parallel_for(all, [&](const auto& range) {
      for (std::size_t k = range.begin(); k < range.end(); ++k) {
        const Ray ray = ray_of(k);
        if (cuts[k] && cuts[k]->s <= -ray.band) continue;
        if (!may_meet(reach, ray)) continue;
        const std::optional<FirstCut> cut = first_cut(trees, block.motion, ray);
        if (cut && (!cuts[k] || cut->s < cuts[k]->s)) cuts[k] = cut;
      }
    });
  });
  return cuts;
}

}  // namespace

Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options) {
  const Streamed with{design_w, cutter, options};
  check_milled(design_w, cutter, CutterMotion{}, options.band);
  const std::vector<Index> order = judged_in_order(design_w);
  const std::vector<Neighbours> neighbours = neighbours_in(order, with);
  Surface surface = nothing_cut(design_w, order);
  each_block(with, begin(), [&](const MotionBlock& block) {
    keep_firsts(with, block.motion, neighbours, surface);
    if (options.progress) options.progress(block.finished);
  });
  const FirstCutsAlong first_cuts = [&](std::size_t count,
                                        const std::function<Ray(std::size_t)>& ray) {
    return cuts_along(with, begin(), count, ray);
  };
  return with_gouges(std::move(surface), design_w, options, first_cuts);
}

}  // namespace abbe::cutting
