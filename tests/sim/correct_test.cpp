#include "sim/compensation/correct.h"

#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "errors/geometric.h"
#include "tests/kinematics/machines.h"

namespace {

using namespace abbe;
using compensation_options = sim::compensation::CorrectOptions;
using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Pose;
using sim::compensation::Belief;
using sim::compensation::correct;
using sim::compensation::Correction;
using sim::compensation::Strategy;

/// All 46 elements of the gantry as random low-order polynomials: 20 um, 40 urad.
errors::GeometricErrors random_errors(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  errors::GeometricErrors all;
  const auto add = [&](const char* name, bool constant) {
    errors::Element element{errors::parse_element_name(name), {}};
    const double size = element.name.is_angle() ? 40e-6 : 20e-3;
    if (constant) {
      element.curves.push_back({errors::Constant{size * unit(random)}, {}, {}, {}, 1.0});
    } else {
      errors::Polynomial p;
      p.c = Eigen::Vector4d(unit(random), unit(random), unit(random), unit(random)) * size / 2.0;
      p.half_range = element.name.axis == 'A' || element.name.axis == 'C' ? pi : 300.0;
      element.curves.push_back({p, {}, {}, {}, 1.0});
    }
    all.elements.push_back(element);
  };
  for (const char axis : {'X', 'Y', 'Z', 'A', 'C'})
    for (const char direction : {'X', 'Y', 'Z', 'A', 'B', 'C'})
      add((std::string("E") + direction + axis).c_str(), false);
  for (const char* name : {"EXS", "EYS", "EZS", "EAS", "EBS", "EC0Y", "EB0Z", "EA0Z", "EB0A",
                           "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"})
    add(name, true);
  return all;
}

Belief belief(const Chain& chain, const errors::GeometricModel& model) {
  return [&chain, model](const AxisState& state) {
    return chain.tool_in_workpiece(state.q, errors::deviations(model, state));
  };
}

AxisState random_command(std::mt19937_64& random, double least_A) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  AxisState state;
  state.q.resize(6);
  const double a = unit(random);
  state.q << pi * unit(random), 200 * unit(random), 150 * unit(random), 100 * unit(random),
      std::copysign(least_A + (1.4 - least_A) * std::abs(a), a), 0.0;
  return state;
}

double tip_left(const Belief& truth, const AxisState& command, const Eigen::MatrixXd& q,
                const Pose& wanted) {
  AxisState told = command;
  told.q = q;
  return (truth(told).translation() - wanted.translation()).norm();
}

}  // namespace

TEST(Correct, OneDecoupledStepLeavesASecondOrderTipError) {
  constexpr std::uint64_t seed = 20260101;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Chain gantry = machines::gantry();
  const errors::GeometricModel once = errors::bind(random_errors(seed), gantry);
  double left[3] = {0, 0, 0};
  const double scale[3] = {4.0, 2.0, 1.0};
  for (int k = 0; k < 3; ++k) {
    const Belief truth = belief(gantry, errors::scaled(once, scale[k]));
    std::mt19937_64 random(seed);
    for (int i = 0; i < 500; ++i) {
      const AxisState command = random_command(random, 5.0 * units::deg);
      const Pose wanted = gantry.tool_in_workpiece(command.q);
      compensation_options options;
      options.strategy = Strategy::Decoupled;
      options.rotary_bound = 1.0;  // the bound is not what is looked at here
      const Correction correction = correct(gantry, truth, wanted, command, options);
      left[k] += std::pow(tip_left(truth, command, correction.q, wanted), 2);
    }
    left[k] = std::sqrt(left[k] / 500);
  }
  const double first = std::log2(left[0] / left[1]), second = std::log2(left[1] / left[2]);
  std::cout << "tip error after one decoupled step, errors x 4, 2, 1: " << left[0] / units::um
            << " " << left[1] / units::um << " " << left[2] / units::um << " um; exponents "
            << first << " " << second << "\n";
  EXPECT_NEAR(first, 2.0, 0.1);
  EXPECT_NEAR(second, 2.0, 0.1);
}

