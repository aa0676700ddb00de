#include "sim/program/rewrite.h"
#include "machines.h"
#include "sim/program/program_writers.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;
using test::Chain;

/// What a compensator adds at an instant, in the coordinates of the block.
using Change = std::function<AxisVector(const Block&, double time_s)>;

double time_at(const Block& block, double u) {
  return block.start_s + u * (block.end_s - block.start_s);
}

AxisVector wanted(const Path& path, const Block& block, double u, const Change& change) {
  return position(path, block, u) + change(block, time_at(block, u));
}

/// Every block of motion in `parts` steps, as a compensator would hand it.
CorrectedPath dense(const Path& path, int parts, const Change& change) {
  CorrectedPath points(path.blocks.size());
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    if (block.interpolation == Interpolation::Dwell) continue;
    for (int k = 0; k <= parts; ++k) {
      const double u = double(k) / parts;
      points[i].push_back({u, wanted(path, block, u, change), {}, {}});
    }
  }
  return points;
}

/// The points without those at the starts.
CorrectedPath every(CorrectedPath points) {
  for (auto& list : points)
    if (!list.empty()) list.erase(list.begin());
  return points;
}

/// Waves of all axes but a last spindle, `size` mm of slides and 0.01 size rad of turns.
Change waves(const std::vector<ControlledAxis>& axes, double size) {
  return [=](const Block&, double time_s) {
    AxisVector off = AxisVector::Zero(Index(axes.size()));
    for (int j = 0; j < int(off.size()); ++j) {
      const auto motion = axes[std::size_t(j)].motion;
      if (motion == kinematics::Motion::Spindle) continue;
      const double most = motion == kinematics::Motion::Linear ? size : 0.01 * size;
      off[j] = most * std::sin(3 * time_s + j);
    }
    return off;
  };
}

AxisVector none(const Block& block, double) { return AxisVector::Zero(block.end.size()); }

struct Off {
  double most = 0.0;  ///< mm
  int blocks = 0;     ///< with motion
};

/// Largest distance between a rewritten program, line for line at its own time, and what was
/// wanted, at 50 instants a line. Rapids are not followed, nor jumps.
/// @param lever  mm per rad of every turn
Off off_wanted(const Path& path, const RewrittenProgram& program, const Path& again,
               const std::vector<ControlledAxis>& axes, double lever, const Change& change) {
  Off off;
  const int spindle = find_spindle(axes);
  for (const Block& block : again.blocks) {
    const LineOrigin& stretch = program.line_origins.at(std::size_t(block.line) - 1);
    const Block& source = path.blocks.at(std::size_t(stretch.block));
    if (block.interpolation == Interpolation::Dwell) continue;
    ++off.blocks;
    if (block.interpolation == Interpolation::Rapid || stretch.to == stretch.from) continue;
    for (int k = 0; k <= 50; ++k) {
      const double u = stretch.from + (stretch.to - stretch.from) * k / 50.0;
      const AxisVector by = position(again, block, k / 50.0) - wanted(path, source, u, change);
      double slides = 0.0, turns = 0.0;
      for (int j = 0; j < int(by.size()); ++j) {
        const auto motion = axes[std::size_t(j)].motion;
        if (motion == kinematics::Motion::Linear) slides += by[j] * by[j];
        if (motion == kinematics::Motion::Rotary && j != spindle) turns += std::abs(by[j]);
      }
      off.most = std::max(off.most, std::sqrt(slides) + lever * turns);
    }
  }
  return off;
}

ThinOptions thin(double tolerance, int axes, double lever) {
  ThinOptions options;
  options.tolerance = tolerance;
  options.lever = {AxisVector::Constant(axes, lever), AxisVector::Constant(axes, lever)};
  options.word_mm = 1e-7;
  return options;
}

constexpr RewriteOptions fine_words = {.word_mm = 1e-7, .word_rad = 1e-9};

const char* const five_axis =
    "S500 M3\nG43.4 H1\nG0 X10 Z5 A10\nG1 X20 C30 F600\nG17 G3 X0 Y20 R30\nG4 P1.5\nG2 X0 Y-20 Z-3 "
    "R25 C90\nG49 G1 X5 F300\nG1 X40 A-20 C180 F900\nG93 G1 Y7 F30\nC10 A3 F5\nG94 F200 M5\nX7\n";

