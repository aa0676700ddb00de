#include "cutting/entry_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cutting/cutter_position.h"
#include "cutting/eight.h"
#include "cutting/outline_lanes.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr float rounding = 3e-6f;  // of a distance, as of a move in sweep_bounds.cpp
constexpr float edge_on = 1e-3f;   // of a plane that bounds
constexpr int steps = 3;           // towards the first contact
constexpr int sharp_steps = 5;     // the same of sharp edges
constexpr float rounded[] = {0.05f, 0.05f, 0.01f, 0.002f};  // of the radius, in each step: what
                                                            // sharp edges are rounded by

template <class T>
[[gnu::always_inline]] inline T clamped(const T& x, float low, float high) {
  return stdx::min(stdx::max(x, T(low)), T(high));
}

/// A ray and moves, in several lanes; about the k at the start of each.
template <class T>
struct Pairs {
  Triple<T> p, n, step, u, turn;
};

// ---- the forms of cutters -----------------------------------------------------------------------
//
// In the half plane about k, x from the axis, y along it: the nearest place of the core, which the
// cutter is thicker than by `corner`, and how far the cutter reaches.

struct RoundedEnd {
  float radius, corner, ring, flank;
  static constexpr float base = 0.0f;  // mm, of the bottom about k

  explicit RoundedEnd(const Cutter& cutter)
      : radius(float(cutter.radius)),
        corner(float(cutter.corner_radius)),
        ring(float(cutter.radius - cutter.corner_radius)),
        flank(float(cutter.flank_length)) {}

  bool is_sharp() const { return corner < rounded[0] * radius; }
  float thickness(int step) const { return std::max(corner, rounded[step] * radius); }

