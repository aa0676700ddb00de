// `interpreter = "linuxcnc"`: programs read by LinuxCNC's own interpreter become the same blocks as
// abbe's own front end makes of them, and whatever it does ends in a fault with its place.

#include "sim/dialects/linuxcnc/rs274.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/dialects/linuxcnc_interpreter.h"
#include "tests/dialects/linuxcnc_moves.h"
#include "tests/dialects/linuxcnc_programs.h"
#include "tests/injured.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;
using program::Block;
using program::Interpolation;
using program::Path;

#define NEEDS_LINUXCNC \
  if (!find_linuxcnc()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc"

constexpr double same_mm = 1e-9;  // up to 1 m, and 1e-12 of the position beyond; degrees likewise

ReadOptions six_axes() {
  ReadOptions options;
  for (const char letter : std::string("XYZABC"))
    options.control.axes.push_back(
        {letter, letter < 'X' ? machines::Motion::Rotary : machines::Motion::Linear});
  for (int n = 1; n <= 99; ++n) {
    options.control.tool_length[n] = 10.0 * n;
    options.control.tool_radius[n] = 0.1 * n;
  }
  options.dialect = Dialect::LinuxCnc;
  return options;
}

ParsedProgram by_linuxcnc(const std::string& text, ReadOptions options) {
  options.interpreter = Interpreter::LinuxCnc;
  return read_program(text, "part.ngc", options);
}

std::string error_text(const std::string& text, const ReadOptions& options) {
  return thrown_text<BadInput>([&] { by_linuxcnc(text, options); }, "none");
}

/// What differs, none if nothing does; and by how much at most.
struct Difference {
  std::string text;
  double off = 0.0;
};

std::string text_of_block(const Path& path, const Block& block) {
  std::string text = fmt::format("line {} kind {} {:.9f} to {:.9f} s", block.line,
                                 int(block.interpolation), block.start_s, block.end_s);
  for (const double one : block.end) text += fmt::format(" {:.9f}", one);
  if (block.interpolation != Interpolation::Arc) return text;
  const program::Arc& arc = path.arcs[block.shape];
  return text +
         fmt::format(" about {:.9f} {:.9f} by {:.9f}", arc.centre.x(), arc.centre.y(), arc.sweep);
}

double distance_of(const Path& a, const Block& p, const Path& b, const Block& q) {
  constexpr double another = 1e9;
  if (p.interpolation != q.interpolation || p.end.size() != q.end.size() || p.inch != q.inch ||
      p.work_offset != q.work_offset || p.tool_length != q.tool_length)
    return another;
  const double size = std::max(1000.0, p.end.cwiseAbs().maxCoeff());
  double off = (p.end - q.end).cwiseAbs().maxCoeff() * 1000 / size;
  // seconds since the start of the block, whatever the ones before have cost; of G93 LinuxCNC makes
  // a feed of at least 0.1 mm/min
  const double seconds = p.end_s - p.start_s;
  const bool slow = p.inverse_time && (p.end - p.start).head(3).norm() * 60 / seconds < 0.1;
  if (!slow)
    off = std::max(off, std::abs(seconds - (q.end_s - q.start_s)) / std::max(1.0, seconds));
  if (p.interpolation != Interpolation::Arc) return off;
  const program::Arc &arc = a.arcs[p.shape], &other = b.arcs[q.shape];
  if (arc.first != other.first || arc.second != other.second ||
      (arc.sweep < 0) != (other.sweep < 0))
    return another;
  // the centre of half a turn by its R is as good as the root of the last digit
  const double far = (arc.centre - other.centre).norm() * 1000 / size;
  const bool half = std::abs(std::abs(arc.sweep) - pi) < 1e-3;
  if (half && far < 1e-5) return off;
  return std::max({off, far, std::abs(arc.sweep - other.sweep) * std::min(1.0, arc.radius)});
}

/// Blocks but those that are the rounding of a move to where the axes stand.
std::vector<Block> blocks_that_go(const Path& path) {
  std::vector<Block> blocks;
  for (const Block& block : path.blocks)
    if (block.end_s - block.start_s > same_mm || block.interpolation == Interpolation::Arc ||
        (block.end - block.start).cwiseAbs().maxCoeff() > same_mm)
      blocks.push_back(block);
  return blocks;
}

/// @param lines  are to be the same too
Difference difference_of(const Path& ours, const Path& theirs, bool lines = true) {
  Difference result;
  const std::vector<Block> of_ours = blocks_that_go(ours), of_theirs = blocks_that_go(theirs);
  for (std::size_t i = 0; i < std::min(of_ours.size(), of_theirs.size()); ++i) {
    const Block &p = of_ours[i], &q = of_theirs[i];
    const double off = distance_of(ours, p, theirs, q);
    if (off > same_mm || (lines && p.line != q.line)) {
      result.text = fmt::format("block {}: {} but LinuxCNC {}", i, text_of_block(ours, p),
                                text_of_block(theirs, q));
      return result;
    }
    result.off = std::max(result.off, off);
  }
  if (of_ours.size() != of_theirs.size())
    result.text = fmt::format("{} blocks but LinuxCNC {}", of_ours.size(), of_theirs.size());
  return result;
}

machines::Chain machine_named(const fs::path& folder) {
  const std::string name = machines::file_text((folder / "machine.txt").string());
  if (name.starts_with("platform")) return machines::platform();
  if (name.starts_with("three_axis")) return machines::three_axis();
  return machines::gantry();
}

TEST(LinuxCncByItself, GoldenProgramsMeanTheSame) {
  NEEDS_LINUXCNC;
  std::map<std::string, std::string> refused;
  int same = 0;
  double off = 0.0;
  for (const auto& entry : fs::directory_iterator(fs::path(ABBE_SOURCE_DIR) / "tests/golden")) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("linuxcnc_") && !name.starts_with("nc_")) continue;
    SCOPED_TRACE(name);
    ReadOptions options;
    options.control = machines::options_for(machine_named(entry.path()));
    options.control.tool_radius = {{1, 3.0}};
    options.dialect = Dialect::LinuxCnc;
    const bool ngc = fs::exists(entry.path() / "program.ngc");
    std::string text =
        machines::file_text((entry.path() / (ngc ? "program.ngc" : "program.nc")).string());
    if (text.find("M2") == std::string::npos && text.find("M30") == std::string::npos)
      text += "\nM2\n";  // the control wants an end
    ParsedProgram theirs;
    try {
      theirs = by_linuxcnc(text, options);
    } catch (const BadInput& fault) {
      refused[name] = fault.what();
      continue;
    }
    const Difference found = difference_of(read_program(text, "part.ngc", options).path,
                                           theirs.path, name != "linuxcnc_compensation");
    EXPECT_EQ(found.text, "");
    off = std::max(off, found.off);
    ++same;
  }
  for (const auto& [name, why] : refused) std::cout << name << ": " << why << "\n";
  std::cout << same << " programs mean the same within " << off << " mm, s or rad, "
            << refused.size() << " are refused\n";
  EXPECT_GE(same, 15);
}

