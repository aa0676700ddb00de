#include "kinematics/frame.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/kinematics/machines.h"

namespace abbe::kinematics {
namespace {

using Eigen::Vector3d;

/// The chain of Poses of Eigen, term by term, that frames stand for.
class PoseChain {
 public:
  PoseChain(const Chain& chain, const AxisVector& q, const std::vector<JointDeviation>& wrong)
      : chain_(chain), q_(q), wrong_(wrong) {}

  Pose tool_in_workpiece() const {
    Pose T_bw = Pose::Identity(), T_bt = Pose::Identity();
    for (int i = chain_.size() - 1; i >= 0; --i)
      if (joint(i).side == Side::Workpiece) T_bw = carried(T_bw, i);
    for (int i = 0; i < chain_.size(); ++i)
      if (joint(i).side == Side::Tool) T_bt = carried(T_bt, i);
    return (T_bw * chain_.T_bw_home()).inverse() * (T_bt * chain_.T_bt_home());
  }

 private:
  const Joint& joint(int i) const { return chain_.joints()[std::size_t(i)]; }

  static Eigen::Matrix3d change(const Vector3d& v) {
    const double angle2 = v.squaredNorm();
    const double s = 1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0);
    const double c = 0.5 * (1.0 - angle2 / 12.0 * (1.0 - angle2 / 30.0));
    const Vector3d sv = s * v, cv = c * v;
    Eigen::Matrix3d R;
    R << cv.x() * v.x() - c * angle2, cv.x() * v.y() - sv.z(), cv.x() * v.z() + sv.y(),
        cv.y() * v.x() + sv.z(), cv.y() * v.y() - c * angle2, cv.y() * v.z() - sv.x(),
        cv.z() * v.x() - sv.y(), cv.z() * v.y() + sv.x(), cv.z() * v.z() - c * angle2;
    return R;
  }

  static Pose displaced(const Pose& T, const Deviation& deviation, const Vector3d& point) {
    const Eigen::Matrix3d R = change(deviation.tail<3>());
    Pose result = T;
    result.linear() += T.linear() * R;
    result.translation() += T.linear() * (deviation.head<3>() - R * point);
    return result;
  }

  static Pose moved(const Pose& T, const Joint& joint, double travel) {
    Pose result = T;
    if (joint.motion == Motion::Rotary) {
      const Eigen::Matrix3d R = Eigen::AngleAxisd(travel, joint.direction_b).toRotationMatrix();
      result.linear() = T.linear() * R;
      result.translation() = T.translation() + T.linear() * (joint.point_b - R * joint.point_b);
    }
    if (joint.motion == Motion::Linear)
      result.translation() += T.linear() * (travel * joint.direction_b);
    return result;
  }

  Pose carried(const Pose& T, int i) const {
    const double travel = carriage_travel(joint(i).side, q_[i]);
    if (wrong_.empty()) return moved(T, joint(i), travel);
    const Deviation& motion = wrong_[std::size_t(i)].motion;
    if (joint(i).motion == Motion::Rotary)
      return moved(displaced(T, motion, joint(i).point_b), joint(i), travel);
    return displaced(moved(T, joint(i), travel), motion, joint(i).point_b);
  }

  const Chain& chain_;
  const AxisVector& q_;
  const std::vector<JointDeviation>& wrong_;
};

TEST(Frame, AChainOfFramesHasTheBitsOfAChainOfPoses) {
  std::mt19937 random(20261126);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const Chain& chain :
       {machines::gantry(), machines::platform(), machines::trunnion(), machines::head_head()})
    for (int k = 0; k < 2000; ++k) {
      AxisVector q(chain.size());
      std::vector<JointDeviation> wrong(k % 5 == 0 ? 0 : std::size_t(chain.size()));
      for (double& one : q) one = (k % 2 == 0 ? 3.0 : 300.0) * unit(random);
      for (JointDeviation& one : wrong)
        for (int i = 0; i < 6; ++i) one.motion[i] = (i < 3 ? 0.05 : 1e-4) * unit(random);
      const Pose expected = PoseChain(chain, q, wrong).tool_in_workpiece();
      const Pose seen = chain.tool_in_workpiece(q, wrong);
      ASSERT_EQ(expected.matrix(), seen.matrix()) << "case " << k << ", difference\n"
                                                  << expected.matrix() - seen.matrix();
    }
}

TEST(Frame, TurnsPlacesAndInvertsAsAPose) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&] { return Vector3d(unit(random), unit(random), unit(random)); };
  for (int k = 0; k < 2000; ++k) {
    const Pose a = machines::placed(300.0 * any(), 3.0 * unit(random), any());
    const Pose b = machines::placed(300.0 * any(), 3.0 * unit(random), any());
    const Vector3d p = 100.0 * any();
    EXPECT_EQ(to_pose(to_frame(a)).matrix(), a.matrix());
    EXPECT_EQ(to_pose(to_frame(a) * to_frame(b)).matrix(), (a * b).matrix());
    EXPECT_EQ(to_pose(inverse(to_frame(a))).matrix(), a.inverse().matrix());
    EXPECT_EQ(transform(to_frame(a), p), Vector3d(a * p));
    EXPECT_EQ(vector(rotate(to_frame(a), p)), Vector3d(a.linear() * p));
  }
}

}  // namespace
}  // namespace abbe::kinematics
