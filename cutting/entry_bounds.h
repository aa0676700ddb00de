#pragma once

#include "cutting/cutter_entry.h"

/// Any cutter, several moves at a time against a ray, in single precision: about when it is entered
/// first, and a bound that holds.
namespace abbe::cutting {

/// A move from `from` to `to`, by its ends.
struct MoveEnds {
  Eigen::Vector3d tip, axis;   ///< mm; unit
  Eigen::Vector3d step, turn;  ///< of the tip, mm, and of the axis
};
MoveEnds ends_of(const Move& move);

/// Moves by the centre k of the corner circle's plane and the axis u; 8 or 16.
template <int lanes>
struct alignas(32) MoveLanes {
  double k[3][lanes];    ///< mm, at the start
  float step[3][lanes];  ///< mm, of k
  float u[3][lanes];     ///< at the start
  float turn[3][lanes];  ///< of u

  void put(int lane, const Cutter& cutter, const MoveEnds& move);
};

template <int lanes>
struct alignas(32) EntryBounds {
  float least[lanes];  ///< mm along the ray, no more than the entry; -1e30: not known, 1e30: missed
  float part[lanes];   ///< 0 .. 1, about when it is entered first, of the move from `from` to `to`
  float m[3][lanes];   ///< from the cutter to the ray there, unit
};

/// A lane depends on its own move alone, bit for bit, however many there are.
template <int lanes>
EntryBounds<lanes> entry_bounds(const Cutter& cutter, const MoveLanes<lanes>& moves,
                                const Ray& ray);

/// mm along the ray, no more than the entry, in double precision, where moves that lie closer than
/// the others can distinguish follow each other: by the plane across m that touches the cutter at
/// both ends. -infinity where the ray runs along that plane, infinity where it passes by.
double least_entry(const Cutter& cutter, const MoveEnds& move, const Ray& ray,
                   const Eigen::Vector3d& m);

/// Of one move.
EntryBounds<1> entry_bounds(const Cutter& cutter, const MoveEnds& move, const Ray& ray);

}  // namespace abbe::cutting