/// How many of the programs that LinuxCNC takes abbe reads as the same.
struct Tally {
  int taken = 0, same = 0, both_refuse = 0, ours_alone = 0;
  std::size_t blocks = 0;
  double off = 0.0;
};

void compare(const std::string& text, unsigned seed, Tally& tally) {
  std::string no, theirs_no;
  ParsedProgram ours, theirs;
  try {
    ours = read_program(text, "part.ngc", six_axes());
  } catch (const BadInput& fault) {
    no = fault.what();
  }
  try {
    theirs = by_linuxcnc(text, six_axes());
  } catch (const BadInput& fault) {
    theirs_no = fault.what();
  }
  if (!theirs_no.empty()) {
    ++(no.empty() ? tally.ours_alone : tally.both_refuse);
    return;
  }
  ++tally.taken;
  const Difference found = no.empty() ? difference_of(ours.path, theirs.path)
                                      : Difference{"refused: " + no.substr(0, no.find('\n')), 0};
  if (found.text.empty()) {
    ++tally.same;
    tally.blocks += ours.path.blocks.size();
    tally.off = std::max(tally.off, found.off);
  } else {
    std::cout << "seed " << seed << ": " << found.text << "\n";
  }
}

void print(const Tally& tally, unsigned seed) {
  std::cout << "seeds from " << seed << ": " << tally.taken << " taken, " << tally.same
            << " the same (" << tally.blocks << " blocks) within " << tally.off << " mm, s or rad; "
            << tally.both_refuse << " refused by both, " << tally.ours_alone
            << " by LinuxCNC alone\n";
}

