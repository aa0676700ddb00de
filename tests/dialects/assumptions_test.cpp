#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

/// What a reader assumes of the control and the operator, in every dialect that leaves it open.
namespace abbe::sim::dialects::assumption_tests {
namespace {

namespace machines = program::test;
using program::Assumption;
using program::BlockSkip;

ReadOptions options_of(Dialect dialect, const machines::Chain& chain = machines::gantry()) {
  ReadOptions options;
  options.control = machines::options_for(chain);
  options.control.tool_length = {{1, 100.0}};
  options.control.tool_radius = {{1, 8.0}};
  options.dialect = dialect;
  return options;
}

ParsedProgram program_of(const std::string& text, const ReadOptions& options) {
  return read_program(text, "part.nc", options);
}

std::string refusal(const std::string& text, const ReadOptions& options) {
  return thrown_text<BadInput>([&] { read_program(text, "part.nc", options); }, "accepted");
}

/// The assumptions with that key, one a line.
std::string said(const ParsedProgram& read, const std::string& key) {
  std::string text;
  for (const Assumption& assumption : read.path.assumptions)
    if (assumption.key == key) text += to_text(assumption) + "\n";
  return text;
}

struct Written {
  Dialect dialect;
  std::string text;
};

std::vector<Written> marked_programs() {
  return {{Dialect::LinuxCnc,
           "G21 G90 G17 G94\nG0 X0 Y0\n/G0 X50 Y50\n/ G1 X55 F200\nG1 X60 F200\nM2\n"},
          {Dialect::Fanuc,
           "O1\nG21 G90 G17 G94\nG0 X0. Y0.\n/G0 X50. Y50.\n/ G1 X55. F200.\nG1 X60. F200.\nM30\n"},
          {Dialect::Siemens,
           "G71 G90 G17 G94\nG0 X0 Y0\n/G0 X50 Y50\n/ G1 X55 F200\nG1 X60 F200\nM30\n"},
          {Dialect::Heidenhain,
           "0 BEGIN PGM 1 MM\n1 L X+0 Y+0 R0 FMAX\n/2 L X+50 Y+50 FMAX\n/ 3 L X+55 F200\n4 L X+60 "
           "F200\n5 END PGM 1 MM\n"}};
}

TEST(Assumptions, BlocksBehindASlashAreLeftOutOrExecutedAndSaidOnce) {
  for (const Written& written : marked_programs()) {
    SCOPED_TRACE(name_of(written.dialect));
    ReadOptions options = options_of(written.dialect);
    const ParsedProgram on = program_of(written.text, options);
    options.control.block_skip.reset();
    const ParsedProgram off = program_of(written.text, options);
    EXPECT_EQ(off.blocks, on.blocks + 2) << "blocks left out are not executed";
    EXPECT_EQ(off.path.motion_blocks, on.path.motion_blocks + 2);
    const int first = written.dialect == Dialect::Fanuc ? 4 : 3;
    EXPECT_EQ(said(on, "program.block_skip"),
              fmt::format("line {}: 2 blocks after / left out: block skip is on "
                          "(program.block_skip, --block-skip)\n",
                          first));
    EXPECT_EQ(said(off, "program.block_skip"),
              fmt::format("line {}: 2 blocks after / executed: block skip is off "
                          "(program.block_skip, --block-skip)\n",
                          first));
    const std::string unmarked = "G0 X1 Y1\n";
    if (written.dialect != Dialect::Heidenhain) {
      EXPECT_EQ(said(program_of(unmarked, options), "program.block_skip"), "");
    }
  }
}

TEST(Assumptions, BlockSkipHasLevels) {
  const std::string fanuc = "O1\nG21 G90 G0 X0. Y0.\n/X1.\n/1X2.\n/3X3.\nX4. /2Y5.\nM30\n";
  const std::string siemens = "G71 G90 G0 X0 Y0\n/X1\n/1 X2\n/3 X3\nM30\n";
  const auto ends = [](const std::string& text, Dialect dialect, const char* levels) {
    ReadOptions options = options_of(dialect);
    options.control.block_skip = *program::parse_block_skip(levels);
    std::string all;
    for (const program::Block& block : program_of(text, options).path.blocks)
      all += fmt::format("{:g},{:g} ", block.end[1], block.end[2]);
    return all;
  };
  EXPECT_EQ(ends(fanuc, Dialect::Fanuc, "off"), "1,0 2,0 3,0 4,5 ");
  EXPECT_EQ(ends(fanuc, Dialect::Fanuc, "on"), "4,0 ");
  EXPECT_EQ(ends(fanuc, Dialect::Fanuc, "1"), "3,0 4,5 ") << "/ alone is /1";
  EXPECT_EQ(ends(fanuc, Dialect::Fanuc, "2 3"), "1,0 2,0 4,0 ");
  EXPECT_EQ(ends(siemens, Dialect::Siemens, "off"), "1,0 2,0 3,0 ");
  EXPECT_EQ(ends(siemens, Dialect::Siemens, "0"), "2,0 3,0 ") << "/ alone is /0";
  EXPECT_EQ(ends(siemens, Dialect::Siemens, "1 3"), "1,0 ");
  EXPECT_FALSE(program::parse_block_skip("yes"));
  EXPECT_FALSE(program::parse_block_skip(""));
  for (const char* levels : {"on", "off", "0", "1 3"})
    EXPECT_EQ(program::to_text(*program::parse_block_skip(levels)), levels);
}

/// A circle of radius 25 around which the tool goes, with the entry at (25, -60), and where a tool
/// of radius 8 stands before it turns in.
std::vector<Written> compensated_programs() {
  return {{Dialect::LinuxCnc,
           "G21 G90 G17 G94\nG54 G0 X25 Y-60\nG42 G1 X25 Y-25 F500\nG1 Y0\nG3 X25 Y0 I-25 J0\n"
           "G1 Y25\nG40 G1 X25 Y60\nM2\n"},
          {Dialect::Fanuc,
           "O1\nG21 G90 G17 G94\nG54 G0 X25. Y-60.\nG42 G1 X25. Y-25. F500\nG1 Y0.\n"
           "G3 X25. Y0. I-25. J0.\nG1 Y25.\nG40 G1 X25. Y60.\nM30\n"},
          {Dialect::Siemens,
           "G71 G90 G17 G94\nG54 G0 X25 Y-60\nG42 G1 X25 Y-25 F500\nG1 Y0\nG3 X25 Y0 I-25 J0\n"
           "G1 Y25\nG40 G1 X25 Y60\nM30\n"},
          {Dialect::Heidenhain,
           "BEGIN PGM 1 MM\nL X+25 Y-60 R0 FMAX\nL X+25 Y-25 RR F500\nL Y+0\nCC X+0 Y+0\n"
           "C X+25 Y+0 DR+\nL Y+25\nL X+25 Y+60 R0\nEND PGM 1 MM\n"}};
}

double radius_of_circle(const ParsedProgram& read) {
  double radius = 0.0;
  for (const program::Arc& arc : read.path.arcs)
    if (std::abs(arc.sweep) > 6.0) radius = arc.radius;
  return radius;
}

TEST(Assumptions, TheOnlyToolIsTheToolWhereNoneIsCalled) {
  for (const Written& written : compensated_programs()) {
    SCOPED_TRACE(name_of(written.dialect));
    const ParsedProgram read = program_of(written.text, options_of(written.dialect));
    EXPECT_NEAR(radius_of_circle(read), 33.0, 1e-9) << "25 and the radius of the tool";
    const std::string lines = said(read, "program.startup_code");
    EXPECT_HAS(lines, "the only tool is assumed");
    EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 1) << lines;
  }
}

TEST(Assumptions, WithSeveralToolsOneMustBeCalled) {
  for (const Written& written : compensated_programs()) {
    SCOPED_TRACE(name_of(written.dialect));
    ReadOptions options = options_of(written.dialect);
    options.control.tool_length = {{1, 100.0}, {2, 50.0}};
    options.control.tool_radius = {{1, 8.0}, {2, 5.0}};
    options.control.control_by_h = {{1, machines::gantry()}, {2, machines::gantry()}};
    const std::string text = refusal(written.text, options);
    EXPECT_HAS(text, "part.nc:");
    EXPECT_TRUE(text.find("a tool call before") != std::string::npos ||
                text.find("a tool with a known radius") != std::string::npos ||
                text.find("a tool (T) before a feed") != std::string::npos)
        << text;
  }
}

TEST(Assumptions, TheLengthOfTheOnlyToolCounts) {
  const auto z_of = [](Dialect dialect, const std::string& text) {
    const ParsedProgram read = program_of(text, options_of(dialect));
    EXPECT_HAS(said(read, "program.startup_code"), "the only tool");
    return read.path.blocks.back().end[3];
  };
  EXPECT_EQ(z_of(Dialect::LinuxCnc, "G21 G90 G43\nG0 Z5\n"), 105.0);
  EXPECT_EQ(z_of(Dialect::Fanuc, "O1\nG21 G90 G43\nG0 Z5.\n"), 105.0);
  const ParsedProgram zero = program_of("O1\nG21 G90 G43 H0\nG0 Z5.\n", options_of(Dialect::Fanuc));
  EXPECT_EQ(zero.path.blocks.back().end[3], 5.0) << "H0 is said";
  EXPECT_EQ(said(zero, "program.startup_code"), "");
}

const std::string rollover_program =
    "O1\nG21 G90\nG0 C0.\nN1 G90 C-150.\nN2 G90 C540.\nN3 G90 C-620.\nN4 G91 C380.\nN5 G91 "
    "C-840.\nM30\n";

std::vector<double> turns_of(const ParsedProgram& read, int joint) {
  std::vector<double> turns;
  for (const program::Block& block : read.path.blocks)
    turns.push_back(std::round((block.end[joint] - block.start[joint]) / units::deg * 1e6) / 1e6);
  return turns;
}

TEST(Assumptions, ATableRollsOverAsTheMachineSays) {
  using program::Rollover;
  const auto turns = [](Rollover rule, Dialect dialect = Dialect::Fanuc) {
    ReadOptions options = options_of(dialect, machines::trunnion());
    options.control.axes[0].rollover = rule;
    return program_of(rollover_program, options);
  };
  const std::vector<double> shortest = {-150, -30, -80, 380, -840};
  const std::vector<double> difference = {-150, 690, -1160, 380, -840};
  const std::vector<double> sign = {-150, 330, -440 + 360, 380, -840};
  EXPECT_EQ(turns_of(turns(Rollover::Shortest), 0), shortest);
  EXPECT_EQ(turns_of(turns(Rollover::None), 0), difference);
  EXPECT_EQ(turns_of(turns(Rollover::Sign), 0), sign);
  EXPECT_EQ(said(turns(Rollover::None), "machine.axis.C.rollover"), "") << "the machine says it";
  const ParsedProgram fanuc = turns(Rollover::ByControl);
  EXPECT_EQ(turns_of(fanuc, 0), shortest);
  EXPECT_EQ(said(fanuc, "machine.axis.C.rollover"),
            "line 5: C rolls over and takes the shortest way, -30 deg; a control without roll-over "
            "turns it by 690 (machine.axis.C.rollover)\n");
  ReadOptions linuxcnc = options_of(Dialect::LinuxCnc, machines::trunnion());
  const ParsedProgram by_difference = program_of("G21 G90\nG0 C-150\nC540\nC-620\nM2\n", linuxcnc);
  EXPECT_EQ(turns_of(by_difference, 0), (std::vector<double>{-150, 690, -1160}));
  EXPECT_EQ(said(by_difference, "machine.axis.C.rollover"),
            "line 3: C turns by the difference of its positions, 690 deg; a control with roll-over "
            "turns it by -30 (machine.axis.C.rollover)\n");
}

TEST(Assumptions, OnlyATableThatTurnsWithoutEndRollsOverByItself) {
  const auto c_with_travel = [](double most, kinematics::Side side) {
    const machines::Chain chain = machines::trunnion();
    std::vector<kinematics::Joint> joints(chain.joints().begin(), chain.joints().end());
    joints[0].min = -most;
    joints[0].max = most;
    joints[0].side = side;
    return machines::Chain(joints, chain.T_bw_home(), chain.T_bt_home());
  };
  const auto turned = [&](const machines::Chain& chain) {
    return turns_of(program_of("O1\nG21 G90\nG0 C350.\nM30\n", options_of(Dialect::Fanuc, chain)),
                    0);
  };
  EXPECT_EQ(turned(c_with_travel(2 * pi, kinematics::Side::Workpiece)), std::vector<double>{350});
  EXPECT_EQ(turned(c_with_travel(200 * pi, kinematics::Side::Workpiece)), std::vector<double>{-10});
}

TEST(Assumptions, DirectionsThatAWordStatesAreKept) {
  const auto turns = [](Dialect dialect, const std::string& text) {
    ReadOptions options = options_of(dialect, machines::trunnion());
    options.control.axes[0].rollover = program::Rollover::Shortest;
    return turns_of(program_of(text, options), 0);
  };
  EXPECT_EQ(turns(Dialect::Siemens, "G71 G90 G0 C=ACP(10)\nC=ACN(20)\nC=DC(350)\nC720\n"),
            (std::vector<double>{10, -350, -30, 10}));
}

TEST(Assumptions, ModesThatNoWordStatesAreSaidInOneLine) {
  const auto line = [](Dialect dialect, const std::string& text) {
    return said(program_of(text, options_of(dialect)), "program.startup_code");
  };
  EXPECT_EQ(line(Dialect::LinuxCnc, "G0 X0 Y0 Z0 A0 C0\nG1 X1 F100\nG2 X3 Y0 I1 J0\n"),
            "line 1: no earlier word states otherwise: mm (G21), absolute (G90), plane X Y (G17), "
            "F per minute (G94) (program.startup_code, --startup-code)\n");
  EXPECT_EQ(line(Dialect::Fanuc, "O1\nX1.\n"),
            "line 2: no earlier word states otherwise: mm (G21), absolute (G90), rapid (G0) "
            "(program.startup_code, --startup-code)\n");
  EXPECT_EQ(line(Dialect::Siemens, "T1 M6 D1\nF100\nX1\n"),
            "line 3: no earlier word states otherwise: mm (G71), absolute (G90), line (G1), F per "
            "minute (G94) (program.startup_code, --startup-code)\n");
  for (const Dialect dialect : {Dialect::LinuxCnc, Dialect::Fanuc})
    EXPECT_EQ(line(dialect, "G21 G90 G17 G94\nG0 X0 Y0\n"), "") << name_of(dialect);
}

TEST(Assumptions, TheStartupCodeIsReadBeforeTheProgram) {
  const std::pair<Dialect, std::string> programs[] = {{Dialect::LinuxCnc, "G0 X10\n"},
                                                      {Dialect::Fanuc, "O1\nG0 X10.\n"},
                                                      {Dialect::Siemens, "G0 X10\n"}};
  for (const auto& [dialect, text] : programs) {
    SCOPED_TRACE(name_of(dialect));
    ReadOptions options = options_of(dialect);
    options.startup_code = dialect == Dialect::Siemens ? "G70 G90" : "G20 G90";
    const ParsedProgram read = program_of(text, options);
    EXPECT_NEAR(read.path.blocks.back().end[1], 254.0, 1e-9);
    EXPECT_EQ(said(read, "program.startup_code"), "");
    options.startup_code = "G20 G777";
    EXPECT_EQ(refusal(text, options).find("program.startup_code:1"), 0u) << refusal(text, options);
  }
  ReadOptions tnc = options_of(Dialect::Heidenhain);
  tnc.startup_code = "TOOL CALL 1 Z S1000 F500";
  const ParsedProgram called =
      program_of("BEGIN PGM 1 MM\nL X+1 Y+0 Z+0 R0 F AUTO\nEND PGM 1 MM\n", tnc);
  EXPECT_EQ(said(called, "program.startup_code"), "");
  ReadOptions cl = options_of(Dialect::Cl);
  cl.startup_code = "LOADTL/1";
  const ParsedProgram points = program_of("UNITS/MM\nFEDRAT/100\nGOTO/1,2,3\nFINI\n", cl);
  EXPECT_EQ(said(points, "program.startup_code"), "");
}

TEST(Assumptions, WhereAxesStandIsSaidBeforeTheFirstFeed) {
  const auto line = [](const std::string& text) {
    ReadOptions options = options_of(Dialect::LinuxCnc);
    options.control.start[3] = 40.0;
    return said(program_of(text, options), "machine.home");
  };
  EXPECT_EQ(line("G21 G90\nG0 X0 Y0\nG1 X5 F100\n"),
            "line 3: no word before this first feed states the positions of these axes; start "
            "positions assumed: C0 Z40 A0 (machine.home)\n");
  EXPECT_EQ(line("G21 G90\nG0 X0 Y0 Z5 A0 C0\nG1 X5 F100\n"), "");
  EXPECT_EQ(line("G21 G90\nG0 X0 Y0\n"), "") << "nothing is cut";
}

TEST(Assumptions, MachineCoordinatesAndTheReferencePosition) {
  const std::pair<Dialect, std::string> programs[] = {
      {Dialect::LinuxCnc, "G21 G90\nG53 G0 Z-5\n"},
      {Dialect::Fanuc, "O1\nG21 G90\nG53 Z-5.\n"},
      {Dialect::Siemens, "G71 G90\nG0 SUPA Z-5 D0\n"},
      {Dialect::Heidenhain, "BEGIN PGM 1 MM\nL Z-5 R0 FMAX M91\nEND PGM 1 MM\n"}};
  for (const auto& [dialect, text] : programs) {
    SCOPED_TRACE(name_of(dialect));
    ReadOptions options = options_of(dialect);
    const ParsedProgram axes = program_of(text, options);
    EXPECT_EQ(axes.path.blocks.back().end[3], -5.0);
    EXPECT_HAS(said(axes, "machine.machine_zero"), "are counted from the zero of axis Z");
    options.control.machine_zero = machines::AxisVector::Zero(6);
    options.control.machine_zero[3] = 400.0;
    const ParsedProgram shifted = program_of(text, options);
    EXPECT_EQ(shifted.path.blocks.back().end[3], 395.0);
    EXPECT_EQ(said(shifted, "machine.machine_zero"), "");
  }
  for (const Dialect dialect : {Dialect::LinuxCnc, Dialect::Fanuc}) {
    SCOPED_TRACE(name_of(dialect));
    ReadOptions options = options_of(dialect);
    options.control.start[3] = 40.0;
    const std::string text = "O1\nG21 G91\nG28 Z0\n";
    EXPECT_NE(said(program_of(dialect == Dialect::Fanuc ? text : text.substr(3), options),
                   "machine.reference"),
              "");
    options.control.reference = machines::AxisVector::Zero(6);
    options.control.reference[3] = 290.0;
    const ParsedProgram stated =
        program_of(dialect == Dialect::Fanuc ? text : text.substr(3), options);
    EXPECT_EQ(stated.path.blocks.back().end[3], 290.0);
    EXPECT_EQ(said(stated, "machine.reference"), "");
  }
}

}  // namespace
}  // namespace abbe::sim::dialects::assumption_tests
