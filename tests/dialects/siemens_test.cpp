#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "sim/dialects/read_options.h"
#include "sim/dialects/siemens/siemens.h"
#include "tests/dialects/siemens_reading.h"

namespace abbe::sim::dialects::siemens_tests {
namespace {

namespace fs = std::filesystem;
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
  EXPECT_NE(siemens_refusal("A1:\nGOTOB A1\n", with).find(limit), std::string::npos);
  EXPECT_NE(siemens_refusal("LOOP\nENDLOOP\n", with).find(limit), std::string::npos);
  EXPECT_NE(siemens_refusal("FOR R1=1 TO 1000000\nENDFOR\n", with).find(limit), std::string::npos);
  EXPECT_NE(siemens_refusal("REPEAT\nUNTIL 0\n", with).find(limit), std::string::npos);
  EXPECT_NE(siemens_refusal("A1:\nREPEAT A1 P=9999\nREPEAT A1 P=9999\n", with).find(limit),
            std::string::npos);
  EXPECT_NE(siemens_refusal("S1 P9999\nSUB P9999\nM30\n%_N_SUB_SPF\nG4 F0\nG4 F0\nM17\n", with)
                .find(limit),
            std::string::npos);
  EXPECT_NE(siemens_refusal("SUB\n%_N_SUB_SPF\nSUB\n").find("50 nested calls"), std::string::npos);
  EXPECT_NE(siemens_refusal("MCALL SUB\nG91 G0 X1\nM30\n%_N_SUB_SPF\nX1\nSUB\nM17\n")
                .find("50 nested calls"),
            std::string::npos);
  EXPECT_NE(siemens_refusal("R1=" + std::string(3000, '(') + "\n").find("100 nested brackets"),
            std::string::npos);
  EXPECT_NE(siemens_refusal("R1=" + std::string(3000, '-') + "R2\n").find("100 nested brackets"),
            std::string::npos);
  EXPECT_NE(siemens_refusal("X" + std::string(10000, '1') + "\n").find("4096 characters"),
            std::string::npos);
  with.limits.variables = 10;
  EXPECT_NE(siemens_refusal("FOR R1=1 TO 100\nR[R1+10]=1\nENDFOR\n", with).find("10 variables"),
            std::string::npos);
}

TEST(Siemens, SubprogramsStandInFilesBesideTheProgram) {
  const fs::path folder = fs::temp_directory_path() / "abbe_siemens_subs";
  fs::create_directories(folder);
  ReadOptions with = siemens_options();
  with.subprogram_folder = folder;
  std::ofstream(folder / "DRILL.SPF") << "%_N_DRILL_SPF\nPROC DRILL(REAL DEEP)\nG0 X=DEEP\nG58\n";
  EXPECT_NE(siemens_refusal("DRILL(5)\n", with).find("DRILL.SPF:4:1: expected TRANS"),
            std::string::npos);
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
  EXPECT_NE(siemens_refusal("T=\"OTHER\"\n", with).find("'MILL 8'"), std::string::npos);
}

TEST(Siemens, BeforeAToolIsCalledOnlyItsLengthIsMissing) {
  ReadOptions with = siemens_options();
  with.control.control_by_h = {{1, machines::gantry()}, {2, siemens_test::low_gantry()}};
  EXPECT_EQ(siemens_refusal("SUPA G0 Z100 D0\nT1 D1\nTRAORI\nG1 X1 F100\n", with), "accepted");
  EXPECT_NE(siemens_refusal("SUPA G0 Z100 D0\nG1 X1 F100\n", with).find("a tool (T)"),
            std::string::npos);
  EXPECT_NE(siemens_refusal("T1 D0\nTRAORI\nG1 X1 F100\n", with).find("D1 before"),
            std::string::npos);
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
  EXPECT_NE(siemens_refusal("MIRROR X0\n", with).find("TRANS and ROT"), std::string::npos)
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
  EXPECT_NE(siemens_refusal("T2=1\n").find("one tool holder"), std::string::npos);
  EXPECT_NE(siemens_refusal("D1=1\n").find("D without an extension"), std::string::npos);
  EXPECT_NE(siemens_refusal("F2=100\n").find("the path feed"), std::string::npos);
  EXPECT_NE(siemens_refusal("M1=30\n").find("M30 without an extension"), std::string::npos);
  EXPECT_NE(siemens_refusal("M2=6\n").find("only M3, M4 or M5 for a spindle other than 1"),
            std::string::npos);
  EXPECT_NE(siemens_refusal("S[1.5]=6\n").find("an integer"), std::string::npos);
  EXPECT_NE(siemens_refusal("S1=5 S6\n").find("one spindle speed"), std::string::npos);
}

}  // namespace
}  // namespace abbe::sim::dialects::siemens_tests
