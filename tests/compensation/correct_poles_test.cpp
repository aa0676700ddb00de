#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "tests/compensation/believed.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Pose;

/// A place where two turns lean the tool the same way, or one of them not at all.
struct Pole {
  const char* name;
  Chain chain;
  int tilt;         ///< the joint that leads to the pole
  double at = 0.0;  ///< rad, where the pole is
};

std::vector<Pole> poles() {
  return {{"gantry", machines::gantry(), 4},
          {"trunnion", machines::trunnion(), 1},
          {"head_head", machines::head_head(), 4},
          {"nutating_head, upright", machines::nutating_head(), 4},
          {"nutating_head, level", machines::nutating_head(), 4, pi},
          {"nutating_table, upright", machines::nutating_table(), 1}};
}

const double near[] = {0.0,
                       1e-15,
                       -1e-15,
                       1e-12,
                       -1e-12,
                       1e-9,
                       -1e-9,
                       1e-6,
                       1e-4,
                       -1e-4,
                       0.01 * units::deg,
                       -0.01 * units::deg,
                       1e-3,
                       -1e-3,
                       5e-3,
                       0.014,
                       0.019,
                       0.02,
                       0.021,
                       -0.021,
                       0.05};

AxisState command_at(const Pole& pole, double from_pole) {
  AxisState command;
  command.q = kinematics::AxisVector::Zero(pole.chain.size());
  for (int i = 0; i < pole.chain.size(); ++i)
    command.q[i] = pole.chain.joints()[std::size_t(i)].motion == kinematics::Motion::Linear
                       ? 40.0 - 30.0 * i
                       : 0.7;
  command.q[pole.tilt] = pole.at + from_pole;
  return command;
}

double leaning(const Pose& T, const Pose& wanted) {
  return (T.linear().col(2) - wanted.linear().col(2)).norm();
}

TEST(CorrectAtPoles, TurnsStayBoundedAndTheBallCentreIsServed) {
  constexpr std::uint64_t seed = 20260106;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  CorrectOptions options;
  options.functional_height = 5.0;
  for (const Pole& pole : poles()) {
    double worst_turn = 0.0, worst_left = 0.0, worst_before = 0.0;
    for (std::uint64_t machine = 0; machine < 20; ++machine) {
      const Belief belief = believed(
          pole.chain, errors::bind(typical_errors(pole.chain, seed + machine), pole.chain));
      for (const double from_pole : near) {
        SCOPED_TRACE(testing::Message()
                     << pole.name << " " << from_pole << " off, machine " << machine);
        const AxisState command = command_at(pole, from_pole);
        const Pose wanted = pole.chain.tool_in_workpiece(command.q);
        const Correction correction = correct(pole.chain, belief, wanted, command, options);
        ASSERT_TRUE(correction.q.allFinite());
        EXPECT_TRUE(correction.converged);
        for (int i = 0; i < pole.chain.size(); ++i) {
          if (pole.chain.joints()[std::size_t(i)].motion != kinematics::Motion::Rotary) continue;
          const double turn = std::abs(correction.q[i] - command.q[i]);
          EXPECT_LE(turn, options.rotary_bound * (1 + 1e-12));
          worst_turn = std::max(worst_turn, turn);
        }
        EXPECT_LT(correction.remaining_point_error, 1e-8);
        AxisState corrected = command;
        corrected.q = correction.q;
        const Pose reached = belief(corrected);
        const Vector3d centre(0, 0, 5);
        EXPECT_LT((reached * centre - wanted * centre).norm(), 1e-8);
        EXPECT_NEAR(correction.remaining_direction_error, leaning(reached, wanted), 1e-12);
        const double before = leaning(belief(command), wanted);
        EXPECT_LE(correction.remaining_direction_error, before * 1.001 + 1e-9);  // never made worse
        worst_left = std::max(worst_left, correction.remaining_direction_error);
        worst_before = std::max(worst_before, before);
      }
    }
    std::cout << pole.name << ": largest turn " << worst_turn / units::deg << " deg, leaning "
              << worst_before / units::urad << " urad before, " << worst_left / units::urad
              << " urad left\n";
  }
}

