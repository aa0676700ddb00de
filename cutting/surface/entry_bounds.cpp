#include "cutting/surface/entry_bounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/simd.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr float rounding = 3e-6f;  // of a distance, as for a move in sweep_bounds.cpp
// Between plane normal and ray; with a smaller cosine a plane gives no bound.
constexpr float min_plane_cosine = 1e-3f;
constexpr int newton_steps = 3;        // towards the first contact
constexpr int sharp_newton_steps = 5;  // the same for cutters with sharp edges
// Fractions of the radius by which sharp edges are rounded in each step, since a Newton step needs
// their curvature.
constexpr float rounding_fractions[] = {0.05f, 0.05f, 0.01f, 0.002f};

[[gnu::always_inline]] inline Float8 clamp_to(const Float8& x, float low, float high) {
  return stdx::min(stdx::max(x, Float8(low)), Float8(high));
}

/// Eight pairs of a ray and a move, with the ray's point relative to the start of the move's k.
struct PairVectors {
  Vector8 p, n, step, u, axis_step;
};

// The two kinds of cutter end. Coordinates are x from the axis and y along it, from k.
// `core_distance` is the distance from the core, which the cutter exceeds by the thickness
// `corner`; `support_reach` is the support of the cutter.

struct RoundedEnd {
  float radius, corner, ring, flank;
  static constexpr float base = 0.0f;  // mm, height of the bottom above k

  explicit RoundedEnd(const Cutter& cutter)
      : radius(float(cutter.radius)),
        corner(float(cutter.corner_radius)),
        ring(float(cutter.radius - cutter.corner_radius)),
        flank(float(cutter.flank_length)) {}

  bool is_sharp() const { return corner < rounding_fractions[0] * radius; }
  float thickness(int step) const { return std::max(corner, rounding_fractions[step] * radius); }

  [[gnu::always_inline]] inline OutlineDistance8 core_distance(const Float8& x,
                                                               const Float8& y) const {
    const Float8 outside_ring = stdx::max(x - ring, Float8(0.0f));
    Float8 below_centre = stdx::max(-y, Float8(0.0f));
    // Inside the core the normal is undefined; the one through the bottom is used.
    stdx::where(!(outside_ring > 0.0f) && !(below_centre > 0.0f), below_centre) = Float8(1e-9f);
    const Float8 distance =
        stdx::sqrt(outside_ring * outside_ring + below_centre * below_centre + tiny);
    const Float8 inverse_distance = Float8(1.0f) / distance;
    Float8 curvature(0.0f);
    stdx::where(outside_ring > 0.0f && below_centre > 0.0f, curvature) = inverse_distance;
    return {distance, outside_ring * inverse_distance, -below_centre * inverse_distance, curvature};
  }
  [[gnu::always_inline]] inline Reach support_reach(const Float8& across, const Float8& rise,
                                                    const Float8& length) const {
    Float8 reach = corner * length + ring * across;
    stdx::where(rise > 0.0f, reach) = (flank - corner) * rise + radius * across;
    return {reach, ring + corner * across, corner * rise};
  }
};

struct FormEnd {
  const ToolOutline& outline;
  float radius, corner = 0.0f, flank, base;

  explicit FormEnd(const Cutter& cutter)
      : outline(*cutter.outline),
        radius(float(cutter.radius)),
        flank(float(cutter.flank_length)),
        base(float(bottom(outline))) {}

  bool is_sharp() const { return outline.is_sharp; }
  float thickness(int step) const { return is_sharp() ? rounding_fractions[step] * radius : 0.0f; }

  [[gnu::always_inline]] inline OutlineDistance8 core_distance(const Float8& x,
                                                               const Float8& y) const {
    return distance(outline, x, y);
  }
  [[gnu::always_inline]] inline Reach support_reach(const Float8& across, const Float8& rise,
                                                    const Float8&) const {
    return reach(outline, across, rise);
  }
};

// The first contact. Each step depends on the previous one and waits for its latency, so several
// groups of pairs take each step in turn.

