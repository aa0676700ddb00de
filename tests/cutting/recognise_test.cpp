#include "cutting/part/recognition.h"

#include <cmath>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cutting/part/primitive.h"
#include "cutting/part/remeshing.h"
#include "kinematics/units.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using std::numbers::pi;

/// Somewhere in the machine, every axis at work.
Eigen::Isometry3d away() {
  return Eigen::Translation3d(310.0, -45.0, 127.0) *
         Eigen::AngleAxisd(1.1, Vector3d(1, -2, 0.5).normalized());
}

/// What a file of a surface holds: points rounded to float32, normals of the facets.
Design from_file(const Primitive& primitive, int vertices) {
  Design mesh = transformed(tessellate(primitive, {vertices}), away());
  mesh.vertices = mesh.vertices.cast<float>().cast<double>();
  mesh.normals = vertex_normals(mesh.vertices, mesh.triangles);
  mesh.area = vertex_area(mesh.vertices, mesh.triangles);
  return mesh;
}

struct KnownForm {
  const char* name;
  Primitive primitive;
  Form form;
};

const KnownForm known_forms[] = {{"plane", RectanglePlane{30.0, 20.0}, Form::Plane},
                                 {"sphere", SphereCap{60.0, 25.0}, Form::Sphere},
                                 {"cylinder", Cylinder{12.0, 30.0}, Form::Cylinder},
                                 {"cone", Cone{20.0, 15.0, 0.4}, Form::Cone},
                                 {"torus", Torus{30.0, 8.0}, Form::Torus}};

/// A mesh of rows of vertices, all of one length. @param closed  each row ends where it begins
Design of_rows(const std::vector<std::vector<Vector3d>>& rows, bool closed) {
  const int n = int(rows.front().size()), m = closed ? n : n - 1;
  Design mesh;
  mesh.vertices.resize(Index(rows.size()) * n, 3);
  mesh.triangles.resize(2 * Index(rows.size() - 1) * m, 3);
  Index triangle = 0;
  for (int i = 0; i < int(rows.size()); ++i)
    for (int k = 0; k < n; ++k) {
      mesh.vertices.row(i * n + k) = rows[std::size_t(i)][std::size_t(k)];
      if (i + 1 == int(rows.size()) || k >= m) continue;
      const int a = i * n + k, b = i * n + (k + 1) % n;
      mesh.triangles.row(triangle++) << a, b, a + n;
      mesh.triangles.row(triangle++) << b, b + n, a + n;
    }
  mesh.normals = vertex_normals(mesh.vertices, mesh.triangles);
  mesh.area = vertex_area(mesh.vertices, mesh.triangles);
  mesh.facet_error = facet_error(mesh.vertices, mesh.normals, mesh.triangles);
  return mesh;
}

/// Rings (r, z) of 60 vertices about z, as an STL has them.
Design of_rings(const std::vector<Eigen::Vector2d>& rings) {
  std::vector<std::vector<Vector3d>> rows;
  for (const Eigen::Vector2d& ring : rings) {
    rows.emplace_back();
    for (int k = 0; k < 60; ++k) {
      const double angle = 2.0 * pi * k / 60.0;
      rows.back().push_back({ring[0] * std::cos(angle), ring[0] * std::sin(angle), ring[1]});
    }
  }
  return of_rows(rows, true);
}

/// Lines along y at (x, z).
Design of_lines(const std::vector<Eigen::Vector2d>& lines) {
  std::vector<std::vector<Vector3d>> rows;
  for (int i = 0; i < 12; ++i) {
    rows.emplace_back();
    for (const Eigen::Vector2d& line : lines) rows.back().push_back({line[0], 3.0 * i, line[1]});
  }
  return of_rows(rows, false);
}

std::string forms_of(const Design& mesh) {
  constexpr const char* names[] = {"plane", "sphere", "cylinder", "cone", "torus"};
  std::string all;
  for (const AnalyticPatch& one : recognised(mesh, 0.1 * units::um).patches)
    all += names[std::size_t(one.form)];
  return all;
}

