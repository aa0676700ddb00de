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
constexpr float edge_on = 1e-3f;   // facing below which a plane gives no bound
constexpr int steps = 3;           // Newton steps towards the first contact
constexpr int sharp_steps = 5;     // the same for sharp edges
constexpr float rounded[] = {0.05f, 0.05f, 0.01f, 0.002f};  // fraction of the radius by which sharp
                                                            // edges are rounded in each step, since
                                                            // a Newton step needs their curvature

[[gnu::always_inline]] inline Float8 clamped(const Float8& x, float low, float high) {
  return stdx::min(stdx::max(x, Float8(low)), Float8(high));
}

/// Eight rays and eight moves, relative to the k of each move at its start.
struct Pairs {
  Vector8 p, n, step, u, turn;
};

// The two kinds of cutter. Both work in the half plane about k, with x from the axis and y along
// it: `from_core` gives the nearest point of the core, which the cutter exceeds by the thickness
// `corner`, and `reach_to` the support of the cutter.

struct RoundedEnd {
  float radius, corner, ring, flank;
  static constexpr float base = 0.0f;  // mm, height of the bottom above k

  explicit RoundedEnd(const Cutter& cutter)
      : radius(float(cutter.radius)),
        corner(float(cutter.corner_radius)),
        ring(float(cutter.radius - cutter.corner_radius)),
        flank(float(cutter.flank_length)) {}

  bool is_sharp() const { return corner < rounded[0] * radius; }
  float thickness(int step) const { return std::max(corner, rounded[step] * radius); }

