#pragma once

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

}  // namespace abbe::kinematics
