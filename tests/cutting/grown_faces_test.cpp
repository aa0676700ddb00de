#include <ctime>
#include "cutting/part/design_points.h"
#include "cutting/part/face_growth.h"
#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "cutting/part/recognition.h"
#include "cutting/part/remeshing.h"
#include "tests/cutting/filleted_bodies.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using filleted::Body;

constexpr double tolerance = 0.1 * units::um;

std::map<std::string, int> forms_in(const RecognisedMesh& found) {
  constexpr const char* names[] = {"plane", "sphere", "cylinder", "cone", "torus"};
  std::map<std::string, int> forms;
  for (const AnalyticPatch& one : found.patches) ++forms[names[std::size_t(one.form)]];
  return forms;
}

/// How far a design is from the true surface: an exact cut of it shows that as residual.
struct Off {
  double distance = 0.0, normal = 0.0, residual = 0.0;
};
Off off_truth(const Design& design, const Body& body, const Eigen::Isometry3d& T) {
  Off worst;
  for (Index i = 0; i < design.vertices.rows(); ++i) {
    const Vector3d p = T.inverse() * Vector3d(design.vertices.row(i));
    const Vector3d n = T.linear().transpose() * Vector3d(design.normals.row(i));
    double along = 0.0;  // along the normal to the surface
    for (int round = 0; round < 20; ++round) {
      const filleted::True there = body.truth(p + along * n);
      along -= there.distance / there.normal.dot(n);
    }
    const filleted::True here = body.truth(p);
    worst.distance = std::max(worst.distance, std::abs(here.distance));
    worst.normal = std::max(worst.normal, (here.normal - n).norm());
    worst.residual = std::max(worst.residual, std::abs(along));
  }
  return worst;
}

std::vector<Body> bodies(double degrees) {
  return {filleted::rounded_box({20.0, 15.0, 8.0}, 2.0, degrees),
          filleted::pocket(25.0, 18.0, 6.0, 2.0, 9.0, degrees),
          filleted::boss(8.0, 12.0, 1.5, 20.0, degrees)};
}

TEST(FaceRegions, FilletsAndWhatTheyJoinFromAnStl) {
  unsigned seed = 41;
  for (const double degrees : {5.0, 15.0, 22.5})
    for (const Body& body : bodies(degrees)) {
      SCOPED_TRACE(testing::Message()
                   << body.name << " at " << degrees << " degrees, seed " << seed);
      const Eigen::Isometry3d T = filleted::any_pose(seed++, 200.0);
      const Design faces = split_at_edges(filleted::as_stl(body, T), pi / 6);
      const RecognisedMesh found = recognise_patches(faces, tolerance);
      EXPECT_EQ(forms_in(found), body.faces);
      double area = 0.0;
      for (const AnalyticPatch& one : found.patches) area += one.area;
      EXPECT_NEAR(area, found.area, 1e-9 * found.area);
      const Off before = off_truth(subdivide(faces, smooth_facet_point, {0.4}), body, T),
                at = off_truth(found.design, body, T),
                between = off_truth(
                    subdivide(refine_round_borders(found.design, found.patches, 0.1 * tolerance),
                              patch_interpolator(found.patches, Eigen::Isometry3d::Identity()),
                              {0.4}),
                    body, T);
      std::cout << body.name << ", " << degrees << " deg: residual " << before.residual / units::um
                << " um, normals " << before.normal << " rad as facets; recognised, at vertices "
                << at.residual / units::um << " um, " << at.normal << " rad; between them "
                << between.residual / units::um << " um, " << between.normal << " rad\n";
      EXPECT_LT(at.residual, 0.1 * units::um);
      EXPECT_LT(at.normal, 1e-4);
      EXPECT_LT(between.residual, 0.1 * units::um);
    }
}