  [[gnu::always_inline]] inline OutlineDistance8 from_core(const Float8& x, const Float8& y) const {
    const Float8 beside = stdx::max(x - ring, Float8(0.0f));
    Float8 below = stdx::max(-y, Float8(0.0f));
    // Inside the core the normal is undefined; the way out is through the bottom.
    stdx::where(!(beside > 0.0f) && !(below > 0.0f), below) = Float8(1e-9f);
    const Float8 d = stdx::sqrt(beside * beside + below * below + tiny);
    const Float8 per_d = Float8(1.0f) / d;
    Float8 curvature(0.0f);
    stdx::where(beside > 0.0f && below > 0.0f, curvature) = per_d;
    return {d, beside * per_d, -below * per_d, curvature};
  }
  [[gnu::always_inline]] inline Reach reach_to(const Float8& across, const Float8& rise,
                                               const Float8& length) const {
    Float8 most = corner * length + ring * across;
    stdx::where(rise > 0.0f, most) = (flank - corner) * rise + radius * across;
    return {most, ring + corner * across, corner * rise};
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
  float thickness(int step) const { return is_sharp() ? rounded[step] * radius : 0.0f; }

  [[gnu::always_inline]] inline OutlineDistance8 from_core(const Float8& x, const Float8& y) const {
    return distance(outline, x, y);
  }
  [[gnu::always_inline]] inline Reach reach_to(const Float8& across, const Float8& rise,
                                               const Float8&) const {
    return reach(outline, across, rise);
  }
};

// The first contact. Each step depends on the one before and waits for its latency: several groups
// of pairs therefore take each step in turn.

/// Eight pairs whose first contact is being computed.
struct Group {
  Pairs pairs;
  Float8 s, t;  // current estimates: mm along the ray; 0 .. 1 of the move
  Vector8 m;    // unit, from the cutter to the ray at the contact
};
// eight groups hide the latency of square roots and divisions
constexpr std::size_t groups_at_once = 8;

template <class End>
int last_step(const End& end) {
  return end.is_sharp() ? sharp_steps - 1 : steps - 1;
}

/// Sets the start: the ray up to s is outside the cutter, and at t the point of the cutter that is
/// foremost against the normal passes the ray.
template <class End>
[[gnu::always_inline]] inline void start(const End& end, Group& group, float band) {
  const auto& [p, n, step, u0, turn] = group.pairs;
  const Float8 rise0 = dot(n, u0), rise1 = rise0 + dot(n, turn);
  const Vector8 lateral = n - rise0 * u0;
  const Float8 across0 = length_of(lateral);
  const Float8 across1 = length_of(cross(n, u0 + turn));
  const Reach first = end.reach_to(across0, -rise0, Float8(1.0f));
  const Reach last = end.reach_to(across1, -rise1, Float8(1.0f));
  const Float8 along = dot(step, n);
  const Float8 least = stdx::min(-first.most, along - last.most) - dot(p, n);
  const Float8 s = clamped(least - (end.thickness(0) - end.corner), -band, band);
  const Vector8 from_foremost = p + s * n + (first.x / across0) * lateral - first.y * u0;
  const Vector8 step_across = step - along * n;
  group.s = s;
  group.t =
      clamped(dot(from_foremost, step_across) / (dot(step_across, step_across) + tiny), 0.0f, 1.0f);
}

// One Newton step towards the instant at which the ray enters first. With d the distance of the
// point p + s n from the cutter's core, m its gradient and V the velocity of the cutter there, the
// entry moves at ds/dt = V m / m n, which is zero at the first entry, where V m = 0. d bends by the
// curvatures of the cutter times the squares of the speeds at which the point moves across m.
template <class End>
[[gnu::always_inline]] inline void take_step(const End& end, Group& group, float band, int i) {
  const auto& [p, n, step, u0, turn] = group.pairs;
  const Float8 s = group.s, t = group.t;
  const Vector8 u = u0 + t * turn;
  const Vector8 w = p + s * n - t * step;
  const Float8 y = dot(w, u);
  const Vector8 across = w - y * u;
  const Float8 x = length_of(across);
  const Float8 per_x = 1.0f / x;
  const Vector8 radial = per_x * across;
  const OutlineDistance8 near = end.from_core(x, y);
  const Vector8 m = near.radial * radial + near.axial * u;
  if (i == steps - 1) group.m = m;
  if (i == last_step(end)) return;
  // 0.05 limits the step of a grazing ray
  const Float8 per_facing = 1.0f / stdx::max(-dot(m, n), Float8(0.05f));
  const Vector8 v_cutter = step + y * turn - dot(across, turn) * u;
  const Float8 slope = -dot(v_cutter, m) * per_facing;
  const Vector8 v = slope * n - v_cutter;
  const Float8 v_around = dot(v, cross(u, radial));
  const Float8 v_up = dot(v, near.radial * u - near.axial * radial);
  const Float8 bend =
      (v_around * v_around * near.radial * per_x + v_up * v_up * near.curvature) * per_facing;
  const Float8 next = clamped(t - slope / (bend + tiny), 0.0f, 1.0f);
  const Float8 dt = next - t;
  group.t = next;
  group.s =
      clamped(s + (near.value - end.thickness(i)) * per_facing + dt * (slope + 0.5f * bend * dt),
              -band, band);
}

// The plane does not depend on parts of the cutter that are farther from k along m than `arm`, nor
// on what the bottom has below. Rounding as for a move in sweep_bounds.cpp, with k at the origin
// and the band as the extent of the ray.

/// A plane that touches all cutters of a move, turned so that they remove no point of the ray
/// before it.
struct Plane {
  Vector8 m;
  Float8 length;
  Float8 gap;  // lower bound of the distance from the plane to the ray's point, times the length
};

template <class End>
[[gnu::always_inline]] inline Plane plane_of(const End& end, const Group& group, float band) {
  const auto& [p, n, step, u0, turn] = group.pairs;
  const Vector8& m0 = group.m;
  const Float8 toward = stdx::max(dot(m0, n), Float8(0.0f));
  const Vector8 m = m0 - toward * n;
  const Float8 length = length_of(m);
  const Vector8 u1 = u0 + turn;
  const Float8 rise0 = dot(m, u0), rise1 = dot(m, u1);
  const Float8 most =
      stdx::max(end.reach_to(length_of(cross(m, u0)), rise0, length).most,
                dot(m, step) + end.reach_to(length_of(cross(m, u1)), rise1, length).most);
  Float8 arm(end.radius);
  // 1e-6: a rise that is negative only by rounding counts as positive.
  stdx::where(stdx::max(rise0, rise1) > -1e-6f * length, arm) = Float8(end.radius + end.flank);
  // 0.13 instead of 1/8 covers the rounding
  const Float8 sag = arm * (0.13f * dot(turn, turn)) * length;
  const Float8 far = stdx::abs(p.x) + stdx::abs(p.y) + stdx::abs(p.z) + stdx::abs(step.x) +
                     stdx::abs(step.y) + stdx::abs(step.z) + band + arm + end.base;
  return {m, length, dot(m, p) - most - sag - rounding * far * (length + toward)};
}

/// Returns the position of the plane along the ray, mm, or slightly less. 4e-7 covers the rounding
/// of the quotient.
[[gnu::always_inline]] inline Float8 min_before(const Plane& plane, const Vector8& n, float band) {
  const Float8 facing = -dot(plane.m, n);
  const Float8 s = plane.gap / facing;
  Float8 least = s - 4e-7f * stdx::abs(s);
  const auto beside = !(facing > edge_on * plane.length);
  stdx::where(beside, least) = Float8(-1e30f);
  stdx::where(beside && plane.gap > stdx::max(facing, Float8(0.0f)) * band, least) = Float8(1e30f);
  return least;
}

// Groups of pairs.

template <class End, class Use>
[[gnu::always_inline]] inline void planes_by_form(const End& end, std::span<Group> groups,
                                                  float band, float around, const Use& use) {
  for (Group& group : groups) start(end, group, band);
  for (int i = 0; i <= last_step(end); ++i)
    for (Group& group : groups) take_step(end, group, band, i);
  for (std::size_t g = 0; g < groups.size(); ++g)
    use(g, groups[g], plane_of(end, groups[g], band + around));
}

Pairs pairs_of(const Move8& moves, const Ray& ray) {
  alignas(32) float p[3][Move8::width], n[3];
  for (int d = 0; d < 3; ++d) {
    for (int i = 0; i < Move8::width; ++i) p[d][i] = float(ray.point[d] - moves.k[d][i]);
    n[d] = float(ray.normal[d]);
  }
  return {load(p), spread(n), load(moves.step), load(moves.u), load(moves.turn)};
}

void store(const Vector8& v, float (&to)[3][Move8::width]) {
  v.x.copy_to(to[0], stdx::vector_aligned);
  v.y.copy_to(to[1], stdx::vector_aligned);
  v.z.copy_to(to[2], stdx::vector_aligned);
}

/// Computes the planes of `count` eights of pairs.
/// @param pairs  returns the pairs of eight number g
/// @param use    called with number, group and plane
template <class PairsAt, class Use>
[[gnu::always_inline]] inline void planes_of(const Cutter& cutter, std::size_t count, double band,
                                             double around, const PairsAt& pairs, const Use& use) {
  std::array<Group, groups_at_once> groups;
  for (std::size_t first = 0; first < count; first += groups_at_once) {
    const std::span<Group> some(groups.data(), std::min(groups_at_once, count - first));
    for (std::size_t g = 0; g < some.size(); ++g) some[g].pairs = pairs(first + g);
    const auto use_one = [&](std::size_t g, const Group& group, const Plane& plane)
        __attribute__((always_inline)) {
      use(first + g, group, plane);
    };
    if (cutter.outline)
      planes_by_form(FormEnd(cutter), some, float(band), float(around), use_one);
    else
      planes_by_form(RoundedEnd(cutter), some, float(band), float(around), use_one);
  }
}

template <class PairsAt>
void bound_all(const Cutter& cutter, double band, std::span<EntryBounds> bounds,
               const PairsAt& pairs) {
  planes_of(
      cutter, bounds.size(), band, 0.0, pairs,
      [&](std::size_t g, const Group& group, const Plane& plane) __attribute__((always_inline)) {
        min_before(plane, group.pairs.n, float(band))
            .copy_to(bounds[g].least, stdx::vector_aligned);
        group.t.copy_to(bounds[g].part, stdx::vector_aligned);
        store(group.m, bounds[g].m);
      });
}

}  // namespace

