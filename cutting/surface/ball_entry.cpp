#include "cutting/surface/ball_entry.h"

#include <algorithm>
#include <cmath>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/simd.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// The path of a ball end's centre during a move; `x` is 0 .. 1 from `from` to `to`.
struct BallPath {
  const Cutter& cutter;
  const Move& move;
  Position start, end;
  Vector3d first, last;  // of the ball
  double angle;          // rad, turned between them

  BallPath(const Cutter& c, const Move& m)
      : cutter(c),
        move(m),
        start(position(m, m.from)),
        end(position(m, m.to)),
        first(centre(start)),
        last(centre(end)),
        angle(m.angle * (m.to - m.from)) {}

  Vector3d centre(const Position& at) const { return at.tip + cutter.radius * at.axis; }
  /// Returns an upper bound of the distance of the centre from its chord, R angle^2 / 8: a ball
  /// thicker by it that runs along the chord contains the sweep.
  double sag() const { return 0.125 * cutter.radius * angle * angle; }
};

/// Returns true if no point of the ray up to s can be higher than the centre of the ball during the
/// move, so that only the lower half of the ball can have met it.
bool stays_below_flank(const BallPath& path, const Ray& ray, double s) {
  const Vector3d place = ray.point + s * ray.normal;
  const double turned = path.angle * path.angle;
  const Vector3d w0 = place - path.first;
  const Vector3d w1 = place - path.last;
  double bend = 0.0;  // twice the amount by which a height above the tip can exceed its values at
                      // the ends
  if (path.angle != 0) {
    const double arms = path.cutter.radius + w0.norm() + w1.norm();
    bend = 0.25 * (arms * turned + 2 * (path.last - path.first).norm() * path.angle);
  }
  // angle^2: more than the axis departs from its chord, so the ray rises along it at every instant
  return ray.normal.dot(path.start.axis) >= turned && ray.normal.dot(path.end.axis) >= turned &&
         w0.dot(path.start.axis) <= -bend && w1.dot(path.end.axis) <= -bend;
}

/// Returns the first entry of the ray's line into a ball of `radius` whose centre runs along the
/// chord.
std::optional<Entry> capsule_entry(const BallPath& path, const Ray& ray, double radius) {
  const Vector3d w = ray.point - path.first;
  const Vector3d chord = path.last - path.first;
  const double wn = w.dot(ray.normal);
  const double rise = chord.dot(ray.normal);
  const Vector3d w_across = w - wn * ray.normal;
  const Vector3d chord_across = chord - rise * ray.normal;
  const double a = chord_across.squaredNorm();
  double x = rise < 0 ? 1.0 : 0.0;
  if (a > 0) {
    const double nearest = w_across.dot(chord_across) / a;
    const double reach = radius * radius - (w_across - nearest * chord_across).squaredNorm();
    if (reach < 0) return std::nullopt;
    x = std::clamp(nearest - rise * std::sqrt(reach / (a * (a + rise * rise))), 0.0, 1.0);
  }
  const double D = radius * radius - (w_across - x * chord_across).squaredNorm();
  if (D < 0) return std::nullopt;
  return Entry{x * rise - wn - std::sqrt(D), x};
}

/// Returns the entry into the ball on its true path, by Newton's method from `x`; only where the
/// entry is strictly convex in time. Nothing if the iteration does not converge.
std::optional<Entry> curved_entry(const BallPath& path, const Ray& ray, double x) {
  const double R = path.cutter.radius;
  const Vector3d chord = path.last - path.first;
  const double across = (chord - chord.dot(ray.normal) * ray.normal).norm();
  // It is convex if the centre moves across the ray faster than R angle. 10 % of that and R angle^2
  // cover the difference between the chord and the velocity at any instant.
  if (across < R * path.angle * (1.1 + path.angle)) return std::nullopt;
  const double span = path.move.to - path.move.from;
  const Vector3d step = span * path.move.step;
  // 8 steps suffice by far where Newton's method converges; elsewhere the general search decides.
  for (int i = 0; i < 8; ++i) {
    const double t = instant(path.move, x);
    const Position at = position(path.move, t);
    const Vector3d w = ray.point - path.centre(at);
    const double wn = w.dot(ray.normal);
    const double D = R * R - (w - wn * ray.normal).squaredNorm();
    if (D <= 0) return std::nullopt;
    const double facing = std::sqrt(D) / R;
    const double s = -wn - R * facing;
    const Vector3d outward = (w + s * ray.normal) / R;
    const double phase = path.move.angle * t;
    const Vector3d speed =
        step +
        R * path.angle * (std::cos(phase) * path.move.side - std::sin(phase) * path.move.axis);
    const double slope = -outward.dot(speed) / facing;
    const Vector3d bend = -R * path.angle * path.angle * at.axis;
    const double curvature =
        ((slope * ray.normal - speed).squaredNorm() / R - outward.dot(bend)) / facing;
    if (!(curvature > 0)) return std::nullopt;
    const double next = std::clamp(x - slope / curvature, 0.0, 1.0);
    // s is then within 5e-13 mm of its minimum, being of second order in x
    if (curvature * (next - x) * (next - x) < 1e-12) return Entry{s, x};
    x = next;
  }
  return std::nullopt;
}

}  // namespace

