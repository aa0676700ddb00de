#pragma once

#include <cmath>

#include <Eigen/Core>

#include "cutting/cutter_entry.h"

/// Where a cutter stands within a move; inline, for it is asked for every sample of a search.
namespace abbe::cutting {

/// The tip of a cutter and the direction of its axis.
struct Position {
  Eigen::Vector3d tip;
  Eigen::Vector3d axis;
};

/// The instant of the whole move at a part 0 .. 1 of the way `from` .. `to`.
inline double instant(const Move& move, double part) {
  return move.from + part * (move.to - move.from);
}

/// Of a move at its instant t, 0 .. 1.
inline Position position(const Move& move, double t) {
  const double x = move.angle * t;
  if (x == 0.0) return {move.tip + t * move.step, move.axis};
  double sine = 0.0;
  double cosine = 1.0;
  if (std::abs(x) < 0.06) {  // the series is exact to rounding here
    const double y = x * x;
    sine = x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72))));
    cosine = 1 - y / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90))));
  } else {
    sine = std::sin(x);
    cosine = std::cos(x);
  }
  return {move.tip + t * move.step, cosine * move.axis + sine * move.side};
}

}  // namespace abbe::cutting