  template <class T>
  [[gnu::always_inline]] inline LanesDistance<T> from_core(const T& x, const T& y) const {
    const T beside = stdx::max(x - ring, T(0.0f));
    T below = stdx::max(-y, T(0.0f));
    stdx::where(!(beside > 0.0f) && !(below > 0.0f), below) =
        T(1e-9f);  // inside: out through the bottom
    const T d = stdx::sqrt(beside * beside + below * below + tiny);
    const T per_d = T(1.0f) / d;
    T curvature(0.0f);
    stdx::where(beside > 0.0f && below > 0.0f, curvature) = per_d;
    return {d, beside * per_d, -below * per_d, curvature};
  }
  template <class T>
  [[gnu::always_inline]] inline Reach<T> reach_to(const T& across, const T& rise,
                                                  const T& length) const {
    T most = corner * length + ring * across;
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

  template <class T>
  [[gnu::always_inline]] inline LanesDistance<T> from_core(const T& x, const T& y) const {
    return distance(outline, x, y);
  }
  template <class T>
  [[gnu::always_inline]] inline Reach<T> reach_to(const T& across, const T& rise, const T&) const {
    return reach(outline, across, rise);
  }
};

// ---- the first contact --------------------------------------------------------------------------

template <class T>
struct Contact {
  T t;
  Triple<T> m;  // unit, from the cutter to the ray
};

/// Where to begin: the ray up to s is outside of the cutter, and at t its foremost point against
/// the normal passes by.
template <class T>
struct Start {
  T s, t;
};

template <class T, class End>
[[gnu::always_inline]] inline Start<T> start_of(const End& end, const Pairs<T>& pairs, float band,
                                                float added) {
  const auto& [p, n, step, u0, turn] = pairs;
  const T rise0 = dot(n, u0), rise1 = rise0 + dot(n, turn);
  const Triple<T> lateral = n - rise0 * u0;
  const T across0 = length_of(lateral);
  const T across1 = length_of(cross(n, u0 + turn));
  const Reach<T> first = end.reach_to(across0, T(-rise0), T(1.0f));
  const Reach<T> last = end.reach_to(across1, T(-rise1), T(1.0f));
  const T along = dot(step, n);
  const T least = stdx::min(-first.most, along - last.most) - dot(p, n);
  const T s = clamped(T(least - added), -band, band);
  const Triple<T> from_foremost = p + s * n + T(first.x / across0) * lateral - first.y * u0;
  const Triple<T> step_across = step - along * n;
  return {s, clamped(T(dot(from_foremost, step_across) / (dot(step_across, step_across) + tiny)),
                     0.0f, 1.0f)};
}

// Newton towards the instant at which the ray enters first: with d the distance of the place p + s
// n from the cutter's core, m its gradient and V the velocity of the cutter there, entering at
// ds/dt = V m / m n is least where V m = 0; d bends by the curvatures of the cutter times the
// squares of how fast the place goes across m.
template <class T, class End>
[[gnu::always_inline]] inline Contact<T> contact_of(const End& end, const Pairs<T>& pairs,
                                                    float band) {
  const auto& [p, n, step, u0, turn] = pairs;
  const int last = end.is_sharp() ? sharp_steps - 1 : steps - 1;
  auto [s, t] = start_of(end, pairs, band, end.thickness(0) - end.corner);
  Triple<T> m = T(-1.0f) * n, m_of_rounded = m;
  for (int i = 0; i <= last; ++i) {
    const Triple<T> u = u0 + t * turn;
    const Triple<T> w = p + s * n - t * step;
    const T y = dot(w, u);
    const Triple<T> across = w - y * u;
    const T x = length_of(across);
    const T per_x = T(1.0f) / x;
    const Triple<T> radial = per_x * across;
    const LanesDistance<T> near = end.from_core(x, y);
    m = near.radial * radial + near.axial * u;
    if (i == steps - 1) m_of_rounded = m;
    if (i == last) break;
    const T per_facing = T(1.0f) / stdx::max(-dot(m, n), T(0.05f));
    const Triple<T> v_cutter = step + y * turn - dot(across, turn) * u;
    const T slope = -dot(v_cutter, m) * per_facing;
    const Triple<T> v = slope * n - v_cutter;
    const T v_around = dot(v, cross(u, radial));
    const T v_up = dot(v, near.radial * u - near.axial * radial);
    const T bend =
        (v_around * v_around * near.radial * per_x + v_up * v_up * near.curvature) * per_facing;
    const T next = clamped(T(t - slope / (bend + tiny)), 0.0f, 1.0f);
    const T dt = next - t;
    t = next;
    s = clamped(
        T(s + (near.value - end.thickness(i)) * per_facing + dt * (slope + 0.5f * bend * dt)),
        -band, band);
  }
  return {t, m_of_rounded};
}

// Rounding as of a move in sweep_bounds.cpp, with k at the origin and the band for how far the ray
// goes. What is farther from k along m than `arm`, and what the bottom has below, the plane does
// not touch.

/// No place of the ray before it is removed: the plane across m touches all cutters of the move.
template <class T, class End>
[[gnu::always_inline]] inline T least_of(const End& end, const Pairs<T>& pairs, float band,
                                         const Triple<T>& m0) {
  const auto& [p, n, step, u0, turn] = pairs;
  const T toward = stdx::max(dot(m0, n), T(0.0f));
  const Triple<T> m = m0 - toward * n;
  const T length = length_of(m);
  const Triple<T> u1 = u0 + turn;
  const T rise0 = dot(m, u0), rise1 = dot(m, u1);
  const T most =
      stdx::max(end.reach_to(length_of(cross(m, u0)), rise0, length).most,
                dot(m, step) + end.reach_to(length_of(cross(m, u1)), rise1, length).most);
  T arm(end.radius);
  stdx::where(stdx::max(rise0, rise1) > 0.0f, arm) = T(end.radius + end.flank);
  const T sag = arm * (0.13f * dot(turn, turn)) * length;
  const T far = stdx::abs(p.x) + stdx::abs(p.y) + stdx::abs(p.z) + stdx::abs(step.x) +
                stdx::abs(step.y) + stdx::abs(step.z) + band + arm + end.base;
  const T gap = dot(m, p) - most - sag - rounding * far * (length + toward);
  const T facing = -dot(m, n);
  const T s = gap / facing;
  T least = s - 4e-7f * stdx::abs(s);
  const auto beside = !(facing > edge_on * length);
  stdx::where(beside, least) = T(-1e30f);
  stdx::where(beside && gap > stdx::max(facing, T(0.0f)) * band, least) = T(1e30f);
  return least;
}

template <class T>
struct Bounds {
  T least, part;
  Triple<T> m;
};

template <class T, class End>
Bounds<T> bounds_of_end(const End& end, const Pairs<T>& pairs, float band) {
  const Contact<T> contact = contact_of(end, pairs, band);
  return {least_of(end, pairs, band, contact.m), contact.t, contact.m};
}

template <class T>
Bounds<T> bounds_of(const Cutter& cutter, const Pairs<T>& pairs, double band) {
  return cutter.outline ? bounds_of_end(FormEnd(cutter), pairs, float(band))
                        : bounds_of_end(RoundedEnd(cutter), pairs, float(band));
}

// ---- lanes --------------------------------------------------------------------------------------

template <int n>
using Lanes = stdx::simd<float, stdx::simd_abi::deduce_t<float, n>>;

template <int n>
Triple<Lanes<n>> lanes(const float (&v)[3][n]) {
  const auto at = [](const float* values) { return Lanes<n>(values, stdx::element_aligned); };
  return {at(v[0]), at(v[1]), at(v[2])};
}

template <class T>
Triple<T> in_all(const Vector3d& v) {
  return {T(float(v.x())), T(float(v.y())), T(float(v.z()))};
}

}  // namespace

