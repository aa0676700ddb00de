#pragma once

#include <string>

#include "kinematics/chain.h"
#include "sim/machine/truth.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// The machine of a scene with all that is wrong with it, standing still: no program runs, nothing
/// is cut, no datum is touched off. Heat comes from the history before the program; after time 0
/// its last phase goes on.
struct IdleMachine {
  Scene scene;  ///< run-out of a tool spindle counted into the tool
  Machine machine;
  Truth truth;
};

/// @throws BadInput as `compile` and `truth_of`
IdleMachine idle_machine(const Scene& scene);

/// Where the tool should be and where it is, T_wt.
struct TipPose {
  kinematics::Pose nominal;
  kinematics::Pose actual;

  Eigen::Vector3d deviation() const { return actual.translation() - nominal.translation(); }
  /// Of the tool axis, a unit vector from the tip to the spindle: rad across it.
  Eigen::Vector3d direction() const { return actual.linear().col(2) - nominal.linear().col(2); }
};

/// @throws std::out_of_range naming the element where a table that refuses is left
TipPose tip_pose(const IdleMachine& idle, const kinematics::AxisState& state);

/// Whether a joint has positions to be commanded, which the nose s has not.
bool is_positioned(const kinematics::Joint& joint);

/// "X A C", the axes that can be positioned.
std::string axis_names(const kinematics::Chain& chain);

/// mm of a slide, degrees of a turn, in which positions are said; and the name of that unit.
double position_unit(const kinematics::Joint& joint);
const char* position_word(const kinematics::Joint& joint);

/// "X between -300 and 300 mm"
std::string travel_text(const kinematics::Joint& joint);

}  // namespace abbe::sim
