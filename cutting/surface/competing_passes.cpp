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

namespace {

/// A query for the shape of one pass around a vertex.
struct PassQuery {
  Eigen::Vector3d normal;               ///< unit, of the vertex
  double distance = 0.0;                ///< mm, of the pass along the normal
  std::optional<Eigen::Vector3d> feed;  ///< velocity of the tool at the contact, of any length;
                                        ///< empty or along the normal if the tool stands
  double step = 0.01;                   ///< mm, step of the differences
};

/// Function that returns the distance (mm) of the pass along the normal, from the vertex displaced
/// by a vector in its tangent plane; nothing if the ray misses the pass.
using PassDistance = std::function<std::optional<double>(const Eigen::Vector3d& displacement)>;

/// The shape of a pass to second order, as described at `CompetingPass`.
struct PassShape {
  Eigen::Vector3d gradient;
  Eigen::Vector3d across;
  double curvature = 0.0;
};

// A change of slope over one step that only an edge causes: a ball of R 5 changes it by 0.002 over
// 0.01 mm.
constexpr double min_edge_slope_change = 0.5;
constexpr double min_tangential_fraction = 1e-3;  // of the feed; with less the tool stands

struct DirectionalDerivatives {
  double slope = 0.0;
  double curvature = 0.0;  // 1/mm
};

/// Returns slope and second derivative of the distance in one direction of the tangent plane.
DirectionalDerivatives directional_derivatives(const PassQuery& query, const PassDistance& distance,
                                               const Vector3d& direction) {
  const std::optional<double> before = distance(-query.step * direction);
  const std::optional<double> after = distance(query.step * direction);
  const double slope_before = before ? (query.distance - *before) / query.step : 0.0;
  const double slope_after = after ? (*after - query.distance) / query.step : 0.0;
  if (!before || !after) return {before ? slope_before : slope_after, 0.0};
  if (std::abs(slope_after - slope_before) > min_edge_slope_change)
    return {std::abs(slope_after) < std::abs(slope_before) ? slope_after : slope_before, 0.0};
  return {0.5 * (slope_after + slope_before), (slope_after - slope_before) / query.step};
}

/// Returns the unit vector of the feed's component in the tangent plane; empty if there is none.
std::optional<Vector3d> surface_feed(const PassQuery& query) {
  if (!query.feed) return std::nullopt;
  const Vector3d tangential = *query.feed - query.feed->dot(query.normal) * query.normal;
  if (!(tangential.norm() > min_tangential_fraction * query.feed->norm())) return std::nullopt;
  return tangential.normalized();
}

/// Returns the shape from central differences: four rays, six if the tool stands. If one of two
/// opposite rays misses, or the pass has an edge between them (the slope changes by over 0.5), the
/// slope is that of the flatter side and the curvature 0; if both miss, the slope is 0 too.
PassShape pass_shape(const PassQuery& query, const PassDistance& distance) {
  const std::optional<Vector3d> feed_direction = surface_feed(query);
  const Vector3d e = feed_direction ? *feed_direction : query.normal.unitOrthogonal();
  const Vector3d f = query.normal.cross(e);
  const DirectionalDerivatives along_e = directional_derivatives(query, distance, e);
  const DirectionalDerivatives along_f = directional_derivatives(query, distance, f);
  PassShape shape{query.normal - along_e.slope * e - along_f.slope * f, f, along_f.curvature};
  // A straight feed generates a surface that is straight along the feed, so the only curvature is
  // across it.
  if (feed_direction) return shape;
  // If the tool stands, no direction is preferred: the larger principal curvature and its direction
  // follow from the second derivatives in three directions.
  const DirectionalDerivatives diagonal =
      directional_derivatives(query, distance, (e + f) / std::sqrt(2.0));
  const double mixed = diagonal.curvature - 0.5 * (along_e.curvature + along_f.curvature);
  const double half_difference = 0.5 * (along_e.curvature - along_f.curvature);
  const double mean = 0.5 * (along_e.curvature + along_f.curvature);
  const double angle = 0.5 * std::atan2(mixed, half_difference);  // rad, direction of the larger
                                                                  // eigenvalue, from e
  const double deviation = std::hypot(half_difference, mixed);
  const bool is_upward = mean >= 0.0;
  shape.curvature = is_upward ? mean + deviation : mean - deviation;
  shape.across = is_upward ? Vector3d(std::cos(angle) * e + std::sin(angle) * f)
                           : Vector3d(std::cos(angle) * f - std::sin(angle) * e);
  return shape;
}

/// Returns all passes in one list, each with the number of its vertex.
std::vector<CompetingPass> in_vertex_order(
    const std::vector<std::vector<CompetingPass>>& passes_by_vertex) {
  std::size_t count = 0;
  for (const std::vector<CompetingPass>& competing_passes : passes_by_vertex)
    count += competing_passes.size();
  std::vector<CompetingPass> result;
  result.reserve(count);
  for (std::size_t i = 0; i < passes_by_vertex.size(); ++i) {
    for (CompetingPass competing_pass : passes_by_vertex[i]) {
      competing_pass.vertex = int(i);
      result.push_back(competing_pass);
    }
  }
  return result;
}

constexpr int vertices_per_block = 64;     // vertices that share their hints
constexpr double min_crest_height = 1e-6;  // mm, height of a crest that separates two passes
constexpr double level_tolerance = 1e-7;   // mm, more than the error of first_entry
constexpr int max_level_parts = 8;         // level parts after which a walk along the pass ends

/// One part of one move; parts are ordered as in the motion.
struct MotionPart {
  int move, part;
  friend auto operator<=>(const MotionPart&, const MotionPart&) = default;
};

MotionPart motion_part(const Removal& removal) { return {removal.move, removal.part}; }

struct MilledSweep {
  const Cutter& cutter;
  const CutterMotion& motion;