MoveEnds ends_of(const Move& move) {
  const Position a = position(move, move.from);
  const Position b = position(move, move.to);
  return {a.tip, a.axis, b.tip - a.tip, b.axis - a.axis};
}

double least_entry(const Cutter& cutter, const MoveEnds& move, const Ray& ray, const Vector3d& m0) {
  constexpr double least_facing = 1e-6, ulps = 4e-15;
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
  if (facing > least_facing) return gap / facing - ulps * (far + std::abs(gap / facing));
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  return gap > std::max(0.0, facing) * ray.band ? everywhere : -everywhere;
}

template <int n>
void MoveLanes<n>::put(int lane, const Cutter& cutter, const MoveEnds& ends) {
  const Vector3d middle = ends.tip + cutter.corner_radius * ends.axis;
  const Vector3d last = ends.tip + ends.step + cutter.corner_radius * (ends.axis + ends.turn);
  for (int d = 0; d < 3; ++d) {
    k[d][lane] = middle[d];
    step[d][lane] = float(last[d] - middle[d]);
    u[d][lane] = float(ends.axis[d]);
    turn[d][lane] = float(ends.turn[d]);
  }
}

template <int n>
EntryBounds<n> entry_bounds(const Cutter& cutter, const MoveLanes<n>& moves, const Ray& ray) {
  alignas(32) float p[3][n];
  for (int d = 0; d < 3; ++d)
    for (int i = 0; i < n; ++i) p[d][i] = float(ray.point[d] - moves.k[d][i]);
  const Pairs<Lanes<n>> pairs{lanes(p), in_all<Lanes<n>>(ray.normal), lanes(moves.step),
                              lanes(moves.u), lanes(moves.turn)};
  const Bounds<Lanes<n>> found = bounds_of(cutter, pairs, ray.band);
  EntryBounds<n> bounds;
  found.least.copy_to(bounds.least, stdx::element_aligned);
  found.part.copy_to(bounds.part, stdx::element_aligned);
  found.m.x.copy_to(bounds.m[0], stdx::element_aligned);
  found.m.y.copy_to(bounds.m[1], stdx::element_aligned);
  found.m.z.copy_to(bounds.m[2], stdx::element_aligned);
  return bounds;
}

EntryBounds<1> entry_bounds(const Cutter& cutter, const MoveEnds& move, const Ray& ray) {
  MoveLanes<1> one;
  one.put(0, cutter, move);
  return entry_bounds(cutter, one, ray);
}

template struct MoveLanes<8>;
template struct MoveLanes<16>;
template EntryBounds<8> entry_bounds(const Cutter&, const MoveLanes<8>&, const Ray&);
template EntryBounds<16> entry_bounds(const Cutter&, const MoveLanes<16>&, const Ray&);

}  // namespace abbe::cutting
