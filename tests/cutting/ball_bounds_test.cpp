#include "cutting/surface/ball_entry.h"
#include "tests/cutting/any_move.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

/// Of balls that are met from below: bounds are never above the entry, and near to it.
TEST(BallBounds, AreNoMoreThanTheEntry) {
  Random random(1801);
  long entries = 0, unknown = 0, missed = 0, rays_tried = 0;
  double highest = -1e300, lowest = 0.0;  // of bound - entry, R
  for (int n = 0; n < 60000 * longer(10); ++n) {
    const double R = random.decades(-1, 2), band = R * random.decades(-2, 0.3);
    const Cutter cutter{R, R, 3 * R};
    const Move move = any_move(random, R, [&] {
      return random.once_in(3) ? Vector3d(Vector3d::UnitZ()) : random.near(Vector3d::UnitZ(), 0.5);
    });
    const Vector3d normal = random.near(Vector3d::UnitZ(), 0.4);
    const double lean = random.decades(-9, -1);
    const BallChord chord(cutter, move, Vector3d::Zero());
    Ray8 eight;
    std::array<Ray, 8> rays;
    double far = 0.0, around = 0.0, tilt = 0.0;
    for (std::size_t i = 0; i < 8; ++i) {
      rays[i] = {R * random.decades(-6, 0) * random.any(),
                 random.turned_evenly(normal, lean * random.in(0, 1)), band};
      far = std::max(far, rays[i].point.norm());
      const Vector3d end = rays[i].point + band * rays[i].normal;
      around = std::max(around, end.norm());
      tilt = std::max(tilt, normal.cross(rays[i].normal).norm() / normal.dot(rays[i].normal));
      for (int d = 0; d < 3; ++d) {
        eight.p[d][i] = float(rays[i].point[d]);
        eight.n[d][i] = float(rays[i].normal[d]);
      }
    }
    if (!(chord.distance + far < 4.9 * R) ||
        !is_below_centre(cutter, move, Vector3d::Zero(), around, normal, tilt))
      continue;
    std::array<Entry8, 1> bounds;
    ball_bounds({&chord, 1}, eight, bounds);
    for (std::size_t i = 0; i < 8; ++i) {
      ++rays_tried;
      const double bound = bounds[0].min_s[i];
      const auto entry = first_entry(cutter, move, rays[i], band);
      unknown += bound < -1e29;
      missed += bound > 1e29;
      if (!entry || bound < -1e29) continue;
      ASSERT_LE(bound, entry->s) << "seed 1801, case " << n << ", R " << R;
      if (entry->s <= -band) continue;
      ++entries;
      highest = std::max(highest, (bound - entry->s) / R);
      lowest = std::min(lowest, (bound - entry->s) / R);
    }
  }
  std::cout << rays_tried << " rays (seed 1801): " << entries << " entries, bounds " << -highest
            << " to " << -lowest << " R below them; " << unknown << " not known, " << missed
            << " missed\n";
  EXPECT_GT(entries, rays_tried / 20);
  EXPECT_LT(unknown, rays_tried / 2);
  EXPECT_GT(lowest, -1e-2);
}

TEST(BallBounds, HoldWhereTheHeightAboveTheCentreDoes) {
  const Cutter cutter{5, 5, 20};
  Move move{Vector3d::Zero(), Vector3d(1, 0, 0), Vector3d::UnitZ(), Vector3d::UnitX()};
  const Vector3d up = Vector3d::UnitZ();
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 4.9}, 0.09, up, 0.1));
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 4.9}, 0.11, up, 0.1));
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 1}, 0.1, Vector3d::UnitX(), 0.0));
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 1}, 0.1, Vector3d::UnitX(), 0.01));
  move.step = {0, 0, -3};  // sinks past it
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 4}, 0.1, up, 0.1));
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 1.8}, 0.1, up, 0.1));
  move.step = {0, 0, 3};
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 4}, 0.1, up, 0.1));
}

}  // namespace
}  // namespace abbe::cutting
