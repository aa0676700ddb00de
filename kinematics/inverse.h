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

struct InverseResult {
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
[[nodiscard]] InverseResult inverse(const Chain& chain, const TipTarget& target,
                                    const AxisVector& previous);

/// What `inverse` puts first, at less than its cost.
struct NearestPose {
  Reach reach = Reach::Unreachable;
  AxisVector q;  ///< empty unless it is reached
};

/// The first branch of `inverse` alone, bit for bit, for long programs. @throws the same
[[nodiscard]] NearestPose nearest_inverse(const Chain& chain, const TipTarget& target,
                                          const AxisVector& previous);

/// Positions of the slides that put the tip at `tip_w` with the rotary axes as in `q`, the rest of
/// q unchanged and limits not looked at; this is what a control does under G43.4. Empty if there
/// are not three slides, independent at q, or if a number is not finite.
[[nodiscard]] std::optional<AxisVector> slides_for_tip(const Chain& chain, const AxisVector& q,
                                                       const Eigen::Vector3d& tip_w);

}  // namespace abbe::kinematics