/// Eight pairs whose first contact is being computed.
struct Group {
  PairVectors pairs;
  Float8 s, t;  // current estimates: mm along the ray; 0 .. 1 of the move
  Vector8 m;    // unit, from the cutter to the ray at the contact
};
// Eight groups hide the latency of square roots and divisions.
constexpr std::size_t groups_per_batch = 8;

template <class End>
int last_step(const End& end) {
  return end.is_sharp() ? sharp_newton_steps - 1 : newton_steps - 1;
}

/// Sets the start of the iteration: the ray up to s is outside the cutter, and at t the point of
/// the cutter that is foremost against the normal passes the ray.
template <class End>
[[gnu::always_inline]] inline void set_start(const End& end, Group& group, float band) {
  const auto& [p, n, step, u0, axis_step] = group.pairs;
  const Float8 rise0 = dot(n, u0), rise1 = rise0 + dot(n, axis_step);
  const Vector8 lateral = n - rise0 * u0;
  const Float8 across0 = magnitude(lateral);
  const Float8 across1 = magnitude(cross(n, u0 + axis_step));
  const Reach first_reach = end.support_reach(across0, -rise0, Float8(1.0f));
  const Reach last_reach = end.support_reach(across1, -rise1, Float8(1.0f));
  const Float8 step_along = dot(step, n);
  const Float8 min_s = stdx::min(-first_reach.value, step_along - last_reach.value) - dot(p, n);
  const Float8 s = clamp_to(min_s - (end.thickness(0) - end.corner), -band, band);
  const Vector8 from_foremost =
      p + s * n + (first_reach.x / across0) * lateral - first_reach.y * u0;
  const Vector8 step_across = step - step_along * n;
  group.s = s;
  group.t = clamp_to(dot(from_foremost, step_across) / (dot(step_across, step_across) + tiny), 0.0f,
                     1.0f);
}

// One Newton step towards the instant at which the ray enters first. With d the distance of the
// point p + s n from the cutter's core, m its gradient and V the velocity of the cutter there, the
// entry moves at ds/dt = V m / m n, which is zero at the first entry, where V m = 0. d bends by the
// curvatures of the cutter times the squares of the speeds at which the point moves across m.
template <class End>
[[gnu::always_inline]] inline void newton_step(const End& end, Group& group, float band, int i) {
  const auto& [p, n, step, u0, axis_step] = group.pairs;
  const Float8 s = group.s, t = group.t;
  const Vector8 u = u0 + t * axis_step;
  const Vector8 w = p + s * n - t * step;
  const Float8 y = dot(w, u);
  const Vector8 across = w - y * u;
  const Float8 x = magnitude(across);
  const Float8 inverse_x = 1.0f / x;
  const Vector8 radial = inverse_x * across;
  const OutlineDistance8 core = end.core_distance(x, y);
  const Vector8 m = core.radial * radial + core.axial * u;
  if (i == newton_steps - 1) group.m = m;
  if (i == last_step(end)) return;
  // 0.05 limits the step of a grazing ray.
  const Float8 inverse_cosine = 1.0f / stdx::max(-dot(m, n), Float8(0.05f));
  const Vector8 v_cutter = step + y * axis_step - dot(across, axis_step) * u;
  const Float8 slope = -dot(v_cutter, m) * inverse_cosine;
  const Vector8 v = slope * n - v_cutter;
  const Float8 v_around = dot(v, cross(u, radial));
  const Float8 v_meridional = dot(v, core.radial * u - core.axial * radial);
  const Float8 bend = (v_around * v_around * core.radial * inverse_x +
                       v_meridional * v_meridional * core.curvature) *
                      inverse_cosine;
  const Float8 next_t = clamp_to(t - slope / (bend + tiny), 0.0f, 1.0f);
  const Float8 dt = next_t - t;
  group.t = next_t;
  group.s = clamp_to(
      s + (core.value - end.thickness(i)) * inverse_cosine + dt * (slope + 0.5f * bend * dt), -band,
      band);
}

