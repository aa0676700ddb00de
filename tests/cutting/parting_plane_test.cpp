#include "cutting/stock/separation.h"

#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

namespace abbe::cutting::parting_plane_tests {
namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// Between convex bodies the plane is as far off as they are, and whatever moves then, what is
/// beyond it is no farther than the gap.
TEST(PartingPlane, IsNeverFartherThanTheGap) {
  constexpr unsigned seed = 2641;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1), length(1, 60);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  const auto pose = [&] {
    Pose T(kinematics::rotation(3.0 * vector()));
    T.pretranslate(80.0 * vector());
    return T;
  };
  double worst = 1.0;
  int parted = 0;
  for (int n = 0; n < 300; ++n) {
    const Body a = n % 2 == 0
                       ? make_body(box_mesh({length(random), length(random), length(random)}))
                       : make_body(sphere_mesh(length(random), 0.2));
    const Body b = make_body(cutter_meshes(Cutter{5, n % 3 == 0 ? 5.0 : 1.0, 40}, 0.01));
    const std::vector<Ball> hull = hull_balls(b);
    const Pose T = pose();
    const Gap here = gap(a, Pose::Identity(), b, T);
    if (here.distance < 1e-3 || is_inside(a, Pose::Identity(), b, T)) continue;
    const PartingPlane plane = parting_plane(a, hull, T, here.on_b - here.on_a);
    const double bound = plane_distance(plane, hull, T);
    EXPECT_LE(bound, here.distance * (1 + 1e-9) + 1e-9);
    worst = std::min(worst, bound / here.distance);
    ++parted;
    for (int k = 0; k < 5; ++k) {
      const Pose moved = pose();
      const double then = gap(a, Pose::Identity(), b, moved).distance;
      EXPECT_LE(plane_distance(plane, hull, moved), then * (1 + 1e-9) + 1e-9) << "seed " << seed;
    }
  }
  std::cout << parted << " pairs, the plane at least at " << worst << " of the gap\n";
  EXPECT_GT(parted, 150);
  EXPECT_GT(worst, 0.9);
}

TEST(PartingPlane, WithoutAHullThereIsNone) {
  const Body a = make_body(box_mesh({1, 1, 1}));
  EXPECT_TRUE(hull_balls(a, 7).empty());
  Pose T = Pose::Identity();
  T.translation() = Vector3d(5, 0, 0);
  EXPECT_EQ(plane_distance(parting_plane(a, {}, T, Vector3d::UnitX()), {}, T), 0.0);
  const std::vector<Ball> hull = hull_balls(a);
  EXPECT_NEAR(plane_distance(parting_plane(a, hull, T, Vector3d(4, 0.4, 0)), hull, T), 4.0, 0.02);
}

}  // namespace
}  // namespace abbe::cutting::parting_plane_tests
