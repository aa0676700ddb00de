#pragma once

#include <span>

#include "cutting/surface/cutter_entry.h"

/// Any cutter, several moves at a time against a ray, in single precision: about when it is entered
/// first, and a bound that holds.
namespace abbe::cutting {

/// A move from `from` to `to`, by its ends.
struct MoveEndpoints {
  Eigen::Vector3d tip, axis;   ///< mm; unit
  Eigen::Vector3d step, turn;  ///< of the tip, mm, and of the axis
};
MoveEndpoints ends_of(const Move& move);

/// Eight moves by the centre k of the corner circle's plane and the axis u.
struct alignas(32) Move8 {
  static constexpr int width = 8;
  double k[3][width];    ///< mm, at the start
  float step[3][width];  ///< mm, of k
  float u[3][width];     ///< at the start
  float turn[3][width];  ///< of u

  void put(int lane, const Cutter& cutter, const MoveEndpoints& move);
};

/// Eight pairs of a ray and a move.
struct alignas(32) Pair8 {
  float p[3][Move8::width];  ///< mm, of the ray's point from the move's k at the start
  float n[3][Move8::width];  ///< normal of the ray
  float step[3][Move8::width];
  float u[3][Move8::width];
  float turn[3][Move8::width];

  void put(int lane, const Move8& moves, int its_lane, const Ray& ray);
};

struct alignas(32) EntryBounds {
  static constexpr int width = Move8::width;
  float least[width];  ///< mm along the ray, no more than the entry; -1e30: not known, 1e30: missed
  float part[width];   ///< 0 .. 1, about when it is entered first, of the move from `from` to `to`
  float m[3][width];   ///< from the cutter to the ray there, unit
};

/// Bounds of rays, all of one band, against moves. A lane depends on its own move and ray alone,
/// bit for bit.
/// @param bounds  (pairs)
void entry_bounds(const Cutter& cutter, std::span<const Pair8> pairs, double band,
                  std::span<EntryBounds> bounds);
/// The same of every ray against all of eight moves.
/// @param bounds  (rays)
void entry_bounds(const Cutter& cutter, const Move8& moves, std::span<const Ray> rays,
                  std::span<EntryBounds> bounds);

/// Planes that have all of a move's cutters behind them, for eight moves.
struct alignas(32) MovePlanes {
  float m[3][Move8::width];  ///< normal, away from the cutters
  float gap[Move8::width];   ///< mm times |m|, by which the ray's point is in front of the
                             ///< plane, at least
};
/// Those that touch the moves where `ray` enters first, good for rays beside it of the same band:
/// their points are no farther from its point than `around` (mm, the sum of three coordinates).
/// @param planes  (moves)
void move_planes(const Cutter& cutter, std::span<const Move8> moves, const Ray& ray, double around,
                 std::span<MovePlanes> planes);

/// The number, counted through all eights, of the move whose plane a ray beside comes to first.
/// @param middle  the point of the ray that the planes are of
int nearest_plane(std::span<const MovePlanes> planes, const Eigen::Vector3d& middle,
                  const Ray& ray);

/// Bit i is set unless `ray` enters move i nowhere before `limit` (mm along it, within the band).
unsigned open_before(const MovePlanes& planes, const Eigen::Vector3d& middle, const Ray& ray,
                     double limit);

/// mm along the ray, no more than the entry, in double precision, where moves that lie closer than
/// the others can distinguish follow each other: by the plane across m that touches the cutter at
/// both ends. -infinity where the ray runs along that plane, infinity where it passes by.
double min_entry(const Cutter& cutter, const MoveEndpoints& move, const Ray& ray,
                 const Eigen::Vector3d& m);

}  // namespace abbe::cutting