// The plane does not depend on parts of the cutter that are farther from k along m than `arm`, nor
// on anything below the bottom. Rounding is as for a move in sweep_bounds.cpp, with k at the origin
// and the band as the extent of the ray.

/// A plane with the cutter behind it during the whole move, turned so that no point of the ray
/// before the plane can be removed.
struct Plane {
  Vector8 m;
  Float8 length;
  Float8 gap;  // lower bound of the distance from the plane to the ray's point, times `length`
};

template <class End>
[[gnu::always_inline]] inline Plane separating_plane(const End& end, const Group& group,
                                                     float band) {
  const auto& [p, n, step, u0, axis_step] = group.pairs;
  const Vector8& m0 = group.m;
  const Float8 along_ray = stdx::max(dot(m0, n), Float8(0.0f));
  const Vector8 m = m0 - along_ray * n;
  const Float8 length = magnitude(m);
  const Vector8 u1 = u0 + axis_step;
  const Float8 rise0 = dot(m, u0), rise1 = dot(m, u1);
  const Float8 reach =
      stdx::max(end.support_reach(magnitude(cross(m, u0)), rise0, length).value,
                dot(m, step) + end.support_reach(magnitude(cross(m, u1)), rise1, length).value);
  Float8 arm(end.radius);
  // A rise that is negative only by rounding (1e-6) counts as positive.
  stdx::where(stdx::max(rise0, rise1) > -1e-6f * length, arm) = Float8(end.radius + end.flank);
  // 0.13 instead of 1/8 covers the rounding.
  const Float8 sag = arm * (0.13f * dot(axis_step, axis_step)) * length;
  const Float8 coordinate_sum = stdx::abs(p.x) + stdx::abs(p.y) + stdx::abs(p.z) +
                                stdx::abs(step.x) + stdx::abs(step.y) + stdx::abs(step.z) + band +
                                arm + end.base;
  return {m, length, dot(m, p) - reach - sag - rounding * coordinate_sum * (length + along_ray)};
}

/// Returns the s at which the ray crosses the plane, mm, or slightly less: 4e-7 covers the rounding
/// of the quotient.
[[gnu::always_inline]] inline Float8 plane_entry(const Plane& plane, const Vector8& n, float band) {
  const Float8 cosine = -dot(plane.m, n);
  const Float8 s = plane.gap / cosine;
  Float8 result = s - 4e-7f * stdx::abs(s);
  const auto is_edge_on = !(cosine > min_plane_cosine * plane.length);
  stdx::where(is_edge_on, result) = Float8(-1e30f);
  stdx::where(is_edge_on && plane.gap > stdx::max(cosine, Float8(0.0f)) * band, result) =
      Float8(1e30f);
  return result;
}

// Groups of pairs.

template <class End, class Visitor>
[[gnu::always_inline]] inline void visit_batch_planes(const End& end, std::span<Group> groups,
                                                      float band, float max_offset,
                                                      const Visitor& visit) {
  for (Group& group : groups) set_start(end, group, band);
  for (int i = 0; i <= last_step(end); ++i)
    for (Group& group : groups) newton_step(end, group, band, i);
  for (std::size_t g = 0; g < groups.size(); ++g)
    visit(g, groups[g], separating_plane(end, groups[g], band + max_offset));
}

PairVectors load_pairs(const Move8& moves, const Ray& ray) {
  alignas(32) float p[3][Move8::width], n[3];
  for (int d = 0; d < 3; ++d) {
    for (int i = 0; i < Move8::width; ++i) p[d][i] = float(ray.point[d] - moves.k[d][i]);
    n[d] = float(ray.normal[d]);
  }
  return {load(p), spread(n), load(moves.step), load(moves.u), load(moves.axis_step)};
}

void store(const Vector8& v, float (&to)[3][Move8::width]) {
  v.x.copy_to(to[0], stdx::vector_aligned);
  v.y.copy_to(to[1], stdx::vector_aligned);
  v.z.copy_to(to[2], stdx::vector_aligned);
}