// With A = a the turns of the gantry lean the tool by 1 (A) and sin a (C), at right angles. What C
// serves fades as s^2 / (s^2 + d^2) with the damping d = s0 - s.
TEST(CorrectAtPoles, TheWeakWayFadesByItsFormulaAndTheStrongOneIsServedInFull) {
  const Chain gantry = machines::gantry();
  errors::GeometricErrors wrong;
  const double across = 23e-6, along = -31e-6;
  wrong.elements.push_back(
      {errors::parse_element_name("EAS"), {{errors::Constant{along}, {}, {}, {}, 1.0}}});
  wrong.elements.push_back(
      {errors::parse_element_name("EBS"), {{errors::Constant{across}, {}, {}, {}, 1.0}}});
  const Belief belief = believed(gantry, errors::bind(wrong, gantry));
  CorrectOptions options;
  options.rotary_bound = 1.0;
  for (const double a : near) {
    SCOPED_TRACE(testing::Message() << "A " << a);
    AxisState command;
    command.q.resize(6);
    command.q << 0.7, 40, -30, 20, a, 0;
    const Pose wanted = gantry.tool_in_workpiece(command.q);
    const Correction correction = correct(gantry, belief, wanted, command, options);
    const double s = std::abs(std::sin(a));
    const double d = std::max(options.min_tilt_ratio - s, 0.0);
    const double left = across * d * d / (s * s + d * d);
    const double turn = across * s / (s * s + d * d);
    // a lean of e tilts the ways themselves by e, and C's correction c turns them by c
    EXPECT_NEAR(correction.remaining_direction_error, left,
                across * (60e-6 / 0.02 + 5.0 * turn) + 1e-12);
    EXPECT_NEAR(std::abs(correction.q[0] - command.q[0]), turn,
                0.01 * turn + across * 60e-6 / 4e-4);
    EXPECT_NEAR(correction.q[4] - command.q[4], -along, 1e-8 + turn * 60e-6);
    EXPECT_LE(turn, 1.21 / options.min_tilt_ratio * across);
  }
}

TEST(CorrectAtPoles, WithoutDampingTheBoundAloneHolds) {
  constexpr std::uint64_t seed = 20260107;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  CorrectOptions options;
  options.min_tilt_ratio = 0.0;
  int asked = 0, converged = 0;
  for (const Pole& pole : poles()) {
    const Belief belief =
        believed(pole.chain, errors::bind(typical_errors(pole.chain, seed), pole.chain));
    for (const double from_pole : near) {
      SCOPED_TRACE(testing::Message() << pole.name << " " << from_pole << " off");
      const AxisState command = command_at(pole, from_pole);
      const Pose wanted = pole.chain.tool_in_workpiece(command.q);
      const Correction correction = correct(pole.chain, belief, wanted, command, options);
      ASSERT_TRUE(correction.q.allFinite());
      for (int i = 0; i < pole.chain.size(); ++i) {
        if (pole.chain.joints()[std::size_t(i)].motion != kinematics::Motion::Rotary) continue;
        EXPECT_LE(std::abs(correction.q[i] - command.q[i]), options.rotary_bound * (1 + 1e-12));
      }
      ++asked;
      if (!correction.converged) continue;
      ++converged;
      EXPECT_LT(correction.remaining_point_error, 1e-8);
    }
  }
  std::cout << "undamped, " << converged << " of " << asked << " converge\n";
  EXPECT_GT(2 * converged, asked);
}

TEST(CorrectAtPoles, ALeanBeyondTheBoundIsServedAsFarAsTheBoundAllows) {
  const Chain gantry = machines::gantry();
  errors::GeometricErrors wrong;
  const double leans = 3e-3;  // about X: A alone could mend it
  wrong.elements.push_back(
      {errors::parse_element_name("EAS"), {{errors::Constant{leans}, {}, {}, {}, 1.0}}});
  const Belief belief = believed(gantry, errors::bind(wrong, gantry));
  AxisState command;
  command.q.resize(6);
  command.q << 0.7, 40, -30, 20, 0.5, 0;
  const Correction correction =
      correct(gantry, belief, gantry.tool_in_workpiece(command.q), command);
  const double bound = CorrectOptions{}.rotary_bound;
  EXPECT_NEAR(correction.q[4] - command.q[4], -bound, 1e-15);
  EXPECT_NEAR(correction.remaining_direction_error, leans - bound, 1e-8);
  EXPECT_LT(correction.remaining_point_error, 1e-8);
  EXPECT_TRUE(correction.converged);
}

}  // namespace
}  // namespace abbe::sim::compensation
