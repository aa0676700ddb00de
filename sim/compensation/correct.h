#pragma once

#include <bitset>
#include <functional>

#include "kinematics/chain.h"

/// A compensator is a belief, a strategy and a channel. This folder never sees the truth: a belief
/// is whatever somebody handed over, and says where the tool really goes.
namespace abbe::sim::compensation {

/// Where the tool is believed to be in the workpiece, T_wt, when the axes are commanded so.
using Belief = std::function<kinematics::Pose(const kinematics::AxisState&)>;

enum class Strategy {
  Position,   ///< slides only, one step, tip on its place
  Decoupled,  ///< rotary axes restore the direction, then the slides the point, one step (Yang
              ///< 2012)
  Iterated,   ///< the same until nothing moves
};

struct CorrectOptions {
  Strategy strategy = Strategy::Iterated;
  double rotary_bound = 1.7453292519943296e-3;  ///< rad, no rotary correction is larger (0.1 deg)
  double singular_sine = 0.02;     ///< a way of leaning the tool in which the turns move it less
                                   ///< than this, rad per rad, is damped: it fades out towards the
                                   ///< pole, and no turn exceeds 1.21 / this times the lean
  double functional_height = 0.0;  ///< mm above the tip of the point that the slides restore when
                                   ///< directions are corrected too: a ball's centre, a corner's
  std::bitset<kinematics::max_joints> still;  ///< joints that are never corrected: the workpiece
                                              ///< spindle, what the channel cannot move
  int max_iterations = 30;
};

/// A corrected command and what it could not reach, by the belief at that very command.
struct Correction {
  kinematics::AxisVector q;     ///< (joints)
  double point_left = 0.0;      ///< mm between the functional point and where it should be
  double direction_left = 0.0;  ///< rad between the tool axis and where it should point
  bool converged = true;  ///< iterated: the axes could correct less than 0.01 nm and 1e-12 rad
};

/// Command that brings the tool, as believed, to where the nominal machine would have it. The turns
/// serve the direction, within their bound; the slides serve the point, in the direction that is
/// really reached. What the joints that may move cannot do is left, by least squares. One step
/// leaves besides an error of second order in the deviations, iterated it does not. A belief that
/// is no number corrects nothing: the command as it was, everything left, not converged.
/// @param control  chain whose Jacobian the control knows
/// @param T_wt     where the tool should be
/// @param command  where the axes would have gone; its time and direction of motion go to the
///                 belief
/// Cost: two beliefs a correction, three or four if iterated, and half a microsecond.
/// Source: decoupling after Yang 2012; damping after Nakamura and Hanafusa 1986, equation 15, of
/// the weak ways alone.
Correction correct(const kinematics::Chain& control, const Belief& belief,
                   const kinematics::Pose& T_wt, const kinematics::AxisState& command,
                   const CorrectOptions& options = {});

}  // namespace abbe::sim::compensation
