// `abbe pose` as it is called: what it prints, what it writes, and what it leaves alone.

#include <sys/wait.h>
#include <nlohmann/json.hpp>
#include "sim/cut/idle_machine.h"
#include "sim/files/output.h"
#include "sim/report/pose_report.h"
#include "sim/scene/toml.h"
#include "tests/injured.h"
#include "tests/sim/pose_scene.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

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
  EXPECT_HAS(written.out, "3000 poses");
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
  EXPECT_TRUE(fs::is_directory(folder_.path() / "folder")) << "a folder for the file";
}

TEST_F(PoseCommandLine, ARefusedTableWritesNothing) {
  folder_.write("poses.csv", "X_mm,Y_mm\n0,0\n400,0\n0,word\n");
  for (const char* out : {"", " --out table.csv"}) {
    const PoseRun ran = run(dome + " --at-file poses.csv" + out);
    EXPECT_EQ(ran.code, 3);
    EXPECT_EQ(ran.out, "");
    EXPECT_HAS(ran.err, "poses.csv:3:1: expected X_mm between -300 and 300");
    EXPECT_HAS(ran.err, "poses.csv:4:3");
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
  EXPECT_HAS(left.err, "poses.csv:3: ");
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
  EXPECT_HAS(cold.err, "time has no effect");
  const std::string warm = (scenes() / "thermal_protocol.toml").string();
  const PoseRun after = run(warm + " --at-file poses.csv --json");
  EXPECT_HAS(after.err, "1 of 2 poses are after time 0");
  EXPECT_EQ(nlohmann::json::parse(after.out)["warnings"].size(), 1u);
  const std::string lost =
      folder_
          .write("lost.toml",
                 idle_scene("gantry_cxyza",
                            "[[errors.EXX]]\nkind = \"backlash\"\nhalf_um = -1.5\n[[errors.EXX]]\n"
                            "kind = \"repeatability\"\nsigma_um = 0.25\n"))
          .string();
  const PoseRun rest = run(lost + " --at X=10");
  EXPECT_HAS(rest.err, "reversal adds or subtracts: EXX 1.5 um");
  EXPECT_HAS(rest.err, "EXX 0.25 um");
}

TEST_F(PoseCommandLine, TheWorkSpaceGivesItsFilesAndFigures) {
  const PoseRun text = run(dome + " --grid \"X=::3 Y=::4 Z=::5\" --out map --elements EC0Y");
  ASSERT_EQ(text.code, 0) << text.err;
  EXPECT_HAS(text.out, "volumetric error");
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

// Tables of poses as people and programs write them, good and bad.

const kinematics::Chain& gantry_chain() { return idle_gantry().machine.nominal; }

PoseList poses_in(const std::string& text) { return read_poses(text, "poses.csv", gantry_chain()); }

TEST(PoseList, ReadsAxesInAnyOrderAndTimeWithTheirUnits) {
  const PoseList poses = poses_in(
      "\xEF\xBB\xBF# made by hand\r\nA_deg; time_min ;X_mm;C_rad\r\n\r\n30;-2;1.5e2;+0.25\r\n"
      "# one more\n-30;0;-1;-1e-12\n");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_TRUE(poses.is_timed());
  EXPECT_EQ(poses.line, (std::vector<int>{4, 6}));
  const kinematics::AxisState first = poses.state(0), second = poses.state(1);
  EXPECT_EQ(first.time_s, -120.0);
  EXPECT_EQ(first.q[*gantry_chain().find('A')], 30 * units::deg);
  EXPECT_EQ(first.q[*gantry_chain().find('X')], 150.0);
  EXPECT_EQ(first.q[*gantry_chain().find('C')], 0.25);
  EXPECT_EQ(first.q[*gantry_chain().find('Y')], 0.0);
  EXPECT_EQ(second.q[*gantry_chain().find('C')], -1e-12);
  EXPECT_EQ(poses.text(0), "A_deg = 30, time_min = -2, X_mm = 150, C_rad = 0.25");
}

TEST(PoseList, BothEndsOfTheTravelAreWithinIt) {
  EXPECT_EQ(poses_in("X_mm,A_deg\n-300,-110\n300,110\n").size(), 2u);
}

TEST(PoseList, RefusesWithLineAndColumn) {
  struct Bad {
    const char* text;
    const char* place;
    const char* expected;
  };
  for (const Bad& bad : {
           Bad{"X_mm,Q_mm\n1,2\n", "poses.csv:1:6",
               "a column name of C_deg,X_mm,Y_mm,Z_mm,A_deg,time_s"},
           Bad{"X,Y\n1,2\n", "poses.csv:1:1", "expected X_mm as the column name"},
           Bad{"X_mm,s_deg\n1,2\n", "poses.csv:1:6", "a column name of"},
           Bad{"X_deg\n1\n", "poses.csv:1:1", "X_mm as the column name"},
           Bad{"X_rad\n1\n", "poses.csv:1:1", "X_mm as the column name"},
           Bad{"A_mm\n1\n", "poses.csv:1:1", "A_deg or A_rad as the column name"},
           Bad{"X_mm,X_mm\n1,2\n", "poses.csv:1:6", "each column only once"},
           Bad{"A_deg,A_rad\n1,2\n", "poses.csv:1:7", "each column only once"},
           Bad{"X_mm,time_s,time_h\n1,2,3\n", "poses.csv:1:13", "each column only once"},
           Bad{"time_s\n1\n", "poses.csv:1:7", "at least one axis"},
           Bad{"X_mm,\n1,\n", "poses.csv:1:6", "a column name of"},
           Bad{"X_mm\n1 2\n", "poses.csv:2:3", "1 cells"},
           Bad{"X_mm,Y_mm\n1,12;5\n", "poses.csv:2:3", "a number"},
           Bad{"X_mm\n300.0000001\n", "poses.csv:2:1", "X_mm between -300 and 300"},
           Bad{"A_deg,X_mm\n0,0\n-110.001,0\n", "poses.csv:3:1", "A_deg between -110 and 110"},
       }) {
    const std::string refusal = refusal_by([&] { poses_in(bad.text); });
    EXPECT_EQ(refusal.rfind(bad.place, 0), 0u) << bad.text << "\n" << refusal;
    EXPECT_HAS(refusal, bad.expected) << bad.text;
  }
}

TEST(PoseList, TellsTheFaultsOfUpToTwentyRowsAtOnce) {
  std::string text = "X_mm\n";
  for (int i = 0; i < 30; ++i) text += i % 2 == 0 ? "999\n" : "word\n";
  try {
    poses_in(text);
    FAIL() << "was read";
  } catch (const BadScene& input_errors) {
    EXPECT_EQ(input_errors.input_errors.size(), 20u);
    EXPECT_EQ(input_errors.input_errors.front().line, 2);
    EXPECT_EQ(input_errors.input_errors.back().line, 21);
  }
}

TEST(PoseList, InjuredTextsAreReadOrRefusedAndNothingElse) {
  SeededRandom random(20261126);
  const std::string good =
      "# poses\nX_mm,Y_mm,Z_mm,A_deg,C_rad,time_s\n1,2,3,4,0.5,-6\n-300,350,0,-110,1e-12,0\n"
      "2.5,+1,.5,0,-0,1e3\n";
  int read_well = 0, refused = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::string text = injured(good, ",;. \t\n\r#-+eE0123456789_XYZACmdegrtinf\"", 2, random);
    try {
      const PoseList poses = poses_in(text);
      ++read_well;
      ASSERT_EQ(poses.numbers.size(), poses.size() * poses.columns.size());
      ASSERT_EQ(poses.line.size(), poses.size());
      for (std::size_t k = 0; k < poses.size(); ++k) {
        const kinematics::AxisState state = poses.state(k);
        for (int j = 0; j < gantry_chain().size(); ++j) {
          const kinematics::Joint& joint = gantry_chain().joints()[std::size_t(j)];
          ASSERT_TRUE(state.q[j] >= joint.min && state.q[j] <= joint.max) << text;
        }
      }
    } catch (const BadInput&) {
      ++refused;
    } catch (const BadScene& input_errors) {
      ++refused;
      ASSERT_FALSE(input_errors.input_errors.empty());
    }
  }
  std::cout << read_well << " read, " << refused << " refused\n";
  EXPECT_GT(read_well, 1000);
  EXPECT_GT(refused, 1000);
}

// The work space: what the grid means, what is said of it, against pose after pose.

TEST(PoseGrid, WithoutAWordRunsTheSlidesOverTheirTravel) {
  const PoseGrid grid = pose_grid(idle_gantry(), "");
  EXPECT_EQ(grid.size, (std::array{11, 11, 11}));
  ASSERT_EQ(grid.poses.size(), 1331u);
  EXPECT_EQ(grid.poses.text(0), "C_deg = 0, X_mm = -300, Y_mm = -350, Z_mm = -50, A_deg = 0");
  EXPECT_EQ(grid.poses.text(1), "C_deg = 0, X_mm = -240, Y_mm = -350, Z_mm = -50, A_deg = 0");
  EXPECT_EQ(grid.poses.text(1330), "C_deg = 0, X_mm = 300, Y_mm = 350, Z_mm = 350, A_deg = 0");
  const IdleMachine platform = idle_of(scenes() / "platform_plane.toml");
  EXPECT_EQ(pose_grid(platform, "").size, (std::array{21, 21, 1}));
}

TEST(PoseGrid, SaysEndsCountsAndPlaces) {
  const PoseGrid grid = pose_grid(idle_gantry(), "X=-100:250:3, Y=10 Z=::2 A=30 C=-90");
  EXPECT_EQ(grid.size, (std::array{3, 2, 1}));
  EXPECT_EQ(grid.poses.text(1), "C_deg = -90, X_mm = 75, Y_mm = 10, Z_mm = -50, A_deg = 30");
  EXPECT_EQ(grid.poses.text(5), "C_deg = -90, X_mm = 250, Y_mm = 10, Z_mm = 350, A_deg = 30");
  const PoseGrid turned = pose_grid(idle_gantry(), "A=-90:90:19 C=0:355:72 X=50 Y=0 Z=100");
  EXPECT_EQ(turned.size, (std::array{72, 19, 1}));
  EXPECT_EQ(pose_grid(idle_gantry(), "X=: Y=0 Z=0").size, (std::array{101, 1, 1}));
  EXPECT_EQ(pose_grid(idle_gantry(), "Y=::11 X=0 Z=0").poses.text(7),
            "C_deg = 0, X_mm = 0, Y_mm = 140, Z_mm = 0, A_deg = 0");
  EXPECT_EQ(pose_grid(idle_gantry(), "Y=::11 X=0 Z=0").poses.numbers[7 * 5 + 2], 140.0);
}

TEST(PoseGrid, RefusesWithTheColumn) {
  for (const auto& [text, place, expected] : std::vector<std::array<std::string, 3>>{
           {"Q=0:1:2", "--grid:1:1", "an axis of this machine (C X Y Z A)"},
           {"s=0:1:2", "--grid:1:1", "an axis of this machine"},
           {"X=0:1:2 X=1", "--grid:1:9", "each axis only once"},
           {"X0:1:2", "--grid:1:2", "= after the axis"},
           {"X", "--grid:1:2", "= after the axis"},
           {"X=", "--grid:1:3", "a number"},
           {"X=a", "--grid:1:3", "a number"},
           {"X=0:nan:2", "--grid:1:5", "a number"},
           {"X=0:10:1", "--grid:1:8", "a count from 2"},
           {"X=0:10:2.5", "--grid:1:8", "a count from 2"},
           {"X=0:10:3:4", "--grid:1:10", "from:to:count"},
           {"X=0:301:2", "--grid:1:3", "X between -300 and 300 mm"},
           {"X=-301", "--grid:1:3", "X between -300 and 300 mm"},
           {"X=10:10:3", "--grid:1:3", "a start below the end"},
           {"X=10:0:3", "--grid:1:3", "a start below the end"},
           {"X=0 Y=0 Z=0", "--grid:1:1", "one to three axes with a range"},
           {"A=-1:1:2", "--grid:1:1", "one to three axes with a range"},
           {"X=::100 Y=::100 Z=::100", "--grid:1:1", "at most 200000 poses"},
       }) {
    const std::string refusal = refusal_by([&] { pose_grid(idle_gantry(), text); });
    EXPECT_EQ(refusal.rfind(place, 0), 0u) << text << "\n" << refusal;
    EXPECT_HAS(refusal, expected) << text;
  }
  const IdleMachine platform = idle_of(scenes() / "platform_plane.toml");
  EXPECT_HAS(refusal_by([&] { pose_grid(platform, "S=::9 X=0 Z=0"); }),
             "S=from:to for an axis without travel limits");
}

TEST(FarthestPair, IsThatOfEveryPairTried) {
  SeededRandom random(20261127);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 400; ++trial) {
    cutting::Points points(1 + trial % 60, 3);
    for (double& x : points.reshaped()) x = normal(random);
    if (trial % 4 == 1) points.col(2).setZero();
    if (trial % 4 == 2) points.rowwise().normalize();  // all on a sphere: nothing can be left out
    if (trial % 4 == 3) points = points.array().round();
    double most = 0.0;
    for (Index i = 0; i < points.rows(); ++i)
      for (Index k = 0; k < i; ++k) most = std::max(most, (points.row(i) - points.row(k)).norm());
    const FarthestPair pair = farthest_pair(points);
    ASSERT_EQ(pair.distance, most);
    ASSERT_EQ((points.row(Index(pair.a)) - points.row(Index(pair.b))).norm(), most);
  }
}

