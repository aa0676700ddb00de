#pragma once

#include <Eigen/Core>

#include "kinematics/chain.h"

namespace abbe::kinematics {

/// Change of the tool in the workpiece, [translation of the tip | rotation vector] in the workpiece
/// frame, per unit of each axis position of the nominal chain.
/// @return (6 x size), mm and rad per mm or rad; the column of a spindle nose is zero
Eigen::MatrixXd axis_jacobian(const Chain& chain, const AxisVector& q);

/// The same per unit of each component of each joint's error motion, at zero deviations.
/// @return (6 x 6 size), joints in the order of the code, [EX EY EZ EA EB EC] within each
Eigen::MatrixXd motion_jacobian(const Chain& chain, const AxisVector& q);

/// The same for the location errors, at zero deviations. @return (6 x 6 size)
Eigen::MatrixXd location_jacobian(const Chain& chain, const AxisVector& q);

}  // namespace abbe::kinematics
