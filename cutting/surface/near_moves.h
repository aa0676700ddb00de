#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "cutting/surface/entry_bounds.h"

/// The candidate moves of a group of neighbouring rays, and their bounds for all of these rays.
namespace abbe::cutting {

/// The candidate moves with their item numbers in a SweepTree.
struct NearMoves {
  static constexpr int capacity = 256;
  int max_count = capacity;  ///< largest `count` allowed, at most `capacity`
  int count = 0;
  std::array<int, capacity> items;
  std::array<Move, capacity> moves;
};

/// The candidate moves in groups of eight, as required by `entry_bounds`.
struct NearMoves8 {
  static constexpr int width = Move8::width, capacity = (NearMoves::capacity + width - 1) / width;
  std::array<MoveEndpoints, NearMoves::capacity> endpoints;
  std::array<Move8, capacity> groups;
  std::size_t count;  ///< number of groups

  NearMoves8(const Cutter& cutter, const NearMoves& move_count);
};

/// Planes that have the candidate moves behind them, for a few neighbouring rays.
struct NearPlanes {
  std::array<MovePlanes, NearMoves8::capacity> planes;
  std::size_t count;
  Eigen::Vector3d reference_point;  ///< point of the ray for which the planes were computed

  NearPlanes(const Cutter& cutter, const NearMoves8& moves8, std::span<const Ray> rays);
};

/// Pairs of a ray and a move that may meet; the pairs of one ray are consecutive.
struct NearPairs {
  static constexpr std::size_t width = Move8::width, capacity = 2 * NearMoves::capacity;
  std::size_t count = 0;
  std::array<int, capacity> moves;  ///< indices into NearMoves
  std::array<Pair8, capacity / width> groups;
  std::array<EntryBounds, capacity / width> bounds;

  /// Adds the moves whose planes the ray crosses before its limit.
  void add_candidates(const NearMoves8& moves8, int move_count, const NearPlanes& planes,
                      const Ray& ray, double limit);
  /// Fills the last group with copies of the last pair, then computes the bounds of all pairs.
  /// @param filler  ray of the last pair
  void compute_bounds(const NearMoves8& moves8, const Cutter& cutter, const Ray& filler);

  float min_s(std::size_t pair) const { return bounds[pair / width].min_s[pair % width]; }
  float fraction(std::size_t pair) const { return bounds[pair / width].fraction[pair % width]; }
  Eigen::Vector3d normal(std::size_t pair) const {
    const auto& m = bounds[pair / width].m;
    return {m[0][pair % width], m[1][pair % width], m[2][pair % width]};
  }

 private:
  void add(const NearMoves8& moves8, int move, const Ray& ray);
};

// These functions lower the limits of rays (mm along them) to the s at which the search would find
// that the rays meet a cutter, or to slightly more.

/// Lowers the limits to a ball end in its pose at instant t of a move.
void lower_limits_to_ball(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                          const Move& move, double t);
/// Lowers the limits to up to eight moves of any cutter.
void lower_limits_to_moves(std::span<double> limits, std::span<const Ray> rays,
                           const Cutter& cutter, std::span<const Move> moves);
/// Lowers the limit of each ray to the move whose plane it crosses first.
/// @param rays  up to eight
void lower_limits_by_planes(std::span<double> limits, std::span<const Ray> rays,
                            const Cutter& cutter, const NearMoves& move_count,
                            const NearMoves8& moves8, const NearPlanes& planes);

}  // namespace abbe::cutting
