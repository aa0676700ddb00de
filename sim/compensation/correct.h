#pragma once

#include <bitset>
#include <functional>

#include "kinematics/chain.h"

/// Correction of commands with a belief and a strategy. This folder never sees the truth: a belief
/// is any function that predicts the actual pose of the tool.
namespace abbe::sim::compensation {

/// Returns the believed pose T_wt of the tool in the workpiece at commanded axes.
using Belief = std::function<kinematics::Pose(const kinematics::AxisState&)>;

/// Strategies of correction.
enum class Strategy {
  Position,  ///< slides only, one step; restores the tip
  /// One step: rotary axes restore the direction, then slides restore the point (Yang 2012).
  Decoupled,
  Iterated,  ///< as Decoupled, repeated until no axis moves
};

/// Options of a correction.
struct CorrectOptions {
  Strategy strategy = Strategy::Iterated;
  double rotary_bound = 1.7453292519943296e-3;  ///< rad, limit of a rotary correction (0.1 deg)
  /// A direction of tilt in which the rotary axes move the tool by less than this, rad per rad, is
  /// damped: its correction fades out towards the pole, and no rotary correction exceeds 1.21 times
  /// the tilt divided by this.
  double min_tilt_ratio = 0.02;
  /// mm, height above the tip of the point that the slides restore if directions are corrected too:
  /// the centre of a ball or of a corner.
  double functional_height = 0.0;
  /// Joints that are never corrected: the workpiece spindle, and those that the channel cannot
  /// move.
  std::bitset<kinematics::max_joints> fixed_joints;
  int max_iterations = 30;
};

/// A corrected command and its remaining errors, by the belief at that command.
struct Correction {
  kinematics::AxisVector q;            ///< (joints)
  double remaining_point_error = 0.0;  ///< mm, from the functional point to its nominal position
  double remaining_direction_error = 0.0;  ///< rad, between the tool axis and its nominal direction
  bool converged = true;  ///< if iterated: the next step is below 0.01 nm and 1e-12 rad
};

/// Returns the command that brings the believed tool to its nominal pose. The rotary axes restore
/// the direction, within their bound; the slides restore the point, with the direction actually
/// reached. Errors that the movable joints cannot correct remain, minimised by least squares. A
/// single step also leaves an error of second order in the deviations, which iteration removes. If
/// the belief is not a number, the command is unchanged, the errors are infinite, and the
/// correction has not converged.
/// @param control  chain whose Jacobian the control knows
/// @param T_wt     nominal pose of the tool
/// @param command  uncorrected axis positions; their time and direction of motion are passed to the
///     belief
/// Cost: two evaluations of the belief, three or four if iterated, and half a microsecond.
/// Source: decoupling after Yang 2012; damping after Nakamura and Hanafusa 1986, equation 15,
/// applied to the weak directions only.
Correction correct(const kinematics::Chain& control, const Belief& belief,
                   const kinematics::Pose& T_wt, const kinematics::AxisState& command,
                   const CorrectOptions& options = {});

}  // namespace abbe::sim::compensation