TEST(FaceRegions, TangentBordersAreNoEdges) {
  const Body body = filleted::boss(8.0, 12.0, 1.5, 20.0, 15.0);
  const Design faces =
      split_at_edges(filleted::as_stl(body, Eigen::Isometry3d::Identity()), pi / 6);
  const RecognisedMesh found = recognise_patches(faces, tolerance);
  ASSERT_EQ(found.patches.size(), 5u);
  const Design round = refine_round_borders(found.design, found.patches, 0.1 * tolerance);
  const std::vector<int> patch = patches(round);
  EXPECT_EQ(*std::max_element(patch.begin(), patch.end()), 0) << "one smooth patch";
  for (const auto& [kept, added] : round.seams) {
    EXPECT_LT((round.vertices.row(kept) - round.vertices.row(added)).norm(), tolerance);
    EXPECT_GT(round.normals.row(kept).dot(round.normals.row(added)), 1.0 - 1e-6);
  }
  EXPECT_TRUE(sharp_edges(faces).empty());
  // the margin at the rim of the top, 8 mm in z and less than 60 degrees steep
  const double least = 0.5;
  const Design judged = judge_top(round, {least, 0.3, top_rim(faces, least)});
  const Design at_borders = exclude_near_edges(round, sharp_edges(faces), 0.5);
  EXPECT_TRUE(at_borders.judged.empty()) << "nothing is left out at a tangent line";
  int tops = 0;
  for (Index i = 0; i < round.vertices.rows(); ++i)
    tops += judged.judged[std::size_t(i)] && round.vertices(i, 2) > 12.0 - 1e-6;
  EXPECT_GT(tops, 24) << "the border of the top plane is within the top";
}

TEST(FaceRegions, AProgramFollowsTheSurfaceAndNotTheFacets) {
  for (const double degrees : {5.0, 15.0, 22.5}) {
    const Body body = filleted::boss(8.0, 5.0, 2.0, 20.0, degrees);
    const Eigen::Isometry3d T(Eigen::Translation3d(300.0, -120.0, 40.0));
    const RecognisedMesh found =
        recognise_patches(split_at_edges(filleted::as_stl(body, T), pi / 6), tolerance);
    const MeshHeightMap mesh(refine_round_borders(found.design, found.patches, 0.1 * tolerance),
                             found.patches);
    double off = 0.0, lean = 0.0;
    int places = 0;
    for (double x = -13.0; x <= 13.0; x += 0.0731)
      for (double y = -13.0; y <= 13.0; y += 0.0817) {
        const double rho = std::hypot(x, y);
        if (std::abs(rho - 8.0) < 0.2) continue;  // upright
        const auto at = highest_surface_point(mesh, 300.0 + x, -120.0 + y);
        ASSERT_TRUE(at) << "a gap at " << x << ", " << y;
        const filleted::True there = body.truth(T.inverse() * at->point);
        off = std::max(off, std::abs(there.distance));
        lean = std::max(lean, (there.normal - at->normal).norm());
        ++places;
      }
    std::cout << degrees << " deg: contacts " << off / units::um << " um and " << lean
              << " rad off, of " << places << "\n";
    EXPECT_LT(off, 0.1 * units::um);
    EXPECT_LT(lean, 0.01);
  }
}

/// Strips along y through points (x, z), each as long as it is cut into.
Design extruded(const std::vector<Vector2d>& profile) {
  filleted::Builder made;
  const auto at = [](const Vector2d& p, double y) { return Vector3d(p[0], y, p[1]); };
  for (std::size_t i = 0; i + 1 < profile.size(); ++i)
    made.quad(at(profile[i], 0), at(profile[i + 1], 0), at(profile[i + 1], 20), at(profile[i], 20));
  return filleted::as_stl({"strips", made.points, made.triangles, {}, {}},
                          filleted::any_pose(5, 100.0));
}

std::string forms_text(const Design& mesh) {
  std::string text;
  const RecognisedMesh found = recognise_patches(split_at_edges(mesh, pi / 6), tolerance);
  for (const auto& [form, count] : forms_in(found)) text += std::to_string(count) + form + " ";
  return text;
}

TEST(FaceRegions, FewLinesShowACylinderOnlyWherePlanesRunIntoIt) {
  // a plane, an arc of r 3 in n steps of 15 degrees, a plane; and the arc alone
  for (const int steps : {1, 2, 3, 4, 6}) {
    std::vector<Vector2d> arc, both = {{-10.0, 0.0}};
    for (int i = 0; i <= steps; ++i) {
      const double a = filleted::radians(15.0 * i);
      arc.emplace_back(3.0 * std::sin(a), 3.0 * (1.0 - std::cos(a)));
    }
    both.insert(both.end(), arc.begin(), arc.end());
    const double end = filleted::radians(15.0 * steps);
    both.emplace_back(arc.back() + 10.0 * Vector2d(std::cos(end), std::sin(end)));
    EXPECT_EQ(forms_text(extruded(both)), steps < 2 ? "" : "1cylinder 2plane ") << steps;
    EXPECT_EQ(forms_text(extruded(arc)), steps == 1  ? "1plane "
                                         : steps < 4 ? ""
                                                     : "1cylinder ")
        << steps;
  }
}

