#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/surface/nose_cut.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/surface_search.h"
#include "cutting/surface/sweep_tree.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

/// A query for the surface of one pass around a vertex.
struct PassQuery {
  Eigen::Vector3d normal;               ///< unit, of the vertex
  double distance = 0.0;                ///< mm, of the pass along the normal
  std::optional<Eigen::Vector3d> feed;  ///< velocity of the tool at the contact, of any length; the
                                        ///< pass stands if it is empty or along the normal
  double step = 0.01;                   ///< mm, step of the differences
};

/// Returns the distance (mm) of the pass along the normal from the vertex displaced by a vector in
/// its tangent plane; nothing if the ray misses the pass.
using PassDistance = std::function<std::optional<double>(const Eigen::Vector3d& displacement)>;

/// The shape of a pass to second order, as described at `CompetingPass`.
struct PassShape {
  Eigen::Vector3d gradient;
  Eigen::Vector3d across;
  double curvature = 0.0;
};

/// Returns the shape from central differences: four rays, six if the pass stands. Where one of two
/// opposite rays misses, or the pass has an edge between them (the slope changes by over 0.5), the
/// slope is that of the flatter side and the curvature 0; where both miss, the slope is 0 too.
PassShape pass_shape(const PassQuery& probe, const PassDistance& distance);

/// Returns all passes in one list, each labelled with its vertex.
std::vector<CompetingPass> in_vertex_order(
    const std::vector<std::vector<CompetingPass>>& of_vertex);

namespace {

constexpr double edge_turn = 0.5;  // change of slope over one step that only an edge causes: a ball
                                   // of R 5 changes it by 0.002 over 0.01 mm
constexpr double standing = 1e-3;  // smallest fraction of the feed that must lie along the surface

struct Difference {
  double slope = 0.0;
  double bend = 0.0;  // 1/mm
};

// Returns slope and second derivative of the distance along one direction of the tangent plane.
Difference difference(const PassQuery& probe, const PassDistance& distance,
                      const Vector3d& direction) {
  const std::optional<double> before = distance(-probe.step * direction);
  const std::optional<double> after = distance(probe.step * direction);
  const double fall = before ? (probe.distance - *before) / probe.step : 0.0;
  const double rise = after ? (*after - probe.distance) / probe.step : 0.0;
  if (!before || !after) return {before ? fall : rise, 0.0};
  if (std::abs(rise - fall) > edge_turn)
    return {std::abs(rise) < std::abs(fall) ? rise : fall, 0.0};
  return {0.5 * (rise + fall), (rise - fall) / probe.step};
}

/// Returns the unit vector of the tangent plane along the feed, if the feed has such a component.
std::optional<Vector3d> along_surface(const PassQuery& probe) {
  if (!probe.feed) return std::nullopt;
  const Vector3d along = *probe.feed - probe.feed->dot(probe.normal) * probe.normal;
  if (!(along.norm() > standing * probe.feed->norm())) return std::nullopt;
  return along.normalized();
}

}  // namespace

PassShape pass_shape(const PassQuery& probe, const PassDistance& distance) {
  const std::optional<Vector3d> along = along_surface(probe);
  const Vector3d e = along ? *along : probe.normal.unitOrthogonal();
  const Vector3d f = probe.normal.cross(e);
  const Difference on_e = difference(probe, distance, e);
  const Difference on_f = difference(probe, distance, f);
  PassShape shape{probe.normal - on_e.slope * e - on_f.slope * f, f, on_f.bend};
  // A straight feed generates a surface that is straight along the feed, so it curves across it
  // only.
  if (along) return shape;
  // The tool stands, so no direction is preferred: the larger principal curvature and its direction
  // follow from the second derivatives in three directions.
  const Difference between = difference(probe, distance, (e + f) / std::sqrt(2.0));
  const double mixed = between.bend - 0.5 * (on_e.bend + on_f.bend);
  const double half = 0.5 * (on_e.bend - on_f.bend);
  const double mean = 0.5 * (on_e.bend + on_f.bend);
  const double angle = 0.5 * std::atan2(mixed, half);  // rad, direction of the larger eigenvalue,
                                                       // from e
  const double spread = std::hypot(half, mixed);
  const bool upward = mean >= 0.0;
  shape.curvature = upward ? mean + spread : mean - spread;
  shape.across = upward ? Vector3d(std::cos(angle) * e + std::sin(angle) * f)
                        : Vector3d(std::cos(angle) * f - std::sin(angle) * e);
  return shape;
}

std::vector<CompetingPass> in_vertex_order(
    const std::vector<std::vector<CompetingPass>>& of_vertex) {
  std::size_t count = 0;
  for (const std::vector<CompetingPass>& competing_passes : of_vertex)
    count += competing_passes.size();
  std::vector<CompetingPass> all;
  all.reserve(count);
  for (std::size_t i = 0; i < of_vertex.size(); ++i) {
    for (CompetingPass competing_pass : of_vertex[i]) {
      competing_pass.vertex = int(i);
      all.push_back(competing_pass);
    }
  }
  return all;
}

