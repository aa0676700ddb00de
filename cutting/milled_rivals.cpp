#include <algorithm>
#include <atomic>
#include <limits>
#include <span>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/gouge.h"
#include "cutting/rival_shape.h"
#include "cutting/rivals.h"
#include "cutting/surface_input.h"
#include "cutting/sweep_tree.h"
#include "kinematics/require.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int rival_block = 64;        // vertices that share their hints
constexpr double parting_rise = 1e-6;  // mm, that parts two passes
constexpr double no_rise = 1e-7;       // mm, more than the error of first_entry
constexpr int patience = 8;            // parts on which a walk may stay level

/// A place in the order of the motion: one part of one move.
struct Place {
  int move, part;
  friend auto operator<=>(const Place&, const Place&) = default;
};

Place place(const Removal& removal) { return {removal.move, removal.part}; }

struct Mill {
  const Cutter& cutter;
  const CutterMotion& motion;

  int moves() const { return std::max(1, int(motion.tip.rows()) - 1); }

  std::optional<Place> beside(const Place& at, int direction) const {
    const Place same{at.move, at.part + direction};
    if (same.part >= 0 && same.part < parts_of(motion, at.move)) return same;
    const int move = at.move + direction;
    if (move < 0 || move >= moves()) return std::nullopt;
    return Place{move, direction > 0 ? 0 : parts_of(motion, move) - 1};
  }

  std::optional<Entry> entry(const Place& at, const Ray& ray, double limit) const {
    return first_entry(cutter, part_of(motion, at.move, at.part), ray, limit);
  }
};

/// Its nearest removal, and the crests on either side that part it from other passes.
struct Pass {
  Removal nearest;
  Place from{0, 0};
  Place to{std::numeric_limits<int>::max(), 0};
};

/// One pass for every least distance in a run of parts without a gap.
std::vector<Pass> passes_of_run(std::span<const Removal> run) {
  std::vector<Pass> passes(1, Pass{.nearest = run.front()});
  const Removal* crest = &run.front();
  bool falls = true;
  for (const Removal& next : run) {
    Pass& last = passes.back();
    if (next.s < last.nearest.s) last.nearest = next;
    if (falls ? next.s > last.nearest.s + parting_rise : next.s > crest->s) {
      crest = &next;
      falls = false;
    } else if (!falls && next.s < crest->s - parting_rise) {
      last.to = place(*crest);
      passes.push_back({.nearest = next, .from = last.to});
      falls = true;
    }
  }
  return passes;
}

std::vector<Pass> passes_of(const Mill& mill, std::span<const Removal> removals) {
  std::vector<Pass> passes;
  for (std::size_t begin = 0, end = 0; begin < removals.size(); begin = end) {
    for (end = begin + 1; end < removals.size(); ++end)
      if (mill.beside(place(removals[end - 1]), 1) != place(removals[end])) break;
    const std::vector<Pass> of_run = passes_of_run(removals.subspan(begin, end - begin));
    passes.insert(passes.end(), of_run.begin(), of_run.end());
  }
  return passes;
}

/// First distance of a pass along a ray near that on which it was found: downhill from there.
std::optional<double> distance_of(const Mill& mill, const Pass& pass, const Ray& ray) {
  const Place start = place(pass.nearest);
  double best = std::numeric_limits<double>::infinity();
  if (const std::optional<Entry> entry = mill.entry(start, ray, ray.band)) best = entry->s;
  for (const int direction : {-1, 1}) {
    std::optional<Place> at = mill.beside(start, direction);
    for (int level = 0; at && *at >= pass.from && *at <= pass.to && level < patience;
         at = mill.beside(*at, direction)) {
      const std::optional<Entry> entry = mill.entry(*at, ray, std::min(best + no_rise, ray.band));
      if (!entry && best <= ray.band) break;  // it rises
      level = entry && entry->s < best - no_rise ? 0 : level + 1;
      if (entry) best = std::min(best, entry->s);
    }
  }
  if (best <= -ray.band || best > ray.band) return std::nullopt;
  return best;
}

/// Way of the cutter's material at a contact; nothing where it turns about it, or stands.
std::optional<Vector3d> feed_at(const Move& move, double t, const Vector3d& contact) {
  const Vector3d turn = move.angle * move.axis.cross(move.side);
  const Vector3d arm = contact - (move.tip + t * move.step);
  const Vector3d feed = move.step + turn.cross(arm);
  const double parts = move.step.norm() + turn.norm() * arm.norm();
  if (feed.norm() < std::max(1e-9, 1e-3 * parts)) return std::nullopt;
  return feed;
}

Rival rival_of(const Mill& mill, const Pass& pass, const Ray& ray, double stencil) {
  const Removal& nearest = pass.nearest;
  Rival rival{.distance = nearest.s, .move = nearest.move, .t = nearest.t};
  rival.contact = ray.point + nearest.s * ray.normal;
  const Move move = move_after(mill.motion, nearest.move);
  const PassProbe probe{ray.normal, nearest.s, feed_at(move, nearest.t, rival.contact), stencil};
  const PassShape shape = pass_shape(probe, [&](const Vector3d& displacement) {
    return distance_of(mill, pass, {ray.point + displacement, ray.normal, ray.band});
  });
  rival.gradient = shape.gradient;
  rival.across = shape.across;
  rival.curvature = shape.curvature;
  return rival;
}

std::vector<Rival> rivals_of(const Mill& mill, const Ray& ray, const std::vector<Removal>& removals,
                             const RivalOptions& options) {
  std::vector<Pass> passes = passes_of(mill, removals);
  std::stable_sort(passes.begin(), passes.end(),
                   [](const Pass& a, const Pass& b) { return a.nearest.s < b.nearest.s; });
  if (passes.size() > std::size_t(options.most)) passes.resize(std::size_t(options.most));
  std::vector<Rival> rivals;
  for (const Pass& pass : passes) rivals.push_back(rival_of(mill, pass, ray, options.stencil));
  return rivals;
}

}  // namespace

std::vector<Rival> milled_rivals(const Design& design_w, const Cutter& cutter,
                                 const CutterMotion& motion, const RivalOptions& options) {
  check_milled(design_w, cutter, motion, options.band);
  require(!is_hollow(cutter), "milled rivals: expected a convex cutter, seen a hollow one");
  check_rivals(options);
  const std::vector<Index> order = judged_in_order(design_w);
  const SweepTree tree(cutter, motion);
  const Mill mill{cutter, motion};
  const ThinRays thin_rays(design_w, options.band);
  std::vector<std::vector<Rival>> of_vertex(std::size_t(design_w.vertices.rows()));
  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), rival_block);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    SweepTree::Hint hint;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Index i = order[k];
      ShiftedRay along{{design_w.vertices.row(i), design_w.normals.row(i), options.band}, 0.0};
      std::vector<Removal> removals = tree.removals_within(along.ray, options.reach, hint);
      if (removals.empty()) {
        const std::optional<ShiftedRay> thin = thin_rays.of(i);
        if (!thin) continue;
        along = *thin;
        removals = tree.removals_within(along.ray, options.reach, hint);
      }
      std::vector<Rival>& rivals = of_vertex[std::size_t(i)];
      rivals = rivals_of(mill, along.ray, removals, options);
      for (Rival& rival : rivals) rival.distance += along.shift;
    }
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return in_order_of_vertices(of_vertex);
}

}  // namespace abbe::cutting
