// Tables of poses as people and programs write them, good and bad.

#include <iostream>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/cut/idle_machine.h"
#include "sim/scene/toml.h"
#include "tests/injured.h"
#include "tests/sim/pose_scene.h"
#include "tests/sim/refusal.h"

namespace abbe::sim {
namespace {

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
           Bad{"", "poses.csv:1", "an empty file"},
           Bad{"# nothing\n\n", "poses.csv:1:1", "a header such as"},
           Bad{"X_mm\n", "poses.csv:1", "at least one pose"},
           Bad{"X_mm,Q_mm\n1,2\n", "poses.csv:1:6",
               "a column name of C_deg,X_mm,Y_mm,Z_mm,A_deg,time_s"},
           Bad{"X,Y\n1,2\n", "poses.csv:1:1", "a column name of"},
           Bad{"X_mm,s_deg\n1,2\n", "poses.csv:1:6", "a column name of"},
           Bad{"X_deg\n1\n", "poses.csv:1:1", "a column name of"},
           Bad{"X_rad\n1\n", "poses.csv:1:1", "a column name of"},
           Bad{"A_mm\n1\n", "poses.csv:1:1", "a column name of"},
           Bad{"X_mm,X_mm\n1,2\n", "poses.csv:1:6", "each axis only once"},
           Bad{"A_deg,A_rad\n1,2\n", "poses.csv:1:7", "each axis only once"},
           Bad{"X_mm,time_s,time_h\n1,2,3\n", "poses.csv:1:13", "only one time column"},
           Bad{"time_s\n1\n", "poses.csv:1:1", "at least one axis"},
           Bad{"X_mm,\n1,\n", "poses.csv:1:6", "a column name of"},
           Bad{"X_mm,Y_mm\n1\n", "poses.csv:2:2", "2 cells"},
           Bad{"X_mm,Y_mm\n1,2,3\n", "poses.csv:2:5", "2 cells"},
           Bad{"X_mm,Y_mm\n1,\n", "poses.csv:2:3", "a number"},
           Bad{"X_mm\nnan\n", "poses.csv:2:1", "a number"},
           Bad{"X_mm\ninf\n", "poses.csv:2:1", "a number"},
           Bad{"X_mm\n1e400\n", "poses.csv:2:1", "a number"},
           Bad{"X_mm\n0x10\n", "poses.csv:2:1", "a number"},
           Bad{"X_mm\n1 2\n", "poses.csv:2:3", "1 cells"},
           Bad{"X_mm,Y_mm\n1,12;5\n", "poses.csv:2:3", "a number"},
           Bad{"X_mm\n300.0000001\n", "poses.csv:2:1", "X between -300 and 300 mm"},
           Bad{"A_deg,X_mm\n0,0\n-110.001,0\n", "poses.csv:3:1", "A between -110 and 110 deg"},
           Bad{"X_mm\n1\n\x01\n", "poses.csv:3:1", "plain text"},
       }) {
    const std::string refusal = refusal_by([&] { poses_in(bad.text); });
    EXPECT_EQ(refusal.rfind(bad.place, 0), 0u) << bad.text << "\n" << refusal;
    EXPECT_NE(refusal.find(bad.expected), std::string::npos) << bad.text << "\n" << refusal;
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
  const unsigned seed = 20261126;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
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

}  // namespace
}  // namespace abbe::sim
