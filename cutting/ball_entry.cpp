#include "cutting/ball_entry.h"

#include <algorithm>
#include <cmath>

#include "cutting/cutter_position.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// The centre of a ball end over a move; `x` is 0 .. 1 from `from` to `to`.
struct BallPath {
  const Cutter& cutter;
  const Move& move;
  Position start, end;
  Vector3d first, last;  // centres
  double angle;          // turned between them

  BallPath(const Cutter& c, const Move& m)
      : cutter(c),
        move(m),
        start(position(m, m.from)),
        end(position(m, m.to)),
        first(centre(start)),
        last(centre(end)),
        angle(m.angle * (m.to - m.from)) {}

  Vector3d centre(const Position& at) const { return at.tip + cutter.radius * at.axis; }
  /// The centre leaves its chord by no more: a ball thicker by it about the chord holds the sweep.
  double sag() const { return 0.125 * cutter.radius * angle * angle; }
};

/// Whether no point of the ray up to s can be higher than the centre of the ball during the move,
/// so that only the lower half of the ball can have met it.
bool stays_below_flank(const BallPath& path, const Ray& ray, double s) {
  const Vector3d place = ray.point + s * ray.normal;
  const double turned = path.angle * path.angle;
  const Vector3d w0 = place - path.first;
  const Vector3d w1 = place - path.last;
  double bend = 0.0;  // twice what a height over the tip can rise between its ends
  if (path.angle != 0) {
    const double arms = path.cutter.radius + w0.norm() + w1.norm();
    bend = 0.25 * (arms * turned + 2 * (path.last - path.first).norm() * path.angle);
  }
  return ray.normal.dot(path.start.axis) >= turned && ray.normal.dot(path.end.axis) >= turned &&
         w0.dot(path.start.axis) <= -bend && w1.dot(path.end.axis) <= -bend;
}

/// First entry of the ray's line into a ball of `radius` whose centre runs along the chord.
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

/// Entry into the ball on its true path, by Newton from `x`; only where the entry is strictly
/// convex in time. Nothing if it does not settle.
std::optional<Entry> curved_entry(const BallPath& path, const Ray& ray, double x) {
  const double R = path.cutter.radius;
  const Vector3d chord = path.last - path.first;
  const double across = (chord - chord.dot(ray.normal) * ray.normal).norm();
  if (across < R * path.angle * (1.1 + path.angle)) return std::nullopt;
  const double span = path.move.to - path.move.from;
  const Vector3d step = span * path.move.step;
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
    if (curvature * (next - x) * (next - x) < 1e-12) return Entry{s, x};
    x = next;
  }
  return std::nullopt;
}

}  // namespace

BallAnswer ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit) {
  const BallPath path(cutter, move);
  const std::optional<Entry> bound = capsule_entry(path, ray, cutter.radius + path.sag());
  // a graze is off by the root of rounding, and must be found the same way whatever the limit
  const double until = limit + 1e-6 * (1.0 + cutter.radius);
  if (!bound || bound->s > until)
    return {stays_below_flank(path, ray, std::min(until, ray.band)), std::nullopt};
  std::optional<Entry> entry = path.angle == 0 ? bound : curved_entry(path, ray, bound->t);
  if (!entry || entry->s <= -ray.band || !stays_below_flank(path, ray, entry->s)) return {};
  entry->t = instant(move, entry->t);
  return {true, entry};
}

}  // namespace abbe::cutting
