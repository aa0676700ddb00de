// Findings on the cut part against closed forms.

#include "cutting/stock/part_findings.h"
#include <tbb/global_control.h>
#include "cutting/stock/stock_mesh.h"
#include "tests/cutting/held_parts.h"
#include "tests/cutting/stock_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using namespace held_parts;

// ---- nothing to find ----------------------------------------------------------------------------

TEST(PartFindings, AnExactCutHasNone) {
  SeededRandom random(20263);
  for (const double spacing : {0.9, 0.5}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 1e-6));
    expect_none(all);
    EXPECT_LT(worst(all.part), 1e-8);
    EXPECT_EQ(all.found.no_design, 0.0);
    EXPECT_EQ(all.found.unresolved, 0.0);
    EXPECT_NEAR(all.found.compared,
                2 * (40 * 30 + 40 * 20 + 30 * 20) + 2 * (23.24 + 18.58) * (20 - pocket_floor),
                0.6 * spacing * (4 * 90 + 4 * 41.82 + 4 * (20 - pocket_floor)));
  }
}

TEST(PartFindings, SharpEdgesHoweverTheyLieMakeNoFinding) {
  // the blank is the design, turned at random against the grid: its edges run through the cells
  SeededRandom random(20264);
  double max_listed = 0.0, off_skin = 0.0;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Isometry3d T = any_pose(random), T_wk = any_pose(random);
    const Design design = pocketed(pocket_x, pocket_y, pocket_floor).design(T);
    const Design in_k = pocketed(pocket_x, pocket_y, pocket_floor).design(T_wk.inverse() * T);
    const Stock stock = make_stock(MeshBlank{in_k.vertices, in_k.triangles}, T_wk, {1.1, true});
    FindingOptions options;
    options.rest = options.gouge = 1e-6;
    options.undercut_along = std::nullopt;
    const Held all = held(stock, design, options);
    expect_none(all);
    EXPECT_EQ(all.found.blank_too_small, 0.0);
    EXPECT_LT(all.found.unresolved, 0.02 * all.found.compared);
    max_listed = std::max(max_listed, worst(all.part));
    const DesignDistance distance(design, facets());
    for (const auto& v : all.skin.mesh.vertices_w.rowwise())
      off_skin = std::max(off_skin, std::abs(distance.at(v.transpose()).value));
  }
  std::cout << "places off the design by " << max_listed << " mm, vertices by " << off_skin
            << " mm\n";
  EXPECT_LT(max_listed, 1e-8);
  EXPECT_GT(off_skin, 0.1) << "the vertices themselves would be findings";
}

// ---- findings of known size ---------------------------------------------------------------------

TEST(PartFindings, APlaceThatIsLeftTooHighHasItsVolumeDepthAndPlace) {
  SeededRandom random(20265);
  const std::array<double, 2> x{14.3, 26.9}, y{9.1, 19.6};
  const double left = 0.3, expected = left * (x[1] - x[0]) * (y[1] - y[0]);
  for (const double spacing : {1.0, 0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor + left, x, y);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
    EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
    EXPECT_EQ(regions(all.found, FindingKind::Undercut), 0u);
    const Finding& rest = all.found.list.front();
    std::cout << "spacing " << spacing << " mm: rest material " << rest.volume << " of " << expected
              << " mm^3, area " << rest.area << " of " << expected / left << " mm^2\n";
    EXPECT_NEAR(rest.volume, expected, left * 2 * (12.6 + 10.5) * 0.5 * spacing);
    EXPECT_NEAR(rest.depth, left, 1e-8);
    EXPECT_EQ(rest.line, 7);
    EXPECT_FALSE(rest.is_at_least);
    const Vector3d place = T.inverse() * rest.position_w;
    EXPECT_NEAR(place.z(), pocket_floor + left, 1e-8);
    EXPECT_GT(place.x(), x[0] - 1e-8);
    EXPECT_LT(place.x(), x[1] + 1e-8);
    EXPECT_GT(place.y(), y[0] - 1e-8);
    EXPECT_LT(place.y(), y[1] + 1e-8);
    for (Index i = 0; i < all.skin.mesh.vertices_w.rows(); ++i) {
      const Vector3d p = T.inverse() * Vector3d(all.skin.mesh.vertices_w.row(i));
      const bool within = p.x() > x[0] + spacing && p.x() < x[1] - spacing &&
                          p.y() > y[0] + spacing && p.y() < y[1] - spacing && p.z() > 5;
      if (within) {
        ASSERT_EQ(all.found.number[std::size_t(i)], 1);
      }
    }
  }
}

