// Rewritten programs in axis coordinates read by LinuxCNC's interpreter: another reader of the same
// language. Without it the tests are skipped.

#include <sys/wait.h>
#include "machines.h"
#include "sim/program/rewrite.h"
#include "tests/oracles/linuxcnc_folder.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;
using test::Chain;

/// A folder that goes with its name; a home of its own keeps runs apart.
class PrivateFolder {
 public:
  PrivateFolder() {
    std::string name = (fs::temp_directory_path() / "abbe_rs274_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~PrivateFolder() { fs::remove_all(path_); }
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  void write(const char* name, const std::string& text) const {
    std::ofstream(path_ / name) << text;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

std::string quoted(const fs::path& path) {
  std::string text = "'";
  for (const char c : path.string()) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

struct Canonical {
  int code = -1;
  std::string commands;
};

Canonical interpreted(const fs::path& packages, const std::string& program) {
  const PrivateFolder folder;
  folder.write("machine.ini",
               "[EMC]\nVERSION = 1.1\n[RS274NGC]\nPARAMETER_FILE = numbers.var\n[TRAJ]\n"
               "COORDINATES = X Y Z A C\nLINEAR_UNITS = mm\nANGULAR_UNITS = deg\n");
  folder.write("tool.tbl", "T1 P1 Z0 D0\n");
  folder.write("numbers.var", "");
  folder.write("program.ngc", program);
  const fs::path usr = packages / "usr";
  const std::string command = fmt::format(
      "cd {} && HOME=\"$PWD\" LD_LIBRARY_PATH={}:{} {} -i machine.ini -t tool.tbl -v numbers.var "
      "-g program.ngc > out.txt 2>&1 < /dev/null",
      quoted(folder.path()), quoted(usr / "lib"), quoted(usr / "lib" / "x86_64-linux-gnu"),
      quoted(usr / "bin" / "rs274"));
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, test::file_text(folder.path() / "out.txt")};
}

/// Where a move ends: X Y Z mm, A B C deg.
struct Move {
  bool rapid = false;
  bool round = false;
  std::array<double, 6> end{};
  std::array<double, 2> centre{};
  double digit = 1e-4;  ///< mm, of what is printed
};

/// Numbers between the brackets of a canonical command.
std::vector<double> numbers(const std::string& line) {
  std::vector<double> all;
  std::stringstream text(line.substr(line.find('(') + 1));
  for (std::string one; std::getline(text, one, ',');)
    all.push_back(std::strtod(one.c_str(), nullptr));
  return all;
}

Move arc_feed(const std::vector<double>& n, const std::string& plane) {
  Move move;
  move.round = true;
  const std::array<int, 3> axes = plane == "XY"   ? std::array{0, 1, 2}
                                  : plane == "XZ" ? std::array{2, 0, 1}
                                                  : std::array{1, 2, 0};
  move.end = {0, 0, 0, n.at(6), n.at(7), n.at(8)};
  move.end[std::size_t(axes[0])] = n[0];
  move.end[std::size_t(axes[1])] = n[1];
  move.end[std::size_t(axes[2])] = n[5];
  move.centre = {n[2], n[3]};
  return move;
}

std::vector<Move> moves_of(const std::string& commands) {
  std::vector<Move> moves;
  double unit = 1.0;
  std::string plane = "XY";
  std::stringstream lines(commands);
  for (std::string line; std::getline(lines, line);) {
    const auto has = [&](const char* word) { return line.find(word) != std::string::npos; };
    if (has("USE_LENGTH_UNITS")) unit = has("INCHES") ? 25.4 : 1.0;
    if (has("SELECT_PLANE")) plane = line.substr(line.find("CANON_PLANE_") + 12, 2);
    Move move;
    if (has(" ARC_FEED(")) {
      move = arc_feed(numbers(line), plane);
    } else if (has("STRAIGHT_TRAVERSE(") || has("STRAIGHT_FEED(")) {
      const std::vector<double> n = numbers(line);
      std::copy_n(n.begin(), 6, move.end.begin());
      move.rapid = has("TRAVERSE");
    } else {
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) move.end[k] *= unit;
    for (double& c : move.centre) c *= unit;
    move.digit = 1e-4 * unit;
    moves.push_back(move);
  }
  return moves;
}

/// The same of our own reader.
std::vector<Move> moves_of(const Path& path, const Chain& machine) {
  static constexpr std::string_view letters = "XYZABC";
  std::vector<Move> moves;
  for (const Block& block : path.blocks) {
    if (block.interpolation == Interpolation::Dwell) continue;
    Move move;
    move.rapid = block.interpolation == Interpolation::Rapid;
    for (std::size_t k = 0; k < 6; ++k)
      if (const auto j = machine.find(letters[k]))
        move.end[k] = block.end[*j] / (k < 3 ? 1.0 : units::deg);
    if (block.interpolation == Interpolation::Arc) {
      move.round = true;
      const Vector2d centre = path.arcs[block.shape].centre;
      move.centre = {centre.x(), centre.y()};
    }
    moves.push_back(move);
  }
  return moves;
}

struct Source {
  const char* name;
  Chain machine;
  const char* text;
  double size;  ///< mm of the correction
};

/// XZ with the spindle on the workpiece, programmed as a turning program.
Chain lathe() {
  return Chain({test::joint('S', kinematics::Side::Workpiece, kinematics::Motion::Rotary, test::ez),
                test::joint('X', kinematics::Side::Tool, kinematics::Motion::Linear, test::ex),
                test::joint('Z', kinematics::Side::Tool, kinematics::Motion::Linear, test::ez)},
               test::Pose::Identity(), test::Pose::Identity());
}

std::vector<Source> sources() {
  return {
      {"turning on X Z", lathe(),
       "G18 G21 G94\nS2500 M3\nG0 X15.5 Z36\nG1 Z-4 F100\nG2 X19.5 Z-8 I4 K0\nG3 X12 Z20 R40 F300\n"
       "G93 G1 X10 Z21 F12\nG4 P0.25\nX9 F30\nG94\nG0 X25\nM5\nM30\n",
       0.02},
      {"three axes", test::three_axis(),
       "T1 M6\nM8\nG0 X5 Y6 Z20\nG1 Z-2 F300\nG2 X25 Y6 I10 J0 F800\nG19 G3 Y30 Z-2 R15\nG17 G3 "
       "I-8 "
       "J3\nG1 X60 Y70 Z0\nM9\nM30\n",
       0.03},
      {"three axes in inches", test::three_axis(),
       "G20\nG0 X1 Y1\nG1 Z-0.1 F20\nG2 X2 Y2 R1\nG1 X3.5\nG93 X4 Y1 F10\nG94 G18 G2 X3 Z0.2 R0.9 "
       "F15\nM2\n",
       0.01},
      {"five axes", test::gantry(),
       "S8000 M3\nG0 X10 Z80 A10 C0\nG1 X40 Y20 A-15 C60 F1200\nG93 G1 X50 A-20 C180 F8\nC200 F20\n"
       "G94 G3 X30 Y40 I-20 J0 Z79 F500\nG1 A5 F720\nM5\nM30\n",
       0.02},
  };
}

/// The program rewritten with waves in every axis.
RewrittenProgram with_waves(const Source& source, const Path& path, const NcOptions& options) {
  CorrectedPath dense(path.blocks.size());
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    if (block.interpolation == Interpolation::Dwell) continue;
    for (int k = 0; k <= 1000; ++k) {
      const double u = k / 1000.0, time_s = block.start_s + u * (block.end_s - block.start_s);
      AxisVector at = position(path, block, u);
      for (int j = 0; j < int(at.size()); ++j) {
        const bool turns = options.axes[std::size_t(j)].motion != kinematics::Motion::Linear;
        at[j] += (turns ? 1e-3 : 1.0) * source.size * std::sin(time_s + j);
      }
      dense[i].push_back({u, at, {}, {}});
    }
  }
  ThinOptions thin;
  thin.tolerance = 1e-3;
  thin.lever[0] = AxisVector::Constant(Index(options.axes.size()), 50.0);
  return rewrite_program(path, thin_out(path, dense, options, thin), options);
}

TEST(LinuxCnc, ReadsRewrittenProgramsInAxisCoordinatesAsWeDo) {
  const auto packages = oracles::linuxcnc_folder();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  for (const Source& source : sources()) {
    SCOPED_TRACE(source.name);
    const NcOptions options = test::options_for(source.machine);
    const Path path = read_nc(source.text, "source", options);
    const std::string text = with_waves(source, path, options).text;
    const std::vector<Move> ours = moves_of(read_nc(text, "rewritten", options), source.machine);
    const Canonical read = interpreted(*packages, text);
    ASSERT_EQ(read.code, 0) << text << read.commands;
    const std::vector<Move> theirs = moves_of(read.commands);
    ASSERT_EQ(theirs.size(), ours.size()) << text << read.commands;
    double off = 0.0;  // in the last digit that is printed
    int arcs = 0;
    for (std::size_t i = 0; i < ours.size(); ++i) {
      EXPECT_EQ(theirs[i].rapid, ours[i].rapid) << i;
      EXPECT_EQ(theirs[i].round, ours[i].round) << i;
      for (std::size_t k = 0; k < 6; ++k)
        off = std::max(
            off, std::abs(theirs[i].end[k] - ours[i].end[k]) / (k < 3 ? theirs[i].digit : 1e-4));
      for (std::size_t k = 0; k < 2 && ours[i].round; ++k)
        off = std::max(off, std::abs(theirs[i].centre[k] - ours[i].centre[k]) / theirs[i].digit);
      arcs += ours[i].round ? 1 : 0;
    }
    std::cout << source.name << ": " << path.motion_blocks << " blocks rewritten as " << ours.size()
              << ", " << arcs << " of them arcs; ends and centres within " << off
              << " of the fourth decimal\n";
    EXPECT_LE(off, 0.51);
  }
}

TEST(LinuxCnc, RefusesWhatIsNoProgram) {
  const auto packages = oracles::linuxcnc_folder();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  EXPECT_EQ(interpreted(*packages, "G21 G94\nG1 X1 F100\nM2\n").code, 0);
  EXPECT_NE(interpreted(*packages, "G21 G94\nG43.4 H1\nG1 X1 F100\nM2\n").code, 0);
  EXPECT_NE(interpreted(*packages, "G21 G93\nG1 X1\nM2\n").code, 0);
  EXPECT_NE(interpreted(*packages, "G21 G94 F10\nG2 X1 I5 J0\nM2\n").code, 0);
}

}  // namespace
}  // namespace abbe::sim::program