TEST(VolumetricMap, IsPoseAfterPoseAndSaysWhatIsWorst) {
  for (const WrongMachine& wrong : wrong_machines()) {
    SCOPED_TRACE(wrong.name);
    const IdleMachine idle = idle_of(wrong.toml);
    const bool lathe = wrong.name == "lathe_zx" || wrong.name == "platform_xz";
    const VolumetricMap map =
        volumetric_map(idle, pose_grid(idle, lathe ? "X=::7 Z=::5" : "X=::4 Y=::5 Z=::6"));
    const VolumetricSummary s = summary(map);
    double most = 0.0, squares = 0.0;
    Vector3d low = Vector3d::Constant(1e9), high = -low;
    for (std::size_t i = 0; i < map.grid.poses.size(); ++i) {
      const TipPose pose = tip_pose(idle, map.grid.poses.state(i));
      const auto row = Index(i);
      ASSERT_EQ(Vector3d(map.nominal.row(row)), Vector3d(pose.nominal.translation()));
      ASSERT_EQ(Vector3d(map.deviation.row(row)), pose.deviation());
      ASSERT_EQ(Vector3d(map.direction.row(row)), pose.direction());
      most = std::max(most, pose.deviation().norm() / units::um);
      squares += pose.deviation().squaredNorm() / (units::um * units::um);
      low = low.cwiseMin(pose.deviation() / units::um);
      high = high.cwiseMax(pose.deviation() / units::um);
    }
    EXPECT_DOUBLE_EQ(s.all.max_um, most);
    EXPECT_NEAR(s.all.rms_um, std::sqrt(squares / double(map.grid.poses.size())), 1e-9);
    EXPECT_LT((s.range_um - (high - low)).norm(), 1e-9);
    EXPECT_GT(s.worst_pair_um, 1.0);
    EXPECT_LE(s.worst_pair_um, 2 * s.all.max_um + 1e-9);
    EXPECT_GE(s.worst_pair_um, s.range_um.maxCoeff() - 1e-9);
    const auto json = to_json(idle, map, s);
    EXPECT_EQ(json["worst"]["pose"], s.all.worst + 1);
    EXPECT_EQ(json["poses"], map.grid.poses.size());
    EXPECT_HAS(to_text(idle, map, s), "worst pair");
  }
}

