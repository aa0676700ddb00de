// The skin of a cut part and its deviation: distances against brute force.

#include "cutting/stock/part_deviation.h"
#include "cutting/stock/part_volumes.h"
#include "tests/cutting/held_parts.h"
#include "tests/cutting/stock_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using namespace held_parts;

// ---- skin ---------------------------------------------------------------------------------------

TEST(StockSkin, HasTheMeshOfTheStockAndPlacesOnTheSkin) {
  std::mt19937 random(20261);
  const Eigen::Isometry3d T = any_pose(random);
  Stock stock = full_block(T, 0.7);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const StockSkin skin = stock_skin(stock);
  const StockMesh mesh = stock_mesh(stock);
  EXPECT_EQ(skin.mesh.vertices_w, mesh.vertices_w);
  EXPECT_EQ(skin.mesh.triangles, mesh.triangles);
  EXPECT_EQ(skin.mesh.line, mesh.line);
  const DesignDistance distance(pocketed(pocket_x, pocket_y, pocket_floor).design(T), facets());
  std::map<std::vector<double>, int> seen;
  for (Index i = 0; i < skin.points_w.rows(); ++i) {
    const Vector3d p = skin.points_w.row(i);
    EXPECT_NEAR(distance.at(p).value, 0.0, 1e-9) << p.transpose();
    const int times = ++seen[std::vector<double>{p.x(), p.y(), p.z()}];
    EXPECT_EQ(times, 1) << "the four cells around an edge share its place";
  }
  for (std::size_t v = 0; v + 1 < skin.first.size(); ++v) {
    Vector3d mean = Vector3d::Zero();
    for (int k = skin.first[v]; k < skin.first[v + 1]; ++k)
      mean += skin.points_w.row(skin.point_indices[std::size_t(k)]);
    mean /= skin.first[v + 1] - skin.first[v];
    ASSERT_LT((mean - mesh.vertices_w.row(Index(v)).transpose()).norm(), 1e-12);
  }
}

// ---- distance -----------------------------------------------------------------------------------

/// Nearest point of a triangle: of its plane if that is inside, else of its sides.
double distance_by_sides(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  bool inside = true;
  double nearest = INFINITY;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d a = t[k], b = t[(k + 1) % 3];
    inside = inside && n.dot((b - a).cross(p - a)) >= 0;
    const double part = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - a - part * (b - a)).norm());
  }
  return inside ? std::abs(n.dot(p - t[0])) : nearest;
}

