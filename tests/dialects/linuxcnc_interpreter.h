#pragma once

#include <sys/wait.h>
#include "sim/dialects/linuxcnc/rs274.h"
#include "tests/test.h"

/// LinuxCNC's own interpreter as an oracle: a separate process, started and read without what
/// `read_by_linuxcnc` does it with. Only where it is (`./abbe setup --linuxcnc`, or what the
/// environment variable ABBE_LINUXCNC names) and the library for its digits are shared.
namespace abbe::sim::dialects::test {

inline std::optional<fs::path> packages() { return find_linuxcnc(); }

/// A folder that goes with its name.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (fs::temp_directory_path() / "abbe_rs274_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TestFolder() { fs::remove_all(path_); }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
  }
  std::string read(const std::string& name) const {
    std::ifstream in(path_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

inline std::string shell_quoted(const fs::path& path) {
  std::string text = "'";
  for (const char c : path.string()) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Tools of the tests: T1 ... T99, length 10 n mm, radius n / 10 mm.
inline double tool_length(int tool) { return 10.0 * tool; }
inline double tool_radius(int tool) { return 0.1 * tool; }
inline constexpr int tools = 99;

struct Interpreted {
  int code = -1;
  std::string commands;  ///< canonical, a line each
  std::string message;
};

/// Runs programs in a folder of its own.
class Interpreter {
 public:
  explicit Interpreter(fs::path packages) : packages_(std::move(packages)) {
    fs::create_symlink(all_digits_library(), shim());
    std::string table;
    // the table of the program alone counts in inches
    for (int n = 1; n <= tools; ++n)
      table += fmt::format("T{} P{} Z{:.17g} D{:.17g}\n", n, n, tool_length(n) / 25.4,
                           2 * tool_radius(n) / 25.4);
    table_ = table;
  }

  Interpreted run(const fs::path& program, const fs::path& subprograms) const {
    home_.write(
        "machine.ini",
        "[EMC]\nVERSION = 1.1\n[RS274NGC]\nPARAMETER_FILE = numbers.var\nSUBROUTINE_PATH = " +
            subprograms.string() +
            "\n[TRAJ]\nCOORDINATES = X Y Z A B C\nLINEAR_UNITS = mm\nANGULAR_UNITS = deg\n");
    home_.write("tool.tbl", table_);
    home_.write("numbers.var", "");
    const fs::path usr = packages_ / "usr";
    const std::string command = fmt::format(
        "cd {} && ulimit -f 400000 && HOME=\"$PWD\" LD_LIBRARY_PATH={}:{} {} timeout 20 {} -i "
        "machine.ini -t tool.tbl -v numbers.var -g {} out.txt > said.txt 2>&1 < /dev/null",
        shell_quoted(home_.path()), shell_quoted(usr / "lib"),
        shell_quoted(usr / "lib" / "x86_64-linux-gnu"), "LD_PRELOAD=" + shell_quoted(shim()),
        shell_quoted(usr / "bin" / "rs274"), shell_quoted(program));
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, home_.read("out.txt"),
            home_.read("said.txt")};
  }
  Interpreted run(const std::string& text) const {
    home_.write("program.ngc", text);
    return run(home_.path() / "program.ngc", home_.path());
  }

 private:
  fs::path shim() const { return home_.path() / "all_digits.so"; }
  fs::path packages_;
  TestFolder home_;
  std::string table_;
};

/// A move of the axes: mm, degrees.
struct Move {
  enum class Kind { Rapid, Feed, Arc, Spline } kind = Kind::Feed;
  std::array<double, 6> end{};
  std::array<double, 2> centre{};  ///< of an arc, in its plane
  double sweep = 0.0;              ///< rad, + from the first to the second axis
};

/// The state of the canonical machine, as its commands leave it; lengths mm.
struct CanonicalMachine {
  double unit = 1.0, angle = 0.0;
  std::array<double, 6> g5x{}, g92{}, tool{}, at{};
  std::array<int, 3> plane{0, 1, 2};

  /// Axes of numbers in the program's coordinates and units.
  std::array<double, 6> axes(std::array<double, 6> p) const {
    for (std::size_t k = 0; k < 6; ++k) p[k] = p[k] * (k < 3 ? unit : 1.0) + g92[k];
    const double c = std::cos(angle), s = std::sin(angle);
    const double x = c * p[0] - s * p[1], y = s * p[0] + c * p[1];
    if (angle != 0.0) {
      p[0] = x;
      p[1] = y;
    }
    for (std::size_t k = 0; k < 6; ++k) p[k] += g5x[k] + tool[k];
    return p;
  }
};

inline std::vector<double> numbers_in(std::string text) {
  for (char& c : text)
    if (c == ',') c = ' ';
  std::vector<double> all;
  std::stringstream in(text.substr(text.find('(') + 1));
  for (std::string one; in >> one;) all.push_back(std::strtod(one.c_str(), nullptr));
  return all;
}

inline Move arc_of(const std::vector<double>& n, CanonicalMachine& machine) {
  std::array<double, 6> end{}, centre{};
  const auto [first, second, third] = machine.plane;
  end[std::size_t(first)] = n.at(0);
  end[std::size_t(second)] = n.at(1);
  end[std::size_t(third)] = n.at(5);
  for (std::size_t k = 3; k < 6; ++k) end[k] = n.at(k + 3);
  centre = end;
  centre[std::size_t(first)] = n[2];
  centre[std::size_t(second)] = n[3];
  const std::array<double, 6> reached = machine.axes(end);
  const auto in_plane = [&](std::array<double, 6> p) {
    if (third == 2) return p;  // turned about what is across the plane
    const double c = std::cos(machine.angle), s = std::sin(machine.angle);
    const double x = c * p[0] + s * p[1], y = c * p[1] - s * p[0];
    p[0] = x;
    p[1] = y;
    return p;
  };
  const auto from = in_plane(machine.at), to = in_plane(reached);
  const auto mid = in_plane(machine.axes(centre));
  const auto angle = [&](const std::array<double, 6>& p) {
    return std::atan2(p[std::size_t(second)] - mid[std::size_t(second)],
                      p[std::size_t(first)] - mid[std::size_t(first)]);
  };
  const double turns = n[4], pi = std::acos(-1.0);
  double sweep = angle(to) - angle(from);
  const double same = std::hypot(to[std::size_t(first)] - from[std::size_t(first)],
                                 to[std::size_t(second)] - from[std::size_t(second)]);
  if (same < 1e-6) sweep = 0;
  if (turns > 0) {
    while (sweep <= 1e-12) sweep += 2 * pi;
    while (sweep > 2 * pi + 1e-12) sweep -= 2 * pi;
  } else {
    while (sweep >= -1e-12) sweep -= 2 * pi;
    while (sweep < -2 * pi - 1e-12) sweep += 2 * pi;
  }
  sweep += (turns > 0 ? turns - 1 : turns + 1) * 2 * pi;
  return {Move::Kind::Arc, reached, {mid[std::size_t(first)], mid[std::size_t(second)]}, sweep};
}

/// What the commands move, offsets applied; moves of nothing left out.
inline std::vector<Move> moves_of(const std::string& commands) {
  std::vector<Move> moves;
  CanonicalMachine machine;
  std::stringstream lines(commands);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t open = line.find('(');
    if (open == std::string::npos) continue;
    const std::size_t blank = line.rfind(' ', open);
    const std::string name = line.substr(blank + 1, open - blank - 1);
    const auto six = [&](std::size_t from) {
      const std::vector<double> n = numbers_in(line);
      std::array<double, 6> all{};
      for (std::size_t k = 0; k < 6; ++k) all[k] = n.at(from + k);
      return all;
    };
    const auto in_mm = [&](std::array<double, 6> all) {
      for (std::size_t k = 0; k < 3; ++k) all[k] *= machine.unit;
      return all;
    };
    if (name == "USE_LENGTH_UNITS")
      machine.unit = line.find("INCHES") != std::string::npos ? 25.4 : 1.0;
    else if (name == "SET_G5X_OFFSET")
      machine.g5x = in_mm(six(1));
    else if (name == "SET_G92_OFFSET")
      machine.g92 = in_mm(six(0));
    else if (name == "SET_XY_ROTATION")
      machine.angle = numbers_in(line).at(0) * std::acos(-1.0) / 180;
    else if (name == "USE_TOOL_LENGTH_OFFSET")
      machine.tool = in_mm(six(0));
    else if (name == "SELECT_PLANE")
      machine.plane = line.find("_XY") != std::string::npos   ? std::array{0, 1, 2}
                      : line.find("_XZ") != std::string::npos ? std::array{2, 0, 1}
                                                              : std::array{1, 2, 0};
    Move move;
    if (name == "STRAIGHT_TRAVERSE" || name == "STRAIGHT_FEED") {
      move.kind = name == "STRAIGHT_FEED" ? Move::Kind::Feed : Move::Kind::Rapid;
      move.end = machine.axes(six(0));
    } else if (name == "ARC_FEED") {
      move = arc_of(numbers_in(line), machine);
    } else if (name == "RIGID_TAP") {
      std::array<double, 6> end = machine.at;
      const std::vector<double> n = numbers_in(line);
      std::array<double, 6> p{n.at(0), n.at(1), n.at(2)};
      const std::array<double, 6> to = machine.axes(p);
      for (std::size_t k = 0; k < 3; ++k) end[k] = to[k];
      moves.push_back({Move::Kind::Feed, end, {}, 0});
      moves.push_back({Move::Kind::Feed, machine.at, {}, 0});
      continue;
    } else if (name == "NURBS_FEED" || name == "SPLINE_FEED") {
      move.kind = Move::Kind::Spline;  // its points are not printed
      move.end = machine.at;
      if (moves.empty() || moves.back().kind != Move::Kind::Spline) moves.push_back(move);
      continue;
    } else {
      continue;
    }
    double way = 0.0;
    for (std::size_t k = 0; k < 6; ++k) way = std::max(way, std::abs(move.end[k] - machine.at[k]));
    machine.at = move.end;
    if (way > 1e-9 || move.kind == Move::Kind::Arc) moves.push_back(move);
  }
  return moves;
}

}  // namespace abbe::sim::dialects::test
