#include "cutting/ball_bounds.h"

#include <algorithm>
#include <cmath>

#include "cutting/cutter_position.h"
#include "cutting/eight.h"

namespace abbe::cutting {

using Eigen::Vector3d;

// With w from `near` to the ray's point, d the direction of the chord, n that of the ray, x the way
// of the centre along d:
//   rise = d n, a = 1 - rise^2, b = w d - (w n) rise, q = w w - (w n)^2,
//   D(x) = R^2 - q + x (2 b - x a), s(x) = x rise - w n - sqrt(D(x)),
// least at x = (b - rise sqrt(a (R^2 - q + b^2 / a))) / a, and convex.
//
// Rounding. Let e = 2^-24, M the distances of `near` and of the ray's point from the origin, and so
// above |w|, a >= 1/2 and D >= R^2 / 4 (elsewhere nothing is said). In units
// of e: w n, w d, rise to 6 M, 6 M, 6; q to 20 M^2; b to 19 M; a to 13; D to 30 M^2 + 20 M^2 +
// 38 M |x| + 13 x^2 + 8 (q + 2 |b x| + a x^2) <= 75 M^2 + 50 x^2, by which s errs by half of it
// over sqrt(D), and by 6 M + 8 |x| + 4 M from its other terms. So
//   doubt = e ((45 M^2 + 26 x^2) / sqrt(D) + 11 M + 9 |x|).
// x itself errs by less than 500 e M^2 / R, and as s'' <= 10 / R the least value by less than a
// tenth of that for M below 5 R.
// tests/cutting/ball_bounds_test.cpp looks for worse.

namespace {

constexpr float rounding = 6e-8f;

[[gnu::always_inline]] inline Eight bound_of(const BallChord& move, const Vector8& p,
                                             const Vector8& n, const Eight& far) {
  const Eight dx(move.direction[0]), dy(move.direction[1]), dz(move.direction[2]);
  const Vector8 w{p.x - move.near[0], p.y - move.near[1], p.z - move.near[2]};
  const Eight w2 = dot(w, w);
  const Eight wn = dot(w, n);
  const Eight wd = w.x * dx + w.y * dy + w.z * dz;
  const Eight rise = n.x * dx + n.y * dy + n.z * dz;
  const float R2 = move.radius * move.radius;
  const Eight a = 1.0f - rise * rise;
  const Eight b = wd - wn * rise;
  const Eight at_zero = R2 - (w2 - wn * wn);
  const Eight per_a = 1.0f / a;
  const Eight most = at_zero + b * b * per_a;  // of D, for any x
  const Eight root = stdx::sqrt(stdx::max(a * most, Eight(0.0f)));
  const Eight x = stdx::min(stdx::max((b - rise * root) * per_a, Eight(move.from)), Eight(move.to));
  const Eight D = at_zero + x * (2.0f * b - x * a);
  const Eight deep = stdx::sqrt(stdx::max(D, Eight(0.25f * R2)));
  const Eight M = far + move.distance;
  const Eight doubt =
      rounding * ((45.0f * M * M + 26.0f * x * x) / deep + 11.0f * M + 9.0f * stdx::abs(x));
  Eight s = x * rise - wn - deep - doubt;
  stdx::where(!(D > 0.26f * R2) || !(a > 0.51f), s) = Eight(-1e30f);
  // what misses the thicker ball by a hundredth of it
  stdx::where(most < -0.01f * R2 && a > 0.51f, s) = Eight(1e30f);
  return s;
}

}  // namespace

BallChord::BallChord(const Cutter& cutter, const Move& move, const Vector3d& origin) {
  const Position start = position(move, move.from), end = position(move, move.to);
  const Vector3d first = start.tip + cutter.radius * start.axis - origin;
  const Vector3d chord = end.tip + cutter.radius * end.axis - origin - first;
  const double length = chord.norm(), turn = move.angle * (move.to - move.from);
  const Vector3d unit = length > 0.0 ? Vector3d(chord / length) : Vector3d::UnitX();
  const double at = -first.dot(unit);
  const Vector3d place = first + at * unit;
  for (int d = 0; d < 3; ++d) {
    near[d] = float(place[d]);
    direction[d] = float(unit[d]);
  }
  from = float(-at);
  to = float(length - at);
  distance = float(place.norm());
  radius = float(cutter.radius * (1.0 + 0.126 * turn * turn + 1e-7));
}

std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const RayEight& rays,
                               std::span<EntryEight> bounds) {
  const Vector8 p = load(rays.p), n = load(rays.n);
  const Eight far = length_of(p);
  Eight first(2e30f), which(0.0f);
  for (std::size_t k = 0; k < moves.size(); ++k) {
    const Eight s = bound_of(moves[k], p, n, far);
    s.copy_to(bounds[k].least, stdx::vector_aligned);
    stdx::where(s < first, which) = Eight(float(k));
    first = stdx::min(first, s);
  }
  std::array<int, 8> least;
  for (std::size_t i = 0; i < 8; ++i) least[i] = int(which[i]);
  return least;
}

bool stays_below_centre(const Cutter& cutter, const Move& move, const Vector3d& place,
                        double around, const Vector3d& normal, double tilt) {
  if (normal.dot(move.axis) < tilt + move.angle) return false;
  const Vector3d arm = place - move.tip;
  const double height = arm.dot(move.axis) - cutter.radius;
  const double rise =
      std::max(0.0, -move.step.dot(move.axis)) + move.angle * (arm.norm() + move.step.norm());
  return height + rise + around < 0.0;
}

}  // namespace abbe::cutting
