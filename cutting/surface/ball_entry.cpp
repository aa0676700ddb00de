#include "cutting/surface/ball_entry.h"

#include <algorithm>
#include <cmath>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/simd.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// The path of a ball end's centre during a move; the parameter x is 0 at `move.from`, 1 at
/// `move.to`.
struct BallPath {
  const Cutter& cutter;
  const Move& move;
  CutterPose start, end;
  Vector3d start_centre, end_centre;  // of the ball
  double angle;                       // rad, by which the axis turns between them

  BallPath(const Cutter& c, const Move& m)
      : cutter(c),
        move(m),
        start(cutter_pose(m, m.from)),
        end(cutter_pose(m, m.to)),
        start_centre(centre(start)),
        end_centre(centre(end)),
        angle(m.angle * (m.to - m.from)) {}

  Vector3d centre(const CutterPose& pose) const { return pose.tip + cutter.radius * pose.axis; }
  /// Returns an upper bound of the distance of the centre from its chord, R angle^2 / 8, mm. A ball
  /// whose radius is larger by the sag, moved along the chord, contains the sweep.
  double sag() const { return 0.125 * cutter.radius * angle * angle; }
};

/// Returns true if the ray up to s stays below the ball's centre during the move, so that it can
/// only have met the lower half of the ball.
bool is_below_flank(const BallPath& path, const Ray& ray, double s) {
  const Vector3d ray_end = ray.point + s * ray.normal;
  const double squared_angle = path.angle * path.angle;
  const Vector3d start_offset = ray_end - path.start_centre;
  const Vector3d end_offset = ray_end - path.end_centre;
  // Twice the amount by which a height above the tip can exceed its values at the ends.
  double bulge = 0.0;
  if (path.angle != 0) {
    const double length_sum = path.cutter.radius + start_offset.norm() + end_offset.norm();
    bulge = 0.25 * (length_sum * squared_angle +
                    2 * (path.end_centre - path.start_centre).norm() * path.angle);
  }
  // The axis departs from its chord by less than angle^2, so the ray rises along it at all times.
  return ray.normal.dot(path.start.axis) >= squared_angle &&
         ray.normal.dot(path.end.axis) >= squared_angle &&
         start_offset.dot(path.start.axis) <= -bulge && end_offset.dot(path.end.axis) <= -bulge;
}

/// Returns the first entry of the ray's line into a ball of `radius` moved along the chord.
std::optional<Entry> capsule_entry(const BallPath& path, const Ray& ray, double radius) {
  const Vector3d w = ray.point - path.start_centre;
  const Vector3d chord = path.end_centre - path.start_centre;
  const double along_ray = w.dot(ray.normal);
  const double rise = chord.dot(ray.normal);
  const Vector3d w_across = w - along_ray * ray.normal;
  const Vector3d chord_across = chord - rise * ray.normal;
  const double a = chord_across.squaredNorm();
  double x = rise < 0 ? 1.0 : 0.0;
  if (a > 0) {
    const double closest_x = w_across.dot(chord_across) / a;
    const double squared_margin =
        radius * radius - (w_across - closest_x * chord_across).squaredNorm();
    if (squared_margin < 0) return std::nullopt;
    x = std::clamp(closest_x - rise * std::sqrt(squared_margin / (a * (a + rise * rise))), 0.0,
                   1.0);
  }
  const double squared_half_chord = radius * radius - (w_across - x * chord_across).squaredNorm();
  if (squared_half_chord < 0) return std::nullopt;
  return Entry{x * rise - along_ray - std::sqrt(squared_half_chord), x};
}

