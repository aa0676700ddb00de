#include "cutting/stock/stock.h"
#include "tests/cutting/stock_parts.h"
#include "tests/oracles/voxel_stock.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using Eigen::Isometry3d;

StockMove straight(const Vector3d& from, const Vector3d& to, int line = 1, bool rapid = false) {
  return {pose(from), pose(to), line, rapid};
}

/// A box of twelve triangles, turned by R about the origin.
MeshBlank meshed_box(const Vector3d& half, const Matrix3d& R = Matrix3d::Identity()) {
  MeshBlank mesh;
  mesh.vertices_k.resize(8, 3);
  for (int i = 0; i < 8; ++i) {
    const Vector3d corner((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    mesh.vertices_k.row(i) = R * corner.cwiseProduct(half);
  }
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2,
      2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

double mesh_volume(const StockMesh& mesh) {
  double six = 0.0;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Vector3d a = mesh.vertices_w.row(mesh.triangles(t, 0));
    const Vector3d b = mesh.vertices_w.row(mesh.triangles(t, 1));
    const Vector3d c = mesh.vertices_w.row(mesh.triangles(t, 2));
    six += a.dot(b.cross(c));
  }
  return six / 6.0;
}

bool is_closed(const StockMesh& mesh) {
  std::map<std::pair<int, int>, int> sides;
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles(t, k), b = mesh.triangles(t, (k + 1) % 3);
      ++sides[{a, b}];
      --sides[{b, a}];
    }
  return std::all_of(sides.begin(), sides.end(), [](const auto& side) { return side.second == 0; });
}

// ---- removal against its definition -------------------------------------------------------------

struct WorstPlaces {
  double kept = 0.0;   // mm, deepest place within the sweep that is left
  double taken = 0.0;  // mm, farthest place outside the sweep that is gone
};

/// Random places on the lines of a block after one move, held against the sweep.
WorstPlaces worst_of(const Stock& before, const Stock& after, const Cutter& cutter,
                     const StockMove& move, std::mt19937& random) {
  const oracles::VoxelCutter brute{cutter.radius, cutter.corner_radius};
  const oracles::VoxelPose from{move.from_T_wt.translation(), move.from_T_wt.linear().col(2)};
  const oracles::VoxelPose to{move.to_T_wt.translation(), move.to_T_wt.linear().col(2)};
  WorstPlaces worst;
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::size_t f = 0; f < after.fields.size(); ++f) {
    const DexelField& field = after.fields[f];
    for (int i = 0; i < 150; ++i) {
      const auto index = std::size_t(unit(random) * double(field.lines.size()));
      const auto runs = before.fields[f].lines[index].runs();
      if (runs.empty()) continue;
      Vector3d place_k;
      place_k[(field.along + 1) % 3] = double(int(index) % field.size[0]) * after.spacing;
      place_k[(field.along + 2) % 3] = double(int(index) / field.size[0]) * after.spacing;
      const auto look = [&](double at) {
        if (at <= runs[0].low || at >= runs[0].high) return;
        place_k[field.along] = at;
        const Vector3d point = after.T_wk * Vector3d(after.origin_k + place_k);
        const double d = oracles::sweep_distance(brute, from, to, point, 80);
        const bool left = field.lines[index].signed_depth(at) > 0.0;
        if (left)
          worst.kept = std::max(worst.kept, -d);
        else
          worst.taken = std::max(worst.taken, d);
      };
      look(runs[0].low + unit(random) * (runs[0].high - runs[0].low));
      for (const DexelRun& run : field.lines[index].runs()) {  // and close to the new ends
        for (const double off : {2e-9, -2e-9}) {
          look(run.low + off);
          look(run.high + off);
        }
      }
    }
  }
  return worst;
}

