#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cutting/part/recognition.h"
#include "cutting/part/remeshing.h"
#include "kinematics/units.h"
#include "tests/cutting/filleted_bodies.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using std::numbers::pi;

using Sampled = std::function<Vector3d(double, double)>;

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
  const Recognised found = recognised(split_at_edges(mesh, pi / 6), tolerance);
  Missed worst{found.patches.size()};
  for (Index t = 0; t < mesh.triangles.rows() && worst.faces > 0; ++t) {
    const int face = found.design.face[std::size_t(found.design.triangles(t, 0))];
    if (face < 0) continue;
    Eigen::Vector2d middle(0.0, 0.0);
    for (const int v : mesh.triangles.row(t))
      middle += Eigen::Vector2d(double(v / (patch.m + 1)) / patch.n,
                                double(v % (patch.m + 1)) / patch.m) /
                3.0;
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
      const Recognised found = recognised(split_at_edges(mesh, pi / 6), tolerance);
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

}  // namespace
}  // namespace abbe::cutting