/// Solid angle of a triangle (van Oosterom and Strackee 1983).
double solid_angle(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d a = t[0] - p, b = t[1] - p, c = t[2] - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

/// A body with dents and sharp edges: a sphere of triangles whose radii are drawn.
Design dented(std::mt19937& random, int rings) {
  std::uniform_real_distribution<double> radius(6, 12);
  Quads body;
  const int around = 2 * rings;
  std::vector<Vector3d> at;
  at.push_back({0, 0, radius(random)});
  for (int i = 1; i < rings; ++i)
    for (int k = 0; k < around; ++k) {
      const double t = pi * i / rings, f = 2 * pi * k / around;
      at.push_back(radius(random) *
                   Vector3d(std::sin(t) * std::cos(f), std::sin(t) * std::sin(f), std::cos(t)));
    }
  at.push_back({0, 0, -radius(random)});
  body.corners = at;
  const auto ring = [&](int i, int k) { return 1 + (i - 1) * around + k % around; };
  for (int k = 0; k < around; ++k) {
    body.triangles.push_back({0, ring(1, k), ring(1, k + 1)});
    for (int i = 1; i + 1 < rings; ++i) {
      body.triangles.push_back({ring(i, k), ring(i + 1, k), ring(i + 1, k + 1)});
      body.triangles.push_back({ring(i, k), ring(i + 1, k + 1), ring(i, k + 1)});
    }
    body.triangles.push_back({ring(rings - 1, k), int(at.size()) - 1, ring(rings - 1, k + 1)});
  }
  return body.design();
}

TEST(DesignDistance, IsThatOfAllTrianglesWithTheSideOfTheSolidAngle) {
  SeededRandom random(20262);
  std::uniform_real_distribution<double> unit(-1, 1);
  double off = 0.0;
  for (int body = 0; body < 12; ++body) {
    const Design design = dented(random, 4 + body);
    const DesignDistance distance(design, facets());
    EXPECT_TRUE(distance.is_closed());
    for (int i = 0; i < 400; ++i) {
      // near corners and edges too: half of the places are drawn about a vertex
      Vector3d p = 14.0 * Vector3d(unit(random), unit(random), unit(random));
      if (i % 2 == 0)
        p = Vector3d(design.vertices.row(i % design.vertices.rows())) +
            0.5 * Vector3d(unit(random), unit(random), unit(random));
      double nearest = INFINITY, angle = 0.0;
      for (const auto& t : design.triangles.rowwise()) {
        const std::array<Vector3d, 3> corners{design.vertices.row(t[0]), design.vertices.row(t[1]),
                                              design.vertices.row(t[2])};
        nearest = std::min(nearest, distance_by_sides(p, corners));
        angle += solid_angle(p, corners);
      }
      const double expected = std::abs(angle) > 2 * pi ? -nearest : nearest;
      const DesignDistance::PointDistance at = distance.at(p, i % int(design.triangles.rows()));
      off = std::max(off, std::abs(at.value - expected));
      ASSERT_NEAR(at.value, expected, 1e-11) << "body " << body << " at " << p.transpose();
      ASSERT_NEAR(at.from.norm(), nearest, 1e-11);
      ASSERT_FALSE(at.is_beyond);
    }
  }
  std::cout << "signed distance off brute force by " << off << " mm at most\n";
}

TEST(DesignDistance, KnowsWhatLiesBeyondTheBorderOfAnOpenDesign) {
  Quads flat;
  flat.add({0, 0, 0}, {10, 0, 0}, {10, 10, 0}, {0, 10, 0});
  const DesignDistance distance(flat.design(), facets());
  EXPECT_FALSE(distance.is_closed());
  EXPECT_FALSE(distance.at({5, 5, 0.3}).is_beyond);
  EXPECT_NEAR(distance.at({5, 5, -0.3}).value, -0.3, 1e-15);
  EXPECT_FALSE(distance.at({10, 5, 0.3}).is_beyond) << "above the border, along its normal";
  EXPECT_TRUE(distance.at({10.01, 5, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10.01, 10.01, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10, 5, -0.3}).is_beyond) << "a side of the blank below";
}

TEST(DesignDistance, OfASmoothSurfaceIsNotThatOfItsFacets) {
  // a coarse sphere: facets sag by 0.12 mm
  const double R = 20;
  Quads sphere;
  const int rings = 24, around = 48;
  const auto at = [&](int i, int k) {
    const double t = 0.2 + 0.05 * i, f = 0.4 * 2 * pi * k / around;
    return Vector3d(R * std::sin(t) * std::cos(f), R * std::sin(t) * std::sin(f), R * std::cos(t));
  };
  for (int i = 0; i < rings; i += 2)
    for (int k = 0; k < around; k += 6)
      sphere.add(at(i, k), at(i + 2, k), at(i + 2, k + 6), at(i, k + 6));
  Design design = sphere.design();
  design.normals = design.vertices.rowwise().normalized();
  const DesignDistance smooth(design), flat(design, facets());
  double off = 0.0, off_flat = 0.0;
  for (int i = 4; i < rings - 4; ++i)
    for (int k = 6; k < around - 6; ++k)
      for (const double d : {-0.4, 0.0, 0.3}) {
        const Vector3d p = at(i, k) * (1 + d / R);
        off = std::max(off, std::abs(smooth.at(p).value - d));
        off_flat = std::max(off_flat, std::abs(flat.at(p).value - d));
      }
  std::cout << "smooth within " << off << " mm, facets " << off_flat << " mm\n";
  EXPECT_GT(off_flat, 0.05);
  EXPECT_LT(off, 0.05 * off_flat);
}

/// A blank around a design, of its own shape: a cap on a cylinder.
TEST(PartDeviation, SidesAndBottomUnderAnOpenDesignAreNotCompared) {
  const Vector3d centre(20, 15, -10);
  const Design design = dome(25, 10, centre, 60, 180);
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  // raw everywhere but for a flat on top that touches the dome
  carve(stock, {-1, -1, 15}, {41, 31, 21}, 3);
  const Held all = held(stock, design);
  EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
  ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
  // seen against the dome itself: what stands over it within its normals
  const double limit = 0.05;
  EXPECT_NEAR(all.found.list.front().depth, 25 / std::cos(std::asin(10.0 / 25)) - 25, 0.02);
  EXPECT_LT(all.found.compared, pi * 11.5 * 11.5);
  for (Index i = 0; i < all.part.deviation.size(); ++i) {
    const Vector3d p = all.skin.mesh.vertices_w.row(i);
    if (p.z() < 14) {
      ASSERT_EQ(all.part.status[std::size_t(i)], SkinStatus::NoDesign) << p.transpose();
    }
    if ((p - centre).head<2>().norm() > 12) {
      ASSERT_TRUE(std::isnan(all.part.deviation[i])) << p.transpose();
    }
    if (std::isfinite(all.part.deviation[i]) && (p - centre).head<2>().norm() < 10) {
      ASSERT_NEAR(all.part.deviation[i], (p - centre).norm() - 25, limit) << p.transpose();
    }
  }
}

TEST(PartDeviation, WallsOfOneDirectionAreNotResolvedAndSaidSo) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5, false);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const Held all = held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design());
  expect_none(all);
  EXPECT_LT(worst(all.part), 1e-8);
  EXPECT_NEAR(all.found.unresolved, 2 * (40 + 30) * 20 + 2 * (23.24 + 18.58) * 10.13,
              0.1 * all.found.unresolved);
}

