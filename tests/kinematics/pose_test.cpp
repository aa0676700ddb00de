#include "kinematics/pose.h"
#include "kinematics/frame.h"
#include "kinematics/inverse_kinematics.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

namespace abbe::kinematics {
namespace {

using Matrix3l = Eigen::Matrix<long double, 3, 3>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// Rodrigues' formula in long double, the reference for `rotation`. It is itself good to 1e-18 times
// the angle.
Matrix3l long_rotation(const Vector3d& v) {
  const Eigen::Matrix<long double, 3, 1> w = v.cast<long double>();
  const long double angle = w.norm();
  if (angle == 0.0L) return Matrix3l::Identity();
  Matrix3l K;
  K << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  const long double half = std::sin(angle / 2) / (angle / 2);
  return Matrix3l::Identity() + std::sin(angle) / angle * K + half * half / 2 * (K * K);
}

std::vector<Vector3d> awkward_axes() {
  std::vector<Vector3d> axes;
  for (const double a : {-1.0, 0.0, 1.0})
    for (const double b : {-1.0, 0.0, 1.0})
      for (const double c : {-1.0, 0.0, 1.0})
        if (a != 0 || b != 0 || c != 0) axes.push_back(Vector3d(a, b, c).normalized());
  axes.push_back(Vector3d(1, 1e-9, 0).normalized());
  axes.push_back(Vector3d(1e-9, 1e-13, -1).normalized());
  return axes;
}

std::vector<double> awkward_angles() {
  return {0.0,  1e-300,     1e-160,    1e-20,     1e-12,     1e-9,
          1e-6, 1e-3,       0.1,       1.0,       0.5 * pi,  0.5 * pi + 1e-12,
          2.0,  2 * pi / 3, pi - 1e-3, pi - 1e-6, pi - 1e-8, pi - 1e-12};
}

TEST(Rotation, EqualsRodriguesFormulaInLongDouble) {
  double worst = 0;
  for (const Vector3d& axis : awkward_axes())
    for (double angle : awkward_angles())
      worst = std::max(
          worst, double((rotation(axis * angle).cast<long double>() - long_rotation(axis * angle))
                            .cwiseAbs()
                            .maxCoeff()));
  std::cout << "largest error of an element up to half a turn: " << worst << "\n";
  EXPECT_LE(worst, 5e-16);

  double worst_far = 0;  // per radian of angle
  for (const Vector3d& axis : awkward_axes())
    for (double angle : {pi, 4.0, 2 * pi, 10.0, 100.0, 1e4, 1e6})
      worst_far =
          std::max(worst_far,
                   double((rotation(axis * angle).cast<long double>() - long_rotation(axis * angle))
                              .cwiseAbs()
                              .maxCoeff()) /
                       (1.0 + angle));
  std::cout << "beyond, per radian of angle: " << worst_far << "\n";
  EXPECT_LE(worst_far, 2e-16);
}

TEST(Rotation, IsTheIdentityToTheBitForNoTurn) {
  EXPECT_EQ(rotation(Vector3d::Zero()), Matrix3d::Identity());
}

TEST(RotationVector, UndoesRotationUpToAHalfTurn) {
  double worst = 0;
  for (const Vector3d& axis : awkward_axes())
    for (double angle : awkward_angles()) {
      const Vector3d v = axis * angle;
      const double error = (rotation_vector(rotation(v)) - v).norm();
      ASSERT_LE(error, 2e-15) << v.transpose() << " angle " << angle;
      worst = std::max(worst, error);
    }
  SeededRandom random(20250301);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 100000; ++i) {
    Vector3d v(unit(random), unit(random), unit(random));
    v *= std::pow(10.0, -6.0 * std::abs(unit(random))) * pi / std::max(1.0, v.norm()) * 0.999999999;
    const double error = (rotation_vector(rotation(v)) - v).norm();
    ASSERT_LE(error, 2e-15) << v.transpose();
    worst = std::max(worst, error);
  }
  std::cout << "largest error of the round trip: " << worst << " rad\n";
}

TEST(RotationVector, FindsTheAxisOfAHalfTurnUpToItsSign) {
  for (const Vector3d& axis : awkward_axes()) {
    const Vector3d v = rotation_vector(2.0 * axis * axis.transpose() - Matrix3d::Identity());
    EXPECT_NEAR(v.norm(), pi, 1e-15);
    EXPECT_LE(std::min((v - pi * axis).norm(), (v + pi * axis).norm()), 2e-15) << axis.transpose();
  }
}

TEST(Motion, LeavesItsPointWhereTheTranslationPutsIt) {
  Deviation D;
  D << 1.0, -2.0, 3.0, 0.1, -0.2, 0.3;
  const Vector3d point(100, -50, 25);
  EXPECT_LT((motion(D, point) * point - (point + Vector3d(1, -2, 3))).norm(), 1e-13);
}

TEST(Motion, OfNothingIsTheIdentityToTheBit) {
  EXPECT_EQ(motion(Deviation::Zero(), Vector3d(0.1, 700.3, -1e3)).matrix(),
            Pose::Identity().matrix());
}

TEST(Motion, FirstOrderIsWithinItsPromise) {
  SeededRandom random(20240607);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&](double size) {
    return Vector3d(size * unit(random), size * unit(random), size * unit(random));
  };
  double worst = 0;  // share of the bound that is used, where the bound is well above rounding
  for (int i = 0; i < 10000; ++i) {
    Deviation D;
    D.head<3>() = any(0.05);
    D.tail<3>() = any(1e-3);
    const Vector3d point = any(500);
    const Vector3d place = any(1000);
    const Vector3d lever = place - point;
    const Vector3d shift = D.head<3>();
    const Vector3d angles = D.tail<3>();
    const Vector3d exact = motion(D, point) * place;
    const Vector3d first = place + shift + angles.cross(lever);
    const double bound = 0.5 * angles.squaredNorm() * lever.norm();
    ASSERT_LE((exact - first).norm(), bound + 1e-12);
    if (bound > 1e-6) worst = std::max(worst, (exact - first).norm() / bound);
  }
  std::cout << "largest share of |E|^2 L / 2 that is used: " << worst << "\n";
  EXPECT_GT(worst, 0.9);  // the bound is not idle
}