  int moves() const { return std::max(1, int(motion.tip.rows()) - 1); }

  std::optional<MotionPart> neighbour(const MotionPart& at, int direction) const {
    const MotionPart neighbour_part{at.move, at.part + direction};
    if (neighbour_part.part >= 0 && neighbour_part.part < move_part_count(motion, at.move))
      return neighbour_part;
    const int move = at.move + direction;
    if (move < 0 || move >= moves()) return std::nullopt;
    return MotionPart{move, direction > 0 ? 0 : move_part_count(motion, move) - 1};
  }

  std::optional<Entry> entry(const MotionPart& at, const Ray& ray, double limit) const {
    return first_entry(cutter, move_part(motion, at.move, at.part), ray, limit);
  }
};

/// A pass: its nearest removal, and the crests on either side that separate it from its neighbours.
struct Pass {
  Removal nearest;
  MotionPart from{0, 0};
  MotionPart to{std::numeric_limits<int>::max(), 0};
};

/// Returns the passes of a run of consecutive parts: one for every local minimum of the distance. A
/// rise below `min_crest_height` is no crest, so that rounding does not split a pass.
std::vector<Pass> split_run(std::span<const Removal> run) {
  std::vector<Pass> passes(1, Pass{.nearest = run.front()});
  const Removal* crest = &run.front();
  bool is_falling = true;
  for (const Removal& removal : run) {
    Pass& pass = passes.back();
    if (removal.s < pass.nearest.s) pass.nearest = removal;
    if (is_falling ? removal.s > pass.nearest.s + min_crest_height : removal.s > crest->s) {
      crest = &removal;
      is_falling = false;
    } else if (!is_falling && removal.s < crest->s - min_crest_height) {
      pass.to = motion_part(*crest);
      passes.push_back({.nearest = removal, .from = pass.to});
      is_falling = true;
    }
  }
  return passes;
}

/// Splits the removals into runs of consecutive parts and returns the passes of all runs.
std::vector<Pass> split_passes(const MilledSweep& sweep, std::span<const Removal> removals) {
  std::vector<Pass> passes;
  for (std::size_t begin = 0, end = 0; begin < removals.size(); begin = end) {
    for (end = begin + 1; end < removals.size(); ++end)
      if (sweep.neighbour(motion_part(removals[end - 1]), 1) != motion_part(removals[end])) break;
    const std::vector<Pass> run_passes = split_run(removals.subspan(begin, end - begin));
    passes.insert(passes.end(), run_passes.begin(), run_passes.end());
  }
  return passes;
}

/// Returns the distance of a pass along a ray near the one on which the pass was found: walks in
/// both directions of the motion as long as the distance decreases. The walk continues over a few
/// level parts, because on a plane many moves leave the same distance to rounding.
std::optional<double> pass_distance(const MilledSweep& sweep, const Pass& pass, const Ray& ray) {
  const MotionPart start = motion_part(pass.nearest);
  double best = std::numeric_limits<double>::infinity();
  if (const std::optional<Entry> entry = sweep.entry(start, ray, ray.band)) best = entry->s;
  for (const int direction : {-1, 1}) {
    std::optional<MotionPart> part = sweep.neighbour(start, direction);
    for (int level_count = 0;
         part && *part >= pass.from && *part <= pass.to && level_count < max_level_parts;
         part = sweep.neighbour(*part, direction)) {
      const std::optional<Entry> entry =
          sweep.entry(*part, ray, std::min(best + level_tolerance, ray.band));
      if (!entry && best <= ray.band) break;  // the distance increases
      level_count = entry && entry->s < best - level_tolerance ? 0 : level_count + 1;
      if (entry) best = std::min(best, entry->s);
    }
  }
  if (best <= -ray.band || best > ray.band) return std::nullopt;
  return best;
}

/// Returns the velocity of the cutter's material at a contact, or nothing if the tool turns about
/// the contact or stands.
std::optional<Vector3d> contact_feed(const Move& move, double t, const Vector3d& contact) {
  const Vector3d angular_velocity = move.angle * move.axis.cross(move.side);
  const Vector3d from_tip = contact - (move.tip + t * move.step);
  const Vector3d feed = move.step + angular_velocity.cross(from_tip);
  const double speed_sum = move.step.norm() + angular_velocity.norm() * from_tip.norm();
  // Translation and rotation may cancel: below a thousandth of their magnitudes the direction of
  // the sum is not reliable, and below 1e-9 mm the tool stands.
  if (feed.norm() < std::max(1e-9, 1e-3 * speed_sum)) return std::nullopt;
  return feed;
}

CompetingPass competing_pass_at(const MilledSweep& sweep, const Pass& pass, const Ray& ray,
                                double difference_step) {
  const Removal& nearest = pass.nearest;
  CompetingPass competing_pass{.distance = nearest.s, .move = nearest.move, .t = nearest.t};
  competing_pass.contact = ray.point + nearest.s * ray.normal;
  const Move move = move_after(sweep.motion, nearest.move);
  const PassQuery query{ray.normal, nearest.s,
                        contact_feed(move, nearest.t, competing_pass.contact), difference_step};
  const PassShape shape = pass_shape(query, [&](const Vector3d& displacement) {
    return pass_distance(sweep, pass, {ray.point + displacement, ray.normal, ray.band});
  });
  competing_pass.gradient = shape.gradient;
  competing_pass.across = shape.across;
  competing_pass.curvature = shape.curvature;
  return competing_pass;
}

std::vector<CompetingPass> competing_passes_along(const MilledSweep& sweep, const Ray& ray,
                                                  const std::vector<Removal>& removals,
                                                  const CompetingPassOptions& options) {
  std::vector<Pass> passes = split_passes(sweep, removals);
  std::stable_sort(passes.begin(), passes.end(),
                   [](const Pass& a, const Pass& b) { return a.nearest.s < b.nearest.s; });
  if (passes.size() > std::size_t(options.max_passes))
    passes.resize(std::size_t(options.max_passes));
  std::vector<CompetingPass> competing_passes;
  for (const Pass& pass : passes)
    competing_passes.push_back(competing_pass_at(sweep, pass, ray, options.difference_step));
  return competing_passes;
}

}  // namespace

