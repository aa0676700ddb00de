#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/program/nc_reader.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;

ReadOptions test_options() {
  ReadOptions options;
  options.control = machines::options_for(machines::gantry());
  options.control.tool_radius = {{1, 3.0}, {2, 0.5}};
  options.dialect = Dialect::LinuxCnc;
  return options;
}

program::Path read(const std::string& text) {
  return read_program(text, "part.ngc", test_options()).path;
}

std::string refused_as(const std::string& text, const ReadOptions& with = test_options()) {
  return thrown_text<BadInput>([&] { read_program(text, "part.ngc", with); }, "accepted");
}

bool same_bits(const program::Block& a, const program::Block& b) {
  const auto same = [](const auto& p, const auto& q) {
    return p.size() == q.size() &&
           std::memcmp(p.data(), q.data(), sizeof(double) * std::size_t(p.size())) == 0;
  };
  return a.line == b.line && a.interpolation == b.interpolation && a.coordinates == b.coordinates &&
         a.start_s == b.start_s && a.end_s == b.end_s && same(a.start, b.start) &&
         same(a.end, b.end) && a.shape == b.shape && a.inch == b.inch &&
         a.inverse_time == b.inverse_time && a.work_offset == b.work_offset &&
         a.tool_length == b.tool_length;
}

TEST(LinuxCnc, PlainProgramsGiveTheBitsOfThePlainReader) {
  std::vector<fs::path> files;
  for (const char* folder : {"/tests/golden", "/scenes"})
    for (const auto& entry :
         fs::recursive_directory_iterator(ABBE_SOURCE_DIR + std::string(folder)))
      if (entry.path().extension() == ".ngc") files.push_back(entry.path());
  int programs = 0;
  std::size_t blocks = 0;
  for (const fs::path& file : files) {
    SCOPED_TRACE(file.string());
    ReadOptions with = test_options();
    with.control.work_offset[1] = machines::AxisVector::Zero(6);
    with.control.work_offset[1] << 10 * units::deg, 1, 2, 3, 0, 0;
    program::Path plain;
    try {
      plain = program::read_nc_file(file, with.control);
    } catch (const BadInput&) {
      continue;  // it is of another machine
    }
    const program::Path path = read_program_file(file, with).path;
    ASSERT_EQ(path.blocks.size(), plain.blocks.size());
    for (std::size_t i = 0; i < path.blocks.size(); ++i)
      ASSERT_TRUE(same_bits(path.blocks[i], plain.blocks[i])) << "block " << i;
    ASSERT_EQ(path.arcs.size(), plain.arcs.size());
    for (std::size_t i = 0; i < path.arcs.size(); ++i) {
      ASSERT_EQ(path.arcs[i].centre, plain.arcs[i].centre);
      ASSERT_EQ(path.arcs[i].sweep, plain.arcs[i].sweep);
    }
    ASSERT_EQ(path.auxiliary_words.size(), plain.auxiliary_words.size());
    for (std::size_t i = 0; i < path.auxiliary_words.size(); ++i)
      ASSERT_EQ(path.auxiliary_words[i].text, plain.auxiliary_words[i].text);
    ++programs;
    blocks += path.blocks.size();
  }
  std::cout << programs << " programs, " << blocks << " blocks the same to the bit\n";
  EXPECT_GE(programs, 15);
}

TEST(LinuxCnc, AllFaultsAreReportedTogetherAndNoneThatOnlyFollows) {
  EXPECT_EQ(
      refused_as("G1 X1 F100\nG12.1 X5\nX[1 / 0]\nG38.2 Z1\nY#<none>\nG2 X9 Y9 I1 J0\nG1 X3\n"),
      "part.ngc:2:1: expected a G code of LinuxCNC, seen G12.1\npart.ngc:3:5: expected a nonzero "
      "divisor, seen /\npart.ngc:4:1: expected no probing: a virtual part is measured by "
      "instruments (abbe measure), seen G38.2\npart.ngc:5:2: expected a named parameter that has "
      "been set, seen #<none>");
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "G12." + std::to_string(i % 10) + "\n";
  try {
    read(many);
    ADD_FAILURE();
  } catch (const BadProgram& bad) {
    EXPECT_EQ(bad.input_errors.size(), 201u);
    EXPECT_EQ(bad.line, 1);
  }
}