MoveEndpoints ends_of(const Move& move) {
  const Position a = position(move, move.from);
  const Position b = position(move, move.to);
  return {a.tip, a.axis, b.tip - a.tip, b.axis - a.axis};
}

double min_entry(const Cutter& cutter, const MoveEndpoints& move, const Ray& ray,
                 const Vector3d& m0) {
  // 4e-15: rounding as derived at Sweep::clearance in cutter_entry.cpp
  constexpr double min_facing = 1e-6, ulps = 4e-15;
  const double toward = std::max(0.0, m0.dot(ray.normal));
  const Vector3d m = (m0 - toward * ray.normal).normalized();
  const Vector3d p = ray.point - move.tip, axis = move.axis + move.turn;
  const double rise0 = m.dot(move.axis), rise1 = m.dot(axis);
  const double most = std::max(support(cutter, rise0, m.cross(move.axis).norm()),
                               m.dot(move.step) + support(cutter, rise1, m.cross(axis).norm()));
  const double arm = cutter.radius + (std::max(rise0, rise1) > 0.0 ? cutter.flank_length : 0.0);
  const double sag = 0.13 * arm * move.turn.squaredNorm();
  const double far = ray.point.cwiseAbs().sum() + move.tip.cwiseAbs().sum() + ray.band +
                     move.step.cwiseAbs().sum() + cutter.radius + cutter.flank_length;
  const double gap = m.dot(p) - most - sag - ulps * far;
  const double facing = -m.dot(ray.normal);
  if (facing > min_facing) return gap / facing - ulps * (far + std::abs(gap / facing));
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  return gap > std::max(0.0, facing) * ray.band ? everywhere : -everywhere;
}

