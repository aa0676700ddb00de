// [[instrument]] and [sensor_choice] of a scene: units, defaults, and every refusal with its place.

#include <string>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/instruments.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using errors::metrology::Kind;

Scene scene_with(const std::string& sections) { return scene_of(measured_scene(sections)); }

/// Faults of a scene whose first instrument line is line 13.
std::string faults_of_measured(const std::string& sections,
                               const std::string& machine = "gantry_cxyza") {
  const SceneFolder folder;
  return faults_of(folder.write("m.toml", measured_scene(sections, machine)));
}

void expect_fault(const std::string& sections, const std::string& place, const std::string& said) {
  const std::string input_errors = faults_of_measured(sections);
  EXPECT_NE(input_errors.find("m.toml:" + place), std::string::npos)
      << place << " in: " << input_errors;
  EXPECT_NE(input_errors.find(said), std::string::npos) << said << " in: " << input_errors;
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
  EXPECT_EQ(i.location_w, Eigen::Vector3d(60, 0, 60));
  EXPECT_EQ(i.reflector_t, Eigen::Vector3d(0, 0, -20));
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
  EXPECT_EQ(scene.instruments.at(0).instrument.up_b, Eigen::Vector3d(0, 1, 0));
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
    EXPECT_NE(input_errors.find("m.toml:15:"), std::string::npos) << input_errors;
    EXPECT_NE(input_errors.find("an instrument that can measure this machine"), std::string::npos)
        << input_errors;
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
    EXPECT_NE(packaged_with(key, value).find(key), std::string::npos) << key;
  EXPECT_NE(packaged_with("cuont", "4").find("count"), std::string::npos);
  ASSERT_EQ(scene.sensor_choice->compared_methods.size(), 1u);
  EXPECT_EQ(scene.sensor_choice->compared_methods[0].choice.grey.kind, GreyKind::Comprehensive);
  for (const auto& [value, word] :
       {std::pair("[{likeness = \"deng\"}]", "name"),
        std::pair("[{name = \"a\", sensors = []}]", "sensors"),
        std::pair("[{name = \"a\", for = [1]}]", "for"),
        std::pair("[{name = \"a\", model = \"ridge\"}]", "model"),
        std::pair("[{name = \"a\"}, {name = \"a\"}]", "again"),
        std::pair("[{name = \"a\", sensors = [\"S\"], groups = 3}]", "groups")})
    EXPECT_NE(packaged_with("beside", value).find(word), std::string::npos) << value;
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
  EXPECT_NE(written(text).find("correlation"), std::string::npos);
}

}  // namespace
}  // namespace abbe::sim
