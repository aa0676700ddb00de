#include "sim/spindle_line.h"

namespace abbe::sim {

SpindleLine spindle_line(const kinematics::Chain& chain, int joint) {
  const kinematics::Pose T_wb = chain.T_bw_home().inverse();
  return {T_wb * chain.joints()[std::size_t(joint)].point_b,
          T_wb.linear() * chain.joints()[std::size_t(joint)].direction_b};
}

kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt) {
  const Eigen::Matrix3d back =
      Eigen::AngleAxisd(-spindle_angle, line.direction_w).toRotationMatrix();
  kinematics::Pose T = T_wt;
  T.linear() = back * T_wt.linear();
  T.translation() = line.point_w + back * (T_wt.translation() - line.point_w);
  return T;
}

}  // namespace abbe::sim
