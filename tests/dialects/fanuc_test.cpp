#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects::fanuc_tests {
namespace {

namespace machines = program::test;
using machines::Chain;

constexpr int x = 1, y = 2, z = 3;  // joints of the gantry

ReadOptions fanuc_options() {
  ReadOptions options;
  options.control = machines::options_for(machines::gantry());
  options.control.tool_radius = {{1, 3.0}, {2, 0.5}};
  options.dialect = Dialect::Fanuc;
  return options;
}

ParsedProgram fanuc_read(const std::string& text, const ReadOptions& with = fanuc_options()) {
  return read_program(text, "part.nc", with);
}

std::string fanuc_refusal(const std::string& text, const ReadOptions& with = fanuc_options()) {
  return thrown_text<BadInput>([&] { read_program(text, "part.nc", with); }, "accepted");
}

/// Where the program ends, (axes).
kinematics::AxisVector end_of_program(const std::string& text) {
  return fanuc_read(text).path.blocks.back().end;
}

TEST(Fanuc, NumbersWithoutADecimalPointCountInTheLeastIncrement) {
  const ParsedProgram metric = fanuc_read("G1 X100 Y-2.5 Z0 F300\nX200\n");
  EXPECT_DOUBLE_EQ(metric.path.blocks[0].end[x], 0.1);
  EXPECT_EQ(metric.path.blocks[0].end[y], -2.5);
  EXPECT_DOUBLE_EQ(metric.path.blocks[1].end[x], 0.2);
  ASSERT_EQ(metric.warnings.size(), 1u) << "once";
  EXPECT_HAS(metric.warnings[0], "part.nc:1: X100 has no decimal point and is 0.1:");
  const ParsedProgram inch = fanuc_read("G20 G1 X100 F10.\nC90000\n");
  EXPECT_DOUBLE_EQ(inch.path.blocks[0].end[x], 100 * 0.0001 * 25.4);
  EXPECT_DOUBLE_EQ(inch.path.blocks[1].end[0], 90 * units::deg) << "angles have no inches";
  EXPECT_TRUE(fanuc_read("G1 X1. Y0 F300\n").warnings.empty()) << "zero is zero";
  EXPECT_EQ(fanuc_read("#1=100\nG1 X#1 F300\n").path.blocks[0].end[x], 100.0)
      << "variables are as they are";
  EXPECT_HAS(fanuc_refusal("G20 G1 X1. F10\n"), "a decimal point in F");
  EXPECT_HAS(fanuc_refusal("G4 P1.5\n"), "milliseconds");
  EXPECT_HAS(fanuc_refusal("S1000. M3\n"), "without a decimal point");
}

TEST(Fanuc, ArgumentsGoToTheVariablesOfTheManual) {
  // B-63684EN, custom macro, mixture of argument specifications I and II: of I4.0 and D5.0, both
  // for #7, the later one is valid
  const std::string show = "\nM30\nO1\nX#1 Y#2 Z#4\nX#7\nIF[#3EQ#0]GOTO1\nX99.\nN1 M99\n";
  const program::Path path = fanuc_read("O9\nG65 P1 A1.0 B2.0 I-3.0 I4.0 D5.0" + show).path;
  ASSERT_EQ(path.blocks.size(), 2u);
  EXPECT_EQ(path.blocks[0].end[x], 1.0);
  EXPECT_EQ(path.blocks[0].end[y], 2.0);
  EXPECT_EQ(path.blocks[0].end[z], -3.0);
  EXPECT_EQ(path.blocks[1].end[x], 5.0);
  EXPECT_HAS(fanuc_refusal("O9\nG65 P1 N1" + show), "sequence number at the start");
  EXPECT_HAS(fanuc_refusal("O9\nG65 P1 F1" + show), "a decimal point in argument");
  EXPECT_HAS(fanuc_refusal("O9\nG65 P1 K1. K1. K1. K1. K1. K1. K1. K1. K1. K1. K1." + show),
             "at most ten times");
}

TEST(Fanuc, LocalVariablesAreOfTheirCallAndThoseOfG66Stay) {
  EXPECT_EQ(end_of_program("O9\n#1=5.\nG65 P1 A1.\nX#1\nM30\nO1\n#1=7.\nX2.\nM99\n")[x], 5.0);
  EXPECT_EQ(end_of_program("O9\n#1=5.\nM98 P1\nX#1\nM30\nO1\n#1=7.\nX2.\nM99\n")[x], 7.0)
      << "M98 has none of its own";
  EXPECT_EQ(end_of_program("O9\nG66 P1 A1.\nX2.\nX3.\nM30\nO1\nY#1\n#1=#1+1.\nM99\n")[y], 2.0)
      << "arguments of G66 are set once";
}

TEST(Fanuc, RefusesByName) {
  const auto refused = [](const std::string& text, const std::string& sentence) {
    const std::string seen = fanuc_refusal(text);
    EXPECT_HAS(seen, sentence) << text;
    EXPECT_EQ(seen.find("part.nc:"), 0u) << text << seen;
  };
  refused("G02.4 X1.\n", "a circle in space");
  refused("G3.4 X1.\n", "a circle in space");
  refused("G51 X1. P2.\n", "no scaling");
  refused("G51.1 X0.\n", "no mirror images");
  refused("G71 U1. R1.\n", "cycles of lathes");
  refused("G31 Z-1.\n", "no probing");
  refused("G187\n", "a G code of Fanuc's milling controls");
  refused("M77\n", "a M code of Fanuc's milling controls");
  refused("G1 X1. ,R2.\n", "not expanded");
  refused("X#2500\n", "a variable from #1 to #33");
  refused("#5001=1\n", "a variable that can be set");
  refused("#3000=7(NO TOOL)\n", "no alarm from the program, seen #3000 = 7 NO TOOL");
  refused("G53.1\n", "G68.2 before G53.1");
  refused("G68.2 X0. Y0. Z0. I0. J30. K0.\nX1.\n", "a tool inclined by 30.000 degrees");
  refused("G68.2 X0. Y0. Z0. I0. J30. K0.\nG53.1\nZ1.\n", "G43 H before a Z word");
  refused("G68.2 P1 X0. Y0. Z0. I0. J30. K0.\n", "Euler angles I J K");
  refused("G43.4 H1\nG68.2 I0. J30. K0.\n", "G49 before G68.2");
  refused("G43.4\n", "H (tool length)");
  refused("G43 H9\n", "a known tool length (H1 H2), seen H9");
  refused("G41 D9\n", "a tool with a known radius, seen D9");
  refused("G91 G53 X0.\n", "G90 with G53");
  refused("G66 P1\n", "a program O0001 in the file, or O0001.nc next to it");
  refused("G88 Z1. R1.\n", "no operator");
  refused("IF[1EQ1]\n", "GOTO or THEN");
  refused("ELSE\n", "IF with GOTO");
  refused("#1=BIN[2]\n", "plain numbers");
  refused("G10 L10 P1 R50.\nG43.4 H1\n", "the tool length of the scene");
}

TEST(Fanuc, AllFaultsAreReportedTogether) {
  EXPECT_EQ(fanuc_refusal("G1 X1. F100.\nG12.3 X5.\nX[1/0]\nG31 Z1.\nY#[-1]\nX3.\n"),
            "part.nc:2:1: expected a G code of Fanuc's milling controls, seen G12.3\npart.nc:3:4: "
            "expected a nonzero divisor, seen /0]\npart.nc:4:1: expected no probing: a virtual "
            "part is measured by instruments (abbe measure), seen G31\npart.nc:5:2: expected a "
            "variable from #0 to #99999, seen #[-1]");
  ReadOptions with = fanuc_options();
  with.on_unknown = UnknownWordPolicy::Warn;
  const ParsedProgram read = fanuc_read("G1 X1. F100.\nG187 P1\nM77\nG187\n", with);
  ASSERT_EQ(read.skipped.size(), 3u);  // G187 P1 M77
  EXPECT_EQ(read.skipped[0].count, 2u);
  EXPECT_HAS(fanuc_refusal("G187 X1.\n", with), "no axis words with a code that is skipped");
}

TEST(Fanuc, WhatNeverEndsIsRefusedInBoundedTime) {
  ReadOptions with = fanuc_options();
  with.limits.blocks = 100000;
  for (const char* text :
       {"N1 GOTO1\n", "WHILE[1EQ1]DO1\nEND1\n", "DO1\nEND1\n",
        "O1\nM98 P2 L9999999\nM30\nO2\nM99\n", "O1\nG65 P2 L9999999\nM30\nO2\nM99\n",
        "M99 P1\nN1 M99 P1\n", "G91 G99 G81 X1. Z-1. R1. K1000000 F100.\n"})
    EXPECT_HAS(fanuc_refusal(text, with), "100000 blocks") << text;
  EXPECT_HAS(fanuc_refusal("O1\nM98 P1\nM30\n", with), "50 nested calls");
  EXPECT_HAS(fanuc_refusal("O1\nG66 P2\nX1.\nM30\nO2\nG65 P2\nM99\n", with), "50 nested calls");
  EXPECT_HAS(fanuc_refusal("G99 G83 X1. Z-10. R1. Q0.00001 F100.\n", with), "1e5 pecks");
  EXPECT_HAS(fanuc_refusal("X" + std::string(100000, '[') + "\n"), "100 nested brackets");
  with.limits.variables = 10;
  std::string many;
  for (int i = 1; i < 30; ++i) many += "#" + std::to_string(i) + "=1\n";
  EXPECT_HAS(fanuc_refusal(many, with), "at most 10 variables");
}

TEST(Fanuc, BrokenFlowIsRefusedWithItsPlace) {
  EXPECT_EQ(fanuc_refusal("GOTO7\n"), "part.nc:1:1: expected N7 in the program, seen none");
  EXPECT_EQ(fanuc_refusal("WHILE[1EQ1]DO1\n"), "part.nc:1:1: expected END1 after it, seen none");
  EXPECT_EQ(fanuc_refusal("END2\n"), "part.nc:1:1: expected DO2 before it, seen none");
  EXPECT_EQ(fanuc_refusal("DO4\nEND4\n").substr(0, 13), "part.nc:1:3: ");
  EXPECT_EQ(fanuc_refusal("O1\nM98 P2\nM30\nO2\nX1.\n"),
            "part.nc:5: expected M99 of O0002, seen its end");
}

TEST(Fanuc, SubprogramsInTheFolderAreNamedInRefusals) {
  const fs::path folder = fs::temp_directory_path() / "abbe_fanuc_subs";
  fs::create_directories(folder);
  std::ofstream(folder / "O1234.nc") << "%\nO1234 (HOLE)\nG0 X#24\nG31 Z1.\nM99\n%\n";
  ReadOptions with = fanuc_options();
  with.subprogram_folder = folder;
  EXPECT_HAS(fanuc_refusal("G65 P1234 X5.\n", with), "O1234.nc:4:1: expected no probing");
  std::ofstream(folder / "O1234.nc") << "G0 X#24\nM99\n";
  const program::Path path = fanuc_read("M98 P1234\nG65 P1234 X5.\nY1.\n", with).path;
  ASSERT_EQ(path.blocks.size(), 2u);
  EXPECT_EQ(path.blocks[0].file, 1);
  EXPECT_EQ(path.blocks[0].line, 1);
  EXPECT_EQ(path.blocks[0].end[x], 5.0);
  EXPECT_EQ(path.blocks[1].file, 0);
  fs::remove_all(folder);
}

// What stands behind a cancelled mirror image is the axes it was of.
TEST(Fanuc, EndsOfWhatIsNotThereMoveNothing) {
  const std::string begin = "G21 G90 G1 X50. Y50. Z-2. F200.\n";
  const program::Path path = fanuc_read(begin + "G50.1 X0. Y0.\nG1 X60.\n").path;
  ASSERT_EQ(path.motion_blocks, 2u);
  EXPECT_EQ(path.blocks[1].end[x], 60.0);
  EXPECT_EQ(path.blocks[1].end[y], 50.0);
  EXPECT_EQ(fanuc_read("G17 G40 G50 G50.1 G80\n").path.motion_blocks, 0u) << "at the beginning";
  for (const char* code : {"G50", "G11", "G13.1", "G113"})
    EXPECT_HAS(fanuc_refusal(begin + code + " X0. Y0.\n"), "which takes none, seen X0.") << code;
  EXPECT_HAS(fanuc_refusal("G4 P100 Y5.\n"), "the only word with G4");
}

// Group 00 beside group 01: the axis words are those of group 00, the code of motion is in force
// behind them.
TEST(Fanuc, CodesOfGroup00StandBesideCodesOfMotion) {
  const std::string begin = "G21 G90 G54 G1 X1. Y2. Z3. F300.\n", behind = "X7. Y8.\n";
  int pairs = 0;
  for (const std::string motion : {"G0", "G1"})
    for (const std::string once : {"G4 P100", "G10 L2 P1 X5.", "G28 X5. Z4.", "G30 X5.", "G52 X5.",
                                   "G53 X5. Z4.", "G92 X5. Y4.", "G92.1 X0"}) {
      SCOPED_TRACE(motion + " " + once);
      ++pairs;
      const program::Path beside = fanuc_read(begin + motion + " " + once + "\n" + behind).path;
      const program::Path apart = fanuc_read(begin + once + "\n" + motion + " " + behind).path;
      ASSERT_EQ(beside.blocks.size(), apart.blocks.size());
      for (std::size_t i = 0; i < apart.blocks.size(); ++i) {
        EXPECT_EQ(beside.blocks[i].end, apart.blocks[i].end);
        EXPECT_EQ(beside.blocks[i].end_s, apart.blocks[i].end_s);
      }
    }
  EXPECT_EQ(pairs, 16);
  EXPECT_HAS(fanuc_refusal("G28 G81 X5. Z1. R2.\n"), "a code that uses R");
  EXPECT_HAS(fanuc_refusal("G28 G68 X5. Y1.\n"), "a block without G28");
}

TEST(Fanuc, ModesOfTheServoMoveNothing) {
  const std::string begin = "G21 G90 G54 G1 X1. F300.\n", behind = "X7. Y8.\n";
  const program::Path without = fanuc_read(begin + behind).path;
  for (const std::string mode : {"G5.1 Q1", "G05 P10000", "G5.4 Q1", "G5.4 Q0", "G8 P1"}) {
    SCOPED_TRACE(mode);
    const program::Path with = fanuc_read(begin + mode + "\n" + behind).path;
    ASSERT_EQ(with.blocks.size(), without.blocks.size());
    EXPECT_EQ(with.blocks.back().end, without.blocks.back().end);
  }
}

TEST(Fanuc, BetweenTwoToolsZGoesToItsReference) {
  const program::Path path = fanuc_read(
                                 "O1\nG20\nG0 G17 G40 G80 G90\nG0 G28 G91 Z0.\nT1 M6\n"
                                 "G0 G90 G54 X1. Y1. S1000 M3\nG43 H1 Z.5\nG91 G0 G28 Z0.\nM30\n")
                                 .path;
  EXPECT_EQ(path.blocks.back().line, 8);
  EXPECT_EQ(path.blocks.back().end[z], 0.0);
  EXPECT_EQ(path.blocks.back().end[x], 25.4);
}

// Type A: the first move under G41 ends across the beginning of the second.
TEST(Fanuc, CompensationEntersAsNormAndRlDo) {
  ReadOptions with = fanuc_options();
  with.control = machines::options_for(machines::three_axis());
  with.control.tool_radius = {{1, 5.0}};
  const std::string contour = "Y30.\nX60.\nY0.\nG40 X40.\nM30\n";
  const program::Path fanuc =
      fanuc_read("G21 G90 G17\nT1 M6\nG0 X0. Y0. Z5.\nG1 Z-1. F100.\nG41 D1 X20. Y0.\n" + contour,
                 with)
          .path;
  const auto entry = std::ranges::find(fanuc.blocks, 5, &program::Block::line);
  ASSERT_NE(entry, fanuc.blocks.end());
  EXPECT_NEAR(entry->end[0], 15.0, 1e-12);
  EXPECT_NEAR(entry->end[1], 0.0, 1e-12);
  with.dialect = Dialect::Siemens;
  const program::Path siemens =
      read_program(
          "G71 G90 G17 G94 NORM G450\nT1 D1 M6\nG0 X0 Y0 Z5\nG1 Z-1 F100\nG41 X20 Y0\n" + contour,
          "part.mpf", with)
          .path;
  ASSERT_EQ(siemens.blocks.size(), fanuc.blocks.size());
  for (std::size_t i = 0; i < fanuc.blocks.size(); ++i)
    EXPECT_LT((siemens.blocks[i].end - fanuc.blocks[i].end).head(2).norm(), 1e-12) << i;
  with.dialect = Dialect::Fanuc;
  EXPECT_HAS(fanuc_refusal("G21 G90 F100.\nG41 D1 G2 X20. Y0. R10.\n", with),
             "a straight line as the first move");
  EXPECT_EQ(
      fanuc_read("G21 G90 F100.\nG41 D1 G1 X20.\nG41 Y30.\nX60.\nG40 X70.\n", with)
          .path.motion_blocks,
      fanuc_read("G21 G90 F100.\nG41 D1 G1 X20.\nY30.\nX60.\nG40 X70.\n", with).path.motion_blocks)
      << "the same side again is no change";
}

/// Haas VF operator's manual 96-8000, page 182: Z goes back to where it was at the start.
TEST(Fanuc, CyclesThatBeginBelowRGoBackDownUnderG98AndSaySo) {
  const auto levels = [](const std::string& text) {
    std::vector<double> at;
    for (const program::Block& block : fanuc_read(text).path.blocks) at.push_back(block.end[z]);
    return at;
  };
  const std::string begin = "O1\nG21 G90 G0 X0 Y0 Z1.\n", end = "X20.\nG80\nM30\n";
  EXPECT_EQ(levels(begin + "G98 G81 X10. Z-5. R5. F100.\n" + end),
            (std::vector<double>{1, 1, 5, -5, 5, 1, 1, 5, -5, 5, 1}));
  EXPECT_EQ(levels(begin + "G99 G81 X10. Z-5. R5. F100.\n" + end).back(), 5.0);
  const std::string part = "a cycle starts below its R";
  const auto warned = [&](const std::string& text) {
    for (const std::string& warning : fanuc_read(text).warnings)
      if (warning.find(part) != std::string::npos) return true;
    return false;
  };
  EXPECT_TRUE(warned(begin + "G98 G81 X10. Z-5. R5. F100.\n" + end));
  EXPECT_FALSE(warned(begin + "G99 G81 X10. Z-5. R5. F100.\n" + end));
  EXPECT_FALSE(warned(begin + "Z8.\nG98 G81 X10. Z-5. R5. F100.\n" + end));
}

/// Programs of what Fanuc and LinuxCNC have in common.
std::string common_program(std::mt19937& random) {
  std::uniform_real_distribution<double> anywhere(-50, 50), angle(0.1, 6.2);
  const auto number = [&](double v) { return fmt::format("{:.4f}", v); };
  std::string text = random() % 2 ? "G21" : "G20";
  text += " G90 G94 G17 G80 F500.\nG0 X1. Y2. Z3.\n";
  const std::string_view planes[] = {"XY", "ZX", "YZ"}, centres[] = {"IJ", "KI", "JK"};
  std::size_t plane = 0;
  for (int i = 0; i < 30; ++i) {
    switch (random() % 7) {
      case 0:
        plane = random() % 3;
        text += fmt::format("G{}\n", 17 + plane);
        break;
      case 1:
        text += random() % 2 ? "G91\n" : "G90\n";
        break;
      case 2:
        text += fmt::format("G{}\n", 54 + random() % 2);
        break;
      case 3: {
        // an arc by steps: its ends lie on a circle
        const double r = 5 + std::abs(anywhere(random)), a = angle(random), b = angle(random);
        const double u = r * (std::cos(b) - std::cos(a)), v = r * (std::sin(b) - std::sin(a));
        text +=
            fmt::format("G91 G{} {}{} {}{} {}{} {}{}\nG90\n", 2 + random() % 2, planes[plane][0],
                        number(u), planes[plane][1], number(v), centres[plane][0],
                        number(-r * std::cos(a)), centres[plane][1], number(-r * std::sin(a)));
        break;
      }
      default:
        text += fmt::format("G{} X{} Y{} C{}\n", random() % 2, number(anywhere(random)),
                            number(anywhere(random)), number(anywhere(random)));
    }
  }
  return text + "M30\n";
}

TEST(Fanuc, WhatLinuxCncHasAsWellGivesTheSameBits) {
  SeededRandom random(20240711);
  ReadOptions with = fanuc_options();
  with.control.work_offset[1] = machines::AxisVector::Zero(6);
  with.control.work_offset[1] << 0.3, 1, 2, 3, 0, 0;
  with.control.axes[0].rollover = program::Rollover::None;  // as LinuxCNC has it
  std::size_t blocks = 0;
  for (int n = 0; n < 300; ++n) {
    const std::string text = common_program(random);
    SCOPED_TRACE(text);
    const program::Path path = fanuc_read(text, with).path;
    ReadOptions other = with;
    other.dialect = Dialect::LinuxCnc;
    const program::Path expected = read_program(text, "part.nc", other).path;
    ASSERT_EQ(path.blocks.size(), expected.blocks.size());
    for (std::size_t i = 0; i < path.blocks.size(); ++i) {
      const program::Block &a = path.blocks[i], &b = expected.blocks[i];
      ASSERT_EQ(a.line, b.line);
      ASSERT_EQ(a.end, b.end) << "line " << a.line;
      ASSERT_EQ(a.end_s, b.end_s) << "line " << a.line;
      ASSERT_EQ(int(a.interpolation), int(b.interpolation));
    }
    blocks += path.blocks.size();
  }
  std::cout << blocks << " blocks the same to the bit\n";
  EXPECT_GT(blocks, 3000u);
}

TEST(Fanuc, AttacksEndInAPathOrInARefusalWithItsPlace) {
  SeededRandom random(20240712);
  std::vector<std::string> goldens;
  for (const auto& entry : fs::directory_iterator(ABBE_SOURCE_DIR "/tests/golden"))
    if (entry.path().filename().string().starts_with("fanuc_"))
      goldens.push_back(machines::file_text((entry.path() / "program.nc").string()));
  ASSERT_GE(goldens.size(), 5u);
  constexpr std::string_view bytes =
      "GMXYZIJKRPQLFSTHDNO#[]=+-*/.0123456789 \n%();,ABCEDOWHILEIFGOTO";
  ReadOptions with = fanuc_options();
  with.limits.blocks = 3000;
  int read = 0, refused = 0;
  for (int n = 0; n < 1500; ++n) {
    std::string text;
    if (n % 4 == 0) {
      for (int i = 0; i < 400; ++i) text += bytes[random() % bytes.size()];
    } else {
      text = goldens[random() % goldens.size()];
      for (unsigned i = 0; i <= random() % 3; ++i) {
        const std::size_t at = random() % text.size();
        switch (random() % 4) {
          case 0:
            text[at] = char(random() % 256);
            break;
          case 1:
            text[at] = bytes[random() % bytes.size()];
            break;
          case 2:
            text.erase(at, random() % 20);
            break;
          default:
            text.insert(at, text.substr(random() % text.size(), random() % 40));
        }
        if (text.empty()) text = "X";
      }
    }
    try {
      const ParsedProgram result = read_program(text, "part.nc", with);
      for (const program::Block& block : result.path.blocks) ASSERT_TRUE(block.end.allFinite());
      ++read;
    } catch (const BadProgram& bad) {
      ++refused;
      for (const BadInput& fault : bad.input_errors) {
        ASSERT_GT(fault.line, 0) << fault.what();
        ASSERT_EQ(fault.file, "part.nc");
      }
    }
  }
  std::cout << read << " read, " << refused << " refused\n";
  EXPECT_GT(read, 100);
  EXPECT_GT(refused, 500);
}

// Tilted planes and directions of the tool against what is written down another way: turns as
// quaternions, the machine's own forward chain, pairs of angles in closed form.

constexpr int c_joint = 0, x_joint = 1, a_joint = 4;  // of the gantry

program::Path planes_read(const std::string& text, const Chain& chain) {
  ReadOptions options;
  options.control = machines::options_for(chain);
  options.dialect = Dialect::Fanuc;
  return read_program(text, "part.nc", options).path;
}

/// A turn as a quaternion w x y z, by its half angle.
using Quaternion = std::array<double, 4>;

Quaternion turn_about(int axis, double degrees) {
  Quaternion q{std::cos(0.5 * degrees * units::deg), 0, 0, 0};
  q[std::size_t(axis) + 1] = std::sin(0.5 * degrees * units::deg);
  return q;
}

Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Vector3d turned(const Quaternion& q, const Vector3d& v) {
  const Quaternion r =
      q * Quaternion{0, v.x(), v.y(), v.z()} * Quaternion{q[0], -q[1], -q[2], -q[3]};
  return {r[1], r[2], r[3]};
}

// Bound: 1e-9 mm and 1e-12 rad, the promise of the inverse; planes lean by up to 60 degrees.
TEST(FanucPlanes, TheTipStandsWhereQuaternionsPutItAndTheToolAcrossThePlane) {
  SeededRandom random(20240713);
  std::uniform_real_distribution<double> any(-180, 180), lean(-60, 60), at(-50, 50);
  double worst_mm = 0, worst_rad = 0;
  for (int n = 0; n < 500; ++n) {
    const Chain machine = n % 2 == 0 ? machines::gantry() : machines::trunnion();
    const double i = any(random), j = lean(random), k = any(random);
    const Vector3d o(at(random), at(random), at(random)), p(at(random), at(random), at(random));
    const std::string text = fmt::format(
        "G90 G0 A0. C0.\nG68.2 X{:.9f} Y{:.9f} Z{:.9f} I{:.9f} J{:.9f} K{:.9f}\nG53.1\n"
        "G43 H1\nG0 X{:.9f} Y{:.9f} Z{:.9f}\nG69\nG49\nG91 G0 X1.\n",
        o.x(), o.y(), o.z(), i, j, k, p.x(), p.y(), p.z());
    const program::Path path = planes_read(text, machine);
    const Quaternion q = turn_about(2, i) * turn_about(0, j) * turn_about(2, k);
    const Vector3d expected = o + turned(q, p), across = turned(q, Vector3d::UnitZ());
    // the last move begins where the axes stand, by the control's chain
    const kinematics::AxisVector axes = path.blocks.back().start;
    ASSERT_EQ(int(path.blocks.back().coordinates), int(program::Coordinates::Axis));
    const machines::Pose tool = machine.tool_in_workpiece(axes);
    worst_mm = std::max(worst_mm, (tool.translation() - expected).norm());
    worst_rad = std::max(worst_rad, tool.linear().col(2).cross(across).norm());
    ASSERT_GT(tool.linear().col(2).dot(across), 0.0);
  }
  std::cout << "worst " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 2e-8) << "angles and positions are written to 1e-9";
  EXPECT_LT(worst_rad, 1e-10);
}