TEST(LinuxCnc, ModesAreSavedAndRestored) {
  const auto last = [](const std::string& text) {
    const program::Path path = read(text);
    return path.blocks.back();
  };
  // M72 brings inches, steps, the plane and the feed back
  const program::Block back =
      last("G21 G90 F100 G1 X10\nM70\nG20 G91 G18 F50 G1 X1\nM72\nG1 X20\n");
  EXPECT_FALSE(back.inch);
  const auto moved = (back.end - back.start).cwiseAbs().maxCoeff();
  EXPECT_NEAR(moved, std::abs(20.0 - 35.4), 1e-12) << "from 10 mm + 1 inch to 20 mm";
  EXPECT_NEAR(back.end_s - back.start_s, moved / 100.0 * 60.0, 1e-12);
  // M73 does so at the end of the call
  const program::Block after = last(
      "o<a> sub\nM73\nG20 G91 F50 G1 X1\no<a> endsub\nG21 G90 F100 G1 X10\no<a> call\nG1 X20\n");
  EXPECT_NEAR((after.end - after.start).cwiseAbs().maxCoeff(), 15.4, 1e-12);
  EXPECT_HAS(refused_as("M72\n"), "M70 or M73 before M72");
  EXPECT_HAS(refused_as("M70\nM71\nM72\n"), "M70 or M73 before M72");
  EXPECT_HAS(refused_as("G1 X1 F100 M70\n"), "a separate block");
}

TEST(LinuxCnc, ASpindleMayBeNamed) {
  const program::Path path = read("F100 S1000 M3 $0\nG95 F0.1\nG1 X10\n");
  EXPECT_NEAR(path.blocks.back().end_s - path.blocks.back().start_s, 10 / (0.1 * 1000) * 60, 1e-9);
  // another spindle turns nothing here
  EXPECT_HAS(refused_as("S1000 M3 $1\nG95 F0.1\nG1 X10\n"), "a stopped spindle");
  EXPECT_HAS(refused_as("S1000 M3 $9\n"), "a spindle from 0 to 7");
}

TEST(LinuxCnc, Parameter5599IsTheSwitchOfDebugComments) {
  EXPECT_EQ(refused_as("#5599 = 0\nG1 X[#5599 + 1] F100\n"), "accepted");
  EXPECT_NEAR(read("G21 G1 X[#5599 * 7] F100\n").blocks.back().end.cwiseAbs().maxCoeff(), 7.0,
              1e-12);
}

TEST(LinuxCnc, UnknownWordsAreSkippedAndCountedOnDemand) {
  ReadOptions with = test_options();
  with.on_unknown = UnknownWordPolicy::Warn;
  const ParsedProgram read = read_program("G1 X1 F100\nG187 P1\nM123 P2 X2\nG187\n", "t", with);
  ASSERT_EQ(read.skipped.size(), 4u);  // G187 P1 M123 P2
  EXPECT_EQ(read.skipped[0].word, "G187");
  EXPECT_EQ(read.skipped[0].count, 2u);
  EXPECT_EQ(read.skipped[0].line, 2);
  EXPECT_EQ(read.skipped[1].word, "P1");
  EXPECT_EQ(read.skipped[2].word, "M123");
  EXPECT_EQ(read.path.motion_blocks, 2);
  EXPECT_EQ(refused_as("G0 X1\nG12.1 X5\n", with),
            "part.ngc:2:7: expected no axis words with a code that is skipped: their effect is "
            "unknown, seen X5 with G12.1");
  EXPECT_HAS(refused_as("G187\nG38.2 Z1\n", with), "no probing")
      << "what is refused by name is not unknown";
}

