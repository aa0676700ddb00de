// Programs read by LinuxCNC's interpreter and by abbe: the same moves, offsets applied.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "sim/dialects/bad_program.h"
#include "sim/dialects/linuxcnc.h"
#include "sim/dialects/read_program.h"
#include "tests/dialects/linuxcnc_interpreter.h"
#include "tests/program/machines.h"

namespace abbe::sim::dialects {
namespace {

using program::test::AxisVector;
using program::test::Motion;
using test::Move;

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

std::vector<Move> moves_of(const program::Path& path) {
  std::vector<Move> moves;
  for (const program::Block& block : path.blocks) {
    if (block.interpolation == program::Interpolation::Dwell) continue;
    Move move;
    for (int k = 0; k < 6; ++k)
      move.end[std::size_t(k)] = block.end[k] / (k < 3 ? 1.0 : units::deg);
    move.kind =
        block.interpolation == program::Interpolation::Rapid ? Move::Kind::Rapid : Move::Kind::Feed;
    if (block.interpolation == program::Interpolation::Arc) {
      const program::Arc& arc = path.arcs[block.shape];
      move.kind = Move::Kind::Arc;
      move.centre = {arc.centre.x(), arc.centre.y()};
      move.sweep = arc.sweep;
    }
    moves.push_back(move);
  }
  return moves;
}

struct Comparison {
  std::string difference;  ///< empty: none
  double off = 0.0;        ///< mm, degrees
  std::size_t moves = 0;
};

std::string text_of(const Move& move) {
  static constexpr const char* names[] = {"rapid", "feed", "arc", "spline"};
  std::string text = names[int(move.kind)];
  for (const double one : move.end) text += fmt::format(" {:.6f}", one);
  if (move.kind == Move::Kind::Arc)
    text +=
        fmt::format(" about {:.6f} {:.6f} by {:.6f}", move.centre[0], move.centre[1], move.sweep);
  return text;
}

double distance(const Move& a, const Move& b) {
  if (a.kind != b.kind) return 1e9;
  double off = 0.0;
  for (std::size_t k = 0; k < 6; ++k) off = std::max(off, std::abs(a.end[k] - b.end[k]));
  if (a.kind != Move::Kind::Arc) return off;
  // the centre of half a turn by its R is as good as the root of the last digit
  const bool half = std::abs(std::abs(a.sweep) - pi) < 1e-3;
  for (std::size_t k = 0; k < 2; ++k)
    off = std::max(off, (half ? 0.01 : 1.0) * std::abs(a.centre[k] - b.centre[k]));
  return std::abs(a.sweep - b.sweep) > 1e-3 ? 1e9 : off;
}

/// Move by move. Of a spline LinuxCNC prints no points: the chords of ours up to the move that is
/// its next are passed over.
Comparison compared(const std::vector<Move>& theirs, const std::vector<Move>& ours,
                    double tolerance) {
  Comparison result;
  result.moves = ours.size();
  std::size_t j = 0;
  for (std::size_t i = 0; i < theirs.size(); ++i) {
    if (theirs[i].kind == Move::Kind::Spline) {
      while (j < ours.size() && ours[j].kind == Move::Kind::Feed &&
             (i + 1 == theirs.size() || distance(theirs[i + 1], ours[j]) > tolerance))
        ++j;
      continue;
    }
    if (j == ours.size()) break;
    double size = 1000.0;
    for (const double one : ours[j].end) size = std::max(size, std::abs(one));
    const double off = distance(theirs[i], ours[j]);
    result.off = std::max(result.off, off);
    if (off > tolerance * size / 1000) {
      result.difference =
          fmt::format("move {}: {} but LinuxCNC {}", j, text_of(ours[j]), text_of(theirs[i]));
      return result;
    }
    ++j;
    if (i + 1 == theirs.size() && j == ours.size()) return result;
  }
  if (j != ours.size() || (!theirs.empty() && theirs.back().kind != Move::Kind::Spline))
    if (theirs.size() != ours.size())
      result.difference = fmt::format("{} moves but LinuxCNC {}", ours.size(), theirs.size());
  return result;
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

TEST(LinuxCncOracle, SamplesGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "ABBE_LINUXCNC is not set";
  const test::Interpreter interpreter(*packages);
  const double tolerance = interpreter.all_digits() ? 1e-8 : 2e-4;
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

/// Programs over the grammar that both read: parameters, expressions, loops, calls, offsets, arcs,
/// cycles, in an order that makes sense to a control.
class Generator {
 public:
  explicit Generator(unsigned seed) : random_(seed) {}

  std::string program() {
    text_ = "G21 G90 G94 G17 G40 G49 G80 F500\n";
    say("o100 sub");
    say("G1 X[#1 + {}] Y#2", number(5));
    say("o101 if [#1 GT {}]", number(20));
    say("G1 Z[#2 / {}]", 1 + whole(9));
    say("o101 elseif [#1 LT 0 AND #2 NE 3]");
    say("G0 Z{}", number(5));
    say("o101 else");
    say("#<z> = [ABS[#1] MOD 7]");
    say("G1 Z#<z> F{}", 100 + whole(900));
    say("o101 endif");
    say("o100 endsub [#1 * 2]");
    say("#31 = {}", number(10));
    say("#<_wide> = [{} - SIN[{}] * {}]", number(9), number(180), number(9));
    const int lines = 10 + whole(30);
    for (int n = 0; n < lines; ++n) line();
    say("G40");
    say("M2");
    return text_;
  }

 private:
  template <typename... Parts>
  void say(const char* format, const Parts&... parts) {
    text_ += fmt::format(fmt::runtime(format), parts...) + "\n";
  }
  int whole(int below) { return int(random_() % unsigned(below)); }
  std::string number(double size) {
    const double value = (double(random_() % 2000001) / 1e6 - 1) * size;
    return fmt::format("{:.{}f}", value, 1 + whole(4));
  }
  std::string value(double size) {
    switch (whole(6)) {
      case 0:
        return fmt::format("[{} + #31]", number(size));
      case 1:
        return fmt::format("[{} * COS[{}] ** 2]", number(size), number(90));
      case 2:
        return "#<_wide>";
      case 3:
        return fmt::format("[ATAN[{}]/[{}] / 10]", number(5), number(5));
      default:
        return number(size);
    }
  }
  void arc() {
    // an arc by its centre: the end lies on the circle
    const double i = 1 + whole(20), turn = 0.3 + 0.1 * whole(50);
    const double x = i * (1 - std::cos(turn)), y = -i * std::sin(turn);
    static constexpr const char* planes[][4] = {
        {"G17", "X", "Y", "I"}, {"G18", "Z", "X", "K"}, {"G19", "Y", "Z", "J"}};
    const auto& plane = planes[whole(3)];
    say("{} G91 G{} {}{:.10f} {}{:.10f} {}{:.10f} P{}", plane[0], 2 + whole(2), plane[1], x,
        plane[2], y, plane[3], i, 1 + whole(3));
    say("G90 G17");
  }
  void cycle() {
    const double r = whole(10), z = r - 1 - whole(20);
    static constexpr const char* codes[] = {"G81", "G82", "G83", "G73", "G85", "G89"};
    const int one = whole(6);
    say("G0 Z{}", 10 + whole(20));
    std::string words;
    if (one == 2 || one == 3) words += fmt::format(" Q{}", 1 + whole(5));
    if (one == 1 || one == 5) words += " P0.1";
    say("G{} {} X{} Y{} Z{} R{}{}", 98 + whole(2), codes[one], value(30), value(30), z, r, words);
    for (int n = whole(3); n > 0; --n) say("X{} Y{}", value(30), value(30));
    if (whole(3) == 0) say("G91 X{} Y{} R-1 Z-2 L{}", value(9), value(9), 1 + whole(4));
    say("G80 G90");
  }
  void offset() {
    switch (whole(8)) {
      case 0:
        // LinuxCNC loses its place where a system is turned while G92 or G52 is in force
        say("G92.1");
        return say("G10 L2 P{} X{} Y{} Z{} R{}", 1 + whole(9), number(50), number(50), number(50),
                   whole(2) == 0 ? "0" : number(90));
      case 1:
        return say("G10 L20 P{} X{} Z{}", 1 + whole(9), number(50), number(50));
      case 2:
        return say("G92 X{} Y{}", value(20), value(20));
      case 3:
        return say("G92.1");
      case 4:
        return say("G52 X{} Z{}", number(20), number(20));
      case 5:
        return say("G54");
      case 6:
        return say("G5{}", 5 + whole(5));
      default:
        return say("G43 H{}", 1 + whole(20));
    }
  }
  void loop() {
    const int label = 200 + label_++;
    // after a break LinuxCNC 2.9 runs the next do loop once only, whatever its condition
    const int kind = whole(broken_ ? 2 : 3);
    const std::string move =
        fmt::format("G91 G1 X{} Y{} A{}\nG90", number(5), number(5), number(9));
    if (kind == 0) {
      say("o{} repeat [{}]\n{}\no{} endrepeat", label, whole(4), move, label);
    } else if (kind == 1) {
      broken_ = true;
      say("#<n> = 0\no{} while [#<n> LT {}]\n{}\n#<n> = [#<n> + 1]\no{} if [#<n> EQ 3]\no{} "
          "break\no{} "
          "endif\no{} endwhile",
          label, whole(6), move, label + 1, label, label + 1, label);
      ++label_;
    } else {
      say("#<n> = {}\no{} do\n{}\n#<n> = [#<n> - 1]\no{} while [#<n> GT 0]", whole(4), label, move,
          label);
    }
  }
  void line() {
    switch (whole(14)) {
      case 0:
      case 1:
        return arc();
      case 2:
        return cycle();
      case 3:
      case 4:
        return offset();
      case 5:
        return loop();
      case 6:
        say("o100 call [{}] [{}]", value(30), value(30));
        return say("G1 X[#<_value> / 2]");
      case 7:
        return say("G28.1\nG0 X{}\nG28 Z{}", value(30), value(30));
      case 8:
        return say("G53 G0 X{} Z{}", number(50), number(50));
      case 9:
        say("G20 G1 X{} Y{}", value(2), value(2));
        return say("G21");
      case 10:
        return say("G0 @{} ^{}", 1 + whole(30), number(180));
      case 11:
        return say("G93 G1 X{} B{} F{}\nG94 F300", value(30), number(90), 1 + whole(9));
      default:
        return say("G{} X{} Y{} Z{}", whole(2), value(40), value(40), value(20));
    }
  }

  std::mt19937 random_;
  std::string text_;
  int label_ = 0;
  bool broken_ = false;  ///< a break has been written
};

/// Cutter compensation: lines and arcs with corners of any kind.
std::string compensated_program(unsigned seed) {
  std::mt19937 random(seed);
  const auto number = [&](double size) { return (double(random() % 2000001) / 1e6 - 1) * size; };
  std::string text = "G21 G90 G94 G17 F500\n";
  for (int n = 0; n < 3; ++n) {
    text += fmt::format("G0 X{:.3f} Y{:.3f} Z{:.3f}\n", number(50), number(50), number(5));
    text += fmt::format("{} D{}\n", random() % 2 == 0 ? "G41" : "G42", 1 + random() % 20);
    double x = number(50), y = number(50);
    text += fmt::format("G1 X{:.6f} Y{:.6f}\n", x, y);
    for (int k = 2 + int(random() % 8); k > 0; --k) {
      const double dx = number(40), dy = number(40);
      x += dx;
      y += dy;
      const std::string end = fmt::format("X{:.6f} Y{:.6f}", x, y);
      switch (random() % 5) {
        case 0:
          text += fmt::format("G{} {} R{:.6f}\n", 2 + random() % 2, end,
                              std::hypot(dx, dy) * (0.55 + 0.001 * double(random() % 1000)));
          break;
        case 1:
          text += fmt::format("G{} {} I{:.9f} J{:.9f}\n", 2 + random() % 2, end, dx / 2, dy / 2);
          break;
        case 2:
          text += fmt::format("G1 {} Z{:.3f}\n", end, number(5));
          break;
        default:
          text += fmt::format("G{} {}\n", random() % 2, end);
      }
      if (random() % 6 == 0) text += fmt::format("G1 Z{:.3f}\n", number(5));
    }
    text += "G40\n";
  }
  return text + "G0 X0 Y0\nM2\n";
}

TEST(LinuxCncOracle, RandomCompensatedProgramsGiveTheSameMoves) {
  const auto packages = test::packages();
  if (!packages) GTEST_SKIP() << "ABBE_LINUXCNC is not set";
  const test::Interpreter interpreter(*packages);
  const double tolerance = interpreter.all_digits() ? 1e-8 : 2e-4;
  const unsigned first_seed = 20261124, programs = 1000;
  int accepted = 0, same = 0, ours_alone = 0, both_refuse = 0, theirs_alone = 0;
  std::size_t moves = 0;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed) {
    const std::string text = compensated_program(seed);
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
  if (!packages) GTEST_SKIP() << "ABBE_LINUXCNC is not set";
  const test::Interpreter interpreter(*packages);
  const double tolerance = interpreter.all_digits() ? 1e-8 : 2e-4;
  const unsigned first_seed = 20261124, programs = 1000;
  int accepted = 0, same = 0, both_refuse = 0;
  std::size_t moves = 0;
  double off = 0.0;
  std::map<std::string, int> theirs_alone;
  for (unsigned seed = first_seed; seed < first_seed + programs; ++seed) {
    const std::string text = Generator(seed).program();
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