TEST(LinuxCncByItself, RandomProgramsMeanTheSame) {
  NEEDS_LINUXCNC;
  const unsigned first_seed = 41, programs = std::getenv("ABBE_LONG") != nullptr ? 150 : 50;
  Tally tally;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed)
    compare(test::Generator(seed).program(), seed, tally);
  print(tally, first_seed);
  EXPECT_EQ(tally.same, tally.taken);
  EXPECT_GE(3 * tally.taken, 2 * int(programs));
}

// Corners within 0.05 rad of straight back are outside for one and inside for the other, so these
// are held against the oracle, which reads the same commands with code of its own.
TEST(LinuxCncByItself, CompensatedProgramsAreWhatItPutsOut) {
  NEEDS_LINUXCNC;
  const test::Interpreter oracle(*find_linuxcnc());
  const unsigned first_seed = 41, programs = 60;
  int taken = 0;
  double off = 0.0;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed) {
    const std::string text = test::compensated_program(seed);
    const test::Interpreted read = oracle.run(text);
    Path path;
    try {
      path = by_linuxcnc(text, six_axes()).path;
    } catch (const BadInput& fault) {
      EXPECT_NE(read.code, 0) << "seed " << seed << ": " << fault.what();
      continue;
    }
    ASSERT_EQ(read.code, 0) << "seed " << seed;
    ++taken;
    const test::Comparison found =
        test::compared(test::moves_of(read.commands), test::moves_of(path), same_mm);
    EXPECT_EQ(found.difference, "") << "seed " << seed;
    off = std::max(off, found.off);
  }
  std::cout << "seeds from " << first_seed << ": " << taken << " of " << programs
            << " taken, the same within " << off << " mm\n";
  EXPECT_GE(taken, 20);
}

TEST(LinuxCncByItself, ModesOfFeedAndSpindleToolsAndStopsAreTheSame) {
  NEEDS_LINUXCNC;
  const std::string text =
      "G21 G90 G94 F300 (tool diameter 6 mm)\n"
      "T3 M6\nT4\nM6\nM61 Q5\nG43 H3\nG0 Z7\nT#31 M6 (in one block) G43 H2 G91 X1\nG90\nG0 "
      "X2\n"
      "S1000 M3 M8\nG1 X10\nG95 F0.2\nX20\nG93 G1 X30 A20 F2\n"
      "G94 F100\nG1 A0\nG4 P1.5\nM9\nM0\nM1\nG20 G1 X2\nF20 X3\nG21\nG96 D2000 S150\nF90 X20\n"
      "X5\nG97 S400\nG33 Z-10 K2\nG33.1 Z-20 K1\nG0 Z5\nG84 X1 Z-5 R2\nG80\nM5 G49\nG0 X0\nM30\n";
  const ReadOptions options = six_axes();
  const Path ours = read_program(text, "part.ngc", options).path;
  const Path theirs = by_linuxcnc(text, options).path;
  EXPECT_EQ(difference_of(ours, theirs).text, "");
  ASSERT_EQ(ours.tool_calls.size(), theirs.tool_calls.size());
  for (std::size_t i = 0; i < ours.tool_calls.size(); ++i) {
    EXPECT_EQ(ours.tool_calls[i].number, theirs.tool_calls[i].number) << i;
    EXPECT_EQ(ours.tool_calls[i].changes, theirs.tool_calls[i].changes) << i;
    EXPECT_EQ(ours.tool_calls[i].before, theirs.tool_calls[i].before) << i;
    EXPECT_EQ(ours.tool_calls[i].line, theirs.tool_calls[i].line) << i;
  }
  ASSERT_EQ(ours.auxiliary_words.size(), theirs.auxiliary_words.size());
  for (std::size_t i = 0; i < ours.auxiliary_words.size(); ++i) {
    EXPECT_EQ(ours.auxiliary_words[i].text, theirs.auxiliary_words[i].text) << i;
    EXPECT_EQ(ours.auxiliary_words[i].before, theirs.auxiliary_words[i].before) << i;
  }
  ASSERT_EQ(theirs.tool_comments.size(), 1u);
  EXPECT_EQ(theirs.tool_comments[0].words.diameter, 6.0);
}