TEST(Rewrite, NcProgramGoesThroughTheCorrectedPointsAtTheirTimes) {
  NcOptions options = test::options_for(test::gantry());
  options.work_offset[0] = AxisVector::Zero(6);
  options.work_offset[0] << 0.1, 5, 6, 7, 0, 0;
  const Path path = read_nc(five_axis, "t", options);
  const CorrectedPath corrected = every(dense(path, 4, waves(options.axes, 0.02)));
  const std::string text = rewrite_program(path, corrected, options).text;
  const Path again = read_nc(text, "rewritten", options);
  double off = 0.0, turned = 0.0, late = 0.0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const std::size_t count = corrected[i].empty() ? 1 : corrected[i].size();
    for (std::size_t k = 0; k < count; ++k, ++next) {
      ASSERT_LT(next, again.blocks.size()) << text;
      const Block& block = again.blocks[next];
      ASSERT_EQ(block.coordinates, path.blocks[i].coordinates);
      if (corrected[i].empty()) continue;
      off = std::max(off, (block.end - corrected[i][k].at).segment(1, 3).cwiseAbs().maxCoeff());
      for (const int j : {0, 4})
        turned = std::max(turned, std::abs((block.end - corrected[i][k].at)[j]));
      const double seconds = 0.25 * (path.blocks[i].end_s - path.blocks[i].start_s);
      const double by = std::abs(block.end_s - block.start_s - seconds) / seconds;
      const bool other =
          k == 0 && i > 0 && path.blocks[i - 1].coordinates != path.blocks[i].coordinates;
      if (block.interpolation == Interpolation::Rapid || other)
        EXPECT_LT(by, 0.02);  // timed by a way that the correction changed
      else
        late = std::max(late, by);
    }
  }
  EXPECT_EQ(next, again.blocks.size()) << text;
  std::cout << "off by " << off << " mm, " << turned / units::deg << " deg, late by " << late
            << " of a block\n";
  EXPECT_LE(off, 0.501e-4);
  EXPECT_LE(turned, 0.501e-4 * units::deg);
  EXPECT_LT(late, 1e-8);
  EXPECT_NEAR(again.blocks.back().end[5], path.blocks.back().end[5], 0.2);  // the spindle, rad
}

TEST(Rewrite, WithoutCorrectionsTheProgramComesBackWithinItsWords) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1.23456789\nG1 X2 Y3 F60\nC20\n", "t", options);
  const Path again =
      read_nc(rewrite_program(path, CorrectedPath(path.blocks.size()), options).text, "t", options);
  ASSERT_EQ(again.blocks.size(), path.blocks.size());
  EXPECT_NEAR(again.blocks[0].end[1], 1.2346, 1e-15);
  EXPECT_EQ(again.blocks[2].end[1], 2.0);
  EXPECT_NEAR(again.blocks[2].end[0], 20 * units::deg, 1e-15);
}

TEST(Rewrite, NoCorrectionAtManyPointsGivesTheBlocksOfTheOriginalBackArcsToo) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc(five_axis, "t", options);
  const ThinOptions tight = thin(1e-5, 6, 100.0);
  const CorrectedPath points = thin_out(path, dense(path, 400, none), options, tight);
  const RewrittenProgram program = rewrite_program(path, points, options, fine_words);
  const Path again = read_nc(program.text, "again", options);
  const Off off = off_wanted(path, program, again, options.axes, 100.0, none);
  std::cout << path.motion_blocks << " blocks become " << off.blocks << ", off by " << off.most
            << " mm, " << path.arcs.size() << " arcs become " << again.arcs.size() << "\n";
  EXPECT_EQ(again.arcs.size(), path.arcs.size());
  EXPECT_LE(off.blocks, path.motion_blocks + 2);  // where axes and tip change places
  EXPECT_LE(off.most, 1.02e-5);
  EXPECT_NEAR(again.blocks.back().end_s, path.blocks.back().end_s, 3e-3);
}