TEST(Correct, IteratedReachesTheWantedPoseAwayFromTheSingularOne) {
  constexpr std::uint64_t seed = 20260102;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Chain gantry = machines::gantry();
  const Belief truth = belief(gantry, errors::bind(random_errors(seed), gantry));
  std::mt19937_64 random(seed);
  double worst_tip = 0.0, worst_direction = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const AxisState command = random_command(random, 5.0 * units::deg);
    const Pose wanted = gantry.tool_in_workpiece(command.q);
    const Correction correction = correct(gantry, truth, wanted, command);
    ASSERT_TRUE(correction.converged);
    AxisState told = command;
    told.q = correction.q;
    const Pose reached = truth(told);
    worst_tip = std::max(worst_tip, (reached.translation() - wanted.translation()).norm());
    worst_direction =
        std::max(worst_direction, (reached.linear().col(2) - wanted.linear().col(2)).norm());
  }
  std::cout << "iterated leaves at most " << worst_tip << " mm and " << worst_direction << " rad\n";
  EXPECT_LT(worst_tip, 1e-8);
  EXPECT_LT(worst_direction, 1e-11);
}

TEST(Correct, RotaryCorrectionsStayBoundedAndTheBallCentreIsServedAtTheSingularPose) {
  constexpr std::uint64_t seed = 20260103;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Chain gantry = machines::gantry();
  const Belief truth = belief(gantry, errors::bind(random_errors(seed), gantry));
  compensation_options options;
  options.functional_height = 5.0;
  for (const double A :
       {0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 0.01 * units::deg, 1e-3, 0.019, 0.021, -1e-9, -1e-4}) {
    AxisState command;
    command.q.resize(6);
    command.q << 0.7, 40, -30, 20, A, 0;
    const Pose wanted = gantry.tool_in_workpiece(command.q);
    const Correction correction = correct(gantry, truth, wanted, command, options);
    ASSERT_TRUE(correction.q.allFinite());
    EXPECT_TRUE(correction.converged) << "A " << A;
    EXPECT_LE(std::abs(correction.q[0] - command.q[0]), options.rotary_bound * (1 + 1e-12))
        << "A " << A;
    EXPECT_LE(std::abs(correction.q[4] - command.q[4]), options.rotary_bound * (1 + 1e-12))
        << "A " << A;
    EXPECT_LT(correction.point_left, 1e-8) << "A " << A;
    EXPECT_LT(correction.direction_left, 400e-6) << "A " << A;
    AxisState told = command;
    told.q = correction.q;
    const Pose reached = truth(told);
    const Vector3d centre = reached * Vector3d(0, 0, 5), target = wanted * Vector3d(0, 0, 5);
    EXPECT_LT((centre - target).norm(), 1e-8) << "A " << A;
    EXPECT_NEAR(correction.direction_left,
                (reached.linear().col(2) - wanted.linear().col(2)).norm(), 1e-12);
  }
}

TEST(Correct, PositionOnlyLeavesTheDirectionAsItWas) {
  const Chain gantry = machines::gantry();
  const Belief truth = belief(gantry, errors::bind(random_errors(5), gantry));
  AxisState command;
  command.q.resize(6);
  command.q << 0.7, 40, -30, 20, 0.5, 0;
  const Pose wanted = gantry.tool_in_workpiece(command.q);
  compensation_options options;
  options.strategy = Strategy::Position;
  const Correction correction = correct(gantry, truth, wanted, command, options);
  EXPECT_EQ(correction.q[0], command.q[0]);
  EXPECT_EQ(correction.q[4], command.q[4]);
  EXPECT_LT(correction.point_left, 1e-4);
  EXPECT_GT(correction.direction_left, 1e-6);
}

TEST(Correct, APlatformCorrectsItsTwoSlidesAndLeavesTheThirdDirection) {
  const Chain platform = machines::platform();
  errors::GeometricErrors wrong;
  for (const char* name : {"EXX", "EYX", "EZX", "EXZ", "EYZ", "EZZ"})
    wrong.elements.push_back(
        {errors::parse_element_name(name), {{errors::Constant{0.01}, {}, {}, {}, 1.0}}});
  const Belief truth = belief(platform, errors::bind(wrong, platform));
  AxisState command;
  command.q.resize(3);
  command.q << 0.0, 3.0, -5.0;
  compensation_options options;
  options.idle_joint = 0;
  const Pose wanted = platform.tool_in_workpiece(command.q);
  AxisState told = command;
  const Correction correction = correct(platform, truth, wanted, command, options);
  told.q = correction.q;
  EXPECT_EQ(correction.q[0], 0.0);
  EXPECT_TRUE(correction.converged);
  const Vector3d left = truth(told).translation() - wanted.translation();
  const Vector3d uncorrected = truth(command).translation() - wanted.translation();
  // the workpiece may be clamped at any angle: what is left is the part along the bed's y alone
  EXPECT_NEAR(left.norm(), std::abs((platform.T_bw_home().linear() * uncorrected).y()), 1e-9);
}