TEST(PartFindings, ABallThatDipsIntoAFlatGougesACap) {
  SeededRandom random(20266);
  std::uniform_real_distribution<double> shift(-0.5, 0.5);
  const double R = 6, h = 0.4, limit = 0.05;
  const auto cap = [&](double height) { return pi * height * height * (3 * R - height) / 3; };
  // the region ends where the depth is the limit: what it misses of the cap lies around it
  const double lower = h - limit, a2 = lower * (2 * R - lower);
  const double within = cap(lower) + limit * pi * a2;
  for (const double spacing : {0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    const Vector3d tip(20 + shift(random), 15 + shift(random), block.z() - h);
    remove(stock, Cutter{R, R, 30}, {T * pose(tip + Vector3d(0, 0, 10)), T * pose(tip), 42, false});
    const Design flat = pocketed(pocket_x, pocket_y, block.z()).design(T);  // of no depth
    const Held all = held(stock, flat, along_grid(T, limit));
    ASSERT_EQ(regions(all.found, FindingKind::Gouge), 1u);
    EXPECT_EQ(regions(all.found, FindingKind::Rest), 0u);
    EXPECT_EQ(regions(all.found, FindingKind::Undercut), 0u);
    const Finding& gouge = all.found.list.front();
    std::cout << "spacing " << spacing << " mm: gouge " << gouge.volume << " of " << within
              << " mm^3 beyond the limit, of " << cap(h) << " in all\n";
    EXPECT_NEAR(gouge.volume, within, 0.03 * within);
    EXPECT_LT(gouge.depth, h + 1e-8);
    EXPECT_GT(gouge.depth, h - spacing * spacing / (4 * R));  // the deepest place between the lines
    EXPECT_LT((T.inverse() * gouge.position_w - tip).norm(), spacing);
    EXPECT_EQ(gouge.line, 42);
    EXPECT_FALSE(gouge.by_crash);
  }
}

TEST(PartFindings, ACrashIsAGougeByThatLineAndABlankThatIsTooSmallIsNone) {
  Stock stock = make_stock(BoxBlank{{0, 0, 0}, {40, 30, 19.5}}, Eigen::Isometry3d::Identity(), {});
  remove(stock, Cutter{5, 0, 30}, {pose({-10, 15, 18}), pose({50, 15, 18}), 9, true});
  const Held all = held(stock, pocketed(pocket_x, pocket_y, block.z()).design());
  ASSERT_EQ(regions(all.found, FindingKind::Gouge), 1u);
  const Finding& gouge = all.found.list.front();
  EXPECT_EQ(gouge.line, 9);
  EXPECT_TRUE(gouge.by_crash);
  EXPECT_NEAR(gouge.depth, 2.0, 1e-8);
  // the slot alone; at its two ends it runs out over an edge of the design
  EXPECT_NEAR(gouge.volume, 2 * 10 * 40, 2 * 10 * 2.0 * 2.0 / 2 + 40);
  EXPECT_LT(gouge.area, 10 * 40 + 2 * 40 * 1.5 + 60);
  EXPECT_NEAR(all.found.blank_too_small, 40 * 20, 0.05 * 800) << "the blank beside the slot";
}

TEST(PartFindings, MaterialFurtherOffThanTheBandIsSaidToBeAtLeastThat) {
  const Stock stock = full_block(Eigen::Isometry3d::Identity(), 1.0);
  const Held all = held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design());
  ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
  const Finding& rest = all.found.list.front();
  EXPECT_TRUE(rest.is_at_least);
  EXPECT_EQ(rest.depth, 5.0);
  EXPECT_EQ(rest.line, 0) << "never cut";
  EXPECT_GT(all.found.beyond_band, 50.0);
}

// ---- undercuts ----------------------------------------------------------------------------------

TEST(PartFindings, TheSidesOfATSlotAreUndercut) {
  SeededRandom random(20267);
  const double low = 5.15, high = 10.3, from = 12.3, to = 27.4, neck_from = 17.1, neck_to = 22.3;
  for (const double spacing : {0.8, 0.4}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    carve(stock, {neck_from, 5.1, low}, {neck_to, 25.2, 21}, 3);
    carve(stock, {from, 5.1, low}, {to, 25.2, high}, 4);
    const Held all = held(stock, pocketed(pocket_x, pocket_y, block.z()).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Undercut), 2u);
    double sum = 0.0;
    for (const Finding& one : all.found.list) {
      if (one.kind != FindingKind::Undercut) continue;
      sum += one.volume;
      EXPECT_NEAR(one.depth, high - low, spacing);
      EXPECT_EQ(one.line, 4);
    }
    const double expected = (to - from - (neck_to - neck_from)) * (high - low) * 20.1;
    std::cout << "spacing " << spacing << " mm: void under the overhangs " << sum << " of "
              << expected << " mm^3\n";
    EXPECT_NEAR(sum, expected, 2 * (20.1 + 2 * 5) * (high - low) * 0.5 * spacing);
  }
}