WorstPlaces worst_of_moves(double turn, int moves, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&] { return Vector3d(unit(random), unit(random), unit(random)); };
  WorstPlaces worst;
  for (int i = 0; i < moves; ++i) {
    const double corner = i % 3 == 0 ? 0.0 : i % 3 == 1 ? 4.0 : 1.3;
    const Cutter cutter{4.0, corner, 12.0};
    Stock stock = make_stock(BoxBlank{Vector3d(-12, -9, -7), Vector3d(12, 9, 7)},
                             pose(0.3 * any(), any().normalized()), {0.7, true});
    const Stock before = stock;
    Vector3d axis = i % 4 == 0 ? Vector3d::UnitZ() : any().normalized();
    const Vector3d tip = 7 * any();
    Vector3d step = (i % 5 == 0 ? 12.0 : 1.5) * any();
    if (i % 7 == 0) step = step.norm() * axis;       // plunges and retracts
    if (i % 11 == 0) step -= step.dot(axis) * axis;  // level
    if (i % 13 == 0) step.setZero();
    const Vector3d target = (axis + turn * any().cross(axis)).normalized();
    const StockMove move{pose(tip, axis), pose(tip + step, target), 1, false};
    const RemovalResult removed = remove(stock, cutter, move);
    EXPECT_NEAR(removed.volume, volume(before) - volume(stock), 1e-6);
    const WorstPlaces one = worst_of(before, stock, cutter, move, random);
    worst.kept = std::max(worst.kept, one.kept);
    worst.taken = std::max(worst.taken, one.taken);
  }
  return worst;
}

TEST(Stock, RemovalWithAStandingAxisIsTheSweepToRounding) {
  const unsigned seed = 20240711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const WorstPlaces worst = worst_of_moves(0.0, 120, seed);
  std::cout << "left within the sweep by " << worst.kept << " mm, taken outside it by "
            << worst.taken << " mm\n";
  EXPECT_LT(worst.kept, 1e-9);  // places are tried 2e-9 mm from the ends
  EXPECT_LT(worst.taken, 1e-9);
}

TEST(Stock, RemovalWithATurningAxisIsWithinTwoMicrometresOfTheSweep) {
  const unsigned seed = 20240712;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  // 23 moves have every kind: plunges (of 7), level moves (of 11) and moves of nothing (of 13)
  const int moves = std::getenv("ABBE_LONG") != nullptr ? 70 : 23;
  for (const double turn : {1e-6, 1e-3, 0.02, 0.3}) {
    const WorstPlaces worst = worst_of_moves(turn, moves, seed);
    std::cout << "axis turns by about " << turn << " rad: left within the sweep by " << worst.kept
              << " mm, taken outside it by " << worst.taken << " mm\n";
    EXPECT_LT(worst.kept, 2e-3);
    EXPECT_LT(worst.taken, 2e-3);
  }
}

TEST(Stock, RemovedVolumeAgreesWithVoxels) {
  const double h = 0.25;
  Stock stock = box({0, 0, 0}, {20, 15, 10}, h);
  oracles::VoxelStock voxels({0, 0, 0}, {20, 15, 10}, h);
  const Cutter cutter{3.0, 1.0, 20.0};
  const Vector3d a(2, 4, 6), b(15, 11, 4), lean = Vector3d(0.3, 0.1, 1).normalized();
  const double taken = remove(stock, cutter, {pose(a), pose(b, lean), 1, false}).volume;
  const double brute = voxels.remove({3.0, 1.0}, {a, Vector3d::UnitZ()}, {b, lean}, 600);
  std::cout << "dexels " << taken << " mm^3, voxels " << brute << " mm^3\n";
  EXPECT_NEAR(taken, brute, 0.01 * brute);
  EXPECT_NEAR(volume(stock), voxels.volume(), 0.01 * brute);
}

// ---- volumes against closed forms ---------------------------------------------------------------

/// Error of a removed volume, root of the mean square over random places of the grid.
struct Convergence {
  std::vector<double> spacing, error;
  double order() const {
    return std::log(error.front() / error.back()) / std::log(spacing.front() / spacing.back());
  }
};

Convergence convergence(const std::string& name, const Cutter& cutter, double depth, double exact,
                        bool aligned) {
  Convergence result;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double h : {1.0, 0.5, 0.25, 0.125}) {
    double sum = 0.0;
    const int runs = 6;
    for (int i = 0; i < runs; ++i) {
      // only what lies between x = +-10 is counted, so the ends of the cut lie outside the body
      const Vector3d half(10 + 0.3 * h * unit(random), 11 + 0.3 * h * unit(random), 8);
      Matrix3d R = Matrix3d::Identity();
      if (!aligned)
        R = Eigen::Quaterniond(1, 0.3 * unit(random), 0.3 * unit(random), 0.3 * unit(random))
                .normalized()
                .toRotationMatrix();
      Isometry3d T_wk = Isometry3d::Identity();
      T_wk.linear() = R;
      Stock stock = make_stock(meshed_box(half, R.transpose()), T_wk, {h, true});
      const double y = h * unit(random);
      const RemovalResult removed =
          remove(stock, cutter, straight({-40, y, half.z() - depth}, {40, y, half.z() - depth}));
      const double error = removed.volume - exact * 2 * half.x();
      sum += error * error;
    }
    result.spacing.push_back(h);
    result.error.push_back(std::sqrt(sum / runs));
  }
  std::cout << name << (aligned ? ", along the grid: " : ", across the grid: ");
  for (const double e : result.error) std::cout << e << " ";
  std::cout << "mm^3 of " << 20 * exact << ", order " << result.order() << "\n";
  return result;
}

