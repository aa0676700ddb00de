// What a work offset means: the rule of sim/program/README.md, held against the forward chain.

#include "sim/dialects/read_program.h"
#include "sim/program/block_motion.h"
#include "sim/program/rewrite.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects::zero_tests {
namespace {

namespace machines = program::test;
using machines::AxisVector;
using machines::Chain;

/// The chain with its workpiece and its nose somewhere else.
Chain elsewhere(const Chain& chain, const Vector3d& workpiece, const Vector3d& tip) {
  kinematics::Pose T_bw = chain.T_bw_home(), T_bt = chain.T_bt_home();
  T_bw.translation() += workpiece;
  T_bt.translation() += tip;
  return Chain(chain.joints(), T_bw, T_bt);
}

AxisVector offset_of(const Chain& chain, const Vector3d& xyz) {
  AxisVector offset = AxisVector::Zero(chain.size());
  for (int j = 0; j < chain.size(); ++j)
    if (const char name = chain.joints()[std::size_t(j)].name; name >= 'X' && name <= 'Z')
      offset[j] = xyz[name - 'X'];
  return offset;
}

program::Path path_of(const std::string& text, Dialect dialect, const program::NcOptions& control) {
  ReadOptions options;
  options.control = control;
  options.dialect = dialect;
  return read_program(text, "part.nc", options).path;
}

Vector3d tip_at_end(const program::Path& path, const Chain& chain) {
  return chain.tool_in_workpiece(program::axes_at(path, path.blocks.back(), chain, 1.0))
      .translation();
}

TEST(ProgramZero, IsOnePlaceOnTheAxesAndOnTheTip) {
  std::mt19937 random(16);
  std::uniform_real_distribution<double> any(-60, 60);
  const auto point = [&] { return Vector3d(any(random), any(random), any(random)); };
  double worst = 0.0;
  for (int n = 0; n < 200; ++n) {
    const Chain chain =
        elsewhere(n % 2 == 0 ? machines::gantry() : machines::trunnion(), point(), point());
    program::NcOptions control = machines::options_for(chain);
    const Vector3d zero_w = point(), p = point();
    control.work_offset[1] = offset_of(chain, zero_w);
    const std::string to = fmt::format("X{:.9f} Y{:.9f} Z{:.9f}", p.x(), p.y(), p.z());
    const auto lead = [&](const std::string& how, Dialect dialect) {
      const program::Path path = path_of(how + to + "\n", dialect, control);
      worst = std::max(worst, (tip_at_end(path, chain) - zero_w - p).norm());
    };
    for (const Dialect dialect : {Dialect::LinuxCnc, Dialect::Fanuc}) {
      lead("G90 G55 G43 H1 G0 ", dialect);
      lead("G90 G43 H1 G0 X1.\nG55 ", dialect);
      lead("G90 G55 G43.4 H1 G0 ", dialect);
      lead("G90 G55 G43.4 H1 G0 X1. A20. C30.\n", dialect);
      lead("G90 G55 G43.4 H1 G0 X1. A20. C30.\nG49\nG43 H1 G0 A0. C0. ", dialect);
    }
    lead("G90 G55 G43 H1\nM428\nG0 ", Dialect::LinuxCnc);
    lead("G90 G55 G43 H1\nM428\nG0 A20 C30\nM429\nG0 A0 C0\n", Dialect::LinuxCnc);
    lead("T1 D1 G90 G55 G0 ", Dialect::Siemens);
    lead("T1 D1 G90 G55\nTRAORI\nG0 ", Dialect::Siemens);
    const std::string preset =
        "TOOL CALL 1 Z S100\nCYCL DEF 247 PRESET SELECT ~\n Q339=+2 ;PRESET\n";
    const std::string klartext =
        fmt::format("L X{:+.9f} Y{:+.9f} Z{:+.9f} FMAX", p.x(), p.y(), p.z());
    for (const char* mode : {"", "M128\nL A+20 C+30 FMAX\n"})
      worst = std::max(
          worst, (tip_at_end(path_of(preset + mode + klartext + "\n", Dialect::Heidenhain, control),
                             chain) -
                  zero_w - p)
                     .norm());
  }
  std::cout << fmt::format("tip within {:.2e} mm of where the offset says\n", worst);
  EXPECT_LT(worst, 1e-9);
}

/// A program that goes to X1 Y2 Z3 of an offset of the control's table.
struct OfTable {
  const char* text;
  Dialect dialect;
  int system;  // as NcOptions::more_offset numbers it
};

TEST(ProgramZero, OffsetsOfTheControlsTableAreWhereItSays) {
  const std::string preset =
      "TOOL CALL 1 Z S100\nCYCL DEF 247 PRESET SELECT ~\n Q339=+{} ;PRESET\nL X+1 Y+2 Z+3 FMAX\n";
  const std::string preset_7 = fmt::format(fmt::runtime(preset), 7),
                    preset_9999 = fmt::format(fmt::runtime(preset), 9999);
  const OfTable all[] = {
      {"G90 G59.1 G43 H1\nG0 X1 Y2 Z3\n", Dialect::LinuxCnc, 7},
      {"G90 G59.2 G43 H1\nG0 X1 Y2 Z3\n", Dialect::LinuxCnc, 8},
      {"G90 G59.3 G43 H1\nM428\nG0 X1 Y2 Z3\n", Dialect::LinuxCnc, 9},
      {"G90 G54.1 P1 G43 H1 G0 X1. Y2. Z3.\n", Dialect::Fanuc, 101},
      {"G90 G54 P300 G43.4 H1 G0 X1. Y2. Z3.\n", Dialect::Fanuc, 400},
      {"T1 D1 G90 G507 G0 X1 Y2 Z3\n", Dialect::Siemens, 507},
      {"T1 D1 G90 G599\nTRAORI\nG0 X1 Y2 Z3\n", Dialect::Siemens, 599},
      {preset_7.c_str(), Dialect::Heidenhain, 1007},
      {preset_9999.c_str(), Dialect::Heidenhain, 10999},
  };
  const Vector3d zero_w(10, 20, 30), external_w(0.5, -0.25, 0.125);
  for (const Chain& home : {machines::gantry(), machines::trunnion()})
    for (const OfTable& one : all) {
      SCOPED_TRACE(one.text);
      const Chain chain = elsewhere(home, Vector3d(7, -4, -30), Vector3d(1, 2, 3));
      program::NcOptions control = machines::options_for(chain);
      control.extra_offsets[one.system] = offset_of(chain, zero_w);
      const auto tip_from_zero = [&] {
        const program::Path path = path_of(one.text, one.dialect, control);
        EXPECT_EQ(path.blocks.back().work_offset, one.system - 1);
        return Vector3d(tip_at_end(path, chain) - zero_w);
      };
      EXPECT_LT((tip_from_zero() - Vector3d(1, 2, 3)).norm(), 1e-9);
      if (one.dialect != Dialect::Fanuc) continue;
      control.extra_offsets[0] = offset_of(chain, external_w);
      EXPECT_LT((tip_from_zero() - external_w - Vector3d(1, 2, 3)).norm(), 1e-9);
    }
}

TEST(ProgramZero, TheExternalOffsetOfFanucIsBelowTheOthers) {
  const Chain chain = elsewhere(machines::gantry(), Vector3d(7, -4, -30), Vector3d(1, 2, 3));
  program::NcOptions control = machines::options_for(chain);
  control.extra_offsets[0] = offset_of(chain, Vector3d(0.5, -0.25, 0.125));
  for (const bool stated : {false, true}) {
    if (stated) control.work_offset[1] = offset_of(chain, Vector3d(10, 20, 30));
    const Vector3d zero_w = stated ? Vector3d(10, 20, 30) : Vector3d::Zero();
    const program::Path path = path_of("G90 G55 G43 H1 G0 X1. Y2. Z3.\n", Dialect::Fanuc, control);
    EXPECT_LT((tip_at_end(path, chain) - zero_w - Vector3d(1.5, 1.75, 3.125)).norm(), 1e-12);
  }
}

TEST(ProgramZero, AnOffsetThatTheTableHasNotIsRefused) {
  program::NcOptions control = machines::options_for(machines::gantry());
  const auto refusal = [&](const char* text, Dialect dialect) -> std::string {
    return thrown_text<BadInput>([&] { path_of(text, dialect, control); }, "read");
  };
  const auto preset = [](int number) {
    return fmt::format("TOOL CALL 1 Z S100\nCYCL DEF 247 PRESET SELECT ~\n Q339=+{} ;PRESET\n",
                       number);
  };
  control.extra_offsets[507] = control.extra_offsets[1007] = {};
  EXPECT_EQ(refusal("G508\n", Dialect::Siemens),
            "part.nc:1:1: expected G54 to G57, G505 or G506, or an offset from the control's table "
            "(`offsets`): $P_UIFR[8], seen G508");
  EXPECT_HAS(refusal("G600\n", Dialect::Siemens), "G600");
  for (const int number : {0, 8, 10'000, 32'000})
    EXPECT_HAS(refusal(preset(number).c_str(), Dialect::Heidenhain),
               "expected a preset from 1 to 6, which are G54 to G59 of the scene, or a "
               "preset of the control's table (`offsets`)")
        << number;
}

TEST(ProgramZero, WithoutALengthTheNoseGoesThere) {
  const Chain chain = elsewhere(machines::trunnion(), Vector3d(7, -4, -30), Vector3d(1, 2, 3));
  program::NcOptions control = machines::options_for(chain);
  control.work_offset[0] = offset_of(chain, Vector3d(10, 20, 30));
  for (const Dialect dialect : {Dialect::LinuxCnc, Dialect::Fanuc}) {
    const program::Path path = path_of("G90 G54 G49 G0 X1. Y2. Z3.\n", dialect, control);
    EXPECT_LT((tip_at_end(path, chain) - Vector3d(11, 22, 33 - 100)).norm(), 1e-12);
  }
  // and no offset is zero of the axes
  control.work_offset[0] = {};
  const program::Path path = path_of("G90 G54 G0 X1 Y2 Z3\n", Dialect::LinuxCnc, control);
  EXPECT_EQ(path.blocks.back().end, offset_of(chain, Vector3d(1, 2, 3)));
}

TEST(ProgramZero, IsThePositionsOfTheSlidesWithoutRotaryAxes) {
  const Chain chain = elsewhere(machines::three_axis(), Vector3d(7, -4, -30), Vector3d(1, 2, 3));
  program::NcOptions control = machines::options_for(chain);
  control.work_offset[0] = offset_of(chain, Vector3d(10, 20, -130));
  const AxisVector expected = offset_of(chain, Vector3d(11, 22, -27));
  const auto expect_there = [&](const program::Path& path) {
    const AxisVector q = program::axes_at(path, path.blocks.back(), chain, 1.0);
    EXPECT_LT((q - expected).cwiseAbs().maxCoeff(), 1e-12) << q.transpose();
  };
  for (const Dialect dialect : {Dialect::LinuxCnc, Dialect::Fanuc})
    for (const char* how : {"G43 H1", "G43.4 H1"})
      expect_there(path_of(fmt::format("G90 G54 {} G0 X1. Y2. Z3.\n", how), dialect, control));
  expect_there(path_of("T1 D1 G90 G54 G0 X1 Y2 Z3\n", Dialect::Siemens, control));
  expect_there(path_of("TOOL CALL 1 Z S100\nL X+1 Y+2 Z+3 FMAX\n", Dialect::Heidenhain, control));
  expect_there(path_of("UNITS/MM\nRAPID\nGOTO/1,2,3\n", Dialect::Cl, control));
}

TEST(ProgramZero, UnderTipKinematicsTheLengthIsThatOfTheTool) {
  const Chain chain = machines::gantry();
  const program::NcOptions control = machines::options_for(chain);
  for (const char* how : {"G43 H1\nM428\n", "M428\nG43 H1\n", "G43.4 H1\n", "M428\n"}) {
    SCOPED_TRACE(how);
    const program::Path path =
        path_of(std::string(how) + "G0 X1 Y2 Z3 A10\n", Dialect::LinuxCnc, control);
    EXPECT_EQ(path.blocks.back().coordinates, program::Coordinates::Tip);
    EXPECT_LT((tip_at_end(path, chain) - Vector3d(1, 2, 3)).norm(), 1e-12);
  }
  const std::string said =
      thrown_text<BadInput>([&] { path_of("G43 H2\nM428\n", Dialect::LinuxCnc, control); });
  EXPECT_EQ(said,
            "part.nc:2:1: expected the tool length of the scene with M428, from which the tip is "
            "computed, seen 50 mm");
}

TEST(ProgramZero, OriginsThatAreSetByPositionAreThere) {
  const Chain chain = elsewhere(machines::gantry(), Vector3d(7, -4, -30), Vector3d(1, 2, 3));
  program::NcOptions control = machines::options_for(chain);
  control.work_offset[0] = offset_of(chain, Vector3d(10, 20, 30));
  for (const char* how :
       {"G10 L20 P1 X4 Y5 Z6\n", "G92 X4 Y5 Z6\n", "G10 L2 P1 R30\nG10 L20 P1 X4 Y5 Z6\n"}) {
    SCOPED_TRACE(how);
    const program::Path path =
        path_of(fmt::format("G90 G54 G43 H1\nG0 X11 Y12 Z13\n{}G0 X4 Y5 Z6.5\n", how),
                Dialect::LinuxCnc, control);
    ASSERT_EQ(path.blocks.size(), 2u);
    const AxisVector way = path.blocks[1].end - path.blocks[0].end;
    EXPECT_LT((way - offset_of(chain, Vector3d(0, 0, 0.5))).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(ProgramZero, OfAProgramWrittenAgainIsTheSame) {
  const Chain chain = elsewhere(machines::gantry(), Vector3d(7, -4, -30), Vector3d(1, 2, 3));
  program::NcOptions control = machines::options_for(chain);
  control.work_offset[0] = offset_of(chain, Vector3d(10, 20, 30));
  const program::Path path = path_of(
      "G21 G90 G94 G54\nG43 H1\nG0 X1 Y2 Z3\nG1 X5 F600\nG2 X7 Y2 I1 J0\nG43.4 H1\nG1 X8 A10 C20\n",
      Dialect::LinuxCnc, control);
  const std::vector<std::vector<program::CorrectedPoint>> as_it_was(path.blocks.size());
  const program::RewrittenProgram again = program::rewrite_program(path, as_it_was, control, {});
  const program::Path read = path_of(again.text, Dialect::LinuxCnc, control);
  const auto ends = [&](const program::Path& one) {
    return program::axes_at(one, one.blocks.back(), chain, 1.0);
  };
  EXPECT_LT((ends(read) - ends(path)).cwiseAbs().maxCoeff(), 1e-6) << again.text;
}

}  // namespace
}  // namespace abbe::sim::dialects::zero_tests
