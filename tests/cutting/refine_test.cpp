#include <tbb/global_control.h>
#include "cutting/map/interpolation.h"
#include "cutting/map/refinement.h"
#include "cutting/part/primitive.h"
#include "cutting/part/remeshing.h"
#include "cutting/surface/surface.h"
#include "kinematics/hash.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/turned_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

constexpr double micron = 1e-3;

/// A ball of 5 mm along x in passes `pitch` apart, turned by `angle` about z, over a square of
/// `side`; z wavers along the passes by a micrometre over 20 mm.
CutterMotion passes(double pitch, double side, double angle) {
  std::vector<Stop> stops;
  const Eigen::AngleAxisd turn(angle, Vector3d::UnitZ());
  const double reach = 0.8 * side;
  for (double y = -reach; y <= reach; y += pitch) {
    stops.push_back({turn * Vector3d(-reach, y, 5.0)});
    for (double x = -reach; x <= reach; x += 1.0)
      stops.push_back(
          {turn * Vector3d(x, y, micron * std::sin(2.0 * std::numbers::pi * x / 20.0))});
    stops.push_back({turn * Vector3d(reach, y, 5.0)});
  }
  return motion_of(stops);
}

struct Milled {
  CutterMotion motion;
  Cutter cutter = ball_mill;
  std::function<Surface(const Design&)> search = prepare_milled_surface(cutter, motion);
  SurfaceProbe operator()(const Design& design) const {
    Surface surface = search(design);
    PassGradients gradients = milled_gradients(design, surface, cutter, motion);
    return {std::move(surface), std::move(gradients)};
  }
};

SurfaceInterpolator on(const Primitive& primitive) {
  return primitive_interpolator(primitive, Eigen::Isometry3d::Identity());
}

TEST(Refine, APlaneOfCuspsIsResolvedToTheBoundHoweverItsVerticesStand) {
  for (const double angle : {0.0, 0.3, std::numbers::pi / 2}) {
    for (const int vertices : {150, 900, 4000}) {
      const Primitive plane = RectanglePlane{10.0, 10.0};
      const Milled mill{passes(0.5, 10.0, angle)};
      const RefineOptions options{.resolution = 0.15 * micron, .can_flip_edges = true};
      const RefinementResult fine =
          refined(tessellate(plane, {vertices}), on(plane), std::cref(mill), options);
      const Surface surface = mill.search(fine.design);
      const InterpolationError error =
          interpolation_error(fine.design, surface, on(plane), mill.search,
                              {.places = 10000, .resolution = options.resolution});
      std::cout << "passes at " << angle << ", " << vertices
                << " vertices: " << fine.design.vertices.rows() << ", " << fine.probed_points
                << " looked at, worst " << error.worst / micron << " um, "
                << 100.0 * error.unresolved << " % beyond 0.15\n";
      EXPECT_EQ(fine.left, 0);
      EXPECT_EQ(fine.surface.residual, surface.residual);
      EXPECT_EQ(fine.surface.cut_time_s, surface.cut_time_s);
      EXPECT_EQ(fine.surface.cut_line, surface.cut_line);
      EXPECT_EQ(fine.surface.status, surface.status);
      EXPECT_GT(error.places, 9000);
      EXPECT_LT(error.unresolved, 0.002);
      EXPECT_LT(error.worst, 2.0 * options.resolution);
    }
  }
}

TEST(Refine, ADomeOfCusps) {
  const Primitive dome = SphereCap{60.0, 8.0};
  std::vector<Stop> stops;
  for (double y = -9.0; y <= 9.0; y += 0.35) {
    stops.push_back({{-9.0, y, 8.0}});
    for (double x = -9.0; x <= 9.0; x += 0.5)
      stops.push_back({{x, y, std::sqrt(65.0 * 65.0 - x * x - y * y) - 60.0 - 5.0}});
    stops.push_back({{9.0, y, 8.0}});
  }
  const Milled mill{motion_of(stops)};
  const RefinementResult fine = refined(tessellate(dome, {2000}), on(dome), std::cref(mill),
                                        {.resolution = 0.1 * micron, .can_flip_edges = true});
  const Surface surface = mill.search(fine.design);
  const InterpolationError error = interpolation_error(
      fine.design, surface, on(dome), mill.search, {.places = 10000, .resolution = 0.1 * micron});
  std::cout << fine.design.vertices.rows() << " vertices, " << fine.probed_points
            << " looked at, worst " << error.worst / micron << " um, " << 100.0 * error.unresolved
            << " % beyond 0.1\n";
  EXPECT_LT(error.unresolved, 0.002);
  for (Index i = 0; i < fine.design.vertices.rows(); ++i) {
    const Vector3d from = fine.design.vertices.row(i).transpose() + Vector3d(0, 0, 60.0);
    ASSERT_NEAR(from.norm(), 60.0, 1e-12);
  }
}

