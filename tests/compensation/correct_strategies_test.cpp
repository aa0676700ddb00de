#include <cmath>
#include <iostream>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "tests/compensation/believed.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Pose;

struct FiveAxes {
  const char* name;
  Chain chain;
  int tilt;  ///< joint whose zero is the pole
};

std::vector<FiveAxes> five_axes() {
  return {{"gantry", machines::gantry(), 4},
          {"trunnion", machines::trunnion(), 1},
          {"head_head", machines::head_head(), 4}};
}

/// Anywhere with the tool tilted by 5 to 80 degrees either way.
template <typename Random>
AxisState away_from_pole(const FiveAxes& machine, Random& random) {
  AxisState state;
  state.q = machines::anywhere(machine.chain, random, 250.0);
  const double a = state.q[machine.tilt] / pi;
  state.q[machine.tilt] = std::copysign((5.0 + 75.0 * std::abs(a)) * units::deg, a);
  return state;
}

AxisState gantry_at(double C, double A) {
  AxisState state;
  state.q.resize(6);
  state.q << C, 40, -30, 20, A, 0;
  return state;
}

Pose reached(const Belief& belief, AxisState command, const Correction& correction) {
  command.q = correction.q;
  return belief(command);
}

struct MeanLeft {
  double tip = 0.0;        ///< mm, root mean square
  double direction = 0.0;  ///< rad
};

MeanLeft left_by(Strategy strategy, const FiveAxes& machine, double scale, std::uint64_t seed) {
  const Belief belief = believed(
      machine.chain, errors::bind(typical_errors(machine.chain, seed, scale), machine.chain));
  std::mt19937_64 random(seed);
  CorrectOptions options;
  options.strategy = strategy;
  options.rotary_bound = 1.0;  // the bound is not what is looked at here
  MeanLeft left;
  constexpr int count = 500;
  for (int i = 0; i < count; ++i) {
    const AxisState command = away_from_pole(machine, random);
    const Pose wanted = machine.chain.tool_in_workpiece(command.q);
    const Correction correction = correct(machine.chain, belief, wanted, command, options);
    const Pose there = reached(belief, command, correction);
    left.tip += (there.translation() - wanted.translation()).squaredNorm() / count;
    left.direction += (there.linear().col(2) - wanted.linear().col(2)).squaredNorm() / count;
  }
  return {std::sqrt(left.tip), std::sqrt(left.direction)};
}

TEST(Correct, HalvingTheErrorsQuartersWhatOneStepLeaves) {
  constexpr std::uint64_t seed = 20260101;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const FiveAxes& machine : five_axes()) {
    for (const Strategy strategy : {Strategy::Position, Strategy::Decoupled}) {
      const MeanLeft vector4 = left_by(strategy, machine, 4.0, seed);
      const MeanLeft two = left_by(strategy, machine, 2.0, seed);
      const MeanLeft one = left_by(strategy, machine, 1.0, seed);
      const double first = std::log2(vector4.tip / two.tip), second = std::log2(two.tip / one.tip);
      std::cout << machine.name << (strategy == Strategy::Position ? ", position" : ", decoupled")
                << ": tip left, errors x 4, 2, 1: " << vector4.tip / units::um << " "
                << two.tip / units::um << " " << one.tip / units::um << " um; exponents " << first
                << " " << second << "\n";
      EXPECT_NEAR(first, 2.0, 0.1) << machine.name;
      EXPECT_NEAR(second, 2.0, 0.1) << machine.name;
      const double of_direction = std::log2(two.direction / one.direction);
      EXPECT_NEAR(of_direction, strategy == Strategy::Position ? 1.0 : 2.0, 0.1) << machine.name;
    }
  }
}

TEST(Correct, IteratedReachesTheWantedPoseAwayFromThePole) {
  constexpr std::uint64_t seed = 20260102;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const FiveAxes& machine : five_axes()) {
    const Belief belief =
        believed(machine.chain, errors::bind(typical_errors(machine.chain, seed), machine.chain));
    std::mt19937_64 random(seed);
    double worst_tip = 0.0, worst_direction = 0.0;
    for (int i = 0; i < 2000; ++i) {
      const AxisState command = away_from_pole(machine, random);
      const Pose wanted = machine.chain.tool_in_workpiece(command.q);
      const Correction correction = correct(machine.chain, belief, wanted, command);
      ASSERT_TRUE(correction.converged);
      const Pose there = reached(belief, command, correction);
      worst_tip = std::max(worst_tip, (there.translation() - wanted.translation()).norm());
      worst_direction =
          std::max(worst_direction, (there.linear().col(2) - wanted.linear().col(2)).norm());
    }
    std::cout << machine.name << ": iterated leaves at most " << worst_tip << " mm and "
              << worst_direction << " rad\n";
    EXPECT_LT(worst_tip, 1e-8);
    EXPECT_LT(worst_direction, 2e-12);
  }
}

