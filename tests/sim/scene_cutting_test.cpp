#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/scene/cutting.h"
#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/written_section.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using Eigen::Vector3d;

ToolDescription mill() {
  ToolDescription tool;
  tool.nominal = tool.actual = cutting::Cutter{};
  return tool;
}
ToolDescription diamond() {
  ToolDescription tool;
  tool.nominal = tool.actual = cutting::Nose{};
  return tool;
}

CuttingDescription cutting_of(const std::string& text, const ToolDescription& tool,
                              InputErrors& input_errors) {
  return read_cutting(parse_toml(text, "s.toml"), tool, input_errors);
}

std::string faults_in(const std::string& text, const ToolDescription& tool = mill()) {
  InputErrors input_errors;
  cutting_of(text, tool, input_errors);
  return text_of(input_errors);
}

std::string material_faults_in(const std::string& text) {
  InputErrors input_errors;
  read_material(parse_toml(text, "m.toml"), input_errors);
  return text_of(input_errors);
}

const std::string box = "blank = \"box\"\nlower_mm = [0, -5, -10]\nupper_mm = [20, 5, 0]\n";

TEST(SceneCutting, BoxIsReadWithItsDefaults) {
  InputErrors input_errors;
  const CuttingDescription cutting = cutting_of(box, mill(), input_errors);
  EXPECT_EQ(text_of(input_errors), "");
  const auto& blank = std::get<cutting::BoxBlank>(cutting.blank);
  EXPECT_EQ(blank.lower_k, Vector3d(0, -5, -10));
  EXPECT_EQ(blank.upper_k, Vector3d(20, 5, 0));
  EXPECT_EQ(cutting.spacing, 0.5);
  EXPECT_TRUE(cutting.three_directions);
  EXPECT_EQ(cutting.max_bytes, std::size_t(2) << 30);
  EXPECT_EQ(cutting.step, 0.5);
  EXPECT_EQ(cutting.tolerance, 1.0_nm);
  EXPECT_EQ(cutting.max_iterations, 30);
  EXPECT_FALSE(cutting.material);
  EXPECT_EQ(cutting.flutes.count, 2);
  EXPECT_EQ(cutting.flutes.helix, 30.0_deg);
  EXPECT_EQ(cutting.flutes.run_out, 0.0);
  EXPECT_TRUE(cutting.flutes.clockwise);
  EXPECT_NO_THROW(validate(cutting.flutes));
}

TEST(SceneCutting, EveryKeyIsReadInInternalUnits) {
  InputErrors input_errors;
  const CuttingDescription cutting = cutting_of(
      "blank = \"cylinder\"\nradius_mm = 12\nlower_mm = -3\nupper_mm = 4\nspacing_mm = 0.25\n"
      "directions = 1\nmax_MiB = 16\nstep_mm = 0.1\ntolerance_nm = 5\nmost_iterations = 7\n"
      "flutes = 4\nhelix_deg = -45\nrun_out_um = 12\nrun_out_angle_deg = 90\n"
      "rotation = \"counter_clockwise\"\nrest_um = 20\ngouge_um = 30\n",
      mill(), input_errors);
  EXPECT_EQ(text_of(input_errors), "");
  const auto& blank = std::get<cutting::CylinderBlank>(cutting.blank);
  EXPECT_EQ(blank.radius, 12.0);
  EXPECT_EQ(blank.lower, -3.0);
  EXPECT_EQ(blank.upper, 4.0);
  EXPECT_EQ(cutting.spacing, 0.25);
  EXPECT_FALSE(cutting.three_directions);
  EXPECT_EQ(cutting.max_bytes, std::size_t(16) << 20);
  EXPECT_EQ(cutting.step, 0.1);
  EXPECT_DOUBLE_EQ(cutting.tolerance, 5.0_nm);
  EXPECT_EQ(cutting.max_iterations, 7);
  EXPECT_EQ(cutting.flutes.count, 4);
  EXPECT_EQ(cutting.flutes.helix, -45.0_deg);
  EXPECT_EQ(cutting.flutes.run_out, 12.0_um);
  EXPECT_EQ(cutting.flutes.run_out_angle, 90.0_deg);
  EXPECT_FALSE(cutting.flutes.clockwise);
  EXPECT_DOUBLE_EQ(cutting.rest, 20.0_um);
  EXPECT_DOUBLE_EQ(cutting.gouge, 30.0_um);
}