std::vector<CompetingPass> milled_competing_passes(const Design& design_w, const Cutter& cutter,
                                                   const CutterMotion& motion,
                                                   const CompetingPassOptions& options) {
  check_milling_input(design_w, cutter, motion, options.band);
  require(!is_hollow(cutter), "competing passes: expected a convex cutter, seen a hollow one");
  check_pass_options(options);
  const std::vector<Index> order = judged_vertices(design_w);
  const SweepTree tree(cutter, motion);
  const MilledSweep sweep{cutter, motion};
  const ThinPartRays thin_rays(design_w, options.band);
  std::vector<std::vector<CompetingPass>> passes_by_vertex(std::size_t(design_w.vertices.rows()));
  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), vertices_per_block);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    SweepTree::Hint hint;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Index i = order[k];
      ShiftedRay segment{{design_w.vertices.row(i), design_w.normals.row(i), options.band}, 0.0};
      std::vector<Removal> removals = tree.removals_within(segment.ray, options.reach, hint);
      if (removals.empty()) {
        const std::optional<ShiftedRay> thin_ray = thin_rays.of(i);
        if (!thin_ray) continue;
        segment = *thin_ray;
        removals = tree.removals_within(segment.ray, options.reach, hint);
      }
      std::vector<CompetingPass>& competing_passes = passes_by_vertex[std::size_t(i)];
      competing_passes = competing_passes_along(sweep, segment.ray, removals, options);
      for (CompetingPass& competing_pass : competing_passes)
        competing_pass.distance += segment.shift;
    }
    const std::size_t finished_count = finished += range.size();
    if (options.progress) options.progress(double(finished_count) / double(order.size()));
  });
  return in_vertex_order(passes_by_vertex);
}

