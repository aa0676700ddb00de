#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>

#include <gtest/gtest.h>

namespace fs = std::filesystem;

namespace {

/// Who may include whom. A folder may always include itself.
const std::map<std::string, std::set<std::string>> may_know = {
    {"kinematics", {}},
    {"errors", {"kinematics"}},
    {"errors/metrology", {"kinematics", "errors"}},
    {"errors/identification", {"kinematics", "errors", "errors/metrology"}},
    {"cutting", {"kinematics"}},
    {"render", {"kinematics", "cutting"}},
    {"sim/program", {"kinematics", "cutting"}},
    {"sim/compensation", {"kinematics", "errors", "errors/identification", "sim/program"}},
    {"sim",
     {"kinematics", "errors", "errors/metrology", "errors/identification", "cutting", "render",
      "sim/program", "sim/compensation"}},
    {"the command line", {"kinematics", "sim", "sim/compensation", "sim/study"}},
    {"sim/study",
     {"kinematics", "errors", "errors/metrology", "errors/identification", "cutting", "render",
      "sim", "sim/program", "sim/compensation"}},
};

std::string module_of(const std::string& path) {
  if (path == "sim/main.cpp") return "the command line";
  for (const char* inner :
       {"errors/metrology", "errors/identification", "sim/program", "sim/compensation", "sim/study"})
    if (path.rfind(std::string(inner) + "/", 0) == 0) return inner;
  return path.substr(0, path.find('/'));
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
        EXPECT_TRUE(mine == theirs || may_know.at(mine).count(theirs))
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
  std::set<std::string> reached{"sim/identify", "sim/identify_composite", "sim/identify_text",
                                "sim/evaluate", "sim/evaluate_tests",     "sim/readings_file"};
  for (const auto& [file, ignored] : includes)
    if (file.rfind("errors/identification/", 0) == 0) reached.insert(file);
  EXPECT_GT(reached.size(), 15u);
  for (std::set<std::string> next = reached; !next.empty();) {
    std::set<std::string> found;
    for (const std::string& file : next) {
      EXPECT_TRUE(file != "sim/truth" && file != "sim/measure" && file != "sim/loop")
          << "reached from what reads readings: " << file;
      for (const std::string& target : includes[file])
        if (reached.insert(target).second) found.insert(target);
    }
    next = std::move(found);
  }
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
