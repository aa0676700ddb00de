#include "cutting/recognise.h"

#include <cmath>
#include <iostream>
#include <numbers>

#include <gtest/gtest.h>

#include "cutting/primitive.h"
#include "cutting/smooth_patches.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using std::numbers::pi;

constexpr double micron = 1e-3;

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

TEST(Recognised, EverySurfaceFromItsFile) {
  for (const KnownForm& one : known_forms)
    for (const int vertices : {100, 400, 5000}) {
      const Design mesh = from_file(one.primitive, vertices);
      const Recognised found = recognised(mesh, 0.1 * micron);
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
      std::cout << one.name << " of " << mesh.vertices.rows() << " vertices: " << off / micron
                << " um and " << lean << " rad off, rounding " << found.patches[0].off / micron
                << " um\n";
      EXPECT_LT(off, 0.05 * micron);
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
    const OnSurface on = on_recognised(found.patches, T);
    const Design placed = transformed(found.design, T);
    const Eigen::Isometry3d back = (T * away()).inverse();
    double off = 0.0;
    for (const auto& t : placed.triangles.rowwise()) {
      std::array<Contact, 3> corners;
      for (int k = 0; k < 3; ++k)
        corners[std::size_t(k)] = {placed.vertices.row(t[k]), placed.normals.row(t[k])};
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
        0.5 * micron * std::sin(wave.vertices(i, 0)) * std::cos(wave.vertices(i, 1));
  EXPECT_TRUE(recognised(wave, 0.1 * micron).patches.empty());
  EXPECT_EQ(recognised(wave, 0.1 * micron).design.vertices, wave.vertices);
  EXPECT_EQ(recognised(wave, 1.0 * micron).patches.size(), 1u)
      << "within a micrometre it is a plane";
  EXPECT_THROW(recognised(wave, 0.0), std::invalid_argument);
}

TEST(Recognised, FacesOfABodyEachForItself) {
  // a cup: a cylinder and a disc that meet at a sharp edge
  const Primitive cup = RevolvedProfile{{{{0.0, 10.0}, {8.0, 10.0}}, {{8.0, 10.0}, {8.0, 0.0}}}};
  const Design mesh = from_file(cup, 800);
  const Design faces = split_at_edges(mesh, pi / 6);
  const Recognised found = recognised(faces, 0.1 * micron);
  ASSERT_EQ(found.patches.size(), 2u);
  EXPECT_EQ(found.patches[0].form, Form::Plane);
  EXPECT_EQ(found.patches[1].form, Form::Cylinder);
  EXPECT_NEAR(found.patches[1].shape[0], 8.0, 1e-5);
}

}  // namespace
}  // namespace abbe::cutting