TEST(Motion, FirstOrderAtOneMetreAndOneHundredMicroradiansNeglectsFiveNanometres) {
  Deviation D = Deviation::Zero();
  D[5] = 100e-6;
  const Vector3d place(1000, 0, 0);
  const Vector3d first = place + D.tail<3>().cross(place);
  EXPECT_NEAR((motion(D, Vector3d::Zero()) * place - first).norm(), 5e-6, 1e-10);
}

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

  static Matrix3d change(const Vector3d& v) {
    const double angle2 = v.squaredNorm();
    const double s = 1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0);
    const double c = 0.5 * (1.0 - angle2 / 12.0 * (1.0 - angle2 / 30.0));
    const Vector3d sv = s * v, cv = c * v;
    Matrix3d R;
    R << cv.x() * v.x() - c * angle2, cv.x() * v.y() - sv.z(), cv.x() * v.z() + sv.y(),
        cv.y() * v.x() + sv.z(), cv.y() * v.y() - c * angle2, cv.y() * v.z() - sv.x(),
        cv.z() * v.x() - sv.y(), cv.z() * v.y() + sv.x(), cv.z() * v.z() - c * angle2;
    return R;
  }

  static Pose displaced(const Pose& T, const Deviation& deviation, const Vector3d& point) {
    const Matrix3d R = change(deviation.tail<3>());
    Pose result = T;
    result.linear() += T.linear() * R;
    result.translation() += T.linear() * (deviation.head<3>() - R * point);
    return result;
  }

  static Pose moved(const Pose& T, const Joint& joint, double travel) {
    Pose result = T;
    if (joint.motion == Motion::Rotary) {
      const Matrix3d R = Eigen::AngleAxisd(travel, joint.direction_b).toRotationMatrix();
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

// Motion of the tool from one pose to another in the workpiece: [tip | rotation vector].
Vector6 moved(const Pose& from, const Pose& to) {
  Vector6 change;
  change << to.translation() - from.translation(),
      rotation_vector(to.linear() * from.linear().transpose());
  return change;
}

// Central difference of a pose. With h = 1e-4 (mm or rad) it is wrong by h^2 / 6 of the third
// derivative, 2e-6 at a lever of 1 m, and by rounding of 1e-9; so two steps are extrapolated.
Vector6 derivative(const std::function<Pose(double)>& pose) {
  const auto central = [&](double h) -> Vector6 { return moved(pose(-h), pose(h)) / (2 * h); };
  return (4.0 * central(1e-4) - central(2e-4)) / 3.0;
}

// Largest difference, rotations weighed with a lever of 1 m.
double weighed_difference(const Vector6& a, const Vector6& b) {
  return std::max((a - b).head<3>().cwiseAbs().maxCoeff(),
                  1000.0 * (a - b).tail<3>().cwiseAbs().maxCoeff());
}

std::vector<AxisVector> places(const Chain& chain, std::mt19937& random) {
  std::vector<AxisVector> places = {AxisVector::Zero(chain.size()),
                                    AxisVector::Constant(chain.size(), 0.5 * pi),
                                    AxisVector::Constant(chain.size(), 1e-12)};
  for (int i = 0; i < 20; ++i) places.push_back(machines::anywhere(chain, random));
  return places;
}

constexpr double tolerance = 5e-8;  // mm per mm or rad, of entries up to 1500

TEST(AxisJacobian, EqualsCentralDifferences) {
  SeededRandom random(20250303);
  double worst = 0;
  for (const auto& [name, chain] : machines::all())
    for (const AxisVector& q : places(chain, random)) {
      const MatrixXd J = axis_jacobian(chain, q);
      ASSERT_EQ(J.rows(), 6);
      ASSERT_EQ(J.cols(), chain.size());
      for (int i = 0; i < chain.size(); ++i) {
        const Vector6 expected = derivative([&, &machine = chain](double h) {
          AxisVector there = q;
          there[i] += h;
          return machine.tool_in_workpiece(there);
        });
        const double error = weighed_difference(J.col(i), expected);
        ASSERT_LE(error, tolerance) << name << " axis " << i << " at " << q.transpose();
        worst = std::max(worst, error);
      }
    }
  std::cout << "largest difference: " << worst << "\n";
}

// Both deviation Jacobians against the same reference; `part` picks the deviation that is varied.
void expect_derivatives(const std::function<MatrixXd(const Chain&, const AxisVector&)>& jacobian,
                        const std::function<Deviation&(JointDeviation&)>& part) {
  SeededRandom random(20250304);
  double worst = 0;
  for (const auto& [name, machine] : machines::all())
    for (const DeviationAxes axes : {DeviationAxes::Fixed, DeviationAxes::Turning})
      for (const Squareness squareness : {Squareness::Frame, Squareness::Travel}) {
        const Chain chain = machines::with_options(machine, axes, squareness);
        for (const AxisVector& q : places(chain, random)) {
          const MatrixXd J = jacobian(chain, q);
          ASSERT_EQ(J.rows(), 6);
          ASSERT_EQ(J.cols(), 6 * chain.size());
          for (int i = 0; i < chain.size(); ++i)
            for (int k = 0; k < 6; ++k) {
              const Vector6 expected = derivative([&](double h) {
                std::vector<JointDeviation> wrong(std::size_t(chain.size()));
                part(wrong[std::size_t(i)])[k] = h;
                return chain.tool_in_workpiece(q, wrong);
              });
              const double error = weighed_difference(J.col(6 * i + k), expected);
              ASSERT_LE(error, tolerance)
                  << name << " joint " << i << " component " << k << " at " << q.transpose();
              worst = std::max(worst, error);
            }
        }
      }
  std::cout << "largest difference: " << worst << "\n";
}

TEST(MotionJacobian, EqualsCentralDifferencesInFixedAndTurningAxes) {
  expect_derivatives(motion_jacobian, [](JointDeviation& d) -> Deviation& { return d.motion; });
}

TEST(LocationJacobian, EqualsCentralDifferencesForFrameAndTravel) {
  expect_derivatives(location_jacobian, [](JointDeviation& d) -> Deviation& { return d.location; });
}

TEST(AxisJacobian, OfASpindleNoseIsZero) {
  const Chain machine = machines::gantry();
  EXPECT_EQ(axis_jacobian(machine, AxisVector::Constant(6, 0.3)).col(5), Vector6::Zero());
}

TEST(Jacobians, OfAMachineWithoutAxesAreEmpty) {
  const Chain fixed({}, Pose::Identity(), Pose::Identity());
  EXPECT_EQ(axis_jacobian(fixed, AxisVector()).cols(), 0);
  EXPECT_EQ(motion_jacobian(fixed, AxisVector()).cols(), 0);
  EXPECT_EQ(location_jacobian(fixed, AxisVector()).cols(), 0);
}

}  // namespace
}  // namespace abbe::kinematics
