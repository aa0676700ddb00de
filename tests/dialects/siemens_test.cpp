#include "kinematics/inverse_kinematics.h"

#include "sim/dialects/read_options.h"
#include "sim/dialects/siemens/siemens.h"
#include "sim/dialects/tool_vectors.h"
#include "tests/dialects/siemens_reading.h"
#include "tests/test.h"

namespace abbe::sim::dialects::siemens_tests {
namespace {
namespace machines = program::test;
using siemens_test::siemens_options;
using siemens_test::siemens_path;
using siemens_test::siemens_refusal;

TEST(Siemens, PecksAddUpAndShrinkAsTheyShould) {
  using siemens::peck_depths;
  // strokes 50, 30, 20 and the rest of 45 in two; then a factor; then pecks of one length
  EXPECT_EQ(peck_depths(145, {50, 20, 0}), (std::vector<double>{50, 80, 100, 120, 132.5, 145}));
  EXPECT_EQ(peck_depths(25, {10, 4, 0}), (std::vector<double>{10, 16, 20, 22.5, 25}));
  EXPECT_EQ(peck_depths(30, {16, -0.5, 3}), (std::vector<double>{16, 24, 28, 30}));
  EXPECT_EQ(peck_depths(12, {5, 0, 0}), (std::vector<double>{5, 10, 12}));
  EXPECT_TRUE(peck_depths(1000, {1e-3, 0, 0}).empty());
  EXPECT_TRUE(peck_depths(30, {1, -0.5, 0}).empty()) << "pecks that shrink to nothing";
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.1, 1);
  for (int n = 0; n < 1000; ++n) {
    const double total = 100 * unit(random), first = total * unit(random);
    const double by = first * unit(random);
    const auto depths = peck_depths(total, {first, by, 0});
    ASSERT_FALSE(depths.empty());
    EXPECT_EQ(depths.back(), total);
    for (std::size_t i = 1; i < depths.size(); ++i) {
      EXPECT_GT(depths[i], depths[i - 1]);
      EXPECT_LE(depths[i] - depths[i - 1], std::max(first, by) + 1e-9);
    }
  }
}

double siemens_value(const std::string& expression) {
  const program::Path path =
      siemens_path("DEF INT WHOLE=7\nT1 D1 G90 G0 X0.125\nR1=3 R2=-2 X=" + expression + "\n");
  return path.blocks.back().end[1];
}

TEST(Siemens, OperatorsBindAsTheControlHasThem) {
  EXPECT_EQ(siemens_value("1+2*3"), 7.0);
  EXPECT_EQ(siemens_value("7 DIV 2*2"), 6.0);
  EXPECT_EQ(siemens_value("7 MOD 4+1"), 4.0);
  EXPECT_EQ(siemens_value("WHOLE/2"), 3.5);
  EXPECT_EQ(siemens_value("R1==3"), 1.0);
  EXPECT_EQ(siemens_value("1+(R1>2 AND R2<0)"), 1.0)
      << "comparisons bind least: R1 > (2 AND R2) < 0";
  EXPECT_EQ(siemens_value("(R1>2) AND (R2<0)"), 1.0);
  EXPECT_EQ(siemens_value("(1 OR 0 AND 0)+1"), 2.0);
  EXPECT_EQ(siemens_value("NOT 0+4"), 5.0);
  EXPECT_EQ(siemens_value("6 B_AND 3"), 2.0);
  EXPECT_EQ(siemens_value("-R2*2"), 4.0);
  EXPECT_EQ(siemens_value("POT(R1)+R[1+1]"), 7.0);
  EXPECT_EQ(siemens_value("BOUND(0,5,9)"), 5.0);
  EXPECT_NEAR(siemens_value("ATAN2(1,-1)"), 135.0, 1e-12);
  EXPECT_EQ(siemens_value("'B101'"), 5.0);
  EXPECT_EQ(siemens_value("$P_EP[X]+1"), 1.125);
  EXPECT_EQ(siemens_value("5 ORIAXES"), 5.0) << "a word that begins as an operator does";
}

TEST(Siemens, WhatNeverEndsEndsInBoundedTime) {
  ReadOptions with = siemens_options();
  with.limits.blocks = 10000;
  const std::string limit = "10000 blocks";
  EXPECT_HAS(siemens_refusal("A1:\nGOTOB A1\n", with), limit);
  EXPECT_HAS(siemens_refusal("LOOP\nENDLOOP\n", with), limit);
  EXPECT_HAS(siemens_refusal("FOR R1=1 TO 1000000\nENDFOR\n", with), limit);
  EXPECT_HAS(siemens_refusal("REPEAT\nUNTIL 0\n", with), limit);
  EXPECT_HAS(siemens_refusal("A1:\nREPEAT A1 P=9999\nREPEAT A1 P=9999\n", with), limit);
  EXPECT_HAS(siemens_refusal("S1 P9999\nSUB P9999\nM30\n%_N_SUB_SPF\nG4 F0\nG4 F0\nM17\n", with),
             limit);
  EXPECT_HAS(siemens_refusal("SUB\n%_N_SUB_SPF\nSUB\n"), "50 nested calls");
  EXPECT_HAS(siemens_refusal("MCALL SUB\nG91 G0 X1\nM30\n%_N_SUB_SPF\nX1\nSUB\nM17\n"),
             "50 nested calls");
  EXPECT_HAS(siemens_refusal("R1=" + std::string(3000, '(') + "\n"), "100 nested brackets");
  EXPECT_HAS(siemens_refusal("R1=" + std::string(3000, '-') + "R2\n"), "100 nested brackets");
  EXPECT_HAS(siemens_refusal("X" + std::string(10000, '1') + "\n"), "4096 characters");
  with.limits.variables = 10;
  EXPECT_HAS(siemens_refusal("FOR R1=1 TO 100\nR[R1+10]=1\nENDFOR\n", with), "10 variables");
}

TEST(Siemens, SubprogramsStandInFilesBesideTheProgram) {
  const fs::path folder = fs::temp_directory_path() / "abbe_siemens_subs";
  fs::create_directories(folder);
  ReadOptions with = siemens_options();
  with.subprogram_folder = folder;
  std::ofstream(folder / "DRILL.SPF") << "%_N_DRILL_SPF\nPROC DRILL(REAL DEEP)\nG0 X=DEEP\nG58\n";
  EXPECT_HAS(siemens_refusal("DRILL(5)\n", with), "DRILL.SPF:4:1: expected TRANS");
  std::ofstream(folder / "DRILL.SPF") << "PROC DRILL(REAL DEEP)\nG0 X=DEEP\nRET\n";
  std::ofstream(folder / "l7.spf") << "G0 Y3\nM17\n";
  const program::Path path =
      read_program("T1 D1 G90\nDRILL(5)\nL7\nG0 Z1\n", "part.mpf", with).path;
  ASSERT_EQ(path.blocks.size(), 3u);
  EXPECT_EQ(path.blocks[0].file, 1);
  EXPECT_EQ(path.blocks[0].line, 2);
  EXPECT_EQ(path.blocks[1].end[2], 3.0);
  EXPECT_EQ(path.blocks[2].file, 0);
  fs::remove_all(folder);
}

TEST(Siemens, ToolsGoByNumberAndByName) {
  ReadOptions with = siemens_options(machines::three_axis());
  with.control.tool_number = {{"MILL 8", 2}};
  const auto calls = [&](const std::string& text) {
    return read_program(text, "part.mpf", with).path.tool_calls;
  };
  const auto named = calls("T=\"MILL 8\"\nM6\nG0 Z0\n");
  ASSERT_EQ(named.size(), 2u);
  EXPECT_EQ(named[1].number, 2);
  EXPECT_TRUE(named[1].changes);
  EXPECT_EQ(calls("T=\"1\" D1\n").front().number, 1);
  EXPECT_FALSE(calls("T1 D1\n").front().changes);
  // T alone selects where M6 changes: the first line still has the length of tool 1
  const program::Path path =
      read_program("T1 M6\nT2\nG0 Z0\nM6\nG0 Z=AC(0) X1\n", "part.mpf", with).path;
  EXPECT_EQ(path.blocks[0].end[2], 100.0);
  EXPECT_EQ(path.blocks[1].end[2], 50.0);
  with.control.control_by_h.emplace(2, machines::three_axis());
  EXPECT_HAS(siemens_refusal("T=\"OTHER\"\n", with), "'MILL 8'");
}

TEST(Siemens, BeforeAToolIsCalledOnlyItsLengthIsMissing) {
  ReadOptions with = siemens_options();
  with.control.control_by_h = {{1, machines::gantry()}, {2, siemens_test::low_gantry()}};
  EXPECT_EQ(siemens_refusal("SUPA G0 Z100 D0\nT1 D1\nTRAORI\nG1 X1 F100\n", with), "accepted");
  EXPECT_HAS(siemens_refusal("SUPA G0 Z100 D0\nG1 X1 F100\n", with), "a tool (T)");
  EXPECT_HAS(siemens_refusal("T1 D0\nTRAORI\nG1 X1 F100\n", with), "D1 before");
}

TEST(Siemens, UnknownWordsAreSkippedAndCountedOnDemand) {
  ReadOptions with = siemens_options();
  with.on_unknown = UnknownWordPolicy::Warn;
  const ParsedProgram read = read_program(
      "T1 D1\nG0 X1 M77\nG888 Q5\nCOOLIT(1,\"a)\",2)\nM77 SPECIAL=5 FIELD[2]=7\n", "t", with);
  ASSERT_EQ(read.skipped.size(), 6u);
  EXPECT_EQ(read.skipped[0].word, "M77");
  EXPECT_EQ(read.skipped[0].count, 2u);
  EXPECT_EQ(read.path.motion_blocks, 1);
  EXPECT_HAS(siemens_refusal("MIRROR X0\n", with), "TRANS and ROT")
      << "what is refused by name is not unknown";
}

/// Programs whose bytes are changed at random: each is read or refused with a place, in bounded
/// time.
TEST(Siemens, RandomChangesOfProgramsAreReadOrRefusedWithAPlace) {
  std::vector<std::string> programs;
  for (const auto& entry : fs::directory_iterator(std::string(ABBE_SOURCE_DIR) + "/tests/golden"))
    if (entry.path().filename().string().starts_with("siemens_"))
      programs.push_back(machines::file_text((entry.path() / "program.nc").string()));
  ASSERT_GE(programs.size(), 7u);
  ReadOptions with = siemens_options();
  with.limits.blocks = 3000;
  std::mt19937 random(20260312);
  const auto below = [&](std::size_t n) {
    return std::size_t(std::uniform_int_distribution<std::size_t>(0, n - 1)(random));
  };
  const std::string_view bytes = "XYZGMR=()[]\"',;:/%$_+-*.0123456789 \nEP\0\xff";
  const int rounds = std::getenv("ABBE_LONG") != nullptr ? 200000 : 3000;
  int read = 0, refused = 0;
  for (int n = 0; n < rounds; ++n) {
    std::string text = programs[below(programs.size())];
    for (std::size_t k = 1 + below(20); k > 0; --k) {
      const std::size_t at = below(text.size());
      switch (below(4)) {
        case 0:
          text[at] = bytes[below(bytes.size())];
          break;
        case 1:
          text.erase(at, 1 + below(5));
          break;
        case 2:
          text.insert(at, 1, bytes[below(bytes.size())]);
          break;
        default:
          text.insert(at, text.substr(below(text.size()), below(40)));
      }
    }
    try {
      read_program(text, "part.mpf", with);
      ++read;
    } catch (const BadProgram& bad) {
      ++refused;
      // behind 200 faults stands one that says so, and has no place
      for (std::size_t i = 0; i < std::min<std::size_t>(bad.input_errors.size(), 200); ++i)
        EXPECT_GE(bad.input_errors[i].line, 1) << bad.input_errors[i].what();
    }
  }
  std::cout << read << " read, " << refused << " refused\n";
  EXPECT_GT(refused, 100);
}

// 60 mm at 0.1 mm a turn and 1000 rpm are 36 s; a spindle that stands is refused.
TEST(Siemens, AddressesWithAnExtensionAreOfTheirSpindle) {
  const auto feed_s = [](const std::string& spindle) {
    const program::Path path =
        siemens_path("G71 G90 T1 D1\n" + spindle + "\nG0 X0 Y0\nG95 G1 X60 F0.1\nM30\n");
    return path.blocks.back().end_s - path.blocks.back().start_s;
  };
  for (const char* spindle :
       {"S1000 M3", "S1=1000 M1=3", "M1=3 S1=1000", "S[1]=1000 M[1]=3", "R1=1\nS[R1]=1000 M[R1]=3",
        "S0=1000 M0=4", "S=1000 M=3", "S2=1000 M2=3\nSETMS(2)", "SETMS(3)\nS3=1000 M3=3",
        "S2=700 M2=4 S1000 M3", "SETMS(2)\nS2=1 M2=4\nSETMS\nS1=1000 M1=4"})
    EXPECT_NEAR(feed_s(spindle), 36.0, 1e-9) << spindle;
  const std::string moves = "\nG0 X0 Y0\nG95 G1 X60 F0.1\n";
  for (const char* spindle :
       {"S2=1000 M2=3", "S1=1000 M2=3", "S2=1000 M1=3", "SETMS(2)\nS1=9 M1=3"})
    EXPECT_NE(siemens_refusal("G71 G90 T1 D1\n" + std::string(spindle) + moves), "accepted")
        << spindle << ": the master spindle stands";
}

TEST(Siemens, AnotherSpindleIsSaidOnce) {
  const ParsedProgram read = read_program(
      "G71 G90 T1 D1 S500 M3\nS2=1000\nM2=3\nM2=5\nG0 X1\nM30\n", "part.mpf", siemens_options());
  int said = 0;
  for (const std::string& warning : read.warnings)
    said += warning.find("part.mpf:2: S2=1000 is for spindle 2 and has no effect") == 0;
  EXPECT_EQ(said, 1);
}

TEST(Siemens, ExtensionsOfOtherAddresses) {
  EXPECT_EQ(siemens_path("G71 T1=1 D1\nH1=5 H[2]=7 G0 X4\n").blocks.back().end[1], 4.0);
  EXPECT_HAS(siemens_refusal("T2=1\n"), "one tool holder");
  EXPECT_HAS(siemens_refusal("D1=1\n"), "D without an extension");
  EXPECT_HAS(siemens_refusal("F2=100\n"), "the path feed");
  EXPECT_HAS(siemens_refusal("M1=30\n"), "M30 without an extension");
  EXPECT_HAS(siemens_refusal("M2=6\n"), "only M3, M4 or M5 for a spindle other than 1");
  EXPECT_HAS(siemens_refusal("S[1.5]=6\n"), "an integer");
  EXPECT_HAS(siemens_refusal("S1=5 S6\n"), "one spindle speed");
}

}  // namespace
}  // namespace abbe::sim::dialects::siemens_tests

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;
using Eigen::Quaterniond;
using kinematics::AxisVector;
using siemens_test::low_gantry;
using siemens_test::siemens_options;
using siemens_test::siemens_path;
using siemens_test::siemens_refusal;