std::string cutting_again(const std::string& text, const ToolDescription& tool) {
  return written_again(
      text,
      [&](const Node& node, InputErrors& input_errors) {
        return read_cutting(node, tool, input_errors);
      },
      [&](const CuttingDescription& cutting) { return cutting_to_table(cutting, tool); });
}

TEST(SceneCutting, EveryKeyIsWritten) {
  const SceneFolder folder;
  const std::string stl = folder.write("b.stl", "solid b\nendsolid b\n").string();
  for (const std::string blank :
       {"blank = \"box\"\nlower_mm = [0.0, -5.0, -10.0]\nupper_mm = [20.0, 5.0, 0.0]\n",
        "blank = \"cylinder\"\nradius_mm = 12.0\nlower_mm = -3.0\nupper_mm = 4.0\n",
        "blank = \"offset\"\nallowance_mm = 0.4\nfloor_mm = -8.0\n",
        "blank = \"mesh\"\nfile = \"STL\"\nunit = \"inch\"\nany_size = true\n"}) {
    std::string text = blank + R"(spacing_mm = 0.25
directions = 1
flutes = 4
helix_deg = -45.0
run_out_um = 12.0
run_out_angle_deg = 90.0
rotation = "counter_clockwise"
step_mm = 0.1
max_MiB = 16
tolerance_nm = 5.0
most_iterations = 7
rest_um = 20.0
gouge_um = 30.0
)";
    if (const std::size_t at = text.find("STL"); at != std::string::npos) text.replace(at, 3, stl);
    EXPECT_EQ(cutting_again(text, mill()), text);
  }
  const std::string turned = R"(blank = "turned"
spacing_mm = 0.01
tolerance_nm = 1.0
most_iterations = 30
rest_um = 20.0
gouge_um = 30.0

[[profile]]
along_mm = -60.0
radius_mm = 13.0

[[profile]]
along_mm = 0.0
radius_mm = 14.0
)";
  EXPECT_EQ(cutting_again(turned, diamond()), turned);
}

TEST(SceneCutting, OffsetMeshAndTurnedBlanksAreRead) {
  InputErrors input_errors;
  const CuttingDescription offset =
      cutting_of("blank = \"offset\"\nallowance_mm = 0.4\nfloor_mm = -8\n", mill(), input_errors);
  EXPECT_EQ(std::get<CuttingDescription::OffsetBlank>(offset.blank).allowance, 0.4);
  EXPECT_EQ(std::get<CuttingDescription::OffsetBlank>(offset.blank).floor, -8.0);
  const SceneFolder folder;
  const std::string stl = folder.write("b.stl", "solid b\nendsolid b\n").string();
  const CuttingDescription mesh = cutting_of(
      "blank = \"mesh\"\nfile = \"" + stl + "\"\nunit = \"inch\"\n", mill(), input_errors);
  EXPECT_EQ(std::get<MeshFile>(mesh.blank).file, stl);
  EXPECT_EQ(std::get<MeshFile>(mesh.blank).unit, 25.4);
  const CuttingDescription turned = cutting_of(
      "blank = \"turned\"\nspacing_mm = 0.01\nprofile = [{ along_mm = -60, radius_mm = 13 }, "
      "{ along_mm = -30, radius_mm = 13 }, { along_mm = -30, radius_mm = 14 }, "
      "{ along_mm = 0, radius_mm = 14 }]\n",
      diamond(), input_errors);
  const auto& profile = std::get<CuttingDescription::TurnedBlank>(turned.blank).profile;
  ASSERT_EQ(profile.rows(), 4);
  EXPECT_EQ(profile(1, 0), -30.0);
  EXPECT_EQ(profile(2, 1), 14.0);
  EXPECT_EQ(text_of(input_errors), "");
}

TEST(SceneCutting, ZeroFlutesAreRefusedWithTheirPlace) {
  EXPECT_EQ(faults_in(box + "flutes = 0\n"),
            "s.toml:4:10: expected an integer from 1 to 100 for cutting.flutes, seen 0\n");
}