// Volumes of rest material and gouges against closed forms: inner corners, edges, whole pockets.

double volume_of(const Findings& found, FindingKind kind) {
  return found.sums[std::size_t(kind)].volume;
}

/// The block of `full_block` in dexels that lie across it.
Stock turned_block(const Eigen::Isometry3d& T_wk, double spacing) {
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.linear() =
      (Eigen::AngleAxisd(0.37, Vector3d::UnitX()) * Eigen::AngleAxisd(0.61, Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.29, Vector3d::UnitZ()))
          .toRotationMatrix();
  const Design solid = pocketed(pocket_x, pocket_y, block.z()).design(turn);
  return make_stock(MeshBlank{solid.vertices, solid.triangles}, T_wk * turn.inverse(),
                    {spacing, true});
}

Stock block_of(const Eigen::Isometry3d& T_wk, double spacing, bool turned) {
  return turned ? turned_block(T_wk, spacing) : full_block(T_wk, spacing);
}

/// The pocket by a flat cutter, line by line and once around its walls.
void mill_with_cutter(Stock& stock, const Eigen::Isometry3d& T, double radius, double floor) {
  const Cutter flat{radius, 0, 40};
  const double x0 = pocket_x[0] + radius, x1 = pocket_x[1] - radius, y0 = pocket_y[0] + radius,
               y1 = pocket_y[1] - radius;
  const auto cut = [&](double xa, double ya, double xb, double yb, int line) {
    remove(stock, flat, {T * pose({xa, ya, floor}), T * pose({xb, yb, floor}), line, false});
  };
  for (double y = y0; y < y1; y += radius) cut(x0, y, x1, y, 3);
  cut(x0, y0, x1, y0, 4);
  cut(x1, y0, x1, y1, 5);
  cut(x1, y1, x0, y1, 6);
  cut(x0, y1, x0, y0, 7);
}