/// Seconds of all blocks but rapids, whose time goes by the length that is left of them.
double fed_s(const Path& path) {
  double sum = 0.0;
  for (const Block& block : path.blocks)
    if (block.interpolation != Interpolation::Rapid) sum += block.end_s - block.start_s;
  return sum;
}

TEST(Rewrite, EveryGoldenProgramComesBackWithItsMotion) {
  NcOptions options = test::options_for(test::gantry());
  options.work_offset[1] = AxisVector::Zero(6);
  options.work_offset[1] << 10 * units::deg, 1, 2, 3, 0, 0;
  int programs = 0;
  double worst = 0.0;
  for (const auto& folder : fs::directory_iterator(ABBE_SOURCE_DIR "/tests/golden")) {
    const auto file = folder.path() / "program.ngc";
    if (!fs::exists(file)) continue;
    SCOPED_TRACE(file);
    const Path path = read_nc_file(file, options);
    if (path.blocks.empty()) continue;
    const RewrittenProgram program =
        rewrite_program(path, CorrectedPath(path.blocks.size()), options, fine_words);
    const Path again = read_nc(program.text, "again", options);
    const Off off = off_wanted(path, program, again, options.axes, 1.0, none);
    // the tool of a spiralling arc (unlike radii) is where the reader of the original put it
    EXPECT_LE(off.most, 1e-6) << program.text;
    EXPECT_NEAR(fed_s(again), fed_s(path), 5e-3);
    EXPECT_LT((again.blocks.back().end - path.blocks.back().end).head(5).cwiseAbs().maxCoeff(),
              1e-6);
    worst = std::max(worst, off.most);
    ++programs;
  }
  std::cout << programs << " programs, off by at most " << worst << " mm\n";
  EXPECT_GT(programs, 10);
}

TEST(Rewrite, CoarseWordsRoundToTheNearestStep) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1.0024\nX-1.0026\n", "t", options);
  const std::string text =
      rewrite_program(path, CorrectedPath(2), options, {.word_mm = 5e-3, .word_rad = 1e-3}).text;
  const Path again = read_nc(text, "t", options);
  EXPECT_EQ(again.blocks[0].end[1], 1.0);
  EXPECT_EQ(again.blocks[1].end[1], -1.005);
}

TEST(Rewrite, DialectStaysInchAndInverseTimeAndWordsWithoutMotion) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc(
      "G20 T3 M6\nM8\nG0 X1\nG1 X2.00001234 F10\nG18 G3 X3 Z0 R2\nM0\nG21 G93 G1 X30 F2\nG94 X40 "
      "F100\nC90 F360 M9\nM30\n",
      "t", options);
  const std::string text = rewrite_program(path, CorrectedPath(path.blocks.size()), options).text;
  EXPECT_EQ(text,
            "(corrected program)\nG17 G90 G91.1 G54\nT3 M6\nM8\nG20\nG94\nG49\nG0 C0 X1 Y0 Z0 A0\n"
            "G1 X2.000012 F9.9999966\nG18\nG3 C0 X3 Y0 Z0 A0 K-1.936493 I0.499994 F10.0000035\nM0\n"
            "G21\nG93\nG1 C0 X30 Y0 Z0 A0 F2\nG94\nG1 C0 X40 Y0 Z0 A0 F100\nG1 C90 F360\nM9\nM2\n");
  const Path again = read_nc(text, "t", options);
  ASSERT_EQ(again.blocks.size(), path.blocks.size()) << text;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    EXPECT_EQ(again.blocks[i].inch, path.blocks[i].inch);
    EXPECT_EQ(again.blocks[i].inverse_time, path.blocks[i].inverse_time);
    EXPECT_EQ(again.blocks[i].interpolation, path.blocks[i].interpolation);
    EXPECT_NEAR(again.blocks[i].end_s, path.blocks[i].end_s, 1e-5);
    EXPECT_LT((again.blocks[i].end - path.blocks[i].end).cwiseAbs().maxCoeff(), 1.3e-5);
  }
}

/// Returns the length of the arcs of a path in their planes, mm, signed by their sense.
double arc_length(const Path& path) {
  double length = 0.0;
  for (const Block& block : path.blocks) {
    if (block.interpolation != Interpolation::Arc) continue;
    const Arc& arc = path.arcs[block.shape];
    length += arc.sweep * (arc.radius + 0.5 * arc.growth);
  }
  return length;
}