TEST(Recognised, TwoRingsAreACylinderOrACone) {
  // they lie on a sphere too, which is 1.2 mm off the first of them
  EXPECT_EQ(forms_of(of_rings({{10, 0}, {10, 10}})), "cylinder");
  EXPECT_EQ(forms_of(of_rings({{10, 0}, {8, 10}})), "cone");
}

TEST(Recognised, NoSurfaceByVerticesThatLieOnItWhateverTheyAre) {
  const double chamfer = std::tan(20.0 * pi / 180.0);
  // a shaft with a chamfer, with one at both ends: they lie on a torus
  EXPECT_EQ(forms_of(of_rings({{10, 0}, {10, 50}, {10 - chamfer, 51}})), "cylindercone");
  EXPECT_EQ(forms_of(of_rings({{10 - chamfer, -1}, {10, 0}, {10, 50}, {10 - chamfer, 51}})),
            "cylinderconecone");
  // a flat ring with a chamfer: on a torus; a bend, a symmetric one: on a cylinder
  EXPECT_EQ(forms_of(of_rings({{20, 0}, {10, 10 * chamfer}, {5, 10 * chamfer}})), "planecone");
  EXPECT_EQ(forms_of(of_lines({{10, -10 * chamfer}, {0, 0}, {-10, -10 * chamfer}})), "");
  EXPECT_EQ(forms_of(of_lines({{15, -5 * chamfer}, {10, 0}, {-10, 0}, {-15, -5 * chamfer}})), "");
}

/// Rings about z, the last of which is closed by a flat fanned from its first vertex.
Design of_capped_rings(const std::vector<Eigen::Vector2d>& rings) {
  Design mesh = of_rings(rings);
  const Index walls = mesh.triangles.rows();
  const int first = int(mesh.vertices.rows()) - 60;
  mesh.triangles.conservativeResize(walls + 58, 3);
  for (int k = 0; k < 58; ++k) mesh.triangles.row(walls + k) << first, first + 1 + k, first + 2 + k;
  mesh.normals = vertex_normals(mesh.vertices, mesh.triangles);
  mesh.area = vertex_area(mesh.vertices, mesh.triangles);
  return mesh;
}

TEST(Recognised, AFlatTopIsAPlaneAndNoPartOfASphereOrCone) {
  for (const double degrees : {5.0, 10.0, 20.0, 28.0})
    EXPECT_EQ(forms_of(of_capped_rings({{20, 0}, {10, 10 * std::tan(degrees * pi / 180.0)}})),
              "planecone")
        << degrees;
  std::vector<Eigen::Vector2d> dome;  // R 30
  for (const double degrees : {40.0, 30.0, 20.0, 12.0})
    dome.push_back({30.0 * std::sin(degrees * pi / 180.0), 30.0 * std::cos(degrees * pi / 180.0)});
  EXPECT_EQ(forms_of(of_rings(dome)), "sphere");
  EXPECT_EQ(forms_of(of_capped_rings(dome)), "planesphere");
}

TEST(Recognised, EverySurfaceFromItsFile) {
  for (const KnownForm& one : known_forms)
    for (const int vertices : {100, 400, 5000}) {
      const Design mesh = from_file(one.primitive, vertices);
      const Recognised found = recognised(mesh, 0.1 * units::um);
      ASSERT_EQ(found.patches.size(), 1u) << one.name << ", " << vertices;
      EXPECT_EQ(found.patches[0].form, one.form) << one.name;
      EXPECT_NEAR(found.patches[0].area, found.area, 1e-9 * found.area);
      double off = 0.0, lean = 0.0;
      for (Index i = 0; i < mesh.vertices.rows(); ++i) {
        const Vector3d p = away().inverse() * Vector3d(found.design.vertices.row(i));
        const Vector3d n = away().linear().transpose() * Vector3d(found.design.normals.row(i));
        const Contact exact = nearest(one.primitive, p, n);
        off = std::max(off, std::abs((p - exact.point).dot(exact.normal)));
        lean = std::max(lean, (n - exact.normal).norm());
      }
      std::cout << one.name << " of " << mesh.vertices.rows() << " vertices: " << off / units::um
                << " um and " << lean << " rad off, rounding " << found.patches[0].off / units::um
                << " um\n";
      EXPECT_LT(off, 0.05 * units::um);
      EXPECT_LT(lean, 1e-5);
    }
}