TEST(LinuxCncByItself, OffsetsOfTheSceneAndThePlaceOfTheAxesAreItsOwn) {
  NEEDS_LINUXCNC;
  const std::string text =
      "G21 G90 F500\nG1 X1 Y2 Z3\nG91 X5 A7\nG90 G55 X1 Y1\nG53 G0 Z20\nX4\nG28.1\nG0 X9 Z1\n"
      "G28\nG10 L20 P3 X2 Y2\nG56 G1 X0 Y0\nG92 X5\nX6\nG92.1\nG59.1 X1 Z2\nG43 H1\nG0 Z1\n"
      "G53 G0 X1 Y2 Z3\nM2\n";
  ReadOptions options;
  options.control = machines::options_for(machines::gantry());
  options.dialect = Dialect::LinuxCnc;
  for (std::size_t i = 0; i < 6; ++i) {
    program::test::AxisVector offset(6);
    offset << 0.1, 10.0 + double(i), -20.25, 30.125, 0.2, 0.0;
    options.control.work_offset[i] = offset;
  }
  options.control.start << 0.5, 300.0, -20.0, 1.0 / 3.0, -0.25, 0.0;
  const Path ours = read_program(text, "part.ngc", options).path;
  const Difference found = difference_of(ours, by_linuxcnc(text, options).path);
  EXPECT_EQ(found.text, "");
  std::cout << ours.blocks.size() << " blocks within " << found.off << "\n";
  EXPECT_HAS(error_text("G10 L2 P1 X5\nG0 X1\nM2\n", options), "part.ngc:1: expected neither");
  EXPECT_HAS(error_text("G0 X1\nG0 X#5221\nM2\n", options), "part.ngc:2: expected neither");
}

/// What is in a folder while its name lives; TMPDIR leads into it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "abbe_test_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
    setenv("TMPDIR", path_.c_str(), 1);
  }
  ~TemporaryFolder() {
    unsetenv("TMPDIR");
    fs::remove_all(path_);
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST(LinuxCncByItself, SubprogramsInFilesOfTheirOwnKeepTheirLines) {
  NEEDS_LINUXCNC;
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "hole.ngc") << "(a hole)\no<hole> sub\nG0 X#1 Y#2\no<edge> call\n"
                                               "o<hole> endsub\nM2\n";
  std::ofstream(folder.path() / "edge.ngc") << "o<edge> sub\n\nG1 Z-1 F100\nG0 Z[3 + #<_up>]\n"
                                               "o<edge> endsub\n";
  ReadOptions options = six_axes();
  options.subprogram_folder = folder.path();
  const std::string text =
      "#<_up> = 2\n/G0 X99\nN7 o<hole> call [5] [6]\nO<HOLE> CALL [7] [8]\nM2\n";
  const Path ours = read_program(text, "part.ngc", options).path;
  const Path theirs = by_linuxcnc(text, options).path;
  EXPECT_EQ(difference_of(ours, theirs).text, "");
  ASSERT_EQ(theirs.blocks.size(), 6u);
  ASSERT_EQ(theirs.subprogram_files.size(), 2u);
  EXPECT_EQ(theirs.subprogram_files[theirs.blocks[1].file - 1u],
            (folder.path() / "edge.ngc").string());
  EXPECT_EQ(theirs.blocks[1].line, 3);
  std::ofstream(folder.path() / "edge.ngc") << "o<edge> sub\n\nG1 Z-1 F100\nG12\no<edge> endsub\n";
  const std::string fault = error_text(text, options);
  EXPECT_HAS(fault, (folder.path() / "edge.ngc").string() + ":4: ");
  EXPECT_HAS(fault, "Unknown g code");
}

