#pragma once

#include <optional>
#include <vector>

#include "kinematics/chain.h"

namespace abbe::kinematics {

enum class Reach {
  Reached,
  Singular,     ///< reached, but a rotary axis was free and keeps its previous position
  OutOfLimits,  ///< every branch that gives the direction leaves the limits of travel
  Unreachable,  ///< no rotary position gives the direction, or the slides cannot give the point
};

/// A wanted place of the tool in the workpiece.
struct TipTarget {
  Eigen::Vector3d tip_w = Eigen::Vector3d::Zero();         ///< mm
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitZ();  ///< from the tip to the spindle, of any
                                                           ///< length
};

struct InverseSolution {
  Reach reach = Reach::Unreachable;
  std::vector<AxisVector> branches;  ///< all within limits, rotary turns unwound towards
                                     ///< `previous`, the chosen one (least rotary travel) first
};

/// Axis positions that put the tip and the tool axis where they are wanted, for any chain of three
/// slides and up to two rotary axes.
/// @param previous  (size) where the axes are: chooses the branch, unwinds turns, and is kept by an
///                  axis that is free in a singular pose (brought to its limits if it lies beyond)
///                  and by the spindle nose
/// Bound: tool_in_workpiece of every branch returns the target within 1e-9 mm and 1e-12 rad over a
/// workspace of 1 m, singular poses included. Never NaN. A rotary axis counts as free where the
/// direction lies within 2e-13 rad of it (0.1 pm at 500 mm).
/// @throws std::invalid_argument if the chain has not three slides, independent at zero, or has
///         more than two rotary axes; if the target is not finite or its direction is zero; if
///         `previous` has the wrong size or is not finite
[[nodiscard]] InverseSolution inverse(const Chain& chain, const TipTarget& target,
                                      const AxisVector& previous);

/// What `inverse` puts first, at less than its cost.
struct NearestPose {
  Reach reach = Reach::Unreachable;
  AxisVector q;  ///< empty unless it is reached
};

/// The first branch of `inverse` alone, bit for bit, for long programs. @throws the same
[[nodiscard]] NearestPose nearest_inverse_solution(const Chain& chain, const TipTarget& target,
                                                   const AxisVector& previous);

/// Positions of the slides that put the tip at `tip_w` with the rotary axes as in `q`, the rest of
/// q unchanged and limits not looked at; this is what a control does under G43.4. Empty if there
/// are not three slides, independent at q, or if a number is not finite.
[[nodiscard]] std::optional<AxisVector> slides_for_tip(const Chain& chain, const AxisVector& q,
                                                       const Eigen::Vector3d& tip_w);

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
double nearest_rotary_position(const Chain& chain, const Pole& pole, const AxisVector& q,
                               const Eigen::Vector3d& direction_w);

}  // namespace abbe::kinematics