void Move8::put(int lane, const Cutter& cutter, const MoveEndpoints& ends) {
  const Vector3d middle = ends.tip + cutter.corner_radius * ends.axis;
  const Vector3d last = ends.tip + ends.step + cutter.corner_radius * (ends.axis + ends.turn);
  for (int d = 0; d < 3; ++d) {
    k[d][lane] = middle[d];
    step[d][lane] = float(last[d] - middle[d]);
    u[d][lane] = float(ends.axis[d]);
    turn[d][lane] = float(ends.turn[d]);
  }
}

void Pair8::put(int lane, const Move8& moves, int its_lane, const Ray& ray) {
  for (int d = 0; d < 3; ++d) {
    p[d][lane] = float(ray.point[d] - moves.k[d][its_lane]);
    n[d][lane] = float(ray.normal[d]);
    step[d][lane] = moves.step[d][its_lane];
    u[d][lane] = moves.u[d][its_lane];
    turn[d][lane] = moves.turn[d][its_lane];
  }
}

void entry_bounds(const Cutter& cutter, std::span<const Pair8> pairs, double band,
                  std::span<EntryBounds> bounds) {
  bound_all(cutter, band, bounds, [&](std::size_t g) {
    const Pair8& eight = pairs[g];
    return Pairs{load(eight.p), load(eight.n), load(eight.step), load(eight.u), load(eight.turn)};
  });
}

void entry_bounds(const Cutter& cutter, const Move8& moves, std::span<const Ray> rays,
                  std::span<EntryBounds> bounds) {
  if (rays.empty()) return;
  bound_all(cutter, rays.front().band, bounds,
            [&](std::size_t g) { return pairs_of(moves, rays[g]); });
}

void move_planes(const Cutter& cutter, std::span<const Move8> moves, const Ray& ray, double around,
                 std::span<MovePlanes> planes) {
  planes_of(
      cutter, moves.size(), ray.band, around,
      [&](std::size_t g) { return pairs_of(moves[g], ray); },
      [&](std::size_t g, const Group&, const Plane& plane) __attribute__((always_inline)) {
        store(plane.m, planes[g].m);
        plane.gap.copy_to(planes[g].gap, stdx::vector_aligned);
      });
}

namespace {

/// A neighbour of the ray for which the planes were computed.
struct Beside {
  Vector8 aside, n;

  Beside(const Vector3d& middle, const Ray& ray) {
    float from_middle[3], normal[3];
    for (int d = 0; d < 3; ++d) {
      from_middle[d] = float(ray.point[d] - middle[d]);
      normal[d] = float(ray.normal[d]);
    }
    aside = spread(from_middle);
    n = spread(normal);
  }
  Float8 gap(const MovePlanes& planes, const Vector8& m) const {
    return load(planes.gap) + dot(m, aside);
  }
};

}  // namespace

int nearest_plane(std::span<const MovePlanes> planes, const Vector3d& middle, const Ray& ray) {
  const Beside beside(middle, ray);
  Float8 least(1e30f), eight(0.0f);
  for (std::size_t e = 0; e < planes.size(); ++e) {
    const Vector8 m = load(planes[e].m);
    const Float8 s = beside.gap(planes[e], m) / stdx::max(-dot(m, beside.n), Float8(edge_on));
    const auto nearer = s < least;
    stdx::where(nearer, least) = s;
    stdx::where(nearer, eight) = Float8(float(e));
  }
  int lane = 0;
  for (int i = 1; i < Move8::width; ++i)
    if (least[std::size_t(i)] < least[std::size_t(lane)]) lane = i;
  return int(eight[std::size_t(lane)]) * Move8::width + lane;
}

unsigned open_before(const MovePlanes& planes, const Vector3d& middle, const Ray& ray,
                     double limit) {
  const Beside beside(middle, ray);
  const Vector8 m = load(planes.m);
  const Float8 gap = beside.gap(planes, m), along = dot(m, beside.n);
  const Float8 at_start = gap - float(ray.band) * along, at_end = gap + float(limit) * along;
  return bits(!(at_start > 0.0f && at_end > 0.0f));
}

}  // namespace abbe::cutting
