#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "tests/kinematics/machines.h"

namespace abbe::kinematics {
namespace {

// A chain may turn by small angles in a cheaper way than motion() does; nobody may see it.
TEST(ChainDeviation, IsTheProductOfTheExactMotionsAtEverySizeOfTheAngle) {
  const unsigned seed = 20260111;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Pose home = machines::placed({1, 2, 3}, 0.3, {1, 2, 2});
  const Eigen::Vector3d point_x(300, -200, 450), point_y(-120, 80, 700);
  const Chain chain({machines::slide('X', Side::Tool, machines::x, point_x),
                     machines::slide('Y', Side::Tool, machines::y, point_y)},
                    Pose::Identity(), home);
  double worst_turn = 0.0, worst_place = 0.0;
  for (const double size : {0.0, 1e-300, 1e-150, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 3.1e-3, 3.2e-3,
                            1e-2, 0.1, 1.0, 3.14, 10.0})
    for (int i = 0; i < 200; ++i) {
      const auto any = [&] { return Eigen::Vector3d(unit(random), unit(random), unit(random)); };
      std::vector<JointDeviation> wrong(2);
      for (JointDeviation& one : wrong) {
        one.motion << any(), size * any().normalized();
        one.location << any(), size * any().normalized();
      }
      AxisVector q(2);
      q << 100.0 * unit(random), 100.0 * unit(random);
      const Pose expected =
          motion(wrong[0].location, point_x) * Eigen::Translation3d(q[0] * machines::x) *
          motion(wrong[0].motion, point_x) * motion(wrong[1].location, point_y) *
          Eigen::Translation3d(q[1] * machines::y) * motion(wrong[1].motion, point_y) * home;
      const Pose seen = chain.tool_in_workpiece(q, wrong);
      worst_turn = std::max(worst_turn, (seen.linear() - expected.linear()).cwiseAbs().maxCoeff());
      worst_place = std::max(worst_place, (seen.translation() - expected.translation()).norm());
    }
  std::cout << "largest difference: " << worst_turn << ", " << worst_place << " mm\n";
  EXPECT_LT(worst_turn, 4e-15);
  EXPECT_LT(worst_place, 4e-12);
}

}  // namespace
}  // namespace abbe::kinematics