TEST(LinuxCnc, WhatNeverEndsIsRefusedInBoundedTime) {
  ReadOptions with = test_options();
  with.limits.blocks = 100000;
  EXPECT_HAS(refused_as("o1 while [1]\no1 endwhile\n", with), "100000 blocks");
  EXPECT_HAS(refused_as("o1 do\no1 while [1]\n", with), "100000 blocks");
  EXPECT_HAS(refused_as("o1 repeat [1000000000]\nG91 G0 X1\nX-1\no1 endrepeat\n", with),
             "100000 blocks");
  EXPECT_HAS(refused_as("o<a> sub\no<a> call\no<a> endsub\no<a> call\n", with), "50 nested calls");
  EXPECT_HAS(refused_as("G91 G81 X1 Z-1 R1 L1000000 F100\n", with), "100000 blocks");
  EXPECT_HAS(refused_as("G83 X1 Z-10 R1 Q0.00001 F100\n", with), "1e5 pecks");
  with.limits.variables = 10;
  std::string names;
  for (int i = 0; i < 20; ++i) names += "#<v" + std::to_string(i) + "> = 1\n";
  EXPECT_HAS(refused_as(names, with), "at most 10 parameters");
  EXPECT_HAS(refused_as("X" + std::string(100000, '[') + "\n"), "100 nested brackets");
}

TEST(LinuxCnc, BrokenFlowIsRefusedWithItsPlace) {
  EXPECT_EQ(refused_as("o1 if [1]\n"), "accepted");
  EXPECT_EQ(refused_as("o1 if [0]\n"), "part.ngc:1:1: expected o1 endif after it, seen none");
  EXPECT_EQ(refused_as("o1 endwhile\n"),
            "part.ngc:1:1: expected o1 while before endwhile, seen none");
  EXPECT_EQ(refused_as("o1 break\n"),
            "part.ngc:1:1: expected a loop with this label around break, seen none");
  EXPECT_EQ(refused_as("o<nothing> call\n"),
            "part.ngc:1:1: expected a subprogram o<nothing> in the program, or nothing.ngc next to "
            "it, seen none");
  EXPECT_EQ(refused_as("o<../x> call\n").substr(0, 30), "part.ngc:1:1: expected a subpr");
  EXPECT_EQ(refused_as("o1 return\n"), "part.ngc:1:1: expected a call before return, seen none");
}

TEST(LinuxCnc, SubprogramsInFilesAreNamedInRefusals) {
  const fs::path folder = fs::temp_directory_path() / "abbe_linuxcnc_subs";
  fs::create_directories(folder);
  std::ofstream(folder / "drill.ngc") << "o<drill> sub\nG0 X#1\nG38.2 Z1\no<drill> endsub\n";
  ReadOptions with = test_options();
  with.subprogram_folder = folder;
  EXPECT_HAS(refused_as("o<drill> call [5]\n", with), "drill.ngc:3:1: expected no probing");
  std::ofstream(folder / "drill.ngc") << "o<drill> sub\nG0 X#1\no<drill> endsub [#1 + 1]\n";
  const program::Path path =
      read_program("o<drill> call [5]\nG0 Y#<_value>\n", "part.ngc", with).path;
  ASSERT_EQ(path.blocks.size(), 2u);
  EXPECT_EQ(path.blocks[0].file, 1);
  EXPECT_EQ(path.blocks[0].line, 2);
  EXPECT_EQ(path.blocks[1].end[2], 6.0);
  fs::remove_all(folder);
}

TEST(LinuxCnc, WhatWaitsUnderCompensationKeepsItsFeedAndItsLine) {
  const program::Path path =
      read("G21 G90 G94 G17\nG41.1 D4\nG1 X10 F100\nX20\nZ-5 F50\nG4 P3\nX30 F200\nG40\nX40\nM2\n");
  std::vector<int> lines;
  for (const program::Block& block : path.blocks) lines.push_back(block.line);
  EXPECT_EQ(lines, (std::vector<int>{3, 4, 5, 6, 7, 9}));
  const program::Block &plunge = path.blocks[2], &dwell = path.blocks[3];
  EXPECT_EQ(plunge.end[3], -5.0);
  EXPECT_NEAR(plunge.end_s - plunge.start_s, 5.0 / 50 * 60, 1e-9);
  EXPECT_NEAR(dwell.end_s - dwell.start_s, 3.0, 1e-9);
}

TEST(LinuxCnc, APlaceStaysWhereFilesAreAdded) {
  const ReadOptions with = test_options();
  program::Canon canon("part.ngc", with.control);
  canon.set_line(4, canon.add_file("first.ngc"));
  const program::NcLocation place = canon.place();
  for (int n = 0; n < 1000; ++n) canon.add_file("another file with a long name.ngc");
  EXPECT_EQ(place.file, "first.ngc");
}

}  // namespace
}  // namespace abbe::sim::dialects