TEST(FaceRegions, AFreeCurveTakesTheNormalOfThePlaneIntoWhichItRuns) {
  // a plane with corners enough to show it, then a quarter of an ellipse
  filleted::Builder made;
  const std::vector<Vector3d> outline = {{0, 0, 0},    {0, 20, 0},  {-9, 20, 0}, {-12, 17, 0},
                                         {-14, 10, 0}, {-12, 3, 0}, {-9, 0, 0}};
  made.fan(outline);
  const auto at = [](int i, double y) {
    const double a = filleted::radians(9.0 * i);
    return Vector3d(5.0 * std::sin(a), y, 3.0 * (1.0 - std::cos(a)));
  };
  for (int i = 0; i < 8; ++i) made.quad(at(i, 0), at(i + 1, 0), at(i + 1, 20), at(i, 20));
  const Eigen::Isometry3d T = filleted::any_pose(9, 100.0);
  const RecognisedMesh found = recognise_patches(
      split_at_edges(filleted::as_stl({"curve", made.points, made.triangles, {}, {}}, T), pi / 6),
      tolerance);
  ASSERT_EQ(found.patches.size(), 1u);
  EXPECT_EQ(found.patches[0].form, Form::Plane);
  int borders = 0;
  for (const auto& [kept, added] : found.design.seams) {
    EXPECT_LT((found.design.normals.row(kept) - found.design.normals.row(added)).norm(), 1e-12);
    ++borders;
  }
  EXPECT_EQ(borders, 2);
}

TEST(FaceRegions, NoFacesOfStripsOfWhatIsNone) {
  std::vector<Vector2d> wave, turns;
  for (int i = 0; i <= 40; ++i) wave.emplace_back(i, 4.0 * std::sin(0.2 * i));
  EXPECT_EQ(forms_text(extruded(wave)), "");
  // chamfers: planes that turn by 20 degrees, which no more than their own normals tell of
  for (int i = 0; i <= 3; ++i)
    turns.emplace_back(i < 1 ? Vector2d(0, 0)
                             : Vector2d(turns.back() + (5.0 + i) * Vector2d(std::cos(0.35 * i),
                                                                            std::sin(0.35 * i))));
  EXPECT_EQ(forms_text(extruded(turns)), "");
  // a tube along a bend, in rings of 10 degrees: no strip of it is a cylinder, all of it is a torus
  filleted::Builder tube;
  const auto at = [](int i, int k, double flatter) {
    const double a = filleted::radians(10.0 * i), b = filleted::radians(15.0 * (k % 24));
    const double rho = 30.0 + 6.0 * std::cos(b);
    return Vector3d(rho * std::cos(a), flatter * rho * std::sin(a), 6.0 * std::sin(b));
  };
  for (const double flatter : {1.0, 0.8}) {
    tube = {};
    for (int i = 0; i < 18; ++i)
      for (int k = 0; k < 24; ++k)
        tube.quad(at(i, k, flatter), at(i + 1, k, flatter), at(i + 1, k + 1, flatter),
                  at(i, k + 1, flatter));
    EXPECT_EQ(forms_text(filleted::as_stl({"tube", tube.points, tube.triangles, {}, {}},
                                          filleted::any_pose(6, 100.0))),
              flatter == 1.0 ? "1torus " : "")
        << flatter;
  }
}

/// An ellipsoid over a square of its middle, n by n quadrangles.
Body ellipsoid(int n) {
  const Vector3d half(30.0, 22.0, 12.0);
  Body body;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = -18.0 + 36.0 * i / n, y = -12.0 + 24.0 * j / n;
      body.points.emplace_back(
          x, y, half.z() * std::sqrt(1.0 - std::pow(x / half.x(), 2) - std::pow(y / half.y(), 2)));
      if (i == n || j == n) continue;
      const int a = i * (n + 1) + j, b = a + n + 1;
      body.triangles.push_back({a, b, b + 1});
      body.triangles.push_back({a, b + 1, a + 1});
    }
  body.truth = [half](const Vector3d& p) {
    const Vector3d g = 2.0 * p.cwiseQuotient(half.cwiseProduct(half));
    const double f = p.cwiseQuotient(half).squaredNorm() - 1.0;
    return filleted::True{f / g.norm(), g.normalized()};  // first order is enough near it
  };
  return body;
}

