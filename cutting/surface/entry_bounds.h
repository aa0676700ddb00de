#pragma once

#include <span>

#include "cutting/surface/cutter_entry.h"

/// Bounds of the first entry of rays into the moves of any cutter, eight pairs of a ray and a move
/// at a time in single precision: an estimate of the instant, and a guaranteed lower bound of s.
namespace abbe::cutting {

/// A move between its instants `from` and `to`, stored as start and change.
struct MoveEndpoints {
  Eigen::Vector3d tip, axis;        ///< mm; unit
  Eigen::Vector3d step, axis_step;  ///< change of the tip, mm, and of the axis
};
/// Returns the endpoints of a move.
MoveEndpoints move_endpoints(const Move& move);

/// Eight moves, each by the centre k of the circle of corner centres and the tool axis u.
struct alignas(32) Move8 {
  static constexpr int width = 8;
  double k[3][width];         ///< mm, at the start
  float step[3][width];       ///< mm, change of k
  float u[3][width];          ///< unit, at the start
  float axis_step[3][width];  ///< change of u

  void set_lane(int lane, const Cutter& cutter, const MoveEndpoints& move);
};

/// Eight pairs of a ray and a move.
struct alignas(32) Pair8 {
  float p[3][Move8::width];  ///< mm, from the move's k at the start to the ray's point
  float n[3][Move8::width];  ///< normal of the ray
  float step[3][Move8::width];
  float u[3][Move8::width];
  float axis_step[3][Move8::width];

  void set_lane(int lane, const Move8& moves, int move_lane, const Ray& ray);
};

/// Bounds of eight pairs.
struct alignas(32) EntryBounds {
  static constexpr int width = Move8::width;
  float min_s[width];  ///< mm along the ray, never beyond the entry; -1e30: unknown, 1e30: missed
  /// 0 .. 1, estimate of the first entry within the move's range `from` .. `to`
  float fraction[width];
  float m[3][width];  ///< unit, from the cutter to the ray at that instant
};

/// Computes the bounds of pairs of a ray and a move; all rays have the same band. The bits of a
/// lane depend on its own move and ray only.
/// @param bounds  (pairs), output
void entry_bounds(const Cutter& cutter, std::span<const Pair8> pairs, double band,
                  std::span<EntryBounds> bounds);
/// Computes the bounds of every ray for the same eight moves.
/// @param bounds  (rays), output
void entry_bounds(const Cutter& cutter, const Move8& moves, std::span<const Ray> rays,
                  std::span<EntryBounds> bounds);

/// Planes of eight moves; the cutter is behind a move's plane during the whole move.
struct alignas(32) MovePlanes {
  float m[3][Move8::width];  ///< normal, pointing away from the cutters
  float gap[Move8::width];   ///< mm times |m|, lower bound of the distance by which the ray's point
                             ///< is in front of the plane
};
/// Computes the planes that touch the moves where `ray` enters first. They also hold for
/// neighbouring rays of the same band whose points are at most `max_offset` from that of `ray` (mm,
/// the sum of the absolute values of the three coordinates).
/// @param planes  (moves), output
void move_planes(const Cutter& cutter, std::span<const Move8> moves, const Ray& ray,
                 double max_offset, std::span<MovePlanes> planes);

/// Returns the index, over all planes, of the move whose plane a neighbouring ray crosses first.
/// @param middle  the point of the ray for which the planes were computed
int nearest_plane(std::span<const MovePlanes> planes, const Eigen::Vector3d& reference_point,
                  const Ray& ray);

/// Returns a mask in which bit i is clear if the plane proves that `ray` does not enter move i
/// before `limit` (mm along the ray, within the band).
unsigned candidates_before(const MovePlanes& planes, const Eigen::Vector3d& reference_point,
                           const Ray& ray, double limit);

/// Returns a lower bound of the entry, mm along the ray, in double precision, which distinguishes
/// successive moves that single precision cannot. The bound is the plane normal to m that touches
/// the cutter at both ends of the move. Returns -infinity if the ray runs along that plane,
/// infinity if it misses the cutter.
double min_entry(const Cutter& cutter, const MoveEndpoints& move, const Ray& ray,
                 const Eigen::Vector3d& m);

}  // namespace abbe::cutting