// By hand: squareness alone displaces a point at height z by -+ angle x z, straight up the column.
TEST(VolumetricMap, OfASquarenessIsTheShearThatItIs) {
  const IdleMachine idle = idle_of(idle_scene("gantry_cxyza", "[errors]\nEB0Z_urad = 100\n"));
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, "X=::3 Y=::3 Z=0:300:4"));
  for (Index i = 0; i < map.nominal.rows(); ++i) {
    const double z = map.grid.poses.state(std::size_t(i)).q[3];
    const double turned_x = map.deviation(i, 0);
    // EB0Z > 0 turns Z towards +X about its point at z = 200, tool and all: the tip hangs 250 below
    EXPECT_NEAR(turned_x, std::sin(100e-6) * (z - 50.0 - 200.0), 1e-9);
    EXPECT_NEAR(map.deviation(i, 1), 0.0, 1e-12);
  }
  const VolumetricSummary s = summary(map);
  EXPECT_NEAR(s.range_um.x(), 30.0, 1e-3);
  EXPECT_NEAR(s.worst_pair_um, 30.0, 1e-3);
  EXPECT_NEAR(s.range_urad.norm(), 0.0, 1e-6);
}

TEST(VolumetricMap, ALeftTableNamesThePoseAndTheElement) {
  const IdleMachine idle = idle_of(idle_scene(
      "gantry_cxyza", "[errors.EXX]\nkind = \"table\"\nq_mm = [-100, 100]\nvalue_um = [0, 5]\n"));
  const std::string refusal = refusal_by([&] { volumetric_map(idle, pose_grid(idle, "")); });
  EXPECT_EQ(refusal.rfind("--grid: ", 0), 0u) << refusal;
  EXPECT_HAS(refusal, "X_mm = -300");
  EXPECT_HAS(refusal, "EXX");
  EXPECT_EQ(refusal_by([&] { volumetric_map(idle, pose_grid(idle, "X=-100:100")); }), "");
}

