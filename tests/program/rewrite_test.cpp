#include "sim/program/rewrite.h"

#include <gtest/gtest.h>

#include <iostream>

#include "machines.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

using Corrected = std::vector<std::vector<CorrectedPoint>>;

/// A smooth correction of every block at `parts` points, as a compensator would hand it.
Corrected corrected_at(const Path& path, int parts, double size) {
  Corrected corrected;
  for (const Block& block : path.blocks) {
    corrected.emplace_back();
    if (block.interpolation == Interpolation::Dwell) continue;
    for (int k = 1; k <= parts; ++k) {
      const double u = double(k) / parts;
      AxisVector at = position(path, block, u);
      const double t = block.start_s + u * (block.end_s - block.start_s);
      for (int j = 0; j < int(at.size()) - 1; ++j) at[j] += size * std::sin(t + j);
      corrected.back().push_back({u, at});
    }
  }
  return corrected;
}

TEST(Rewrite, NcProgramGoesThroughTheCorrectedPointsAtTheirTimes) {
  NcOptions options = test::options_for(test::gantry());
  options.work_offset[0] = AxisVector::Zero(6);
  options.work_offset[0] << 0.1, 5, 6, 7, 0, 0;
  const Path path = read_nc(
      "S500 M3\nG43.4 H1\nG0 X10 Z5 A10\nG1 X20 C30 F600\nG17 G3 X0 Y20 R30\nG4 P1.5\nG49 G1 X5 "
      "F300\nM5\nX7\n",
      "t", options);
  const int parts = 4;
  const Corrected corrected = corrected_at(path, parts, 0.02);
  const std::string text = rewritten(path, corrected, options);
  const Path again = read_nc(text, "rewritten", options);
  double off = 0.0, late = 0.0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const std::size_t count = corrected[i].empty() ? 1 : corrected[i].size();
    for (std::size_t k = 0; k < count; ++k, ++next) {
      ASSERT_LT(next, again.blocks.size()) << text;
      const Block& block = again.blocks[next];
      ASSERT_EQ(block.coordinates, path.blocks[i].coordinates);
      if (corrected[i].empty()) continue;
      off = std::max(off, (block.end - corrected[i][k].at).head(4).tail(3).cwiseAbs().maxCoeff());
      EXPECT_LE((block.end - corrected[i][k].at)(0), 0.51e-4 * units::deg);
      const double t = path.blocks[i].start_s +
                       corrected[i][k].u * (path.blocks[i].end_s - path.blocks[i].start_s);
      late = std::max(late, std::abs(block.end_s - t));
    }
  }
  EXPECT_EQ(next, again.blocks.size());
  std::cout << "off by " << off << " mm, late by " << late << " s\n";
  EXPECT_LE(off, 0.501e-4);
  EXPECT_LT(late, 2e-3);  // rapids are timed by their corrected length
  EXPECT_NEAR(again.blocks.back().end[5], path.blocks.back().end[5], 0.2);  // the spindle, rad
}

TEST(Rewrite, WithoutCorrectionsTheProgramComesBackWithinItsWords) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1.23456789\nG1 X2 Y3 F60\nC20\n", "t", options);
  const Path again = read_nc(rewritten(path, Corrected(path.blocks.size()), options), "t", options);
  ASSERT_EQ(again.blocks.size(), path.blocks.size());
  EXPECT_NEAR(again.blocks[0].end[1], 1.2346, 1e-15);
  EXPECT_EQ(again.blocks[2].end[1], 2.0);
  EXPECT_NEAR(again.blocks[2].end[0], 20 * units::deg, 1e-15);
}

TEST(Rewrite, CoarseWordsRoundToTheNearestStep) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1.0024\nX-1.0026\n", "t", options);
  const std::string text =
      rewritten(path, Corrected(2), options, {.word_mm = 5e-3, .word_rad = 1e-3});
  const Path again = read_nc(text, "t", options);
  EXPECT_EQ(again.blocks[0].end[1], 1.0);
  EXPECT_EQ(again.blocks[1].end[1], -1.005);
}

TEST(Rewrite, PvtProgramFollowsTheCorrectionSmoothly) {
  const NcOptions options = test::options_for(test::platform());
  std::string text = "time_s,X_mm,Z_mm,S_rad,X_mm_per_s,Z_mm_per_s,S_rad_per_s\n";
  for (int k = 0; k <= 40; ++k)
    text += fmt::format("{},{},0,{},0.5,0,15\n", k * 0.1, k * 0.05, k * 1.5);
  const Path path = read_pvt(text, "t", options);
  Corrected corrected;
  const auto wanted = [](double t) { return 1e-3 * std::sin(2 * t); };
  for (const Block& block : path.blocks) {
    corrected.emplace_back();
    for (const double u : {0.0, 0.5, 1.0}) {
      if (u == 0.0 && corrected.size() > 1) continue;
      AxisVector at = position(path, block, u);
      at[1] += wanted(block.start_s + u * (block.end_s - block.start_s));
      corrected.back().push_back({u, at});
    }
  }
  const Path again = read_pvt(rewritten(path, corrected, options), "t", options);
  ASSERT_EQ(again.blocks.size(), 2 * path.blocks.size());
  double off = 0.0;
  for (const Block& block : again.blocks)
    for (const double u : {0.25, 0.5, 0.75}) {
      const double t = block.start_s + u * (block.end_s - block.start_s);
      const AxisVector q = position(again, block, u);
      off = std::max(off, std::abs(q[1] - (0.5 * t + wanted(t))));
      EXPECT_NEAR(q[0], 15 * t, 1e-12);
      EXPECT_EQ(q[2], 0.0);
    }
  std::cout << "between the points off by " << off << " mm\n";
  EXPECT_LT(off, 1e-7);  // of a correction of 1e-3 mm
}

TEST(Rewrite, UncorrectedPvtComesBackBitForBit) {
  const NcOptions options = test::options_for(test::platform());
  const Path path =
      read_pvt("time_s,X_mm,X_mm_per_s\n0.1,0.3,1\n0.7,0.123456789,-2e-9\n1,4,5\n", "t", options);
  const Path again = read_pvt(rewritten(path, Corrected(2), options), "t", options);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again.blocks[i].start_s, path.blocks[i].start_s);
    EXPECT_EQ(again.blocks[i].end, path.blocks[i].end);
    EXPECT_EQ(again.cubics[i].start_velocity, path.cubics[i].start_velocity);
    EXPECT_EQ(again.cubics[i].end_velocity, path.cubics[i].end_velocity);
  }
}

TEST(Rewrite, ListsThatDoNotFitAreRefused) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc("G0 X1\n", "t", options);
  const AxisVector q = path.blocks[0].end;
  EXPECT_THROW(rewritten(path, Corrected(2), options), std::invalid_argument);
  EXPECT_THROW(rewritten(path, Corrected{{{0.5, q}}}, options), std::invalid_argument);
  EXPECT_THROW(rewritten(path, Corrected{{{0.5, q}, {0.4, q}, {1, q}}}, options),
               std::invalid_argument);
  EXPECT_THROW(rewritten(path, Corrected{{{1, AxisVector::Zero(2)}}}, options),
               std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::program
