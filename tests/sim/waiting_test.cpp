#include <cerrno>
#include <chrono>
#include <cmath>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/safety/program_run.h"

/// What somebody sees who waits: the program on a terminal, and without one.
namespace abbe::sim {
namespace {

using Clock = std::chrono::steady_clock;

/// Something that was drawn, and when.
struct Drawn {
  double at_s = 0.0;
  std::string text;
};

struct Watched {
  int code = -1;
  double total_s = 0.0;
  std::vector<Drawn> lines;
};

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The program with a terminal of its own.
Watched on_a_terminal(const std::string& arguments) {
  const std::string command = std::string(ABBE_PROGRAM) + " " + arguments;
  const Clock::time_point start = Clock::now();
  int terminal = -1;
  const ::pid_t child = ::forkpty(&terminal, nullptr, nullptr, nullptr);
  if (child == 0) {
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  Watched watched;
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0;
       (n = ::read(terminal, buffer, sizeof buffer)) > 0 || (n < 0 && errno == EINTR);) {
    text.append(buffer, std::size_t(std::max<ssize_t>(0, n)));
    for (std::size_t end = 0; (end = text.find_first_of("\r\n")) != std::string::npos;
         text.erase(0, end + 1))
      if (end > 0) watched.lines.push_back({since(start), text.substr(0, end)});
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ::close(terminal);
  watched.total_s = since(start);
  watched.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return watched;
}

TEST(Waiting, OnATerminalThePartTheStageAndTheTimeLeftAreDrawn) {
  const safety::Folder folder;
  const std::string scene = (safety::source / "scenes/new/gantry.toml").string();
  const Watched watched = on_a_terminal("compare " + scene + " --out " + (folder / "out").string());
  ASSERT_EQ(watched.code, 0);
  const std::regex state(R"(\[(\d+)/(\d+)\] (.+): (\w+)( \d+ %)?(, (\d+) (s|min) left)?)");
  std::set<std::string> parts, stages;
  int times = 0, last = 0;
  for (const Drawn& line : watched.lines) {
    std::smatch seen;
    if (!std::regex_search(line.text, seen, state)) continue;
    parts.insert(seen[3]);
    stages.insert(seen[4]);
    EXPECT_GE(std::stoi(seen[1]), last) << line.text;
    EXPECT_LE(last = std::stoi(seen[1]), std::stoi(seen[2])) << line.text;
    times += seen[6].matched;
  }
  // preparing, three cases, three folders of files, the comparison
  EXPECT_EQ(parts.size(), 8u);
  EXPECT_EQ(last, 8);
  for (const char* stage : {"surface", "correct", "draw", "compare"})
    EXPECT_TRUE(stages.contains(stage)) << stage;
  EXPECT_GE(times, 2) << "of " << watched.lines.size() << " lines in " << watched.total_s << " s";
}

TEST(Waiting, WithoutATerminalEveryPartIsALine) {
  const safety::Folder folder;
  const std::string scene = (safety::source / "scenes/new/lathe.toml").string();
  const safety::Ran ran = safety::run("compare " + scene + " --out " + (folder / "out").string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  for (const char* line :
       {"[1/8] prepare\n", "[2/8] error_free\n", "[4/8] perfect-position-program\n",
        "[5/8] write error_free\n", "[8/8] write comparison\n"})
    EXPECT_NE(ran.text.find(line), std::string::npos) << line << ran.text;
  EXPECT_EQ(ran.text.find('\x1b'), std::string::npos);
  const safety::Ran written =
      safety::run("rewrite " + scene + " --out " + (folder / "program.ngc").string());
  EXPECT_NE(written.text.find("[3/3] write\n"), std::string::npos) << written.text;
  const safety::Ran exported = safety::run(
      "export " + scene + " --case perfect-position-table --out " + (folder / "tables").string());
  EXPECT_NE(exported.text.find("[3/3] write\n"), std::string::npos) << exported.text;
}

}  // namespace
}  // namespace abbe::sim
