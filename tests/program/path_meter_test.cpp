#include "sim/program/path_meter.h"
#include <Eigen/SVD>
#include "kinematics/inverse_kinematics.h"
#include "machines.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_reader.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

constexpr AxisLimits meter_limits{100.0, 1.0};

PathFigures measured(const Path& path, const test::Chain& chain) {
  PathMeter meter(chain, meter_limits);
  meter.add(path);
  return meter.figures();
}

Path gantry_path(const std::string& text) {
  return read_nc(text, "part.ngc", test::options_for(test::gantry()));
}

TEST(PathMeter, TimesWaysAndExtentsOfASmallProgramByHand) {
  const Path path = gantry_path(
      "G21 G90 G94 G17\nG0 X300 Y400\nG1 Z-30 F600\nG4 P2\nG2 X340 Y400 I20 J0\nG1 X940 F60000\n");
  const PathFigures f = measured(path, test::gantry());
  EXPECT_EQ(f.blocks, 5u);
  EXPECT_EQ(f.rapids.count, 1u);
  EXPECT_EQ(f.lines.count, 2u);
  EXPECT_EQ(f.arcs.count, 1u);
  EXPECT_EQ(f.dwells.count, 1u);
  EXPECT_NEAR(f.rapids.seconds, 5.0, 1e-12);    // 500 mm along the way at 100 mm/s
  EXPECT_NEAR(f.rapids.limited_s, 4.0, 1e-12);  // Y alone, 400 mm
  EXPECT_NEAR(f.lines.seconds, 3.0 + 0.6, 1e-12);
  EXPECT_NEAR(f.lines.limited_s, 3.0 + 6.0, 1e-12);  // X cannot do 1000 mm/s
  EXPECT_EQ(f.slowed_moves, 1u);
  EXPECT_NEAR(f.max_slow_down.value, 10.0, 1e-9);
  EXPECT_EQ(f.max_slow_down.line, 6);
  EXPECT_NEAR(f.arcs.seconds, 2 * pi, 1e-9);
  EXPECT_EQ(f.dwells.seconds, 2.0);
  EXPECT_NEAR(f.rapids.path_length, 500.0, 1e-9);
  EXPECT_NEAR(f.arcs.path_length, 20 * pi, 0.05);  // by chords within 0.01 mm
  EXPECT_LE(f.arcs.path_length, 20 * pi);
  EXPECT_NEAR(f.tip_extent_w.max().y(), 420.0, 1e-9);
  EXPECT_NEAR(f.feed_extent_w.min().y(), 400.0, 1e-9);
  EXPECT_EQ(f.fastest_axis, 1);
  EXPECT_NEAR(f.axes[1].fastest.value, 1000.0, 1e-6);
  EXPECT_NEAR(f.axes[1].highest.value, 940.0, 1e-12);
  EXPECT_EQ(f.axes[1].highest.line, 6);
  EXPECT_FALSE(f.singular) << "no rotary axis turns";
  EXPECT_FALSE(f.axes[5].has_position) << "the nose";
}

// The head leans by 1 degree and the table turns by 90 within 6 s, then further away from the pole.
TEST(PathMeter, NearAPoleTheTurnOfTheFreeAxisIsSummedByHand) {
  const Path path = gantry_path(
      "G21 G90 G94 G17\nG43.4 H1\nG0 X0 Y0 Z50 A1 C0\nG1 X60 C90 F600\nG1 X0 A3\nG1 X60 C0\n"
      "G1 A1\nG0 C90\n");
  const test::Chain gantry = test::gantry();
  const auto pole_of = [&](double within) {
    PathMeter meter(gantry, {100.0, 1.0, within});
    meter.add(path);
    return meter.figures().pole;
  };
  const auto pole = pole_of(2.0 * units::deg);
  ASSERT_TRUE(pole);
  EXPECT_NEAR(pole->angle / units::deg, 1.0, 1e-9);
  EXPECT_EQ(pole->axis, 0) << "C";
  EXPECT_EQ(pole->pole_axis, 4) << "A";
  EXPECT_NEAR(pole->pole_position, 0.0, 1e-12);
  EXPECT_NEAR(pole->rotation / units::deg, 90.0, 1e-9);
  EXPECT_NEAR(pole->max_speed / units::deg, 15.0, 1e-6);
  EXPECT_EQ(pole->line, 4);
  EXPECT_NEAR(pole_of(4.0 * units::deg)->rotation / units::deg, 180.0, 1e-9);
  EXPECT_FALSE(pole_of(0.9 * units::deg));
  EXPECT_FALSE(pole_of(0.0)) << "not asked for";
}