/// Pose of the tool in the workpiece at the end of a block, by the machine's forward chain.
kinematics::Pose pose_at_end(const program::Block& block, const machines::Chain& chain) {
  if (block.coordinates == program::Coordinates::Axis) return chain.tool_in_workpiece(block.end);
  const auto q =
      kinematics::solve_slides(chain, block.end, {block.end[1], block.end[2], block.end[3]});
  return chain.tool_in_workpiece(*q);
}

Vector3d random_vector(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> any(-size, size);
  return {any(random), any(random), any(random)};
}

TEST(SiemensGeometry, SwivelledPlanesAreThoseOfQuaternions) {
  std::mt19937 random(20260311);
  std::uniform_int_distribution<int> axis(1, 3);
  double worst_mm = 0.0, worst_rad = 0.0;
  int swivelled = 0;
  for (int n = 0; n < 300; ++n) {
    const bool solid = n % 4 == 0;
    const Eigen::Vector3i order(axis(random), axis(random), axis(random));
    const Vector3d first = random_vector(random, 100), angles = random_vector(random, 45),
                   then = random_vector(random, 50), point = random_vector(random, 80);
    const int mode = solid ? 64 : order[0] + 4 * order[1] + 16 * order[2];
    const std::string text = fmt::format(
        "T1 D1 G90 G0 X0 Y0 Z0\nCYCLE800(0,\"A\",0,{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},"
        "{:.17g},{:.17g},{:.17g},{:.17g},{})\nG1 X{:.9f} Y{:.9f} Z{:.9f} F1000\n",
        mode, first[0], first[1], first[2], angles[0], angles[1], angles[2], then[0], then[1],
        then[2], n % 2 == 0 ? 1 : -1, point[0], point[1], point[2]);
    const machines::Chain chain = low_gantry();
    const program::Path path = siemens_path(text, chain);
    const auto about = [](int k, double deg) {
      return Quaterniond(Eigen::AngleAxisd(deg * units::deg, Vector3d::Unit(k)));
    };
    const Quaterniond turn = solid
                                 ? about(2, angles[0]) * about(1, angles[1])
                                 : about(order[0] - 1, angles[0]) * about(order[1] - 1, angles[1]) *
                                       about(order[2] - 1, angles[2]);
    const kinematics::Pose T_wt = pose_at_end(path.blocks.back(), chain);
    const Vector3d normal = turn * Vector3d::UnitZ();
    worst_mm = std::max(worst_mm, (T_wt.translation() - (first + turn * (then + point))).norm());
    worst_rad = std::max(worst_rad, (T_wt.linear().col(2) - normal).norm());
    const double a = path.blocks.back().end[4];
    if (normal.head<2>().norm() > 1e-6) {
      EXPECT_EQ(a > 0, n % 2 == 0) << "the head is the first rotary axis";
    }
    ++swivelled;
  }
  std::cout << swivelled << " planes: " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 2e-9);  // nine digits of the words
  EXPECT_LT(worst_rad, 1e-11);
}

