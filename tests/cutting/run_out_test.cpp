// The union of a cutter's places by brute force: a point is in it if some place of the axis on a
// fine grid of angles and heights has the point inside the cutter.

#include "cutting/surface/tool.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "tests/kinematics/nan.h"

namespace abbe::cutting {
namespace {

using namespace abbe::literals;

/// How far a point at radius r and height z above the tip lies outside a cutter, mm; < 0 inside.
double outside_by(const Cutter& cutter, double r, double z) {
  const double flat = cutter.radius - cutter.corner_radius;
  const double across = std::max(0.0, r - flat);
  const double below = std::max(0.0, cutter.corner_radius - z);
  const bool in_core = across == 0.0 && below == 0.0;
  const double core = in_core ? -1.0 : std::hypot(across, below) - cutter.corner_radius;
  return std::max({core, r - cutter.radius, -z, z - cutter.flank_length});
}

/// The same of the union, at z above the tip at rest.
double outside_union_by(const Cutter& cutter, double radial, double axial, double r, double z) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 720; ++i) {
    const double angle = i * pi / 720;  // the other half mirrors
    const double from_axis = std::hypot(r - radial * std::cos(angle), radial * std::sin(angle));
    for (int k = -20; k <= 20; ++k)
      least = std::min(least, outside_by(cutter, from_axis, z - axial * k / 20));
    if (radial == 0.0) break;
  }
  return least;
}

struct Compared {
  int inside = 0, outside = 0, only_hull = 0, only_union = 0;
  double deepest = 0.0;  ///< mm, height above the tip to which the hull alone reaches
};

Compared compare(const Cutter& cutter, double radial, double axial) {
  const Cutter hull = with_run_out(cutter, radial, axial);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0, 1);
  Compared found;
  const double grid = 1e-4 * (radial + axial) + axial / 20 + 1e-9;
  for (int i = 0; i < 2000; ++i) {
    const bool at_the_tip = i % 2 == 0;
    const double r = (at_the_tip ? 1.5 * radial + 0.01 : 1.3 * cutter.radius) * unit(random);
    const double z = -1.2 * axial + (at_the_tip ? 0.3 : 1.2 * cutter.flank_length) * unit(random);
    const double in_hull = outside_by(hull, r, z + axial);
    const double in_union = outside_union_by(cutter, radial, axial, r, z);
    if (std::abs(in_hull) < grid || std::abs(in_union) < grid) continue;  // at a skin
    ++(in_hull < 0 ? found.inside : found.outside);
    if (in_hull < 0 && in_union > 0) {
      ++found.only_hull;
      found.deepest = std::max(found.deepest, z);
    }
    if (in_hull > 0 && in_union < 0) ++found.only_union;
  }
  std::cout << "run-out " << radial << " " << axial << " on R " << cutter.radius << " corner "
            << cutter.corner_radius << ": " << found.inside << " in, " << found.outside
            << " out, hull alone " << found.only_hull << " up to " << found.deepest << " mm\n";
  EXPECT_GT(found.inside, 250);
  EXPECT_GT(found.outside, 250);
  EXPECT_EQ(found.only_union, 0);
  return found;
}

TEST(RunOut, IsTheUnionOfThePlacesWhereItSaysSo) {
  EXPECT_EQ(compare({5, 0, 20}, 0.3, 0.0).only_hull, 0);  // a flat end
  EXPECT_EQ(compare({6, 1, 20}, 0.3, 0.0).only_hull, 0);  // a bull nose, flat of 5
  EXPECT_EQ(compare({5, 5, 20}, 0.0, 0.2).only_hull, 0);  // axial alone
  EXPECT_EQ(compare({6, 1, 20}, 0.3, 0.2).only_hull, 0);  // every height at every angle
}

TEST(RunOut, BallLeavesAHollowNoDeeperThanStated) {
  for (const double radial : {0.2, 0.5, 1.0}) {
    const Compared found = compare({5, 5, 20}, radial, 0.0);
    const double stated = radial * radial / (5 + std::sqrt(25 - radial * radial));
    EXPECT_GT(found.only_hull, 0) << radial;
    EXPECT_LE(found.deepest, stated + 1e-4) << radial;
  }
  EXPECT_NEAR(1.0_um * 1.0_um / (5 + std::sqrt(25 - 1.0_um * 1.0_um)), 0.1_nm, 1e-12);
}

TEST(RunOut, SynchronousRunOutEnlargesTheEffectiveRadius) {
  const Cutter larger = with_run_out({8, 1, 25}, 12.0_um, 3.0_um);
  EXPECT_DOUBLE_EQ(larger.radius, 8.012);
  EXPECT_DOUBLE_EQ(larger.corner_radius, 1.0);
  EXPECT_DOUBLE_EQ(larger.flank_length, 25.006);
  const Cutter same = with_run_out({8, 1, 25}, 0.0, 0.0);
  EXPECT_EQ(same.radius, 8.0);
  EXPECT_EQ(same.flank_length, 25.0);
}

TEST(RunOut, AmountsThatCannotBeAreRefusedByName) {
  EXPECT_THROW(with_run_out({}, -1e-3, 0), std::invalid_argument);
  EXPECT_THROW(with_run_out({}, nan, 0), std::invalid_argument);
  try {
    with_run_out({}, 0, -1e-3);
    FAIL();
  } catch (const std::invalid_argument& fault) {
    EXPECT_STREQ(fault.what(), "expected axial run-out of at least 0 mm, seen -0.001");
  }
}

}  // namespace
}  // namespace abbe::cutting
