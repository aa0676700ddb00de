#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "cutting/part/design_points.h"
#include "cutting/stock/body.h"
#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

/// A plate of 40 x 40 mm, top at z = 0, with a vertex every 2 mm above and below.
Design plate(double thickness) {
  constexpr int n = 21;
  Design design;
  design.vertices.resize(2 * n * n, 3);
  design.normals.resize(2 * n * n, 3);
  std::vector<Eigen::Vector3i> triangles;
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int v = side * n * n + j * n + i;
        design.vertices.row(v) << 2.0 * i - 20, 2.0 * j - 20, side == 0 ? 0.0 : -thickness;
        design.normals.row(v) << 0, 0, side == 0 ? 1 : -1;
        if (i + 1 == n || j + 1 == n) continue;
        const int b = v + 1, c = v + n + 1, d = v + n;
        const auto add = [&](int p, int q, int r) {
          triangles.push_back(side == 0 ? Eigen::Vector3i(p, q, r) : Eigen::Vector3i(p, r, q));
        };
        add(v, b, c);
        add(v, c, d);
      }
  design.triangles.resize(Eigen::Index(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    design.triangles.row(Eigen::Index(t)) = triangles[t].transpose();
  design.area = vertex_area(design.vertices, design.triangles);
  design.judged.assign(std::size_t(design.vertices.rows()), 1);
  return design;
}

int count(const Surface& surface, VertexStatus status) {
  return int(std::count(surface.status.begin(), surface.status.end(), status));
}

/// Passes along x every 2 mm at a height, the axis up or down.
std::vector<Stop> passes(double z, double axis) {
  std::vector<Stop> stops;
  for (int i = 0; i <= 20; ++i)
    for (const double x : {-30.0, 30.0})
      stops.push_back({Vector3d(x, 2.0 * i - 20, z), Vector3d(0, 0, axis)});
  return stops;
}

CutterMotion facing(double z) { return motion_of(passes(z, 1)); }

TEST(WallThickness, IsTheDistanceToTheOtherSide) {
  const Design design = plate(7.5);
  const WallThickness thickness(design);
  for (Eigen::Index v = 0; v < design.vertices.rows(); ++v) {
    const auto behind = thickness.behind(design.vertices.row(v), design.normals.row(v), 20.0);
    ASSERT_TRUE(behind) << "vertex " << v;
    EXPECT_NEAR(*behind, 7.5, 1e-12);
    EXPECT_FALSE(thickness.behind(design.vertices.row(v), design.normals.row(v), 7.4));
  }
}

TEST(WallThickness, IsSeenFromARimThatRoundingPutBesideTheOtherSide) {
  // a place within the rim of an open mesh comes out at 30.000000000000004 where its corners have
  // 30
  const Design design = plate(1.5);
  const WallThickness thickness(design);
  const double rim = std::nextafter(20.0, 21.0);
  for (const double x : {-19.3, 0.0, 7.7, rim}) {
    const auto behind = thickness.behind({x, rim, 0.0}, {2.2e-16, 0.0, 1.0}, 20.0);
    ASSERT_TRUE(behind) << "x " << x;
    EXPECT_NEAR(*behind, 1.5, 1e-12);
    const auto along = thickness.behind({x, -rim, 0.0}, Vector3d::UnitZ(), 20.0);
    ASSERT_TRUE(along) << "x " << x;
    EXPECT_NEAR(*along, 1.5, 1e-12);
  }
  EXPECT_FALSE(thickness.behind({0.0, 20.001, 0.0}, Vector3d::UnitZ(), 20.0));
}

TEST(WallThickness, AgreesWithEveryTriangleTried) {
  const unsigned seed = 20261122;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Design design = plate(9.0);
  for (Eigen::Index v = 0; v < design.vertices.rows(); ++v) {
    design.vertices(v, 2) += 0.3 * normal(random);
    design.normals.row(v) += 0.4 * Eigen::RowVector3d(normal(random), normal(random), 0);
    design.normals.row(v).normalize();
  }
  const WallThickness thickness(design);
  int found = 0;
  for (Eigen::Index v = 0; v < design.vertices.rows(); ++v) {
    // the triangle's plane, and the place in it by areas
    double nearest = 30.0;
    const Vector3d p = design.vertices.row(v), d = -design.normals.row(v);
    for (const auto& t : design.triangles.rowwise()) {
      if ((t.array() == int(v)).any()) continue;
      const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                     c = design.vertices.row(t[2]);
      const Vector3d n = (b - a).cross(c - a);
      if (n.dot(d) <= 0.0) continue;
      const double s = n.dot(a - p) / n.dot(d);
      if (s <= 0.0 || s >= nearest) continue;
      const Vector3d q = p + s * d;
      const bool inside = n.dot((b - a).cross(q - a)) >= 0 && n.dot((c - b).cross(q - b)) >= 0 &&
                          n.dot((a - c).cross(q - c)) >= 0;
      if (inside) nearest = s;
    }
    const auto behind = thickness.behind(design.vertices.row(v), design.normals.row(v), 30.0);
    EXPECT_EQ(behind.has_value(), nearest < 30.0) << "vertex " << v;
    if (!behind) continue;
    ++found;
    EXPECT_NEAR(*behind, nearest, 1e-9) << "vertex " << v;
  }
  EXPECT_GT(found, 400);
}

TEST(Gouge, DeeperThanTheBandIsFoundWithItsDepth) {
  const Design design = plate(50.0);
  for (const double depth : {2.5, 8.0, 19.0}) {
    const Surface surface = milled_surface(design, {5, 0, 60}, facing(-depth));
    EXPECT_EQ(count(surface, VertexStatus::Gouged), 441);
    ASSERT_EQ(surface.gouges.size(), 441u);
    for (const Gouge& gouge : surface.gouges) {
      EXPECT_NEAR(gouge.depth, depth, 1e-7);
      EXPECT_FALSE(gouge.continues_deeper);
      EXPECT_TRUE(std::isnan(surface.residual[gouge.vertex]));
      EXPECT_GT(surface.cut_line[std::size_t(gouge.vertex)], 0);
    }
  }
  for (const Gouge& gouge : milled_surface(design, {5, 0, 60}, facing(-30)).gouges) {
    EXPECT_EQ(gouge.depth, 20.0);
    EXPECT_TRUE(gouge.continues_deeper);
  }
}

TEST(Gouge, AToolThatRunsUnderTheSurfaceIsOne) {
  const Surface surface = milled_surface(plate(50.0), {5, 0, 4}, facing(-12));
  EXPECT_EQ(count(surface, VertexStatus::Gouged), 441);
  for (const Gouge& gouge : surface.gouges) EXPECT_NEAR(gouge.depth, 12.0, 1e-7);
}

TEST(Gouge, OfAThinPartTheOtherSideIsNone) {
  // both sides of a plate of 1.5 mm faced: a ray of 2 mm starts behind it
  const Design design = plate(1.5);
  std::vector<Stop> both = passes(0.0, 1);
  for (const Vector3d& axis : {Vector3d(0, 0, 1), Vector3d(1, 0, 0), Vector3d(0, 0, -1)})
    both.push_back({Vector3d(30, 60, axis.z() < 0 ? -1.5 : 0.0), axis});  // turned over beside it
  for (const Stop& stop : passes(-1.5, -1)) both.push_back(stop);
  const Surface surface = milled_surface(design, {5, 0, 20}, motion_of(both));
  EXPECT_EQ(count(surface, VertexStatus::Gouged), 0);
  EXPECT_EQ(count(surface, VertexStatus::Cut), 2 * 441);
  EXPECT_LE(surface.residual.cwiseAbs().maxCoeff(), 1e-7);
  const std::vector<CompetingPass> competing_passes =
      milled_competing_passes(design, {5, 0, 20}, motion_of(both));
  std::vector<int> of_vertex(std::size_t(surface.residual.size()), 0);
  for (const CompetingPass& competing_pass : competing_passes)
    if (of_vertex[std::size_t(competing_pass.vertex)]++ == 0) {
      EXPECT_NEAR(competing_pass.distance, surface.residual[competing_pass.vertex], 1e-7);
    }
  EXPECT_EQ(std::count(of_vertex.begin(), of_vertex.end(), 0), 0);
}

TEST(Shank, ThatGoesIntoThePartIsFoundWithItsDepthAndLine) {
  const Design design = plate(50.0);
  // 3 mm of flank, the shank from -5 upward
  const auto contact = shank_contact(design, {5, 0, 3}, facing(-8), {.length = 90, .band = 2});
  ASSERT_TRUE(contact);
  EXPECT_EQ(contact->vertices, 441);
  EXPECT_EQ(contact->deepest, 2.0);  // as far as was searched
  const auto shallow = shank_contact(design, {5, 0, 3}, facing(-4.2), {.length = 90, .band = 2});
  ASSERT_TRUE(shallow);
  EXPECT_NEAR(shallow->deepest, 1.2, 1e-7);
  EXPECT_GE(shallow->first_line, 1);
  EXPECT_FALSE(shank_contact(design, {5, 0, 3}, facing(-3.05), {.length = 90, .band = 2}));
  EXPECT_FALSE(shank_contact(design, {5, 0, 3}, facing(0), {.length = 90, .band = 2}));
  EXPECT_FALSE(shank_contact(design, {5, 0, 90}, facing(-8), {.length = 90, .band = 2}));
}

/// A box whose faces have vertices and normals of their own, ten squares along each edge.
Design box(const Vector3d& lower, const Vector3d& upper) {
  constexpr int n = 10;
  std::vector<Site> sites;
  std::vector<Eigen::Vector3i> triangles;
  for (int k = 0; k < 3; ++k)
    for (const bool up : {false, true}) {
      const int first = int(sites.size()), a = (k + 1) % 3, b = (k + 2) % 3;
      for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
          Vector3d part = Vector3d::Zero();
          part[k] = up;
          part[a] = double(i) / n;
          part[b] = double(j) / n;
          sites.push_back(
              {lower + part.cwiseProduct(upper - lower), (up ? 1.0 : -1.0) * Vector3d::Unit(k)});
          if (i == n || j == n) continue;
          const int at = first + j * (n + 1) + i, right = at + 1, over = at + n + 1;
          for (const Eigen::Vector3i& t :
               {Eigen::Vector3i(at, right, over + 1), Eigen::Vector3i(at, over + 1, over)})
            triangles.push_back(up ? t : Eigen::Vector3i(t[0], t[2], t[1]));
        }
    }
  Design design = design_of(sites);
  design.triangles.resize(Eigen::Index(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    design.triangles.row(Eigen::Index(t)) = triangles[t].transpose();
  return design;
}

/// A flat R 3 with 8 mm of flank in one pass along the wall x = 0 of `box`, so far before it.
CutterMotion along_the_wall(double before) {
  return motion_of({{Vector3d(-before, -30, 0), Vector3d::UnitZ()},
                    {Vector3d(-before, 30, 0), Vector3d::UnitZ()}});
}

TEST(Shank, ThatRunsAlongAWallIsNotInIt) {
  const Design design = box({0, -20, 0}, {12, 20, 20});
  const ShankOptions options{.length = 50, .band = 2};
  // across tangents rounding decides whether a line meets the cylinder
  for (const double before : {3.0 + 1e-12, 3.0, 3.0 - 1e-12, 2.95})
    EXPECT_FALSE(shank_contact(design, {3, 0, 8}, along_the_wall(before), options)) << before;
  const auto contact = shank_contact(design, {3, 0, 8}, along_the_wall(2.5), options);
  ASSERT_TRUE(contact);
  EXPECT_NEAR(contact->deepest, 0.5, 1e-7);
  EXPECT_EQ(contact->tolerated_depth, 0.1);
  EXPECT_FALSE(contact->continues_deeper);
}

TEST(Shank, HasARadiusOfItsOwn) {
  const Design design = box({0, -20, 0}, {12, 20, 20});
  const auto deepest = [&](double before, double radius) {
    const auto contact = shank_contact(design, {3, 0, 8}, along_the_wall(before),
                                       {.length = 50, .band = 2, .radius = radius});
    return contact ? contact->deepest : 0.0;
  };
  EXPECT_EQ(deepest(2.5, 2.2), 0.0) << "thinner than the cutter, it has room";
  EXPECT_NEAR(deepest(3.0, 4.0), 1.0, 1e-7);
  EXPECT_NEAR(deepest(4.5, 5.0), 0.5, 1e-7);
}

/// The holder from 5 mm above the tip: a disc, a cone to it, a step.
TEST(Holder, ThatGoesIntoThePartIsFoundWithItsDepth) {
  const Design design = plate(50.0);
  Eigen::MatrixX2d cylinder(2, 2), cone(3, 2), step(4, 2);
  cylinder << 12, 5, 12, 40;
  cone << 1, 5, 12, 16, 12, 40;
  step << 6, 5, 6, 20, 12, 20, 12, 40;
  for (const Eigen::MatrixX2d& profile : {cylinder, cone, step}) {
    const auto contact =
        non_cutting_contact(design, non_cutting_sections(profile), facing(-6.5), 2.0);
    ASSERT_TRUE(contact);
    EXPECT_NEAR(contact->deepest, 1.5, 1e-7);
    EXPECT_EQ(contact->vertices, 441);
    EXPECT_FALSE(contact->continues_deeper);
    EXPECT_FALSE(non_cutting_contact(design, non_cutting_sections(profile), facing(-5.05), 2.0));
  }
  EXPECT_EQ(non_cutting_sections(step).size(), 2u);
  // the cone above its disc, beside a wall: it leans by 45 deg
  const Design wall = box({0, -20, 0}, {12, 20, 20});
  const auto beside =
      non_cutting_contact(wall, non_cutting_sections(cone), along_the_wall(11.0), 2.0);
  ASSERT_TRUE(beside);
  EXPECT_NEAR(beside->deepest, 1.0, 1e-6);
  EXPECT_FALSE(non_cutting_contact(wall, non_cutting_sections(cone), along_the_wall(12.05), 2.0));
  // as a shank of that radius
  const auto as_shank = shank_contact(design, {12, 0, 5}, facing(-6.5), {.length = 40, .band = 2});
  const auto as_holder =
      non_cutting_contact(design, non_cutting_sections(cylinder), facing(-6.5), 2.0);
  EXPECT_NEAR(as_shank->deepest, as_holder->deepest, 1e-9);
  EXPECT_EQ(as_shank->first_line, as_holder->first_line);
}

}  // namespace
}  // namespace abbe::cutting