TEST(Rewrite, WholeTurnsStayWholeTurns) {
  const NcOptions options = test::options_for(test::gantry());
  for (const char* move :
       {"G2 I10", "G3 J-5", "G2 X0 Y0 I-3 J4", "G2 X0.002 Y0 I10", "G3 I10 Z-6", "G2 X20 I10",
        "G18 G2 K4", "G19 G3 J4", "G3 X0 Y-0.001 I-10", "G20 G2 I0.5", "G93 G3 I8 F2"})
    for (const int more : {0, 1, 4}) {  // turns besides
      SCOPED_TRACE(fmt::format("{} and {} turns", move, more));
      Path path = read_nc(
          fmt::format("G21 G90 G17 G94\nG1 X1 Y2 Z3 F100\nX0 Y0 Z0\n{}\nM2\n", move), "t", options);
      ASSERT_EQ(path.arcs.size(), 1u);
      path.arcs[0].sweep += std::copysign(2 * pi * more, path.arcs[0].sweep);
      const std::string text =
          rewrite_program(path, CorrectedPath(path.blocks.size()), options).text;
      const Path again = read_nc(text, "t", options);
      EXPECT_NE(arc_length(path), 0.0);
      EXPECT_NEAR(arc_length(again), arc_length(path), 1e-4 * (1 + more)) << text;
      EXPECT_NEAR(again.blocks.back().end_s, path.blocks.back().end_s, 1e-4);
      EXPECT_LT((again.blocks.back().end - path.blocks.back().end).cwiseAbs().maxCoeff(), 1.3e-5);
    }
}

/// A rewriting of a program with a tolerance.
struct Case {
  const char* name;
  Chain machine;
  std::string text;
  double size;  ///< of the correction, mm and rad
};

class ThinnedNc : public testing::TestWithParam<double> {};

