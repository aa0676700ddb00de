// `abbe pose` as it is called: what it prints, what it writes, and what it leaves alone.

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "tests/sim/pose_scene.h"
#include "tests/sim/scene_folder.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

struct PoseRun {
  int code = 0;
  std::string out, err;
};

class PoseCommandLine : public testing::Test {
 protected:
  PoseRun run(const std::string& arguments, const std::string& before = {}) const {
    const fs::path err = folder_.path() / "stderr.txt";
    const std::string command = "cd " + folder_.path().string() + " && " + before + ABBE_PROGRAM +
                                " pose " + arguments + " 2>" + err.string();
    std::FILE* pipe = ::popen(command.c_str(), "r");
    PoseRun ran;
    std::array<char, 4096> buffer;
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
      ran.out.append(buffer.data(), n);
    const int status = ::pclose(pipe);
    ran.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    ran.err = bytes(err);
    return ran;
  }

  int files() const {
    int count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
      count += entry.is_regular_file() && entry.path().filename() != "stderr.txt" &&
               entry.path().filename() != manifest_name;
    return count;
  }

  const std::string dome = (scenes() / "gantry_dome.toml").string();
  SceneFolder folder_;
};

TEST_F(PoseCommandLine, ATableIsPrintedOrWrittenWithTheSameBytesForAnyThreads) {
  const IdleMachine idle = idle_of(scenes() / "gantry_dome.toml");
  folder_.write("poses.csv", csv_of(idle, any_states(idle, 3000, 20261128)));
  const std::string what = dome + " --at-file poses.csv --elements all --jacobian axis,motion ";
  const PoseRun one = run(what + "--threads 1"), two = run(what + "--threads 2");
  ASSERT_EQ(one.code, 0) << one.err;
  EXPECT_EQ(one.err, "");
  EXPECT_EQ(one.out, two.out);
  const auto rows = cells_of_csv(one.out);
  ASSERT_EQ(rows.size(), 3001u);
  EXPECT_EQ(rows[3000][0], "3000");
  for (const auto& row : rows) ASSERT_EQ(row.size(), rows.front().size());
  const PoseRun written = run(what + "--out deep/table.csv");
  EXPECT_EQ(written.code, 0) << written.err;
  EXPECT_EQ(bytes(folder_.path() / "deep/table.csv"), one.out);
  EXPECT_NE(written.out.find("3000 poses"), std::string::npos) << written.out;
  EXPECT_EQ(files(), 2) << "nothing unfinished is left";
  EXPECT_EQ(run(what + "--out deep/table.csv").code, 0) << "its own table may be replaced";
}

// What is written is more than may be held. ABBE_LONG=1 tries ten times as many, and a million.
TEST_F(PoseCommandLine, ManyPosesTakeLittleMemory) {
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  const IdleMachine idle = idle_of(scenes() / "gantry_dome.toml");
  const auto run_within = [&](int kb, const std::string& arguments) {
    return run(dome + " --at-file poses.csv " + arguments, fmt::format("ulimit -d {} && ", kb));
  };
  folder_.write("poses.csv", csv_of(idle, any_states(idle, is_long ? 200000 : 20000, 20261129)));
  const int max_kb = is_long ? 120000 : 65000;
  const PoseRun ran = run_within(max_kb, "--elements all --threads 2 --out shares.csv");
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto written_kb = long(fs::file_size(folder_.path() / "shares.csv") >> 10);
  std::cout << written_kb << " KB written within " << max_kb << " KB\n";
  EXPECT_GT(written_kb, 1.1 * max_kb);
  EXPECT_NE(run_within(5000, "--out other.csv").code, 0) << "the limit means something";
  if (!is_long) return;
  fs::remove(folder_.path() / "shares.csv");
  folder_.write("poses.csv", csv_of(idle, any_states(idle, 1000000, 20261130)));
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(run_within(300000, "--threads 1 --out table.csv").code, 0);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
  std::cout << "a million poses in " << spent.count() << " s\n";
}