TEST(PartVolumes, TheFourCornersOfAPocketThatAFlatCutterLeaves) {
  SeededRandom random(20301);
  const double radius = 4, height = block.z() - pocket_floor;
  const double expected = 4 * (1 - pi / 4) * radius * radius * height;
  for (const bool turned : {false, true})
    for (const double spacing : {0.5, 0.25}) {
      const Eigen::Isometry3d T = any_pose(random);
      Stock stock = block_of(T, spacing, turned);
      mill_with_cutter(stock, T, radius, pocket_floor);
      const Held all =
          held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 0.01));
      std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Rest)
                << " of " << expected << " mm^3\n";
      EXPECT_EQ(regions(all.found, FindingKind::Rest), 4u);
      EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
      EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.05 * spacing * expected);
    }
}

TEST(PartVolumes, CornersWithDexelsOfOneDirectionAreThoseOfTheDexels) {
  const double radius = 4, height = block.z() - pocket_floor, spacing = 0.25;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Stock stock = full_block(T, spacing, false);
  mill_with_cutter(stock, T, radius, pocket_floor);
  int lines = 0;  // of material where the design has none
  const DexelField& field = stock.fields.front();
  for (int j = 0; j < field.size[1]; ++j)
    for (int i = 0; i < field.size[0]; ++i) {
      const Vector3d p = stock.origin_k + spacing * Vector3d(i, j, 0);
      const bool in_pocket =
          p.x() > pocket_x[0] && p.x() < pocket_x[1] && p.y() > pocket_y[0] && p.y() < pocket_y[1];
      const DexelLine& line =
          field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)];
      if (in_pocket && line.length() > 15) ++lines;
    }
  const double expected = lines * spacing * spacing * height;
  const Held all =
      held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 0.01));
  std::cout << volume_of(all.found, FindingKind::Rest) << " of " << expected << " mm^3 in dexels, "
            << 4 * (1 - pi / 4) * radius * radius * height << " in truth\n";
  EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.02 * expected);
}

TEST(PartVolumes, APocketThatWasNeverCutIsLeftWhole) {
  SeededRandom random(20302);
  const double expected =
      (pocket_x[1] - pocket_x[0]) * (pocket_y[1] - pocket_y[0]) * (block.z() - pocket_floor);
  for (const bool turned : {false, true}) {
    const Eigen::Isometry3d T = any_pose(random);
    const Held all = held(block_of(T, 0.5, turned),
                          pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
    std::cout << volume_of(all.found, FindingKind::Rest) << " of " << expected << " mm^3\n";
    EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.005 * expected);
    EXPECT_TRUE(all.found.list.front().is_at_least) << "the depth";
  }
}

TEST(PartVolumes, ASlotThatRunsOutOfAPocketWall) {
  // 2 mm deep from the pocket through the wall to the outside: gouged over two edges of the design
  SeededRandom random(20303);
  const double y0 = 11.37, y1 = 19.81, deep = 2.0;
  const double expected = (block.x() - pocket_x[1]) * (y1 - y0) * deep;
  for (const double spacing : {0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor, {14.3, 26.9}, {9.1, 19.6});
    carve(stock, {20, y0, block.z() - deep}, {50, y1, 30}, 12);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Gouge)
              << " of " << expected << " mm^3\n";
    EXPECT_EQ(regions(all.found, FindingKind::Gouge), 1u);
    EXPECT_NEAR(volume_of(all.found, FindingKind::Gouge), expected, 0.05 * spacing * expected);
  }
}

TEST(PartVolumes, AHoleThroughTheWholePart) {
  SeededRandom random(20304);
  const double radius = 3, expected = pi * radius * radius * block.z();
  for (const bool turned : {false, true})
    for (const double spacing : {0.5, 0.25}) {
      const Eigen::Isometry3d T = any_pose(random);
      Stock stock = block_of(T, spacing, turned);
      remove(stock, Cutter{radius, 0, 60},
             {T * pose({4.21, 15.37, 30}), T * pose({4.21, 15.37, -5}), 9, false});
      const Held all =
          held(stock, pocketed(pocket_x, pocket_y, block.z()).design(T), along_grid(T));
      std::cout << "spacing " << spacing << " mm: " << volume_of(all.found, FindingKind::Gouge)
                << " of " << expected << " mm^3\n";
      EXPECT_NEAR(volume_of(all.found, FindingKind::Gouge), expected, 0.015 * spacing * expected);
    }
}

