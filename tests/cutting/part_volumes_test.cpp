// Volumes of rest material and gouges against closed forms: inner corners, edges, whole pockets.

#include "cutting/stock/part_volumes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "tests/cutting/held_parts.h"
#include "tests/cutting/stock_parts.h"

namespace abbe::cutting {
namespace {

using namespace held_parts;
using Eigen::Vector3d;

double volume_of(const Findings& found, FindingKind kind) {
  return found.sums[std::size_t(kind)].volume;
}

/// The block of `full_block` in dexels that lie across it.
Stock turned_block(const Eigen::Isometry3d& T_wk, double spacing) {
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.linear() =
      (Eigen::AngleAxisd(0.37, Vector3d::UnitX()) * Eigen::AngleAxisd(0.61, Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.29, Vector3d::UnitZ()))
          .toRotationMatrix();
  const Design solid = pocketed(pocket_x, pocket_y, block.z()).design(turn);
  return make_stock(MeshBlank{solid.vertices, solid.triangles}, T_wk * turn.inverse(),
                    {spacing, true});
}

Stock block_of(const Eigen::Isometry3d& T_wk, double spacing, bool turned) {
  return turned ? turned_block(T_wk, spacing) : full_block(T_wk, spacing);
}

/// The pocket by a flat cutter, line by line and once around its walls.
void mill_with_cutter(Stock& stock, const Eigen::Isometry3d& T, double radius, double floor) {
  const Cutter flat{radius, 0, 40};
  const double x0 = pocket_x[0] + radius, x1 = pocket_x[1] - radius, y0 = pocket_y[0] + radius,
               y1 = pocket_y[1] - radius;
  const auto cut = [&](double xa, double ya, double xb, double yb, int line) {
    remove(stock, flat, {T * pose({xa, ya, floor}), T * pose({xb, yb, floor}), line, false});
  };
  for (double y = y0; y < y1; y += radius) cut(x0, y, x1, y, 3);
  cut(x0, y0, x1, y0, 4);
  cut(x1, y0, x1, y1, 5);
  cut(x1, y1, x0, y1, 6);
  cut(x0, y1, x0, y0, 7);
}

TEST(PartVolumes, TheFourCornersOfAPocketThatAFlatCutterLeaves) {
  const unsigned seed = 20301;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double radius = 4, height = block.z() - pocket_floor;
  const double expected = 4 * (1 - pi / 4) * radius * radius * height;
  for (const bool turned : {false, true})
    for (const double spacing : {0.5, 0.25}) {
      const Eigen::Isometry3d T = any_pose(random);
      Stock stock = block_of(T, spacing, turned);
      mill_with_cutter(stock, T, radius, pocket_floor);
      const Held all =
          held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 0.01));
      std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Rest)
                << " of " << expected << " mm^3\n";
      EXPECT_EQ(regions(all.found, FindingKind::Rest), 4u);
      EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
      EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.05 * spacing * expected);
    }
}

TEST(PartVolumes, CornersWithDexelsOfOneDirectionAreThoseOfTheDexels) {
  const double radius = 4, height = block.z() - pocket_floor, spacing = 0.25;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Stock stock = full_block(T, spacing, false);
  mill_with_cutter(stock, T, radius, pocket_floor);
  int lines = 0;  // of material where the design has none
  const DexelField& field = stock.fields.front();
  for (int j = 0; j < field.size[1]; ++j)
    for (int i = 0; i < field.size[0]; ++i) {
      const Vector3d p = stock.origin_k + spacing * Vector3d(i, j, 0);
      const bool in_pocket =
          p.x() > pocket_x[0] && p.x() < pocket_x[1] && p.y() > pocket_y[0] && p.y() < pocket_y[1];
      const DexelLine& line =
          field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)];
      if (in_pocket && line.length() > 15) ++lines;
    }
  const double expected = lines * spacing * spacing * height;
  const Held all =
      held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 0.01));
  std::cout << volume_of(all.found, FindingKind::Rest) << " of " << expected << " mm^3 in dexels, "
            << 4 * (1 - pi / 4) * radius * radius * height << " in truth\n";
  EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.02 * expected);
}

TEST(PartVolumes, APocketThatWasNeverCutIsLeftWhole) {
  const unsigned seed = 20302;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double expected =
      (pocket_x[1] - pocket_x[0]) * (pocket_y[1] - pocket_y[0]) * (block.z() - pocket_floor);
  for (const bool turned : {false, true}) {
    const Eigen::Isometry3d T = any_pose(random);
    const Held all = held(block_of(T, 0.5, turned),
                          pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
    std::cout << volume_of(all.found, FindingKind::Rest) << " of " << expected << " mm^3\n";
    EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.005 * expected);
    EXPECT_TRUE(all.found.list.front().is_at_least) << "the depth";
  }
}