TEST(Stock, VolumeOfASlotConverges) {
  const Cutter flat{5.0, 0.0, 30.0};
  EXPECT_GT(convergence("slot by a flat end mill", flat, 4.0, 40.0, false).order(), 1.5);
  EXPECT_GT(convergence("slot by a flat end mill", flat, 4.0, 40.0, true).order(), 0.8);
}

TEST(Stock, VolumeOfABallGrooveConverges) {
  const Cutter ball{5.0, 5.0, 30.0};
  const double depth = 3.0, w = std::acos(2.0 / 5.0);
  const double area = 25.0 * (w - std::sin(w) * std::cos(w));
  EXPECT_GT(convergence("ball groove", ball, depth, area, false).order(), 1.5);
  EXPECT_GT(convergence("ball groove", ball, depth, area, true).order(), 0.8);
}

TEST(Stock, VolumeOfABullNoseSlotConverges) {
  const Cutter bull{5.0, 1.5, 30.0};
  const double area = 40.0 - 2 * 1.5 * 1.5 * (1 - pi / 4);
  EXPECT_GT(convergence("slot by a bull-nose end mill", bull, 4.0, area, false).order(), 1.5);
}

TEST(Stock, APlaneAcrossTheLinesIsExact) {
  Stock stock = box({0, 0, 0}, {20, 10, 8}, 0.5, false);
  EXPECT_NEAR(volume(stock), 1600.0, 1e-9);
  const Cutter flat{30.0, 0.0, 50.0};
  const RemovalResult removed = remove(stock, flat, straight({-40, 5, 6.123}, {60, 5, 6.123}));
  EXPECT_NEAR(removed.volume, 200 * (8 - 6.123), 1e-9);
  EXPECT_NEAR(volume(stock), 200 * 6.123, 1e-9);
}

TEST(Stock, TheFaceOfACylinderIsMilledOff) {
  for (const double h : {0.5, 0.25, 0.125}) {
    Stock stock = make_stock(CylinderBlank{12.0, 0.0, 10.0}, Isometry3d::Identity(), {h, true});
    const double before = volume(stock);
    const double exact = pi * 144.0 * 10.0;
    const Cutter flat{30.0, 0.0, 50.0};
    const RemovalResult removed = remove(stock, flat, straight({-50, 0, 8.0}, {50, 0, 8.0}));
    std::cout << "spacing " << h << ": cylinder " << before - exact << " mm^3 of " << exact
              << ", face " << removed.volume - 0.2 * exact << " of " << 0.2 * exact << "\n";
    EXPECT_NEAR(before, exact, 40 * std::pow(h, 1.5));
    EXPECT_NEAR(removed.volume, 0.2 * exact, 8 * std::pow(h, 1.5));
  }
}

TEST(Stock, AStepDownInLevelsRemovesWhatOneCutDoes) {
  Stock levels = box({0, 0, 0}, {20, 10, 8}, 0.5);
  Stock once = levels;
  const Cutter flat{3.0, 0.0, 50.0};
  double sum = 0.0;
  for (const double z : {7.0, 6.0, 5.5, 5.0})
    sum += remove(levels, flat, straight({-5, 5, z}, {25, 5, z})).volume;
  const double one = remove(once, flat, straight({-5, 5, 5}, {25, 5, 5})).volume;
  EXPECT_NEAR(sum, one, 1e-9);
  EXPECT_NEAR(volume(levels), volume(once), 1e-9);
}

// ---- crashes ------------------------------------------------------------------------------------