TEST(LinuxCncByItself, WhatItRefusesIsAFaultWithItsPlaceAndItsMessage) {
  NEEDS_LINUXCNC;
  const ReadOptions options = six_axes();
  const std::pair<const char*, const char*> programs[] = {
      {"G0 X1\nG12\nM2\n", "part.ngc:2: expected a block accepted by LinuxCNC's own interpreter"},
      {"G0 X1\n\nG0 X[1/0]\nM2\n", "part.ngc:3: "},
      {"G0 X1\nG0 X2\n", "File ended with no percent sign or program end"},
      {"G0 X1\no<none> call\nG0 X2\nM2\n", "part.ngc:2: "},
      {"G0 X1\nG0 U5\nM2\n", "part.ngc:2: "},
      {"o100 sub\no100 call\no100 endsub\no100 call\nM2\n", "Too many subroutine levels"},
      {"G0 X1\nM199\nM2\n", "Unknown m code used: M199"},
  };
  for (const auto& [text, expected] : programs) {
    const std::string fault = error_text(text, options);
    EXPECT_HAS(fault, expected) << text;
  }
}

TEST(LinuxCncByItself, WhatItCannotGiveIsRefusedByName) {
  NEEDS_LINUXCNC;
  ReadOptions options = six_axes();
  options.control.tool_length = {{1, 100.0}};
  options.control.tool_radius = {{1, 3.0}};
  const std::pair<const char*, const char*> programs[] = {
      {"G21 G43 H1\nG20\nG53 G0 Z0\nM2\n",
       "part.ngc:3: expected no G53 after a switch between G20 and G21"},
      {"G21 G43 H1\nG20\nG28 Z0\nM2\n",
       "part.ngc:3: expected no G28 and G30 after a switch between G20 and G21"},
      {"G21 G43 H1\nG20\nG49\nM2\n",
       "part.ngc:3: expected no G43 and G49 after a switch between G20 and G21"},
      {"T1 M6 G[40 + 3] H1\nG0 X1\nM2\n", "part.ngc:1: expected M6 in a separate block"},
      {"F100\nG5 X1 Y1 I1 J1 P1 Q1\nM2\n", "part.ngc:2: expected no G5, G5.1 and G5.2"},
      {"F100\nG38.2 X5\nM2\n", "part.ngc:2: expected no probing"},
      {"G0 X1\nM66 P0 L0\nM2\n", "part.ngc:2: expected no wait for an input"},
      {"G0 X1\nG43 H5\nM2\n", "part.ngc:2: expected a known tool length (H1)"},
      {"F10\nG41 D7\nG1 X20\nM2\n", "part.ngc:2: expected a tool with a known radius"},
      {"G0 X2e6\nM2\n", "part.ngc:1: "},
      {"G0 X2000000\nM2\n", "part.ngc:1: expected a position within 1e6 mm"},
  };
  for (const auto& [text, expected] : programs) {
    const std::string fault = error_text(text, options);
    EXPECT_HAS(fault, expected) << text;
  }
  EXPECT_EQ(error_text("G21 G43 H1\nG20\nG0 Z1\nG21\nG53 G0 Z0\nM2\n", options), "none");
  EXPECT_HAS(error_text("G0 X1 (" + std::string(300, 'a') + ")\nM2\n", options),
             "part.ngc:1: expected at most 252 characters");
  ReadOptions three;
  three.control = machines::options_for(machines::three_axis());
  three.dialect = Dialect::LinuxCnc;
  const std::string fault = error_text("G0 X1\nG0 A5\nG0 X2\nG1 X3\nM2\n", three);
  EXPECT_HAS(fault, "part.ngc:2: expected an axis of this machine (X Y Z)");
  EXPECT_EQ(fault.find("part.ngc:3: "), std::string::npos) << fault;
  EXPECT_HAS(fault, "part.ngc:4: expected a block");
  ReadOptions any = six_axes();
  any.dialect = Dialect::Auto;
  EXPECT_HAS(error_text("O1001\nG65 P9010 A1\nM30\n", any),
             "part.ngc:1: expected a LinuxCNC program");
}

