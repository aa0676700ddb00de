#include "cutting/surface/machined_surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/random.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

constexpr double search_band = 2.0;  // mm

SurfaceFunction surface_of(const Cutter& cutter, const CutterMotion& motion) {
  return [cutter, motion](const Design& design, double within) {
    return milled_surface(design, cutter, motion, {.band = within, .progress = {}});
  };
}

/// Stops around the plane z = 0, some of them far below it.
std::vector<Stop> wandering(Random& random, int count) {
  std::vector<Stop> stops;
  for (int i = 0; i < count; ++i) {
    const double deep = random.in(0.0, 1.0) < 0.15 ? -random.in(1.0, 12.0) : 0.0;
    stops.push_back({Vector3d(random.in(-12, 12), random.in(-12, 12), random.in(-1.5, 4.0) + deep),
                     Vector3d(random.in(-0.4, 0.4), random.in(-0.4, 0.4), 1).normalized()});
  }
  return stops;
}

Design sites(Random& random, int count) {
  std::vector<Site> all;
  for (int i = 0; i < count; ++i)
    all.push_back({Vector3d(random.in(-12, 12), random.in(-12, 12), 0.0),
                   Vector3d(random.in(-0.2, 0.2), random.in(-0.2, 0.2), 1).normalized()});
  return design_of(all);
}

TEST(United, ASweepInPiecesIsTheSweep) {
  Random random(20261123);
  const CutterMotion whole = motion_of(wandering(random, 40));
  const Design design = sites(random, 3000);
  for (const Cutter& cutter :
       {Cutter{3.0, 3.0, 8.0}, Cutter{4.0, 1.0, 6.0}, Cutter{2.0, 0.0, 5.0}}) {
    std::vector<SurfaceFunction> pieces;
    for (const auto& [first, last] : {std::pair{0, 9}, {9, 10}, {10, 31}, {31, 39}}) {
      const Index n = last - first + 1;
      pieces.push_back(surface_of(
          cutter, {whole.tip.middleRows(first, n), whole.axis.middleRows(first, n),
                   whole.time_s.segment(first, n),
                   std::vector<int>(whole.line.begin() + first, whole.line.begin() + last + 1)}));
    }
    const Surface expected = surface_of(cutter, whole)(design, search_band);
    const Surface found = combined_surface(design, pieces, search_band);
    EXPECT_EQ(found.status, expected.status);
    int cut = 0;
    for (std::size_t i = 0; i < found.status.size(); ++i) {
      if (expected.status[i] != VertexStatus::Cut) continue;
      const auto v = Index(i);
      EXPECT_NEAR(found.residual[v], expected.residual[v], no_difference) << i;
      EXPECT_NEAR(found.cut_time_s[v], expected.cut_time_s[v], 1e-6) << i;
      EXPECT_EQ(found.cut_line[i], expected.cut_line[i]) << i;
      ++cut;
    }
    EXPECT_GT(cut, 100);
    ASSERT_EQ(found.gouges.size(), expected.gouges.size());
    EXPECT_GT(found.gouges.size(), 50u);
    std::size_t shallower = 0;  // a piece that cuts within the band is not asked what it cut below
    for (std::size_t i = 0; i < found.gouges.size(); ++i) {
      EXPECT_EQ(found.gouges[i].vertex, expected.gouges[i].vertex);
      EXPECT_LT(found.gouges[i].depth, expected.gouges[i].depth + 1e-6);
      shallower += found.gouges[i].depth < expected.gouges[i].depth - 1e-6;
    }
    std::cout << cut << " cut, " << found.gouges.size() << " gouges, " << shallower
              << " of which are deeper in the whole sweep\n";
    EXPECT_LT(10 * shallower, found.gouges.size());
  }
}