TEST(Stock, ARapidThroughMaterialIsACrashAndMarksItsLine) {
  Stock stock = box({0, 0, 0}, {20, 20, 10}, 0.5);
  const Cutter cutter{3.0, 0.0, 20.0};
  EXPECT_FALSE(remove(stock, cutter, straight({-10, 10, 12}, {30, 10, 12}, 4, true)).crashed);
  EXPECT_TRUE(remove(stock, cutter, straight({-10, 10, 8}, {30, 10, 8}, 5, true)).crashed);
  const StockMesh mesh = stock_mesh(stock);
  EXPECT_EQ(*std::min_element(mesh.line.begin(), mesh.line.end()), -5);
  EXPECT_EQ(*std::max_element(mesh.line.begin(), mesh.line.end()), 0);
}

TEST(Stock, ARapidThatRubsOnWhatWasJustCutIsNoCrash) {
  Stock stock = box({0, 0, 0}, {20, 20, 10}, 0.5);
  const Cutter cutter{3.0, 1.0, 20.0};
  EXPECT_FALSE(remove(stock, cutter, straight({-10, 10, 8}, {10, 10, 8}, 1)).crashed);
  EXPECT_FALSE(
      remove(stock, cutter, straight({10.05, 10.02, 8}, {10.05, 10.02, 30}, 2, true)).crashed);
  EXPECT_TRUE(remove(stock, cutter, straight({10.3, 10, 8}, {10.3, 10, 30}, 3, true)).crashed);
}

TEST(Stock, TheShankIsACrashWhereTheFlankHasNotPassed) {
  const Cutter cutter{3.0, 0.0, 5.0};
  Stock stock = box({0, 0, 0}, {30, 30, 20}, 0.5);
  EXPECT_TRUE(remove(stock, cutter, straight({-10, 10, 10}, {10, 10, 10})).crashed);
  stock = box({0, 0, 0}, {30, 30, 20}, 0.5);
  EXPECT_FALSE(remove(stock, cutter, straight({-10, 10, 15}, {40, 10, 15})).crashed);
  EXPECT_FALSE(remove(stock, cutter, straight({-10, 10, 10}, {40, 10, 10})).crashed)
      << "the slot above is as wide as the shank";
  EXPECT_FALSE(remove(stock, cutter, straight({20, 22, 25}, {20, 22, 5})).crashed)
      << "a plunge drills its own hole";
  EXPECT_TRUE(remove(stock, cutter, straight({20, 22, 5}, {22, 22, 5})).crashed);
  stock = box({0, 0, 0}, {30, 30, 20}, 0.5);
  EXPECT_TRUE(remove(stock, cutter, straight({-10, 10, 13}, {40, 10, 9})).crashed)
      << "a ramp that goes deeper than the flank is long";
}

TEST(Stock, TheShankThatTurnsIntoAWallIsACrash) {
  const Cutter ball{2.0, 2.0, 6.0};
  Stock stock = box({0, 0, 0}, {30, 30, 20}, 0.5);
  for (double z = 18; z > 9; z -= 2) remove(stock, ball, straight({-5, 15, z}, {35, 15, z}));
  const Vector3d tip(15, 15, 10);
  const RemovalResult removed =
      remove(stock, ball, {pose(tip), pose(tip, Vector3d(0, 0.4, 1).normalized()), 9, false});
  EXPECT_TRUE(removed.crashed);
  EXPECT_GT(removed.volume, 1.0);
}

// ---- awkward inputs -----------------------------------------------------------------------------

TEST(Stock, AwkwardMovesDoWhatTheyShould) {
  Stock stock = box({0, 0, 0}, {20, 20, 10}, 0.5);
  const double before = volume(stock);
  const Cutter cutter{3.0, 1.0, 40.0};
  EXPECT_EQ(remove(stock, cutter, straight({500, 0, 0}, {600, 0, 0})).volume, 0.0);
  EXPECT_EQ(remove(stock, cutter, straight({10, 10, 1e6}, {10, 10, 2e6})).volume, 0.0);
  EXPECT_EQ(volume(stock), before);
  const double hole = pi * 9 * 8 + pi * 4 + pi * pi / 2 * 2 + 2.0 / 3.0 * pi;  // corner by Pappus
  EXPECT_NEAR(remove(stock, cutter, straight({10, 10, 1}, {10, 10, 1})).volume, hole, 0.05 * hole);
  EXPECT_EQ(remove(stock, cutter, straight({10, 10, 1}, {10, 10, 1})).volume, 0.0);
  for (int i = 0; i < 5; ++i)
    remove(stock, {40.0, 0.0, 80.0}, straight({-50, 10, -1}, {70, 10, -1}));
  EXPECT_EQ(volume(stock), 0.0);
  EXPECT_EQ(stock_mesh(stock).triangles.rows(), 0);
  EXPECT_LT(depth(stock, {10, 10, 5}), 0.0);
}

