// The work space: what the grid means, what is said of it, against pose after pose.

#include <iostream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/cut/idle_machine.h"
#include "sim/report/pose_report.h"
#include "tests/sim/pose_scene.h"
#include "tests/sim/refusal.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

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
    EXPECT_NE(refusal.find(expected), std::string::npos) << text << "\n" << refusal;
  }
  const IdleMachine platform = idle_of(scenes() / "platform_plane.toml");
  EXPECT_NE(refusal_by([&] {
              pose_grid(platform, "S=::9 X=0 Z=0");
            }).find("S=from:to for an axis without travel limits"),
            std::string::npos);
}

TEST(FarthestPair, IsThatOfEveryPairTried) {
  const unsigned seed = 20261127;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 400; ++trial) {
    cutting::Points points(1 + trial % 60, 3);
    for (double& x : points.reshaped()) x = normal(random);
    if (trial % 4 == 1) points.col(2).setZero();
    if (trial % 4 == 2) points.rowwise().normalize();  // all on a sphere: nothing can be left out
    if (trial % 4 == 3) points = points.array().round();
    double most = 0.0;
    for (Eigen::Index i = 0; i < points.rows(); ++i)
      for (Eigen::Index k = 0; k < i; ++k)
        most = std::max(most, (points.row(i) - points.row(k)).norm());
    const FarthestPair pair = farthest_pair(points);
    ASSERT_EQ(pair.distance, most);
    ASSERT_EQ((points.row(Eigen::Index(pair.a)) - points.row(Eigen::Index(pair.b))).norm(), most);
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
      const auto row = Eigen::Index(i);
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
    EXPECT_NE(to_text(idle, map, s).find("worst pair"), std::string::npos);
  }
}

// By hand: squareness alone displaces a point at height z by -+ angle x z, straight up the column.
TEST(VolumetricMap, OfASquarenessIsTheShearThatItIs) {
  const IdleMachine idle = idle_of(idle_scene("gantry_cxyza", "[errors]\nEB0Z_urad = 100\n"));
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, "X=::3 Y=::3 Z=0:300:4"));
  for (Eigen::Index i = 0; i < map.nominal.rows(); ++i) {
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
  EXPECT_NE(refusal.find("X_mm = -300"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("EXX"), std::string::npos) << refusal;
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
  EXPECT_NE(said(tool_side, "").find("EXX 1.5"), std::string::npos) << said(tool_side, "");
  EXPECT_EQ(said(tool_side, "X=-200:200"), "");
  const IdleMachine primed =
      idle_of(idle_scene("three_axis_table", curve + "centre_mm = 200\nargument = \"carriage\"\n"));
  EXPECT_EQ(said(primed, "X=-400:0"), "");
  EXPECT_NE(said(primed, "X=0:100").find("EXX 1.5"), std::string::npos);
}

TEST(VolumetricMap, EveryMachineOfTheLibraryGivesItsFiles) {
  const SceneFolder folder;
  for (const WrongMachine& wrong : wrong_machines()) {
    const IdleMachine idle = idle_of(wrong.toml);
    const std::filesystem::path out = folder.path() / wrong.name;
    std::filesystem::create_directories(out);
    const bool lathe = wrong.name == "lathe_zx" || wrong.name == "platform_xz";
    const VolumetricMap map =
        volumetric_map(idle, pose_grid(idle, lathe ? "X=::4 Z=::4" : "X=::4 Y=::3 Z=::3"));
    write_volumetric_files(ResultFolder(out, {}), PoseTable(idle, {}), map, summary(map), {});
    std::vector<std::string> names{"volumetric.csv"};
    if (ABBE_RENDER)
      names.insert(names.end(), {"volumetric.vts", "volumetric.vtp", "volumetric.png"});
    for (const std::string& name : names)
      EXPECT_GT(std::filesystem::file_size(out / name), 1000u) << name;
    std::ifstream csv(out / "volumetric.csv");
    int lines = 0;
    for (std::string line; std::getline(csv, line);) ++lines;
    EXPECT_EQ(lines, 1 + int(map.grid.poses.size()));
  }
}

}  // namespace
}  // namespace abbe::sim
