// Programs read by LinuxCNC's interpreter and by abbe: the same moves, offsets applied.

#include <cctype>
#include <regex>
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/dialects/linuxcnc_interpreter.h"
#include "tests/dialects/linuxcnc_moves.h"
#include "tests/dialects/linuxcnc_programs.h"
#include "tests/program/machines.h"
#include "tests/test.h"

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

bool is_long_form() { return std::getenv("ABBE_LONG") != nullptr; }

/// Random programs of a test. A start of the interpreter takes 70 ms.
int random_programs() { return is_long_form() ? 1000 : 250; }

/// Returns false if a program certainly moves nothing: outside of its subroutines it names no axis,
/// calls nothing, and has no arc, G28, G30 or M98, which move without naming an axis.
bool may_move(const std::string& program) {
  static const std::regex remark(R"(\([^)]*\)|;.*)"), name("<[^>]*>");
  static const std::regex begin(R"(/?(n\d+)?o(<[^>]*>|\d+)sub.*)");
  static const std::regex end(R"(/?(n\d+)?o(<[^>]*>|\d+)endsub.*)");
  static const std::regex motion(R"([xyzabcuvw]|call|g28|g30|g0?[23](\D|$)|m98)");
  std::istringstream lines(program);
  bool is_in_subroutine = false;
  for (std::string line; std::getline(lines, line);) {
    std::string text = std::regex_replace(line, remark, "");
    std::erase_if(text, [](unsigned char c) { return std::isspace(c) != 0; });
    for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
    if (std::regex_match(text, begin)) is_in_subroutine = true;
    if (!is_in_subroutine && std::regex_search(std::regex_replace(text, name, ""), motion))
      return true;
    if (std::regex_match(text, end)) is_in_subroutine = false;
  }
  return false;
}

