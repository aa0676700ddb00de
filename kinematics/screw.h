#pragma once

#include "kinematics/pose.h"

namespace abbe::kinematics {

/// A motion at a constant rate about and along one line: what a joint alone does, and what two
/// joints do together to second order. Its velocity is constant in the frame that moves.
struct Screw {
  Pose start = Pose::Identity();                     ///< at u = 0
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();    ///< rad, rotation vector of the whole motion
  Eigen::Vector3d travel = Eigen::Vector3d::Zero();  ///< mm, of the origin, at its rate at u = 0
};

/// The screw from one pose at u = 0 to another at u = 1, by at most half a turn.
Screw screw_between(const Pose& from, const Pose& to);

/// Where the frame is; u need not be within 0 to 1. To 1e-14 of
/// the distances that the poses have.
Pose pose_at(const Screw& screw, double u);

/// mm per unit of u: as fast as a point can be that lies within `radius` of `centre`, both in the
/// frame that moves.
double fastest(const Screw& screw, const Eigen::Vector3d& centre, double radius);

}  // namespace abbe::kinematics
