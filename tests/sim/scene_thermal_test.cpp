#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"
#include "tests/sim/gantry.h"
#include "tests/sim/listed_keys.h"
#include "tests/sim/refusal.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using errors::Surroundings;

/// Line numbers of the tests below count here.
const std::string small_thermal = R"(reference_C = 21
start_C = 22
[[node]]
name = "spindle"
capacity_J_per_K = 8000
[[node]]
name = "bed"
capacity_J_per_K = 6e5
start_C = 19.5
[[link]]
between = ["spindle", "bed"]
conductance_W_per_K = 25
[[link]]
between = ["room", "bed"]
conductance_W_per_K = 12
)";

ThermalDescription thermal_of(const std::string& text, InputErrors& input_errors,
                              const MachineDescription& machine = gantry()) {
  const Node table = parse_toml(text, "t");
  return read_thermal(table, machine, 7, input_errors);
}

ThermalDescription thermal_of(const std::string& text) {
  InputErrors input_errors;
  ThermalDescription thermal = thermal_of(text, input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  return thermal;
}

/// All faults, a line each.
std::string thermal_faults(const std::string& text) {
  InputErrors input_errors;
  thermal_of(text, input_errors);
  return text_of(input_errors);
}

std::string faults_with_more(const std::string& more) {
  return thermal_faults(small_thermal + more);
}

std::string thermal_with(const std::string& old_part, const std::string& new_part) {
  return with(small_thermal, old_part, new_part);
}

// ---- what is read

TEST(SceneThermal, NetworkIsReadInItsUnits) {
  const ThermalDescription thermal = thermal_of(small_thermal + R"(
[[link]]
between = ["spindle", "coolant"]
conductance_W_per_K = 30
[[source]]
node = "spindle"
kind = "spindle"
power_W = 900
at_rpm = 12000
exponent = 1.5
[[source]]
node = "bed"
kind = "axis"
axis = "Y"
coulomb_N = 300
viscous_N_s_per_mm = 0.5
[[source]]
node = "bed"
kind = "axis"
axis = "A"
coulomb_Nm = 2
viscous_Nm_s = 3
[[source]]
node = "bed"
kind = "power_on"
power_W = 150
[[source]]
node = "spindle"
kind = "cutting"
share = 0.1
)");
  const errors::ThermalNetwork& network = thermal.network;
  ASSERT_EQ(network.nodes.size(), 2u);
  EXPECT_EQ(network.nodes[1].name, "bed");
  EXPECT_EQ(network.nodes[1].capacity_J_per_K, 6e5);
  EXPECT_EQ(network.start_T_C, Vector2d(22, 19.5));
  EXPECT_EQ(thermal.errors.reference_T_C, 21.0);
  ASSERT_EQ(network.links.size(), 1u);
  EXPECT_EQ(network.links[0].a, 0);
  EXPECT_EQ(network.links[0].b, 1);
  ASSERT_EQ(network.surroundings.size(), 2u);
  EXPECT_EQ(network.surroundings[0].node, 1);
  EXPECT_EQ(network.surroundings[0].to, Surroundings::Room);
  EXPECT_EQ(network.surroundings[1].node, 0);
  EXPECT_EQ(network.surroundings[1].to, Surroundings::Coolant);
  EXPECT_EQ(network.surroundings[1].conductance_W_per_K, 30.0);
  ASSERT_EQ(network.sources.size(), 5u);
  const auto& spindle = std::get<errors::SpindleHeat>(network.sources[0].law);
  EXPECT_EQ(spindle.power_W, 900.0);
  EXPECT_NEAR(spindle.reference_speed, 400 * pi, 1e-9);
  EXPECT_EQ(spindle.exponent, 1.5);
  const auto& slide = std::get<errors::AxisHeat>(network.sources[1].law);
  EXPECT_EQ(slide.joint, 2);
  EXPECT_EQ(slide.coulomb, 300.0);
  EXPECT_EQ(slide.viscous, 0.5);
  const auto& turn = std::get<errors::AxisHeat>(network.sources[2].law);
  EXPECT_EQ(turn.joint, 4);
  EXPECT_EQ(turn.coulomb, 2e3);
  EXPECT_EQ(turn.viscous, 3e3);
  EXPECT_EQ(std::get<errors::PowerOnHeat>(network.sources[3].law).power_W, 150.0);
  EXPECT_EQ(std::get<errors::CuttingHeat>(network.sources[4].law).share, 0.1);
}

TEST(SceneThermal, ElementsAreReadInMmAndRad) {
  const ThermalDescription thermal = thermal_of(small_thermal + R"(
[[element]]
name = "EXX"
offset_um = 2
offset = [{ node = "bed", um_per_K = 0.5 }]
slope_um_per_m = -2.7523
slope = [{ node = "spindle", um_per_m_K = 3.3601 },
         { node = "bed", minus = "spindle", um_per_m_K = 1 }]
fixed_mm = -400
[[element]]
name = "EAS"
offset_urad = 1
offset = { node = "spindle", minus = "bed", urad_per_K = 4 }
[[element]]
name = "EBY"
slope_urad_per_m = 5
slope = { node = "bed", urad_per_m_K = 0.25 }
[[element]]
name = "EZS"
[[element.offset]]
node = "spindle"
dT_K = [0, 10, 40]
value_um = [0, 8, 20]
between = "spline"
outside = "hold"
[[element]]
name = "EYY"
slope = { node = "bed", dT_K = [-5, 5], value_um_per_m = [-50, 60] }
)");
  ASSERT_EQ(thermal.errors.elements.size(), 5u);
  const errors::ThermalElement& exx = thermal.errors.elements[0];
  EXPECT_NEAR(exx.offset.constant, 2e-3, 1e-18);
  EXPECT_NEAR(exx.offset.terms.at(0).per_K, 0.5e-3, 1e-18);
  EXPECT_EQ(exx.offset.terms[0].node, 1);
  EXPECT_FALSE(exx.offset.terms[0].minus);
  EXPECT_NEAR(exx.slope.constant, -2.7523e-6, 1e-20);
  ASSERT_EQ(exx.slope.terms.size(), 2u);
  EXPECT_NEAR(exx.slope.terms[0].per_K, 3.3601e-6, 1e-20);
  EXPECT_EQ(exx.slope.terms[1].minus, 0);
  EXPECT_EQ(exx.fixed, -400.0);
  const errors::ThermalElement& eas = thermal.errors.elements[1];
  EXPECT_NEAR(eas.offset.constant, 1e-6, 1e-20);
  EXPECT_NEAR(eas.offset.terms.at(0).per_K, 4e-6, 1e-20);
  const errors::ThermalElement& eby = thermal.errors.elements[2];
  EXPECT_NEAR(eby.slope.constant, 5e-9, 1e-22);  // urad/m = 1e-6 rad / 1000 mm
  EXPECT_NEAR(eby.slope.terms.at(0).per_K, 0.25e-9, 1e-22);
  const auto& table = thermal.errors.elements[3].offset.terms.at(0).table;
  ASSERT_TRUE(table);
  EXPECT_EQ(table->q, Vector3d(0, 10, 40));
  EXPECT_NEAR(table->value[2], 20e-3, 1e-17);
  EXPECT_EQ(table->outside, errors::TableExtrapolation::Hold);
  EXPECT_EQ(table->between, errors::TableInterpolation::Spline);
  EXPECT_NEAR(thermal.errors.elements[4].slope.terms.at(0).table->value[1], 60e-6, 1e-19);
}

TEST(SceneThermal, GrowthIsReadPerAxisAndOfTheWorkpiece) {
  const ThermalDescription thermal = thermal_of(small_thermal + R"(
[axis.X]
feedback = "motor"
screw = { node = "bed", um_per_m_K = 11.7, fixed_mm = -300 }
[axis.Z]
feedback = "scale"
screw = { node = "bed", um_per_m_K = 11.7 }
scale = { node = "spindle", um_per_m_K = 8 }
[workpiece]
node = "bed"
um_per_m_K = 23.8
fixed_mm = [1, 2, 3]
)");
  ASSERT_EQ(thermal.errors.expansions.size(), 2u);
  const errors::AxisExpansion& x = thermal.errors.expansions[0];
  EXPECT_EQ(x.axis, 'X');
  EXPECT_EQ(x.feedback, errors::Feedback::Motor);
  EXPECT_NEAR(x.screw->per_K, 11.7e-6, 1e-20);
  EXPECT_EQ(x.screw->fixed, -300.0);
  EXPECT_EQ(x.screw->node, 1);
  EXPECT_FALSE(x.scale);
  EXPECT_EQ(thermal.errors.expansions[1].feedback, errors::Feedback::Scale);
  EXPECT_NEAR(thermal.errors.expansions[1].scale->per_K, 8e-6, 1e-20);
  EXPECT_NEAR(thermal.errors.workpiece->per_K, 23.8e-6, 1e-20);
  EXPECT_EQ(thermal.errors.workpiece->fixed_w, Vector3d(1, 2, 3));
}

TEST(SceneThermal, HistoryRoomAndSensorsAreRead) {
  const ThermalDescription thermal = thermal_of(small_thermal + R"(
[room]
time_h = [-8, 0, 2]
T_C = [18, 21, 22.5]
[[history]]
name = "warm-up"
duration_h = 3
speed_rpm = 12000
axis_speed_mm_per_min = { X = 6000, Z = 1200 }
axis_speed_deg_per_min = { A = 180 }
[[history]]
duration_min = 30
powered = false
coolant = true
[[sensor]]
name = "T1"
node = "bed"
offset_K = -0.2
noise_K = 0.02
resolution_K = 0.1
lag_s = 15
sampling_s = 5
[[sensor]]
name = "T2"
node = "spindle"
seed = 42
)");
  EXPECT_EQ(thermal.room_time_s, Vector3d(-8, 0, 2) * 3600);
  EXPECT_EQ(thermal.room_T_C, Vector3d(18, 21, 22.5));
  ASSERT_EQ(thermal.history.size(), 2u);
  const ThermalPhase& warm_up = thermal.history[0];
  EXPECT_EQ(warm_up.duration, 10800.0);
  EXPECT_NEAR(warm_up.spindle_speed, 400 * pi, 1e-9);
  ASSERT_EQ(warm_up.axis_speed.size(), 6);
  EXPECT_NEAR(warm_up.axis_speed[1], 100.0, 1e-12);
  EXPECT_EQ(warm_up.axis_speed[2], 0.0);
  EXPECT_NEAR(warm_up.axis_speed[3], 20.0, 1e-12);
  EXPECT_NEAR(warm_up.axis_speed[4], 3 * units::deg, 1e-15);
  EXPECT_TRUE(warm_up.powered);
  EXPECT_FALSE(warm_up.coolant);
  EXPECT_EQ(thermal.history[1].duration, 1800.0);
  EXPECT_FALSE(thermal.history[1].powered);
  EXPECT_TRUE(thermal.history[1].coolant);
  EXPECT_EQ(thermal.history[1].axis_speed, kinematics::AxisVector::Zero(6));
  ASSERT_EQ(thermal.sensors.size(), 2u);
  const errors::TemperatureSensor& sensor = thermal.sensors[0];
  EXPECT_EQ(sensor.name, "T1");
  EXPECT_EQ(sensor.node, 1);
  EXPECT_EQ(sensor.offset_K, -0.2);
  EXPECT_EQ(sensor.noise_K, 0.02);
  EXPECT_EQ(sensor.resolution_K, 0.1);
  EXPECT_EQ(sensor.lag_s, 15.0);
  EXPECT_EQ(sensor.sampling_s, 5.0);
  EXPECT_EQ(thermal.sensors[1].seed, 42u);
  EXPECT_EQ(thermal.sensors[1].sampling_s, 1.0);
}

TEST(SceneThermal, DefaultsAreAColdMachineInARoomOf20C) {
  const ThermalDescription thermal = thermal_of(
      "[[node]]\nname = \"a\"\ncapacity_J_per_K = 1\n[[link]]\nbetween = [\"a\", \"room\"]\n"
      "conductance_W_per_K = 1\n");
  EXPECT_EQ(thermal.network.start_T_C[0], 20.0);
  EXPECT_EQ(thermal.errors.reference_T_C, 20.0);
  EXPECT_EQ(thermal.room_time_s.size(), 1);
  EXPECT_EQ(thermal.room_T_C[0], 20.0);
  EXPECT_EQ(thermal.coolant_T_C, 20.0);
  EXPECT_TRUE(thermal.powered);
  EXPECT_FALSE(thermal.coolant);
  EXPECT_EQ(thermal.interval, 1.0);
  EXPECT_TRUE(thermal.history.empty());
}

TEST(SceneThermal, EverySensorHasANoiseOfItsOwnFromTheSeedOfTheScene) {
  const std::string two = small_thermal +
                          "[[sensor]]\nname = \"T1\"\nnode = \"bed\"\n"
                          "[[sensor]]\nname = \"T2\"\nnode = \"bed\"\n";
  const Node table = parse_toml(two, "t");
  InputErrors input_errors;
  const auto seeds = [&](std::uint64_t scene) {
    const ThermalDescription thermal = read_thermal(table, gantry(), scene, input_errors);
    return std::pair(thermal.sensors.at(0).seed, thermal.sensors.at(1).seed);
  };
  EXPECT_NE(seeds(1).first, seeds(1).second);
  EXPECT_NE(seeds(1).first, seeds(2).first);
  EXPECT_EQ(seeds(1), seeds(1));
}

// ---- what is written

std::string thermal_again(const std::string& text) {
  const Node::Table again = thermal_to_table(thermal_of(text), gantry(), 7);
  EXPECT_EQ(unlisted(again, thermal_keys()), "");
  EXPECT_EQ(unlisted(*parse_toml(text, "t").table(), thermal_keys()), "");
  return to_toml(Node{{}, again});
}

TEST(SceneThermal, WhatIsWrittenReadsBackTheSame) {
  const std::string once =
      thermal_again("name = \"all\"\nscale = 0.5\npowered = false\n" + small_thermal + R"(
[[link]]
between = ["spindle", "coolant"]
conductance_W_per_K = 30
[room]
time_h = [-8, 0, 2]
T_C = [18, 21, 22.5]
[[source]]
node = "spindle"
kind = "spindle"
power_W = 900
at_rpm = 12000
exponent = 1.5
[[source]]
node = "bed"
kind = "axis"
axis = "Y"
coulomb_N = 300
[[source]]
node = "bed"
kind = "axis"
axis = "A"
viscous_Nm_s = 3
[[source]]
node = "bed"
kind = "power_on"
power_W = 150
[[source]]
node = "spindle"
kind = "cutting"
share = 0.25
[[element]]
name = "EYX"
offset_um = 2
offset = [{ node = "bed", um_per_K = 0.5 }, { node = "bed", minus = "spindle", um_per_K = 4 }]
slope_um_per_m = -2.5
slope = { node = "bed", dT_K = [-5, 5], value_um_per_m = [-50, 60], between = "spline" }
fixed_mm = -400
[[element]]
name = "EAS"
offset = { node = "spindle", urad_per_K = 4 }
[[element]]
name = "EAX"
slope = { node = "spindle", urad_per_m_K = 8 }
[axis.X]
feedback = "scale"
screw = { node = "bed", um_per_m_K = 12, fixed_mm = -300 }
scale = { node = "spindle", um_per_m_K = 8 }
[workpiece]
node = "bed"
um_per_m_K = 24
fixed_mm = [1, 2, 3]
[[sensor]]
name = "T1"
node = "bed"
noise_K = 0.5
sampling_s = 5
[[sensor]]
name = "T2"
node = "bed"
seed = 42
[[history]]
name = "warm-up"
duration_h = 3
speed_rpm = 12000
axis_speed_mm_per_min = { X = 6000 }
axis_speed_deg_per_min = { A = 180 }
[[history]]
duration_min = 30
coolant = true
[[plot]]
element = "EXX"
at_h = [-1, 0]
range_mm = [-100, 100]
[[plot]]
element = "EAA"
at_s = [0]
range_deg = [-90, 90]
)");
  EXPECT_EQ(thermal_again(once), once);
  for (const char* part :
       {"scale = 0.5", "powered = false", "start_C = 19.5", "between = [\"spindle\", \"coolant\"]",
        "time_s = [-28800.0, 0.0, 7200.0]", "exponent = 1.5", "coulomb_N = 300.0",
        "viscous_Nm_s = 3.0", "share = 0.25", "minus = \"spindle\"", "value_um_per_m = [",
        "feedback = \"scale\"", "um_per_m_K = 24", "sampling_s = 5.0",
        "seed = ", "duration_s = 10800.0", "A = 180", "range_deg = [-90"}) {
    EXPECT_HAS(once, part);
  }
}

TEST(SceneThermal, KeysOfAnElementAreListedInEitherUnit) {
  const std::vector<Key> keys = thermal_keys();
  const Key* element = listed("element", keys);
  ASSERT_TRUE(element);
  for (const char* name : {"offset_urad", "slope_urad_per_m", "slope_um_per_m", "fixed_mm"})
    EXPECT_TRUE(listed(name, element->keys)) << name;
  const Key* slope = listed("slope", element->keys);
  ASSERT_TRUE(slope);
  for (const char* name : {"um_per_m_K", "urad_per_m_K", "value_urad_per_m", "minus", "between"})
    EXPECT_TRUE(listed(name, slope->keys)) << name;
  EXPECT_FALSE(listed("um_per_K", slope->keys));
}

// ---- what is refused

TEST(SceneThermal, ANonsenseNetworkIsRefusedWhereItStands) {
  EXPECT_EQ(thermal_faults(thermal_with("8000", "-8000")),
            "t:5:20: expected thermal.node.spindle.capacity_J_per_K > 0, seen -8000\n");
  EXPECT_EQ(thermal_faults(thermal_with("[\"room\", \"bed\"]", "[\"coolant\", \"bed\"]")),
            "t:3:1: expected links through which heat reaches the room from thermal.node.spindle, "
            "seen none\n");
  EXPECT_EQ(faults_with_more("[[node]]\nname = \"column\"\ncapacity_J_per_K = 1\n"),
            "t:16:1: expected links through which heat reaches the room from thermal.node.column, "
            "seen none\n");
  EXPECT_EQ(thermal_faults(thermal_with("\"spindle\", \"bed\"", "\"spindle\", \"bad\"")),
            "t:11:23: expected a node of the thermal network, \"room\" or \"coolant\", seen "
            "\"bad\" (nearest: \"bed\")\n");
  EXPECT_EQ(thermal_faults(thermal_with("\"spindle\", \"bed\"", "\"bed\", \"bed\"")),
            "t:11:11: expected two different nodes, or a node and its surroundings, seen bed and "
            "bed\n");
  EXPECT_EQ(
      faults_with_more("[[link]]\nbetween = [\"room\", \"coolant\"]\nconductance_W_per_K = 1\n"),
      "t:17:11: expected two different nodes, or a node and its surroundings, seen room and "
      "coolant\n");
  EXPECT_EQ(thermal_faults(thermal_with("\"spindle\", \"bed\"", "\"spindle\"")),
            "t:11:11: expected two names for thermal.link.between, seen an array of 1\n");
  EXPECT_HAS(thermal_faults(thermal_with("= 25", "= 0")),
             "thermal.link.conductance_W_per_K > 0, seen 0");
  EXPECT_HAS(thermal_faults(thermal_with("\"bed\"\ncap", "\"spindle\"\ncap")),
             "t:7:8: expected each node once");
  EXPECT_HAS(thermal_faults(thermal_with("name = \"bed\"", "name = \"room\"")),
             "t:7:8: expected a node name other than room or coolant");
  EXPECT_EQ(thermal_faults("start_C = 20\n"),
            "t:1:1: expected a list of tables for thermal.node, seen nothing\n");
  EXPECT_HAS(thermal_faults(thermal_with("8000", "5e-324")), "capacity_J_per_K of at least 1e-12");
}

TEST(SceneThermal, ManyNodesAreRefusedAtOnce) {
  std::string many;
  for (int i = 0; i < 201; ++i)
    many += fmt::format("[[node]]\nname = \"n{}\"\ncapacity_J_per_K = 1\n", i);
  EXPECT_HAS(thermal_faults(many), "expected at most 200 nodes, seen 201");
}

TEST(SceneThermal, SourcesAreRefusedWhereTheyStand) {
  const auto source = [](const std::string& text) {
    return faults_with_more("[[source]]\nnode = \"bed\"\n" + text);
  };
  EXPECT_EQ(source("kind = \"power_on\"\npower_W = 3\n"), "");
  EXPECT_EQ(faults_with_more("[[source]]\nnode = \"nut\"\nkind = \"power_on\"\npower_W = 3\n"),
            "t:17:8: expected a node of the thermal network for node, seen \"nut\"\n");
  EXPECT_EQ(source("power_W = 3\n"),
            "t:16:1: expected a kind of heat for thermal.source.kind, seen nothing\n");
  EXPECT_HAS(source("kind = \"motor\"\npower_W = 3\n"), "t:18:8: expected one of \"axis\"");
  EXPECT_HAS(source("kind = \"cutting\"\nshare = 1.2\n"), "thermal.source.share >= 0 and <= 1");
  EXPECT_HAS(source("kind = \"spindle\"\npower_W = 3\nat_rpm = 0\n"), "thermal.source.at_rpm > 0");
  EXPECT_EQ(source("kind = \"axis\"\naxis = \"B\"\ncoulomb_N = 1\n"),
            "t:19:8: expected an axis of the machine, seen B\n");
  EXPECT_HAS(source("kind = \"axis\"\naxis = \"X\"\ncoulomb_Nm = 1\n"),
             "t:20:1: expected thermal.source.coulomb_N in N, seen coulomb_Nm in Nm");
  EXPECT_EQ(source("kind = \"axis\"\naxis = \"X\"\n"),
            "t:16:1: expected a number, or viscous_N_s_per_mm, for thermal.source.coulomb_N, seen "
            "nothing\n");
  EXPECT_HAS(source("kind = \"power_on\"\npower_W = 3\nspeed = 2\n"), "t:20:1: ");
}

TEST(SceneThermal, ElementsAreRefusedWhereTheyStand) {
  const auto element = [](const std::string& text) {
    return faults_with_more("[[element]]\n" + text);
  };
  EXPECT_EQ(element("name = \"EZS\"\noffset_um = 3\n"), "");
  EXPECT_HAS(element("name = \"EZB\"\noffset_um = 3\n"),
             "t:17:8: expected thermal errors that fit "
             "the machine, seen EZB: expected an axis");
  EXPECT_HAS(element("name = \"ECS\"\noffset_urad = 3\n"), "ECS: a spindle has no error element");
  EXPECT_HAS(element("name = \"bent\"\noffset_um = 3\n"),
             "t:17:8: expected the name of an element");
  EXPECT_HAS(element("offset_um = 3\n"), "t:16:1: expected the name of an element");
  EXPECT_HAS(element("name = \"EZS\"\noffset_urad = 3\n"),
             "t:18:15: expected values of EZS in um, seen offset_urad");
  EXPECT_EQ(element("name = \"EC0Y\"\nslope_urad_per_m = 3\n"),
            "t:18:20: expected no slope, as only error motions of slides have one, seen "
            "slope_urad_per_m\n");
  EXPECT_HAS(element("name = \"ECC\"\nslope = { node = \"bed\", urad_per_m_K = 3 }\n"), "no slope");
  EXPECT_HAS(element("name = \"EZS\"\noffset = { node = \"nut\", um_per_K = 3 }\n"),
             "t:18:19: expected a node of the thermal network for node, seen \"nut\"");
  EXPECT_EQ(element("name = \"EZS\"\noffset = { node = \"bed\" }\n"),
            "t:18:10: expected a number for thermal.element.EZS.offset.um_per_K, seen nothing\n");
  EXPECT_HAS(
      element("name = \"EZS\"\noffset = { node = \"bed\", um_per_K = 1, dT_K = [0, 1], value_um = "
              "[0, 1] }\n"),
      "either a table of dT_K or um_per_K");
  EXPECT_HAS(
      element("name = \"EZS\"\noffset = { node = \"bed\", dT_K = [0, 0], value_um = [0, 1] }\n"),
      "a table with ascending temperatures");
  EXPECT_HAS(
      element("name = \"EZS\"\noffset = { node = \"bed\", dT_K = [0, 1], value_um = [0] }\n"),
      "as many values as temperatures, that is 2, seen 1");
  EXPECT_HAS(element("name = \"EZS\"\n[[element]]\nname = \"EZS\"\n"),
             "t:19:8: expected each element once");
}

TEST(SceneThermal, GrowthIsRefusedWhereItStands) {
  const std::string screw = "screw = { node = \"bed\", um_per_m_K = 11.7 }\n";
  EXPECT_EQ(faults_with_more("[axis.X]\nfeedback = \"motor\"\n" + screw), "");
  EXPECT_HAS(faults_with_more("[axis.X]\nfeedback = \"scale\"\n" + screw),
             "t:16:1: expected thermal errors that fit the machine, seen expansion of X: "
             "feedback from a scale requires a scale");
  EXPECT_HAS(faults_with_more("[axis.A]\nfeedback = \"motor\"\n" + screw),
             "t:16:7: expected a known key");
  EXPECT_HAS(faults_with_more("[axis.X]\n" + screw),
             "\"motor\", \"scale\" for thermal.axis.X.feedback, seen nothing");
  EXPECT_HAS(faults_with_more(
                 "[axis.X]\nfeedback = \"motor\"\nscrew = { node = \"bed\", um_per_K = 11.7 }\n"),
             "thermal.axis.X.screw.um_per_m_K");
  EXPECT_HAS(faults_with_more("[workpiece]\nnode = \"bed\"\num_per_m_K = 1e4\n"),
             "workpiece: expected a growth");
  EXPECT_HAS(faults_with_more("[workpiece]\nnode = \"part\"\num_per_m_K = 1\n"),
             "t:17:8: expected a node");
}

TEST(SceneThermal, SensorsAreRefusedByName) {
  EXPECT_EQ(faults_with_more("[[sensor]]\nname = \"T1\"\nnode = \"spindel\"\n"),
            "t:18:8: expected a node of the thermal network for node, seen \"spindel\" (nearest: "
            "\"spindle\")\n");
  EXPECT_HAS(faults_with_more("[[sensor]]\nname = \"T1\"\nnode = \"bed\"\nsampling_s = 0\n"),
             "t:19:14: expected thermal.sensor.T1.sampling_s");
  EXPECT_HAS(faults_with_more("[[sensor]]\nname = \"T1\"\nnode = \"bed\"\nnoise_K = -1\n"),
             "thermal.sensor.T1.noise_K >= 0");
  EXPECT_HAS(faults_with_more(
                 "[[sensor]]\nname = \"T1\"\nnode = \"bed\"\n[[sensor]]\nname = \"T1\"\nnode = "
                 "\"bed\"\n"),
             "t:20:8: expected each sensor once, seen T1 again");
}

TEST(SceneThermal, HistoryAndRoomAreRefusedWhereTheyStand) {
  EXPECT_HAS(faults_with_more("[[history]]\nspeed_rpm = 100\n"),
             "t:16:1: expected one of duration_h, duration_min, duration_s");
  EXPECT_HAS(faults_with_more("[[history]]\nduration_h = 1\nduration_s = 1\n"),
             "t:18:14: expected only one of duration_h");
  EXPECT_HAS(faults_with_more("[[history]]\nduration_h = 0\n"),
             "t:17:14: expected thermal.history.duration_h > 0");
  EXPECT_HAS(faults_with_more("[[history]]\nduration_h = 1e300\n"),
             "t:17:14: expected thermal.history.duration_h");
  EXPECT_HAS(faults_with_more("[[history]]\nduration_h = 1\naxis_speed_mm_per_min = { A = 3 }\n"),
             "t:18:27: expected a known key");
  EXPECT_HAS(faults_with_more("[[history]]\nduration_h = 1\naxis_speed_mm_per_min = { X = -3 }\n"),
             "thermal.history.axis_speed_mm_per_min.X >= 0");
  EXPECT_HAS(thermal_faults("room_C = 20\n" + small_thermal + "[room]\ntime_h = [0]\nT_C = [20]\n"),
             "either room_C or a room table");
  EXPECT_HAS(faults_with_more("[room]\ntime_h = [0, 0]\nT_C = [20, 21]\n"),
             "t:17:10: expected ascending times");
  EXPECT_HAS(faults_with_more("[room]\ntime_h = [0, 1]\nT_C = [20]\n"),
             "as many temperatures as times, that is 2, seen 1");
  EXPECT_HAS(faults_with_more("[room]\ntime_h = [0]\nT_C = [-300]\n"),
             "t:18:7: expected temperatures of");
  EXPECT_HAS(faults_with_more("[room]\nT_C = [20]\n"), "one of time_h, time_min, time_s");
}

TEST(SceneThermal, PlotsAreReadAndRefusedWhereTheyStand) {
  const ThermalDescription thermal =
      thermal_of(small_thermal + "[[plot]]\nelement = \"EXX\"\nat_h = [-4, 0]\n");
  ASSERT_EQ(thermal.plots.size(), 1u);
  EXPECT_EQ(errors::to_string(thermal.plots[0].element), "EXX");
  EXPECT_EQ(thermal.plots[0].time_s, Vector2d(-14400, 0));
  const auto refused = [](const std::string& text, const std::string& what) {
    const std::string all = faults_with_more("[[plot]]\n" + text);
    EXPECT_HAS(all, what);
  };
  refused("element = \"EXB\"\nat_h = [0]\n", "t:17:11: expected thermal errors that fit");
  refused("element = \"EZS\"\nat_h = [0]\n", "t:17:11: expected an error motion of an axis");
  refused("element = \"EXX\"\n", "one of at_h, at_min, at_s");
  refused("element = \"EXX\"\nat_s = []\n", "t:18:8: expected an array of numbers");
  refused("at_s = [0]\n", "expected a string for thermal.plot.element");
  refused("element = \"EXX\"\nat_s = [0]\n[[plot]]\nelement = \"EXX\"\nat_s = [1]\n",
          "t:20:11: expected one plot per element, seen EXX again");
}

TEST(SceneThermal, PlotsAreDrawnOverARangeWithinTheTravel) {
  MachineDescription machine = gantry();
  for (kinematics::Joint& joint : machine.joints) {
    if (joint.name == 'X') std::tie(joint.min, joint.max) = std::pair(-500.0, 500.0);
    if (joint.name == 'A') std::tie(joint.min, joint.max) = std::pair(-2.0, 2.0);
  }
  const auto plot = [&](const std::string& text, std::string& refused) {
    InputErrors input_errors;
    const auto thermal =
        thermal_of(small_thermal + "[[plot]]\nat_h = [0]\n" + text, input_errors, machine);
    for (const BadInput& fault : input_errors.list()) refused += fault.what();
    return thermal.plots.empty() ? ThermalDescription::Plot() : thermal.plots[0];
  };
  std::string refused;
  const auto slide = plot("element = \"EXX\"\nrange_mm = [-400, 500]\n", refused).range;
  ASSERT_TRUE(slide) << refused;
  EXPECT_EQ(*slide, (std::array{-400.0, 500.0}));
  const auto turn = plot("element = \"EXA\"\nrange_deg = [-90, 45]\n", refused).range;
  ASSERT_TRUE(turn) << refused;
  EXPECT_DOUBLE_EQ(turn->back(), pi / 4);
  EXPECT_FALSE(plot("element = \"EXX\"\n", refused).range);
  EXPECT_EQ(refused, "");
  for (const char* wrong : {"[-400, 501]", "[400, -400]", "[7, 7]"}) {
    refused.clear();
    plot(std::string("element = \"EXX\"\nrange_mm = ") + wrong, refused);
    EXPECT_EQ(refused.find("t:19:12: expected an ascending range within the travel, -500 .. 500"),
              0u)
        << refused;
  }
  for (const char* wrong :
       {"element = \"EXX\"\nrange_deg = [0, 1]", "element = \"EXX\"\nrange_mm = 4",
        "element = \"EXA\"\nrange_mm = [0, 1]", "element = \"EXX\"\nrange_mm = [nan, 4]"}) {
    refused.clear();
    plot(wrong, refused);
    EXPECT_EQ(refused.find("t:19:"), 0u) << wrong << ": " << refused;
  }
}

TEST(SceneThermal, AbsurdNumbersAreRefusedWhereTheyStand) {
  const auto refused = [](const std::string& text, const std::string& what) {
    const std::string all = faults_with_more(text);
    EXPECT_HAS(all, what);
  };
  refused("[[source]]\nnode = \"bed\"\nkind = \"power_on\"\npower_W = 1.1e7\n", "t:19:11: ");
  refused("[[source]]\nnode = \"bed\"\nkind = \"spindle\"\nat_rpm = 1\npower_W = 1e300\n",
          "t:20:11: ");
  refused("[[history]]\nduration_h = 1\nspeed_rpm = 1.1e6\n", "t:18:13: ");
  for (const char* scale : {"1.1e6", "-1e300", "nan", "inf"}) {
    const std::string all = thermal_faults("scale = " + std::string(scale) + "\n" + small_thermal);
    EXPECT_EQ(all.find("t:1:9: "), 0u) << all;
  }
  EXPECT_EQ(thermal_of("scale = -0.5\n" + small_thermal).scale, -0.5);
  EXPECT_EQ(thermal_of(small_thermal).scale, 1.0);
}

TEST(SceneThermal, UnknownKeysAreRefusedWithTheNearestKnownOne) {
  EXPECT_HAS(thermal_faults("start_c = 20\n" + small_thermal),
             "t:1:1: expected a known key (nearest: thermal.start_C)");
  EXPECT_HAS(thermal_faults(thermal_with("start_C = 19.5", "start_K = 292")),
             "thermal.node.bed.start_C in C, seen start_K in K");
  EXPECT_HAS(thermal_faults("interval_s = 0\n" + small_thermal), "thermal.interval_s");
}

TEST(SceneThermal, AMachineWithFaultsOfItsOwnCausesNoOthersHere) {
  InputErrors input_errors;
  thermal_of(small_thermal + R"(
[axis.X]
feedback = "motor"
screw = { node = "bed", um_per_m_K = 11.7 }
[[element]]
name = "EZS"
offset_um = 3
[[source]]
node = "bed"
kind = "axis"
axis = "X"
coulomb_N = 3
[[history]]
duration_h = 1
axis_speed_mm_per_min = { X = 3 }
)",
             input_errors, MachineDescription{});
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
}

}  // namespace
}  // namespace abbe::sim