TEST(PartVolumes, AGrooveAcrossADome) {
  const double R = 60, radius = 10, floor = 28;
  const Vector3d centre(50, 50, -30);
  Stock stock =
      make_stock(BoxBlank{{0, 0, 0}, {100, 100, 31}}, Eigen::Isometry3d::Identity(), {0.5, true});
  remove(stock, Cutter{radius, 0, 60}, {pose({50, -20, floor}), pose({50, 120, floor}), 1, false});
  double expected = 0.0;
  const double step = 0.01;
  for (double x = -radius + step / 2; x < radius; x += step)
    for (double y = -30 + step / 2; y < 30; y += step)
      expected +=
          step * step * std::max(0.0, std::sqrt(R * R - x * x - y * y) + centre.z() - floor);
  const DesignDistance dome_of(dome(R, 45, centre, 60, 160));
  const StockSkin skin = stock_skin(stock);
  const Findings found = findings(skin, part_deviation(skin, dome_of), dome_of);
  std::cout << volume_of(found, FindingKind::Gouge) << " of " << expected << " mm^3\n";
  EXPECT_NEAR(volume_of(found, FindingKind::Gouge), expected, 0.01 * expected);
}

TEST(PartVolumes, AShoulderThatARoundNoseLeaves) {
  // a step from radius 12 to 10 with a fillet of 0.8 left in it, on the axis x through (1, 2, 3)
  const double high = 12, low = 10, fillet = 0.8, step_at = 15.013;
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << 0, high, 30, high;
  TurnedStock stock = make_turned_stock(profile, 0.01, {1, 2, 3}, Vector3d::UnitX());
  for (Index i = 0; i < stock.radius.size(); ++i) {
    const double along = stock.first + stock.spacing * double(i);
    stock.line[std::size_t(i)] = 4;
    if (along > step_at) continue;
    const double to_wall = step_at - along;
    stock.radius[i] = low;
    if (to_wall < fillet)
      stock.radius[i] =
          low + fillet - std::sqrt(fillet * fillet - (fillet - to_wall) * (fillet - to_wall));
  }
  Quads steps;
  const int around = 180;
  const auto ring = [&](double along, double r, int k) {
    const double f = 2 * pi * k / around;
    const Vector3d across = Vector3d::UnitX().unitOrthogonal();
    return Vector3d(Vector3d(1 + along, 2, 3) +
                    r * (std::cos(f) * across + std::sin(f) * Vector3d::UnitX().cross(across)));
  };
  const std::vector<std::array<double, 2>> corners{{0, 0},          {0, low},   {step_at, low},
                                                   {step_at, high}, {30, high}, {30, 0}};
  for (std::size_t c = 0; c + 1 < corners.size(); ++c)
    for (int k = 0; k < around; ++k)
      steps.add(ring(corners[c][0], corners[c][1], k), ring(corners[c][0], corners[c][1], k + 1),
                ring(corners[c + 1][0], corners[c + 1][1], k + 1),
                ring(corners[c + 1][0], corners[c + 1][1], k));
  std::erase_if(steps.triangles,
                [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  const Design design = steps.design();
  FindingOptions options;
  options.undercut_along = std::nullopt;
  options.rest = options.gouge = 0.005;
  const Held all = held(stock_skin(stock), design, options);
  // Pappus: a square less the quarter circle about its far corner, whose moment is pi/4 - 1/3
  const double area = (1 - pi / 4) * fillet * fillet;
  const double from_corner = fillet * (5.0 / 6 - pi / 4) / (1 - pi / 4);
  const double expected = area * 2 * pi * (low + from_corner);
  std::cout << "corner " << volume_of(all.found, FindingKind::Rest) << " of " << expected
            << " mm^3\n";
  EXPECT_EQ(regions(all.found, FindingKind::Rest), 1u);
  EXPECT_NEAR(volume_of(all.found, FindingKind::Rest), expected, 0.01 * expected);
}

}  // namespace
}  // namespace abbe::cutting
