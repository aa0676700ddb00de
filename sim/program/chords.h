#pragma once

#include <cstddef>

#include "kinematics/chain.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Sum of the turns of the positioned rotary axes in a block, rad; of a cubic at most.
double turn_in(const Path& path, const Block& block, const kinematics::Chain& control);

/// Chords of a block at most: some 10 s of work.
inline constexpr double max_chords = 2e7;

/// Equal parts of a block in each of which neither the slides nor the tip in the workpiece leave
/// the straight line between its ends by more than `within`, mm.
/// @throws BadInput naming the line where more than `max_chords` are needed
/// Bound: a second derivative of at most b leaves a chord of 1/n by b / 8 n^2, with
/// b = lever turn^2 + 2 way turn + way turn^2 + what arcs and cubics bend.
std::size_t chords_of(const Path& path, const Block& block, const kinematics::Chain& control,
                      double within);

}  // namespace abbe::sim::program