TEST(Stock, PlungesGiveAHoleOfTheToolsShape) {
  Stock stock = box({-10, -10, 0}, {10, 10, 20}, 0.25);
  const Cutter ball{4.0, 4.0, 30.0};
  const RemovalResult removed = remove(stock, ball, straight({0, 0, 30}, {0, 0, 5}));
  const double exact = pi * 16 * (20 - 9) + 2.0 / 3.0 * pi * 64;
  std::cout << "plunge " << removed.volume << " of " << exact << " mm^3\n";
  EXPECT_NEAR(removed.volume, exact, 0.01 * exact);
  EXPECT_NEAR(depth(stock, {0, 0, 4.9}), 0.1, 0.01);
}

TEST(Stock, FacesExactlyOnNodesAndLinesAreCutOnce) {
  Stock stock = box({0, 0, 0}, {10, 10, 10}, 1.0);  // nodes at 0.5, 1.5, ...
  const Cutter cutter{2.0, 0.0, 40.0};
  double sum = 0.0;
  for (int i = 0; i < 3; ++i)
    sum += remove(stock, cutter, straight({-5, 4.5, 6.5}, {15, 4.5, 6.5})).volume;
  EXPECT_NEAR(sum, 4.0 * 3.5 * 10, 40.0);  // lines that lie in a face count whole
  EXPECT_NEAR(volume(stock), 1000.0 - sum, 1e-9);
  EXPECT_NEAR(depth(stock, {5.3, 4.4, 6.4}), 0.1, 1e-6);
  EXPECT_NEAR(depth(stock, {5.3, 2.3, 8.2}), 0.2, 1e-6);
  EXPECT_TRUE(is_closed(stock_mesh(stock)));
}

TEST(Stock, ABlankThinnerThanTheSpacingIsStillThere) {
  Stock stock = box({0, 0, 0}, {20, 20, 0.1}, 0.5);
  EXPECT_NEAR(depth(stock, {10, 10, 0.03}), 0.03, 1e-6);
  EXPECT_GT(volume(stock), 0.0);
  EXPECT_TRUE(is_closed(stock_mesh(stock)));
  const Cutter cutter{3.0, 0.0, 40.0};
  EXPECT_GT(remove(stock, cutter, straight({0, 10, -1}, {20, 10, -1})).volume, 0.0);
  EXPECT_LT(depth(stock, {10, 10, 0.03}), 0.0);
}

TEST(Stock, BadInputIsRefusedByName) {
  Stock stock = box({0, 0, 0}, {5, 5, 5}, 0.5);
  const Cutter cutter{3.0, 1.0, 40.0};
  EXPECT_THROW(remove(stock, cutter, straight({nan, 0, 0}, {1, 1, 1})), std::invalid_argument);
  EXPECT_THROW(remove(stock, cutter, straight({0, 0, 0}, {1, -nan, 1})), std::invalid_argument);
  EXPECT_THROW(remove(stock, {0.0, 0.0, 1.0}, straight({0, 0, 0}, {1, 1, 1})),
               std::invalid_argument);
  EXPECT_THROW(remove(stock, {3.0, 4.0, 9.0}, straight({0, 0, 0}, {1, 1, 1})),
               std::invalid_argument);
  EXPECT_THROW(
      remove(stock, cutter, {pose({0, 0, 0}), pose({0, 0, 0}, -Vector3d::UnitZ()), 1, false}),
      std::invalid_argument);
  const std::string said = thrown_text<std::invalid_argument>([&] {
    const Vector3d tilted(0, 0.6, 0.8);
    remove(stock, cutter, {pose({0, 0, 1e18}), pose({1e18, 0, 0}, tilted), 1, false});
  });
  std::cout << said << "\n";
  EXPECT_HAS(said, "straight segments");
  EXPECT_EQ(depth(stock, {nan, 0, 0}), -std::numeric_limits<double>::infinity());
  EXPECT_THROW(box({0, 0, 0}, {5, 0, 5}, 0.5), std::invalid_argument);
  EXPECT_THROW(box({0, 0, 0}, {5, nan, 5}, 0.5), std::invalid_argument);
  EXPECT_THROW(box({0, 0, 0}, {5, 5, 5}, 0.0), std::invalid_argument);
  EXPECT_THROW(box({0, 0, 0}, {5, 5, 5}, nan), std::invalid_argument);
}