TEST(Correct, WhatIsLeftIsThatOfTheBeliefAtTheCorrectedCommandToTheBit) {
  constexpr std::uint64_t seed = 20260103;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const FiveAxes machine = five_axes()[0];
  const Belief belief =
      believed(machine.chain, errors::bind(typical_errors(machine.chain, seed), machine.chain));
  std::mt19937_64 random(seed);
  for (const Strategy strategy : {Strategy::Position, Strategy::Decoupled, Strategy::Iterated})
    for (int i = 0; i < 100; ++i) {
      CorrectOptions options;
      options.strategy = strategy;
      const AxisState command = away_from_pole(machine, random);
      const Pose wanted = machine.chain.tool_in_workpiece(command.q);
      const Correction correction = correct(machine.chain, belief, wanted, command, options);
      const Pose there = reached(belief, command, correction);
      EXPECT_EQ(correction.remaining_point_error,
                (there.translation() - wanted.translation()).norm());
      EXPECT_EQ(correction.remaining_direction_error,
                (there.linear().col(2) - wanted.linear().col(2)).norm());
    }
}

TEST(Correct, NothingWrongLeavesTheCommandAsItWasToTheBit) {
  std::mt19937_64 random(1);
  for (const auto& [name, chain] : machines::all()) {
    const Belief belief = believed(chain, errors::bind({}, chain));
    for (const Strategy strategy : {Strategy::Position, Strategy::Decoupled, Strategy::Iterated}) {
      AxisState command;
      command.q = machines::anywhere(chain, random);
      CorrectOptions options;
      options.strategy = strategy;
      const Correction correction =
          correct(chain, belief, chain.tool_in_workpiece(command.q), command, options);
      EXPECT_EQ(correction.q, command.q) << name;
      EXPECT_EQ(correction.remaining_point_error, 0.0) << name;
      EXPECT_TRUE(correction.converged) << name;
    }
  }
}

TEST(Correct, PositionOnlyLeavesTheDirectionAsItWas) {
  const Chain gantry = machines::gantry();
  const Belief belief = believed(gantry, errors::bind(typical_errors(gantry, 5), gantry));
  const AxisState command = gantry_at(0.7, 0.5);
  const Pose wanted = gantry.tool_in_workpiece(command.q);
  CorrectOptions options;
  options.strategy = Strategy::Position;
  options.functional_height = 7.0;  // means nothing to it: the tip is served
  const Correction correction = correct(gantry, belief, wanted, command, options);
  EXPECT_EQ(correction.q[0], command.q[0]);
  EXPECT_EQ(correction.q[4], command.q[4]);
  EXPECT_LT((reached(belief, command, correction).translation() - wanted.translation()).norm(),
            1e-4);
  EXPECT_LT(correction.remaining_point_error, 1e-4);
  EXPECT_NEAR(correction.remaining_direction_error,
              (belief(command).linear().col(2) - wanted.linear().col(2)).norm(), 1e-8);
  EXPECT_GT(correction.remaining_direction_error, 1e-6);
}

TEST(Correct, WhereOnlySlidesCanMoveTheyServeThePointInTheDirectionReallyReached) {
  constexpr std::uint64_t seed = 20260104;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  CorrectOptions options;
  options.functional_height = 50.0;  // so high that the tip itself is missed by micrometres
  std::mt19937_64 random(seed);
  for (const auto& [name, chain] : machines::five_axis()) {
    options.fixed_joints.reset();
    for (int i = 0; i < chain.size(); ++i)
      if (chain.joints()[std::size_t(i)].motion == Motion::Rotary)
        options.fixed_joints.set(std::size_t(i));
    const Belief belief = believed(chain, errors::bind(typical_errors(chain, seed), chain));
    for (int i = 0; i < 200; ++i) {
      AxisState command;
      command.q = machines::anywhere(chain, random, 250.0);
      const Pose wanted = chain.tool_in_workpiece(command.q);
      const Correction correction = correct(chain, belief, wanted, command, options);
      ASSERT_TRUE(correction.converged) << name;
      for (int k = 0; k < chain.size(); ++k)
        ASSERT_TRUE(!options.fixed_joints[std::size_t(k)] || correction.q[k] == command.q[k])
            << name;
      const Pose there = reached(belief, command, correction);
      const double uncorrected = (belief(command).linear().col(2) - wanted.linear().col(2)).norm();
      const Vector3d point(0, 0, 50);
      EXPECT_LT((there * point - wanted * point).norm(), 1e-8) << name;
      // the slides' own angles change over the way that they are corrected: three Legendre series
      // of at most 10 urad a term, whose slopes add to 20 / 350 of that a mm
      const double way = (correction.q - command.q).lpNorm<1>();
      EXPECT_NEAR(correction.remaining_direction_error, uncorrected,
                  std::sqrt(3.0) * 10e-6 * 20 / 350 * way)
          << name;
      EXPECT_NEAR((there.translation() - wanted.translation()).norm(),
                  50.0 * correction.remaining_direction_error, 2e-8)
          << name;
    }
  }
}

