#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "cutting/part/mesh_file.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using Corners = std::vector<Vector3d>;

double area(const Corners& corners, const std::vector<std::array<int, 3>>& triangles,
            const Vector3d& normal) {
  double sum = 0.0;
  for (const auto& [a, b, c] : triangles) {
    const auto at = [&](int i) { return corners[std::size_t(i)]; };
    const double one = 0.5 * (at(b) - at(a)).cross(at(c) - at(a)).dot(normal);
    EXPECT_GT(one, 0.0) << "every triangle is turned as the polygon is";
    sum += one;
  }
  return sum;
}

TEST(Polygon, AQuadrilateralIsSplitAlongItsShorterDiagonal) {
  const Corners kite = {{0, 0, 0}, {3, -1, 0}, {8, 0, 0}, {3, 1, 0}};
  const auto triangles = triangulate(kite);
  ASSERT_EQ(triangles.size(), 2u);
  for (const auto& t : triangles) {
    EXPECT_TRUE(std::count(t.begin(), t.end(), 1) == 1 && std::count(t.begin(), t.end(), 3) == 1);
  }
  EXPECT_NEAR(area(kite, triangles, Vector3d::UnitZ()), 8.0, 1e-12);
}

TEST(Polygon, AHollowCornerKeepsTheDiagonalInside) {
  const Corners dart = {{0, 0, 0}, {4, 1, 0}, {0, 2, 0}, {1, 1, 0}};
  const auto triangles = triangulate(dart);
  ASSERT_EQ(triangles.size(), 2u);
  EXPECT_NEAR(area(dart, triangles, Vector3d::UnitZ()), 3.0, 1e-12);
}

TEST(Polygon, RandomStarsAreFilledExactly) {
  const unsigned seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> radius(1.0, 4.0), angle(-3.0, 3.0);
  std::uniform_int_distribution<int> size(3, 40);
  for (int i = 0; i < 300; ++i) {
    const int n = size(random);
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(angle(random), Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(angle(random), Vector3d::UnitY()))
                                     .toRotationMatrix();
    Corners star;
    for (int k = 0; k < n; ++k) {
      const double phi = 2 * std::numbers::pi * k / n, r = radius(random);
      star.push_back(turn * Vector3d(r * std::cos(phi), r * std::sin(phi), 0));
    }
    double expected = 0.0;
    for (int k = 0; k < n; ++k)
      expected += 0.5 * star[std::size_t(k)].cross(star[std::size_t((k + 1) % n)]).dot(turn.col(2));
    const auto triangles = triangulate(star);
    ASSERT_EQ(int(triangles.size()), n - 2);
    EXPECT_NEAR(area(star, triangles, turn.col(2)), expected, 1e-10);
  }
}

TEST(Polygon, AnOutlineThatCrossesItselfIsRefused) {
  EXPECT_TRUE(triangulate({{0, 0, 0}, {10, 10, 0}, {10, 0, 0}, {0, 10, 0}}).empty());
  EXPECT_TRUE(triangulate({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}).empty());
}

}  // namespace
}  // namespace abbe::cutting