TEST(Stock, MemoryIsRefusedWithAnEstimateBeforeItIsTaken) {
  const std::string said = thrown_text<std::length_error>([&] {
    box({0, 0, 0}, {1000, 1000, 1000}, 0.01);
  });
  std::cout << said << "\n";
  EXPECT_HAS(said, "MiB");
  EXPECT_THROW(box({0, 0, 0}, {1e300, 1, 1}, 1e-300), std::length_error);
}

TEST(Stock, ACopyKeepsItsState) {
  Stock stock = box({0, 0, 0}, {20, 20, 10}, 0.5);
  const Cutter cutter{1.0, 0.0, 40.0};
  for (double y = 2; y < 19; y += 3) remove(stock, cutter, straight({-3, y, 5}, {23, y, 5}));
  const Stock copy = stock;
  const double before = volume(copy);
  remove(stock, cutter, straight({4, -3, 3}, {4, 23, 3}));
  EXPECT_EQ(volume(copy), before);
  EXPECT_LT(volume(stock), before);
  Stock assigned = box({0, 0, 0}, {1, 1, 1}, 0.5);
  assigned = stock;
  EXPECT_EQ(volume(assigned), volume(stock));
}

// ---- depth --------------------------------------------------------------------------------------

TEST(Stock, DepthIsExactOnPlanesHoweverTheyLie) {
  SeededRandom random(20240713);
  std::uniform_real_distribution<double> unit(-1, 1);
  double worst = 0.0;
  for (int i = 0; i < 40; ++i) {
    const Matrix3d R = Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random))
                           .normalized()
                           .toRotationMatrix();
    const Stock stock = make_stock(meshed_box({9, 9, 9}, R), Isometry3d::Identity(), {0.5, true});
    for (int k = 0; k < 100; ++k) {
      const Vector3d on_face = R * Vector3d(6 * unit(random), 6 * unit(random), 9);
      worst = std::max(worst, std::abs(depth(stock, on_face)));
      EXPECT_GT(depth(stock, on_face - 1e-4 * R.col(2)), 0.0);
      EXPECT_LT(depth(stock, on_face + 1e-4 * R.col(2)), 0.0);
    }
  }
  std::cout << "depth on oblique planes, spacing 0.5 mm: " << worst << " mm at most\n";
  EXPECT_LT(worst, 2e-7);
}

TEST(Stock, DepthOnCurvedSkinConvergesAtSecondOrder) {
  std::vector<double> errors;
  for (const double h : {1.0, 0.5, 0.25}) {
    Stock stock = box({-15, -15, -10}, {15, 15, 10}, h);
    remove(stock, {8.0, 8.0, 30.0}, straight({-30, 0.1, 3}, {30, 0.1, 3}));
    double worst = 0.0;
    for (double angle = -1.0; angle <= 1.0; angle += 0.01)
      for (double x = -5; x < 5; x += 0.37)
        worst = std::max(
            worst,
            std::abs(depth(stock, {x, 0.1 + 8 * std::sin(angle), 11 - 8 * std::cos(angle)})));
    errors.push_back(worst);
  }
  const double order = std::log2(errors.front() / errors.back()) / 2;
  std::cout << "depth on a groove of radius 8: " << errors[0] << " " << errors[1] << " "
            << errors[2] << " mm at spacings 1, 0.5, 0.25; order " << order << "\n";
  EXPECT_GT(order, 1.7);
}

TEST(Stock, DepthIsContinuous) {
  SeededRandom random(20240714);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const bool three : {true, false}) {
    Stock stock = box({-10, -10, -10}, {10, 10, 10}, 0.5, three);
    remove(stock, {4.0, 4.0, 30.0}, straight({-30, 0, 3}, {30, 1, 4}));
    remove(stock, {2.0, 0.0, 30.0}, straight({0, -20, 2}, {3, 20, 4}));
    double steepest = 0.0;
    for (int i = 0; i < 200000; ++i) {
      const Vector3d p = 10 * Vector3d(unit(random), unit(random), unit(random));
      const Vector3d step = 1e-6 * Vector3d(unit(random), unit(random), unit(random)).normalized();
      steepest = std::max(steepest, std::abs(depth(stock, p + step) - depth(stock, p)) / 1e-6);
    }
    std::cout << (three ? "three directions" : "one direction") << ": depth changes by at most "
              << steepest << " mm/mm\n";
    EXPECT_LT(steepest, three ? 12.0 : 24.0);  // from + to - the farthest within one spacing
  }
}

