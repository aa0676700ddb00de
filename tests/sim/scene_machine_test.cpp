// [machine] and [control]: what is written reads as the same.

#include <string>

#include <gtest/gtest.h>

#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

MachineDescription machine_of(const std::string& text) {
  InputErrors input_errors;
  MachineDescription machine = read_machine(parse_toml(text, "m.toml"), input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  return machine;
}

std::string toml_of(Node::Table table) { return to_toml(Node{{}, std::move(table)}); }

constexpr const char* rich_machine = R"(
name = "rich"
code = "w C' b X Y Z B s t"
rapid_mm_per_min = 6000
rapid_deg_per_min = 720
nose = { at_mm = [1, 2, 3], axis = [0, 1, 0], x = [0, 1, 3] }
workpiece = { at_mm = [10, 0, -5], turn_deg = [0, 90, 0] }
home = { Z_deg = 45, X_mm = 100, C_deg = 90 }
[axis.C]
point_mm = [0, 0.5, 0]
[axis.X]
direction = [0, 0, -2]
point_mm = [0, 0, 10]
travel_mm = [-300, 300]
squareness = "travel"
[axis.Y]
[axis.Z]
motion = "rotary"
point_mm = [7, 8, 9]
travel_deg = [-90, 90]
[axis.B]
point_mm = [0, 0, 20]
deviation_axes = "turning"
)";

TEST(SceneMachine, AShapeThatIsNoneIsAllThatIsSaidOfABody) {
  const auto faults_of_body = [](const std::string& keys) {
    InputErrors input_errors;
    read_machine(parse_toml("code = \"w b X Y Z s t\"\nnose = { at_mm = [0, 0, 0] }\n[axis.X]\n"
                            "[axis.Y]\n[axis.Z]\n[[body]]\ncarried_by = \"Z\"\n" +
                                keys,
                            "m.toml"),
                 input_errors);
    return text_of(input_errors);
  };
  const std::string shapes =
      "one of \"box\", \"cone\", \"cylinder\", \"extrusion\", \"mesh\", \"revolution\", \"sphere\"";
  for (const char* keys :
       {"size_mm = [1, 2, 3]\n", "radius_mm = 3\nheight_mm = 4\n", "file = \"m.stl\"\n", ""})
    EXPECT_EQ(faults_of_body(std::string("shape = \"boxx\"\n") + keys),
              "m.toml:8:9: expected " + shapes +
                  " for machine.body.shape, seen \"boxx\" (nearest: \"box\")\n");
  EXPECT_NE(faults_of_body("shape = \"boxx\"\nradus_mm = 3\n").find("radus_mm"), std::string::npos)
      << "a key of no shape is unknown all the same";
}

TEST(SceneMachine, WhatIsWrittenReadsAsTheSame) {
  const MachineDescription machine = machine_of(rich_machine);
  const std::string toml = toml_of(machine_to_table(machine));
  const MachineDescription again = machine_of(to_table);
  EXPECT_EQ(toml_of(machine_to_table(again)), toml);
  EXPECT_EQ(again.T_bs.matrix(), machine.T_bs.matrix());
  EXPECT_EQ(again.T_bw.matrix(), machine.T_bw.matrix());
  EXPECT_EQ(again.home, machine.home);
  ASSERT_EQ(again.joints.size(), 6u);
  for (std::size_t j = 0; j < 6; ++j) {
    const kinematics::Joint &a = machine.joints[j], &b = again.joints[j];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.side, b.side);
    EXPECT_EQ(a.motion, b.motion);
    EXPECT_EQ(a.direction_b, b.direction_b);
    EXPECT_EQ(a.point_b, b.point_b);
    EXPECT_EQ(a.min, b.min);
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.deviation_axes, b.deviation_axes);
    EXPECT_EQ(a.squareness, b.squareness);
  }
}

TEST(SceneMachine, PackagedMachinesAreWrittenAndReadAsTheSame) {
  for (const char* name : {"gantry_cxyza", "trunnion_ca", "head_head", "lathe_zx", "platform_xz"}) {
    const std::string file = std::string("machines/") + name + ".toml";
    const MachineDescription machine =
        read_scene(packaged("gantry_perfect.toml"), {{"machine", file}}).machine;
    const std::string toml = toml_of(machine_to_table(machine));
    EXPECT_EQ(toml_of(machine_to_table(machine_of(toml))), toml) << name;
  }
}

TEST(SceneMachine, ATurnIsWrittenAsItWasGiven) {
  for (const char* turn : {"[0.0, 90.0, 0.0]", "[180.0, 0.0, 0.0]", "[0.0, 0.0, -90.0]",
                           "[0.0, 12.5, 0.0]", "[10.0, 20.0, 30.0]", "[0.0, 0.0, 0.0]"}) {
    InputErrors input_errors;
    const Node given = parse_toml("turn_deg = " + std::string(turn), "t.toml");
    const Node::Table table =
        turn_fields().to_table(turn_fields().read_table(given, "", input_errors));
    EXPECT_EQ(toml_of(table), to_toml(given));
  }
}

TEST(SceneMachine, WhatTheControlBelievesIsWrittenAndReadAsTheSame) {
  const MachineDescription machine = read_scene(packaged("gantry_perfect.toml")).machine;
  const auto control_of = [&](const std::string& text) {
    InputErrors input_errors;
    ControlDescription control =
        read_control(parse_toml(text, "c.toml"), machine.joints, input_errors);
    for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
    return control;
  };
  for (const char* text :
       {"", "tool_length_mm = 100.02",
        "[axis.C]\npoint_mm = [0.01, 0, 0]\n[axis.A]\ndirection = [1, 1e-4, 0]"}) {
    const ControlDescription control = control_of(text);
    const std::string toml = toml_of(control_to_table(control));
    const ControlDescription again = control_of(toml);
    EXPECT_EQ(toml_of(control_to_table(again)), toml);
    EXPECT_EQ(again.tool_length, control.tool_length);
    EXPECT_EQ(again.joints.size(), control.joints.size());
  }
}

}  // namespace
}  // namespace abbe::sim
