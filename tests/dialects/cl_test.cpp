#include "kinematics/inverse_kinematics.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/program/sample.h"
#include "tests/injured.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects::cl_tests {
namespace {

namespace cl_machines = program::test;
using cl_machines::Chain;
using cl_machines::Motion;
using cl_machines::Pose;
using cl_machines::Side;

ReadOptions cl_options(const Chain& chain = cl_machines::gantry()) {
  ReadOptions options;
  options.control = cl_machines::options_for(chain);
  options.dialect = Dialect::Cl;
  return options;
}

ParsedProgram read_locations(const std::string& text, const ReadOptions& options = cl_options()) {
  return read_program(text, "part.cl", options);
}

std::string cl_fault(const std::string& text, const ReadOptions& options = cl_options()) {
  return thrown_text<BadInput>([&] { read_locations(text, options); }, "accepted");
}

/// Table and trunnion: w C' A' b Y X Z s t.
Chain trunnion() {
  using namespace cl_machines;
  Pose T_bw = Pose::Identity();
  T_bw.translation() = Vector3d(0, 0, 50);
  Pose T_bt = Pose::Identity();
  T_bt.translation() = Vector3d(0, 0, 120);
  return Chain(
      {joint('C', Side::Workpiece, Motion::Rotary, ez),
       joint('A', Side::Workpiece, Motion::Rotary, ex), joint('Y', Side::Tool, Motion::Linear, ey),
       joint('X', Side::Tool, Motion::Linear, ex), joint('Z', Side::Tool, Motion::Linear, ez),
       joint('s', Side::Tool, Motion::Spindle, ez)},
      T_bw, T_bt);
}

/// Both axes in the head, the inner one inclined by 45 degrees.
Chain nutating_head() {
  using namespace cl_machines;
  const Vector3d inclined = Vector3d(0, 1, 1).normalized();
  return Chain(
      {joint('X', Side::Tool, Motion::Linear, ex), joint('Y', Side::Tool, Motion::Linear, ey),
       joint('Z', Side::Tool, Motion::Linear, ez),
       joint('C', Side::Tool, Motion::Rotary, ez, {0, 0, 300}),
       joint('B', Side::Tool, Motion::Rotary, inclined, {0, 0, 300}),
       joint('s', Side::Tool, Motion::Spindle, ez, {0, 0, 150})},
      Pose::Identity(), Pose::Identity());
}

/// Turns a vector about an axis by Rodrigues' formula, which no module uses.
Vector3d turned(const Vector3d& v, const Vector3d& axis, double angle) {
  return v * std::cos(angle) + axis.cross(v) * std::sin(angle) +
         axis * axis.dot(v) * (1 - std::cos(angle));
}

/// Tool in the workpiece at a share of a block, by the forward chain alone.
Pose pose_at(const program::Path& path, const program::Block& block, double u, const Chain& chain) {
  const auto programmed = program::position(path, block, u);
  const auto q = kinematics::solve_slides(
      chain, programmed,
      {programmed[*chain.find('X')], programmed[*chain.find('Y')], programmed[*chain.find('Z')]});
  return chain.tool_in_workpiece(*q);
}

std::string point_text(const Vector3d& tip, const Vector3d& axis) {
  return fmt::format("GOTO/{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", tip.x(), tip.y(),
                     tip.z(), axis.x(), axis.y(), axis.z());
}

TEST(CutterLocations, TheForwardChainGivesTheProgrammedTipAndVectorOnThreeMachines) {
  std::mt19937 random(20251124);
  std::uniform_real_distribution<double> unit(-1, 1);
  double tip_off = 0.0, axis_off = 0.0, line_off = 0.0;
  int points = 0;
  for (const Chain& chain : {cl_machines::gantry(), trunnion(), nutating_head()}) {
    std::string text = "UNITS/MM\nFEDRAT/1000,MMPM\n";
    std::vector<std::pair<Vector3d, Vector3d>> wanted;
    for (int i = 0; i < 300; ++i) {
      // within 80 degrees of upright; every tenth upright, where an axis is free
      Vector3d axis(unit(random), unit(random), 0.25 + std::abs(unit(random)));
      axis.normalize();
      if (i % 10 == 0) axis = Vector3d::UnitZ();
      const Vector3d tip = 200 * Vector3d(unit(random), unit(random), unit(random));
      wanted.emplace_back(tip, axis);
      text += point_text(tip, axis);
    }
    const program::Path path = read_locations(text, cl_options(chain)).path;
    ASSERT_EQ(path.blocks.size(), wanted.size());
    for (std::size_t i = 0; i < wanted.size(); ++i, ++points) {
      const Pose T = pose_at(path, path.blocks[i], 1.0, chain);
      tip_off = std::max(tip_off, (T.translation() - wanted[i].first).norm());
      axis_off = std::max(axis_off, T.linear().col(2).cross(wanted[i].second).norm());
      if (i == 0) continue;
      const Vector3d on_line = wanted[i - 1].first + 0.3 * (wanted[i].first - wanted[i - 1].first);
      const Pose between = pose_at(path, path.blocks[i], 0.3, chain);
      line_off = std::max(line_off, (between.translation() - on_line).norm());
    }
  }
  std::cout << points << " points: tip within " << tip_off << " mm, of the line between within "
            << line_off << " mm, axis within " << axis_off << " rad\n";
  EXPECT_LT(tip_off, 1e-9);
  EXPECT_LT(line_off, 1e-9);
  EXPECT_LT(axis_off, 1e-12);
}

TEST(CutterLocations, AreTheMovesOfATipModeWithTheSameAxes) {
  const program::Path locations =
      read_locations(
          "UNITS/MM\nFEDRAT/600\nRAPID\nGOTO/10,20,30\nGOTO/10,20,0,0,0.6,0.8\n"
          "GOTO/-5,3,0,0.6,0,0.8\n")
          .path;
  std::string nc = "G21 G90 G94 G43.4 H1 F600\n";
  for (const program::Block& block : locations.blocks)
    nc += fmt::format("G{} X{:.17g} Y{:.17g} Z{:.17g} A{:.17g} C{:.17g}\n",
                      block.interpolation == program::Interpolation::Rapid ? 0 : 1, block.end[1],
                      block.end[2], block.end[3], block.end[4] / units::deg,
                      block.end[0] / units::deg);
  ReadOptions options = cl_options();
  options.dialect = Dialect::LinuxCnc;
  const program::Path same = read_program(nc, "part.ngc", options).path;
  ASSERT_EQ(same.blocks.size(), locations.blocks.size());
  for (std::size_t i = 0; i < same.blocks.size(); ++i) {
    EXPECT_LT((same.blocks[i].end - locations.blocks[i].end).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_NEAR(same.blocks[i].end_s, locations.blocks[i].end_s, 1e-12);
    EXPECT_EQ(same.blocks[i].coordinates, locations.blocks[i].coordinates);
    EXPECT_EQ(same.blocks[i].tool_length, locations.blocks[i].tool_length);
  }
}

TEST(CutterLocations, ArcsInAnyPlaneAreTheTurnedStart) {
  std::mt19937 random(77);
  std::uniform_real_distribution<double> unit(-1, 1);
  double off = 0.0, time_off = 0.0;
  const Chain chain = cl_machines::gantry();
  for (int i = 0; i < 300; ++i) {
    const Vector3d axis = i % 20 == 0 ? Vector3d(0, 0, i % 40 == 0 ? 1 : -1)
                          : i % 20 == 1
                              ? Vector3d(1, 0, 0)
                              : Vector3d(unit(random), unit(random), unit(random)).normalized();
    const Vector3d centre = 50 * Vector3d(unit(random), unit(random), unit(random));
    const double radius = 1 + 20 * std::abs(unit(random));
    const double sweep = pi * (1.0 + 0.95 * unit(random));
    const double rise = i % 3 == 0 ? 5 * unit(random) : 0.0;
    const Vector3d arm = radius * axis.unitOrthogonal();
    const auto at = [&](double u) -> Vector3d {
      return centre + turned(arm, axis, u * sweep) + u * rise * axis;
    };
    const bool nx = i % 2 == 0;  // clockwise about the opposite vector
    const Vector3d stated = nx ? Vector3d(-axis) : axis;
    const std::string word = i % 4 == 1 ? "MOVARC/" : "CIRCLE/";
    const std::string text =
        fmt::format("UNITS/MM\nFEDRAT/600\nGOTO/{:.17g},{:.17g},{:.17g}\n", at(0).x(), at(0).y(),
                    at(0).z()) +
        fmt::format("{}{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}{}\n", word,
                    centre.x(), centre.y(), centre.z(), stated.x(), stated.y(), stated.z(), radius,
                    nx                  ? ",0.06,0.5,10,0"
                    : word == "MOVARC/" ? fmt::format(",ANGLE,{:.17g}", sweep / units::deg)
                                        : "") +
        fmt::format("GOTO/{:.17g},{:.17g},{:.17g}\n", at(1).x(), at(1).y(), at(1).z());
    const program::Path path = read_locations(text).path;
    ASSERT_EQ(path.blocks.size(), 2u) << text;
    const program::Block& block = path.blocks.back();
    ASSERT_EQ(block.interpolation, program::Interpolation::Arc);
    for (const double u : {0.0, 0.11, 0.5, 0.83, 1.0})
      off = std::max(off, (pose_at(path, block, u, chain).translation() - at(u)).norm());
    const double length = std::hypot(radius * sweep, rise);
    time_off = std::max(time_off, std::abs(block.end_s - block.start_s - length / 10.0));
  }
  std::cout << "300 arcs: within " << off << " mm of the turned start, " << time_off << " s\n";
  EXPECT_LT(off, 1e-9);
  EXPECT_LT(time_off, 1e-9);
}

TEST(CutterLocations, ATableAndStatementsAreTheSameBits) {
  const ParsedProgram statements = read_locations(
      "UNITS/MM\nRAPID\nGOTO/1,2,30\nFEDRAT/500\nGOTO/1,2,0,0,0.6,0.8\nGOTO/3.5,2,0\n");
  for (const std::string table :
       {"x,y,z,i,j,k,feed\n1,2,30,0,0,1,500\n1,2,0,0,.6,.8,500\n3.5,2,0,0,.6,.8,500\n",
        "1 2 30 0 0 1 500\n1 2 0 0 0.6 0.8 500\n3.5 2 0 0 0.6 0.8 500\n",
        "# made\r\nFEED;X_mm;Y_mm;Z_mm;i;j;k\r\n500;1;2;30;0;0;1\r\n;1;2;0;0;6e-1;0.8\r\n"
        ";3.5;2;0;0;0.6;0.8\r\n"}) {
    SCOPED_TRACE(table);
    const ParsedProgram read = read_locations(table);
    ASSERT_EQ(read.path.blocks.size(), statements.path.blocks.size());
    for (std::size_t i = 0; i < read.path.blocks.size(); ++i) {
      EXPECT_EQ(read.path.blocks[i].end, statements.path.blocks[i].end);
      EXPECT_EQ(read.path.blocks[i].end_s, statements.path.blocks[i].end_s);
    }
    EXPECT_TRUE(read.warnings.empty());
  }
}

TEST(CutterLocations, BranchAndPoleAreThoseOfTheInverse) {
  const Chain chain = cl_machines::gantry();
  // over the pole and down on the other side: the least rotary travel is A through zero, not C
  // by half a turn
  const program::Path path = read_locations(
                                 "UNITS/MM\nFEDRAT/600\nGOTO/0,0,0,0,0.1,0.99498743710662\n"
                                 "GOTO/0,1,0,0,0,1\nGOTO/0,2,0,0,-0.1,0.99498743710662\n"
                                 "GOTO/0,3,0,0.1,0,0.99498743710662\nGOTO/1,3,0,0,0,1\n")
                                 .path;
  ASSERT_EQ(path.blocks.size(), 5u);
  EXPECT_NEAR(path.blocks[0].end[4], -std::asin(0.1), 1e-12);
  EXPECT_NEAR(path.blocks[2].end[4], std::asin(0.1), 1e-12);
  for (const std::size_t i : {0u, 1u, 2u}) EXPECT_NEAR(path.blocks[i].end[0], 0.0, 1e-12);
  EXPECT_NEAR(std::abs(path.blocks[3].end[0]), pi / 2, 1e-12);
  EXPECT_EQ(path.blocks[4].end[0], path.blocks[3].end[0]) << "C is free at the pole, and stays";
}

TEST(CutterLocations, WorkOffsetsShiftThePointsAndLeaveTheVectors) {
  ReadOptions options = cl_options();
  options.control.work_offset[0] = cl_machines::AxisVector::Zero(6);
  options.control.work_offset[0] << 90 * units::deg, 1, 2, 3, 0, 0;
  const ParsedProgram read = read_locations("UNITS/MM\nRAPID\nGOTO/10,20,30,0.6,0,0.8\n", options);
  const Pose T = pose_at(read.path, read.path.blocks[0], 1.0, cl_machines::gantry());
  EXPECT_LT((T.translation() - Vector3d(11, 22, 33)).norm(), 1e-12);
  EXPECT_LT((T.linear().col(2) - Vector3d(0.6, 0, 0.8)).norm(), 1e-12);
  ASSERT_EQ(read.warnings.size(), 1u);
  EXPECT_HAS(read.warnings[0], "work offset of a rotary axis");
}

TEST(CutterLocations, WhatCannotBeDoneIsRefusedByName) {
  const std::string head = "UNITS/MM\nFEDRAT/600\n";
  EXPECT_EQ(cl_fault("GOTO/1,2,3\n"),
            "part.cl:1:1: expected FEDRAT/ before the first move at feed, seen none");
  EXPECT_EQ(
      cl_fault(head + "GOTO/1,2,3,0,0,2\n"),
      "part.cl:3:12: expected a tool vector of length 1 within 0.001, seen 0 0 2, of length 2");
  EXPECT_EQ(cl_fault(head + "GOTO/1,2\n"),
            "part.cl:3:1: expected x,y,z or x,y,z,i,j,k after GOTO, seen 2 values");
  EXPECT_EQ(cl_fault(head + "GOTO/1,\n  2,$\n"),
            "part.cl:3:7: expected a value after the last comma, seen none\npart.cl:4:3: expected "
            "a word at the start of the statement, seen 2,$");
  EXPECT_EQ(cl_fault(head + "CYCLE/DEEP,10\nP1=POINT/1,2,3\n"),
            "part.cl:3:7: expected CYCLE/DRILL or explicit moves: other cycles are not expanded, "
            "seen DEEP\npart.cl:4:1: expected processed statements: an APT source with definitions "
            "must be processed first, seen a definition");
  EXPECT_EQ(cl_fault(head + "GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,9,.06,.5,1,0\nGOTO/0,10,0\n"),
            "part.cl:5:1: expected the start of the arc 9 mm from the axis of CIRCLE/ of line 4, "
            "seen 10 mm");
  EXPECT_EQ(cl_fault(head + "GOTO/10,0,0\nMOVARC/0,0,0,0,0,1,10,ANGLE,80\nGOTO/0,10,0\n"),
            "part.cl:5:1: expected the end of an arc of 80 deg, as stated by MOVARC/ on line 4, "
            "seen an arc of 90 deg");
  EXPECT_EQ(
      cl_fault(head + "GOTO/10,0,0\nCIRCLE/0,0,0,0,0,-1,10\nGOTO/0,10,0\nGOTO/-10,0,0\n"),
      "part.cl:6:1: expected points that go around the CIRCLE/ of line 4 at most once, "
      "counter-clockwise about its vector, seen 540 deg: the vector seems to point the other way");
  EXPECT_EQ(
      cl_fault("UNITS/MM\nFEDRAT/600\nMULTAX/OFF\nGOTO/0,0,0,0,.6,.8\n"),
      "part.cl:4:12: expected MULTAX/ON before a tool vector other than 0,0,1, seen 0 0.6 0.8");
  EXPECT_EQ(cl_fault(head + "GOTO/0,0,0,0,.6,.8\n", cl_options(cl_machines::three_axis())),
            "part.cl:3:1: expected a tool vector within reach of the machine axes (X Y Z), seen 0 "
            "0.6 0.8");
  EXPECT_EQ(cl_fault(head + "GOTO/0,0,0\n", cl_options(cl_machines::platform())),
            "part.cl:3:1: expected a machine with the axes X Y Z for GOTO, seen one with X Z");
}

TEST(CutterLocations, ALongArcWhoseSenseIsInDoubtIsWarnedOfWithBothReadings) {
  const ParsedProgram read =
      read_locations("UNITS/MM\nFEDRAT/600\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,-1,10\nGOTO/0,10,0\n");
  ASSERT_EQ(read.warnings.size(), 1u);
  EXPECT_EQ(read.warnings[0],
            "the arc of line 5 is taken counter-clockwise about the vector of its CIRCLE/, 270 "
            "deg; if the CAM system means clockwise, it is 90 deg the other way");
}

TEST(CutterLocations, UnknownWordsAreSkippedAndCountedOnDemand) {
  ReadOptions options = cl_options();
  options.on_unknown = UnknownWordPolicy::Warn;
  const ParsedProgram read = read_locations(
      "UNITS/MM\nFEDRAT/600,LOCK\nGOTO/1,2,3\nPOLISH/ON\nGOTO/2,2,3\nPOLISH/OFF\n", options);
  ASSERT_EQ(read.skipped.size(), 2u);
  EXPECT_EQ(read.skipped[0].word, "FEDRAT/LOCK");
  EXPECT_EQ(read.skipped[1].word, "POLISH");
  EXPECT_EQ(read.skipped[1].count, 2u);
  EXPECT_EQ(read.path.motion_blocks, 2);
}

TEST(CutterLocations, ToolsOfTheProgramAreNotedInMm) {
  const program::Path path =
      read_locations("UNITS/INCHES\nCUTTER/0.5,0.25\nLOADTL/7\nFEDRAT/10\nGOTO/1,0,0\n").path;
  ASSERT_EQ(path.tool_comments.size(), 1u);
  EXPECT_DOUBLE_EQ(path.tool_comments[0].words.diameter, 12.7);
  EXPECT_DOUBLE_EQ(*path.tool_comments[0].words.corner_radius, 6.35);
  ASSERT_EQ(path.tool_calls.size(), 1u);
  EXPECT_EQ(path.tool_calls[0].number, 7);
  EXPECT_TRUE(path.tool_calls[0].changes);
  EXPECT_DOUBLE_EQ(path.blocks[0].end_s, 25.4 * 60 / 254);
}

TEST(CutterLocations, NoiseAndDamageAreReadOrRefusedWithAPlace) {
  namespace fs = std::filesystem;
  std::vector<std::string> seeds = {"x,y,z,i,j,k,feed\n1,2,30,0,0,1,500\n1,2,0,0,.6,.8,500\n"};
  for (const auto& folder : fs::directory_iterator(ABBE_SOURCE_DIR "/tests/golden"))
    if (folder.path().filename().string().starts_with("cl_"))
      seeds.push_back(cl_machines::file_text((folder.path() / "program.nc").string()));
  ASSERT_GE(seeds.size(), 6u);
  std::sort(seeds.begin(), seeds.end());
  std::mt19937 random(4711);
  const std::string fodder = "GOTO/CIRCLE,$.-+0123456789eE \n\r\t;#=()\0\xff";
  std::uniform_int_distribution<int> any(0, 255);
  int read = 0, refused = 0;
  for (int i = 0; i < 6000; ++i) {
    std::string text;
    if (i % 6 == 0)
      for (int k = any(random); k > 0; --k)
        text += i % 12 == 0 ? char(any(random)) : fodder[std::size_t(any(random)) % fodder.size()];
    else
      text = injured(seeds[std::size_t(i) % seeds.size()], fodder, 6, random);
    try {
      const ParsedProgram done = read_locations(text);
      for (const program::Block& block : done.path.blocks) {
        ASSERT_TRUE(block.start.allFinite() && block.end.allFinite()) << text;
        ASSERT_GE(block.end_s, block.start_s) << text;
      }
      ++read;
    } catch (const BadProgram& bad) {
      for (const BadInput& fault : bad.input_errors) ASSERT_GE(fault.line, 1) << text;
      ++refused;
    }
  }
  std::cout << read << " read, " << refused << " refused\n";
  EXPECT_GT(read, 300);
  EXPECT_GT(refused, 1000);
}

TEST(CutterLocations, HugeStatementsAreRefusedInBoundedTime) {
  std::string many = "GOTO/1";
  for (int i = 0; i < 100000; ++i) many += ",1";
  EXPECT_HAS(cl_fault(many + "\n"), "at most 1000 values");
  std::string lines = "GOTO/1,$\n";
  for (int i = 0; i < 100000; ++i) lines += "$\n";
  EXPECT_HAS(cl_fault(lines), "at most 200 lines");
  ReadOptions options = cl_options();
  options.limits.blocks = 100;
  std::string long_program;
  for (int i = 0; i < 200; ++i) long_program += "REMARK\n";
  EXPECT_HAS(cl_fault(long_program, options), "at most 100 blocks");
}

}  // namespace
}  // namespace abbe::sim::dialects::cl_tests