TEST(PoseDoubts, CurvesBeyondTheirRangeAreNamedWithHowFarTheyAreFollowed) {
  const std::string curve =
      "[errors.EXX]\nkind = \"legendre\"\ncoefficients_um = [0, 5]\n"
      "half_range_mm = 200\n";
  const auto said = [](const IdleMachine& idle, const std::string& grid) {
    const std::vector<std::string> all = pose_warnings(idle, pose_grid(idle, grid).poses);
    return all.empty() ? std::string() : all.front();
  };
  const IdleMachine tool_side = idle_of(idle_scene("gantry_cxyza", curve));
  EXPECT_HAS(said(tool_side, ""), "EXX 1.5");
  EXPECT_EQ(said(tool_side, "X=-200:200"), "");
  const IdleMachine primed =
      idle_of(idle_scene("three_axis_table", curve + "centre_mm = 200\nargument = \"carriage\"\n"));
  EXPECT_EQ(said(primed, "X=-400:0"), "");
  EXPECT_HAS(said(primed, "X=0:100"), "EXX 1.5");
}

TEST(VolumetricMap, EveryMachineOfTheLibraryGivesItsFiles) {
  const SceneFolder folder;
  for (const WrongMachine& wrong : wrong_machines()) {
    const IdleMachine idle = idle_of(wrong.toml);
    const fs::path out = folder.path() / wrong.name;
    fs::create_directories(out);
    const bool lathe = wrong.name == "lathe_zx" || wrong.name == "platform_xz";
    const VolumetricMap map =
        volumetric_map(idle, pose_grid(idle, lathe ? "X=::4 Z=::4" : "X=::4 Y=::3 Z=::3"));
    write_volumetric_files(ResultFolder(out, {}), PoseTable(idle, {}), map, summary(map), {});
    std::vector<std::string> names{"volumetric.csv"};
    if (ABBE_RENDER)
      names.insert(names.end(), {"volumetric.vts", "volumetric.vtp", "volumetric.png"});
    for (const std::string& name : names) EXPECT_GT(fs::file_size(out / name), 1000u) << name;
    std::ifstream csv(out / "volumetric.csv");
    int lines = 0;
    for (std::string line; std::getline(csv, line);) ++lines;
    EXPECT_EQ(lines, 1 + int(map.grid.poses.size()));
  }
}

}  // namespace
}  // namespace abbe::sim
