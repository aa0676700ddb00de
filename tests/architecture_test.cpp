#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
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
    {"cutting", {"kinematics"}},
    {"render", {"kinematics", "cutting"}},
    {"sim/files", {"kinematics"}},
    {"sim/program", {"kinematics", "cutting"}},
    {"sim/compensation", {"kinematics", "errors", "errors/identification", "sim/program"}},
    {"sim/scene", {"sim/program", "sim/compensation", "render"}},
    {"sim/readings", {"sim/scene"}},
    {"sim/machine", {"sim/scene"}},
    {"sim/cut", {"sim/machine", "sim/scene", "sim/program", "sim/compensation"}},
    {"sim/measure", {"sim/cut", "sim/machine", "sim/scene", "sim/readings"}},
    {"sim/loop",
     {"sim/measure", "sim/cut", "sim/machine", "sim/scene", "sim/readings", "sim/program",
      "sim/compensation"}},
    {"sim/calibration", {"sim/readings", "sim/scene", "sim/compensation"}},
    {"sim/report",
     {"sim/loop", "sim/cut", "sim/calibration", "sim/machine", "sim/scene", "sim/readings",
      "sim/program", "sim/compensation", "render"}},
    {"sim/study",
     {"sim/report", "sim/loop", "sim/measure", "sim/calibration", "sim/cut", "sim/machine",
      "sim/scene", "sim/readings", "sim/program", "sim/compensation", "render"}},
    {"sim/commands",
     {"sim/study", "sim/report", "sim/loop", "sim/measure", "sim/calibration", "sim/cut",
      "sim/machine", "sim/scene", "sim/readings", "sim/program", "sim/compensation"}},
};

/// What every room of sim above its program and compensation may know.
const std::set<std::string> common = {
    "kinematics", "errors", "errors/metrology", "errors/identification", "cutting", "sim/files"};

bool is_upper(const std::string& room) {
  return room.rfind("sim/", 0) == 0 && room != "sim/files" && room != "sim/program" &&
         room != "sim/compensation";
}

bool may(const std::string& mine, const std::string& theirs) {
  return mine == theirs || may_know.at(mine).count(theirs) > 0 ||
         (is_upper(mine) && common.count(theirs) > 0);
}

std::string module_of(const std::string& path) {
  const std::string folder = path.substr(0, path.rfind('/'));
  return may_know.count(folder) ? folder : path.substr(0, path.find('/'));
}

/// Calls `visit(file, line number, text between the quotes)` for every quoted include of the
/// program.
template <typename Visit>
int for_every_include(const Visit& visit) {
  int files = 0;
  for (const char* folder : {"kinematics", "errors", "cutting", "render", "sim"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(ABBE_SOURCE_DIR) / folder)) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".h" && ending != ".cpp") continue;
      ++files;
      std::ifstream in(entry.path());
      std::string line;
      for (int number = 1; std::getline(in, line); ++number) {
        const std::string mark = "#include ";
        if (line.rfind(mark, 0) == 0)
          visit(fs::relative(entry.path(), ABBE_SOURCE_DIR).string(), number,
                line.substr(mark.size()));
      }
    }
  }
  return files;
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

TEST(Architecture, CompensationNeverSeesTheTruth) {
  for_every_include([](const std::string& file, int line, const std::string& target) {
    if (file.rfind("sim/compensation/", 0) != 0) return;
    EXPECT_EQ(target.find("truth"), std::string::npos) << file << ":" << line;
    // models of errors it may have, of what it believes; what a scene injects, and the loop, never
    const bool of_sim = target.rfind("\"sim/", 0) == 0;
    EXPECT_TRUE(!of_sim || target.rfind("\"sim/compensation/", 0) == 0 ||
                target.rfind("\"sim/program/", 0) == 0)
        << file << ":" << line << ": " << target;
  });
}

TEST(Architecture, WhatReadsReadingsNeverReachesTheTruth) {
  std::map<std::string, std::set<std::string>> includes;  // of a file without its ending
  const auto stem = [](const std::string& file) { return file.substr(0, file.rfind('.')); };
  for_every_include([&](const std::string& file, int, const std::string& target) {
    if (target.front() == '"')
      includes[stem(file)].insert(stem(target.substr(1, target.size() - 2)));
  });
  std::set<std::string> reached;
  for (const auto& [file, ignored] : includes)
    for (const char* room : {"errors/identification/", "sim/calibration/", "sim/readings/"})
      if (file.rfind(room, 0) == 0) reached.insert(file);
  EXPECT_GT(reached.size(), 15u);
  for (std::set<std::string> next = reached; !next.empty();) {
    std::set<std::string> found;
    for (const std::string& file : next) {
      for (const char* room : {"sim/machine/", "sim/cut/", "sim/measure/", "sim/loop/"})
        EXPECT_NE(file.rfind(room, 0), 0u) << "reached from what reads readings: " << file;
      for (const std::string& target : includes[file])
        if (reached.insert(target).second) found.insert(target);
    }
    next = std::move(found);
  }
}

TEST(Architecture, NoCircleAmongTheFilesOfSim) {
  std::map<std::string, std::set<std::string>> includes;  // of a header and its source together
  const auto stem = [](const std::string& file) { return file.substr(0, file.rfind('.')); };
  for_every_include([&](const std::string& file, int, const std::string& target) {
    if (file.rfind("sim/", 0) != 0 || target.rfind("\"sim/", 0) != 0) return;
    const std::string theirs = stem(target.substr(1, target.size() - 2));
    if (theirs != stem(file)) includes[stem(file)].insert(theirs);
  });
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
    if (target.find("<vtk") == 0) EXPECT_EQ(module_of(file), "render") << file << ":" << line;
    if (target.find("<OpenMesh") == 0) EXPECT_EQ(module_of(file), "cutting") << file << ":" << line;
  });
  EXPECT_LE(fcl.size(), 1u);
}
