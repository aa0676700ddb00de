#include "cutting/part/remeshing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "cutting/part/design_points.h"
#include "cutting/part/primitive.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using std::numbers::pi;

Design with_all(Points vertices, Triangles triangles) {
  Design design;
  design.vertices = std::move(vertices);
  design.triangles = std::move(triangles);
  design.normals = vertex_normals(design.vertices, design.triangles);
  design.area = vertex_area(design.vertices, design.triangles);
  design.facet_error = facet_error(design.vertices, design.normals, design.triangles);
  design.judged.assign(std::size_t(design.vertices.rows()), 1);
  return design;
}

Design cube() {
  Points v(8, 3);
  v << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  Triangles t(12, 3);
  t << 0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3,
      0, 4, 3, 4, 7;
  return with_all(v, t);
}

TEST(SmoothPatches, ACubeHasSixFacesWithTheirOwnNormals) {
  const Design split = split_at_edges(cube(), pi / 6);
  EXPECT_EQ(split.vertices.rows(), 24);
  EXPECT_NEAR(split.area.sum(), 6.0, 1e-14);
  const std::vector<int> patch = patches(split);
  EXPECT_EQ(std::set(patch.begin(), patch.end()).size(), 6u);
  for (Index i = 0; i < 24; ++i)
    EXPECT_NEAR(split.normals.row(i).cwiseAbs().maxCoeff(), 1.0, 1e-14);
  for (const auto& t : split.triangles.rowwise()) {
    const Vector3d a = split.vertices.row(t[0]), b = split.vertices.row(t[1]),
                   c = split.vertices.row(t[2]);
    const Vector3d face = (b - a).cross(c - a).normalized();
    for (const int v : t) EXPECT_NEAR(face.dot(split.normals.row(v)), 1.0, 1e-14);
  }
}

TEST(SmoothPatches, ASmoothBodyStaysAsItIs) {
  const Design cap = tessellate(SphereCap{20.0, 15.0}, {500});
  const Design split = split_at_edges(cap, pi / 6);
  EXPECT_EQ(split.triangles, cap.triangles);
  EXPECT_EQ(split.normals, cap.normals);
}

TEST(SmoothPatches, TheAngleDecides) {
  for (const auto& [angle, vertices] : {std::pair(89.0, 24), {91.0, 8}})
    EXPECT_EQ(split_at_edges(cube(), angle * pi / 180.0).vertices.rows(), vertices);
  EXPECT_THROW(split_at_edges(cube(), 0.0), std::invalid_argument);
  EXPECT_THROW(split_at_edges(cube(), pi), std::invalid_argument);
}

TEST(SmoothPatches, EdgesAtTheAngleAreCounted) {
  constexpr double right = std::numbers::pi / 2.0;
  const Design body = cube();
  EXPECT_EQ(count_edges_near_angle(body, right, 1e-3), 12);
  EXPECT_EQ(count_edges_near_angle(body, right + 2e-3, 1e-3), 0);
  EXPECT_EQ(count_edges_near_angle(body, 0.0, 1e-3), 6);  // across the squares
}

TEST(SmoothPatches, AnEdgeThatEndsWithinAFaceSplitsItsVerticesUpToItsEnd) {
  // a roof along y over x = -1, 0, 1 that rises out of a plane: 10 degrees to either side at first,
  // 40 at the end
  const int rows = 7;
  Points v(3 * rows, 3);
  Triangles t(4 * (rows - 1), 3);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < 3; ++i)
      v.row(3 * j + i) << i - 1.0, 2.0 * j, i == 1 ? std::tan((10.0 + 5.0 * j) * pi / 180.0) : 0.0;
  for (int j = 0; j + 1 < rows; ++j)
    for (int i = 0; i < 2; ++i) {
      const int a = 3 * j + i, k = 4 * j + 2 * i;
      t.row(k) << a, a + 1, a + 3;
      t.row(k + 1) << a + 1, a + 4, a + 3;
    }
  // across the ridge the normals turn by 20 to 80 degrees, elsewhere by less than 10
  const Design split = split_at_edges(with_all(v, t), 50.0 * pi / 180.0);
  EXPECT_GT(split.vertices.rows(), 3 * rows);
  EXPECT_LT(split.vertices.rows(), 4 * rows);
  const std::vector<int> patch = patches(split);
  EXPECT_EQ(*std::max_element(patch.begin(), patch.end()), 0) << "it is one face still";
}

