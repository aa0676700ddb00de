#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/mesh.h"

namespace abbe::cutting {

/// Actual motion of a milling cutter in the workpiece: poses at instants; between two of them the
/// tip moves on a line and the axis on a great circle, both in proportion to time.
struct CutterMotion {
  Points tip;              ///< (n x 3) mm
  Points axis;             ///< (n x 3) unit, from the tip to the spindle
  Eigen::VectorXd time_s;  ///< (n) not decreasing; equal instants are a jump, and it cuts
  std::vector<int> line;   ///< (n) program line of the move that ENDS at this sample
};

/// Actual motion of a turning tool seen from the spindle that carries the workpiece. The slow pose
/// is the tool in the workpiece turned back by the spindle angle; between samples its origin moves
/// on a line, its rotation turns at constant rate, the spindle angle grows in proportion to time.
/// The tool in the workpiece is turn(spindle angle about the spindle line) * slow pose.
struct NoseMotion {
  std::vector<Eigen::Isometry3d> T_slow;                         ///< (n)
  Eigen::VectorXd spindle;                                       ///< (n) rad, unwrapped
  Eigen::VectorXd time_s;                                        ///< (n) strictly increasing
  std::vector<int> line;                                         ///< (n) as above
  Eigen::Vector3d spindle_point = Eigen::Vector3d::Zero();       ///< mm, workpiece frame
  Eigen::Vector3d spindle_direction = Eigen::Vector3d::UnitX();  ///< unit, workpiece frame
};

}  // namespace abbe::cutting
