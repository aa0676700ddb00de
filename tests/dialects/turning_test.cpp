#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/program/block_motion.h"
#include "tests/dialects/lathe.h"
#include "tests/test.h"

/// Programs of turning controls. Every figure is worked out here, by closed form or by numerical
/// integration, and not by what reads programs.
namespace abbe::sim::dialects::turning_tests {
namespace {

namespace machines = program::test;
using kinematics::AxisVector;
using program::Block;
using program::Interpolation;
using program::Path;

constexpr int z = 1, x = 2;  // joints of the lathe

using test::lathe;

ReadOptions lathe_options(Dialect dialect, const machines::Chain& chain = lathe()) {
  ReadOptions options;
  options.control = machines::options_for(chain);
  options.control.start[x] = 40;
  options.control.start[z] = 60;
  options.control.tool_radius = {{1, 0.8}};
  options.control.max_spindle_rpm = 5000;
  options.dialect = dialect;
  return options;
}

ParsedProgram read(Dialect dialect, const std::string& text) {
  return read_program(text, "part.nc", lathe_options(dialect));
}

std::vector<std::string> input_errors(const std::string& text, const ReadOptions& options) {
  std::vector<std::string> texts;
  try {
    read_program(text, "part.nc", options);
  } catch (const BadProgram& bad) {
    for (const BadInput& fault : bad.input_errors) texts.push_back(fault.what());
  } catch (const BadInput& fault) {
    texts.push_back(fault.what());
  }
  return texts;
}

double feed_time(const Path& path) {
  double seconds = 0.0;
  for (const Block& block : path.blocks)
    if (program::is_feed(block)) seconds += block.end_s - block.start_s;
  return seconds;
}

double turns_at_feed(const Path& path) {
  double turns = 0.0;
  for (const Block& block : path.blocks)
    if (program::is_feed(block)) turns += std::abs(block.end[0] - block.start[0]) / (2 * pi);
  return turns;
}

std::string all_of(const std::vector<std::string>& texts) {
  std::string joined;
  for (const std::string& text : texts) joined += text + "\n";
  return joined;
}

std::string assumptions_of(const ParsedProgram& program) {
  std::string texts;
  for (const program::Assumption& one : program.path.assumptions) texts += to_text(one) + "\n";
  return texts;
}

void expect_assumption(const ParsedProgram& program, const std::string& part) {
  EXPECT_HAS(assumptions_of(program), part);
}

/// Time of a feed per turn under constant surface speed, by the trapezoid rule over the path.
/// @param radius  mm, at a fraction of the path
double time_by_sum(const std::function<double(double)>& radius, double length, double feed,
                   double m_per_min, double max_rpm) {
  constexpr int n = 400'000;
  double sum = 0.0;
  for (int i = 0; i <= n; ++i) {
    const double r = std::abs(radius(double(i) / n));
    const double rpm = r > 0 ? std::min(max_rpm, m_per_min * 1000 / (2 * pi * r)) : max_rpm;
    sum += (i == 0 || i == n ? 0.5 : 1.0) / rpm;
  }
  return sum / n * length / feed * 60.0;
}

TEST(Turning, ATurningProgramOfFanucIsReadOnALathe) {
  const ParsedProgram program =
      read(Dialect::Fanuc,
           "O10\nG18 G21 G40 G99\nG50 S2000\nT0101\nG96 S180 M03\nG00 X54. Z12.\nG01 Z2. F0.2\n"
           "X60.\nG00 X80. Z50.\nM30\n");
  ASSERT_EQ(program.path.blocks.size(), 4u);
  EXPECT_EQ(program.path.blocks[0].end[x], 27.0) << "X is a diameter";
  EXPECT_EQ(program.path.blocks[2].end[x], 30.0);
  // 10 mm at the radius 27, then from 27 to 30: 2 pi r / (f v), integrated
  const double v = 180e3 / 60;  // mm/s
  const double along = 10 * 2 * pi * 27 / (0.2 * v);
  const double outwards = pi * (30.0 * 30.0 - 27.0 * 27.0) / (0.2 * v);
  EXPECT_NEAR(feed_time(program.path), along + outwards, 1e-9);
  EXPECT_NEAR(along + outwards, 3.723, 1e-3);
  expect_assumption(program, "the control is taken as a turning control (Fanuc G-code system A)");
  expect_assumption(program, "program.control, --control");
  ASSERT_EQ(program.path.tool_calls.size(), 1u);
  EXPECT_EQ(program.path.tool_calls[0].number, 1);
  EXPECT_TRUE(program.turning);
}

TEST(Turning, OnePartInThreeDialectsIsOnePath) {
  const std::vector<std::pair<Dialect, std::string>> programs = {
      {Dialect::Fanuc,
       "O1\nG21 G18 G40 G99\nG28 U0 W0\nT0101\nG50 S3000\nG96 S200 M03\nG0 X64. Z2.\n"
       "G1 X-1. F0.15\nG0 W3.\nX50. Z1.\nG1 Z-20. F0.25\nG2 X60. Z-25. R5.\nG1 U4. W-2.\n"
       "G3 X74. Z-32. I0 K-5.\nG97 S800\nG98 G1 X76. F120.\nG0 X80. Z60.\nM30\n"},
      {Dialect::Siemens,
       "G71 G18 G40 G95 DIAMON\nT1 D1\nLIMS=3000\nG96 S200 M3\nG0 X64 Z2\n"
       "G1 X-1 F0.15\nG0 Z=IC(3)\nX50 Z1\nG1 Z-20 F0.25\nG2 X60 Z-25 CR=5\nG1 X=IC(4) Z=IC(-2)\n"
       "G3 X74 Z-32 I0 K-5\nG97 S800\nG94 G1 X76 F120\nG0 X80 Z60\nM30\n"},
      {Dialect::LinuxCnc,
       "G21 G18 G40 G7 G95\nT1 M6 G43\nG96 D3000 S200 M3\nG0 X64 Z2\n"
       "G1 X-1 F0.15\nG91 G0 Z3\nG90 X50 Z1\nG1 Z-20 F0.25\nG2 X60 Z-25 R5\nG91 G1 X4 Z-2\n"
       "G90 G3 X74 Z-32 I0 K-5\nG97 S800\nG94 G1 X76 F120\nG0 X80 Z60\nM30\n"}};
  const Path first = read(programs[0].first, programs[0].second).path;
  ASSERT_EQ(first.blocks.size(), 10u);
  for (const auto& [dialect, text] : programs) {
    SCOPED_TRACE(name_of(dialect));
    const Path path = read(dialect, text).path;
    ASSERT_EQ(path.blocks.size(), first.blocks.size());
    for (std::size_t i = 0; i < path.blocks.size(); ++i) {
      const Block &one = path.blocks[i], &other = first.blocks[i];
      EXPECT_EQ(one.interpolation, other.interpolation) << i;
      EXPECT_LT((one.end - other.end).tail<2>().cwiseAbs().maxCoeff(), 1e-12) << i;
      EXPECT_NEAR(one.end[0], other.end[0], 1e-9 * std::abs(other.end[0])) << i;
      EXPECT_NEAR(one.end_s, other.end_s, 1e-12 * other.end_s) << i;
    }
  }
  EXPECT_EQ(first.blocks[1].end[x], -0.5);
  EXPECT_EQ(first.blocks[6].end[x], 32.0) << "increments are diameters";
}

TEST(Turning, FacingUnderConstantSurfaceSpeedTakesTheTimeOfItsIntegral) {
  const double v = 200e3 / 60, f = 0.2, max_rpm = 3000;
  const double limit = 200e3 / (2 * pi * max_rpm);  // mm, where the largest speed is reached
  ASSERT_NEAR(limit, 10.61, 0.01);
  const double expected = pi * (30.0 * 30.0 - limit * limit) / (f * v) + limit / (f * max_rpm) * 60;
  const std::vector<std::pair<Dialect, std::string>> programs = {
      {Dialect::Fanuc, "O1\nT0101\nG50 S3000\nG99 G96 S200 M3\nG0 X60. Z0\nG1 X0 F0.2\nM30\n"},
      {Dialect::Siemens, "T1 D1 DIAMON\nG96 S200 LIMS=3000 M3\nG0 X60 Z0\nG1 X0 F0.2\nM30\n"},
      {Dialect::LinuxCnc, "G7 G18 G95\nG96 D3000 S200 M3\nG0 X60 Z0\nG1 X0 F0.2\nM2\n"}};
  for (const auto& [dialect, text] : programs) {
    SCOPED_TRACE(name_of(dialect));
    const ParsedProgram program = read(dialect, text);
    EXPECT_NEAR(feed_time(program.path), expected, 1e-9);
    EXPECT_NEAR(turns_at_feed(program.path), 30.0 / f, 1e-9) << "as many as the feed asks for";
    EXPECT_EQ(assumptions_of(program).find("is not limited"), std::string::npos);
  }
}

TEST(Turning, MeanSpindleSpeedsAreThoseOfASumOverTheMove) {
  const double f = 0.3;
  struct Move {
    program::RadialMove move;
    double length;
    std::function<double(double)> radius;
  };
  std::vector<Move> moves;
  for (const auto& [from, to] : std::vector<std::pair<double, double>>{
           {30, 20}, {5, 25}, {30, 0}, {20, -3}, {-2, 2}, {1, 3}, {-20, -5}, {7, 7}, {0, 0}})
    moves.push_back(
        {{from, to}, 11.0, [from = from, to = to](double u) { return from + (to - from) * u; }});
  for (const auto& [centre, radius, start, sweep] :
       std::vector<std::array<double, 4>>{{20, 5, 0.3, 1.2},
                                          {0, 8, -0.2, 2.5},
                                          {12, 12, 2.0, -3.0},
                                          {3, 10, 1.0, 4 * pi + 1.0},
                                          {-30, 4, 5.0, -2 * pi},
                                          {2, 1, 0.0, pi}}) {
    program::RadialMove move;
    move.arc = program::RadialMove::Arc{centre, radius, start, sweep};
    const auto at = [=](double u) { return centre + radius * std::cos(start + sweep * u); };
    move.from = at(0);
    move.to = at(1);
    moves.push_back({move, radius * std::abs(sweep), at});
  }
  for (std::size_t i = 0; i < moves.size(); ++i)
    for (const double max_rpm : {1500.0, 4000.0}) {
      const Move& one = moves[i];
      const double rpm = program::mean_spindle_speed(one.move, 180, max_rpm);
      const double expected = time_by_sum(one.radius, one.length, f, 180, max_rpm);
      EXPECT_NEAR(one.length / (f * rpm) * 60, expected, 2e-9 * expected) << i;
      EXPECT_LE(rpm, max_rpm) << i;
    }
  EXPECT_EQ(program::mean_spindle_speed({30, 20}, 0, 1000), 0.0);
}

TEST(Turning, ArcsUnderConstantSurfaceSpeedCountAlongThemselves) {
  // a half circle that leaves the radius 10 and comes back to it over 20
  const Path path = read(Dialect::Fanuc,
                         "O1\nG99 G50 S4000\nG96 S100 M3\nG0 X20. Z0\n"
                         "G3 X20. Z-20. R10. F0.1\nM30\n")
                        .path;
  const double expected =
      time_by_sum([](double u) { return 10 + 10 * std::sin(pi * u); }, 10 * pi, 0.1, 100, 4000);
  EXPECT_NEAR(feed_time(path), expected, 1e-8 * expected);
}

TEST(Turning, SpindlesAreLimitedByTheMachineOrItIsSaid) {
  const std::string text = "O1\nG99 G96 S200 M3\nG0 X60. Z0\nG1 X0 F0.2\nM30\n";
  ReadOptions with = lathe_options(Dialect::Fanuc);
  with.control.max_spindle_rpm = 2500;
  const ParsedProgram limited = read_program(text, "part.nc", with);
  const double expected = time_by_sum([](double u) { return 30 * (1 - u); }, 30, 0.2, 200, 2500);
  EXPECT_NEAR(feed_time(limited.path), expected, 1e-8 * expected);
  with.control.max_spindle_rpm.reset();
  const ParsedProgram free = read_program(text, "part.nc", with);
  EXPECT_LT(feed_time(free.path), expected);
  expect_assumption(free,
                    "line 4: the spindle speed under G96 is not limited at a radius down to 0 mm");
  expect_assumption(free, "max_spindle_rpm");
}

TEST(Turning, ToolOffsetsLeadTheTipToTheSpindleLine) {
  // the tip stands 13 mm beyond the line with the axes at zero
  const std::string fanuc = "O1\nT0101\nG98 G1 X50. Z-3. F100.\nT0100\nX50.\nM30\n";
  ReadOptions with = lathe_options(Dialect::Fanuc, lathe(13));
  Path path = read_program(fanuc, "part.nc", with).path;
  EXPECT_DOUBLE_EQ(path.blocks[0].end[x], 25.0 - 13.0);
  EXPECT_DOUBLE_EQ(path.blocks[1].end[x], 25.0) << "without an offset, the slide";
  for (const auto& [dialect, text] : std::vector<std::pair<Dialect, std::string>>{
           {Dialect::Siemens, "T1 D1\nG94 G1 DIAMON X50 Z-3 F100\nSUPA X30\n"},
           {Dialect::LinuxCnc, "G18 T1 M6 G43\nG7 G1 X50 Z-3 F100\nG53 X30\n"}}) {
    SCOPED_TRACE(name_of(dialect));
    with.dialect = dialect;
    path = read_program(text, "part.nc", with).path;
    EXPECT_DOUBLE_EQ(path.blocks[0].end[x], 25.0 - 13.0);
    EXPECT_EQ(path.blocks[0].end[z], -3.0) << "a tool along X is no length along Z";
    EXPECT_DOUBLE_EQ(path.blocks[1].end[x], dialect == Dialect::Siemens ? 15.0 - 13.0 : 15.0);
  }
  with.dialect = Dialect::Fanuc;
  path = read_program("O1\nT0101\nG10 P1 X0.4 Z0.1\nG98 G1 X50. Z-3. F100.\nM30\n", "part.nc", with)
             .path;
  EXPECT_DOUBLE_EQ(path.blocks[0].end[x], 25.0 - 13.0 + 0.2) << "wear of a diameter";
  EXPECT_DOUBLE_EQ(path.blocks[0].end[z], -2.9);
}

/// Where the centre of the nose stands at the end of every block, (z, x).
std::vector<Vector2d> centres(const Path& path) {
  std::vector<Vector2d> places;
  for (const Block& block : path.blocks) places.emplace_back(block.end[z], block.end[x]);
  return places;
}

void expect_place(const Vector2d& seen, double at_z, double at_x) {
  EXPECT_NEAR(seen.x(), at_z, 1e-9);
  EXPECT_NEAR(seen.y(), at_x, 1e-9);
}

TEST(Turning, TheNoseIsLedByItsTipAndAlongContours) {
  const double r = 0.8;
  for (const auto& [dialect, text] : std::vector<std::pair<Dialect, std::string>>{
           {Dialect::Fanuc,
            "O1\nG98 G18 T0101\nG0 X40. Z5.\nG1 X50. Z-1. F100.\nG0 X60. Z5.\nG42 G1 X40. Z2.\n"
            "Z-20.\nX60. Z-30.\nG40 G1 X70. Z-30.\nM30\n"},
           {Dialect::Siemens,
            "G94 G18 DIAMON T1 D1\nG0 X40 Z5\nG1 X50 Z-1 F100\nG0 X60 Z5\nG42 G1 X40 Z2\n"
            "Z-20\nX60 Z-30\nG40 G1 X70 Z-30\nM30\n"}}) {
    SCOPED_TRACE(name_of(dialect));
    ReadOptions with = lathe_options(dialect);
    with.turning.tip_number = 3;  // X- Z- of the centre
    const std::vector<Vector2d> at = centres(read_program(text, "part.nc", with).path);
    ASSERT_GE(at.size(), 7u);
    expect_place(at[0], 5 + r, 20 + r);
    expect_place(at[1], -1 + r, 25 + r);
    // beside a cylinder of radius 20, to its right towards -Z: outside by r
    expect_place(at[3], 2, 20 + r);
    // the corner to a cone of 45 degrees is an inside one: both lines beside meet
    expect_place(at[4], -20 + r * (std::sqrt(2.0) - 1.0), 20 + r);
    expect_place(at[5], -30 + r * std::sqrt(0.5), 30 + r * std::sqrt(0.5));
    expect_place(at.back(), -30 + r, 35 + r);
  }
  ReadOptions without = lathe_options(Dialect::Fanuc);
  without.control.tool_radius.clear();
  EXPECT_HAS(all_of(input_errors("O1\nT0101\nG42 G1 X1. F0.1\n", without)), "nose radius is known");
}

TEST(Turning, CyclesOfOneCutAreExpanded) {
  const auto along = [](const std::string& text) {
    return centres(read(Dialect::Fanuc, "O1\nG98 F100.\nG0 X64. Z2.\n" + text + "M30\n").path);
  };
  const auto turned = along("G90 X60. Z-30.\nX56.\nG0 X70.\n");
  ASSERT_EQ(turned.size(), 10u);
  expect_place(turned[1], 2, 30);
  expect_place(turned[2], -30, 30);
  expect_place(turned[3], -30, 32);
  expect_place(turned[4], 2, 32);
  expect_place(turned[5], 2, 28);
  expect_place(turned[6], -30, 28);
  const auto tapered = along("G90 U-4. W-32. R-1.\n");
  expect_place(tapered[1], 2, 29);
  expect_place(tapered[2], -30, 30);
  const auto faced = along("G94 X20. Z-1.\n");
  expect_place(faced[1], -1, 32);
  expect_place(faced[2], -1, 10);
  expect_place(faced[3], 2, 10);
  expect_place(faced[4], 2, 32);
}

TEST(Turning, CoordinateSystemsAndReferencesCountInDiameters) {
  const Path path = read(Dialect::Fanuc,
                         "O1\nG98 F100.\nG0 X60. Z10.\nG50 X100. Z0\nG0 X80.\nG28 U0\n"
                         "#1=#5041\nG53 X20.\nG10 L2 P1 X2.\nG0 X10.\nG50.3 X0\nX10.\n"
                         "G0 X#1\nG4 X1.5\nM30\n")
                        .path;
  ASSERT_GE(path.blocks.size(), 7u);
  EXPECT_DOUBLE_EQ(path.blocks[1].end[x], 20.0) << "X100 is where the radius 30 was";
  EXPECT_DOUBLE_EQ(path.blocks[2].end[x], 40.0) << "home";
  EXPECT_DOUBLE_EQ(path.blocks[3].end[x], 10.0);
  EXPECT_DOUBLE_EQ(path.blocks[4].end[x], 5.0 + 1.0 - 20.0);
  EXPECT_DOUBLE_EQ(path.blocks[5].end[x], 6.0);
  EXPECT_DOUBLE_EQ(path.blocks[6].end[x], (120.0 + 2.0) / 2) << "#5041 is a diameter";
  EXPECT_EQ(path.blocks.back().interpolation, Interpolation::Dwell);
}

TEST(Turning, WhatIsNotReadIsRefusedByNameAndLine) {
  const auto refused = [](Dialect dialect, const std::string& text, const std::string& sentence) {
    const std::vector<std::string> all = input_errors(text, lathe_options(dialect));
    ASSERT_EQ(all.size(), 1u) << text << all_of(all);
    EXPECT_HAS(all[0], sentence) << text;
    EXPECT_EQ(all[0].find("part.nc:2:"), 0u) << all[0];
  };
  const auto fanuc = [&](const std::string& line, const std::string& sentence) {
    refused(Dialect::Fanuc, "O1\n" + line + "\nM30\n", sentence);
  };
  for (const char* cycle :
       {"G70 P10 Q20", "G71 U2. R0.5", "G72 W2. R0.5", "G73 U5. W5. R3", "G74 R1.", "G75 R1."})
    fanuc(cycle, "roughing, finishing and grooving cycles are not expanded");
  for (const char* thread : {"G32 Z-10. F2.", "G76 P020060 Q100 R0.05", "G92 X20. Z-10. F1.5"})
    fanuc(thread, "threads are not synchronised");
  fanuc("G83 Z-10. R2. Q1000 F0.1", "drilling cycles of a turning control");
  fanuc("G91 U2.", "G91, G93 and G95 belong to G-code systems B and C");
  fanuc("G96 M3", "S (surface speed) with G96");
  fanuc("G96 G50 S2000 M3", "S (surface speed) with G96");
  fanuc("G1 X20. U2. F0.1", "as a position or as an increment");
  fanuc("G1 X20. R2. F0.1", "are not expanded");
  fanuc("G1 X20. C1. F0.1", "are not expanded");
  fanuc("G1 X20. ,R2. F0.1", "are not expanded");
  fanuc("T12", "T with four digits");
  fanuc("G90 X20.", "X and Z in the first block");
  fanuc("G10 P10001 X2.", "the geometry of tools is that of the scene");
  fanuc("G53 U2.", "X Y Z C with G53");
  fanuc("G1 X20. V2. F0.1", "an axis of this machine (Z X)");
  fanuc("G1 X20. F1", "a decimal point in F under G20 and G99");
  for (const char* cycle : {"CYCLE95(\"PART\",2)", "CYCLE93(20,-5,4,2)", "CYCLE97(2,,0,-20,30,30)"})
    refused(Dialect::Siemens, std::string("T1\n") + cycle + "\nM30\n",
            "stock removal, grooves, undercuts and threads");
  refused(Dialect::Siemens, "T1\nG96 M3\nM30\n", "S (surface speed) with G96");
  refused(Dialect::Siemens, "DIAMON\nTRANS X2\nM30\n", "DIAMOF before X2");
  for (const char* cycle : {"G70", "G71 Q1", "G71.1 Q1", "G72 Q1"})
    refused(Dialect::LinuxCnc, std::string("G18\n") + cycle + "\nM2\n",
            "turning cycles G70 to G72 are not expanded");
  refused(Dialect::LinuxCnc, "G18\nG96 M3\nM2\n", "S (surface speed) with G96");
}

TEST(Turning, DiametersAreThoseOfTheDialect) {
  const auto end = [](const std::string& text) {
    return read(Dialect::Siemens, "G94 F100 G18 T1 D1\n" + text).path.blocks.back().end[x];
  };
  EXPECT_EQ(end("G1 X50\n"), 25.0) << "DIAMON at first";
  EXPECT_EQ(end("DIAMOF\nG1 X50\n"), 50.0);
  EXPECT_EQ(end("DIAMON\nG1 X50\nG91 X4\n"), 27.0);
  EXPECT_EQ(end("DIAM90\nG1 X50\nG91 X4\n"), 29.0);
  EXPECT_EQ(end("DIAM90\nG1 X50\nX=IC(4)\n"), 29.0);
  EXPECT_EQ(end("DIAM90\nG1 X50\nG91 X=AC(60)\n"), 30.0);
  EXPECT_EQ(end("DIAMON\nG1 X50\nR1=$AA_IW[X]\nX=R1+2\n"), 26.0);
  // I from the start is a radius, I=AC() a diameter
  const std::string to = "G1 X40 Z-25\nG3 X44 Z-39 ";
  const Path relative =
      read(Dialect::Siemens, "G94 F100 G18 T1 D1 DIAMON\n" + to + "I-6 K-8\n").path;
  const Path absolute =
      read(Dialect::Siemens, "G94 F100 G18 T1 D1 DIAMON\n" + to + "I=AC(28) K=AC(-33)\n").path;
  EXPECT_NEAR((relative.arcs[0].centre - Vector2d(-33, 14)).norm(), 0, 1e-9);
  EXPECT_NEAR((absolute.arcs[0].centre - relative.arcs[0].centre).norm(), 0, 1e-9);

  ReadOptions with = lathe_options(Dialect::LinuxCnc);
  EXPECT_EQ(read_program("G1 X50 F100\n", "a.ngc", with).path.blocks[0].end[x], 50.0);
  with.turning.x_words = XWordMeaning::Diameters;
  EXPECT_EQ(read_program("G1 X50 F100\n", "a.ngc", with).path.blocks[0].end[x], 25.0);
  with.turning.x_words = XWordMeaning::Radii;
  with.dialect = Dialect::Fanuc;
  EXPECT_EQ(read_program("G98 G1 X50. F100.\n", "a.nc", with).path.blocks[0].end[x], 50.0);
}

TEST(Turning, SiemensFeedsGoWithTheirSpeedModes) {
  const auto time = [](const std::string& modes) {
    return feed_time(
        read(Dialect::Siemens, "DIAMON T1 D1\n" + modes + "G0 X40 Z0\nG1 Z-10 F0.5\n").path);
  };
  const double rpm = 100e3 / (pi * 40);
  EXPECT_NEAR(time("G95\nG96 S100 LIMS=4000 M3\n"), 10 / (0.5 * rpm) * 60, 1e-9);
  EXPECT_NEAR(time("G95\nG961 S100 LIMS=4000 M3\n"), 10 / 0.5 * 60, 1e-9);
  EXPECT_NEAR(time("G94\nG962 S100 LIMS=4000 M3\n"), 10 / 0.5 * 60, 1e-9);
  EXPECT_NEAR(time("G94\nG97 S500 M3\n"), 10 / (0.5 * 500) * 60, 1e-9);
  EXPECT_NEAR(time("G95\nG971 S500 M3\n"), 10 / 0.5 * 60, 1e-9);
  EXPECT_NEAR(time("G95\nG972 S500 M3\n"), 10 / (0.5 * 500) * 60, 1e-9);
}

TEST(Turning, SpeedsAreKeptOverTheOtherSpeedMode) {
  const auto time = [](const std::string& text) {
    return feed_time(read(Dialect::Fanuc, "O1\nG99 G50 S4000\nG0 X40. Z0 M3\n" + text).path);
  };
  const double rpm = 100e3 / (pi * 40);
  EXPECT_NEAR(time("G96 S100\nG97 S700\nG96\nG1 Z-10. F0.5\nM30\n"), 10 / (0.5 * rpm) * 60, 1e-9);
  EXPECT_NEAR(time("G96 S100\nG1 Z-10. F0.5\nG97\nZ-20.\nM30\n"), 20 / (0.5 * rpm) * 60, 1e-9)
      << "G97 without S keeps the speed";
}

TEST(Turning, WhatATurningControlBeginsWithIsSaid) {
  const ParsedProgram fanuc = read(Dialect::Fanuc, "O1\nM3 S500\nG1 X50. F0.1\nX52.\nM30\n");
  expect_assumption(fanuc, "F per revolution (G99)");
  expect_assumption(fanuc, "X and U words are diameters");
  expect_assumption(fanuc, "line 3: no T before the first feed: the only tool is assumed");
  EXPECT_EQ(assumptions_of(fanuc).find("G90"), std::string::npos) << "there is no G91";
  const ParsedProgram siemens = read(Dialect::Siemens, "T1 D1\nM3 S500\nG1 X50 F0.1\nX52\nM30\n");
  expect_assumption(siemens, "line 3: X words are diameters (DIAMON)");
  expect_assumption(siemens, "F per revolution (G95)");
  expect_assumption(read(Dialect::LinuxCnc, "G94 F100\nG1 X50\n"),
                    "line 2: X words are radii (G8)");
  const ParsedProgram said =
      read(Dialect::Siemens, "DIAMON G95\nT1 D1\nM3 S500\nG1 X50 F0.1\nM30\n");
  EXPECT_EQ(assumptions_of(said).find("DIAMON"), std::string::npos);
  EXPECT_EQ(assumptions_of(said).find("G95"), std::string::npos);
  EXPECT_EQ(assumptions_of(read(Dialect::LinuxCnc, "G8 G94 F100\nG1 X50\n")).find("X words"),
            std::string::npos);
}

TEST(Turning, ProgramsOfTurningControlsAreOneErrorOnAMill) {
  ReadOptions mill;
  mill.control = machines::options_for(machines::three_axis());
  mill.dialect = Dialect::Fanuc;
  const std::vector<std::pair<std::string, int>> programs = {
      {"O10\nG18 G21 G40 G99\nG50 S2000\nT0101\nG96 S180 M03\nG00 X54. Z12.\nG01 Z2. F0.2\nX60. "
       "U3.\nM30\n",
       3},
      {"O1\nG28 U0 W0\nT0202\nG97 S500 M3\nG0 X50. Z2.\n", 2},
      {"O1\nG21\nG71 P10 Q20 U0.4 W0.1 F0.3\nN10 G0 X20.\nN20 X40.\n", 3},
      {"O1\n(T0101 IN A COMMENT, G50 S1)\nT0101\nG96 S100 M3\nG1 U2. F0.1\n", 3}};
  for (const auto& [text, line] : programs) {
    const std::vector<std::string> all = input_errors(text, mill);
    ASSERT_EQ(all.size(), 1u) << text << all_of(all);
    EXPECT_EQ(all[0].find(fmt::format("part.nc:{}:", line)), 0u) << all[0];
    EXPECT_HAS(all[0], "control = \"turning\"");
  }
  EXPECT_TRUE(
      input_errors("O1\nT0101 M6\nG96 S100 M3\nG97 S100\n(G50 S2000)\nM30\n", mill).empty());
  mill.turning.control_kind = ControlKind::Turning;
  EXPECT_TRUE(
      input_errors("O1\nG50 S2000\nT0101\nG97 S180 M03\nG00 X54. Z12.\nM30\n", mill).empty());
  mill.turning.control_kind = ControlKind::FromMachine;
  mill.dialect = Dialect::Siemens;
  const auto diameters = input_errors("T1 D1\nDIAMON\nG1 X5 F100\nM30\n", mill);
  ASSERT_EQ(diameters.size(), 1u);
  EXPECT_HAS(diameters[0], "X is not a diameter on a milling control");
}

TEST(Turning, ProgramsWithoutANumberAreRecognised) {
  EXPECT_EQ(detect_dialect("%\nG21 G18\nG50 S2000\nT0101\n", "a.nc").dialect, Dialect::Fanuc);
  EXPECT_EQ(detect_dialect("G18 G95\nDIAMON\nT1 D1\n", "a.nc").dialect, Dialect::Siemens);
  EXPECT_EQ(detect_dialect("G7 G18\nG64 P0.01\nG96 D2000 S100\n", "a.nc").dialect,
            Dialect::LinuxCnc);
}

TEST(Turning, AMachineWhoseXRunsAlongTheSpindleHasNoDiameters) {
  ReadOptions with;
  with.control = machines::options_for(machines::platform());
  with.dialect = Dialect::Fanuc;
  const ParsedProgram program = read_program("O1\nG98 G1 X5. Z3. F100.\nM30\n", "part.nc", with);
  EXPECT_DOUBLE_EQ(program.path.blocks[0].end[1], 5.0 - 1.0) << "its tip stands at 1 with X at 0";
  expect_assumption(program, "X and U words are radii");
}

}  // namespace
}  // namespace abbe::sim::dialects::turning_tests
