#pragma once

#include <array>
#include <optional>
#include <span>

#include "cutting/surface/cutter_entry.h"

/// Ball ends against rays: the first entry in closed form, and lower bounds of it for eight rays at
/// a time in single precision.
namespace abbe::cutting {

/// Result of `ball_entry`: `entry` is meaningful only if `decided` is true.
struct BallEntry {
  bool decided = false;
  std::optional<Entry> entry;
};

/// Computes `first_entry` for a ball end (the common case) where neither its flank nor its top can
/// matter; returns an undecided result elsewhere. The method by which a value is computed does not
/// depend on `limit`.
BallEntry ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit);

// Bounds for ball ends against eight rays at a time, in single precision. They are true to some
// 1e-5 mm near a ball of R 5, where only its lower half can be met.

/// A move of a ball end about an origin. Its centre runs along a chord; the ball is a little
/// thicker than the real one, so that it also contains the arc of a turning axis.
struct BallChord {
  float near[3];       ///< mm, the point of the chord's line nearest to the origin
  float direction[3];  ///< unit
  float from, to;      ///< mm, ends of the chord, measured from `near`
  float radius;        ///< mm, of the thickened ball
  float distance;      ///< mm, from the origin to `near`

  BallChord() = default;
  BallChord(const Cutter& cutter, const Move& move, const Eigen::Vector3d& origin);
};

/// Eight rays about the same origin: their points p (mm) and unit normals n.
struct alignas(32) Ray8 {
  float p[3][8];
  float n[3][8];
};

/// Lower bounds of the entries of eight rays into one move.
struct alignas(32) Entry8 {
  float least[8];  ///< mm along the ray, never beyond its entry; -1e30: not known, 1e30: missed
};

/// Computes the bounds of eight rays for every move.
/// @param moves   the sum of a move's `distance` and the distance of each ray's point from the
///               origin must be below five radii
/// @param bounds  (moves), output
/// @return for each ray the index of the move with the least bound
std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const Ray8& rays,
                               std::span<Entry8> bounds);

/// Returns true if no point of any ray up to its end is ever higher than the centre of the ball.
/// @param place, around  mm, all ends lie within `around` of `place`
/// @param normal, tilt   every ray is within an angle of `normal`, whose tangent is `tilt`
bool stays_below_centre(const Cutter& cutter, const Move& move, const Eigen::Vector3d& place,
                        double around, const Eigen::Vector3d& normal, double tilt);

}  // namespace abbe::cutting