namespace {

constexpr double half_revolution = std::numbers::pi;

struct TurnedSweep {
  const NoseCutSearch& cut_search;
  const NoseMotion& motion;
  const CompetingPassOptions& options;
};

/// Returns the nearest cut of every revolution, sorted by distance.
std::vector<NoseCut> nearest_per_revolution(const NoseCutSearch& cut_search,
                                            const std::vector<NoseCut>& cuts) {
  std::vector<NoseCut> nearest;
  double revolution_begin = 0.0;
  for (const NoseCut& cut : cuts) {
    const double angle = cut_search.spindle_travel(cut);
    if (nearest.empty() || angle - revolution_begin > half_revolution) {
      nearest.push_back(cut);
      revolution_begin = angle;
    } else if (cut.s < nearest.back().s) {
      nearest.back() = cut;
    }
  }
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const NoseCut& a, const NoseCut& b) { return a.s < b.s; });
  return nearest;
}

/// Returns the normal of the rake plane in the workpiece, which is the direction in which the work
/// passes the edge.
Vector3d rake_normal(const NoseMotion& motion, const NoseCut& cut) {
  const auto i = std::size_t(cut.interval);
  const Vector3d from = motion.T_without_spindle[i].linear().col(1);
  const Vector3d to = motion.T_without_spindle[i + 1].linear().col(1);
  const double angle =
      motion.spindle[Index(i)] + cut.u * (motion.spindle[Index(i) + 1] - motion.spindle[Index(i)]);
  return Eigen::AngleAxisd(angle, motion.spindle_direction) * (from + cut.u * (to - from));
}

/// Returns the spindle angle, rad, within which the same revolution cuts the rays of the stencil.
double angular_window(const TurnedSweep& sweep, const Vector3d& contact) {
  const Vector3d from_spindle = contact - sweep.motion.spindle_point;
  const double radius = from_spindle.cross(sweep.motion.spindle_direction).norm();
  // Four times the angle of a step at this radius, plus 0.05 rad for the slow motion; at most 90
  // deg, so that the cuts of other revolutions are excluded.
  return std::min(0.5 * half_revolution,
                  0.05 + 4.0 * sweep.options.difference_step / std::max(radius, 1e-9));
}