TEST(SceneCutting, WhatCannotBeIsRefusedByName) {
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_PRED2(has, faults_in(""), "blank");
  EXPECT_PRED2(has, faults_in("blank = \"bax\""), "\"box\"");
  EXPECT_PRED2(has, faults_in("blank = \"box\"\nlower_mm = [0, 0, 0]\nupper_mm = [1, 0, 1]"),
               "in y");
  EXPECT_PRED2(has, faults_in("blank = \"box\"\nupper_mm = [1, 0, 1]"), "lower_mm");
  const std::string cylinder = "blank = \"cylinder\"\nradius_mm = 1\n";
  EXPECT_PRED2(has, faults_in(cylinder + "lower_mm = 2\nupper_mm = 1"), "upper_mm");
  EXPECT_PRED2(has, faults_in(cylinder + "lower_mm = [0, 0, 0]\nupper_mm = 1"), "lower_mm");
  EXPECT_PRED2(has, faults_in("blank = \"offset\"\nallowance_mm = 0\nfloor_mm = 0"), "allowance");
  EXPECT_PRED2(has, faults_in("blank = \"mesh\"\nfile = \"none.stl\""), "no file");
  EXPECT_PRED2(has, faults_in(box + "helix_deg = 90"), "helix");
  EXPECT_PRED2(has, faults_in(box + "run_out_um = -1"), "run_out");
  EXPECT_PRED2(has, faults_in(box + "run_out_mm = 1"), "run_out");
  for (const char* spacing : {"0", "0.0009", "20.1", "1e300"})
    EXPECT_PRED2(has, faults_in(box + "spacing_mm = " + spacing), "s.toml:4:14: ");
  EXPECT_EQ(faults_in(box + "spacing_mm = 0.001\nstep_mm = 100\nrun_out_um = 1000"), "");
  EXPECT_PRED2(has, faults_in(box + "step_mm = 101"), "s.toml:4:11: ");
  EXPECT_PRED2(has, faults_in(box + "run_out_um = 1001"), "s.toml:4:14: ");
  EXPECT_PRED2(has, faults_in(box + "step_mm = nan"), "step");
  EXPECT_PRED2(has, faults_in(box + "directions = 2"), "1 or 3");
  EXPECT_PRED2(has, faults_in(box + "max_MiB = 0"), "max_MiB");
  EXPECT_PRED2(has, faults_in(box + "tolerance_nm = 0"), "tolerance");
  EXPECT_PRED2(has, faults_in(box + "most_iterations = 0"), "most_iterations");
  EXPECT_PRED2(has, faults_in(box + "rotation = \"left\""), "clockwise");
  EXPECT_PRED2(has, faults_in(box + "radius_mm = 3"), "radius_mm");  // not a box's key
}

TEST(SceneCutting, TurnedBlankAsksForATurningToolAndARisingProfile) {
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  const auto turned = [](const std::string& corners) {
    return "blank = \"turned\"\nprofile = [" + corners + "]\n";
  };
  const std::string good =
      turned("{ along_mm = 0, radius_mm = 3 }, { along_mm = 5, radius_mm = 3 }");
  EXPECT_EQ(faults_in(good, diamond()), "");
  EXPECT_PRED2(has, faults_in(good, mill()), "milling cutter");
  EXPECT_PRED2(has, faults_in(box, diamond()), "turning tool");
  EXPECT_PRED2(has, faults_in(good + "flutes = 2", diamond()), "flutes");
  EXPECT_PRED2(has, faults_in(good + "max_MiB = 2", diamond()), "s.toml:3:1: ");  // no dexels
  EXPECT_PRED2(has, faults_in("blank = \"turned\"", diamond()), "profile");
  EXPECT_PRED2(has, faults_in(turned("{ along_mm = 0, radius_mm = 3 }"), diamond()), "2 to 10000");
  EXPECT_PRED2(
      has,
      faults_in(turned("{ along_mm = 0, radius_mm = 3 }, { along_mm = -1, radius_mm = 3 }"),
                diamond()),
      "the previous corner");
  EXPECT_PRED2(has,
               faults_in(turned("{ along_mm = 0, radius_mm = 3 }, { along_mm = 0, radius_mm = 4 }"),
                         diamond()),
               "one position");
  EXPECT_PRED2(
      has,
      faults_in(turned("{ along_mm = 0, radius_mm = -3 }, { along_mm = 1, radius_mm = 4 }"),
                diamond()),
      "radius_mm");
  EXPECT_PRED2(has,
               faults_in(turned("{ along_mm = 0 }, { along_mm = 1, radius_mm = 4 }"), diamond()),
               "radius_mm");
  EXPECT_PRED2(has, faults_in("blank = \"turned\"\nprofile = 3", diamond()), "profile");
}

