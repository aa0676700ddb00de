#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "cutting/surface/entry_bounds.h"

/// The candidate moves of a group of neighbouring rays, bounded against all of the rays at a time.
namespace abbe::cutting {

/// The candidate moves, with their indices in a SweepTree.
struct NearMoves {
  static constexpr int room = 256;
  int most = room;  ///< largest permitted `count`
  int count = 0;
  std::array<int, room> items;
  std::array<Move, room> moves;
};

/// The candidate moves in the form in which `entry_bounds` takes them.
struct NearMoves8 {
  static constexpr int width = Move8::width, room = (NearMoves::room + width - 1) / width;
  std::array<MoveEndpoints, NearMoves::room> ends;
  std::array<Move8, room> eights;
  std::size_t count;  ///< number of eights

  NearMoves8(const Cutter& cutter, const NearMoves& near);
};

/// Planes behind which the candidate moves lie, for a few neighbouring rays.
struct NearPlanes {
  std::array<MovePlanes, NearMoves8::room> planes;
  std::size_t count;
  Eigen::Vector3d middle;  ///< point of the ray for which the planes were computed

  NearPlanes(const Cutter& cutter, const NearMoves8& all, std::span<const Ray> rays);
};

/// Pairs of a ray and a move that may meet; those of one ray are consecutive.
struct NearPairs {
  static constexpr std::size_t width = Move8::width, room = 2 * NearMoves::room;
  std::size_t count = 0;
  std::array<int, room> moves;  ///< indices into NearMoves
  std::array<Pair8, room / width> eights;
  std::array<EntryBounds, room / width> bounds;

  /// Adds the moves whose planes the ray passes before its limit.
  void add_open(const NearMoves8& all, int near, const NearPlanes& planes, const Ray& ray,
                double limit);
  /// Repeats the last pair until the last eight is full, then computes the bounds of all pairs.
  void bound(const NearMoves8& all, const Cutter& cutter, const Ray& last);

  float least(std::size_t pair) const { return bounds[pair / width].least[pair % width]; }
  float part(std::size_t pair) const { return bounds[pair / width].part[pair % width]; }
  Eigen::Vector3d away(std::size_t pair) const {
    const auto& m = bounds[pair / width].m;
    return {m[0][pair % width], m[1][pair % width], m[2][pair % width]};
  }

 private:
  void add(const NearMoves8& all, int move, const Ray& ray);
};

// Each of these lowers the rays' limits (mm along them) to the s at which the search would find
// that they meet a cutter, or slightly beyond.

/// Uses a ball end standing still at instant t of a move.
void lower_to_ball(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                   const Move& move, double t);
/// Uses up to eight moves of any cutter.
void lower_to_eight(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                    std::span<const Move> moves);
/// Uses, for each ray, the move whose plane it comes to first.
/// @param rays  up to eight
void lower_by_planes(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                     const NearMoves& near, const NearMoves8& all, const NearPlanes& planes);

}  // namespace abbe::cutting