TEST_F(PoseCommandLine, JsonHasTheNumbersOfTheTable) {
  folder_.write("poses.csv", "X_mm,A_deg\n0,0\n100,30\n-100,-30\n");
  const PoseRun csv = run(dome + " --at-file poses.csv --elements EXX,EC0Y");
  const PoseRun json = run(dome + " --at-file poses.csv --elements EXX,EC0Y --json");
  ASSERT_EQ(json.code, 0) << json.err;
  const auto read = nlohmann::json::parse(json.out);
  const auto rows = cells_of_csv(csv.out);
  ASSERT_EQ(read["poses"].size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < rows[0].size(); ++k)
      EXPECT_EQ(read["poses"][i][rows[0][k]].get<double>(), std::stod(rows[i + 1][k]))
          << rows[0][k];
  EXPECT_EQ(read["summary"]["poses"], 3);
  EXPECT_TRUE(read["warnings"].empty());
  EXPECT_EQ(run(dome + " --at-file poses.csv --elements EXX,EC0Y --out a.json").code, 0);
  EXPECT_EQ(bytes(folder_.path() / "a.json"), json.out);
}

TEST_F(PoseCommandLine, NothingOfTheUsersIsOverwritten) {
  folder_.write("poses.csv", "X_mm\n0\n");
  folder_.write("mine.csv", "x,y\n1,2\n");
  folder_.write("mine.json", "{}\n");
  for (const char* out : {"poses.csv", "mine.csv", "mine.json", ".", "mine.txt"}) {
    const PoseRun ran = run(dome + " --at-file poses.csv --out " + out);
    EXPECT_EQ(ran.code, 5) << out << ran.err;
    EXPECT_EQ(ran.out, "") << out;
  }
  EXPECT_EQ(bytes(folder_.path() / "poses.csv"), "X_mm\n0\n");
  EXPECT_EQ(bytes(folder_.path() / "mine.csv"), "x,y\n1,2\n");
  EXPECT_EQ(bytes(folder_.path() / "mine.json"), "{}\n");
  EXPECT_EQ(files(), 3);
  EXPECT_EQ(run(dome + " --at-file poses.csv --out folder").code, 0);
  EXPECT_TRUE(std::filesystem::is_directory(folder_.path() / "folder")) << "a folder for the file";
}

TEST_F(PoseCommandLine, ARefusedTableWritesNothing) {
  folder_.write("poses.csv", "X_mm,Y_mm\n0,0\n400,0\n0,word\n");
  for (const char* out : {"", " --out table.csv"}) {
    const PoseRun ran = run(dome + " --at-file poses.csv" + out);
    EXPECT_EQ(ran.code, 3);
    EXPECT_EQ(ran.out, "");
    EXPECT_NE(ran.err.find("poses.csv:3:1: expected X between -300 and 300 mm"), std::string::npos)
        << ran.err;
    EXPECT_NE(ran.err.find("poses.csv:4:3"), std::string::npos) << ran.err;
  }
  EXPECT_EQ(files(), 1);
  const std::string table =
      folder_
          .write("table.toml",
                 idle_scene("gantry_cxyza",
                            "[errors.EXX]\nkind = \"table\"\nq_mm = [-100, 100]\nvalue_um = [0, "
                            "5]\n"))
          .string();
  folder_.write("poses.csv", "X_mm\n0\n101\n");
  const PoseRun left = run(table + " --at-file poses.csv --out table.csv");
  EXPECT_EQ(left.code, 3);
  EXPECT_NE(left.err.find("poses.csv:3: "), std::string::npos) << left.err;
  EXPECT_EQ(files(), 2) << "nothing unfinished is left";
}