/// Returns the entry into the ball on its true path, by Newton's method from `x`. Empty if the
/// entry is not strictly convex in time or the iteration does not converge.
std::optional<Entry> curved_entry(const BallPath& path, const Ray& ray, double x) {
  const double R = path.cutter.radius;
  const Vector3d chord = path.end_centre - path.start_centre;
  const double cross_speed = (chord - chord.dot(ray.normal) * ray.normal).norm();
  // The entry is convex if the centre moves across the ray faster than R angle. The margin of 10 %
  // and R angle^2 covers the difference between the chord and the velocity at any instant.
  if (cross_speed < R * path.angle * (1.1 + path.angle)) return std::nullopt;
  const double duration = path.move.to - path.move.from;
  const Vector3d step = duration * path.move.step;
  // Newton's method needs far fewer than 8 steps, or else the general search decides.
  for (int i = 0; i < 8; ++i) {
    const double t = instant(path.move, x);
    const CutterPose pose = cutter_pose(path.move, t);
    const Vector3d w = ray.point - path.centre(pose);
    const double wn = w.dot(ray.normal);
    const double squared_half_chord = R * R - (w - wn * ray.normal).squaredNorm();
    if (squared_half_chord <= 0) return std::nullopt;
    const double cosine = std::sqrt(squared_half_chord) / R;
    const double s = -wn - R * cosine;
    const Vector3d outward = (w + s * ray.normal) / R;
    const double phase = path.move.angle * t;
    const Vector3d velocity =
        step +
        R * path.angle * (std::cos(phase) * path.move.side - std::sin(phase) * path.move.axis);
    const double slope = -outward.dot(velocity) / cosine;
    const Vector3d acceleration = -R * path.angle * path.angle * pose.axis;
    const double curvature =
        ((slope * ray.normal - velocity).squaredNorm() / R - outward.dot(acceleration)) / cosine;
    if (!(curvature > 0)) return std::nullopt;
    const double next_x = std::clamp(x - slope / curvature, 0.0, 1.0);
    // s is of second order in x, so it is then within 5e-13 mm of its minimum.
    if (curvature * (next_x - x) * (next_x - x) < 1e-12) return Entry{s, x};
    x = next_x;
  }
  return std::nullopt;
}

}  // namespace

BallEntry ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit) {
  const BallPath path(cutter, move);
  const std::optional<Entry> thick_ball_entry =
      capsule_entry(path, ray, cutter.radius + path.sag());
  // The s of a grazing ray is uncertain by the square root of rounding; the wider search limit
  // makes such a ray take the same branch for every limit.
  const double search_limit = limit + 1e-6 * (1.0 + cutter.radius);
  if (!thick_ball_entry || thick_ball_entry->s > search_limit)
    return {is_below_flank(path, ray, std::min(search_limit, ray.band)), std::nullopt};
  std::optional<Entry> entry =
      path.angle == 0 ? thick_ball_entry : curved_entry(path, ray, thick_ball_entry->t);
  if (!entry || entry->s <= -ray.band || !is_below_flank(path, ray, entry->s)) return {};
  entry->t = instant(move, entry->t);
  return {true, entry};
}

// With w from `near` to the ray's point, d the direction of the chord, n that of the ray, x the
// position of the centre along d:
//   rise = d n, a = 1 - rise^2, b = w d - (w n) rise, q = w w - (w n)^2,
//   D(x) = R^2 - q + x (2 b - x a), s(x) = x rise - w n - sqrt(D(x)),
// which is convex with its minimum at x = (b - rise sqrt(a (R^2 - q + b^2 / a))) / a.
//
// Rounding. Let e = 2^-24, and M the sum of the distances of `near` and of the ray's point from the
// origin, which is above |w|; let a >= 1/2 and D >= R^2 / 4 (no bound is given elsewhere). In units
// of e: w n, w d, rise to 6 M, 6 M, 6; q to 20 M^2; b to 19 M; a to 13; D to 30 M^2 + 20 M^2 + 38 M
// |x| + 13 x^2 + 8 (q + 2 |b x| + a x^2) <= 75 M^2 + 50 x^2. The error of s is half of that divided
// by sqrt(D), plus 6 M + 8 |x| + 4 M from its other terms. So
//   doubt = e ((45 M^2 + 26 x^2) / sqrt(D) + 11 M + 9 |x|).
// The error of x itself is less than 500 e M^2 / R, and as s'' <= 10 / R it changes the least value
// by less than a tenth of `doubt` for M below 5 R. tests/cutting/ball_bounds_test.cpp searches for
// larger errors.