TEST(PartFindings, AHoleFromTheSideIsUndercutAndAPocketIsNot) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Stock stock = full_block(T, 0.5);
  mill_pocket(stock, 15, 15, pocket_x, pocket_y);
  const Design design = pocketed(pocket_x, pocket_y, 15).design(T);
  EXPECT_EQ(regions(held(stock, design).found, FindingKind::Undercut), 0u);
  remove(stock, Cutter{3, 0, 30},
         {pose({-5, 15.2, 7.1}, -Vector3d::UnitX()), pose({15, 15.2, 7.1}, -Vector3d::UnitX()), 6,
          false});
  const Held all = held(stock, design);
  ASSERT_EQ(regions(all.found, FindingKind::Undercut), 1u);
  const Finding& hole = all.found.list.back();
  const double expected = pi * 9 * 15;
  std::cout << "hole from the side " << hole.volume << " of " << expected << " mm^3\n";
  EXPECT_NEAR(hole.volume, expected, 0.05 * expected);
  EXPECT_NEAR(hole.depth, 6.0, 0.1);
  EXPECT_EQ(hole.line, 6);
}

TEST(PartFindings, WallsThatLeanByLessThanASpacingAreNoUndercut) {
  // a cutter that leans by 1 mrad mills a wall 20 mm high: it overhangs by 20 um
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  const Vector3d axis = Vector3d(-1e-3, 0, 1).normalized();
  remove(stock, Cutter{5, 0, 60}, {pose({10, -10, 2}, axis), pose({10, 40, 2}, axis), 1, false});
  EXPECT_EQ(
      regions(held(stock, pocketed(pocket_x, pocket_y, 20).design()).found, FindingKind::Undercut),
      0u);
}

// ---- what is not compared, not resolved, not listed ---------------------------------------------

TEST(PartFindings, SpecklesAreCountedAndALongListIsSummedUp) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  // holes of known depth in a flat top: one after the other deeper; and pits of one dexel
  double sum = 0.0;
  for (int i = 0; i < 12; ++i) {
    const double x = 3.0 * i + 2.1, deep = 0.1 + 0.02 * i;
    carve(stock, {x, 10.1, 20 - deep}, {x + 1.6, 12.7, 21}, 100 + i);
    sum += deep * 1.6 * 2.6;
  }
  const double z = stock.origin_k.z();
  DexelField& upright = stock.fields.back();
  ASSERT_EQ(upright.along, 2);
  upright.lines[std::size_t(30) + std::size_t(upright.size[0]) * 45].cut(19.8 - z, 21 - z, 200);
  FindingOptions options;
  options.max_listed = 5;
  const Held all = held(stock, pocketed(pocket_x, pocket_y, 20).design(), options);
  const Findings::Sums& gouges = all.found.sums[std::size_t(FindingKind::Gouge)];
  ASSERT_EQ(gouges.regions + gouges.speckles, 13u);
  EXPECT_EQ(gouges.listed, 5u);
  ASSERT_EQ(all.found.list.size(), 5u);
  EXPECT_EQ(all.found.list.front().line, 111);
  double listed = 0.0;
  for (std::size_t i = 0; i < 5; ++i) {
    listed += all.found.list[i].volume;
    if (i > 0) {
      EXPECT_LE(all.found.list[i].volume, all.found.list[i - 1].volume);
    }
  }
  EXPECT_NEAR(listed + gouges.unlisted_volume, gouges.volume, 1e-12);
  EXPECT_NEAR(gouges.volume, sum, 0.3 * sum);
}

TEST(PartFindings, FewerVerticesThanTheDexelsResolveAreASpeckle) {
  // by hand: a strip of skin with two vertices up
  StockSkin skin;
  skin.mesh.vertices_w.resize(6, 3);
  skin.mesh.vertices_w << 0, 0, 0, 1, 0, 0.2, 1, 1, 0.3, 0, 1, 0, 2, 0, 0, 2, 1, 0;
  skin.mesh.triangles.resize(4, 3);
  skin.mesh.triangles << 0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2;
  skin.mesh.line.assign(6, 5);
  skin.points_w = skin.mesh.vertices_w;
  skin.line = skin.mesh.line;
  for (int i = 0; i < 6; ++i) skin.point_indices.push_back(i);
  for (int i = 0; i <= 6; ++i) skin.first.push_back(i);
  skin.spacing = 1;
  Quads flat;
  flat.add({-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0});
  const Held all = held(skin, flat.design());
  const Findings::Sums& rest = all.found.sums[std::size_t(FindingKind::Rest)];
  EXPECT_EQ(rest.regions, 0u);
  EXPECT_EQ(rest.speckles, 1u);
  EXPECT_NEAR(rest.speckle_depth, 0.3, 1e-15);
  EXPECT_GT(rest.speckle_volume, 0.0);
  EXPECT_TRUE(all.found.list.empty());
}

