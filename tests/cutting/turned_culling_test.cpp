#include <atomic>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/surface/nose_cut.h"
#include "tests/cutting/random.h"
#include "tests/cutting/turned_parts.h"

// The tree over the revolutions of a turning tool against every revolution tried: a window that
// holds the whole motion leaves nothing out.
namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

constexpr double no_turn_is_farther = 1e9;  // rad

NosePath any_path(Random& random, double feed) {
  NosePath path;
  const double height = random.some(0.05), wander = random.some(1e-3), tilt = random.some(0.1);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(tilt, random.any().normalized()).toRotationMatrix();
  const double from = random.decades(-1, 1.5);
  const double to = random.in(0, 3) < 1 ? 0.0 : std::max(0.0, from - 30 * feed);
  const double turns = std::min(60.0, (from - to) / feed) + 1.0;
  const double a_sample = random.decades(-1, 0.7);
  const double angle = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += a_sample) {
    const double r = std::max(to, from - feed * turn);
    const Eigen::Matrix3d wandering =
        Eigen::AngleAxisd(wander, random.any().normalized()).toRotationMatrix();
    path.add(Vector3d(0.25 - 0.05 * r, height, r) + wander * random.any(), angle + two_pi * turn,
             R * wandering);
  }
  path.add(path.T_lt.back().translation(), path.spindle.back() + two_pi, path.T_lt.back().linear());
  return path;
}

TEST(TurnedCulling, LosesNothing) {
  const std::uint64_t seed = 701000;
  const int cases = 40 * longer(15);
  std::atomic<int> rays = 0, cut = 0, late = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Nose nose{random.decades(-1.3, 0.7), {}};
    const double feed = nose.radius * random.decades(-1.5, -0.3);
    const NosePath path = any_path(random, feed);
    const NoseCutSearch swept(nose, motion_of(path));
    for (int ray = 0; ray < 40; ++ray) {
      const std::size_t near = std::size_t(random.in(0, double(path.T_lt.size()) - 0.01));
      const Vector3d centre = path.T_lt[near].translation();
      const double lean = random.in(-0.3, 0.8);
      const double reach = nose.radius * (random.in(0, 3) < 1 ? 0.9999 : random.in(0.5, 1.02));
      const MeridianVertex vertex{centre.x() - std::cos(lean) * reach,
                                  std::max(0.0, centre.z() - std::sin(lean) * reach),
                                  random.in(-10, 10), std::cos(lean), std::sin(lean)};
      const Design design = design_of(std::vector<MeridianVertex>{vertex});
      const Vector3d askew = random.some(0.3) * random.any();
      const Ray in_w{design.vertices.row(0),
                     (design.normals.row(0).transpose() + askew).normalized(), 0.3};
      const auto found = swept.first(in_w);
      const auto tried = swept.first_in_window(in_w, found.value_or(NoseCut{}), no_turn_is_farther);
      ++rays;
      cut += found.has_value();
      const double s = found ? found->s : in_w.band;
      if (!tried || tried->s >= s - 1e-9) continue;
      if (++late < 10)
        ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ", ray " << ray << ": first cut at "
                      << s << ", of every revolution " << tried->s;
    }
  });
  std::cout << "  seeds " << seed << " and on: " << rays << " rays, " << cut << " cut, " << late
            << " late\n";
  EXPECT_EQ(late, 0);
  EXPECT_GT(cut, rays / 2);
}

}  // namespace
}  // namespace abbe::cutting