/// Computes the planes of `count` groups of eight pairs.
/// @param load_pairs  returns the pairs of group number g
/// @param visit       called with number, group and plane
template <class PairLoader, class Visitor>
[[gnu::always_inline]] inline void visit_planes(const Cutter& cutter, std::size_t count,
                                                double band, double max_offset,
                                                const PairLoader& load_pairs,
                                                const Visitor& visit) {
  std::array<Group, groups_per_batch> groups;
  for (std::size_t first_group = 0; first_group < count; first_group += groups_per_batch) {
    const std::span<Group> batch(groups.data(), std::min(groups_per_batch, count - first_group));
    for (std::size_t g = 0; g < batch.size(); ++g) batch[g].pairs = load_pairs(first_group + g);
    const auto visit_group = [&](std::size_t g, const Group& group, const Plane& plane)
        __attribute__((always_inline)) {
      visit(first_group + g, group, plane);
    };
    if (cutter.outline)
      visit_batch_planes(FormEnd(cutter), batch, float(band), float(max_offset), visit_group);
    else
      visit_batch_planes(RoundedEnd(cutter), batch, float(band), float(max_offset), visit_group);
  }
}

template <class PairLoader>
void compute_bounds(const Cutter& cutter, double band, std::span<EntryBounds> bounds,
                    const PairLoader& load_pairs) {
  visit_planes(
      cutter, bounds.size(), band, 0.0, load_pairs,
      [&](std::size_t g, const Group& group, const Plane& plane) __attribute__((always_inline)) {
        plane_entry(plane, group.pairs.n, float(band))
            .copy_to(bounds[g].min_s, stdx::vector_aligned);
        group.t.copy_to(bounds[g].fraction, stdx::vector_aligned);
        store(group.m, bounds[g].m);
      });
}

}  // namespace

MoveEndpoints move_endpoints(const Move& move) {
  const CutterPose a = cutter_pose(move, move.from);
  const CutterPose b = cutter_pose(move, move.to);
  return {a.tip, a.axis, b.tip - a.tip, b.axis - a.axis};
}

double min_entry(const Cutter& cutter, const MoveEndpoints& move, const Ray& ray,
                 const Vector3d& m0) {
  // 4e-15 is the rounding as derived at EntryFunction::clearance in cutter_entry.cpp.
  constexpr double min_cosine = 1e-6, ulps = 4e-15;
  const double along_ray = std::max(0.0, m0.dot(ray.normal));
  const Vector3d m = (m0 - along_ray * ray.normal).normalized();
  const Vector3d p = ray.point - move.tip, axis = move.axis + move.axis_step;
  const double rise0 = m.dot(move.axis), rise1 = m.dot(axis);
  const double reach = std::max(support(cutter, rise0, m.cross(move.axis).norm()),
                                m.dot(move.step) + support(cutter, rise1, m.cross(axis).norm()));
  const double arm = cutter.radius + (std::max(rise0, rise1) > 0.0 ? cutter.flank_length : 0.0);
  const double sag = 0.13 * arm * move.axis_step.squaredNorm();
  const double coordinate_sum = ray.point.cwiseAbs().sum() + move.tip.cwiseAbs().sum() + ray.band +
                                move.step.cwiseAbs().sum() + cutter.radius + cutter.flank_length;
  const double gap = m.dot(p) - reach - sag - ulps * coordinate_sum;
  const double cosine = -m.dot(ray.normal);
  if (cosine > min_cosine) return gap / cosine - ulps * (coordinate_sum + std::abs(gap / cosine));
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  return gap > std::max(0.0, cosine) * ray.band ? everywhere : -everywhere;
}

void Move8::set_lane(int lane, const Cutter& cutter, const MoveEndpoints& move) {
  const Vector3d set_start = move.tip + cutter.corner_radius * move.axis;
  const Vector3d end = move.tip + move.step + cutter.corner_radius * (move.axis + move.axis_step);
  for (int d = 0; d < 3; ++d) {
    k[d][lane] = set_start[d];
    step[d][lane] = float(end[d] - set_start[d]);
    u[d][lane] = float(move.axis[d]);
    axis_step[d][lane] = float(move.axis_step[d]);
  }
}

