#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <iostream>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "machines.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

Path read(const std::string& text) {
  return read_nc(text, "part.ngc", test::options_for(test::gantry()));
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const BadInput& bad) {
    return bad.what();
  }
  return "accepted";
}

TEST(Nc, RefusalNamesFileLineColumnExpectedAndSeen) {
  const std::string what = refusal("G21\n(five)\nG0 X1 G5\n");
  EXPECT_TRUE(what.starts_with("part.ngc:3:7: expected a G code of this control (G0 G1 G2 G3"))
      << what;
  EXPECT_TRUE(what.ends_with("seen G5")) << what;
}

TEST(Nc, ToolCallsAreKeptWithTheirLines) {
  const Path path = read("G21 G90\nM6\nT7 M6\nG0 X1\nT8\nG1 X2 F100\nM6\nG1 X3\n");
  ASSERT_EQ(path.tool_calls.size(), 4u);
  const auto expect = [&](std::size_t i, int line, int number, bool changes, std::size_t before) {
    const ToolCall& call = path.tool_calls[i];
    EXPECT_EQ(call.line, line) << i;
    EXPECT_EQ(call.number, number) << i;
    EXPECT_EQ(call.changes, changes) << i;
    EXPECT_EQ(call.before, before) << i;
  };
  expect(0, 2, -1, true, 0);
  expect(1, 3, 7, true, 0);
  expect(2, 5, 8, false, 1);
  expect(3, 7, 8, true, 2);
}

TEST(Nc, RefusalOfAnAxisNamesTheAxesOfTheMachine) {
  EXPECT_EQ(refusal("G0 X1 B10\n"),
            "part.ngc:1:7: expected an axis of this machine (C X Y Z A), seen B10");
}

TEST(Nc, NumbersAreReadToTheNearestDouble) {
  const Path path = read("G0 X12.3456789012345 Y-0 Z+.5\nG0 X00012.\n");
  EXPECT_EQ(path.blocks[0].end[1], 12.3456789012345);
  EXPECT_EQ(path.blocks[0].end[2], 0.0);
  EXPECT_EQ(path.blocks[0].end[3], 0.5);
  EXPECT_EQ(path.blocks[1].end[1], 12.0);
}

TEST(Nc, SwitchingToTheTipKeepsTheAxesWhereTheyAre) {
  const auto machine = test::gantry();
  NcOptions options = test::options_for(machine);
  options.start << 0.4, 30, -20, 15, 0.3, 0;
  const Path path = read_nc("G43.4 H1\nG0 X1 Y2 Z3\nG49\nG0 X5\n", "t", options);
  const Eigen::Vector3d tip = machine.tool_in_workpiece(options.start).translation();
  const auto xyz = [](const AxisVector& q) { return Eigen::Vector3d(q[1], q[2], q[3]); };
  EXPECT_LT((xyz(path.blocks[0].start) - tip).norm(), 1e-12);
  EXPECT_EQ(path.blocks[1].coordinates, Coordinates::Axis);
  const Eigen::Vector3d back = machine.tool_in_workpiece(path.blocks[1].start).translation();
  EXPECT_LT((back - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
}

TEST(Nc, TipProgrammingIsRefusedWithoutItsMeans) {
  NcOptions options = test::options_for(test::gantry());
  options.control.reset();
  EXPECT_THROW(read_nc("G43.4 H1\n", "t", options), BadInput);
  EXPECT_THROW(read_nc("G43.4 H1\n", "t", test::options_for(test::platform())), BadInput);
}

TEST(Nc, BlockDeleteCanBeSwitchedOff) {
  NcOptions options = test::options_for(test::gantry());
  options.block_skip.reset();
  EXPECT_EQ(read_nc("/G0 X1\nG0 X2\n", "t", options).motion_blocks, 2);
  EXPECT_EQ(read("/G0 X1\nG0 X2\n").motion_blocks, 1);
}

TEST(Nc, WorkpieceSpindleTurnsAtConstantSpeed) {
  const Path path =
      read_nc("S150 M3\nG1 X3 F60\nM4\nG1 X4\n", "t", test::options_for(test::platform()));
  EXPECT_NEAR(path.blocks[0].end[0], 3 * 150 * 2 * pi / 60, 1e-12);
  EXPECT_NEAR(path.blocks[1].end[0], 2 * 150 * 2 * pi / 60, 1e-12);
}

TEST(Nc, FilesThatAreNoFilesAreRefused) {
  const NcOptions options = test::options_for(test::gantry());
  EXPECT_THROW(read_nc_file("/nowhere/part.ngc", options), BadInput);
  EXPECT_THROW(read_nc_file(std::filesystem::temp_directory_path(), options), BadInput);
  NcOptions small = options;
  small.max_bytes = 4;
  EXPECT_THROW(read_nc("G0 X1\n", "t", small), BadInput);
}

TEST(Nc, EmptyProgramsHaveNoBlocks) {
  EXPECT_TRUE(read("").blocks.empty());
  EXPECT_TRUE(read("%\n%\n").blocks.empty());
  EXPECT_TRUE(read("(only a comment)").blocks.empty());
}

TEST(Nc, ArcStaysOnItsCircleAndEndsAtItsEnd) {
  const Path path = read("G17 F600 G0 X10 Y0\nG3 X-6 Y8 Z4 I-10 J0\n");
  const Block& arc = path.blocks.back();
  EXPECT_EQ(position(path, arc, 0.0), arc.start);
  EXPECT_EQ(position(path, arc, 1.0), arc.end);
  for (int k = 1; k < 100; ++k) {
    const AxisVector q = position(path, arc, k / 100.0);
    EXPECT_NEAR(std::hypot(q[1], q[2]), 10.0, 1e-13);
    EXPECT_NEAR(q[3], 4.0 * k / 100, 1e-14);
  }
  const double sweep = std::atan2(8, -6);
  EXPECT_NEAR(arc.end_s - arc.start_s, std::hypot(10 * sweep, 4) / 10, 1e-12);
}

TEST(Nc, VelocityIsTheDerivativeOfPosition) {
  const Path path = read("G17 F600 G0 X10 Y0\nG3 X-6 Y8.004 Z4 C20 I-10 J0\nG1 X3 A10\n");
  for (const Block& block : path.blocks)
    for (const double u : {0.1, 0.5, 0.9}) {
      const double h = 1e-5;
      const AxisVector difference = (position(path, block, u + h) - position(path, block, u - h)) /
                                    (2 * h * (block.end_s - block.start_s));
      EXPECT_LT((difference - velocity(path, block, u)).norm(), 1e-6);
    }
}

TEST(Nc, MillionBlocksAreReadQuicklyInLittleMemory) {
  std::string text = "G21 G90 F1000\n";
  const int blocks = 1'000'000;
  for (int i = 0; i < blocks; ++i)
    text += fmt::format("G1 X{:.7f} Y{:.7f} Z{:.7f} A{:.9f} C{:.9f}\n", i * 1e-3, i * 2e-3 + 1,
                        i * 5e-4 + 2, i * 1e-5, i * 3e-5);
  const auto start = std::chrono::steady_clock::now();
  const Path path = read(text);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << seconds << " s, " << sizeof(Block) << " B a block\n";
  EXPECT_EQ(path.motion_blocks, blocks);
  EXPECT_LE(sizeof(Block), 250u);
  EXPECT_LT(seconds, 15.0);  // about one second alone on a machine
}

}  // namespace
}  // namespace abbe::sim::program
