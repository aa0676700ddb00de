#include "cutting/part/design_points.h"
#include "cutting/part/mesh_file.h"
#include "cutting/part/primitive.h"
#include "cutting/part/recognition.h"
#include "cutting/part/remeshing.h"
#include "tests/cutting/filleted_bodies.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using Sampled = std::function<Vector3d(double, double)>;
using Corners = std::vector<Vector3d>;

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
Design of_rings(const std::vector<Vector2d>& rings) {
  std::vector<std::vector<Vector3d>> rows;
  for (const Vector2d& ring : rings) {
    rows.emplace_back();
    for (int k = 0; k < 60; ++k) {
      const double angle = 2.0 * pi * k / 60.0;
      rows.back().push_back({ring[0] * std::cos(angle), ring[0] * std::sin(angle), ring[1]});
    }
  }
  return of_rows(rows, true);
}

/// Lines along y at (x, z).
Design of_lines(const std::vector<Vector2d>& lines) {
  std::vector<std::vector<Vector3d>> rows;
  for (int i = 0; i < 12; ++i) {
    rows.emplace_back();
    for (const Vector2d& line : lines) rows.back().push_back({line[0], 3.0 * i, line[1]});
  }
  return of_rows(rows, false);
}

std::string forms_of(const Design& mesh) {
  constexpr const char* names[] = {"plane", "sphere", "cylinder", "cone", "torus"};
  std::string all;
  for (const AnalyticPatch& one : recognise_patches(mesh, 0.1 * units::um).patches)
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
Design of_capped_rings(const std::vector<Vector2d>& rings) {
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
  std::vector<Vector2d> dome;  // R 30
  for (const double degrees : {40.0, 30.0, 20.0, 12.0})
    dome.push_back({30.0 * std::sin(degrees * pi / 180.0), 30.0 * std::cos(degrees * pi / 180.0)});
  EXPECT_EQ(forms_of(of_rings(dome)), "sphere");
  EXPECT_EQ(forms_of(of_capped_rings(dome)), "planesphere");
}

TEST(Recognised, EverySurfaceFromItsFile) {
  for (const KnownForm& one : known_forms)
    for (const int vertices : {100, 400, 5000}) {
      const Design mesh = from_file(one.primitive, vertices);
      const RecognisedMesh found = recognise_patches(mesh, 0.1 * units::um);
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
    const RecognisedMesh found = recognise_patches(mesh, 1e-6);
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
  const RecognisedMesh found = recognise_patches(bore, 1e-6);
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
  EXPECT_TRUE(recognise_patches(wave, 0.1 * units::um).patches.empty());
  EXPECT_EQ(recognise_patches(wave, 0.1 * units::um).design.vertices, wave.vertices);
  EXPECT_EQ(recognise_patches(wave, 1.0 * units::um).patches.size(), 1u)
      << "within a micrometre it is a plane";
  EXPECT_THROW(recognise_patches(wave, 0.0), std::invalid_argument);
}

TEST(Recognised, FacesOfABodyEachForItself) {
  // a cup: a cylinder and a disc that meet at a sharp edge
  const Primitive cup = RevolvedProfile{{{{0.0, 10.0}, {8.0, 10.0}}, {{8.0, 10.0}, {8.0, 0.0}}}};
  const Design mesh = from_file(cup, 800);
  const Design faces = split_at_edges(mesh, pi / 6);
  const RecognisedMesh found = recognise_patches(faces, 0.1 * units::um);
  ASSERT_EQ(found.patches.size(), 2u);
  EXPECT_EQ(found.patches[0].form, Form::Plane);
  EXPECT_EQ(found.patches[1].form, Form::Cylinder);
  EXPECT_NEAR(found.patches[1].shape[0], 8.0, 1e-5);
}

/// A surface over the unit square.
struct SampledPatch {
  std::string name;
  Sampled at;
  int n, m;
  double noise = 0.0;  ///< mm, of each coordinate
};

Design mesh_of(const SampledPatch& patch, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> unit;
  filleted::Body body;
  for (int i = 0; i <= patch.n; ++i)
    for (int j = 0; j <= patch.m; ++j) {
      Vector3d p = patch.at(double(i) / patch.n, double(j) / patch.m);
      for (double& x : p) x += patch.noise * unit(random);
      body.points.push_back(p);
      if (i == patch.n || j == patch.m) continue;
      const int a = i * (patch.m + 1) + j, b = a + patch.m + 1;
      body.triangles.push_back({a, b, b + 1});
      body.triangles.push_back({a, b + 1, a + 1});
    }
  return filleted::as_stl(body, filleted::any_pose(seed, 100.0));
}

/// How far what is recognised lies from the surface that was sampled, at the middles of facets.
struct Missed {
  std::size_t faces = 0;
  double distance = 0.0;  // mm
};
Missed missed(const SampledPatch& patch, unsigned seed, double tolerance) {
  const Design mesh = mesh_of(patch, seed);
  const Eigen::Isometry3d T = filleted::any_pose(seed, 100.0);
  const RecognisedMesh found = recognise_patches(split_at_edges(mesh, pi / 6), tolerance);
  Missed worst{found.patches.size()};
  for (Index t = 0; t < mesh.triangles.rows() && worst.faces > 0; ++t) {
    const int face = found.design.face[std::size_t(found.design.triangles(t, 0))];
    if (face < 0) continue;
    Vector2d middle(0.0, 0.0);
    for (const int v : mesh.triangles.row(t))
      middle +=
          Vector2d(double(v / (patch.m + 1)) / patch.n, double(v % (patch.m + 1)) / patch.m) / 3.0;
    const Vector3d p = T * patch.at(middle.x(), middle.y());
    worst.distance =
        std::max(worst.distance, std::abs(distance_of(found.patches[std::size_t(face)], p)));
  }
  return worst;
}

Sampled ellipsoid_off(double d) {
  return [d](double u, double v) {
    const double a = 0.3 + 0.9 * u, b = 1.5 * v;
    return Vector3d(30.0 * std::sin(a) * std::cos(b), (30.0 + d) * std::sin(a) * std::sin(b),
                    (30.0 - d) * std::cos(a));
  };
}

Sampled bent_cylinder(double sag) {
  return [sag](double u, double v) {
    const double y = 2.0 * u - 1.0, a = 2.0 * v - 1.0;
    return Vector3d(30.0 * std::sin(a), 50.0 * y, 30.0 * std::cos(a) + sag * (1.0 - y * y));
  };
}

Sampled widening_torus(double d) {
  return [d](double u, double v) {
    const double w = 1.5 * u, q = 6.0 + d * w, r = 40.0 + q * std::cos(3.0 * v);
    return Vector3d(r * std::cos(w), r * std::sin(w), q * std::sin(3.0 * v));
  };
}

/// A tube of 60 mm along a circle of radius R.
Sampled bent_tube(double R) {
  return [R](double u, double v) {
    const double w = 60.0 * (u - 0.5) / R, r = 6.0 * std::cos(3.0 * v);
    return Vector3d((R + r) * std::cos(w) - R, (R + r) * std::sin(w), 6.0 * std::sin(3.0 * v));
  };
}

TEST(FalseFaces, WhatIsNearlyASurfaceIsNoneOfItsStrips) {
  constexpr double tolerance = 0.1 * units::um;
  std::vector<SampledPatch> all;
  for (const int n : {6, 10, 16, 40}) {
    for (const double um : {1.0, 5.0, 50.0, 1000.0})
      all.push_back({"ellipsoid", ellipsoid_off(um * units::um), n, n});
    for (const double um : {3.0, 20.0, 500.0}) {
      all.push_back({"bent cylinder", bent_cylinder(um * units::um), n, n});
      all.push_back({"bent cylinder, four strips", bent_cylinder(um * units::um), 4, n});
    }
    for (const double um : {1.0, 10.0, 100.0, 1000.0})
      all.push_back({"widening torus", widening_torus(um * units::um), n, n});
    for (const double R : {100.0, 1e3, 1e4, 1e5}) all.push_back({"bent tube", bent_tube(R), n, 24});
  }
  unsigned seed = 101;
  double worst = 0.0;
  for (const SampledPatch& one : all) {
    const Missed off = missed(one, seed, tolerance);
    EXPECT_LT(off.distance, tolerance) << one.name << ", " << one.n << " by " << one.m << ", seed "
                                       << seed << ": " << off.faces << " faces";
    worst = std::max(worst, off.distance);
    ++seed;
  }
  std::cout << all.size() << " bodies, at most " << worst / units::um << " um off\n";
}

TEST(FalseFaces, NoiseMakesNone) {
  const Sampled cylinder = [](double u, double v) {
    return Vector3d(30.0 * std::sin(1.8 * v), 55.0 * u, 30.0 * std::cos(1.8 * v));
  };
  const Sampled flat = [](double u, double v) { return Vector3d(11.0 * u, 11.0 * v, 0.0); };
  for (unsigned seed = 17; seed < 21; ++seed)
    for (const double noise : {0.5, 1.0, 2.0, 5.0})
      for (const double tolerance : {0.1, 1.0}) {
        if (noise < 5.0 * tolerance && tolerance > 0.1) continue;
        for (const SampledPatch& one :
             {SampledPatch{"cylinder", cylinder, 110, 110, noise * units::um},
              SampledPatch{"plane", flat, 110, 110, noise * units::um}})
          EXPECT_EQ(missed(one, seed, tolerance * units::um).faces, 0u)
              << one.name << ", noise of " << noise << " um, within " << tolerance << " um, seed "
              << seed;
      }
}

TEST(FalseFaces, FacetsOfAFewTolerancesMakeNoPlanes) {
  for (const double sides : {3.0, 8.0, 12.0}) {  // tolerances
    constexpr double tolerance = 5.0 * units::um;
    const double d = 100.0 * sides * tolerance;
    const Sampled wave = [d](double u, double v) {
      return Vector3d(d * u, d * v, 0.05 * d * std::sin(2.0 * pi * u) * std::cos(2.0 * pi * v));
    };
    EXPECT_EQ(missed({"wave", wave, 100, 100}, 7, tolerance).faces, 0u) << sides;
  }
}

double larger_curvature(const AnalyticPatch& face) {
  if (face.form == Form::Plane) return 0.0;
  if (face.form == Form::Torus)
    return std::max(1.0 / face.shape[1], 1.0 / std::abs(face.shape[0] - face.shape[1]));
  return 1.0 / face.shape[0];
}

TEST(FalseFaces, EveryFacetOfAFaceLiesOnIt) {
  constexpr double tolerance = 0.1 * units::um;
  unsigned seed = 71;
  double worst = 0.0;
  for (const double degrees : {1.0, 2.0, 5.0, 15.0, 22.5})
    for (const filleted::Body& body : {filleted::pocket(25.0, 18.0, 6.0, 2.0, 9.0, degrees),
                                       filleted::boss(8.0, 12.0, 1.5, 20.0, degrees)}) {
      const Design mesh = filleted::as_stl(body, filleted::any_pose(seed, 200.0));
      const RecognisedMesh found = recognise_patches(split_at_edges(mesh, pi / 6), tolerance);
      EXPECT_EQ(found.patches.size(), body.name == "boss" ? 5u : 17u)
          << body.name << ", " << degrees << " degrees, seed " << seed;
      for (Index t = 0; t < mesh.triangles.rows() && !found.patches.empty(); ++t) {
        const int number = found.design.face[std::size_t(found.design.triangles(t, 0))];
        if (number < 0) continue;
        const AnalyticPatch& face = found.patches[std::size_t(number)];
        Vector3d middle = Vector3d::Zero();
        double longest = 0.0;
        for (int k = 0; k < 3; ++k) {
          const Vector3d p = mesh.vertices.row(mesh.triangles(t, k));
          const Vector3d next = mesh.vertices.row(mesh.triangles(t, (k + 1) % 3));
          middle += p / 3.0;
          longest = std::max(longest, (next - p).norm());
          ASSERT_LE(std::abs(distance_of(face, p)), tolerance);
        }
        const double bound = tolerance + larger_curvature(face) * longest * longest / 6.0;
        worst = std::max(worst, std::abs(distance_of(face, middle)) / bound);
        // the body is that far off its facet, too: none is of a face that it is not on
        const Vector3d p = filleted::any_pose(seed, 200.0).inverse() * middle;
        ASSERT_NEAR(std::abs(body.truth(p).distance), std::abs(distance_of(face, middle)),
                    2.0 * tolerance)
            << body.name << ", " << degrees << " degrees, seed " << seed;
      }
      ++seed;
    }
  std::cout << "middles of facets at most " << worst << " of the bound\n";
  EXPECT_LT(worst, 1.0);
}

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
  SeededRandom random(7);
  std::uniform_real_distribution<double> radius(1.0, 4.0), angle(-3.0, 3.0);
  std::uniform_int_distribution<int> size(3, 40);
  for (int i = 0; i < 300; ++i) {
    const int n = size(random);
    const Matrix3d turn = (Eigen::AngleAxisd(angle(random), Vector3d::UnitX()) *
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