TEST(PathMeter, TravelLeftIsToTheNearerLimitAndBelowZeroBeyondIt) {
  std::vector<kinematics::Joint> joints = test::gantry().joints();
  joints[1].min = -50;
  joints[1].max = 100;
  const test::Chain chain(joints, test::gantry().T_bw_home(), test::gantry().T_bt_home());
  EXPECT_NEAR(measured(gantry_path("G0 X80\nX-10\n"), chain).axes[1].remaining_travel, 20.0, 1e-12);
  EXPECT_NEAR(measured(gantry_path("G0 X80\nX-45\n"), chain).axes[1].remaining_travel, 5.0, 1e-12);
  EXPECT_NEAR(measured(gantry_path("G0 X80\nX-57\n"), chain).axes[1].remaining_travel, -7.0, 1e-12);
}

/// Random moves of the tip with rotary axes, in lines and arcs.
Path random_five_axis(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::string text = "G21 G90 G94 G17\n";
  bool tip = false;
  for (int i = 0; i < 120; ++i) {
    if (i % 15 == 0) text += (tip = !tip) ? "G43.4 H1\n" : "G49\n";
    const double x = 100 * unit(random), y = 100 * unit(random), turn = i % 3 == 0 ? 60.0 : 2.0;
    const double a = 10 + 80 * std::abs(unit(random));
    text += fmt::format("G1 X{:.4f} Y{:.4f} Z{:.4f} A{:.4f} C{:.4f} F3000\n", x, y,
                        50 * unit(random), i % 10 == 5 ? -a : a, turn * unit(random));
    if (i % 7 == 3) text += fmt::format("G3 X{:.4f} Y{:.4f} I5 J5\n", x + 10, y + 10);
  }
  return gantry_path(text);
}

/// What 2000 places of every block show.
struct Brute {
  AxisVector lowest, highest;
  Eigen::AlignedBox3d box;
  double singular = 10.0;
};

Brute brute_force(const Path& path, const test::Chain& chain) {
  Brute brute;
  for (const Block& block : path.blocks)
    for (int k = 0; k <= 2000; ++k) {
      const AxisVector q = axes_at(path, block, chain, k / 2000.0);
      brute.lowest = brute.lowest.size() == 0 ? q : AxisVector(brute.lowest.cwiseMin(q));
      brute.highest = brute.highest.size() == 0 ? q : AxisVector(brute.highest.cwiseMax(q));
      brute.box.extend(Vector3d(chain.tool_in_workpiece(q).translation()));
      // on the gantry C turns the tool by sin A, A by 1, at right angles to each other
      if ((block.end - block.start)[0] != 0.0 || (block.end - block.start)[4] != 0.0)
        brute.singular = std::min(brute.singular, std::abs(std::asin(std::sin(q[4]))));
    }
  return brute;
}

TEST(PathMeter, MeetsExtremesAndTheSingularPoseAsBruteForceDoes) {
  double position = 0.0, box = 0.0, angle = 0.0;
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Path path = random_five_axis(seed);
    const test::Chain chain = test::gantry();
    const PathFigures f = measured(path, chain);
    const Brute brute = brute_force(path, chain);
    for (const int j : {0, 1, 2, 3, 4}) {
      const double unit = j == 0 || j == 4 ? 100.0 : 1.0;  // mm per rad
      const AxisFigures& axis = f.axes[std::size_t(j)];
      position = std::max(position, unit * std::abs(axis.lowest.value - brute.lowest[j]));
      position = std::max(position, unit * std::abs(axis.highest.value - brute.highest[j]));
    }
    box = std::max(box, (f.tip_extent_w.min() - brute.box.min()).cwiseAbs().maxCoeff());
    box = std::max(box, (f.tip_extent_w.max() - brute.box.max()).cwiseAbs().maxCoeff());
    ASSERT_TRUE(f.singular);
    // brute force sees A at steps of up to 180/2000 deg
    EXPECT_LE(f.singular->angle, brute.singular + 1e-9);
    angle = std::max(angle,
                     std::abs(f.singular->angle - std::abs(std::asin(std::sin(f.singular->q[4])))));
  }
  std::cout << "axes within " << position << " mm, tip within " << box
            << " mm of brute force; singular angle within " << angle << " rad of |A|\n";
  // brute force misses an extreme by the square of its step: 60 deg at 350 mm, 2000 places
  EXPECT_LT(position, 1e-4);
  EXPECT_LT(box, 1e-4);
  EXPECT_LT(angle, 1e-12);
}