TEST(PartVolumes, ASlotThatRunsOutOfAPocketWall) {
  // 2 mm deep from the pocket through the wall to the outside: gouged over two edges of the design
  const unsigned seed = 20303;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double y0 = 11.37, y1 = 19.81, deep = 2.0;
  const double expected = (block.x() - pocket_x[1]) * (y1 - y0) * deep;
  for (const double spacing : {0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor, {14.3, 26.9}, {9.1, 19.6});
    carve(stock, {20, y0, block.z() - deep}, {50, y1, 30}, 12);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Gouge)
              << " of " << expected << " mm^3\n";
    EXPECT_EQ(regions(all.found, FindingKind::Gouge), 1u);
    EXPECT_NEAR(volume_of(all.found, FindingKind::Gouge), expected, 0.05 * spacing * expected);
  }
}

TEST(PartVolumes, AHoleThroughTheWholePart) {
  const unsigned seed = 20304;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double radius = 3, expected = pi * radius * radius * block.z();
  for (const bool turned : {false, true})
    for (const double spacing : {0.5, 0.25}) {
      const Eigen::Isometry3d T = any_pose(random);
      Stock stock = block_of(T, spacing, turned);
      remove(stock, Cutter{radius, 0, 60},
             {T * pose({4.21, 15.37, 30}), T * pose({4.21, 15.37, -5}), 9, false});
      const Held all =
          held(stock, pocketed(pocket_x, pocket_y, block.z()).design(T), along_grid(T));
      std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Gouge)
                << " of " << expected << " mm^3\n";
      EXPECT_NEAR(volume_of(all.found, FindingKind::Gouge), expected, 0.015 * spacing * expected);
    }
}

TEST(PartVolumes, AGrooveAcrossADome) {
  const double R = 60, radius = 10, floor = 28;
  const Vector3d centre(50, 50, -30);
  Stock stock =
      make_stock(BoxBlank{{0, 0, 0}, {100, 100, 31}}, Eigen::Isometry3d::Identity(), {0.5, true});
  remove(stock, Cutter{radius, 0, 60}, {pose({50, -20, floor}), pose({50, 120, floor}), 1, false});
  double expected = 0.0;
  const double step = 0.01;
  for (double x = -radius + step / 2; x < radius; x += step)
    for (double y = -30 + step / 2; y < 30; y += step)
      expected +=
          step * step * std::max(0.0, std::sqrt(R * R - x * x - y * y) + centre.z() - floor);
  const DesignDistance dome_of(dome(R, 45, centre, 60, 160));
  const StockSkin skin = stock_skin(stock);
  const Findings found = findings(skin, part_deviation(skin, dome_of), dome_of);
  std::cout << volume_of(found, FindingKind::Gouge) << " of " << expected << " mm^3\n";
  EXPECT_NEAR(volume_of(found, FindingKind::Gouge), expected, 0.01 * expected);
}

TEST(PartVolumes, AShoulderThatARoundNoseLeaves) {
  // a step from radius 12 to 10 with a fillet of 0.8 left in it, on the axis x through (1, 2, 3)
  const double high = 12, low = 10, fillet = 0.8, step_at = 15.013;
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << 0, high, 30, high;
  TurnedStock stock = make_turned_stock(profile, 0.01, {1, 2, 3}, Vector3d::UnitX());
  for (Eigen::Index i = 0; i < stock.radius.size(); ++i) {
    const double along = stock.first + stock.spacing * double(i);
    stock.line[std::size_t(i)] = 4;
    if (along > step_at) continue;
    const double to_wall = step_at - along;
    stock.radius[i] = low;
    if (to_wall < fillet)
      stock.radius[i] =
          low + fillet - std::sqrt(fillet * fillet - (fillet - to_wall) * (fillet - to_wall));
  }
  Quads steps;
  const int around = 180;
  const auto ring = [&](double along, double r, int k) {
    const double f = 2 * pi * k / around;
    const Vector3d across = Vector3d::UnitX().unitOrthogonal();
    return Vector3d(Vector3d(1 + along, 2, 3) +
                    r * (std::cos(f) * across + std::sin(f) * Vector3d::UnitX().cross(across)));
  };
  const std::vector<std::array<double, 2>> corners{{0, 0},          {0, low},   {step_at, low},
                                                   {step_at, high}, {30, high}, {30, 0}};
  for (std::size_t c = 0; c + 1 < corners.size(); ++c)
    for (int k = 0; k < around; ++k)
      steps.add(ring(corners[c][0], corners[c][1], k), ring(corners[c][0], corners[c][1], k + 1),
                ring(corners[c + 1][0], corners[c + 1][1], k + 1),
                ring(corners[c + 1][0], corners[c + 1][1], k));
  std::erase_if(steps.triangles,
                [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  const Design design = steps.design();
  FindingOptions options;
  options.undercut_along = std::nullopt;
  options.rest = options.gouge = 0.005;
  const Held all = held(stock_skin(stock), design, options);
  // Pappus: a square less the quarter circle about its far corner, whose moment is pi/4 - 1/3
  const double area = (1 - pi / 4) * fillet * fillet;
  const double from_corner = fillet * (5.0 / 6 - pi / 4) / (1 - pi / 4);
  const double expected = area * 2 * pi * (low + from_corner);
  std::cout << "corner " << volume_of(all.found, FindingKind::Rest) << " of " << expected
            << " mm^3\n";
  EXPECT_EQ(regions(all.found, FindingKind::Rest), 1u);
  EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.01 * expected);
}

}  // namespace
}  // namespace abbe::cutting