TEST(LinuxCncByItself, ProgramsStartNothingAndReadNothingElsewhere) {
  NEEDS_LINUXCNC;
  const TemporaryFolder folder;
  const fs::path written = folder.path() / "written", sub = folder.path() / "sub.ngc";
  const std::string python = "py,open('" + written.string() + "','w').write('x')";
  std::ofstream(sub) << "o<sub> sub\nG0 X5\no<sub> endsub\n;" << python << "\n";
  ReadOptions options = six_axes();
  const std::string path = fs::path(sub).replace_extension().string();
  const std::vector<std::string> escapes = {";" + python,
                                            "; " + python,
                                            "/;" + python,
                                            "(" + python + ")",
                                            " ;PY,1",
                                            "N1 ;" + python,
                                            "%;" + python,
                                            "o<" + path + "> call",
                                            "N5 O < ../" + path + " > CALL",
                                            ";" + python + std::string(400, ' ')};
  for (const std::string& line : escapes) {
    const std::string fault = error_text("G0 X1\n" + line + "\nM2\n", options);
    EXPECT_HAS(fault, "part.ngc:2: expected") << line;
    EXPECT_FALSE(fs::exists(written)) << line;
  }
  options.subprogram_folder = folder.path();
  const std::string fault = error_text("G0 X1\no<sub> call\nM2\n", options);
  EXPECT_HAS(fault, "sub.ngc:4: expected no Python");
  EXPECT_EQ(error_text("G0 X1 (logopen," + written.string() + ")\n(log,x)\nM2\n", options), "none");
  EXPECT_FALSE(fs::exists(written));
}