TEST(FanucPlanes, OfTwoPairsTheTableTurnsLessThenTheHead) {
  // A plane that leans by 30 about X: A 30 and C 0, or A -30 and C 180.
  const auto turned_from = [](double c) {
    const program::Path path = planes_read(
        fmt::format("G0 C{:.1f}\nG68.2 I0. J30. K0.\nG53.1\nG69\nG0 X1.\n", c), machines::gantry());
    const kinematics::AxisVector& q = path.blocks.back().end;
    return std::array{q[a_joint] / units::deg, q[c_joint] / units::deg};
  };
  const auto near = turned_from(40.0), far = turned_from(150.0);
  EXPECT_NEAR(near[0], 30.0, 1e-9);
  EXPECT_NEAR(near[1], 0.0, 1e-9);
  EXPECT_NEAR(far[0], -30.0, 1e-9);
  EXPECT_NEAR(far[1], 180.0, 1e-9);
}

TEST(FanucPlanes, OfTwoPairsOfATrunnionItsFirstAxisTurnsLess) {
  // A carries C: the pairs of one direction have A and -A, whatever C must turn.
  for (const double from : {5.0, -5.0}) {
    const program::Path path =
        planes_read(fmt::format("G0 A{:.1f} C10.\nG68.2 I0. J20. K0.\nG53.1\nG69\nG0 X1.\n", from),
                    machines::trunnion());
    EXPECT_NEAR(path.blocks.back().end[1] / units::deg, from > 0 ? 20.0 : -20.0, 1e-9);
  }
}

