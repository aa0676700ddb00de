#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <set>
#include <string>

#include <gtest/gtest.h>

namespace fs = std::filesystem;

namespace {

/// Who may include whom, the lowest first. A room may always include itself, and rooms of sim the
/// four lower ones and sim/files; no room may be added without a line here.
const std::map<std::string, std::set<std::string>> may_know = {
    {"kinematics", {}},
    {"errors", {"kinematics"}},
    {"errors/metrology", {"kinematics", "errors"}},
    {"errors/identification", {"kinematics", "errors", "errors/metrology"}},
    {"cutting/part", {"kinematics"}},
    {"cutting/surface", {"kinematics", "cutting/part"}},
    {"cutting/map", {"kinematics", "cutting/part", "cutting/surface"}},
    {"cutting/stock", {"kinematics", "cutting/part", "cutting/surface"}},
    {"render", {"kinematics", "cutting/part", "cutting/surface", "cutting/map", "cutting/stock"}},
    {"sim/files", {"kinematics"}},
    {"sim/program", {"kinematics", "cutting/part", "cutting/surface"}},
    {"sim/dialects", {"kinematics", "sim/files", "sim/program"}},
    {"sim/compensation", {"kinematics", "errors", "errors/identification", "sim/program"}},
    {"sim/scene", {"sim/program", "sim/dialects", "sim/compensation", "render"}},
    {"sim/readings", {"sim/scene"}},
    {"sim/machine", {"sim/scene"}},
    {"sim/cut", {"sim/machine", "sim/scene", "sim/program", "sim/dialects", "sim/compensation"}},
    {"sim/measure", {"sim/cut", "sim/machine", "sim/scene", "sim/readings"}},
    {"sim/loop",
     {"sim/measure", "sim/cut", "sim/machine", "sim/scene", "sim/readings", "sim/program",
      "sim/dialects", "sim/compensation"}},
    {"sim/calibration", {"sim/readings", "sim/scene", "sim/compensation"}},
    {"sim/report",
     {"sim/loop", "sim/cut", "sim/calibration", "sim/machine", "sim/scene", "sim/readings",
      "sim/program", "sim/compensation", "render"}},
    {"sim/study",
     {"sim/report", "sim/loop", "sim/measure", "sim/calibration", "sim/cut", "sim/machine",
      "sim/scene", "sim/readings", "sim/program", "sim/dialects", "sim/compensation", "render"}},
    {"sim/commands",
     {"sim/study", "sim/report", "sim/loop", "sim/measure", "sim/calibration", "sim/cut",
      "sim/machine", "sim/scene", "sim/readings", "sim/program", "sim/dialects",
      "sim/compensation"}},
    {"sim/python",
     {"sim/commands", "sim/study", "sim/report", "sim/loop", "sim/calibration", "sim/cut",
      "sim/machine", "sim/scene", "sim/compensation"}},
};

/// What every room of sim above its program and compensation may know.
const std::set<std::string> common = {
    "kinematics",   "errors",          "errors/metrology", "errors/identification",
    "cutting/part", "cutting/surface", "cutting/map",      "cutting/stock",
    "sim/files"};

bool is_upper(const std::string& room) {
  return room.rfind("sim/", 0) == 0 && room != "sim/files" && room != "sim/program" &&
         room != "sim/dialects" && room != "sim/compensation";
}

bool may(const std::string& mine, const std::string& theirs) {
  return mine == theirs || may_know.at(mine).count(theirs) > 0 ||
         (is_upper(mine) && common.count(theirs) > 0);
}

/// The room of a file: the nearest folder above it that is one.
std::string module_of(const std::string& path) {
  std::string folder = path;
  while (folder.find('/') != std::string::npos) {
    folder = folder.substr(0, folder.rfind('/'));
    if (may_know.count(folder)) return folder;
  }
  return folder;
}

/// Calls `visit(file, line number, line)` for every line of the program.
template <typename Visit>
int for_every_line(const Visit& visit) {
  int files = 0;
  for (const char* folder : {"kinematics", "errors", "cutting", "render", "sim"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(ABBE_SOURCE_DIR) / folder)) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".h" && ending != ".cpp") continue;
      ++files;
      const std::string file = fs::relative(entry.path(), ABBE_SOURCE_DIR).string();
      std::ifstream in(entry.path());
      std::string line;
      for (int number = 1; std::getline(in, line); ++number) visit(file, number, line);
    }
  }
  return files;
}

/// Calls `visit(file, line number, text after the word)` for every include of the program.
template <typename Visit>
int for_every_include(const Visit& visit) {
  return for_every_line([&](const std::string& file, int number, const std::string& line) {
    const std::string mark = "#include ";
    if (line.rfind(mark, 0) == 0) visit(file, number, line.substr(mark.size()));
  });
}