TEST(SiemensGeometry, AWorkOffsetIsOnePlaceWithAndWithoutTransformation) {
  const machines::Chain chain = low_gantry();
  ReadOptions with = siemens_options(chain);
  with.control.work_offset[1] = AxisVector::Zero(6);
  with.control.work_offset[1] << 0, 11, 12, 13, 0, 0;
  const auto ends_at = [&](const std::string& how) {
    const std::string text = "T1 D1 G90 G55\n" + how + "G1 X1 Y2 Z3 F100\n";
    const program::Path path = read_program(text, "part.mpf", with).path;
    return Vector3d(pose_at_end(path.blocks.back(), chain).translation());
  };
  const Vector3d wanted(12, 14, 16);
  EXPECT_LT((ends_at("") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("TRAORI\n") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("CYCLE800(0,\"A\",0,57,0,0,0,0,0,0,0,0,0,-1)\n") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("TRAORI\nG1 X5 A30 F100\nTRAFOOF\nG1 A0\n") - wanted).norm(), 1e-12);
}

TEST(SiemensGeometry, ToolVectorsPointTheToolOfTheForwardChain) {
  std::mt19937 random(5);
  const machines::Chain chain = low_gantry();
  double worst_mm = 0.0, worst_rad = 0.0;
  for (int n = 0; n < 200; ++n) {
    Vector3d direction = random_vector(random, 1);
    direction.z() = std::abs(direction.z()) + 0.1;
    const Vector3d tip = random_vector(random, 100);
    const Vector3d frame_deg = random_vector(random, 20), shift = random_vector(random, 30);
    const std::string text = fmt::format(
        "T1 D1 G90 TRAORI ORIAXES\nTRANS X={:.17g} Y={:.17g} Z={:.17g}\nAROT X={:.17g} Y={:.17g} "
        "Z={:.17g}\nG1 X={:.17g} Y={:.17g} Z={:.17g} A3={:.17g} B3={:.17g} C3={:.17g} F1000\n",
        shift[0], shift[1], shift[2], frame_deg[0], frame_deg[1], frame_deg[2], tip[0], tip[1],
        tip[2], direction[0], direction[1], direction[2]);
    const program::Path path = siemens_path(text, chain);
    const auto about = [&](int k) {
      return Quaterniond(Eigen::AngleAxisd(frame_deg[k] * units::deg, Vector3d::Unit(k)));
    };
    const Quaterniond turn = about(2) * about(1) * about(0);  // RPY: Z, then Y, then X
    const kinematics::Pose T_wt = pose_at_end(path.blocks.back(), chain);
    worst_mm = std::max(worst_mm, (T_wt.translation() - (shift + turn * tip)).norm());
    worst_rad = std::max(worst_rad, (T_wt.linear().col(2) - turn * direction.normalized()).norm());
  }
  std::cout << "worst " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 1e-9);
  EXPECT_LT(worst_rad, 1e-11);
}