namespace {

// e of the derivation: 2^-24 = 5.96e-8, rounded up.
constexpr float rounding = 6e-8f;

[[gnu::always_inline]] inline Float8 entry_bound(const BallChord& move, const Vector8& p,
                                                 const Vector8& n, const Float8& ray_distance) {
  const Float8 dx(move.direction[0]), dy(move.direction[1]), dz(move.direction[2]);
  const Vector8 w{p.x - move.near[0], p.y - move.near[1], p.z - move.near[2]};
  const Float8 w2 = dot(w, w);
  const Float8 wn = dot(w, n);
  const Float8 wd = w.x * dx + w.y * dy + w.z * dz;
  const Float8 rise = n.x * dx + n.y * dy + n.z * dz;
  const float R2 = move.radius * move.radius;
  const Float8 a = 1.0f - rise * rise;
  const Float8 b = wd - wn * rise;
  const Float8 squared_at_zero = R2 - (w2 - wn * wn);
  const Float8 per_a = 1.0f / a;
  const Float8 max_squared = squared_at_zero + b * b * per_a;  // upper bound of D over all x
  const Float8 root = stdx::sqrt(stdx::max(a * max_squared, Float8(0.0f)));
  const Float8 x =
      stdx::min(stdx::max((b - rise * root) * per_a, Float8(move.from)), Float8(move.to));
  const Float8 D = squared_at_zero + x * (2.0f * b - x * a);
  const Float8 half_chord = stdx::sqrt(stdx::max(D, Float8(0.25f * R2)));
  const Float8 M = ray_distance + move.distance;
  const Float8 doubt =
      rounding * ((45.0f * M * M + 26.0f * x * x) / half_chord + 11.0f * M + 9.0f * stdx::abs(x));
  Float8 s = x * rise - wn - half_chord - doubt;
  stdx::where(!(D > 0.26f * R2) || !(a > 0.51f), s) = Float8(-1e30f);
  // The ray misses by more than a hundredth of R^2, far beyond the rounding of `max_squared`.
  stdx::where(max_squared < -0.01f * R2 && a > 0.51f, s) = Float8(1e30f);
  return s;
}

}  // namespace

BallChord::BallChord(const Cutter& cutter, const Move& move, const Vector3d& origin) {
  const CutterPose start = cutter_pose(move, move.from), end = cutter_pose(move, move.to);
  const Vector3d start_centre = start.tip + cutter.radius * start.axis - origin;
  const Vector3d chord = end.tip + cutter.radius * end.axis - origin - start_centre;
  const double length = chord.norm(), axis_turn = move.angle * (move.to - move.from);
  const Vector3d unit_chord = length > 0.0 ? Vector3d(chord / length) : Vector3d::UnitX();
  const double origin_offset = -start_centre.dot(unit_chord);
  const Vector3d nearest_point = start_centre + origin_offset * unit_chord;
  for (int d = 0; d < 3; ++d) {
    near[d] = float(nearest_point[d]);
    direction[d] = float(unit_chord[d]);
  }
  from = float(-origin_offset);
  to = float(length - origin_offset);
  distance = float(nearest_point.norm());
  // The sag of the centre's path is 0.125 turn^2; the rest covers the rounding to float.
  radius = float(cutter.radius * (1.0 + 0.126 * axis_turn * axis_turn + 1e-7));
}

std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const Ray8& rays,
                               std::span<Entry8> bounds) {
  const Vector8 p = load(rays.p), n = load(rays.n);
  const Float8 ray_distances = magnitude(p);
  Float8 first(2e30f), first_move(0.0f);
  for (std::size_t k = 0; k < moves.size(); ++k) {
    const Float8 s = entry_bound(moves[k], p, n, ray_distances);
    s.copy_to(bounds[k].min_s, stdx::vector_aligned);
    stdx::where(s < first, first_move) = Float8(float(k));
    first = stdx::min(first, s);
  }
  std::array<int, 8> nearest_moves;
  for (std::size_t i = 0; i < 8; ++i) nearest_moves[i] = int(first_move[i]);
  return nearest_moves;
}

bool is_below_centre(const Cutter& cutter, const Move& move, const Vector3d& centre,
                     double bundle_radius, const Vector3d& normal, double tilt) {
  // The axis turns by at most `angle`, so every ray still rises along it at the end of the move.
  if (normal.dot(move.axis) < tilt + move.angle) return false;
  const Vector3d from_tip = centre - move.tip;
  const double height = from_tip.dot(move.axis) - cutter.radius;
  const double rise =
      std::max(0.0, -move.step.dot(move.axis)) + move.angle * (from_tip.norm() + move.step.norm());
  return height + rise + bundle_radius < 0.0;
}

}  // namespace abbe::cutting