/// The name of a constant that a line defines outside of any function; empty if it defines none.
std::string constant_of(const std::string& line) {
  static const std::regex constant(
      R"((?:inline )?constexpr (?:const )?[\w:<>, ]+? \*?(\w+)(?: =|\[|\{).*)");
  std::smatch match;
  return std::regex_match(line, match, constant) ? match[1].str() : "";
}

}  // namespace

TEST(Architecture, EveryIncludeFollowsTheArrowsOfTheHouse) {
  const int files =
      for_every_include([](const std::string& file, int line, const std::string& target) {
        if (target.front() != '"') return;
        const std::string mine = module_of(file), theirs = module_of(target.substr(1));
        ASSERT_TRUE(may_know.count(mine)) << file;
        ASSERT_TRUE(may_know.count(theirs)) << file << ":" << line << ": " << target;
        EXPECT_TRUE(may(mine, theirs))
            << file << ":" << line << ": " << mine << " must not know " << theirs;
      });
  EXPECT_GT(files, 40) << "the test looked at too few files to mean anything";
}

namespace {

/// What each file includes, a header and its source taken as one file without ending.
using Includes = std::map<std::string, std::set<std::string>>;

Includes includes_of_the_program() {
  Includes includes;
  const auto stem = [](const std::string& file) { return file.substr(0, file.rfind('.')); };
  for_every_include([&](const std::string& file, int, const std::string& target) {
    if (target.front() != '"') return;
    const std::string theirs = stem(target.substr(1, target.size() - 2));
    if (theirs != stem(file)) includes[stem(file)].insert(theirs);
  });
  return includes;
}

bool begins_with_one_of(const std::string& file, const std::set<std::string>& beginnings) {
  return std::any_of(beginnings.begin(), beginnings.end(),
                     [&](const std::string& one) { return file.rfind(one, 0) == 0; });
}

/// What corrects, identifies or evaluates.
const std::set<std::string> behind_the_wall = {"errors/identification/", "sim/compensation/",
                                               "sim/readings/", "sim/calibration/", "sim/loop/"};
/// The door: the loop around a job, which also makes the perfect belief.
const std::set<std::string> doors = {"sim/loop/compensate"};
/// What says how the machine really is, or can reach it.
const std::set<std::string> truth = {
    "sim/scene/scene",   "sim/scene/read_scene", "sim/scene/tool",      "sim/scene/thermal",
    "sim/scene/cutting", "sim/machine/truth",    "sim/machine/run_out", "sim/cut/job",
    "sim/cut/cut",       "sim/cut/signals",      "sim/measure/",        "sim/loop/compensate"};

/// Ways from behind the wall to the truth, each as "file <- file <- file"; `count` files were
/// walked.
struct Leaks {
  std::set<std::string> ways;
  std::size_t count = 0;
};

Leaks leaks(const Includes& includes) {
  std::map<std::string, std::string> way;  // to each file that was reached
  for (const auto& [file, ignored] : includes)
    if (begins_with_one_of(file, behind_the_wall) && !doors.count(file)) way[file] = file;
  Leaks found;
  for (std::map<std::string, std::string> next = way; !next.empty();) {
    std::map<std::string, std::string> further;
    for (const auto& [file, how] : next) {
      if (begins_with_one_of(file, truth)) {
        found.ways.insert(how);
        continue;
      }
      const auto targets = includes.find(file);
      if (targets == includes.end()) continue;
      for (const std::string& target : targets->second)
        if (way.emplace(target, target + " <- " + how).second) further[target] = way[target];
    }
    next = std::move(further);
  }
  found.count = way.size();
  return found;
}

}  // namespace

TEST(Architecture, NothingBehindTheWallReachesTheTruth) {
  const Leaks found = leaks(includes_of_the_program());
  for (const std::string& way : found.ways) ADD_FAILURE() << way;
  EXPECT_GT(found.count, 60u) << "the test walked too few files to mean anything";
}

TEST(Architecture, AnIncludeThatBreaksTheWallIsFound) {
  const Includes sound = includes_of_the_program();
  const std::size_t before = leaks(sound).ways.size();
  for (const char* file : {"sim/loop/learn", "sim/loop/correction_channels",
                           "sim/calibration/calibration", "sim/readings/readings_file",
                           "sim/compensation/correct", "sim/cut/commands", "sim/machine/machine"})
    for (const char* target : {"sim/machine/truth", "sim/scene/scene", "sim/cut/job"}) {
      Includes broken = sound;
      broken[file].insert(target);
      EXPECT_GT(leaks(broken).ways.size(), before) << file << " may include " << target;
    }
}

