// The skin of a cut part and its deviation: distances against brute force.

#include "cutting/stock/part_deviation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <random>

#include "tests/cutting/held_parts.h"

namespace abbe::cutting {
namespace {

using namespace held_parts;
using Eigen::Vector3d;

// ---- skin ---------------------------------------------------------------------------------------

TEST(StockSkin, HasTheMeshOfTheStockAndPlacesOnTheSkin) {
  std::mt19937 random(20261);
  const Eigen::Isometry3d T = any_pose(random);
  Stock stock = full_block(T, 0.7);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const StockSkin skin = stock_skin(stock);
  const StockMesh mesh = stock_mesh(stock);
  EXPECT_EQ(skin.mesh.vertices_w, mesh.vertices_w);
  EXPECT_EQ(skin.mesh.triangles, mesh.triangles);
  EXPECT_EQ(skin.mesh.line, mesh.line);
  const DesignDistance distance(pocketed(pocket_x, pocket_y, pocket_floor).design(T), facets());
  std::map<std::vector<double>, int> seen;
  for (Eigen::Index i = 0; i < skin.points_w.rows(); ++i) {
    const Vector3d p = skin.points_w.row(i);
    EXPECT_NEAR(distance.at(p).value, 0.0, 1e-9) << p.transpose();
    const int times = ++seen[std::vector<double>{p.x(), p.y(), p.z()}];
    EXPECT_EQ(times, 1) << "the four cells around an edge share its place";
  }
  for (std::size_t v = 0; v + 1 < skin.first.size(); ++v) {
    Vector3d mean = Vector3d::Zero();
    for (int k = skin.first[v]; k < skin.first[v + 1]; ++k)
      mean += skin.points_w.row(skin.place[std::size_t(k)]);
    mean /= skin.first[v + 1] - skin.first[v];
    ASSERT_LT((mean - mesh.vertices_w.row(Eigen::Index(v)).transpose()).norm(), 1e-12);
  }
}

// ---- distance -----------------------------------------------------------------------------------

/// Nearest point of a triangle: of its plane if that is inside, else of its sides.
double distance_by_sides(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  bool inside = true;
  double nearest = INFINITY;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d a = t[k], b = t[(k + 1) % 3];
    inside = inside && n.dot((b - a).cross(p - a)) >= 0;
    const double part = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - a - part * (b - a)).norm());
  }
  return inside ? std::abs(n.dot(p - t[0])) : nearest;
}

