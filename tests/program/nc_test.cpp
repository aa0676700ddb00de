#include "kinematics/inverse_kinematics.h"
#include "machines.h"
#include "sim/program/nc_reader.h"
#include "sim/program/path.h"
#include "sim/program/program_writers.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;
using End = CutterData::End;

Path read(const std::string& text) {
  return read_nc(text, "part.ngc", test::options_for(test::gantry()));
}

std::string refusal(const std::string& text) {
  return thrown_text<BadInput>([&] { read(text); }, "accepted");
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
  const Vector3d tip = machine.tool_in_workpiece(options.start).translation();
  const auto xyz = [](const AxisVector& q) { return Vector3d(q[1], q[2], q[3]); };
  EXPECT_LT((xyz(path.blocks[0].start) - tip).norm(), 1e-12);
  EXPECT_EQ(path.blocks[1].coordinates, Coordinates::Axis);
  const Vector3d back = machine.tool_in_workpiece(path.blocks[1].start).translation();
  EXPECT_LT((back - Vector3d(1, 2, 3)).norm(), 1e-12);
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
  EXPECT_THROW(read_nc_file(fs::temp_directory_path(), options), BadInput);
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

struct Said {
  const char* comment;
  std::optional<int> number;
  double diameter;  // 0: none is said
  std::optional<double> corner_radius = {};
  End end = End::Unspecified;
  std::optional<double> unit_mm = {};
};

TEST(ToolComment, CamSystemsSayDiametersInManyWays) {
  const Said all[] = {
      {"T1 D=10. CR=0. - ZMIN=-4.2 - FLAT END MILL", 1, 10.0, 0.0, End::Flat},
      {"T12  D=6 CR=3. - ZMIN=-26. - ball end mill", 12, 6.0, 3.0, End::Ball},
      {"T6  Spiral O Metal 3.175*12mm  D=3.175 CR=0. - ZMIN=-26. - flat end mill", 6, 3.175, 0.0,
       End::Flat},
      {"T2 D=0.25 CR=0.03 TAPER=118deg - ZMIN=-0.5 - bull nose end mill", 2, 0.25, 0.03},
      {"T4 D=6. - drill", 4, 6.0},
      {"TOOL - 1 DIA. OFF. - 1 LEN. - 1 DIA. - 10.", 1, 10.0},
      {" 1/16 FLAT ENDMILL TOOL - 1 DIA. OFF. - 21 LEN. - 2 DIA. - .0625",
       1,
       0.0625,
       {},
       End::Flat},
      {" TOOL - 6 2\"  FACE MILL    DIA. OFF. - 6  LEN. - 6  DIA. - 2. ", 6, 2.0},
      {"TOOL - 14 DIA. OFF. - 14 LEN. - 14 TOOL DIA. - .125", 14, 0.125},
      {"T1 | 10. FLAT ENDMILL | H1", 1, 10.0, {}, End::Flat},
      {"T3 | 1/2 BALL ENDMILL | H3 | D3", 3, 0.5, {}, End::Ball},
      {"T3 | 1-1/4 FLAT ENDMILL | H3", 3, 1.25, {}, End::Flat},
      {"TOOL DIAMETER: 3.0", {}, 3.0},
      {"Tool diameter   6.00", {}, 6.0},
      {"TOOL DIA = 12", {}, 12.0},
      {"TOOL -2- MILL DIA 10.0 R1. MM", 2, 10.0, 1.0},
      {"D10R1", {}, 10.0, 1.0},
      {"T5 D16 R0.8", 5, 16.0, 0.8},
      {"TOOL NAME : D6.5R3.25", {}, 6.5, 3.25},
      {"T2 D6", 2, 6.0},
      {"5mm Endmill", {}, 5.0, {}, End::Unspecified, 1.0},
      {"T2 10 mm 4 flute end mill", 2, 10.0, {}, End::Unspecified, 1.0},
      {"T7 1/4 inch flat end mill", 7, 0.25, {}, End::Flat, 25.4},
      {"Tool: 1  End Mill {6.35 mm}", 1, 6.35, {}, End::Unspecified, 1.0},
      {"T1 \xC3\x98 8", 1, 8.0},
  };
  for (const Said& said : all) {
    const auto words = parse_cutter_comment(said.comment);
    ASSERT_TRUE(words) << said.comment;
    EXPECT_EQ(words->number, said.number) << said.comment;
    EXPECT_DOUBLE_EQ(words->diameter, said.diameter) << said.comment;
    EXPECT_EQ(words->corner_radius, said.corner_radius) << said.comment;
    EXPECT_EQ(words->end, said.end) << said.comment;
    EXPECT_EQ(words->unit_mm, said.unit_mm) << said.comment;
  }
}

TEST(ToolComment, RegistersPlacesAndTitlesAreNoDiameters) {
  for (const char* comment :
       {"", "roughing", "T1", "T1 H1 D1", "T1 D1", "TOOL - 1 DIA. OFF. - 1 LEN. - 1", "G43 H1 D2",
        "PART 4711 D", "MACHINE GROUP-1", "2D ADAPTIVE1", "ZMIN=-4.2", "FEED 100",
        "DATE=22-11-26 TIME=10:15", "STEP 5 FACE", "OFFSET D12", "D=0 - nothing", "DIAL 3",
        "RETRACT 5mm", "STOCK 100 x 50 x 20 mm"})
    EXPECT_FALSE(parse_cutter_comment(comment)) << comment;
  EXPECT_FALSE(parse_cutter_comment("T1 D=10. " + std::string(300, 'x')));  // no name of a tool
}

TEST(ToolComment, ItsUnitIsThatOfTheProgramThatFollows) {
  NcOptions options;
  options.axes = {{'X', kinematics::Motion::Linear}};
  const Path path = read_nc(
      "(T1 D=.5 CR=0. - flat end mill)\nG20 G90\nT1 M6\n(T2 D=.25)\n(6mm endmill)\nG21\n(T3 "
      "D=8.)\n",
      "p.ngc", options);
  ASSERT_EQ(path.tool_comments.size(), 4u);
  const double mm[] = {12.7, 6.35, 6.0, 8.0};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_DOUBLE_EQ(path.tool_comments[i].words.diameter, mm[i]) << i;
  EXPECT_EQ(path.tool_comments[0].words.corner_radius, 0.0);
  EXPECT_EQ(path.tool_comments[3].line, 7);
  ASSERT_EQ(path.unit_words.size(), 2u);
  EXPECT_TRUE(path.unit_words[0].inch);
  EXPECT_EQ(path.unit_words[1].line, 6);
}

// Readers meet noise and damaged programs: they read or refuse with a place, and nothing else.

constexpr unsigned fuzz_seed = 20250314;

const std::string valid_nc =
    "%\nN10 G21 G90 G94 G54 (head)\nG43.4 H1\nS1000 M3\nG0 X1 Y2 Z30 A5 C10\nG1 X2.5 F600\n"
    "G3 X3.5 Y3 I1 J0\nG2 X2 R5\nG49\nG93 G1 X1 F30\nG4 P.5\nG53 G0 Z0\nM30\n%\n";
const std::string valid_pvt =
    "time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s\n0,0,0,0,1,1,1\n1,1e-3,2,30,0,-1e-2,"
    "4\n"
    "2,1,3.25,60,0,0,0\n";

std::string noise(std::mt19937& random, std::string_view letters) {
  std::uniform_int_distribution<int> length(0, 300);
  std::uniform_int_distribution<int> any(0, 255);
  std::string text(std::size_t(length(random)), ' ');
  for (char& c : text)
    c = letters.empty() ? char(any(random)) : letters[std::size_t(any(random)) % letters.size()];
  return text;
}

std::string damaged(std::mt19937& random, std::string text, std::string_view letters) {
  std::uniform_int_distribution<int> any(0, 1 << 20);
  const int edits = 1 + any(random) % 4;
  for (int i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = std::size_t(any(random)) % text.size();
    const char c = letters[std::size_t(any(random)) % letters.size()];
    switch (any(random) % 4) {
      case 0:
        text[at] = c;
        break;
      case 1:
        text.insert(at, 1, c);
        break;
      case 2:
        text.erase(at, 1 + std::size_t(any(random)) % 5);
        break;
      default:
        text.resize(at);
    }
  }
  return text;
}

struct Count {
  int read = 0, refused = 0;
};

template <typename Reader>
void try_one(const Reader& reader, const std::string& text, Count& count) {
  try {
    const Path path = reader(text);
    ++count.read;
    double time_s = -1e300;
    for (const Block& block : path.blocks) {
      ASSERT_TRUE(block.start.allFinite() && block.end.allFinite());
      ASSERT_GE(block.start_s, time_s);
      ASSERT_GE(block.end_s, block.start_s) << text;
      ASSERT_TRUE(std::isfinite(block.end_s));
      ASSERT_TRUE(position(path, block, 0.37).allFinite());
      time_s = block.end_s;
    }
  } catch (const BadInput& refusal) {
    ++count.refused;
    ASSERT_GE(refusal.line, 1) << text;
    ASSERT_FALSE(refusal.expected.empty());
    ASSERT_LT(std::string(refusal.what()).size(), 500u);
  }
}

TEST(Fuzz, NcReaderReadsOrRefusesWithAPlace) {
  SCOPED_TRACE(testing::Message() << "seed " << fuzz_seed);
  std::mt19937 random(fuzz_seed);
  const NcOptions options = test::options_for(test::gantry());
  const auto reader = [&](const std::string& text) { return read_nc(text, "fuzz", options); };
  const std::string_view letters = "GMXYZACIJKRFSTHPNO0123456789.-+()%;/#[]= \n\r\te";
  Count count;
  for (int i = 0; i < 60000; ++i) {
    const std::string text = i % 3 == 0   ? noise(random, "")
                             : i % 3 == 1 ? noise(random, letters)
                                          : damaged(random, valid_nc, letters);
    ASSERT_NO_FATAL_FAILURE(try_one(reader, text, count)) << text;
  }
  std::cout << "seed " << fuzz_seed << ": " << count.read << " read, " << count.refused
            << " refused\n";
  EXPECT_GT(count.read, 1000);
  EXPECT_GT(count.refused, 1000);
}

TEST(Fuzz, PvtReaderReadsOrRefusesWithAPlace) {
  SCOPED_TRACE(testing::Message() << "seed " << fuzz_seed);
  std::mt19937 random(fuzz_seed);
  const NcOptions options = test::options_for(test::platform());
  const auto reader = [&](const std::string& text) { return read_pvt(text, "fuzz", options); };
  const std::string_view letters = "time_s,XZS_mm_per_deg0123456789.-+e\n\r#";
  Count count;
  for (int i = 0; i < 90000; ++i) {
    const std::string text = i % 5 == 0   ? noise(random, "")
                             : i % 5 == 1 ? noise(random, letters)
                                          : damaged(random, valid_pvt, "0123456789.-+e ,");
    ASSERT_NO_FATAL_FAILURE(try_one(reader, text, count)) << text;
  }
  std::cout << "seed " << fuzz_seed << ": " << count.read << " read, " << count.refused
            << " refused\n";
  EXPECT_GT(count.read, 1000);
  EXPECT_GT(count.refused, 1000);
}

TEST(Fuzz, LinesWithoutEndTakeNoMemoryOfTheirOwn) {
  const NcOptions nc = test::options_for(test::gantry());
  EXPECT_THROW(read_nc(std::string(5'000'000, 'G'), "t", nc), BadInput);
  EXPECT_THROW(read_nc("X" + std::string(5'000'000, '9'), "t", nc), BadInput);
  EXPECT_NO_THROW(read_nc(std::string(5'000'000, ' '), "t", nc));
  EXPECT_THROW(read_nc("(" + std::string(5'000'000, 'a'), "t", nc), BadInput);
  std::string codes;
  for (int i = 0; i < 1'000'000; ++i) codes += "G1 ";
  EXPECT_THROW(read_nc(codes, "t", nc), BadInput);
  const NcOptions pvt = test::options_for(test::platform());
  EXPECT_THROW(read_pvt(std::string(5'000'000, ','), "t", pvt), BadInput);
}

}  // namespace
}  // namespace abbe::sim::program