TEST(SiemensGeometry, LinesTurnTheToolOnGreatCirclesWithinAMicroradian) {
  std::mt19937 random(17);
  const machines::Chain chain = machines::gantry();
  const OrientationKinematics turning(chain);
  std::uniform_real_distribution<double> tilt(5, 60), round(-20, 20), turn(-3, 3);
  double worst = 0.0;
  std::size_t pieces = 0, most = 0;
  for (int n = 0; n < 100; ++n) {
    AxisVector from = AxisVector::Zero(6), to = from;
    from[4] = tilt(random) * units::deg;
    from[0] = round(random) * units::deg;
    to[4] = from[4] + turn(random) * units::deg;
    to[0] = from[0] + 3 * turn(random) * units::deg;
    const auto all = great_circle_segments(turning, from, to, 1e-6);
    ASSERT_FALSE(all.empty());
    pieces += all.size();
    most = std::max(most, all.size());
    EXPECT_EQ(all.back().q, to);
    const Vector3d a = chain.tool_in_workpiece(from).linear().col(2);
    const Vector3d b = chain.tool_in_workpiece(to).linear().col(2);
    const Quaterniond whole = Quaterniond::FromTwoVectors(a, b);
    AxisVector here = from;
    double done = 0.0;
    for (const auto& piece : all) {
      for (int k = 0; k <= 16; ++k) {
        const double u = k / 16.0, fraction = done + u * (piece.fraction - done);
        const Vector3d seen =
            chain.tool_in_workpiece(AxisVector(here + u * (piece.q - here))).linear().col(2);
        const Vector3d wanted = Quaterniond::Identity().slerp(fraction, whole) * a;
        worst = std::max(worst, (seen - wanted).norm());
      }
      here = piece.q;
      done = piece.fraction;
    }
  }
  std::cout << "worst " << worst * 1e6 << " urad, " << pieces << " pieces of 100 lines, at most "
            << most << "\n";
  EXPECT_LT(worst, 1.02e-6);  // between the quarters at which it is held
  AxisVector through = AxisVector::Zero(6), pole = through;
  through[4] = 30 * units::deg;
  pole[4] = 30 * units::deg;
  pole[0] = pi;
  EXPECT_TRUE(great_circle_segments(turning, through, pole, 1e-6).empty())
      << "it runs through the pole, where C would have to jump";
}