CompetingPass competing_pass_at(const TurnedSweep& sweep, const NoseCut& cut, const Ray& ray) {
  CompetingPass competing_pass{.distance = cut.s, .move = cut.interval, .t = cut.u};
  competing_pass.contact = ray.point + cut.s * ray.normal;
  const PassQuery query{ray.normal, cut.s, rake_normal(sweep.motion, cut),
                        sweep.options.difference_step};
  const double max_angle = angular_window(sweep, competing_pass.contact);
  const auto distance = [&](const Vector3d& displacement) -> std::optional<double> {
    const Ray neighbour_ray{ray.point + displacement, ray.normal, ray.band};
    const std::optional<NoseCut> neighbour_cut =
        sweep.cut_search.first_in_window(neighbour_ray, cut, max_angle);
    if (!neighbour_cut || neighbour_cut->s <= -ray.band) return std::nullopt;
    return neighbour_cut->s;
  };
  const PassShape shape = pass_shape(query, distance);
  competing_pass.gradient = shape.gradient;
  competing_pass.across = shape.across;
  competing_pass.curvature = shape.curvature;
  return competing_pass;
}

std::vector<CompetingPass> competing_passes_along(const TurnedSweep& sweep, const Ray& ray) {
  const std::optional<NoseCut> first_cut = sweep.cut_search.first(ray);
  if (!first_cut || first_cut->s <= -ray.band) return {};
  const double limit = std::min(first_cut->s + sweep.options.reach, ray.band);
  std::vector<NoseCut> cuts =
      nearest_per_revolution(sweep.cut_search, sweep.cut_search.within(ray, limit));
  if (cuts.size() > std::size_t(sweep.options.max_passes))
    cuts.resize(std::size_t(sweep.options.max_passes));
  std::vector<CompetingPass> competing_passes;
  for (const NoseCut& cut : cuts) competing_passes.push_back(competing_pass_at(sweep, cut, ray));
  return competing_passes;
}

}  // namespace

std::vector<CompetingPass> turned_competing_passes(const Design& design_w, const Nose& nose,
                                                   const NoseMotion& motion,
                                                   const CompetingPassOptions& options) {
  check_turning_input(design_w, options.band);
  check_pass_options(options);
  const NoseCutSearch cut_search(nose, motion);
  const TurnedSweep sweep{cut_search, motion, options};
  const Index n = design_w.vertices.rows();
  auto passes_by_vertex = std::vector<std::vector<CompetingPass>>(std::size_t(n));
  const ThinPartRays thin_rays(design_w, options.band);
  const auto vertex_passes = [&](Index v) {
    std::vector<CompetingPass> competing_passes = competing_passes_along(
        sweep, {design_w.vertices.row(v), design_w.normals.row(v), options.band});
    if (!competing_passes.empty()) return competing_passes;
    const std::optional<ShiftedRay> thin_ray = thin_rays.of(v);
    if (!thin_ray) return competing_passes;
    competing_passes = competing_passes_along(sweep, thin_ray->ray);
    for (CompetingPass& competing_pass : competing_passes)
      competing_pass.distance += thin_ray->shift;
    return competing_passes;
  };
  std::atomic<Index> finished_count = 0;
  tbb::parallel_for(tbb::blocked_range<Index>(0, n, 64), [&](const auto& range) {
    for (Index v = range.begin(); v != range.end(); ++v)
      if (is_judged(design_w, v)) passes_by_vertex[std::size_t(v)] = vertex_passes(v);
    finished_count += Index(range.size());
    if (options.progress) options.progress(double(finished_count) / double(n));
  });
  return in_vertex_order(passes_by_vertex);
}

}  // namespace abbe::cutting