TEST_P(ThinnedNc, StaysWithinItsToleranceOfTheCorrectedPathAtEveryInstant) {
  const double tolerance = GetParam();
  const std::vector<Case> cases = {
      {"five axes", test::gantry(), five_axis, 0.003},
      {"large correction", test::gantry(), five_axis, 0.05},
      {"three axes", test::three_axis(),
       "G1 X100 Y3 F600\nG2 X80 Y-10 R25\nG18 G3 X0 Z0 R41 F2000\nG19 G2 Y-10 Z0 J3 K4\n", 0.01},
  };
  for (const Case& one : cases) {
    const NcOptions options = test::options_for(one.machine);
    const int n = one.machine.size();
    const double lever = 100.0;
    const Path path = read_nc(one.text, "t", options);
    const Change change = waves(options.axes, one.size);
    const int parts = 4000;
    const CorrectedPath all = dense(path, parts, change);
    const CorrectedPath points = thin_out(path, all, options, thin(tolerance, n, lever));
    const RewrittenProgram program = rewrite_program(path, points, options, fine_words);
    const Path again = read_nc(program.text, "again", options);
    const Off off = off_wanted(path, program, again, options.axes, lever, change);
    std::cout << one.name << ", tolerance " << tolerance << " mm: off by " << off.most << " mm in "
              << off.blocks << " blocks (" << again.arcs.size() << " arcs) of "
              << path.motion_blocks << "\n";
    // words of 1e-7 mm and 1e-9 rad, and what the dense points themselves leave between them
    EXPECT_LE(off.most, tolerance + 2e-6) << one.name;
    EXPECT_GT(off.most, 0.5 * tolerance) << one.name;  // no more blocks than it takes
    EXPECT_LT(off.blocks, parts * path.motion_blocks / 10) << one.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Tolerances, ThinnedNc, testing::Values(1e-2, 1e-3, 1e-4));

TEST(DecimatedMesh, RandomProgramsStayWithinTheirTolerance) {
  SeededRandom random(20240611);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto pick = [&](int n) { return int(random() % unsigned(n)); };
  const NcOptions options = test::options_for(test::gantry());
  double worst = 0.0;
  for (int round = 0; round < 60; ++round) {
    std::string text = pick(2) ? "G94 F500\n" : "G93\n";
    const bool inverse = text[2] == '3';
    if (pick(3) == 0) text += "G20\n";
    for (int line = 0; line < 12; ++line) {
      const std::string feed = inverse ? fmt::format(" F{:.3f}", 20 + 10 * unit(random)) : "";
      switch (pick(6)) {
        case 0:
          text += pick(2) ? "G43.4 H1\n" : "G49\n";
          break;
        case 1:
          text += fmt::format("G{} G91 G{} {}{:.4f} {}{:.4f}{}\nG90\n", 17, 2 + pick(2), 'I',
                              3 * unit(random), 'J', 5 + unit(random), feed);
          break;
        case 2:
          text += fmt::format("G0 X{:.4f} Z{:.4f}\n", 3 * unit(random), 2 * unit(random));
          break;
        case 3:
          text += fmt::format("G1 C{:.3f} A{:.3f}{}\n", 50 * unit(random), 50 * unit(random), feed);
          break;
        default:
          text += fmt::format("G1 X{:.4f} Y{:.4f} A{:.3f}{}\n", 3 * unit(random), 3 * unit(random),
                              20 * unit(random), feed);
      }
    }
    const Path path = read_nc(text, "t", options);
    const double size = std::pow(10.0, -3 + 2 * unit(random));
    const Change change = waves(options.axes, size);
    const double tolerance = std::pow(10.0, -3 + unit(random));
    const CorrectedPath points =
        thin_out(path, dense(path, 2000, change), options, thin(tolerance, 6, 10.0));
    const RewrittenProgram program = rewrite_program(path, points, options, fine_words);
    const Path again = read_nc(program.text, "again", options);
    const Off off = off_wanted(path, program, again, options.axes, 10.0, change);
    ASSERT_LE(off.most, tolerance + 2e-6) << text << program.text;
    worst = std::max(worst, off.most / tolerance);
  }
  std::cout << "at most " << worst << " of the tolerance used\n";
  EXPECT_GT(worst, 0.9);
}

TEST(DecimatedMesh, ConstantCorrectionKeepsEveryBlock) {
  const NcOptions options = test::options_for(test::three_axis());
  const Path path =
      read_nc("G1 X1 F600\nG17 G3 X1 Y0 I-20 J0\nG1 X30\nG2 X40 Y10 I0 J10\n", "t", options);
  const Change change = [](const Block& block, double) {
    return AxisVector::Constant(block.end.size(), 0.01);
  };
  const CorrectedPath points = thin_out(path, dense(path, 500, change), options, thin(1e-5, 3, 0));
  const Path again = read_nc(rewrite_program(path, points, options, fine_words).text, "t", options);
  EXPECT_EQ(again.motion_blocks, 1 + 4 + 3);  // a jump at the start, circle and three quarters cut
  EXPECT_EQ(again.arcs.size(), 5u);
  EXPECT_NEAR(again.arcs.back().radius, 10.0, 1e-4);
}

TEST(DecimatedMesh, AxisThatTurnsBackJumpsByItsPlay) {
  const NcOptions options = test::options_for(test::three_axis());
  const Path path = read_nc("G93 G1 X10 F60\nX0 F60\nG17 G2 X0 Y0 I5 J0 F10\n", "t", options);
  // 4 um of play in X, taken up at once
  CorrectedPath points = dense(path, 100, none);
  for (int k = 0; k <= 100; ++k) points[1][std::size_t(k)].at[0] -= k == 0 ? 0.0 : 0.004;
  points[1].insert(points[1].begin() + 1, points[1][0]);
  points[1][1].at[0] -= 0.004;
  for (int k = 51; k <= 100; ++k) points[2][std::size_t(k)].at[0] -= 0.004;
  points[2].insert(points[2].begin() + 51, points[2][50]);
  points[2][51].at[0] -= 0.004;
  points[2].insert(points[2].begin(), points[2][0]);
  points[2][0].at[0] -= 0.004;
  const RewrittenProgram program =
      rewrite_program(path, thin_out(path, points, options, thin(1e-4, 3, 0)), options);
  const Path again = read_nc(program.text, "t", options);
  std::vector<double> jumps;
  for (const Block& block : again.blocks) {
    const LineOrigin& stretch = program.line_origins[std::size_t(block.line) - 1];
    if (stretch.from != stretch.to) continue;
    jumps.push_back(block.end[0] - block.start[0]);
    EXPECT_NEAR(block.end_s - block.start_s, 1e-3, 1e-9);
  }
  ASSERT_EQ(jumps.size(), 3u) << program.text;
  EXPECT_NEAR(jumps[0], -0.004, 1e-9);
  EXPECT_NEAR(jumps[1], 0.004, 1e-9);
  EXPECT_NEAR(jumps[2], -0.004, 1e-9);
  EXPECT_NEAR(again.blocks.back().end_s, path.blocks.back().end_s, 1e-6);
  // a play below the tolerance is smoothed
  const CorrectedPath coarse = thin_out(path, points, options, thin(5e-3, 3, 0));
  EXPECT_EQ(coarse[1].size(), 1u);
}

TEST(Rewrite, PvtProgramFollowsTheCorrectionSmoothly) {
  const NcOptions options = test::options_for(test::platform());
  std::string text = "time_s,X_mm,Z_mm,S_rad,X_mm_per_s,Z_mm_per_s,S_rad_per_s\n";
  for (int k = 0; k <= 40; ++k)
    text += fmt::format("{},{},0,{},0.5,0,15\n", k * 0.1, k * 0.05, k * 1.5);
  const Path path = read_pvt(text, "t", options);
  const Change change = [](const Block& block, double time_s) {
    AxisVector off = AxisVector::Zero(block.end.size());
    off[1] = 1e-3 * std::sin(2 * time_s);
    return off;
  };
  CorrectedPath corrected = dense(path, 2, change);
  for (std::size_t i = 1; i < corrected.size(); ++i) corrected[i].erase(corrected[i].begin());
  const RewrittenProgram program = rewrite_program(path, corrected, options);
  const Path again = read_pvt(program.text, "t", options);
  ASSERT_EQ(again.blocks.size(), 2 * path.blocks.size());
  const Off off = off_wanted(path, program, again, options.axes, 0.0, change);
  std::cout << "between the points off by " << off.most << " mm\n";
  EXPECT_LT(off.most, 1e-7);  // of a correction of 1e-3 mm
  for (const Block& block : again.blocks) EXPECT_EQ(position(again, block, 0.3)[2], 0.0);
}

TEST(DecimatedMesh, PvtRowsStayWithinTheirToleranceWithFarFewerOfThem) {
  const NcOptions options = test::options_for(test::platform());
  std::string text = "time_s,X_mm,Z_mm,S_rad,X_mm_per_s,Z_mm_per_s,S_rad_per_s\n";
  for (int k = 0; k <= 20; ++k)
    text += fmt::format("{0},{1},{2},{3},0.5,{4},15\n", k, k * 0.5, std::sin(0.3 * k), k * 15,
                        0.3 * std::cos(0.3 * k));
  const Path path = read_pvt(text, "t", options);
  const Change change = [](const Block& block, double time_s) {
    AxisVector off = AxisVector::Zero(block.end.size());
    off[1] = 5e-3 * std::sin(7 * time_s);
    off[2] = 2e-3 * std::cos(3 * time_s) + 1e-3;
    return off;
  };
  const int parts = 1000;
  for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
    const CorrectedPath points =
        thin_out(path, dense(path, parts, change), options, thin(tolerance, 3, 0));
    const RewrittenProgram program = rewrite_program(path, points, options);
    const Path again = read_pvt(program.text, "t", options);
    const Off off = off_wanted(path, program, again, options.axes, 0.0, change);
    std::cout << "tolerance " << tolerance << " mm: off by " << off.most << " mm in "
              << again.blocks.size() << " rows of " << parts * path.blocks.size() << " points\n";
    EXPECT_LE(off.most, 1.01 * tolerance);
    EXPECT_GT(off.most, 0.3 * tolerance);
    std::set<double> ends;
    for (const Block& block : again.blocks) ends.insert(block.end_s);
    for (const Block& block : path.blocks) EXPECT_EQ(ends.count(block.end_s), 1u);
    EXPECT_EQ(again.blocks.front().start, wanted(path, path.blocks.front(), 0.0, change));
    const auto rows = pvt_rows(again);
    EXPECT_EQ(write_pvt(rows, options.axes, std::vector<int>{0, 1, 2}), program.text);
  }
}