TEST(SiemensGeometry, ArcsAreThoseOfClosedForms) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-50, 50), angle(5, 355);
  double worst = 0.0;
  for (int n = 0; n < 300; ++n) {
    const Vector2d start(any(random), any(random)), centre(any(random), any(random));
    const double ar = angle(random);
    const bool clockwise = n % 2 == 0;
    const Eigen::Rotation2Dd turn((clockwise ? -ar : ar) * units::deg);
    const Vector2d end = centre + turn * (start - centre);
    const Vector2d middle =
        centre + Eigen::Rotation2Dd((clockwise ? -ar : ar) * units::deg / 2) * (start - centre);
    const double r = (start - centre).norm();
    const std::string begin =
        fmt::format("T1 D1 G90 G0 X={:.17g} Y={:.17g} Z1\n", start.x(), start.y());
    const std::string g = clockwise ? "G2" : "G3";
    const std::string to = fmt::format(" X={:.17g} Y={:.17g}", end.x(), end.y());
    for (const std::string& words :
         {g + to +
              fmt::format(" I={:.17g} J={:.17g}", centre.x() - start.x(), centre.y() - start.y()),
          g + to + fmt::format(" I=AC({:.17g}) J=AC({:.17g})", centre.x(), centre.y()),
          g + to + fmt::format(" CR={:.17g}", ar > 180 ? -r : r),
          g + to + fmt::format(" AR={:.17g}", ar),
          g + fmt::format(" AR={:.17g} I=AC({:.17g}) J=AC({:.17g})", ar, centre.x(), centre.y()),
          "CIP" + to + fmt::format(" I1={:.17g} J1={:.17g}", middle.x(), middle.y())}) {
      const program::Path path = siemens_path(begin + words + " F100\n");
      ASSERT_EQ(path.arcs.size(), 1u) << words;
      const program::Arc& arc = path.arcs[0];
      worst = std::max({worst, (arc.centre - centre).norm(), std::abs(arc.radius - r),
                        std::abs(arc.sweep - (clockwise ? -ar : ar) * units::deg) * r,
                        (path.blocks.back().end.segment<2>(1) - end).norm()});
    }
  }
  std::cout << "worst " << worst << " mm\n";
  EXPECT_LT(worst, 1e-9);
}

