// Programs read by LinuxCNC's interpreter and by abbe: the same moves, offsets applied.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "sim/dialects/bad_program.h"
#include "sim/dialects/linuxcnc.h"
#include "sim/dialects/read_program.h"
#include "tests/dialects/linuxcnc_interpreter.h"
#include "tests/dialects/linuxcnc_moves.h"
#include "tests/dialects/linuxcnc_programs.h"
#include "tests/program/machines.h"

namespace abbe::sim::dialects {
namespace {

using program::test::Motion;
using test::compared;
using test::Comparison;
using test::Move;
using test::moves_of;

constexpr std::string_view letters = "XYZABC";

ReadOptions oracle_options() {
  ReadOptions options;
  for (const char letter : letters)
    options.control.axes.push_back({letter, letter < 'X' ? Motion::Rotary : Motion::Linear});
  for (int n = 1; n <= test::tools; ++n) {
    options.control.tool_length[n] = test::tool_length(n);
    options.control.tool_radius[n] = test::tool_radius(n);
  }
  options.dialect = Dialect::LinuxCnc;
  options.limits.blocks = 3'000'000;
  return options;
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

TEST(LinuxCncOracle, SamplesGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  int accepted = 0, same = 0, empty = 0, refused_by_name = 0;
  std::vector<test::fs::path> files;
  for (const char* folder : {"usr/share/linuxcnc/ncfiles", "usr/share/doc/linuxcnc/examples"}) {
    if (!test::fs::exists(*packages / folder)) continue;
    for (const auto& entry : test::fs::recursive_directory_iterator(*packages / folder))
      if (entry.path().extension() == ".ngc") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  double off = 0.0;
  for (const auto& file : files) {
    const test::Interpreted read = interpreter.run(file, file.parent_path());
    if (read.code != 0) continue;
    std::vector<Move> theirs;
    try {
      theirs = test::moves_of(read.commands);
    } catch (const std::exception&) {
      std::cout << file.filename() << ": its commands are not understood\n";
      continue;
    }
    if (theirs.empty() && ++empty > 0) continue;
    ++accepted;
    std::string difference;
    bool by_name = false;
    try {
      const ReadProgram ours = read_program_file(file, oracle_options());
      const Comparison result = compared(theirs, moves_of(ours.path), tolerance);
      difference = result.difference;
      if (difference.empty()) off = std::max(off, result.off);
    } catch (const BadInput& fault) {
      difference = "refused: " + first_line(fault.what());
      by_name = std::any_of(linuxcnc_words().begin(), linuxcnc_words().end(), [&](auto& word) {
        return word.use == Use::Refused && fault.expected == word.sentence;
      });
    }
    same += difference.empty();
    refused_by_name += by_name;
    if (!difference.empty())
      std::cout << test::fs::relative(file, *packages / "usr/share").string() << ": " << difference
                << "\n";
  }
  const int claimed = accepted - refused_by_name;
  std::cout << files.size() << " files, " << accepted << " that LinuxCNC runs and that move ("
            << empty << " others run and do not move), " << refused_by_name
            << " of them with words refused by name, " << same << " the same within " << off
            << " mm\n";
  EXPECT_EQ(same, claimed - 2) << "two whose place is read again after M6 by rs274 alone";
}

TEST(LinuxCncOracle, RandomCompensatedProgramsGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  const unsigned first_seed = 20261124, programs = 1000;
  int accepted = 0, same = 0, ours_alone = 0, both_refuse = 0, theirs_alone = 0;
  std::size_t moves = 0;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed) {
    const std::string text = test::compensated_program(seed);
    const test::Interpreted read = interpreter.run(text);
    std::vector<Move> ours;
    std::string no;
    try {
      ours = moves_of(read_program(text, "random.ngc", oracle_options()).path);
    } catch (const BadInput& fault) {
      no = first_line(fault.what());
    }
    if (read.code != 0) {
      ++(no.empty() ? ours_alone : both_refuse);
      if (no.empty() && std::getenv("ABBE_KEEP") != nullptr) {
        std::cout << "seed " << seed << " read by abbe alone: " << read.message.substr(0, 200)
                  << "\n";
        std::ofstream(fmt::format("{}/c{}.ngc", std::getenv("ABBE_KEEP"), seed)) << text;
      }
      continue;
    }
    ++accepted;
    moves += ours.size();
    Comparison result;
    if (no.empty()) result = compared(test::moves_of(read.commands), ours, tolerance);
    theirs_alone += !no.empty();
    same += no.empty() && result.difference.empty();
    if (!no.empty() || !result.difference.empty()) {
      std::cout << "seed " << seed << ": " << (no.empty() ? result.difference : no) << "\n";
      if (std::getenv("ABBE_KEEP") != nullptr)
        std::ofstream(fmt::format("{}/c{}.ngc", std::getenv("ABBE_KEEP"), seed)) << text;
    }
  }
  std::cout << "seeds from " << first_seed << ": " << accepted << " of " << programs
            << " programs that LinuxCNC runs, " << same << " the same (" << moves << " moves), "
            << theirs_alone << " refused by abbe alone, " << ours_alone << " by LinuxCNC alone, "
            << both_refuse << " by both\n";
  // a corner within 0.05 rad of straight back is outside for one and inside for the other
  EXPECT_GE(same * 100, accepted * 90);
  EXPECT_LE(ours_alone * 100, accepted);
}

TEST(LinuxCncOracle, RandomProgramsGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  const unsigned first_seed = 20261124, programs = 1000;
  int accepted = 0, same = 0, both_refuse = 0;
  std::size_t moves = 0;
  double off = 0.0;
  std::map<std::string, int> theirs_alone;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed) {
    const std::string text = test::Generator(seed).program();
    const test::Interpreted read = interpreter.run(text);
    std::string no;
    std::vector<Move> ours;
    try {
      ours = moves_of(read_program(text, "random.ngc", oracle_options()).path);
    } catch (const BadInput& fault) {
      no = first_line(fault.what());
    }
    if (read.code != 0) {
      both_refuse += !no.empty();
      std::string why = read.message.substr(0, read.message.rfind('\n'));
      why = why.substr(0, why.rfind('\n'));
      why = why.substr(why.rfind('\n') + 1);
      if (no.empty()) ++theirs_alone[why.substr(0, 60)];
      continue;
    }
    ++accepted;
    Comparison result;
    if (no.empty()) result = compared(test::moves_of(read.commands), ours, tolerance);
    if (!no.empty()) result.difference = "refused: " + no;
    same += result.difference.empty();
    moves += ours.size();
    if (result.difference.empty()) off = std::max(off, result.off);
    if (!result.difference.empty()) {
      std::cout << "seed " << seed << ": " << result.difference << "\n";
      if (std::getenv("ABBE_KEEP") != nullptr)
        std::ofstream(fmt::format("{}/{}.ngc", std::getenv("ABBE_KEEP"), seed)) << text;
    }
  }
  for (const auto& [why, count] : theirs_alone)
    std::cout << count << " refused by LinuxCNC alone: " << why << "\n";
  std::cout << "seeds from " << first_seed << ": " << accepted << " of " << programs
            << " programs that LinuxCNC runs, " << same << " the same, " << moves
            << " moves within " << off << " mm; " << both_refuse << " refused by both\n";
  EXPECT_EQ(same, accepted);
  EXPECT_GE(accepted, 700);
}

}  // namespace
}  // namespace abbe::sim::dialects