namespace {

constexpr int rival_block = 64;        // vertices that share their hints
constexpr double parting_rise = 1e-6;  // mm, height of a crest that separates two passes
constexpr double no_rise = 1e-7;       // mm, more than the error of first_entry
constexpr int patience = 8;            // parts over which a walk may stay level before it ends

/// A position in the order of the motion: one part of one move.
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

/// A pass: its nearest removal, and the crests on either side that separate it from other passes.
struct Pass {
  Removal nearest;
  Place from{0, 0};
  Place to{std::numeric_limits<int>::max(), 0};
};

/// Returns the passes of a run of consecutive parts: one for every local minimum of the distance.
/// Rises below `parting_rise` are not crests, so rounding does not split a pass.
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

// Splits the removals into runs of consecutive parts and collects the passes of all runs.
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

/// Returns the first distance of a pass along a ray near the one on which it was found, by walking
/// downhill in both directions of the motion. The walk continues over a few level parts, because on
/// a plane many moves leave the same distance to rounding.
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

/// Returns the velocity of the cutter's material at a contact; nothing where the tool turns about
/// the contact or stands.
std::optional<Vector3d> feed_at(const Move& move, double t, const Vector3d& contact) {
  const Vector3d turn = move.angle * move.axis.cross(move.side);
  const Vector3d arm = contact - (move.tip + t * move.step);
  const Vector3d feed = move.step + turn.cross(arm);
  const double parts = move.step.norm() + turn.norm() * arm.norm();
  // Translation and rotation may cancel: below a thousandth of their sizes the direction of the
  // difference is not reliable, below 1e-9 mm the tool stands.
  if (feed.norm() < std::max(1e-9, 1e-3 * parts)) return std::nullopt;
  return feed;
}

CompetingPass competing_pass_at(const Mill& mill, const Pass& pass, const Ray& ray,
                                double stencil) {
  const Removal& nearest = pass.nearest;
  CompetingPass competing_pass{.distance = nearest.s, .move = nearest.move, .t = nearest.t};
  competing_pass.contact = ray.point + nearest.s * ray.normal;
  const Move move = move_after(mill.motion, nearest.move);
  const PassQuery probe{ray.normal, nearest.s, feed_at(move, nearest.t, competing_pass.contact),
                        stencil};
  const PassShape shape = pass_shape(probe, [&](const Vector3d& displacement) {
    return distance_of(mill, pass, {ray.point + displacement, ray.normal, ray.band});
  });
  competing_pass.gradient = shape.gradient;
  competing_pass.across = shape.across;
  competing_pass.curvature = shape.curvature;
  return competing_pass;
}

std::vector<CompetingPass> competing_passes_along(const Mill& mill, const Ray& ray,
                                                  const std::vector<Removal>& removals,
                                                  const CompetingPassOptions& options) {
  std::vector<Pass> passes = passes_of(mill, removals);
  std::stable_sort(passes.begin(), passes.end(),
                   [](const Pass& a, const Pass& b) { return a.nearest.s < b.nearest.s; });
  if (passes.size() > std::size_t(options.most)) passes.resize(std::size_t(options.most));
  std::vector<CompetingPass> competing_passes;
  for (const Pass& pass : passes)
    competing_passes.push_back(competing_pass_at(mill, pass, ray, options.stencil));
  return competing_passes;
}

}  // namespace

std::vector<CompetingPass> milled_competing_passes(const Design& design_w, const Cutter& cutter,
                                                   const CutterMotion& motion,
                                                   const CompetingPassOptions& options) {
  check_milled(design_w, cutter, motion, options.band);
  require(!is_hollow(cutter), "milled rivals: expected a convex cutter, seen a hollow one");
  check_pass_options(options);
  const std::vector<Index> order = judged_along_curve(design_w);
  const SweepTree tree(cutter, motion);
  const Mill mill{cutter, motion};
  const ThinPartRays thin_rays(design_w, options.band);
  std::vector<std::vector<CompetingPass>> of_vertex(std::size_t(design_w.vertices.rows()));
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
      std::vector<CompetingPass>& competing_passes = of_vertex[std::size_t(i)];
      competing_passes = competing_passes_along(mill, along.ray, removals, options);
      for (CompetingPass& competing_pass : competing_passes) competing_pass.distance += along.shift;
    }
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return in_vertex_order(of_vertex);
}

namespace {

constexpr double half_turn = std::numbers::pi;

struct Lathe {
  const NoseCutSearch& swept;
  const NoseMotion& motion;
  const CompetingPassOptions& options;
};

/// Returns the nearest cut of every revolution, sorted by distance.
std::vector<NoseCut> nearest_per_revolution(const NoseCutSearch& swept,
                                            const std::vector<NoseCut>& cuts) {
  std::vector<NoseCut> nearest;
  double begins = 0.0;
  for (const NoseCut& cut : cuts) {
    const double turned = swept.turned(cut);
    if (nearest.empty() || turned - begins > half_turn) {
      nearest.push_back(cut);
      begins = turned;
    } else if (cut.s < nearest.back().s) {
      nearest.back() = cut;
    }
  }
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const NoseCut& a, const NoseCut& b) { return a.s < b.s; });
  return nearest;
}