/// Extremes of a program by dense places, each of the greatest and least refined within its
/// neighbours by many more.
struct DenseExtremes {
  std::array<double, 6> lowest, highest;  // X Y Z of the axes, then of the tip
};

DenseExtremes dense_extremes(const Path& path, const test::Chain& chain) {
  DenseExtremes all;
  all.lowest.fill(1e9);
  all.highest.fill(-1e9);
  const std::array slides{*chain.find('X'), *chain.find('Y'), *chain.find('Z')};
  const auto look = [&](const Block& block, double u) {
    const AxisVector q = axes_at(path, block, chain, u);
    const Vector3d tip = chain.tool_in_workpiece(q).translation();
    std::array<double, 6> values;
    for (std::size_t k = 0; k < 3; ++k) values[k] = q[slides[k]], values[k + 3] = tip[Index(k)];
    return values;
  };
  for (const Block& block : path.blocks) {
    constexpr int n = 2000;
    std::vector<std::array<double, 6>> seen;
    for (int i = 0; i <= n; ++i) seen.push_back(look(block, double(i) / n));
    for (std::size_t k = 0; k < 6; ++k)
      for (const double sign : {1.0, -1.0}) {
        const auto highest = std::ranges::max_element(
            seen, {}, [&](const auto& values) { return sign * values[k]; });
        double best = sign * (*highest)[k], at = double(highest - seen.begin()) / n;
        for (double width = 1.0 / n; width > 1e-9; width *= 0.2)
          for (int i = -5; i <= 5; ++i) {
            const double u = std::clamp(at + 0.2 * i * width, 0.0, 1.0);
            if (const double value = sign * look(block, u)[k]; value > best) best = value, at = u;
          }
        if (sign > 0.0)
          all.highest[k] = std::max(all.highest[k], best);
        else
          all.lowest[k] = std::min(all.lowest[k], -best);
      }
  }
  return all;
}

/// An arc or helix in one of the planes, by its centre; in words so fine that its end lies on it.
std::string random_arc(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const int plane = int(std::uniform_int_distribution<int>(0, 2)(random));
  const char* first = std::array{"X", "Z", "Y"}[std::size_t(plane)];
  const char* second = std::array{"Y", "X", "Z"}[std::size_t(plane)];
  const char* third = std::array{"Z", "Y", "X"}[std::size_t(plane)];
  const char* offset[2] = {std::array{"I", "K", "J"}[std::size_t(plane)],
                           std::array{"J", "I", "K"}[std::size_t(plane)]};
  const double radius = std::pow(10.0, 1.0 + 1.5 * unit(random));
  const double from = pi * unit(random), to = pi * unit(random);
  const double c[2] = {50.0 * unit(random), 50.0 * unit(random)};
  return fmt::format(
      "G{} G0 {}{:.10f} {}{:.10f} {}{:.10f}\nG{} {}{:.10f} {}{:.10f} {}{:.10f} {}{:.10f} {}{:.10f} "
      "F3000\n",
      17 + plane, first, c[0] + radius * std::cos(from), second, c[1] + radius * std::sin(from),
      third, 20.0 * unit(random), unit(random) > 0 ? 2 : 3, first, c[0] + radius * std::cos(to),
      second, c[1] + radius * std::sin(to), third, 20.0 * unit(random), offset[0],
      -radius * std::cos(from), offset[1], -radius * std::sin(from));
}

/// The program with the arc that ends it going round so many times more.
Path with_turns(Path path, int more) {
  double& sweep = path.arcs[path.blocks.back().shape].sweep;
  sweep += std::copysign(2 * pi * more, sweep);
  return path;
}

