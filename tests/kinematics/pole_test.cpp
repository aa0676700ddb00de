// Poles against what poses show: the tool's direction, and what turning an axis does to it.

#include "kinematics/inverse_kinematics.h"

#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "kinematics/pose.h"
#include "tests/kinematics/machines.h"

namespace abbe::kinematics {
namespace {

using Eigen::Vector3d;

Vector3d direction_at(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2);
}

AxisVector with(AxisVector q, int joint, double value) {
  q[joint] = value;
  return q;
}

/// The line of the pole axis in the workpiece, measured: what stays while it turns.
double angle_to_pole(const Chain& chain, const AxisVector& q, int axis) {
  const Vector3d a = direction_at(chain, q);
  const Vector3d b = direction_at(chain, with(q, axis, q[axis] + pi));
  // half a turn about a line at angle t takes the tool by 2 t, or by pi - 2 (pi/2 - t) beyond
  const double moved = angle_between(a, b);
  return 0.5 * moved;
}

TEST(Pole, ByHandOnTheGantry) {
  const Chain chain = machines::gantry();
  const int c = *chain.find('C'), a = *chain.find('A');
  const auto at = [&](double tilt) {
    return with(AxisVector::Zero(chain.size()), a, tilt * units::deg);
  };
  const auto through = nearest_pole(chain, at(-5), at(3));
  ASSERT_TRUE(through);
  EXPECT_EQ(through->axis, c);
  EXPECT_EQ(through->other, a);
  EXPECT_LT(through->angle, 1e-15);
  EXPECT_NEAR(nearest_pole(chain, at(2), at(7))->angle / units::deg, 2.0, 1e-12);
  EXPECT_NEAR(nearest_pole(chain, at(-7), at(-3))->angle / units::deg, 3.0, 1e-12);
  // upside down it is a pole as well, and a turn away the same one
  EXPECT_LT(nearest_pole(chain, at(170), at(190))->angle, 1e-15);
  EXPECT_LT(nearest_pole(chain, at(350), at(365))->angle, 1e-14);
}

TEST(Pole, ThereIsNoneWithoutTwoAxesThatTurnTheTool) {
  const AxisVector q = AxisVector::Zero(machines::moving_table().size());
  EXPECT_FALSE(nearest_pole(machines::moving_table(), q, q));
  const Chain lathe = machines::platform();
  EXPECT_FALSE(nearest_pole(lathe, AxisVector::Zero(lathe.size()), AxisVector::Zero(lathe.size())));
}

TEST(Pole, IsWhatPosesShowOnEveryMachine) {
  const unsigned seed = 20261126;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  double worst = 0.0, worst_turn = 0.0;
  for (const machines::Named& machine : machines::five_axis())
    for (int i = 0; i < 1000; ++i) {
      const Chain& chain = machine.chain;
      const AxisVector from = machines::anywhere(chain, random),
                       to = machines::anywhere(chain, random);
      const auto here = nearest_pole(chain, from, from);
      ASSERT_TRUE(here) << machine.name;
      worst = std::max(worst, std::abs(here->angle - angle_to_pole(chain, from, here->axis)));
      // along the way none is nearer, and one is as near
      const auto way = nearest_pole(chain, from, to);
      double least = pi;
      for (int k = 0; k <= 200; ++k)
        least = std::min(least, angle_to_pole(chain, from + k / 200.0 * (to - from), way->axis));
      EXPECT_LE(way->angle, least + 1e-12) << machine.name;
      EXPECT_GE(way->angle, least - pi / 200.0 * std::abs(to[way->other] - from[way->other]))
          << machine.name;
      // no small turn brings the tool nearer to a direction than the nearest one
      const Vector3d wanted = direction_at(chain, to);
      const double turn = nearest_rotary_position(chain, *here, from, wanted);
      const auto off = [&](double by) {
        return angle_between(direction_at(chain, with(from, here->other, turn + by)), wanted);
      };
      for (const double by : {-0.3, -1e-3, 1e-3, 0.3})
        worst_turn = std::max(worst_turn, off(0) - off(by));
    }
  std::cout << "angle to the pole within " << worst << " rad; nearest turn missed by " << worst_turn
            << " rad\n";
  EXPECT_LT(worst, 1e-12);
  EXPECT_LT(worst_turn, 1e-12);
}

}  // namespace
}  // namespace abbe::kinematics