/// Returns the normal of the rake plane in the workpiece, which is the direction of the work past
/// the edge.
Vector3d rake_normal(const NoseMotion& motion, const NoseCut& cut) {
  const auto i = std::size_t(cut.interval);
  const Vector3d from = motion.T_slow[i].linear().col(1);
  const Vector3d to = motion.T_slow[i + 1].linear().col(1);
  const double angle =
      motion.spindle[Index(i)] + cut.u * (motion.spindle[Index(i) + 1] - motion.spindle[Index(i)]);
  return Eigen::AngleAxisd(angle, motion.spindle_direction) * (from + cut.u * (to - from));
}

/// Returns the angle within which the same revolution cuts a ray of the stencil, rad.
double window(const Lathe& lathe, const Vector3d& contact) {
  const Vector3d arm = contact - lathe.motion.spindle_point;
  const double radius = arm.cross(lathe.motion.spindle_direction).norm();
  // Four times the angle of a step at this radius, plus 0.05 rad for the slow motion. 90 deg at
  // most, so that the cuts of other revolutions are excluded.
  return std::min(0.5 * half_turn, 0.05 + 4.0 * lathe.options.stencil / std::max(radius, 1e-9));
}

CompetingPass competing_pass_at(const Lathe& lathe, const NoseCut& cut, const Ray& ray) {
  CompetingPass competing_pass{.distance = cut.s, .move = cut.interval, .t = cut.u};
  competing_pass.contact = ray.point + cut.s * ray.normal;
  const PassQuery probe{ray.normal, cut.s, rake_normal(lathe.motion, cut), lathe.options.stencil};
  const double turn = window(lathe, competing_pass.contact);
  const auto distance = [&](const Vector3d& displacement) -> std::optional<double> {
    const Ray beside{ray.point + displacement, ray.normal, ray.band};
    const std::optional<NoseCut> found = lathe.swept.near(beside, cut, turn);
    if (!found || found->s <= -ray.band) return std::nullopt;
    return found->s;
  };
  const PassShape shape = pass_shape(probe, distance);
  competing_pass.gradient = shape.gradient;
  competing_pass.across = shape.across;
  competing_pass.curvature = shape.curvature;
  return competing_pass;
}

std::vector<CompetingPass> competing_passes_along(const Lathe& lathe, const Ray& ray) {
  const std::optional<NoseCut> first = lathe.swept.first(ray);
  if (!first || first->s <= -ray.band) return {};
  const double limit = std::min(first->s + lathe.options.reach, ray.band);
  std::vector<NoseCut> cuts = nearest_per_revolution(lathe.swept, lathe.swept.within(ray, limit));
  if (cuts.size() > std::size_t(lathe.options.most)) cuts.resize(std::size_t(lathe.options.most));
  std::vector<CompetingPass> competing_passes;
  for (const NoseCut& cut : cuts) competing_passes.push_back(competing_pass_at(lathe, cut, ray));
  return competing_passes;
}

}  // namespace

std::vector<CompetingPass> turned_competing_passes(const Design& design_w, const Nose& nose,
                                                   const NoseMotion& motion,
                                                   const CompetingPassOptions& options) {
  check_turned(design_w, options.band);
  check_pass_options(options);
  const NoseCutSearch swept(nose, motion);
  const Lathe lathe{swept, motion, options};
  const Index n = design_w.vertices.rows();
  auto of_vertex = std::vector<std::vector<CompetingPass>>(std::size_t(n));
  const ThinPartRays thin_rays(design_w, options.band);
  const auto rivals_at = [&](Index v) {
    std::vector<CompetingPass> competing_passes = competing_passes_along(
        lathe, {design_w.vertices.row(v), design_w.normals.row(v), options.band});
    if (!competing_passes.empty()) return competing_passes;
    const std::optional<ShiftedRay> thin = thin_rays.of(v);
    if (!thin) return competing_passes;
    competing_passes = competing_passes_along(lathe, thin->ray);
    for (CompetingPass& competing_pass : competing_passes) competing_pass.distance += thin->shift;
    return competing_passes;
  };
  std::atomic<Index> done = 0;
  tbb::parallel_for(tbb::blocked_range<Index>(0, n, 64), [&](const auto& range) {
    for (Index v = range.begin(); v != range.end(); ++v)
      if (is_judged(design_w, v)) of_vertex[std::size_t(v)] = rivals_at(v);
    done += Index(range.size());
    if (options.progress) options.progress(double(done) / double(n));
  });
  return in_vertex_order(of_vertex);
}

}  // namespace abbe::cutting