TEST(Rewrite, UncorrectedPvtComesBackBitForBit) {
  const NcOptions options = test::options_for(test::platform());
  const Path path =
      read_pvt("time_s,X_mm,X_mm_per_s\n0.1,0.3,1\n0.7,0.123456789,-2e-9\n1,4,5\n", "t", options);
  const auto same = [&](const CorrectedPath& corrected) {
    const Path again = read_pvt(rewrite_program(path, corrected, options).text, "t", options);
    ASSERT_EQ(again.blocks.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(again.blocks[i].start_s, path.blocks[i].start_s);
      EXPECT_EQ(again.blocks[i].end, path.blocks[i].end);
      EXPECT_EQ(again.cubics[i].start_velocity, path.cubics[i].start_velocity);
      EXPECT_EQ(again.cubics[i].end_velocity, path.cubics[i].end_velocity);
    }
  };
  same(CorrectedPath(2));
  same(thin_out(path, dense(path, 100, none), options));
}

TEST(Rewrite, WhatNoLongerMovesByAWordKeepsItsTime) {
  const NcOptions options = test::options_for(test::three_axis());
  const Path path = read_nc("G1 X1 F60\nX1.00002\nX1.00004\nX2\n", "t", options);
  const RewrittenProgram program = rewrite_program(path, CorrectedPath(4), options);
  const Path again = read_nc(program.text, "t", options);
  ASSERT_EQ(again.blocks.size(), 4u) << program.text;
  EXPECT_EQ(again.blocks[1].interpolation, Interpolation::Dwell);
  EXPECT_EQ(program.line_origins[std::size_t(again.blocks[2].line) - 1].block, 2);
  EXPECT_NEAR(again.blocks.back().end_s, path.blocks.back().end_s, 1e-9);
}