TEST(Refine, TrianglesThatAreNotLookedIntoMissNoMore) {
  constexpr std::uint64_t seed = 20261124;
  const auto chance = [&](std::uint64_t k) { return split_mix::unit(split_mix::stream(seed, k)); };
  double most = 0.0, max_all = 0.0;
  for (std::uint64_t i = 0; i < 6; ++i) {
    const double pitch = 0.2 + 0.8 * chance(4 * i), angle = std::numbers::pi * chance(4 * i + 1);
    const double share = 0.03 + 0.17 * chance(4 * i + 2);
    const double cusp = pitch * pitch / (8.0 * ball_mill.corner_radius);
    const Primitive plane = RectanglePlane{8.0, 8.0};
    const Milled mill{passes(pitch, 8.0, angle)};
    const int vertices = 100 + int(2000.0 * chance(4 * i + 3));
    const auto refined_with = [&](bool all) {
      const RefineOptions options{
          .resolution = share * cusp, .can_flip_edges = true, .probe_all_triangles = all};
      RefinementResult fine =
          refined(tessellate(plane, {vertices}), on(plane), std::cref(mill), options);
      const InterpolationError error =
          interpolation_error(fine.design, mill.search(fine.design), on(plane), mill.search,
                              {.places = 40000, .seed = i, .resolution = share * cusp});
      std::cout << "pitch " << pitch << ", bound " << share * cusp / micron << " um, "
                << fine.design.vertices.rows() << " vertices, " << fine.probed_points
                << " looked at; worst " << error.worst / error.resolution << " of the bound, "
                << 100.0 * error.unresolved << " % beyond\n";
      return std::pair(fine.probed_points, error);
    };
    const auto [places, error] = refined_with(false);
    const auto [places_all, error_all] = refined_with(true);
    EXPECT_LT(places, places_all);
    EXPECT_LE(error.unresolved, error_all.unresolved + 5e-4) << "seed " << seed << ", case " << i;
    most = std::max(most, error.worst / error.resolution);
    max_all = std::max(max_all, error_all.worst / error_all.resolution);
  }
  std::cout << "worst " << most << " of the bound, " << max_all << " when all are looked into\n";
  EXPECT_LT(most, std::max(1.5, 1.25 * max_all));
}

TEST(Refine, NothingIsAddedWhereTheResidualIsLinear) {
  const Primitive plane = RectanglePlane{10.0, 10.0};
  std::vector<Stop> stops;
  for (double y = -20.0; y <= 20.0; y += 5.0)
    for (const double x : {-20.0, 20.0}) stops.push_back({{x, y, 1e-3}});
  Milled mill{motion_of(stops), {8.0, 0.0, 20.0}};
  const Design design = tessellate(plane, {400});
  const RefinementResult fine = refined(design, on(plane), std::cref(mill), {.resolution = 5e-5});
  EXPECT_EQ(fine.design.vertices.rows(), design.vertices.rows());
}

