#include "sim/program/block_axes.h"

#include <algorithm>
#include <cmath>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;

AxisVector with_slides_for(const Path& path, const Block& block, const Chain& control,
                           const AxisVector& programmed, const Eigen::Vector3d& tip_w) {
  const auto q = slides_for_tip(control, programmed, tip_w);
  if (!q)
    throw BadInput(path.file, block.line, 0, "slides that reach the tip",
                   "a tip out of their reach");
  return *q;
}

AxisVector axes_at(const Path& path, const Block& block, const Chain& control, double u) {
  AxisVector programmed = position(path, block, u);
  if (block.coordinates == Coordinates::Axis) return programmed;
  const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
  if (!x || !y || !z)
    throw BadInput(path.file, block.line, 0, "a machine with X Y Z for a tip mode", "another");
  return with_slides_for(path, block, control, programmed,
                         {programmed[*x], programmed[*y], programmed[*z]});
}

Bends bends(const Path& path, const Block& block, int j) {
  const double way = block.end[j] - block.start[j];
  if (block.interpolation != Interpolation::Cubic) return {std::abs(way), 0.0, 0.0};
  const double duration = block.end_s - block.start_s;
  const Cubic& cubic = path.cubics[block.shape];
  const double v0 = cubic.start_velocity[j] * duration, v1 = cubic.end_velocity[j] * duration;
  const double middle = 3 * way - v0 - v1;  // Bezier coefficients of the first derivative
  return {std::max({std::abs(v0), std::abs(middle), std::abs(v1)}),
          2 * std::max(std::abs(middle - v0), std::abs(v1 - middle)),
          2 * std::abs(v0 - 2 * middle + v1)};
}

}  // namespace abbe::sim::program