TEST(SmoothPatches, TheMarginAtSharpEdgesIsLeftOut) {
  Design fine = cube();
  fine.vertices *= 10.0;
  fine = with_all(fine.vertices, fine.triangles);
  const Design split = split_at_edges(fine, pi / 6);
  const Design off = exclude_near_edges(split, sharp_edges(split), 0.5);
  EXPECT_EQ(std::count(off.judged.begin(), off.judged.end(), 1), 0) << "all stand on edges";
  EXPECT_EQ(exclude_near_edges(fine, sharp_edges(fine), 0.5).judged, fine.judged)
      << "without split edges none is sharp";
  EXPECT_EQ(exclude_near_edges(split, sharp_edges(split), 0.0).judged, split.judged);
  EXPECT_THROW(exclude_near_edges(split, sharp_edges(split), -1.0), std::invalid_argument);
  EXPECT_THROW(exclude_near_edges(split, sharp_edges(split), std::nan("")), std::invalid_argument);
}

TEST(NearestPoint, GivesBackThePointFromWhichItWasMoved) {
  const RevolvedProfile profile{{{{0.0, 0.0}, {10.0, -2.0}, 40.0},
                                 {{10.0, -2.0}, {14.0, -2.0}, 0.0},
                                 {{14.0, -2.0}, {18.0, -4.0}, -6.0}}};
  const Primitive all[] = {RectanglePlane{30.0, 20.0},
                           Disc{10.0, 3.0},
                           Cylinder{8.0, 12.0},
                           Cone{12.0, 15.0, 0.3},
                           SphereCap{100.0, 50.0},
                           Torus{30.0, 5.0},
                           profile};
  for (const Primitive& primitive : all) {
    const Design design = tessellate(primitive, {2000});
    double worst = 0.0, turned = 0.0;
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      const Vector3d p = design.vertices.row(i), n = design.normals.row(i);
      for (const double off : {0.0, 1e-9, -1e-3, 0.02}) {
        const Contact at = nearest(primitive, p + off * n, n);
        worst = std::max(worst, (at.point - p).norm());
        turned = std::max(turned, (at.normal - n).norm());
      }
    }
    EXPECT_LT(worst, 2e-13 * 100.0) << primitive.index();
    EXPECT_LT(turned, 1e-12) << primitive.index();
  }
}

TEST(NearestPoint, ASmoothFacetOfASphereLiesOnIt) {
  constexpr double R = 30.0, L = 0.5;
  for (const double phi : {0.1, 0.7, 1.4}) {
    std::array<Contact, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const double a = phi + 2.0 * pi * double(i) / 3.0, s = L / std::sqrt(3.0) / R;
      const Vector3d n = Vector3d(s * std::cos(a), s * std::sin(a), 1.0).normalized();
      corners[i] = {R * n, n};
    }
    for (const std::array<double, 3>& weights :
         {std::array{1.0 / 3, 1.0 / 3, 1.0 / 3}, {0.5, 0.5, 0.0}, {0.2, 0.7, 0.1}}) {
      const double flat = R - facet_point(corners, weights).point.norm();
      const double smooth = R - smooth_facet_point(corners, weights).point.norm();
      EXPECT_GT(flat, 3e-4);
      EXPECT_LT(std::abs(smooth), std::pow(L, 4) / (20.0 * R * R * R));
    }
  }
}

TEST(NearestPoint, AtAKinkTakesThePieceThatTheNormalMeans) {
  const RevolvedProfile corner{{{{0.0, 0.0}, {5.0, 0.0}, 0.0}, {{5.0, 0.0}, {5.0, -5.0}, 0.0}}};
  const Contact top = nearest(corner, {5.0, 0.0, 0.01}, Vector3d::UnitZ());
  const Contact wall = nearest(corner, {5.01, 0.0, 0.0}, Vector3d::UnitX());
  EXPECT_NEAR(top.normal.z(), 1.0, 1e-15);
  EXPECT_NEAR(wall.normal.x(), 1.0, 1e-15);
}

}  // namespace
}  // namespace abbe::cutting