TEST(Rewrite, ListsThatDoNotFitAreRefused) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1\n", "t", options);
  const AxisVector q = path.blocks[0].end;
  const AxisVector far = AxisVector::Constant(6, std::numeric_limits<double>::quiet_NaN());
  const auto point = [](double u, const AxisVector& at) { return CorrectedPoint{u, at, {}, {}}; };
  const std::vector<CorrectedPath> wrong = {
      CorrectedPath(2),
      {{point(0.5, q)}},
      {{point(0.5, q), point(0.4, q), point(1, q)}},
      {{point(1, AxisVector::Zero(2))}},
      {{point(0, q), point(1, far)}},
      {{point(-0.1, q), point(1, q)}},
      {{point(0, q), point(1.5, q)}},
      {{point(std::nan(""), q), point(1, q)}},
      {{point(0, q), {1.0, q, Vector2d(0, 0), {}}}},
  };
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    EXPECT_THROW(rewrite_program(path, wrong[i], options), std::invalid_argument) << i;
    if (i + 1 < wrong.size()) {
      EXPECT_THROW(thin_out(path, wrong[i], options), std::invalid_argument) << i;
    }
  }
  const CorrectedPath right = {{point(0, q), point(1, q)}};
  for (const double nonsense : {-1.0, std::nan(""), -0.1}) {
    ThinOptions options_of_thin;
    options_of_thin.tolerance = nonsense;
    EXPECT_THROW(thin_out(path, right, options, options_of_thin), std::invalid_argument);
    EXPECT_THROW(rewrite_program(path, right, options, {.word_mm = nonsense}),
                 std::invalid_argument);
    EXPECT_THROW(rewrite_program(path, right, options, {.word_rad = nonsense}),
                 std::invalid_argument);
  }
  EXPECT_THROW(rewrite_program(path, right, options, {.word_mm = 0.0}), std::invalid_argument);
  NcOptions no_length = options;
  const Path tip = read_nc("G43.4 H1\nG0 X1\n", "t", options);
  no_length.tool_length.clear();
  EXPECT_THROW(rewrite_program(tip, right, no_length), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::program