void Pair8::set_lane(int lane, const Move8& moves, int move_lane, const Ray& ray) {
  for (int d = 0; d < 3; ++d) {
    p[d][lane] = float(ray.point[d] - moves.k[d][move_lane]);
    n[d][lane] = float(ray.normal[d]);
    step[d][lane] = moves.step[d][move_lane];
    u[d][lane] = moves.u[d][move_lane];
    axis_step[d][lane] = moves.axis_step[d][move_lane];
  }
}

void entry_bounds(const Cutter& cutter, std::span<const Pair8> pairs, double band,
                  std::span<EntryBounds> bounds) {
  compute_bounds(cutter, band, bounds, [&](std::size_t g) {
    const Pair8& group = pairs[g];
    return PairVectors{load(group.p), load(group.n), load(group.step), load(group.u),
                       load(group.axis_step)};
  });
}

void entry_bounds(const Cutter& cutter, const Move8& moves, std::span<const Ray> rays,
                  std::span<EntryBounds> bounds) {
  if (rays.empty()) return;
  compute_bounds(cutter, rays.front().band, bounds,
                 [&](std::size_t g) { return load_pairs(moves, rays[g]); });
}

void move_planes(const Cutter& cutter, std::span<const Move8> moves, const Ray& ray,
                 double max_offset, std::span<MovePlanes> planes) {
  visit_planes(
      cutter, moves.size(), ray.band, max_offset,
      [&](std::size_t g) { return load_pairs(moves[g], ray); },
      [&](std::size_t g, const Group&, const Plane& plane) __attribute__((always_inline)) {
        store(plane.m, planes[g].m);
        plane.gap.copy_to(planes[g].gap, stdx::vector_aligned);
      });
}

namespace {

/// A neighbour of the ray for which the planes were computed, in single precision.
struct NeighbourRay {
  Vector8 displacement, n;

  NeighbourRay(const Vector3d& reference_point, const Ray& ray) {
    float from_middle[3], normal[3];
    for (int d = 0; d < 3; ++d) {
      from_middle[d] = float(ray.point[d] - reference_point[d]);
      normal[d] = float(ray.normal[d]);
    }
    displacement = spread(from_middle);
    n = spread(normal);
  }
  Float8 gap(const MovePlanes& planes, const Vector8& m) const {
    return load(planes.gap) + dot(m, displacement);
  }
};

}  // namespace

int nearest_plane(std::span<const MovePlanes> planes, const Vector3d& reference_point,
                  const Ray& ray) {
  const NeighbourRay neighbour(reference_point, ray);
  Float8 min_s(1e30f), nearest_group(0.0f);
  for (std::size_t group = 0; group < planes.size(); ++group) {
    const Vector8 m = load(planes[group].m);
    const Float8 s =
        neighbour.gap(planes[group], m) / stdx::max(-dot(m, neighbour.n), Float8(min_plane_cosine));
    const auto is_nearer = s < min_s;
    stdx::where(is_nearer, min_s) = s;
    stdx::where(is_nearer, nearest_group) = Float8(float(group));
  }
  int lane = 0;
  for (int i = 1; i < Move8::width; ++i)
    if (min_s[std::size_t(i)] < min_s[std::size_t(lane)]) lane = i;
  return int(nearest_group[std::size_t(lane)]) * Move8::width + lane;
}

unsigned candidates_before(const MovePlanes& planes, const Vector3d& reference_point,
                           const Ray& ray, double limit) {
  const NeighbourRay neighbour(reference_point, ray);
  const Vector8 m = load(planes.m);
  const Float8 gap = neighbour.gap(planes, m), slope = dot(m, neighbour.n);
  const Float8 at_start = gap - float(ray.band) * slope, at_end = gap + float(limit) * slope;
  return bits(!(at_start > 0.0f && at_end > 0.0f));
}

}  // namespace abbe::cutting