TEST(Architecture, PrecompiledHeadersBringNothingOfASceneAlong) {
  std::ifstream in(fs::path(ABBE_SOURCE_DIR) / "CMakeLists.txt");
  std::string line;
  int headers = 0;
  for (bool inside = false; std::getline(in, line);) {
    if (line.rfind("set(described ", 0) == 0) inside = true;
    if (!inside) continue;
    headers += line.find("errors/") != std::string::npos;
    EXPECT_EQ(line.find("sim/scene"), std::string::npos) << line;
    EXPECT_EQ(line.find("sim/machine"), std::string::npos) << line;
    if (line.find(')') != std::string::npos) break;
  }
  EXPECT_GT(headers, 0);
}

TEST(Architecture, CompensationKnowsItsOwnRoomAndPrograms) {
  for_every_include([](const std::string& file, int line, const std::string& target) {
    if (file.rfind("sim/compensation/", 0) != 0) return;
    // models of errors it may have, of what it believes; what a scene injects, and the loop, never
    const bool of_sim = target.rfind("\"sim/", 0) == 0;
    EXPECT_TRUE(!of_sim || target.rfind("\"sim/compensation/", 0) == 0 ||
                target.rfind("\"sim/program/", 0) == 0)
        << file << ":" << line << ": " << target;
  });
}

TEST(Architecture, NoCircleAmongTheFilesOfSim) {
  Includes includes;
  for (const auto& [file, targets] : includes_of_the_program())
    for (const std::string& target : targets)
      if (file.rfind("sim/", 0) == 0 && target.rfind("sim/", 0) == 0) includes[file].insert(target);
  EXPECT_GT(includes.size(), 80u);
  // files of which all includes are done are done, until none is left but those in circles
  std::set<std::string> done;
  for (bool more = true; more;) {
    more = false;
    for (const auto& [file, targets] : includes) {
      if (done.count(file)) continue;
      const bool ready = std::all_of(
          targets.begin(), targets.end(),
          [&](const std::string& target) { return done.count(target) || !includes.count(target); });
      if (ready) more = done.insert(file).second;
    }
  }
  for (const auto& [file, targets] : includes)
    EXPECT_TRUE(done.count(file)) << file << " is in a circle, or includes one that is";
}

TEST(Architecture, HeavyLibrariesStayOutOfHeaders) {
  for_every_include([](const std::string& file, int line, const std::string& target) {
    if (file.substr(file.size() - 2) != ".h") return;
    for (const char* library : {"<vtk", "<fcl", "<OpenMesh", "<toml++"})
      EXPECT_EQ(target.find(library), std::string::npos)
          << file << ":" << line << ": " << library << " belongs in a .cpp";
  });
}

TEST(Architecture, FclStaysInOneSourceOfCuttingAndVtkInRender) {
  std::set<std::string> fcl;
  for_every_include([&](const std::string& file, int line, const std::string& target) {
    if (target.find("<fcl") == 0) fcl.insert(file);
    if (target.find("<vtk") == 0) {
      EXPECT_EQ(module_of(file), "render") << file << ":" << line;
    }
    if (target.find("<OpenMesh") == 0) {
      EXPECT_EQ(module_of(file), "cutting/part") << file << ":" << line;
    }
  });
  EXPECT_LE(fcl.size(), 1u);
}

TEST(Architecture, NoConstantOfASourceHidesOneOfAHeader) {
  // sources are compiled several at a time, so a name of one source's anonymous namespace would
  // hide that of a header from the sources that follow, without a word from the compiler
  std::map<std::string, std::string> of_headers;  // namespace::name, file
  std::map<std::string, std::string> namespaces;  // of each file, the innermost that has a name
  int constants = 0;
  const auto each = [&](const std::string& ending, const auto& use) {
    for_every_line([&](const std::string& file, int number, const std::string& line) {
      if (file.size() < ending.size() || file.substr(file.size() - ending.size()) != ending) return;
      if (line.rfind("namespace abbe", 0) == 0)
        namespaces[file] = line.substr(10, line.find(' ', 10) - 10);
      if (const std::string name = constant_of(line); !name.empty()) use(file, number, name);
    });
  };
  each(".h", [&](const std::string& file, int, const std::string& name) {
    of_headers[namespaces[file] + "::" + name] = file;
  });
  each(".cpp", [&](const std::string& file, int number, const std::string& name) {
    ++constants;
    const auto found = of_headers.find(namespaces[file] + "::" + name);
    if (found == of_headers.end()) return;
    ADD_FAILURE() << file << ":" << number << ": " << name << " hides that of " << found->second;
  });
  std::cout << of_headers.size() << " constants of headers, " << constants << " of sources\n";
  EXPECT_GT(of_headers.size(), 50u);
  EXPECT_GT(constants, 200);
  EXPECT_EQ(constant_of("constexpr double least_facing = 1e-6;  // of"), "least_facing");
  EXPECT_EQ(constant_of("inline constexpr int width = 8;"), "width");
  EXPECT_EQ(constant_of("  constexpr int width = 8;"), "");
}
