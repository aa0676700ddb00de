#include "kinematics/jacobian.h"

#include <array>

#include "kinematics/frame.h"

namespace abbe::kinematics {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Frames between the joints of the chain from workpiece to tool: T[i] maps the bed frame at zero to
// the workpiece frame after the motion of all joints before i, in the order of the code. In this
// order the joints of both sides turn by the command itself, since the workpiece side is inverted.
struct ChainFrames {
  std::array<Frame, max_joints + 1> T;  // size + 1 are used
  Eigen::Vector3d tip_w;
};

// Returns the frames between the joints at positions q.
ChainFrames chain_frames(const Chain& chain, const AxisVector& q) {
  ChainFrames result;
  Frame T = inverse(to_frame(chain.T_bw_home()));
  result.T[0] = T;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    T = T * apply_motion(identity_frame(), joint, joint.direction_b, q[i]);
    result.T[std::size_t(i) + 1] = T;
  }
  result.tip_w = transform(T, chain.T_bt_home().translation());
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

// Returns the effect on the tool of a displacement of joint i, before or after the motion of the
// carriage in the order from the bed outwards. In the chain from workpiece to tool the workpiece
// side is reversed and inverted.
Matrix6 displacement_columns(const ChainFrames& frames, const Joint& joint, int i,
                             bool before_motion) {
  const bool is_primed = joint.side == Side::Workpiece;
  const Pose T = to_pose(frames.T[std::size_t(before_motion == is_primed ? i + 1 : i)]);
  return (is_primed ? -1.0 : 1.0) * transport(T, joint.point_b, frames.tip_w);
}

// Returns the effect on the tool of rotations of the direction of travel alone.
Eigen::Matrix<double, 6, 3> travel_rotation_columns(const ChainFrames& frames, const Joint& joint,
                                                    int i, double q) {
  Eigen::Matrix<double, 6, 3> M = Eigen::Matrix<double, 6, 3>::Zero();
  const Pose T = to_pose(frames.T[std::size_t(i)]);
  if (joint.motion == Motion::Linear)
    M.topRows<3>() = -q * T.linear() * cross_matrix(joint.direction_b);
  // Tilting the axis, moving and tilting it back is the difference of a rotation before and one
  // after the motion.
  if (joint.motion == Motion::Rotary)
    M = (transport(T, joint.point_b, frames.tip_w) -
         transport(to_pose(frames.T[std::size_t(i) + 1]), joint.point_b, frames.tip_w))
            .rightCols<3>();
  return M;
}

}  // namespace

AxisJacobian axis_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  AxisJacobian J = AxisJacobian::Zero(6, chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Frame& T = frames.T[std::size_t(i)];
    const Eigen::Vector3d direction_w = vector(rotate(T, joint.direction_b));
    if (joint.motion == Motion::Linear) J.col(i).head<3>() = direction_w;
    if (joint.motion == Motion::Rotary)
      J.col(i) << direction_w.cross(frames.tip_w - transform(T, joint.point_b)), direction_w;
  }
  return J;
}

Eigen::MatrixXd motion_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const bool is_before_motion =
        joint.motion == Motion::Rotary && joint.deviation_axes == DeviationAxes::Fixed;
    J.middleCols<6>(6 * i) = displacement_columns(frames, joint, i, is_before_motion);
  }
  return J;
}

Eigen::MatrixXd location_jacobian(const Chain& chain, const AxisVector& q) {
  const ChainFrames frames = chain_frames(chain, q);
  Eigen::MatrixXd J(6, 6 * chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    const Matrix6 frame = displacement_columns(frames, joint, i, true);
    for (int k = 0; k < 6; ++k) {
      switch (chain.location_rule(i)[std::size_t(k)]) {
        case DisplacedPart::Frame:
          J.col(6 * i + k) = frame.col(k);
          break;
        case DisplacedPart::Carried:
          J.col(6 * i + k) = -displacement_columns(frames, joint, i, false).col(k);
          break;
        case DisplacedPart::Axis:
          J.col(6 * i + k) = travel_rotation_columns(frames, joint, i, q[i]).col(k - 3);
      }
    }
  }
  return J;
}

}  // namespace abbe::kinematics
