#pragma once

#include "cutting/surface/cutter_entry.h"
#include "tests/cutting/random.h"

namespace abbe::cutting {

/// A move or a part of one, of 1e-7 to 30 radii or none, that turns by 1e-9 to 0.05 rad or not.
/// @param axis()  made when it is its turn
template <class Axis>
Move any_move(Random& random, double radius, const Axis& axis) {
  Move move;
  move.tip = radius * random.in(0, 2) * random.direction();
  move.step = random.once_in(8)
                  ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                  : Eigen::Vector3d(radius * random.decades(-7, 1.5) * random.direction());
  move.axis = axis();
  move.side = move.axis.unitOrthogonal();
  move.angle = random.once_in(2) ? 0.0 : random.decades(-9, -1.3);
  if (random.once_in(4)) {
    move.from = random.in(0, 0.5);
    move.to = random.in(0.5, 1);
  }
  return move;
}

}  // namespace abbe::cutting