TEST(Recognised, BetweenTheVerticesItIsTheSurface) {
  for (const KnownForm& one : known_forms) {
    const Design mesh = transformed(tessellate(one.primitive, {100}), away());
    const Recognised found = recognised(mesh, 1e-6);
    ASSERT_EQ(found.patches.size(), 1u) << one.name;
    const Eigen::Isometry3d T(Eigen::Translation3d(-7.0, 800.0, 3.0) *
                              Eigen::AngleAxisd(0.3, Vector3d::UnitX()));
    const SurfaceInterpolator on = patch_interpolator(found.patches, T);
    const Design placed = transformed(found.design, T);
    const Eigen::Isometry3d back = (T * away()).inverse();
    double off = 0.0;
    for (const auto& t : placed.triangles.rowwise()) {
      std::array<Contact, 3> corners;
      for (int k = 0; k < 3; ++k) corners[std::size_t(k)] = vertex_contact(placed, t[k]);
      const Contact at = on(corners, std::array{0.5, 0.2, 0.3});
      const Vector3d p = back * at.point;
      const Contact exact = nearest(one.primitive, p, back.linear() * at.normal);
      off = std::max(off, std::abs((p - exact.point).dot(exact.normal)));
      EXPECT_GT((back.linear() * at.normal).dot(exact.normal), 1.0 - 1e-9);
    }
    std::cout << one.name << ": " << off << " mm off between 100 vertices\n";
    EXPECT_LT(off, 1e-9);
  }
}

TEST(Recognised, AHoleLooksInwards) {
  Design bore = tessellate(Cylinder{6.0, 20.0}, {300});
  bore.triangles.col(1).swap(bore.triangles.col(2));
  bore.normals *= -1.0;
  const Recognised found = recognised(bore, 1e-6);
  ASSERT_EQ(found.patches.size(), 1u);
  EXPECT_EQ(found.patches[0].sign, -1.0);
  for (Index i = 0; i < bore.vertices.rows(); ++i)
    EXPECT_LT(found.design.normals.row(i).dot(found.design.vertices.row(i)), 0.0);
}

TEST(Recognised, WhatIsNoneOfThemStaysAsItIs) {
  Design wave = tessellate(RectanglePlane{30.0, 30.0}, {900});
  for (Index i = 0; i < wave.vertices.rows(); ++i)
    wave.vertices(i, 2) =
        0.5 * units::um * std::sin(wave.vertices(i, 0)) * std::cos(wave.vertices(i, 1));
  EXPECT_TRUE(recognised(wave, 0.1 * units::um).patches.empty());
  EXPECT_EQ(recognised(wave, 0.1 * units::um).design.vertices, wave.vertices);
  EXPECT_EQ(recognised(wave, 1.0 * units::um).patches.size(), 1u)
      << "within a micrometre it is a plane";
  EXPECT_THROW(recognised(wave, 0.0), std::invalid_argument);
}

TEST(Recognised, FacesOfABodyEachForItself) {
  // a cup: a cylinder and a disc that meet at a sharp edge
  const Primitive cup = RevolvedProfile{{{{0.0, 10.0}, {8.0, 10.0}}, {{8.0, 10.0}, {8.0, 0.0}}}};
  const Design mesh = from_file(cup, 800);
  const Design faces = split_at_edges(mesh, pi / 6);
  const Recognised found = recognised(faces, 0.1 * units::um);
  ASSERT_EQ(found.patches.size(), 2u);
  EXPECT_EQ(found.patches[0].form, Form::Plane);
  EXPECT_EQ(found.patches[1].form, Form::Cylinder);
  EXPECT_NEAR(found.patches[1].shape[0], 8.0, 1e-5);
}

}  // namespace
}  // namespace abbe::cutting
