#pragma once

#include "sim/compensation/course.h"

namespace abbe::sim::compensation {

/// How a position loop follows a change of its set-point. The programmed motion itself is taken as
/// fed forward; only corrections lag.
struct PositionLoop {
  enum class Order {
    None,    ///< at once
    First,   ///< 1 / (1 + s / w)
    Second,  ///< w^2 / (s^2 + 2 d w s + w^2)
  } order = Order::None;
  double bandwidth = 20.0;  ///< Hz, w / 2 pi
  double damping = 0.7;     ///< d of a second-order loop, 0.001 to 100
};

struct LoopOptions {
  int per_constant = 8;     ///< knots a time constant 1 / w while the loop still moves
  double tolerance = 1e-8;  ///< mm or rad: 0.01 nm; what moves by less is at rest
};

/// Answer of a loop that starts at rest on the first value. It has a knot at every instant of the
/// course, and while it still has more than `tolerance` to go before it follows steadily,
/// `per_constant` more a time constant, also after the last until it has settled. Its knots are
/// exact to 1e-8 of a step. Between them, where it is linear, it is off by less than
/// 1 / (3 per_constant^2) of what it has to go (8: 0.5 %; damping up to 1) or by twice the
/// tolerance. A ramp of slope v is followed v / w late (first order) or 2 d v / w (second order).
/// @throws std::invalid_argument for a course that is not valid, a bandwidth, damping, tolerance or
///         per_constant outside its range, or more knots than `Knots` takes
Course followed_by(const Course& wanted, const PositionLoop& loop, const LoopOptions& options = {});

}  // namespace abbe::sim::compensation