TEST(SiemensGeometry, ArcsThroughAPointLieInThePlaneOfTheThree) {
  std::mt19937 random(8);
  double worst = 0.0;
  for (int n = 0; n < 100; ++n) {
    const Vector3d a = random_vector(random, 50), b = random_vector(random, 50),
                   c = random_vector(random, 50);
    const program::Path path = siemens_path(fmt::format(
        "T1 D1 G90 G0 X={:.17g} Y={:.17g} Z={:.17g}\nROT Z30\nCIP X={:.17g} Y={:.17g} Z={:.17g} "
        "I1={:.17g} J1={:.17g} K1={:.17g} F100\n",
        a[0], a[1], a[2], c[0], c[1], c[2], b[0], b[1], b[2]));
    const Quaterniond frame(Eigen::AngleAxisd(30 * units::deg, Vector3d::UnitZ()));
    const Vector3d between = frame * b, end = frame * c;
    const program::Block& block = path.blocks.back();
    EXPECT_LT((Vector3d(block.end.segment<3>(1)) - end).norm(), 1e-12);
    // how near the arc comes to the point between, along its way
    double near = 1e9;
    double low = 0.0, high = 1.0;
    for (int level = 0; level < 12; ++level) {
      double best = low;
      near = 1e9;
      for (int k = 0; k <= 200; ++k) {
        const double u = low + (high - low) * k / 200;
        const double d =
            (Vector3d(program::position(path, block, u).segment<3>(1)) - between).norm();
        if (d < near) {
          near = d;
          best = u;
        }
      }
      const double half = (high - low) / 100;
      low = std::max(0.0, best - half);
      high = std::min(1.0, best + half);
    }
    worst = std::max(worst, near);
  }
  std::cout << "worst " << worst << " mm from the point between\n";
  EXPECT_LT(worst, 1e-8);
}