TEST(United, IsTheLeastOfWhatToolsRemoveByBruteForce) {
  Random random(7);
  const std::vector<Cutter> cutters = {{3.0, 3.0, 8.0}, {4.0, 1.0, 6.0}, {2.0, 0.0, 5.0}};
  std::vector<std::vector<Stop>> stops;
  std::vector<SurfaceFunction> tools;
  for (const Cutter& cutter : cutters) {
    stops.push_back(wandering(random, 8));
    tools.push_back(surface_of(cutter, motion_of(stops.back())));
  }
  const Design design = sites(random, 150);
  const Surface found = combined_surface(design, tools, search_band);
  int cut = 0, gouged = 0, by[3] = {};
  double largest = 0.0;
  for (Index v = 0; v < design.vertices.rows(); ++v) {
    bool removed = false, is_cut = false;
    double least = search_band, bound = 0.0;
    int first = 0;
    for (std::size_t k = 0; k < cutters.size(); ++k) {
      std::vector<oracles::BrutePose> poses;
      for (std::size_t i = 0; i < stops[k].size(); ++i)
        poses.push_back({stops[k][i].tip, stops[k][i].axis, double(i)});
      const oracles::BruteHit hit = oracles::brute_milled(
          {design.vertices.row(v), design.normals.row(v)},
          {cutters[k].radius, cutters[k].corner_radius, cutters[k].flank_length}, poses,
          {.band = search_band, .tolerance = 1e-7, .most = 50000});
      removed |= hit.begins_removed;
      if (!hit.cut || !(hit.s < least)) continue;
      is_cut = true;
      least = hit.s;
      bound = hit.bound;
      first = int(k);
    }
    if (removed) {
      EXPECT_EQ(found.status[std::size_t(v)], VertexStatus::Gouged) << v;
      ++gouged;
    } else if (is_cut && bound < 1e-6) {
      ASSERT_EQ(found.status[std::size_t(v)], VertexStatus::Cut) << v;
      largest = std::max(largest, std::abs(found.residual[v] - least));
      ++by[first];
      ++cut;
    }
  }
  std::cout << cut << " cut (" << by[0] << ", " << by[1] << ", " << by[2] << " by each), " << gouged
            << " gouged, at most " << largest << " mm apart\n";
  EXPECT_LT(largest, 1e-6);
  EXPECT_GT(cut, 50);
  EXPECT_GT(gouged, 5);
  for (const int count : by) EXPECT_GT(count, 5);
}

TEST(United, OfEqualCutsTheEarliestIsNamed) {
  const Design design = design_of({{Vector3d(0, 0, 0)}});
  CutterMotion late = motion_of({{Vector3d(-9, 0, 0.5)}, {Vector3d(9, 0, 0.5)}}), early = late;
  late.time_s.array() += 100.0;
  late.line = {0, 70};
  for (const bool swapped : {false, true}) {
    std::vector<SurfaceFunction> tools = {surface_of(ball_mill, late),
                                          surface_of(ball_mill, early)};
    if (swapped) std::swap(tools[0], tools[1]);
    const Surface found = combined_surface(design, tools, search_band);
    EXPECT_EQ(found.cut_line[0], 10);
    EXPECT_DOUBLE_EQ(found.cut_time_s[0], 0.5);
  }
}

TEST(United, WhatLiesDeeperIsAGougeOnlyWhereNoToolCutsTheSurface) {
  // a groove far below the surface, and a cut at its height
  const Design design = design_of({{Vector3d(0, 0, 0)}, {Vector3d(5, 0, 0)}});
  const Cutter small{1.0, 1.0, 2.0};
  const SurfaceFunction groove =
      surface_of(small, motion_of({{Vector3d(-9, 0, -8)}, {Vector3d(9, 0, -8)}}));
  const SurfaceFunction above =
      surface_of(small, motion_of({{Vector3d(0, -9, 0.1)}, {Vector3d(0, 9, 0.1)}}));
  const Surface found = combined_surface(design, {groove, above}, search_band);
  EXPECT_EQ(found.status[0], VertexStatus::Cut);
  EXPECT_NEAR(found.residual[0], 0.1, 1e-9);
  EXPECT_EQ(found.status[1], VertexStatus::Gouged);
  ASSERT_EQ(found.gouges.size(), 1u);
  EXPECT_NEAR(found.gouges[0].depth, 8.0, 1e-6);
  // one that reaches up to -band takes the surface away
  const SurfaceFunction wide =
      surface_of({1.0, 1.0, 9.0}, motion_of({{Vector3d(-9, 0, -8)}, {Vector3d(9, 0, -8)}}));
  EXPECT_EQ(combined_surface(design, {wide, above}, search_band).status[0], VertexStatus::Gouged);
  EXPECT_EQ(combined_surface(design, {above, wide}, search_band).status[0], VertexStatus::Gouged);
}

}  // namespace
}  // namespace abbe::cutting
