#pragma once

#include <array>
#include <optional>
#include <span>

#include "cutting/surface/cutter_entry.h"

/// Entry of rays into the sweep of a ball end: the first entry in closed form, and lower bounds of
/// it for eight rays at a time in single precision.
namespace abbe::cutting {

/// Result of `ball_entry`: `entry` is meaningful only if `is_decided` is true.
struct BallEntry {
  bool is_decided = false;
  std::optional<Entry> entry;
};

/// Computes `first_entry` for a ball end (the common case) if neither flank nor top can be met
/// first; otherwise returns an undecided result. `limit` does not change the method by which a
/// value is computed.
BallEntry ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit);

// Bounds for ball ends and eight rays at a time, in single precision. They are accurate to some
// 1e-5 mm near a ball of R 5, and hold where the rays can only meet its lower half.

/// A move of a ball end relative to an origin. The centre runs along a chord, and the ball is
/// slightly thicker than the real one so that it also contains the arc due to a turning axis.
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
  float min_s[8];  ///< mm along the ray, never beyond its entry; -1e30: unknown, 1e30: missed
};

/// Computes the bounds of eight rays for every move.
/// @param moves   a move's `distance` plus the distance of any ray's point from the origin must be
///                below five radii
/// @param bounds  (moves), output
/// @return for each ray the index of the move with the least bound
std::array<int, 8> ball_bounds(std::span<const BallChord> moves, const Ray8& rays,
                               std::span<Entry8> bounds);

/// Returns true if all rays of a bundle stay below the ball's centre up to their ends during the
/// move.
/// @param centre, bundle_radius  mm, ball that contains all ray ends
/// @param normal, tilt   unit, and the tangent of the largest angle between `normal` and a ray
bool is_below_centre(const Cutter& cutter, const Move& move, const Eigen::Vector3d& centre,
                     double bundle_radius, const Eigen::Vector3d& normal, double tilt);

}  // namespace abbe::cutting