TEST(Refine, StopsAtItsBudgetEvenlyAndSaysSo) {
  const Primitive plane = RectanglePlane{10.0, 10.0};
  const Milled mill{passes(0.5, 10.0, 0.1)};
  const RefinementResult fine =
      refined(tessellate(plane, {200}), on(plane), std::cref(mill),
              {.resolution = 1e-5, .points = 3000, .can_flip_edges = true});
  EXPECT_EQ(fine.design.vertices.rows(), 3000);
  EXPECT_GT(fine.left, 100);
  EXPECT_GT(fine.reached, 1e-4);
  const InterpolationError error =
      interpolation_error(fine.design, mill.search(fine.design), on(plane), mill.search,
                          {.places = 10000, .resolution = fine.reached});
  std::cout << "reached " << fine.reached / micron << " um, worst " << error.worst / micron
            << " um, " << 100.0 * error.unresolved << " % beyond\n";
  EXPECT_LT(error.unresolved, 0.05);
}

TEST(Refine, IsTheSameForAnyNumberOfThreads) {
  const Primitive plane = RectanglePlane{6.0, 6.0};
  const Milled mill{passes(0.5, 6.0, 0.2)};
  const auto made = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return refined(tessellate(plane, {200}), on(plane), std::cref(mill),
                   {.resolution = 2e-4, .can_flip_edges = true})
        .design;
  };
  const Design one = made(1), two = made(2);
  EXPECT_EQ(one.vertices, two.vertices);
  EXPECT_EQ(one.triangles, two.triangles);
}

TEST(Refine, CoversTheSameAreaAndKeepsWhatWasGiven) {
  const Primitive plane = RectanglePlane{6.0, 6.0};
  const Milled mill{passes(0.5, 6.0, 0.2)};
  const Design design = tessellate(plane, {200});
  const Design fine =
      refined(design, on(plane), std::cref(mill), {.resolution = 2e-4, .can_flip_edges = true})
          .design;
  EXPECT_NEAR(fine.area.sum(), 36.0, 1e-9);
  EXPECT_EQ(fine.vertices.topRows(design.vertices.rows()), design.vertices);
  for (const auto& t : fine.triangles.rowwise()) {
    const Vector3d a = fine.vertices.row(t[0]), b = fine.vertices.row(t[1]),
                   c = fine.vertices.row(t[2]);
    ASSERT_GT((b - a).cross(c - a).z(), 0.0);
  }
}

TEST(PassGradients, GradientsAreTheDifferencesOfTheResidual) {
  const Milled mills[] = {{passes(0.5, 10.0, 0.3), ball_mill},
                          {passes(0.5, 10.0, 0.3), {5.0, 1.0, 20.0}}};
  for (const Milled& mill : mills) {
    std::vector<Site> sites, moved;
    constexpr double step = 1e-4;
    for (int i = 0; i < 200; ++i) {
      const double x = 0.041 * (i % 17) - 0.3, y = 0.037 * (i / 17) - 0.2;
      sites.push_back({{x, y, 0.0}, Vector3d(0.05, -0.03, 1.0).normalized()});
      for (const Vector3d& d : {Vector3d(step, 0, 0), Vector3d(0, step, 0)})
        moved.push_back({sites.back().point + d, sites.back().normal});
    }
    const SurfaceProbe here = mill(design_of(sites)), there = mill(design_of(moved));
    int compared = 0;
    for (Index i = 0; i < 200; ++i)
      for (Index k = 0; k < 2; ++k) {
        const Index j = 2 * i + k;
        // a crest or a join of moves between the two is no slope
        if (std::abs(there.gradients.travel[j] - here.gradients.travel[i]) > 20.0 * step) continue;
        const double change = there.surface.residual[j] - here.surface.residual[i];
        EXPECT_NEAR(change, -here.gradients.gradient(i, k) * step, 0.2 * step * step + 2e-9);
        ++compared;
      }
    EXPECT_GT(compared, 300);
  }
}

TEST(Subdivide, LeavesNoJudgedEdgeLonger) {
  const Primitive dome = SphereCap{30.0, 10.0};
  const Design fine = subdivide(tessellate(dome, {300}), on(dome), {0.5, 100000});
  double longest = 0.0;
  for (const auto& t : fine.triangles.rowwise())
    for (int k = 0; k < 3; ++k)
      longest =
          std::max(longest, (fine.vertices.row(t[k]) - fine.vertices.row(t[(k + 1) % 3])).norm());
  EXPECT_LE(longest, 0.5);
  EXPECT_GT(longest, 0.25);
}

}  // namespace
}  // namespace abbe::cutting