TEST(Correct, AThreeAxisMachineServesThePointAndReportsTheDirection) {
  constexpr std::uint64_t seed = 20260105;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Chain chain = machines::moving_table();
  const Belief belief = believed(chain, errors::bind(typical_errors(chain, seed), chain));
  std::mt19937_64 random(seed);
  for (int i = 0; i < 500; ++i) {
    AxisState command;
    command.q = machines::anywhere(chain, random, 250.0);
    const Pose wanted = chain.tool_in_workpiece(command.q);
    const Correction correction = correct(chain, belief, wanted, command);
    ASSERT_TRUE(correction.converged);
    EXPECT_LT(correction.remaining_point_error, 1e-8);
    EXPECT_NEAR(correction.remaining_direction_error,
                (belief(command).linear().col(2) - wanted.linear().col(2)).norm(), 1e-7);
  }
}

TEST(Correct, NoJointThatMayMoveLeavesAllAndSaysSo) {
  const Chain gantry = machines::gantry();
  const Belief belief = believed(gantry, errors::bind(typical_errors(gantry, 6), gantry));
  const AxisState command = gantry_at(0.7, 0.5);
  const Pose wanted = gantry.tool_in_workpiece(command.q);
  CorrectOptions options;
  options.fixed_joints.set();
  const Correction correction = correct(gantry, belief, wanted, command, options);
  EXPECT_EQ(correction.q, command.q);
  EXPECT_TRUE(correction.converged);  // there is nothing that could be corrected
  EXPECT_EQ(correction.remaining_point_error,
            (belief(command).translation() - wanted.translation()).norm());
}

TEST(Correct, TooFewStepsAreReportedWithWhatTheyLeave) {
  const Chain gantry = machines::gantry();
  const Belief belief = believed(gantry, errors::bind(typical_errors(gantry, 7), gantry));
  const AxisState command = gantry_at(0.7, 0.5);
  const Pose wanted = gantry.tool_in_workpiece(command.q);
  CorrectOptions options, one_step;
  one_step.strategy = Strategy::Decoupled;
  options.max_iterations = 0;
  EXPECT_EQ(correct(gantry, belief, wanted, command, options).q, command.q);
  EXPECT_FALSE(correct(gantry, belief, wanted, command, options).converged);
  options.max_iterations = 1;
  const Correction one = correct(gantry, belief, wanted, command, options);
  EXPECT_FALSE(one.converged);
  EXPECT_EQ(one.q, correct(gantry, belief, wanted, command, one_step).q);
  EXPECT_EQ(one.remaining_point_error,
            (reached(belief, command, one).translation() - wanted.translation()).norm());
}

TEST(Correct, ABeliefThatIsNoNumberCorrectsNothing) {
  const Chain gantry = machines::gantry();
  const AxisState command = gantry_at(0.7, 0.5);
  const Pose wanted = gantry.tool_in_workpiece(command.q);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const Belief belief = [&](const AxisState& state) {
      Pose T = gantry.tool_in_workpiece(state.q);
      T.translation().y() = bad;
      return T;
    };
    const Correction correction = correct(gantry, belief, wanted, command);
    EXPECT_EQ(correction.q, command.q);
    EXPECT_FALSE(correction.converged);
    EXPECT_EQ(correction.remaining_point_error, std::numeric_limits<double>::infinity());
    EXPECT_EQ(correction.remaining_direction_error, std::numeric_limits<double>::infinity());
  }
}

TEST(Correct, TheBeliefIsAskedAtTheTimeAndDirectionOfTheCommand) {
  const Chain gantry = machines::gantry();
  AxisState command = gantry_at(0.7, 0.5);
  command.time_s = 12.5;
  command.direction = {1, -1, 1, 0, -1, 0, 0, 0};
  command.stroke = {3, 1, 4, 1, 5, 0, 0, 0};
  command.spindle_speed = 99.0;
  int asked = 0;
  const Belief belief = [&](const AxisState& state) {
    ++asked;
    EXPECT_EQ(state.time_s, command.time_s);
    EXPECT_EQ(state.direction, command.direction);
    EXPECT_EQ(state.stroke, command.stroke);
    EXPECT_EQ(state.spindle_speed, command.spindle_speed);
    Pose T = gantry.tool_in_workpiece(state.q);
    T.translation().x() += 0.01;
    return T;
  };
  const Correction correction =
      correct(gantry, belief, gantry.tool_in_workpiece(command.q), command);
  EXPECT_TRUE(correction.converged);
  EXPECT_GE(asked, 2);
}

}  // namespace
}  // namespace abbe::sim::compensation