TEST_F(PoseCommandLine, OneKindOfPlaceIsAskedForAtATime) {
  folder_.write("poses.csv", "X_mm\n0\n");
  EXPECT_EQ(run(dome).code, 2);
  EXPECT_EQ(run(dome + " --at X=0 --grid").code, 2);
  EXPECT_EQ(run(dome + " --at-file poses.csv --grid").code, 2);
  EXPECT_EQ(run(dome + " --at X=0 --out a.csv").code, 2);
  EXPECT_EQ(run(dome + " --at X=0 --jacobian all").code, 2);
  EXPECT_EQ(run(dome + " --at X=0 --elements EXU").code, 3);
  EXPECT_EQ(run(dome + " --at-file none.csv").code, 3);
  EXPECT_EQ(run("--help").code, 0);
}

TEST_F(PoseCommandLine, WhatStandingStillLeavesOutIsSaid) {
  folder_.write("poses.csv", "X_mm,time_h\n0,0\n0,1\n");
  const PoseRun cold = run(dome + " --at-file poses.csv");
  EXPECT_EQ(cold.code, 0);
  EXPECT_NE(cold.err.find("time has no effect"), std::string::npos) << cold.err;
  const std::string warm = (scenes() / "thermal_protocol.toml").string();
  const PoseRun after = run(warm + " --at-file poses.csv --json");
  EXPECT_NE(after.err.find("1 of 2 poses are after time 0"), std::string::npos) << after.err;
  EXPECT_EQ(nlohmann::json::parse(after.out)["warnings"].size(), 1u);
  const std::string lost =
      folder_
          .write("lost.toml",
                 idle_scene("gantry_cxyza",
                            "[[errors.EXX]]\nkind = \"backlash\"\nhalf_um = -1.5\n[[errors.EXX]]\n"
                            "kind = \"repeatability\"\nsigma_um = 0.25\n"))
          .string();
  const PoseRun rest = run(lost + " --at X=10");
  EXPECT_NE(rest.err.find("reversal adds or subtracts: EXX 1.5 um"), std::string::npos) << rest.err;
  EXPECT_NE(rest.err.find("EXX 0.25 um"), std::string::npos) << rest.err;
}

TEST_F(PoseCommandLine, TheWorkSpaceGivesItsFilesAndFigures) {
  const PoseRun text = run(dome + " --grid \"X=::3 Y=::4 Z=::5\" --out map --elements EC0Y");
  ASSERT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("volumetric error"), std::string::npos) << text.out;
  std::vector<std::string> names{"volumetric.csv", "volumetric.json"};
  if (ABBE_RENDER)
    names.insert(names.end(), {"volumetric.vts", "volumetric.vtp", "volumetric.png"});
  for (const std::string& name : names)
    EXPECT_GT(fs::file_size(folder_.path() / "map" / name), 1000u) << name;
  const auto rows = cells_of_csv(bytes(folder_.path() / "map/volumetric.csv"));
  ASSERT_EQ(rows.size(), 61u);
  const auto json = nlohmann::json::parse(bytes(folder_.path() / "map/volumetric.json"));
  EXPECT_EQ(json["poses"], 60);
  // the worst pose of the summary is the largest of the table
  double most = 0.0;
  std::size_t column = 0;
  while (rows[0].at(column) != "deviation_um") ++column;
  for (std::size_t i = 1; i < rows.size(); ++i) most = std::max(most, std::stod(rows[i][column]));
  EXPECT_DOUBLE_EQ(json["deviation_um"]["max"].get<double>(), most);
  const PoseRun again =
      run(dome + " --grid \"X=::3 Y=::4 Z=::5\" --out again --elements EC0Y --threads 1");
  for (const std::string& name : names)
    EXPECT_EQ(bytes(folder_.path() / "again" / name), bytes(folder_.path() / "map" / name)) << name;
  EXPECT_EQ(run(dome + " --grid X=0 --json").code, 0) << "two slides over their travel";
}

}  // namespace
}  // namespace abbe::sim