// ---- mesh ---------------------------------------------------------------------------------------

TEST(Stock, TheMeshIsClosedAndItsVolumeConverges) {
  for (const bool three : {true, false}) {
    std::vector<double> off;
    for (const double h : {1.0, 0.5, 0.25}) {
      Stock stock = box({0, 0, 0}, {30, 20, 12}, h, three);
      remove(stock, {4.0, 4.0, 30.0}, straight({-10, 10.1, 7}, {40, 10.1, 7}, 3));
      remove(stock, {2.0, 0.0, 30.0}, straight({7.03, -10, 9}, {7.03, 30, 9}, 4));
      const StockMesh mesh = stock_mesh(stock);
      EXPECT_TRUE(is_closed(mesh));
      EXPECT_TRUE(mesh.vertices_w.allFinite());
      EXPECT_EQ(Index(mesh.line.size()), mesh.vertices_w.rows());
      for (const int line : {0, 3, 4})
        EXPECT_GT(std::count(mesh.line.begin(), mesh.line.end(), line), 10) << line;
      off.push_back(std::abs(mesh_volume(mesh) - volume(stock)));
    }
    const double order = std::log2(off.front() / off.back()) / 2;
    std::cout << (three ? "three directions" : "one direction") << ": mesh and dexels differ by "
              << off[0] << " " << off[1] << " " << off[2] << " mm^3 of 5700; order " << order
              << "\n";
    EXPECT_LT(off.back(), 0.005 * 5700);
    EXPECT_GT(order, 0.8);
  }
}

TEST(Stock, MeshVerticesLieOnFlatSkin) {
  Stock stock = box({0, 0, 0}, {20, 20, 10}, 0.5);
  remove(stock, {6.0, 0.0, 30.0}, straight({-10, 10, 7.3}, {30, 10, 7.3}, 3));
  const StockMesh mesh = stock_mesh(stock);
  int floor = 0;
  for (Index i = 0; i < mesh.vertices_w.rows(); ++i) {
    const Vector3d p = mesh.vertices_w.row(i);
    if (mesh.line[std::size_t(i)] != 3 || std::abs(p.y() - 10) > 5 || p.x() < 1 || p.x() > 19)
      continue;
    EXPECT_NEAR(p.z(), 7.3, 1e-9);
    ++floor;
  }
  EXPECT_GT(floor, 500);
}

// ---- blanks -------------------------------------------------------------------------------------

TEST(Blank, BoxMeshAndCylinderHoldTheirVolume) {
  EXPECT_NEAR(volume(box({-1, 2, 3}, {9, 7, 6}, 0.5)), 150.0, 1e-9);
  const Stock mesh = make_stock(meshed_box({5, 2.5, 1.5}), Isometry3d::Identity(), {0.5, true});
  EXPECT_NEAR(volume(mesh), 150.0, 1e-9);
  const Matrix3d R = Eigen::Quaterniond(1, 0.2, -0.3, 0.4).normalized().toRotationMatrix();
  const Stock turned =
      make_stock(meshed_box({5, 2.5, 1.5}, R), Isometry3d::Identity(), {0.1, true});
  EXPECT_NEAR(volume(turned), 150.0, 0.15);
}

TEST(Blank, LinesThroughEdgesAndVerticesOfAMeshCountOnce) {
  // nodes of the grid fall on the vertices and edges of an octahedron
  MeshBlank mesh;
  mesh.vertices_k.resize(6, 3);
  mesh.vertices_k << 2.5, 0, 0, -2.5, 0, 0, 0, 2.5, 0, 0, -2.5, 0, 0, 0, 2.5, 0, 0, -2.5;
  mesh.triangles.resize(8, 3);
  mesh.triangles << 0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5;
  const Stock stock = make_stock(mesh, Isometry3d::Identity(), {1.0, true});
  for (const DexelField& field : stock.fields)
    for (const DexelLine& line : field.lines) EXPECT_LE(line.runs().size(), 1u);
  const Stock fine = make_stock(mesh, Isometry3d::Identity(), {0.05, true});
  EXPECT_NEAR(volume(fine), 4.0 / 3.0 * 2.5 * 2.5 * 2.5, 0.05);
}

