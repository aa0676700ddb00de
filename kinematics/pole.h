#pragma once

#include <optional>

#include "kinematics/chain.h"

namespace abbe::kinematics {

/// A pole of a chain of two rotary axes: where the tool lies along the one nearer to the workpiece
/// in the structural code, so that turning it does not turn the tool.
struct Pole {
  int axis = 0;        ///< joint that is free there
  int other = 0;       ///< the other rotary joint, which alone leads to it and away from it
  double at = 0.0;     ///< rad, position of `other` at which the tool is nearest to the line of
                       ///< `axis` in its own direction; half a turn on, to the opposite one
  double angle = 0.0;  ///< rad, of the tool to the line of `axis`, 0 .. pi/2
};

/// How near the tool comes to the pole while the axes go from one position to another in
/// proportion, both ends included. None unless the chain has two rotary axes, the tool leaves the
/// line of the second, and that of the first is not parallel to it.
/// Bound: `angle` within 1e-14 rad; where the way leads through the pole of a machine whose axes
/// and tool are at right angles to 1e-15, 1e-15.
/// @param from, to  (size) of which the rotary axes count
std::optional<Pole> nearest_pole(const Chain& chain, const AxisVector& from, const AxisVector& to);

/// The position of `pole.other` that turns the tool nearest to a direction while `pole.axis` stays.
/// @param q  (size) of which `pole.axis` counts  @param direction_w  of any length but zero
double nearest_turn(const Chain& chain, const Pole& pole, const AxisVector& q,
                    const Eigen::Vector3d& direction_w);

}  // namespace abbe::kinematics