TEST(FanucPlanes, DirectionsOutOfReachAreRefused) {
  const std::string said = thrown_text<BadInput>(
      [&] { planes_read("G68.2 I0. J30. K0.\nG53.1\n", machines::three_axis()); });
  EXPECT_HAS(said, "part.nc:2:1: expected a direction that the rotary");
}

// I J K of G43.5: the forward chain gives the direction back.
TEST(FanucPlanes, DirectionsOfG435AreThoseOfTheForwardChain) {
  SeededRandom random(20240714);
  std::uniform_real_distribution<double> any(-1, 1), at(-50, 50);
  double worst = 0;
  for (int n = 0; n < 200; ++n) {
    const Chain machine = n % 2 == 0 ? machines::gantry() : machines::trunnion();
    const Vector3d d = Vector3d(any(random), any(random), 1.2 + any(random));
    const Vector3d tip(at(random), at(random), at(random));
    const program::Path path = planes_read(
        fmt::format("G43.5 H1\nG1 X{:.6f} Y{:.6f} Z{:.6f} I{:.12f} J{:.12f} K{:.12f} F100.\n",
                    tip.x(), tip.y(), tip.z(), d.x(), d.y(), d.z()),
        machine);
    const program::Block& block = path.blocks.back();
    ASSERT_EQ(int(block.coordinates), int(program::Coordinates::Tip));
    worst = std::max(
        worst, machine.tool_in_workpiece(block.end).linear().col(2).cross(d.normalized()).norm());
    ASSERT_NEAR(block.end[*machine.find('X')], tip.x(), 1e-6);
  }
  std::cout << "worst " << worst << " rad\n";
  EXPECT_LT(worst, 1e-11);
}

// The plane of a rotation G68 in G18 turns from Z to X, as a positive turn about Y.
TEST(FanucPlanes, G68TurnsInThePlaneAboutItsCentre) {
  const auto at = [](const std::string& text) {
    const kinematics::AxisVector q = planes_read(text, machines::gantry()).blocks.back().end;
    return Vector3d(q[x_joint], q[x_joint + 1], q[x_joint + 2]);
  };
  EXPECT_NEAR((at("G17 G68 X1. Y2. R90.\nX3. Y2. Z4.\n") - Vector3d(1, 4, 4)).norm(), 0, 1e-14);
  EXPECT_NEAR((at("G18 G68 X1. Z2. R90.\nX1. Y5. Z3.\n") - Vector3d(2, 5, 2)).norm(), 0, 1e-14);
  EXPECT_NEAR((at("G19 G68 Y1. Z2. R90.\nX7. Y2. Z2.\n") - Vector3d(7, 1, 3)).norm(), 0, 1e-14);
}

}  // namespace
}  // namespace abbe::sim::dialects::fanuc_tests
