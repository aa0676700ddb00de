#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"

// What the search of a surface must not lose: moves whose cutter stands in a singular place of the
// ray or of its own frame. A cutter that stands nearly upright, by squareness or a turned head,
// cuts a hollow with its far side. Its depth is first order in the lean, so it is there at every
// lean that a machine has.
namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

/// Across a straight pass along x of a cutter that leans by `lean` along it: the lowest place of
/// its ring at an angle `alpha` from x, and the corner around it. (y, z) mm over the tip.
Eigen::Vector2d hollow(const Cutter& cutter, double lean, double alpha) {
  const double r = cutter.corner_radius, ring = cutter.radius - r;
  const double flat = std::sin(lean);  // of the ring, seen along x
  Eigen::Vector2d outward(flat * std::sin(alpha), -std::cos(alpha));
  outward.normalize();
  return Eigen::Vector2d(ring * std::sin(alpha),
                         r * std::cos(lean) - ring * flat * std::cos(alpha)) +
         r * outward;
}

/// A pass along x from -3 R to 3 R with a sample every `step` mm.
CutterMotion leaning_pass(const Cutter& cutter, double lean, double step, bool there_and_back) {
  const Vector3d axis(std::sin(lean), 0.0, std::cos(lean));
  const double half = 3.0 * cutter.radius;
  const int moves = std::max(1, int(std::lround(2.0 * half / step)));
  std::vector<Stop> stops;
  for (int i = 0; i <= moves; ++i) stops.push_back({{half * (2.0 * i / moves - 1.0), 0, 0}, axis});
  if (there_and_back)
    for (int i = moves; i >= 0; --i) stops.push_back(stops[std::size_t(i)]);
  return motion_of(stops);
}

struct Found {
  double worst = 0.0;  // mm, from the closed form
  double pv = 0.0;     // mm
};

Found against_closed_form(const Cutter& cutter, double lean, double width, double step,
                          bool there_and_back) {
  std::vector<Site> sites;
  std::vector<double> expected;
  const double ring = cutter.radius - cutter.corner_radius;
  for (int k = 0; k < 8; ++k)
    for (int i = -10; i <= 10; ++i) {
      const Eigen::Vector2d at = hollow(cutter, lean, std::asin(0.5 * width * i / 10 / ring));
      sites.push_back({{(0.0137 + 0.031 * k) * cutter.radius, at.x(), 0.0}});
      expected.push_back(at.y());
    }
  const Surface surface =
      milled_surface(design_of(sites), cutter, leaning_pass(cutter, lean, step, there_and_back));
  Found found;
  for (std::size_t i = 0; i < sites.size(); ++i) {
    const double off = std::abs(surface.residual[Eigen::Index(i)] - expected[i]);
    if (!std::isnan(found.worst)) found.worst = std::isnan(off) ? off : std::max(found.worst, off);
  }
  found.pv = surface.residual.maxCoeff() - surface.residual.minCoeff();
  return found;
}

struct JudgedCutter {
  const char* name;
  Cutter cutter;
  double width;  // mm judged, of the ring
};
const JudgedCutter judged_cutters[] = {{"flat R10", {10, 0, 30}, 12},
                                       {"flat R40", {40, 0, 60}, 48},
                                       {"bull R6 r1", {6, 1, 25}, 6},
                                       {"bull R0.5 r0.1", {0.5, 0.1, 3}, 0.6},
                                       {"bull R100 r99", {100, 99, 120}, 1.5}};

TEST(UprightCutter, LeavesItsHollowAtEveryLean) {
  for (const JudgedCutter& kind : judged_cutters)
    for (const double lean : {1e-9, 1e-7, 20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 0.01})
      for (const double part : {0.01, 0.1, 1.0, 6.0})
        for (const bool back : {false, true}) {
          const Found found =
              against_closed_form(kind.cutter, lean, kind.width, part * kind.cutter.radius, back);
          EXPECT_LE(found.worst, no_difference)
              << kind.name << ", lean " << lean << ", step " << part << " R, back " << back
              << ": PV " << found.pv * 1e3 << " um";
        }
}

TEST(UprightCutter, PeakToValleyOfAPassIsThatOfTheRing) {
  for (const auto& [kind, lean, pv_um] :
       {std::tuple{judged_cutters[0], 100e-6, 0.200}, std::tuple{judged_cutters[1], 200e-6, 1.600},
        std::tuple{judged_cutters[2], 200e-6, 0.200}})
    for (const double step : {0.05, 0.5, 2.0, 20.0}) {
      const Found found = against_closed_form(kind.cutter, lean, kind.width, step, false);
      std::cout << "  " << kind.name << ", " << lean * 1e6 << " urad, step " << step << " mm: PV "
                << found.pv * 1e3 << " um, closed form " << pv_um << "\n";
      EXPECT_NEAR(found.pv * 1e3, pv_um, 1e-4) << kind.name << ", step " << step;
    }
}

/// Where a small ball touches a plane, the normal runs through its middle and out behind it.
TEST(SmallBall, LeavesThePlaneThatItTouches) {
  const Cutter ball{0.15, 0.15, 2};
  const unsigned seed = 31;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
  for (int plane = 0; plane < 1000; ++plane) {
    const Vector3d n = any().normalized(), x = n.unitOrthogonal();
    const Vector3d axis = (n + 0.2 * x).normalized();
    std::vector<Stop> stops;
    for (int k = 0; k <= 4; ++k) stops.push_back({0.5 * k * x + ball.radius * (n - axis), axis});
    for (const double along : {0.25, 0.75, 1.1, 1.3}) {  // vertices that share nothing
      const Surface surface = milled_surface(design_of({{along * x, n}}), ball, motion_of(stops));
      EXPECT_LE(std::abs(surface.residual[0]), no_difference)
          << "seed " << seed << ", normal " << n.transpose() << ", " << along << " mm along";
    }
  }
}

}  // namespace
}  // namespace abbe::cutting
