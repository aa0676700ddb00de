// [machine] and [control]: what is written reads as the same.

#include "sim/scene/errors.h"
#include "sim/scene/fields.h"
#include "sim/scene/instruments.h"
#include "sim/scene/machine.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/gantry.h"
#include "tests/sim/listed_keys.h"
#include "tests/sim/measured_scene.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using errors::metrology::Kind;

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
  EXPECT_HAS(faults_of_body("shape = \"boxx\"\nradus_mm = 3\n"), "radus_mm")
      << "a key of no shape is unknown all the same";
}

TEST(SceneMachine, WhatIsWrittenReadsAsTheSame) {
  const MachineDescription machine = machine_of(rich_machine);
  const std::string toml = toml_of(machine_to_table(machine));
  const MachineDescription again = machine_of(toml);
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

/// What is written of the errors that a text gives.
std::string errors_again(const std::string& text) {
  InputErrors input_errors;
  const Node table = parse_toml(text, "e");
  const Node* list = table.find("list");
  const ErrorsSection section = read_errors(list ? *list : table, gantry(), 7, input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  const Node::Table again = errors_to_table(section, gantry());
  EXPECT_EQ(unlisted(again, errors_keys()), "");
  EXPECT_EQ(unlisted(*table.table(), errors_keys()), list ? "list\n" : "");
  return to_toml(Node{{}, again});
}

TEST(SceneErrors, WhatIsWrittenReadsBackTheSame) {
  const std::string once = errors_again(R"(name = "all"
scale = 2.0
EXX_um = 5.0
C0Y_urad = 30.0
EYX = [
  { name = "all", kind = "constant", value_um = 1 },
  { kind = "polynomial", coefficients_um = [1, 2, 3], centre_mm = 10, half_range_mm = 300 },
  { name = "l", kind = "legendre", coefficients_um = [1, 2], half_range_mm = 300, argument = "carriage", negate = true },
  { name = "pitch", kind = "fourier", period_mm = 16, a_um = [0.5], b_um = [0.25, 0.125], scale = 2.0 },
  { name = "t", kind = "table", q_mm = [-300, 0, 300], value_um = [1, 0, 2], between = "spline", outside = "hold" },
  { kind = "backlash", half_um = 1.5 },
  { kind = "up_down", up = { q_mm = [0, 1], value_um = [0, 1] }, down = { q_mm = [0, 1], value_um = [2, 1] } },
  { kind = "repeatability", sigma_um = 0.25, seed = 7 },
]
EXY = { kind = "table", q_mm = [0, 50, 100], value_um = [1, 6, 11], detrend = "lsq" }
EAC = { kind = "asynchronous", rms_urad = 1, lowest_order = 0.5 }
EBC = { kind = "fourier", period_deg = 360, b_urad = [10] }
[measured]
X = { at_mm = [1, 2, 3], by = "tool" }
Z = { at_mm = [4, 5, 6], by = "carriage" }
[covariance]
of = ["EXX", "EYX pitch sin 2", "EC0Y"]
standard_uncertainty_um_urad = [1, 2, 4]
correlation = [0.5, 0, -0.25]
)");
  EXPECT_EQ(errors_again(once), once);
  for (const char* part :
       {"scale = 2.0", "EXX_um = 5.0", "name = \"slope of EXY\"", "kind = \"legendre\"",
        "a_um = [0.5, 0.0]", "between = \"spline\"", "sigma_um = 0.25", "seed = 7",
        "correlation = [0.5, 0.0, -0.25]", "by = \"carriage\""}) {
    EXPECT_HAS(once, part);
  }
}

TEST(SceneErrors, TablesFromFilesAreWrittenAsTheirElements) {
  const SceneFolder folder;
  const auto file = folder.write("run.csv", "X EXX EYX\n-300 0 0\n0 0.001 0.002\n300 0 0\n");
  const std::string once = errors_again("list = [{ tables = { file = \"" + file.string() +
                                        "\", name = \"run 3\", scale = 2.0 } }, { EXX_um = 3.0 }]");
  EXPECT_EQ(errors_again(once), once);
  EXPECT_HAS(once, "value_um = [0.0, 2.0, 0.0]");
}

TEST(SceneErrors, KeysOfACurveAreListedInEitherUnit) {
  const std::vector<Key> keys = errors_keys();
  const Key* curve = listed("EAC", keys);
  ASSERT_TRUE(curve);
  for (const char* name : {"value_um", "value_urad", "centre_deg", "coefficients_urad", "detrend"})
    EXPECT_TRUE(listed(name, curve->keys)) << name;
  EXPECT_FALSE(listed("value_mm", curve->keys));
  EXPECT_FALSE(listed("EQX", keys));
  EXPECT_FALSE(listed("EXX_urad", keys));
}

// [[instrument]] and [sensor_choice] of a scene: units, defaults, and every refusal with its place.

Scene scene_with(const std::string& sections) { return scene_of(measured_scene(sections)); }

/// Faults of a scene whose first instrument line is line 13.
std::string faults_of_measured(const std::string& sections,
                               const std::string& machine = "gantry_cxyza") {
  const SceneFolder folder;
  return faults_of(folder.write("m.toml", measured_scene(sections, machine)));
}

void expect_fault(const std::string& sections, const std::string& place, const std::string& said) {
  const std::string input_errors = faults_of_measured(sections);
  EXPECT_HAS(input_errors, "m.toml:" + place) << place;
  EXPECT_HAS(input_errors, said);
}

TEST(SceneInstruments, AKindAloneIsTheInstrumentAsItIsBought) {
  const Scene scene = scene_with("[[instrument]]\nkind = \"laser\"\n");
  ASSERT_EQ(scene.instruments.size(), 1u);
  const auto& one = scene.instruments[0];
  const auto typical_instrument = errors::metrology::typical_instrument(Kind::Laser);
  EXPECT_EQ(one.instrument.name, "laser");
  EXPECT_EQ(one.instrument.kind, Kind::Laser);
  EXPECT_EQ(one.instrument.noise, typical_instrument.noise);
  EXPECT_EQ(one.instrument.runs, typical_instrument.runs);
  EXPECT_EQ(one.starts_s, std::vector<double>{0.0});
}

TEST(SceneInstruments, EveryKeyIsReadInInternalUnits) {
  const Scene scene = scene_with(
      "[[instrument]]\nname = \"mine\"\nkind = \"r_test\"\nnoise_um = 2\nnoise_urad = 3\n"
      "resolution_um = 0.5\nresolution_urad = 0.25\nalignment_urad = 7\nposition_um = 9\n"
      "scale_um_per_m = 4\ndrift_um_per_h = 3.6\naxes = [\"C\"]\nruns = 3\ntargets = 13\n"
      "both_ways = false\nmargin = 0.1\nat_mm = [60, 0, 60]\nreflector_mm = [0, 0, -20]\n"
      "radius_mm = 50\nlever_mm = 70\nfrom_deg = 0\nto_deg = 180\ninterval_s = 30\n"
      "duration_h = 2\nspeed_mm_per_min = 600\ndwell_s = 5\nset_up_min = 10\nspindle_rpm = 60\n"
      "start_h = [-2, 0.5]\n");
  ASSERT_EQ(scene.instruments.size(), 1u);
  const auto& i = scene.instruments[0].instrument;
  EXPECT_EQ(i.name, "mine");
  EXPECT_DOUBLE_EQ(i.noise, 2e-3);
  EXPECT_DOUBLE_EQ(i.noise_rad, 3e-6);
  EXPECT_DOUBLE_EQ(i.resolution, 5e-4);
  EXPECT_DOUBLE_EQ(i.resolution_rad, 2.5e-7);
  EXPECT_DOUBLE_EQ(i.rotation_sigma, 7e-6);
  EXPECT_DOUBLE_EQ(i.position_sigma, 9e-3);
  EXPECT_DOUBLE_EQ(i.scale_sigma, 4e-6);
  EXPECT_DOUBLE_EQ(i.drift_sigma, 1e-6);
  EXPECT_EQ(i.axes, std::vector<char>{'C'});
  EXPECT_EQ(i.runs, 3);
  EXPECT_EQ(i.targets, 13);
  EXPECT_FALSE(i.bidirectional);
  EXPECT_EQ(i.margin, 0.1);
  EXPECT_EQ(i.location_w, Vector3d(60, 0, 60));
  EXPECT_EQ(i.reflector_t, Vector3d(0, 0, -20));
  EXPECT_EQ(i.radius, 50.0);
  EXPECT_EQ(i.lever, 70.0);
  EXPECT_DOUBLE_EQ(i.to_rad, pi);
  EXPECT_EQ(i.interval_s, 30.0);
  EXPECT_EQ(i.duration_s, 7200.0);
  EXPECT_DOUBLE_EQ(i.speed, 10.0);
  EXPECT_EQ(i.dwell_s, 5.0);
  EXPECT_EQ(i.set_up_s, 600.0);
  EXPECT_DOUBLE_EQ(i.spindle_speed, 2 * pi);
  EXPECT_EQ(scene.instruments[0].starts_s, (std::vector<double>{-7200.0, 1800.0}));
}

TEST(SceneInstruments, UpIsADirection) {
  const Scene scene = scene_with("[[instrument]]\nkind = \"level\"\nup = [0, 2, 0]\n");
  EXPECT_EQ(scene.instruments.at(0).instrument.up_b, Vector3d(0, 1, 0));
  EXPECT_NE(faults_of_measured("[[instrument]]\nkind = \"level\"\nup = [0, 0, 0]\n"), "");
}

TEST(SceneInstruments, WhatMeasuresThePartIsReadToo) {
  const Scene scene = scene_with(
      "[[instrument]]\nkind = \"cmm\"\nspacing_mm = 2\nnoise_um = 0.3\nalignment_urad = 10\n"
      "best_fit = true\ncase = \"perfect-iterated-ideal\"\n"
      "[[instrument]]\nkind = \"touch_probe\"\nball_radius_mm = 2\nstart_h = 0.5\n"
      "pose = { C_deg = 90 }\n");
  EXPECT_TRUE(scene.instruments.empty());
  ASSERT_EQ(scene.part_instruments.size(), 2u);
  const auto& cmm =
      std::get<errors::metrology::CoordinateMeasuringMachine>(scene.part_instruments[0].device);
  EXPECT_EQ(scene.part_instruments[0].spacing, 2.0);
  EXPECT_EQ(scene.part_instruments[0].case_name, "perfect-iterated-ideal");
  EXPECT_DOUBLE_EQ(cmm.noise, 3e-4);
  EXPECT_DOUBLE_EQ(cmm.alignment_sigma_rad, 1e-5);
  EXPECT_TRUE(cmm.best_fit);
  const auto& probe = std::get<errors::metrology::TouchProbe>(scene.part_instruments[1].device);
  EXPECT_EQ(probe.radius, 2.0);
  EXPECT_EQ(probe.start_s, 1800.0);
  EXPECT_DOUBLE_EQ(probe.q[0], pi / 2);
}

TEST(SceneInstruments, FaultsAreReportedWithTheirPlace) {
  expect_fault("[[instrument]]\nkind = \"lasre\"\n", "15:", "did you mean laser?");
  expect_fault("[[instrument]]\nkind = \"laser\"\nnoise_um = -1\n", "16:", "noise_um");
  expect_fault("[[instrument]]\nkind = \"laser\"\nnoise = 1\n", "16:", "noise_um");
  expect_fault("[[instrument]]\nkind = \"laser\"\ntargets = 1\n", "16:", "targets");
  expect_fault("[[instrument]]\nkind = \"laser\"\ntargets = 2.5\n", "16:", "targets");
  expect_fault("[[instrument]]\nkind = \"laser\"\nmargin = 0.5\n", "16:", "margin");
  expect_fault("[[instrument]]\nkind = \"laser\"\naxes = \"X\"\n", "16:", "list of letters");
  expect_fault("[[instrument]]\nkind = \"laser\"\naxes = [\"XY\"]\n", "16:", "letter of an axis");
  expect_fault("[[instrument]]\nkind = \"laser\"\naxes = [\"W\"]\n", "15:", "can measure");
  expect_fault("[[instrument]]\nkind = \"laser\"\naxes = [\"C\"]\n", "15:", "can measure");
  expect_fault("[[instrument]]\nkind = \"laser\"\nnoise_um = nan\n", "16:", "noise_um");
  expect_fault("[[instrument]]\nkind = \"laser\"\nname = \"../x\"\n", "16:", "for a file");
  expect_fault("[[instrument]]\nkind = \"laser\"\n[[instrument]]\nkind = \"laser\"\n",
               "17:", "no other instrument");
  expect_fault("[[instrument]]\nname = \"x\"\n", "14:", "kind");
  expect_fault("[[instrument]]\nkind = \"cmm\"\ntargets = 3\n", "16:", "targets");
  expect_fault("[[instrument]]\nkind = \"ball_bar\"\nradius_mm = 5000\n", "15:", "can measure");
  expect_fault("instrument = 5\n", "14:", "instrument");
}

TEST(SceneInstruments, AnInstrumentThatTheMachineCannotCarryIsRefusedAtItsKind) {
  for (const std::string kind : {"r_test", "sphere", "ball_bar_rotary"}) {
    const std::string input_errors =
        faults_of_measured("[[instrument]]\nkind = \"" + kind + "\"\n", "three_axis_table");
    EXPECT_HAS(input_errors, "m.toml:15:");
    EXPECT_HAS(input_errors, "an instrument that can measure this machine");
  }
  EXPECT_EQ(faults_of_measured("[[instrument]]\nkind = \"ball_bar\"\n", "three_axis_table"), "");
}

TEST(SceneInstruments, ASensorChoiceIsReadAndItsFaultsAreReported) {
  using namespace errors::identification;
  const auto packaged_with = [](const std::string& key, const std::string& value) {
    return faults_of(packaged("thermal_protocol.toml"), {{"sensor_choice." + key, value}});
  };
  const Scene scene =
      read_scene(packaged("thermal_protocol.toml"), {{"sensor_choice.count", "3"},
                                                     {"sensor_choice.likeness", "\"absolute\""},
                                                     {"sensor_choice.image", "\"mean\""},
                                                     {"sensor_choice.screening", "\"degree\""},
                                                     {"sensor_choice.threshold", "0.8"},
                                                     {"sensor_choice.model", "\"ridge\""},
                                                     {"sensor_choice.lag_rows", "5"},
                                                     {"sensor_choice.random_subsets", "50"}});
  ASSERT_TRUE(scene.sensor_choice);
  const auto& study = scene.sensor_choice->study;
  EXPECT_EQ(study.choice.count, 3);
  EXPECT_EQ(study.choice.similarity_measure, SimilarityMeasure::Grey);
  EXPECT_EQ(study.choice.grey.kind, GreyKind::Absolute);
  EXPECT_EQ(study.choice.grey.image, Image::Mean);
  EXPECT_EQ(study.choice.screening, Screening::Degree);
  EXPECT_EQ(study.choice.threshold, 0.8);
  EXPECT_EQ(study.model.kind, ModelKind::Ridge);
  EXPECT_TRUE(study.features.since_start);
  EXPECT_EQ(study.features.lag_rows, 5.0);
  EXPECT_EQ(study.random_subsets, 50);
  for (const auto& [key, value] :
       {std::pair("count", "0"), std::pair("likeness", "\"gray\""), std::pair("threshold", "1.5"),
        std::pair("lag_rows", "-1"), std::pair("model", "\"oracle\"")})
    EXPECT_HAS(packaged_with(key, value), key);
  EXPECT_HAS(packaged_with("cuont", "4"), "count");
  ASSERT_EQ(scene.sensor_choice->compared_methods.size(), 1u);
  EXPECT_EQ(scene.sensor_choice->compared_methods[0].choice.grey.kind, GreyKind::Comprehensive);
  for (const auto& [value, word] :
       {std::pair("[{likeness = \"deng\"}]", "name"),
        std::pair("[{name = \"a\", sensors = []}]", "sensors"),
        std::pair("[{name = \"a\", for = [1]}]", "for"),
        std::pair("[{name = \"a\", model = \"ridge\"}]", "model"),
        std::pair("[{name = \"a\"}, {name = \"a\"}]", "again"),
        std::pair("[{name = \"a\", sensors = [\"S\"], groups = 3}]", "groups")})
    EXPECT_HAS(packaged_with("beside", value), word) << value;
  expect_fault("[sensor_choice]\ncount = 4\n", "14:", "[thermal]");
}

std::string written_text(const Scene& scene) {
  Node::Array instruments;
  for (Node::Table& one :
       instruments_to_tables({scene.instruments, scene.part_instruments}, scene.machine))
    instruments.push_back(Node{{}, std::move(one)});
  Node::Table table;
  put_value(table, "instrument", std::move(instruments));
  return to_toml(Node{{}, std::move(table)});
}

TEST(SceneInstruments, WhatIsWrittenReadsAsTheSame) {
  std::string sections =
      "[[instrument]]\nname = \"mine\"\nkind = \"r_test\"\nnoise_um = 2\nnoise_urad = 3\n"
      "axes = [\"C\"]\nboth_ways = false\nat_mm = [60, 0, 60]\nto_deg = 180\nup = [0, 2, 0]\n"
      "start_h = [-2, 0.5]\n"
      "[[instrument]]\nkind = \"cmm\"\nbest_fit = true\ncase = \"perfect-iterated-ideal\"\n"
      "[[instrument]]\nkind = \"touch_probe\"\nstart_h = 0.5\npose = { C_deg = 90 }\n";
  for (const Kind kind : errors::metrology::all_kinds())
    sections += "[[instrument]]\nkind = \"" + to_string(kind) + "\"\n";
  const Scene scene = scene_with(sections);
  const Scene again = scene_with(written_text(scene));
  EXPECT_EQ(written_text(again), written_text(scene));
  EXPECT_EQ(again.instruments[0].starts_s, scene.instruments[0].starts_s);
  EXPECT_EQ(again.instruments[0].instrument.axes, std::vector<char>{'C'});
  EXPECT_EQ(again.instruments[0].instrument.location_w, scene.instruments[0].instrument.location_w);
  EXPECT_EQ(again.part_instruments[0].case_name, "perfect-iterated-ideal");
}

TEST(SceneInstruments, ASensorChoiceThatIsWrittenReadsAsTheSame) {
  const std::string text =
      "instrument = \"nest\"\ncount = 3\nlikeness = \"comprehensive\"\nimage = \"mean\"\n"
      "screening = \"degree\"\nthreshold = 0.8\ngroups = 5\nmodel = \"lasso\"\n"
      "since_start = true\nlag_rows = 5\nrandom_subsets = 50\n"
      "[[beside]]\nname = \"a\"\nsensors = [\"S\", \"T\"]\n"
      "[[beside]]\nname = \"b\"\nfor = [\"Z\"]\nlikeness = \"correlation\"\n";
  const auto written = [](const std::string& toml) {
    InputErrors input_errors;
    const auto choice = read_sensor_choice(parse_toml(toml, "s.toml"), input_errors);
    EXPECT_TRUE(input_errors.empty());
    return to_toml(Node{{}, sensor_choice_to_table(choice)});
  };
  EXPECT_EQ(written(written(text)), written(text));
  EXPECT_HAS(written(text), "correlation");
}

}  // namespace
}  // namespace abbe::sim