BallEntry ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit) {
  const BallPath path(cutter, move);
  const std::optional<Entry> bound = capsule_entry(path, ray, cutter.radius + path.sag());
  // The s of a grazing ray is uncertain by the square root of rounding. Such a ray must take the
  // same branch whatever the limit.
  const double until = limit + 1e-6 * (1.0 + cutter.radius);
  if (!bound || bound->s > until)
    return {stays_below_flank(path, ray, std::min(until, ray.band)), std::nullopt};
  std::optional<Entry> entry = path.angle == 0 ? bound : curved_entry(path, ray, bound->t);
  if (!entry || entry->s <= -ray.band || !stays_below_flank(path, ray, entry->s)) return {};
  entry->t = instant(move, entry->t);
  return {true, entry};
}

// With w from `near` to the ray's point, d the direction of the chord, n that of the ray, x the
// position of the centre along d:
//   rise = d n, a = 1 - rise^2, b = w d - (w n) rise, q = w w - (w n)^2,
//   D(x) = R^2 - q + x (2 b - x a), s(x) = x rise - w n - sqrt(D(x)),
// which is convex and least at x = (b - rise sqrt(a (R^2 - q + b^2 / a))) / a.
//
// Rounding. Let e = 2^-24, and M the sum of the distances of `near` and of the ray's point from the
// origin, which is above |w|; let a >= 1/2 and D >= R^2 / 4 (no bound is given elsewhere). In units
// of e: w n, w d, rise to 6 M, 6 M, 6; q to 20 M^2; b to 19 M; a to 13; D to 30 M^2 + 20 M^2 + 38 M
// |x| + 13 x^2 + 8 (q + 2 |b x| + a x^2) <= 75 M^2 + 50 x^2. The error of s is half of that divided
// by sqrt(D), plus 6 M + 8 |x| + 4 M from its other terms. So
//   doubt = e ((45 M^2 + 26 x^2) / sqrt(D) + 11 M + 9 |x|).
// The error of x itself is less than 500 e M^2 / R, and as s'' <= 10 / R it changes the least value
// by less than a tenth of the doubt for M below 5 R. tests/cutting/ball_bounds_test.cpp searches
// for larger errors.

namespace {

// e of the derivation, 2^-24 = 5.96e-8, rounded up
constexpr float rounding = 6e-8f;

[[gnu::always_inline]] inline Float8 bound_of(const BallChord& move, const Vector8& p,
                                              const Vector8& n, const Float8& far) {
  const Float8 dx(move.direction[0]), dy(move.direction[1]), dz(move.direction[2]);
  const Vector8 w{p.x - move.near[0], p.y - move.near[1], p.z - move.near[2]};
  const Float8 w2 = dot(w, w);
  const Float8 wn = dot(w, n);
  const Float8 wd = w.x * dx + w.y * dy + w.z * dz;
  const Float8 rise = n.x * dx + n.y * dy + n.z * dz;
  const float R2 = move.radius * move.radius;
  const Float8 a = 1.0f - rise * rise;
  const Float8 b = wd - wn * rise;
  const Float8 at_zero = R2 - (w2 - wn * wn);
  const Float8 per_a = 1.0f / a;
  const Float8 most = at_zero + b * b * per_a;  // upper bound of D over all x
  const Float8 root = stdx::sqrt(stdx::max(a * most, Float8(0.0f)));
  const Float8 x =
      stdx::min(stdx::max((b - rise * root) * per_a, Float8(move.from)), Float8(move.to));
  const Float8 D = at_zero + x * (2.0f * b - x * a);
  const Float8 deep = stdx::sqrt(stdx::max(D, Float8(0.25f * R2)));
  const Float8 M = far + move.distance;
  const Float8 doubt =
      rounding * ((45.0f * M * M + 26.0f * x * x) / deep + 11.0f * M + 9.0f * stdx::abs(x));
  Float8 s = x * rise - wn - deep - doubt;
  stdx::where(!(D > 0.26f * R2) || !(a > 0.51f), s) = Float8(-1e30f);
  // Misses by more than a hundredth of R^2, which is far beyond the rounding of `most`.
  stdx::where(most < -0.01f * R2 && a > 0.51f, s) = Float8(1e30f);
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
  // 0.125 turn^2 is the sag of the centre's path; the rest covers the rounding to float.
  radius = float(cutter.radius * (1.0 + 0.126 * turn * turn + 1e-7));
}

std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const Ray8& rays,
                               std::span<Entry8> bounds) {
  const Vector8 p = load(rays.p), n = load(rays.n);
  const Float8 far = length_of(p);
  Float8 first(2e30f), which(0.0f);
  for (std::size_t k = 0; k < moves.size(); ++k) {
    const Float8 s = bound_of(moves[k], p, n, far);
    s.copy_to(bounds[k].least, stdx::vector_aligned);
    stdx::where(s < first, which) = Float8(float(k));
    first = stdx::min(first, s);
  }
  std::array<int, 8> least;
  for (std::size_t i = 0; i < 8; ++i) least[i] = int(which[i]);
  return least;
}

bool stays_below_centre(const Cutter& cutter, const Move& move, const Vector3d& place,
                        double around, const Vector3d& normal, double tilt) {
  // The axis turns by at most `angle`, so every ray still rises along it at the end of the move.
  if (normal.dot(move.axis) < tilt + move.angle) return false;
  const Vector3d arm = place - move.tip;
  const double height = arm.dot(move.axis) - cutter.radius;
  const double rise =
      std::max(0.0, -move.step.dot(move.axis)) + move.angle * (arm.norm() + move.step.norm());
  return height + rise + around < 0.0;
}

}  // namespace abbe::cutting
