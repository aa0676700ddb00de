#pragma once

#include "kinematics/chain.h"
#include "sim/program/path.h"

/// What the axes do in a block.
namespace abbe::sim::program {

/// Axis positions with the slides that bring the tip to a place of the workpiece, under a tip mode.
/// @param programmed  (axes) of which the rotary ones count
/// @throws BadInput naming the line where they do not reach it
kinematics::AxisVector with_slides_for(const Path& path, const Block& block,
                                       const kinematics::Chain& control,
                                       const kinematics::AxisVector& programmed,
                                       const Eigen::Vector3d& tip_w);

/// Axis positions at fraction u of a block; under a tip mode the slides are those that bring the
/// tip there.
/// @throws BadInput naming the line where they do not reach it
kinematics::AxisVector axes_at(const Path& path, const Block& block,
                               const kinematics::Chain& control, double u);

/// Largest first, second and third derivative of one coordinate over u in [0, 1].
struct Bends {
  double first = 0.0, second = 0.0, third = 0.0;
};
Bends bends(const Path& path, const Block& block, int j);

}  // namespace abbe::sim::program