double worst_extreme(const Path& path, const test::Chain& chain) {
  const PathFigures f = measured(path, chain);
  const DenseExtremes dense = dense_extremes(path, chain);
  double worst = 0.0;
  const std::array names{'X', 'Y', 'Z'};
  for (std::size_t k = 0; k < 3; ++k) {
    const AxisFigures& axis = f.axes[std::size_t(*chain.find(names[k]))];
    worst = std::max({worst, std::abs(axis.highest.value - dense.highest[k]),
                      std::abs(axis.lowest.value - dense.lowest[k]),
                      std::abs(f.tip_extent_w.max()[Index(k)] - dense.highest[k + 3]),
                      std::abs(f.tip_extent_w.min()[Index(k)] - dense.lowest[k + 3])});
  }
  return worst;
}

TEST(PathMeter, ExtremesOfArcsAndHelicesInAllPlanesAreThoseOfTheCurves) {
  std::mt19937 random(60325);
  std::uniform_real_distribution<double> turn(-80.0, 80.0);
  double straight = 0.0, turned = 0.0;
  const auto worst = [](const std::string& text, int turns, const test::Chain& chain) {
    return worst_extreme(with_turns(read_nc(text, "part.ngc", test::options_for(chain)), turns),
                         chain);
  };
  for (int i = 0; i < 30; ++i) {
    const std::string arc = random_arc(random);
    straight = std::max(straight, worst("G21 G90 G94\n" + arc, i % 3, test::three_axis()));
    const std::string head =
        fmt::format("G21 G90 G94\nG0 A{:.3f} C{:.3f}\n", turn(random), turn(random));
    turned = std::max(turned, worst(head + arc, i % 3, test::gantry()));
    turned = std::max(turned, worst("G43.4 H1\n" + head + arc, i % 3, test::gantry()));
  }
  std::cout << "extremes of arcs within " << straight << " mm, with axes turned " << turned
            << " mm of dense places\n";
  EXPECT_LT(straight, 1e-8);
  EXPECT_LT(turned, 1e-8);
}

TEST(PathMeter, ExtremesOfMovesThatTurnAreMet) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int i = 0; i < 25; ++i)
    for (const char* mode : {"", "G43.4 H1\n"}) {
      const auto words = [&] {
        return fmt::format("X{:.4f} Y{:.4f} Z{:.4f} A{:.4f} C{:.4f}", 100 * unit(random),
                           100 * unit(random), 50 * unit(random), 80 * unit(random),
                           90 * unit(random));
      };
      const std::string text =
          fmt::format("G21 G90 G94\n{}G0 {}\nG1 {} F3000\n", mode, words(), words());
      worst = std::max(worst, worst_extreme(gantry_path(text), test::gantry()));
    }
  std::cout << "extremes of moves that turn within " << worst << " mm of dense places\n";
  EXPECT_LT(worst, 1e-8);
}

TEST(PathMeter, ACircleThatPassesItsTravelByMicrometresIsFound) {
  std::vector<kinematics::Joint> joints = test::three_axis().joints();
  joints[1].max = 60.316;  // Y
  joints[1].min = -100.0;
  const test::Chain chain(joints, test::three_axis().T_bw_home(), test::three_axis().T_bt_home());
  const Path path = read_nc(
      "G21 G90 G17 F500\nG0 X60.325 Y0\nG3 X-60.325 Y0 I-60.325 J0\nG3 X60.325 Y0 I60.325 J0\nM2\n",
      "part.ngc", test::options_for(chain));
  const PathFigures f = measured(path, chain);
  EXPECT_NEAR(f.axes[1].highest.value, 60.325, 1e-9);
  EXPECT_NEAR(f.axes[1].lowest.value, -60.325, 1e-9);
  EXPECT_NEAR(f.feed_extent_w.max().y(), 60.325, 1e-9);
  EXPECT_NEAR(f.axes[1].remaining_travel, -0.009, 1e-9);
}

/// Chords keep to the tolerance however many turns an arc has, or the arc is refused by its line.
TEST(Chords, KeepToTheToleranceOfAnArcOfThousandsOfTurns) {
  const test::Chain chain = test::three_axis();
  const auto path_of = [&](int turns) {
    return with_turns(read_nc("G21 G90 G17 F500\nG0 X60 Y0 Z0\nG2 X60 Y0 Z-10 I-60 J0\n",
                              "part.ngc", test::options_for(chain)),
                      turns - 1);
  };
  for (const int turns : {1, 30, 2000}) {
    const Path path = path_of(turns);
    const Block& arc = path.blocks.back();
    const auto n = double(chords_of(path, arc, chain, 1e-3));
    const double sagitta = 60.0 * (1.0 - std::cos(turns * pi / n));
    std::cout << turns << " turns: " << n << " chords, " << 1e3 * sagitta << " um\n";
    EXPECT_LE(sagitta, 1e-3);
    EXPECT_GT(sagitta, 0.9e-3) << "as many as are needed";
  }
  const std::string said = thrown_text<BadInput>([&] {
    const Path path = path_of(9000);
    chords_of(path, path.blocks.back(), chain, 1e-8);
  });
  EXPECT_HAS(said, "part.ngc:3");
  EXPECT_HAS(said, "2e+07 chords");
}