TEST(FacetMiss, IsAboutWhatTheFacetsMiss) {
  const auto compare = [](const Body& body, const std::string& name) {
    const Design mesh = filleted::as_stl(body, Eigen::Isometry3d::Identity());
    const Design between = subdivide(mesh, smooth_facet_point, {0.3});
    double off = 0.0;
    for (Index i = 0; i < between.vertices.rows(); ++i)
      off = std::max(off, std::abs(body.truth(between.vertices.row(i)).distance));
    const double said = facet_uncertainty(mesh).maxCoeff();
    std::cout << name << ": " << said / units::um << " um predicted, " << off / units::um
              << " um found\n";
    EXPECT_GT(said, off / 2.0) << name;
    EXPECT_LT(said, 2.0 * off) << name;
  };
  for (const int n : {12, 24, 48}) compare(ellipsoid(n), "ellipsoid " + std::to_string(n));
  for (const double degrees : {5.0, 15.0, 22.5})
    compare(filleted::boss(8.0, 12.0, 1.5, 20.0, degrees), "boss " + std::to_string(degrees));
}

double cpu_seconds_of(const Design& design) {
  const std::clock_t start = std::clock();
  const RecognisedMesh found = recognise_patches(design, tolerance);
  for (const auto& [form, count] : forms_in(found)) ADD_FAILURE() << count << " times a " << form;
  return double(std::clock() - start) / CLOCKS_PER_SEC;
}

/// A free form over a square, n by n quadrangles.
Design free_form(int n, double waves) {
  Body body;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = 100.0 * i / n, y = 100.0 * j / n;
      body.points.emplace_back(x, y,
                               waves * (std::sin(0.11 * x + 0.3) * std::cos(0.07 * y) +
                                        0.3 * std::sin(0.05 * x * y / 10.0 + 1.0)));
      if (i == n || j == n) continue;
      const int a = i * (n + 1) + j, b = a + n + 1;
      body.triangles.push_back({a, b, b + 1});
      body.triangles.push_back({a, b + 1, a + 1});
    }
  return filleted::as_stl(body, filleted::any_pose(7, 100.0));
}

/// A sector of a cylinder R 30, n by n quadrangles, with waves.
Design nearly_a_cylinder(int n, double waves) {
  Body body;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double y = 100.0 * i / n, angle = -1.0 + 2.0 * j / n;
      const double r = 30.0 + waves * std::sin(y / 8.0) * std::cos(4.0 * angle);
      body.points.emplace_back(r * std::sin(angle), y, r * std::cos(angle));
      if (i == n || j == n) continue;
      const int a = i * (n + 1) + j, b = a + n + 1;
      body.triangles.push_back({a, a + 1, b + 1});
      body.triangles.push_back({a, b + 1, b});
    }
  return filleted::as_stl(body, filleted::any_pose(8, 100.0));
}

void expect_in_proportion(const std::string& name, const Design& small, const Design& large) {
  const double few = cpu_seconds_of(small), many = cpu_seconds_of(large);
  std::cout << name << ": " << few << " s of " << small.triangles.rows() << " triangles, " << many
            << " s of " << large.triangles.rows() << "\n";
  EXPECT_LT(many, 8.0 * few + 0.5) << name;
}

TEST(FaceRegions, AFreeFormHasNoneAndTakesTimeInProportion) {
  for (const double waves : {0.5, 2.0, 4.0, 12.0})
    expect_in_proportion("waves of " + std::to_string(waves) + " mm", free_form(112, waves),
                         free_form(224, waves));
  for (const double waves : {0.2, 0.5, 2.0, 10.0})
    expect_in_proportion("a cylinder with waves of " + std::to_string(waves) + " um",
                         nearly_a_cylinder(112, waves * units::um),
                         nearly_a_cylinder(224, waves * units::um));
}

TEST(FaceRegions, WhatWasNotLookedForIsCounted) {
  const auto unexamined_triangles = [](const Design& design) {
    const RecognisedMesh found = recognise_patches(split_at_edges(design, pi / 6), 0.1 * units::um);
    std::cout << found.unexamined_triangles << " of " << design.triangles.rows() << " triangles\n";
    return found.unexamined_triangles;
  };
  EXPECT_EQ(unexamined_triangles(nearly_a_cylinder(112, 0.2 * units::um)), 0);
  EXPECT_GT(unexamined_triangles(nearly_a_cylinder(112, 2.0 * units::um)), 20000);
  for (const double waves : {0.5, 2.0, 4.0, 12.0})
    EXPECT_EQ(unexamined_triangles(free_form(112, waves)), 0);
}

}  // namespace
}  // namespace abbe::cutting