/// Distance of a place from a closed polygon.
double distance_from(const std::vector<Vector2d>& corners, const Vector2d& p) {
  double least = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector2d a = corners[i], side = corners[(i + 1) % corners.size()] - a;
    const double u = std::clamp((p - a).dot(side) / side.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - a - u * side).norm());
  }
  return least;
}

TEST(SiemensGeometry, CutterCompensationKeepsTheRadiusFromTheContour) {
  std::mt19937 random(23);
  ReadOptions with = siemens_options();
  with.control.tool_radius = {{1, 3.0}};
  std::uniform_real_distribution<double> size(30, 60), part(0.3, 1.0), turn(-30, 30);
  double worst = 0.0;
  for (int n = 0; n < 200; ++n) {
    const bool outside = n % 2 == 0;
    std::vector<Vector2d> corners;  // counter-clockwise, convex
    const double a = size(random), b = size(random);
    for (double angle = 0; angle < 2 * pi - 0.5; angle += part(random) + 0.2)
      corners.emplace_back(a * std::cos(angle), b * std::sin(angle));
    const Vector2d first = corners[0], middle = 0.5 * (corners[0] + corners[1]);
    const Vector2d from = middle * (outside ? 1.4 : 0.6);
    // in and out at the middle of the first side, turned by a frame of the program
    const double frame_deg = n % 3 == 0 ? turn(random) : 0.0;
    std::string text = fmt::format(
        "T1 D1 G17 G90 F1000\nROT Z={:.17g}\nG0 X={:.17g} Y={:.17g} Z0\n{} G1 X={:.17g} "
        "Y={:.17g}\n",
        frame_deg, from.x(), from.y(), outside ? "G42" : "G41", middle.x(), middle.y());
    for (std::size_t i = 1; i <= corners.size(); ++i) {
      const Vector2d& to = corners[i % corners.size()];
      text += fmt::format("X={:.17g} Y={:.17g}\n", to.x(), to.y());
    }
    text += fmt::format("X={0:.17g} Y={1:.17g}\nG40 X={2:.17g} Y={3:.17g}\n", middle.x(),
                        middle.y(), from.x(), from.y());
    const program::Path path = read_program(text, "part.mpf", with).path;
    const Eigen::Rotation2Dd frame(-frame_deg * units::deg);
    const Vector2d normal =
        Vector2d(corners[1].y() - first.y(), first.x() - corners[1].x()).normalized();
    const Vector2d upright = middle + (outside ? 3.0 : -3.0) * normal;
    ASSERT_GE(path.blocks.size(), corners.size() + 3);
    const Vector2d entered = frame * path.blocks[1].end.segment<2>(1);
    worst = std::max(worst, (entered - upright).norm());
    for (std::size_t i = 2; i + 1 < path.blocks.size(); ++i)
      for (int k = 0; k <= 10; ++k) {
        const Vector2d p = frame * program::position(path, path.blocks[i], 0.1 * k).segment<2>(1);
        worst = std::max(worst, std::abs(distance_from(corners, p) - 3.0));
      }
    EXPECT_LT((frame * path.blocks.back().end.segment<2>(1) - from).norm(), 1e-12);
  }
  std::cout << "worst " << worst << " mm\n";
  EXPECT_LT(worst, 1e-11);
  EXPECT_HAS(siemens_refusal("T1 D1 G0 X0 Y0\nROT X20\nG41 G1 X5 F100\n", with), "tilted");
}

}  // namespace
}  // namespace abbe::sim::dialects