TEST(PathMeter, AMoveThroughThePoleIsSeenWhereverItLiesInTheMove) {
  double worst = 0.0;
  for (const double from : {-0.013, -7.0, -80.0, -3.3})
    for (const double to : {0.2, 11.0, 85.0}) {
      const Path path =
          gantry_path(fmt::format("G43.4 H1\nG0 A{} C10\nG1 X50 A{} C30 F500\n", from, to));
      const PathFigures f = measured(path, test::gantry());
      ASSERT_TRUE(f.singular);
      worst = std::max(worst, f.singular->angle);
      EXPECT_EQ(f.singular->line, 3);
    }
  std::cout << "poles met within " << worst << " rad\n";
  EXPECT_LT(worst, 1e-7);
}

TEST(PathMeter, TheSingularAngleIsTheLeastSingularValueOfTheTurnsOfTheTool) {
  // both axes in the head, the inner one inclined
  using namespace test;
  const Vector3d inclined = Vector3d(0, 1, 1).normalized();
  const Chain chain(
      {joint('X', Side::Tool, Motion::Linear, ex), joint('Y', Side::Tool, Motion::Linear, ey),
       joint('Z', Side::Tool, Motion::Linear, ez),
       joint('C', Side::Tool, Motion::Rotary, ez, {0, 0, 300}),
       joint('B', Side::Tool, Motion::Rotary, inclined, {0, 0, 300})},
      Pose::Identity(), Pose::Identity());
  double worst = 0.0;
  for (double b = 3; b < 180; b += 3.5) {
    Path path;
    Block block;
    block.line = 1;
    block.start = AxisVector::Zero(5);
    block.start[4] = b * units::deg;
    block.end = block.start;
    block.end[3] = 1e-6;  // C turns: the angle does not change
    block.end_s = 1.0;
    path.blocks = {block};
    const PathFigures f = measured(path, chain);
    ASSERT_TRUE(f.singular);
    Eigen::Matrix<double, 3, 2> turns;  // by central differences
    for (int k = 0; k < 2; ++k) {
      AxisVector up = block.start, down = block.start;
      up[3 + k] += 1e-5;
      down[3 + k] -= 1e-5;
      turns.col(k) = (chain.tool_in_workpiece(up).linear().col(2) -
                      chain.tool_in_workpiece(down).linear().col(2)) /
                     2e-5;
    }
    const double lowest = Eigen::JacobiSVD<Eigen::Matrix<double, 3, 2>>(turns).singularValues()[1];
    worst = std::max(worst, std::abs(std::sin(f.singular->angle) - lowest));
  }
  std::cout << "within " << worst << " of differences\n";
  EXPECT_LT(worst, 1e-9);
}

TEST(PathMeter, PiecesGiveTheFiguresOfTheWhole) {
  const Path path = random_five_axis(9);
  const test::Chain chain = test::gantry();
  PathMeter pieces(chain, meter_limits), one(chain, meter_limits);
  one.add(path);
  for (std::size_t first = 0; first < path.blocks.size(); first += 7)
    pieces.add(path_segment(path, first, std::min(first + 7, path.blocks.size())));
  const PathFigures a = one.figures(), b = pieces.figures();
  EXPECT_EQ(a.blocks, b.blocks);
  EXPECT_EQ(a.lines.limited_s, b.lines.limited_s);
  EXPECT_EQ(a.lines.path_length, b.lines.path_length);
  EXPECT_EQ(a.tip_extent_w.max(), b.tip_extent_w.max());
  EXPECT_EQ(a.singular->angle, b.singular->angle);
  EXPECT_EQ(a.axes[1].fastest.value, b.axes[1].fastest.value);
}

}  // namespace
}  // namespace abbe::sim::program