// ---- turning ------------------------------------------------------------------------------------

TEST(PartFindings, AGrooveTurnedTooDeepIsFoundAllAround) {
  const double R = 10, deep = 0.2, from = 12, to = 17;
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << 0, R, 30, R;
  TurnedStock stock = make_turned_stock(profile, 0.05, {1, 2, 3}, Vector3d::UnitX());
  for (Index i = 0; i < stock.radius.size(); ++i) {
    const double along = stock.first + stock.spacing * double(i);
    stock.line[std::size_t(i)] = 4;
    if (along <= from || along >= to) continue;
    stock.radius[i] = R - deep;
    stock.line[std::size_t(i)] = 17;
  }
  // an open design, the cylinder alone, of 48 facets with the normals of the round
  Quads cylinder;
  const int around = 48;
  const auto at = [&](double along, int k) {
    const double f = 2 * pi * k / around;
    return Vector3d(1 + along, 2 + R * std::cos(f), 3 + R * std::sin(f));
  };
  for (int k = 0; k < around; ++k)
    for (int i = 0; i < 15; ++i)
      cylinder.add(at(2 * i, k), at(2 * i, k + 1), at(2 * i + 2, k + 1), at(2 * i + 2, k));
  Design design = cylinder.design();
  for (Index i = 0; i < design.normals.rows(); ++i)
    design.normals.row(i) =
        Eigen::RowVector3d(0, design.vertices(i, 1) - 2, design.vertices(i, 2) - 3).normalized();
  ASSERT_GT(vertex_normals(design.vertices, design.triangles).row(0).dot(design.normals.row(0)), 0);
  const StockSkin skin = stock_skin(stock);
  const DesignDistance distance(design);
  const PartDeviation part = part_deviation(skin, distance);
  FindingOptions options;
  options.undercut_along = std::nullopt;
  const Findings found = findings(skin, part, distance, options);
  ASSERT_EQ(regions(found, FindingKind::Gouge), 1u);
  EXPECT_EQ(regions(found, FindingKind::Rest), 0u);
  const double expected = pi * (R * R - (R - deep) * (R - deep)) * (to - from);
  std::cout << "groove " << found.list.front().volume << " of " << expected << " mm^3\n";
  EXPECT_NEAR(found.list.front().volume, expected, (deep / R + 0.02) * expected);
  EXPECT_NEAR(found.list.front().depth, deep, 1e-3);  // facets 21 um lower: 48 of R 10
  EXPECT_EQ(found.list.front().line, 17);
}

// ---- threads and time ---------------------------------------------------------------------------

TEST(PartFindings, AreTheSameForAnyNumberOfThreads) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  mill_pocket(stock, pocket_floor, pocket_floor + 0.3, {14.3, 26.9}, {9.1, 19.6});
  const Design design = pocketed(pocket_x, pocket_y, pocket_floor - 0.2).design();
  const Held all = held(stock, design);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Held alone = held(stock, design);
  for (Index i = 0; i < all.part.deviation.size(); ++i) {
    const double a = all.part.deviation[i], b = alone.part.deviation[i];
    ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b)));
  }
  EXPECT_EQ(all.found.number, alone.found.number);
  ASSERT_EQ(all.found.list.size(), alone.found.list.size());
  for (std::size_t i = 0; i < all.found.list.size(); ++i)
    EXPECT_EQ(all.found.list[i].volume, alone.found.list[i].volume);
}

TEST(PartFindings, ADomeOf120000TrianglesTakesASecond) {
  const Vector3d centre(50, 50, -30);
  const Design design = dome(60, 45, centre, 150, 400);
  Stock stock =
      make_stock(BoxBlank{{0, 0, 0}, {100, 100, 31}}, Eigen::Isometry3d::Identity(), {0.5, true});
  remove(stock, Cutter{10, 10, 60}, {pose({50, -20, 28}), pose({50, 120, 28}), 1, false});
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const StockSkin skin = stock_skin(stock);
  const double skinned = seconds();
  const DesignDistance distance(design);
  const double built = seconds();
  const PartDeviation part = part_deviation(skin, distance);
  const double compared = seconds();
  const Findings found = findings(skin, part, distance);
  std::cout << design.triangles.rows() << " triangles, " << skin.mesh.vertices_w.rows()
            << " vertices, " << skin.points_w.rows() << " places: skin " << skinned << " s, design "
            << built - skinned << " s, deviation " << compared - built << " s, findings "
            << seconds() - compared << " s\n";
  EXPECT_EQ(regions(found, FindingKind::Gouge), 1u);
}

}  // namespace
}  // namespace abbe::cutting