TEST(LinuxCncByItself, ProgramsWithoutEndEndByTheLimits) {
  NEEDS_LINUXCNC;
  const auto seconds_of = [](const std::string& text, const ReadOptions& options,
                             const char* expected) {
    const auto start = std::chrono::steady_clock::now();
    const std::string fault = error_text(text, options);
    EXPECT_HAS(fault, expected) << text;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  ReadOptions options = six_axes();
  options.on_path_segment = [](const Path&) {};
  options.interpreter_limits.seconds = 1.0;
  for (const char* text : {"o1 while [1]\n#1 = [#1 + 1]\no1 endwhile\nM2\n",
                           "o1 while [1]\n(PRINT, #1)\n(DEBUG, more)\no1 endwhile\nM2\n"}) {
    const double seconds = seconds_of(text, options, "within 1 s");
    std::cout << "a limit of 1 s took " << seconds << " s\n";
    EXPECT_LT(seconds, 10.0);
  }
  options.interpreter_limits = {.seconds = 60.0, .megabytes = 2.0};
  const std::string endless = "F100\nG91\no1 while [1]\nG1 X1\nG1 X-1\no1 endwhile\nM2\n";
  std::cout << "2 MB took " << seconds_of(endless, options, "at most 2 MB of commands") << " s\n";
  options.interpreter_limits = {};
  options.limits.blocks = 50'000;
  std::cout << "50000 blocks took " << seconds_of(endless, options, "at most 50000 blocks")
            << " s\n";
}

TEST(LinuxCncByItself, RunsAtOnceDoNotDisturbOneAnother) {
  NEEDS_LINUXCNC;
  const TemporaryFolder folder;
  const auto program_of = [](int n) {
    std::string text = "G21 F100\nG10 L2 P1 X" + std::to_string(n) + "\nT" + std::to_string(n) +
                       " M6\nG43\nG10 L1 P" + std::to_string(n) + " Z" + std::to_string(3 * n) +
                       "\nG43\n";
    for (int k = 0; k < 2000; ++k) text += fmt::format("G1 X{} Z{}\n", k * n, k);
    return text + "M2\n";
  };
  std::vector<Path> alone, together(6);
  for (int n = 1; n <= 6; ++n) alone.push_back(by_linuxcnc(program_of(n), six_axes()).path);
  std::vector<std::thread> threads;
  for (int n = 1; n <= 6; ++n)
    threads.emplace_back(
        [&, n] { together[std::size_t(n - 1)] = by_linuxcnc(program_of(n), six_axes()).path; });
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < 6; ++i) {
    ASSERT_EQ(alone[i].blocks.size(), together[i].blocks.size());
    for (std::size_t k = 0; k < alone[i].blocks.size(); ++k)
      ASSERT_EQ(alone[i].blocks[k].end, together[i].blocks[k].end) << i << " " << k;
    EXPECT_EQ(difference_of(read_program(program_of(int(i) + 1), "part.ngc", six_axes()).path,
                            together[i])
                  .text,
              "");
  }
  EXPECT_TRUE(fs::is_empty(folder.path())) << "folders are left";
}

TEST(LinuxCncByItself, InjuredProgramsEndInBlocksOrFaults) {
  NEEDS_LINUXCNC;
  const TemporaryFolder folder;
  const unsigned seed = 20261125, programs = 120;
  std::mt19937 random(seed);
  int taken = 0, refused = 0, same = 0, theirs_alone = 0;
  for (unsigned n = 0; n < programs; ++n) {
    const std::string text =
        injured(test::Generator(seed + n).program(), "GMXYZFo<>[]#%/();.-123\n", 1, random);
    ReadOptions options = six_axes();
    options.limits.blocks = 100'000;
    options.interpreter_limits.seconds = 5.0;
    Path ours, theirs;
    bool ours_too = true;
    try {
      ours = read_program(text, "part.ngc", options).path;
    } catch (const BadInput&) {
      ours_too = false;
    }
    try {
      theirs = by_linuxcnc(text, options).path;
    } catch (const BadInput& fault) {
      ++refused;
      EXPECT_HAS(fault.what(), "part.ngc");
      continue;
    }
    ++taken;
    theirs_alone += !ours_too;
    same += ours_too && difference_of(ours, theirs).text.empty();
  }
  std::cout << "seed " << seed << ": " << taken << " taken, " << same << " of them the same, "
            << theirs_alone << " not read by abbe; " << refused << " refused\n";
  EXPECT_TRUE(fs::is_empty(folder.path())) << "folders are left";
  EXPECT_GE(same, (taken - theirs_alone) * 9 / 10);
}

TEST(LinuxCncByItself, WithoutItTheFaultSaysHowToGetIt) {
  const char* named = std::getenv("ABBE_LINUXCNC");
  const std::string before = named == nullptr ? "" : named;
  setenv("ABBE_LINUXCNC", "/nowhere", 1);
  const std::string fault = error_text("G0 X1\nM2\n", six_axes());
  if (named == nullptr)
    unsetenv("ABBE_LINUXCNC");
  else
    setenv("ABBE_LINUXCNC", before.c_str(), 1);
  EXPECT_HAS(fault, "./abbe setup --linuxcnc");
}

}  // namespace
}  // namespace abbe::sim::dialects
