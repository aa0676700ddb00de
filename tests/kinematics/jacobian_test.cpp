#include "kinematics/inverse_kinematics.h"

#include <algorithm>
#include <functional>
#include <iostream>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/kinematics/machines.h"

namespace abbe::kinematics {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

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
  const unsigned seed = 20250303;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  double worst = 0;
  for (const auto& [name, chain] : machines::all())
    for (const AxisVector& q : places(chain, random)) {
      const Eigen::MatrixXd J = axis_jacobian(chain, q);
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
void expect_derivatives(
    const std::function<Eigen::MatrixXd(const Chain&, const AxisVector&)>& jacobian,
    const std::function<Deviation&(JointDeviation&)>& part) {
  const unsigned seed = 20250304;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  double worst = 0;
  for (const auto& [name, machine] : machines::all())
    for (const DeviationAxes axes : {DeviationAxes::Fixed, DeviationAxes::Turning})
      for (const Squareness squareness : {Squareness::Frame, Squareness::Travel}) {
        const Chain chain = machines::with_options(machine, axes, squareness);
        for (const AxisVector& q : places(chain, random)) {
          const Eigen::MatrixXd J = jacobian(chain, q);
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
