#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"

namespace abbe::kinematics {

/// Jacobian of the tool with respect to the axis positions: a column per joint, in the order of the
/// structural code.
using AxisJacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, max_joints>;

/// Returns the change of the tool in the workpiece, [translation of the tip | rotation vector] in
/// the workpiece frame, per unit of each axis position of the nominal chain.
/// @return (6 x size), mm and rad per mm or rad; the column of a spindle nose is zero
AxisJacobian axis_jacobian(const Chain& chain, const AxisVector& q);

/// Returns the change per unit of each component of each joint's error motion, at zero deviations.
/// @return (6 x 6 size), joints in the order of the code, [EX EY EZ EA EB EC] within each
Eigen::MatrixXd motion_jacobian(const Chain& chain, const AxisVector& q);

/// Returns the change per unit of each component of the location errors, at zero deviations.
/// @return (6 x 6 size)
Eigen::MatrixXd location_jacobian(const Chain& chain, const AxisVector& q);

enum class Reachability {
  Reached,
  Singular,     ///< reached, but a rotary axis is free and keeps its previous position
  OutOfLimits,  ///< every branch that gives the direction exceeds the limits of travel
  Unreachable,  ///< no rotary position gives the direction, or the slides cannot reach the point
};

/// Target pose of the tool tip in the workpiece.
struct TipTarget {
  Eigen::Vector3d tip_w = Eigen::Vector3d::Zero();         ///< mm
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitZ();  ///< from the tip to the spindle, of any
                                                           ///< length
};

struct InverseSolution {
  Reachability reach = Reachability::Unreachable;
  std::vector<AxisVector> branches;  ///< solutions within limits, rotary axes unwound towards
                                     ///< `previous`; first the one of least rotary travel
};

/// Returns the axis positions that bring tip and tool axis to the target, for any chain of three
/// slides and up to two rotary axes.
/// @param previous  (size) current positions: they choose the branch and the number of turns, and
///                  are kept by an axis that is free in a singular pose (clamped to its limits) and
///                  by the spindle nose
/// Bound: tool_in_workpiece of every branch returns the target within 1e-9 mm and 1e-12 rad over a
/// workspace of 1 m, singular poses included. Never NaN. A rotary axis counts as free if the
/// direction lies within 2e-13 rad of it (0.1 pm at 500 mm).
/// @throws std::invalid_argument if the chain does not have three slides, independent at zero, or
///         has more than two rotary axes; if the target is not finite or its direction is zero; if
///         `previous` has the wrong size or is not finite
[[nodiscard]] InverseSolution inverse(const Chain& chain, const TipTarget& target,
                                      const AxisVector& previous);

/// Axis positions of least rotary travel for a target.
struct NearestPose {
  Reachability reach = Reachability::Unreachable;
  AxisVector q;  ///< empty unless reached
};

/// Returns the first branch of `inverse`, bit for bit, at lower cost; for long programs.
/// @throws as `inverse`
[[nodiscard]] NearestPose solve_nearest_pose(const Chain& chain, const TipTarget& target,
                                             const AxisVector& previous);

/// Returns q with its slides set such that the tip is at `tip_w`; rotary axes are unchanged and
/// limits are not checked. This is what a control does under G43.4. Empty if there are not three
/// slides, independent at q, or if a number is not finite.
[[nodiscard]] std::optional<AxisVector> solve_slides(const Chain& chain, const AxisVector& q,
                                                     const Eigen::Vector3d& tip_w);

/// The pole of a chain of two rotary axes: the tool lies along the axis that is nearer to the
/// workpiece in the structural code, so turning that axis does not turn the tool.
struct Pole {
  int axis = 0;        ///< joint that is free at the pole
  int other = 0;       ///< the other rotary joint, which alone leads to the pole and away from it
  double at = 0.0;     ///< rad, position of `other` at which the tool is nearest to the direction
                       ///< of `axis`; half a turn later it is nearest to the opposite direction
  double angle = 0.0;  ///< rad, between the tool and the line of `axis`, 0 .. pi/2
};

/// Returns the pole and the smallest angle to it while the axes move linearly from one position to
/// another, both ends included. Empty unless the chain has two rotary axes, the tool is not
/// parallel to the second, and the two are not parallel to each other.
/// Bound: `angle` within 1e-14 rad; 1e-15 if the path leads through the pole of a machine whose
/// axes and tool are square to 1e-15.
/// @param from, to  (size) only the rotary axes are used
std::optional<Pole> nearest_pole(const Chain& chain, const AxisVector& from, const AxisVector& to);

/// Returns the position of `pole.other` that turns the tool as near as possible to a direction
/// while `pole.axis` does not move.
/// @param q            (size) only `pole.axis` is used
/// @param direction_w  of any length but zero
double nearest_rotary_position(const Chain& chain, const Pole& pole, const AxisVector& q,
                               const Eigen::Vector3d& direction_w);

}  // namespace abbe::kinematics