TEST(SceneMaterial, EveryShippedSetIsReadAndNamesItsSource) {
  int sets = 0;
  for (const auto& file : std::filesystem::directory_iterator(
           std::filesystem::path(ABBE_SOURCE_DIR) / "scenes" / "materials")) {
    SCOPED_TRACE(file.path().string());
    InputErrors input_errors;
    const cutting::CuttingCoefficients K = read_material(read_toml_file(file.path()), input_errors);
    EXPECT_EQ(text_of(input_errors), "");
    EXPECT_NO_THROW(validate(K));
    EXPECT_GT(K.name.size(), 5u);
    EXPECT_GT(K.source.size(), 20u);
    ++sets;
  }
  EXPECT_GE(sets, 5);
}

TEST(SceneMaterial, Al6082IsAsItsSourceSays) {
  InputErrors input_errors;
  const auto file =
      std::filesystem::path(ABBE_SOURCE_DIR) / "scenes/materials/al6082_t6_carbide.toml";
  const cutting::CuttingCoefficients K = read_material(read_toml_file(file), input_errors);
  EXPECT_EQ(K.K_tc, 631.0);
  EXPECT_EQ(K.K_rc, 99.0);
  EXPECT_EQ(K.K_ac, 273.0);
  EXPECT_EQ(K.K_te, 13.0);
  EXPECT_EQ(K.K_re, 10.0);
  EXPECT_EQ(K.K_ae, 2.8);
}

TEST(SceneMaterial, EveryKeyIsWritten) {
  const std::string text =
      "name = \"x\"\nsource = \"y\"\nK_tc_N_per_mm2 = 600.0\nK_rc_N_per_mm2 = 100.0\n"
      "K_ac_N_per_mm2 = -5.0\nK_te_N_per_mm = 10.0\nK_re_N_per_mm = 11.0\nK_ae_N_per_mm = 0.5\n";
  EXPECT_EQ(written_again(text, read_material, material_to_table), text);
}

TEST(SceneMaterial, NonPhysicalCoefficientsAreRefusedByName) {
  const std::string good =
      "name = \"x\"\nsource = \"y\"\nK_tc_N_per_mm2 = 600\nK_rc_N_per_mm2 = 100\n"
      "K_ac_N_per_mm2 = -5\nK_te_N_per_mm = 10\nK_re_N_per_mm = 10\nK_ae_N_per_mm = 0\n";
  EXPECT_EQ(material_faults_in(good), "");
  const auto refuses = [&](const std::string& old_part, const std::string& new_part,
                           const std::string& name) {
    std::string text = good;
    text.replace(text.find(old_part), old_part.size(), new_part);
    EXPECT_NE(material_faults_in(text).find(name), std::string::npos)
        << new_part << ": " << material_faults_in(text);
  };
  refuses("K_tc_N_per_mm2 = 600", "K_tc_N_per_mm2 = -600", "K_tc_N_per_mm2");
  refuses("K_tc_N_per_mm2 = 600", "K_tc_MPa = 600", "K_tc_N_per_mm2");
  refuses("K_rc_N_per_mm2 = 100", "K_rc_N_per_mm2 = inf", "K_rc_N_per_mm2");
  refuses("K_te_N_per_mm = 10", "", "K_te_N_per_mm");
  refuses("K_re_N_per_mm = 10", "K_re_N_per_mm = \"10\"", "K_re_N_per_mm");
  refuses("K_ae_N_per_mm = 0", "K_ae_N_per_mm = nan", "K_ae_N_per_mm");
  refuses("source = \"y\"\n", "", "source");
}

}  // namespace
}  // namespace abbe::sim
