#pragma once

#include <Eigen/Core>

#include "kinematics/bad_input.h"
#include "sim/program/path.h"
#include "sim/program/place.h"

namespace abbe::sim::program {

/// Words that make no arc.
struct BadGeometry : BadInput {
  using BadInput::BadInput;
  bool in_doubt = false;  ///< it may only follow from a fault before it
};

/// Centre of the arc of radius |r| from start to end: r above zero is the arc of at most half a
/// turn, below zero the other. mm.
/// @throws BadGeometry where start and end are one point, r is zero or less than half the chord
Eigen::Vector2d centre_by_radius(const ArcWords& ends, double r, const NcPlace& place,
                                 const Cause& cause);

/// The arc as the control turns it; `first` and `second` are left.
/// @param turns  begun: 1 is at most a whole turn
/// @throws BadGeometry at `cause` for a centre at an end, a radius beyond 1e6 mm, radii at start
/// and
///         end that differ more than the README of this folder says
Arc checked_arc(const ArcWords& words, int turns, const NcPlace& place, const Cause& cause);

}  // namespace abbe::sim::program
