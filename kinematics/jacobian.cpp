#include "kinematics/jacobian.h"

#include <array>

#include "kinematics/frame.h"

namespace abbe::kinematics {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The chain from workpiece to tool, cut before and after every joint: T[i] maps the bed frame at
// zero to the workpiece frame after the motion of all joints before i, in the order of the code. In
// this order both sides turn by the command itself, since the workpiece side is inverted.
struct ChainFrames {
  std::array<Frame, max_joints + 1> T;  // size + 1 are used
  Eigen::Vector3d tip_w;
};

ChainFrames cuts(const Chain& chain, const AxisVector& q) {
  ChainFrames result;
  Frame T = inverse(to_frame(chain.T_bw_home()));
  result.T[0] = T;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    T = T * moved(identity_frame(), joint, joint.direction_b, q[i]);
    result.T[std::size_t(i) + 1] = T;
  }
  result.tip_w = placed(T, chain.T_bt_home().translation());
  return result;
}

// Returns the effect on the tool of a small [translation | rotation] at `point_b`, inserted into
// the chain at T.
Matrix6 transport(const Pose& T, const Eigen::Vector3d& point_b, const Eigen::Vector3d& tip_w) {
  Matrix6 M = Matrix6::Zero();
  M.topLeftCorner<3, 3>() = T.linear();
  M.topRightCorner<3, 3>() = -cross_matrix(tip_w - T * point_b) * T.linear();
  M.bottomRightCorner<3, 3>() = T.linear();
  return M;
}

// Returns the effect of a displacement of joint i. It precedes the motion of the carriage in the
// order from the bed outwards; a chain from workpiece to tool meets the workpiece side reversed and
// inverted.
Matrix6 displaced(const ChainFrames& cut, const Joint& joint, int i, bool before_motion) {
  const bool primed = joint.side == Side::Workpiece;
  const Pose T = to_pose(cut.T[std::size_t(before_motion == primed ? i + 1 : i)]);
  return (primed ? -1.0 : 1.0) * transport(T, joint.point_b, cut.tip_w);
}

// Returns the effect of rotations of the direction of travel alone.
Eigen::Matrix<double, 6, 3> travel_rotation_columns(const ChainFrames& cut, const Joint& joint,
                                                    int i, double q) {
  Eigen::Matrix<double, 6, 3> M = Eigen::Matrix<double, 6, 3>::Zero();
  const Pose T = to_pose(cut.T[std::size_t(i)]);
  if (joint.motion == Motion::Linear)
    M.topRows<3>() = -q * T.linear() * cross_matrix(joint.direction_b);
  if (joint.motion == Motion::Rotary)  // turned axis, motion, turned back: the difference before
                                       // and after the motion
    M = (transport(T, joint.point_b, cut.tip_w) -
         transport(to_pose(cut.T[std::size_t(i) + 1]), joint.point_b, cut.tip_w))
            .rightCols<3>();
  return M;
}

}  // namespace

AxisJacobian axis_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames cut = cuts(chain, q);
  AxisJacobian J = AxisJacobian::Zero(6, chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Frame& T = cut.T[std::size_t(i)];
    const Eigen::Vector3d direction_w = vector(turned(T, joint.direction_b));
    if (joint.motion == Motion::Linear) J.col(i).head<3>() = direction_w;
    if (joint.motion == Motion::Rotary)
      J.col(i) << direction_w.cross(cut.tip_w - placed(T, joint.point_b)), direction_w;
  }
  return J;
}

Eigen::MatrixXd motion_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames cut = cuts(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const bool before =
        joint.motion == Motion::Rotary && joint.deviation_axes == DeviationAxes::Fixed;
    J.middleCols<6>(6 * i) = displaced(cut, joint, i, before);
  }
  return J;
}

Eigen::MatrixXd location_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames cut = cuts(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Matrix6 frame = displaced(cut, joint, i, true);
    for (int k = 0; k < 6; ++k) {
      switch (chain.location_rule(i)[std::size_t(k)]) {
        case DisplacedPart::Frame:
          J.col(6 * i + k) = frame.col(k);
          break;
        case DisplacedPart::Carried:
          J.col(6 * i + k) = -displaced(cut, joint, i, false).col(k);
          break;
        case DisplacedPart::Axis:
          J.col(6 * i + k) = travel_rotation_columns(cut, joint, i, q[i]).col(k - 3);
      }
    }
  }
  return J;
}

}  // namespace abbe::kinematics