TEST(LinuxCncOracle, SamplesGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  int accepted = 0, same = 0, empty = 0, refused_by_name = 0;
  std::vector<fs::path> files;
  for (const char* folder : {"usr/share/linuxcnc/ncfiles", "usr/share/doc/linuxcnc/examples"}) {
    if (!fs::exists(*packages / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(*packages / folder))
      if (entry.path().extension() == ".ngc") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  double off = 0.0;
  int skipped = 0;
  for (const auto& file : files) {
    // two thirds of the files are subroutines alone, which are read where they are called
    if (!is_long_form() && !may_move(program::test::file_text(file.string()))) {
      ++skipped;
      continue;
    }
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
      const ParsedProgram ours = read_program_file(file, oracle_options());
      const Comparison result = compared(theirs, moves_of(ours.path), tolerance);
      difference = result.difference;
      if (difference.empty()) off = std::max(off, result.off);
    } catch (const BadInput& fault) {
      difference = "refused: " + first_line(fault.what());
      by_name = std::any_of(linuxcnc_words().begin(), linuxcnc_words().end(), [&](auto& word) {
        return word.use == WordTreatment::Refused && fault.expected == word.sentence;
      });
    }
    same += difference.empty();
    refused_by_name += by_name;
    if (!difference.empty())
      std::cout << fs::relative(file, *packages / "usr/share").string() << ": " << difference
                << "\n";
  }
  const int claimed = accepted - refused_by_name;
  std::cout << files.size() << " files, " << skipped << " not run as they cannot move, " << accepted
            << " that LinuxCNC runs and that move (" << empty << " others run and do not move), "
            << refused_by_name << " of them with words refused by name, " << same
            << " the same within " << off << " mm\n";
  EXPECT_EQ(same, claimed - 2) << "two whose place is read again after M6 by rs274 alone";
}

/// What LinuxCNC refuses is refused, for every code of the table beside words of every kind; what
/// both read is the same moves. In the default form every line is read by abbe, LinuxCNC reads all
/// lines that abbe reads and every eighth of those that abbe refuses.
TEST(LinuxCncOracle, CodesBesideWordsAreRefusedWhereLinuxCncRefusesThem) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  // abbe's own words, and a spindle that rs274 alone has not
  const std::set<std::string> own = {"G43.4", "M428", "M429", "M98", "M99"};
  const std::string begin = "G21 G90 G94 M3 S100 T2 M6\nG1 X1 Y2 Z3 F100\n";
  const int stride = is_long_form() ? 1 : 8;
  int lines = 0, both = 0, refusals = 0, refused = 0, ours_alone = 0;
  const auto compare = [&](const std::string& tried) {
    SCOPED_TRACE(tried);
    const std::string text = begin + tried + "\nG1 X50 Y60 Z70 F100\nM2\n";
    ++lines;
    std::vector<Move> ours;
    try {
      ours = moves_of(read_program(text, "code.ngc", oracle_options()).path);
    } catch (const BadInput&) {
      if (refusals++ % stride == 0) ++(interpreter.run(text).code != 0 ? refused : ours_alone);
      return;
    }
    const test::Interpreted theirs = interpreter.run(text);
    EXPECT_EQ(theirs.code, 0) << "LinuxCNC: " << theirs.message;
    if (theirs.code != 0) return;
    ++both;
    // rs274 does not print the points of splines
    if (tried.starts_with("G5 ") || tried.starts_with("G5.")) return;
    EXPECT_EQ(compared(test::moves_of(theirs.commands), ours, 1e-8).difference, "");
  };
  for (const WordTableEntry& use : linuxcnc_words())
    each_word(use.word, [&](std::string_view word) {
      const bool code = word.size() > 1 && (word[0] == 'G' || word[0] == 'M') &&
                        std::isdigit(static_cast<unsigned char>(word[1])) != 0;
      if (!code || use.use == WordTreatment::Refused || own.contains(std::string(word))) return;
      for (const char* beside : {"", "P1", "Q1", "E1", "D1", "L2 P1", "K1", "R1", "X7 Y8 Z9",
                                 "P1 X7 Z-9 R1", "E1 Q1 X7", "P-1", "I1 J1"})
        compare(fmt::format("{} {}", word, beside));
    });
  // words without a code, and codes that meet
  for (const char* tried : {"G83 X7 Z-9 R1 Q1\nQ2",
                            "G81 X7 Z-9 R1\nR2",
                            "G81 X7 Z-9 R1\nL3",
                            "G81 X7 Z-9 R1\nG81",
                            "G82 X7 Z-9 R1 P1\nP2",
                            "G82 X7 Z-9 R1 P1\nX9",
                            "G82 X7 Z-9 R1 P1\nG80\nG82 X8 Z-9 R1",
                            "G33 X5 K1\nK2",
                            "G2 X3 Y2 I1\nI1",
                            "G2 X3 Y2 I1\nP2",
                            "G2 X3 Y2 I1\nR5",
                            "G91 G53 G0 X7",
                            "G91\nG53 G0 X7",
                            "G28 G0",
                            "G30 G1",
                            "G92 G1",
                            "G10 L2 P1 G1",
                            "G92.1 G0",
                            "G80 G0 X7",
                            "G0 G80 X7",
                            "G80 G81 X7 Z-9 R1\nX9",
                            "G80 G2 X3 I1",
                            "G80 G28 Z5",
                            "G80 G53 G0 X7",
                            "M7 M8",
                            "M7 M9",
                            "M8 M8",
                            "N-1 X7",
                            "N1.5 X7",
                            "G94\nX7",
                            "G95 X7 F0.1\nG95 X8",
                            "G94 F50 X7",
                            "G5.1 X7 I1",
                            "G5.1 X7 J1",
                            "M19 R5 Q-1",
                            "X[round[-2.5]]",
                            "X[round[-0.5]]",
                            "X[round[2.5]]",
                            "X[fix[-2.5]]",
                            "X[-7 mod 4]",
                            "X[2-3-4]",
                            "X[2**3**2]",
                            "X[5.5 mod 2]",
                            "X[3 mod -4]",
                            "g1 x 7",
                            "G1X+7",
                            "X1 2",
                            "N#1 X5",
                            "N[5] X5",
                            "o1 endif",
                            "o1 else",
                            "o1 sub\no2 sub\nX6\no2 endsub\no2 call\no1 endsub\no1 call",
                            "o1 if [1]\nX5\no1 else\nX6\no1 endif",
                            "o1 if [0]\nX5\no1 elseif [1]\nX6\no1 endif",
                            "#5221=0.5\nG54\nX0",
                            "#5221=0.5\nX0",
                            "#5221=0\nG10 L2 P1 Y5\nX0",
                            "T7 M6\nX[#5403/#5403]",
                            "T3 M6\nG43 H7\nX[#5403/#5403] Z5",
                            "(debug, X9) X7",
                            "G1 X7 ; Y8",
                            "X7 #1=9\nX#1",
                            "#1=7 X#1",
                            "G4 P1 X7",
                            "G19 G2 Y4 Z3 J1 P3"})
    compare(tried);
  std::cout << lines << " lines: " << both << " read by both, " << refusals
            << " refused by abbe, of which one in " << stride << " was tried: " << refused
            << " refused by both, " << ours_alone << " by abbe alone\n";
  EXPECT_LT(ours_alone * stride, lines / 10);
}

TEST(LinuxCncOracle, RandomCompensatedProgramsGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  const unsigned first_seed = 20261124;
  const int programs = random_programs();
  int accepted = 0, same = 0, ours_alone = 0, both_refuse = 0, theirs_alone = 0;
  std::size_t moves = 0;
  for (unsigned seed = first_seed; seed < first_seed + unsigned(programs); ++seed) {
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
  // one in a hundred; in the default form, of some 170 programs, three standard deviations of the
  // binomial count more: 1.7 + 3 * 1.3, so five
  const double expected = accepted / 100.0;
  EXPECT_LE(ours_alone, is_long_form() ? expected : expected + 3.0 * std::sqrt(0.99 * expected));
}

TEST(LinuxCncOracle, RandomProgramsGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const test::Interpreter interpreter(*packages);
  const double tolerance = 1e-8;
  const unsigned first_seed = 20261124;
  const int programs = random_programs();
  int accepted = 0, same = 0, both_refuse = 0;
  std::size_t moves = 0;
  double off = 0.0;
  std::map<std::string, int> theirs_alone;
  for (unsigned seed = first_seed; seed < first_seed + unsigned(programs); ++seed) {
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
  EXPECT_GE(accepted * 10, programs * 7);
}

}  // namespace
}  // namespace abbe::sim::dialects
