#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "cutting/part/design_points.h"
#include "cutting/part/read_mesh.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

struct Deviations {
  double height = 0.0, flat = 0.0, tilt = 0.0;
};

/// How far the contacts of a mesh leave a true surface, and how far its flat triangles do.
template <class Truth>
Deviations against(const MeshHeightMap& mesh, const Truth& truth, double reach) {
  const unsigned seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> in(-reach, reach);
  // flat: the same mesh with every normal that of the triangle is what a sharp edge gets
  Design bare = mesh.design();
  for (Eigen::Index i = 0; i < bare.normals.rows(); ++i)
    bare.normals.row(i) = Eigen::RowVector3d(1, 0, 0);
  const MeshHeightMap flat(bare);
  Deviations d;
  for (int i = 0; i < 20000; ++i) {
    const double x = in(random), y = in(random);
    const Contact expected = truth(x, y);
    const auto smooth = highest_surface_point(mesh, x, y);
    const auto facet = highest_surface_point(flat, x, y);
    EXPECT_TRUE(smooth && facet);
    if (!smooth || !facet) return d;
    EXPECT_EQ(smooth->point.x(), x);
    EXPECT_EQ(smooth->point.y(), y);
    d.height = std::max(d.height, std::abs(smooth->point.z() - expected.point.z()));
    d.flat = std::max(d.flat, std::abs(facet->point.z() - expected.point.z()));
    d.tilt = std::max(d.tilt, smooth->normal.cross(expected.normal).norm());
  }
  return d;
}

TEST(MeshHeightMap, AQuadraticSurfaceWithExactNormalsIsReproduced) {
  // a paraboloid over an irregular sheet; rounding alone is left
  Design sheet = tessellate(RectanglePlane{20, 20}, {500});
  const auto truth = [](double x, double y) {
    return Contact{Vector3d(x, y, 0.02 * x * x - 0.03 * x * y + 0.01 * y * y),
                   Vector3d(-0.04 * x + 0.03 * y, 0.03 * x - 0.02 * y, 1).normalized()};
  };
  for (Eigen::Index i = 0; i < sheet.vertices.rows(); ++i) {
    const Contact c = truth(sheet.vertices(i, 0), sheet.vertices(i, 1));
    sheet.vertices.row(i) = c.point;
    sheet.normals.row(i) = c.normal;
  }
  const Deviations d = against(MeshHeightMap(sheet), truth, 10.0);
  std::cout << "paraboloid: " << d.height << " mm (flat triangles " << d.flat << "), " << d.tilt
            << " rad\n";
  EXPECT_LT(d.height, 1e-13);
  EXPECT_LT(d.tilt, 1e-13);
  EXPECT_GT(d.flat, 1e-3);
}

TEST(MeshHeightMap, ADomeIsMetBetterThanItsFacets) {
  const SphereCap cap{50.0, 30.0};
  const MeshHeightMap mesh(tessellate(cap, {20000}));
  const auto truth = [&](double x, double y) { return *highest_surface_point(cap, x, y); };
  const Deviations d = against(mesh, truth, 20.0);
  std::cout << "dome: " << d.height * 1e6 << " nm (flat " << d.flat * 1e6 << " nm), "
            << d.tilt * 1e6 << " urad\n";
  EXPECT_LT(d.height, 0.02 * d.flat);
}

TEST(MeshHeightMap, TheFreeFormBlockIsMetBetterThanItsFacets) {
  const MeshHeightMap mesh(read_mesh(std::string(ABBE_SOURCE_DIR) + "/scenes/parts/freeform.stl"));
  const auto truth = [](double x, double y) {
    const double dx =
        2.4 / 9 * std::cos(x / 9 + 0.3) * std::cos(y / 11) - 0.8 / 17 * std::sin(x / 17 - y / 8);
    const double dy =
        -2.4 / 11 * std::sin(x / 9 + 0.3) * std::sin(y / 11) + 0.8 / 8 * std::sin(x / 17 - y / 8);
    const double z =
        10 + 2.4 * std::sin(x / 9 + 0.3) * std::cos(y / 11) + 0.8 * std::cos(x / 17 - y / 8);
    return Contact{Vector3d(x, y, z), Vector3d(-dx, -dy, 1).normalized()};
  };
  const Deviations d = against(mesh, truth, 29.0);
  std::cout << "free form: " << d.height * 1e6 << " nm (flat " << d.flat * 1e6 << " nm), "
            << d.tilt * 1e6 << " urad\n";
  EXPECT_LT(d.height, 0.2 * d.flat);
  EXPECT_FALSE(highest_surface_point(mesh, 30.5, 0.0));
  EXPECT_FALSE(highest_surface_point(mesh, 0.0, NAN));
  EXPECT_TRUE(highest_surface_point(mesh, 30.0 - 1e-5, 30.0 - 1e-5));
}

TEST(MeshHeightMap, TheHighestOfSeveralSheetsIsTaken) {
  Design low = tessellate(RectanglePlane{10, 10}, {100});
  Design both = low;
  const auto n = low.vertices.rows(), m = low.triangles.rows();
  both.vertices.resize(2 * n, 3);
  both.normals.resize(2 * n, 3);
  both.triangles.resize(2 * m, 3);
  both.vertices << low.vertices, low.vertices.rowwise() + Eigen::RowVector3d(3, 0, 2);
  both.normals << low.normals, low.normals;
  both.triangles << low.triangles, (low.triangles.array() + static_cast<int>(n)).matrix();
  const MeshHeightMap mesh(both);
  EXPECT_EQ(highest_surface_point(mesh, -4.0, 1.0)->point.z(), 0.0);
  EXPECT_EQ(highest_surface_point(mesh, 1.0, 1.0)->point.z(), 2.0);
  EXPECT_EQ(highest_surface_point(mesh, 7.0, 1.0)->point.z(), 2.0);
  EXPECT_FALSE(highest_surface_point(mesh, 8.1, 1.0));
}

TEST(MeshHeightMap, NothingIsAboveAWallOrAnEmptyMesh) {
  EXPECT_FALSE(highest_surface_point(MeshHeightMap(Design{}), 0, 0));
  EXPECT_FALSE(highest_surface_point(MeshHeightMap(tessellate(Cylinder{10, 5}, {200})), 10, 0));
}

}  // namespace
}  // namespace abbe::cutting