TEST(Blank, OpenAndFlippedMeshesAreRefused) {
  MeshBlank open = meshed_box({5, 2, 1});
  open.triangles.conservativeResize(11, 3);
  EXPECT_THROW(make_stock(open, Isometry3d::Identity()), std::invalid_argument);
  MeshBlank flipped = meshed_box({5, 2, 1});
  flipped.triangles.col(0).swap(flipped.triangles.col(1));
  EXPECT_THROW(make_stock(flipped, Isometry3d::Identity()), std::invalid_argument);
  MeshBlank beyond = meshed_box({5, 2, 1});
  beyond.triangles(3, 1) = 8;
  EXPECT_THROW(make_stock(beyond, Isometry3d::Identity()), std::invalid_argument);
  EXPECT_THROW(make_stock(MeshBlank{}, Isometry3d::Identity()), std::invalid_argument);
}

Design wavy(double amplitude) {
  Design design;
  const int n = 41;
  design.vertices.resize(n * n, 3);
  design.triangles.resize(2 * (n - 1) * (n - 1), 3);
  int t = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      design.vertices.row(j * n + i) =
          Vector3d(i, j, amplitude * std::sin(0.2 * i) * std::cos(0.3 * j));
      if (i + 1 == n || j + 1 == n) continue;
      const int v = j * n + i;
      design.triangles.row(t++) << v, v + 1, v + n;
      design.triangles.row(t++) << v + 1, v + n + 1, v + n;
    }
  design.normals = vertex_normals(design.vertices, design.triangles);
  return design;
}

TEST(Blank, AnOffsetBlankStandsBetweenTheRaisedDesignAndTheFloor) {
  const MeshBlank flat = offset_blank(wavy(0.0), 2.0, -5.0);
  EXPECT_NEAR(volume(make_stock(flat, Isometry3d::Identity(), {0.5, true})), 40 * 40 * 7, 1e-6);
  const Stock stock = make_stock(offset_blank(wavy(1.0), 0.7, -5.0), Isometry3d::Identity());
  const Design design = wavy(1.0);
  for (const int v : {5 * 41 + 7, 20 * 41 + 20, 33 * 41 + 12}) {
    const Vector3d p = design.vertices.row(v), n = design.normals.row(v);
    EXPECT_NEAR(depth(stock, p + 0.7 * n), 0.0, 0.02);
    EXPECT_GT(depth(stock, p), 0.4);
  }
  EXPECT_THROW(offset_blank(wavy(1.0), 0.7, 5.0), std::invalid_argument);
  Design upside_down = wavy(1.0);
  upside_down.triangles.col(0).swap(upside_down.triangles.col(1));
  EXPECT_THROW(offset_blank(upside_down, 0.7, -5.0), std::invalid_argument);
}

TEST(Blank, AClosedDesignIsRaisedAsItIs) {
  const MeshBlank cube = meshed_box({5, 5, 5});
  Design design;
  design.vertices = cube.vertices_k;
  design.triangles = cube.triangles;
  design.normals = cube.vertices_k / (5 * std::sqrt(3.0));
  const Stock stock = make_stock(offset_blank(design, std::sqrt(3.0), 0.0), Isometry3d::Identity());
  EXPECT_NEAR(volume(stock), 1728.0, 1e-6);
}

TEST(Blank, AKinkOfADesignStaysClosedWhenItIsRaised) {
  // a roof whose ridge has its vertices twice, one for each normal
  Design roof;
  roof.vertices.resize(8, 3);
  roof.vertices << 0, -5, 0, 10, -5, 0, 0, 0, 5, 10, 0, 5, 0, 0, 5, 10, 0, 5, 0, 5, 0, 10, 5, 0;
  roof.triangles.resize(4, 3);
  roof.triangles << 0, 1, 2, 1, 3, 2, 4, 5, 6, 5, 7, 6;
  roof.normals = vertex_normals(roof.vertices, roof.triangles);
  const Stock stock =
      make_stock(offset_blank(roof, 0.5, -3.0), Isometry3d::Identity(), {0.1, true});
  const double s = 0.5 / std::sqrt(2.0);  // raised: two slopes and a flat between of width 2 s
  const double area = 25.0 + 5.0 * 2 * s + (10.0 + 2 * s) * (3.0 + s);
  EXPECT_NEAR(volume(stock), 10 * area, 0.01 * 10 * area);
}

}  // namespace
}  // namespace abbe::cutting