/// Solid angle of a triangle (van Oosterom and Strackee 1983).
double solid_angle(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d a = t[0] - p, b = t[1] - p, c = t[2] - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

/// A body with dents and sharp edges: a sphere of triangles whose radii are drawn.
Design dented(std::mt19937& random, int rings) {
  std::uniform_real_distribution<double> radius(6, 12);
  Quads body;
  const int around = 2 * rings;
  std::vector<Vector3d> at;
  at.push_back({0, 0, radius(random)});
  for (int i = 1; i < rings; ++i)
    for (int k = 0; k < around; ++k) {
      const double t = pi * i / rings, f = 2 * pi * k / around;
      at.push_back(radius(random) *
                   Vector3d(std::sin(t) * std::cos(f), std::sin(t) * std::sin(f), std::cos(t)));
    }
  at.push_back({0, 0, -radius(random)});
  body.corners = at;
  const auto ring = [&](int i, int k) { return 1 + (i - 1) * around + k % around; };
  for (int k = 0; k < around; ++k) {
    body.triangles.push_back({0, ring(1, k), ring(1, k + 1)});
    for (int i = 1; i + 1 < rings; ++i) {
      body.triangles.push_back({ring(i, k), ring(i + 1, k), ring(i + 1, k + 1)});
      body.triangles.push_back({ring(i, k), ring(i + 1, k + 1), ring(i, k + 1)});
    }
    body.triangles.push_back({ring(rings - 1, k), int(at.size()) - 1, ring(rings - 1, k + 1)});
  }
  return body.design();
}

TEST(DesignDistance, IsThatOfAllTrianglesWithTheSideOfTheSolidAngle) {
  const unsigned seed = 20262;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  double off = 0.0;
  for (int body = 0; body < 12; ++body) {
    const Design design = dented(random, 4 + body);
    const DesignDistance distance(design, facets());
    EXPECT_TRUE(distance.is_closed());
    for (int i = 0; i < 400; ++i) {
      // near corners and edges too: half of the places are drawn about a vertex
      Vector3d p = 14.0 * Vector3d(unit(random), unit(random), unit(random));
      if (i % 2 == 0)
        p = Vector3d(design.vertices.row(i % design.vertices.rows())) +
            0.5 * Vector3d(unit(random), unit(random), unit(random));
      double nearest = INFINITY, angle = 0.0;
      for (const auto& t : design.triangles.rowwise()) {
        const std::array<Vector3d, 3> corners{design.vertices.row(t[0]), design.vertices.row(t[1]),
                                              design.vertices.row(t[2])};
        nearest = std::min(nearest, distance_by_sides(p, corners));
        angle += solid_angle(p, corners);
      }
      const double expected = std::abs(angle) > 2 * pi ? -nearest : nearest;
      const DesignDistance::PointDistance at = distance.at(p, i % int(design.triangles.rows()));
      off = std::max(off, std::abs(at.value - expected));
      ASSERT_NEAR(at.value, expected, 1e-11) << "body " << body << " at " << p.transpose();
      ASSERT_NEAR(at.from.norm(), nearest, 1e-11);
      ASSERT_FALSE(at.is_beyond);
    }
  }
  std::cout << "signed distance off brute force by " << off << " mm at most\n";
}

TEST(DesignDistance, KnowsWhatLiesBeyondTheBorderOfAnOpenDesign) {
  Quads flat;
  flat.add({0, 0, 0}, {10, 0, 0}, {10, 10, 0}, {0, 10, 0});
  const DesignDistance distance(flat.design(), facets());
  EXPECT_FALSE(distance.is_closed());
  EXPECT_FALSE(distance.at({5, 5, 0.3}).is_beyond);
  EXPECT_NEAR(distance.at({5, 5, -0.3}).value, -0.3, 1e-15);
  EXPECT_FALSE(distance.at({10, 5, 0.3}).is_beyond) << "above the border, along its normal";
  EXPECT_TRUE(distance.at({10.01, 5, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10.01, 10.01, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10, 5, -0.3}).is_beyond) << "a side of the blank below";
}

TEST(DesignDistance, OfASmoothSurfaceIsNotThatOfItsFacets) {
  // a coarse sphere: facets sag by 0.12 mm
  const double R = 20;
  Quads sphere;
  const int rings = 24, around = 48;
  const auto at = [&](int i, int k) {
    const double t = 0.2 + 0.05 * i, f = 0.4 * 2 * pi * k / around;
    return Vector3d(R * std::sin(t) * std::cos(f), R * std::sin(t) * std::sin(f), R * std::cos(t));
  };
  for (int i = 0; i < rings; i += 2)
    for (int k = 0; k < around; k += 6)
      sphere.add(at(i, k), at(i + 2, k), at(i + 2, k + 6), at(i, k + 6));
  Design design = sphere.design();
  design.normals = design.vertices.rowwise().normalized();
  const DesignDistance smooth(design), flat(design, facets());
  double off = 0.0, off_flat = 0.0;
  for (int i = 4; i < rings - 4; ++i)
    for (int k = 6; k < around - 6; ++k)
      for (const double d : {-0.4, 0.0, 0.3}) {
        const Vector3d p = at(i, k) * (1 + d / R);
        off = std::max(off, std::abs(smooth.at(p).value - d));
        off_flat = std::max(off_flat, std::abs(flat.at(p).value - d));
      }
  std::cout << "smooth within " << off << " mm, facets " << off_flat << " mm\n";
  EXPECT_GT(off_flat, 0.05);
  EXPECT_LT(off, 0.05 * off_flat);
}

/// A blank around a design, of its own shape: a cap on a cylinder.
TEST(PartDeviation, SidesAndBottomUnderAnOpenDesignAreNotCompared) {
  const Vector3d centre(20, 15, -10);
  const Design design = dome(25, 10, centre, 60, 180);
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  // raw everywhere but for a flat on top that touches the dome
  carve(stock, {-1, -1, 15}, {41, 31, 21}, 3);
  const Held all = held(stock, design);
  EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
  ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
  // seen against the dome itself: what stands over it within its normals
  const double limit = 0.05;
  EXPECT_NEAR(all.found.list.front().depth, 25 / std::cos(std::asin(10.0 / 25)) - 25, 0.02);
  EXPECT_LT(all.found.compared, pi * 11.5 * 11.5);
  for (Eigen::Index i = 0; i < all.part.deviation.size(); ++i) {
    const Vector3d p = all.skin.mesh.vertices_w.row(i);
    if (p.z() < 14) {
      ASSERT_EQ(all.part.status[std::size_t(i)], SkinStatus::NoDesign) << p.transpose();
    }
    if ((p - centre).head<2>().norm() > 12) {
      ASSERT_TRUE(std::isnan(all.part.deviation[i])) << p.transpose();
    }
    if (std::isfinite(all.part.deviation[i]) && (p - centre).head<2>().norm() < 10) {
      ASSERT_NEAR(all.part.deviation[i], (p - centre).norm() - 25, limit) << p.transpose();
    }
  }
}

TEST(PartDeviation, WallsOfOneDirectionAreNotResolvedAndSaidSo) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5, false);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const Held all = held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design());
  expect_none(all);
  EXPECT_LT(worst(all.part), 1e-8);
  EXPECT_NEAR(all.found.unresolved, 2 * (40 + 30) * 20 + 2 * (23.24 + 18.58) * 10.13,
              0.1 * all.found.unresolved);
}

}  // namespace
}  // namespace abbe::cutting
