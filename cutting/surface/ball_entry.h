#pragma once

#include <array>
#include <optional>
#include <span>

#include "cutting/surface/cutter_entry.h"

namespace abbe::cutting {

struct BallEntry {
  bool decided = false;
  std::optional<Entry> entry;
};

/// `first_entry` for a ball end (the common case) where its flank and top cannot matter; undecided
/// elsewhere. Which way a value is found does not depend on `limit`.
BallEntry ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit);

// Ball ends against eight rays at a time, in single precision: bounds of where they are entered,
// true to some 1e-5 mm near a ball of R 5, where only its lower half can be met.

/// A move of a ball end about an origin: its centre runs along a chord, and a ball a little thicker
/// holds what turning adds.
struct BallChord {
  float near[3];       ///< mm, the place of the chord's line that is nearest to the origin
  float direction[3];  ///< unit
  float from, to;      ///< mm, ends of the chord from there
  float radius;        ///< mm
  float distance;      ///< mm, of `near` from the origin

  BallChord() = default;
  BallChord(const Cutter& cutter, const Move& move, const Eigen::Vector3d& origin);
};

/// Eight rays about the same origin.
struct alignas(32) Ray8 {
  float p[3][8];
  float n[3][8];
};

/// Bounds of eight rays for one move.
struct alignas(32) Entry8 {
  float least[8];  ///< mm along the ray, no more than its entry; -1e30: not known, 1e30: missed
};

/// @param moves   whose `distance` and that of the rays' points come to less than five radii
/// @param bounds  (moves)
/// @return of each ray the move with the least
std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const Ray8& rays,
                               std::span<Entry8> bounds);

/// Whether no point of a ray up to a place is ever higher than the centre of the ball.
/// @param place, around  mm, all such places lie within `around` of it
/// @param normal, tilt   every ray is within an angle of it, whose tangent is `tilt`
bool stays_below_centre(const Cutter& cutter, const Move& move, const Eigen::Vector3d& place,
                        double around, const Eigen::Vector3d& normal, double tilt);

}  // namespace abbe::cutting
