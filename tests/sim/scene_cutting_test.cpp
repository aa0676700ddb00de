#include <fmt/ranges.h>
#include "sim/cut/process.h"
#include "sim/report/key_reference.h"
#include "sim/scene/cutting.h"
#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/scene_fields.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/tool.h"
#include "tests/oracles/closed_forms.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/sim/written_section.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

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
  for (const auto& file :
       fs::directory_iterator(fs::path(ABBE_SOURCE_DIR) / "scenes" / "materials")) {
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
  const auto file = fs::path(ABBE_SOURCE_DIR) / "scenes/materials/al6082_t6_carbide.toml";
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
    EXPECT_HAS(material_faults_in(text), name) << new_part;
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

// Turning inserts in scenes: their keys, what is refused, and what they leave of a shaft and a
// face.
namespace abbe::sim::insert_tests {
namespace {

using cutting::Insert;
using cutting::Nose;

const std::string pointed =
    "kind = \"insert\"\nradius_mm = 0.4\ncutting_edge_angle_deg = 93\nminor_edge_angle_deg = 32\n"
    "cutting_edge_mm = 15\nminor_edge_mm = 14\nlength_mm = 60\n";
const std::string wiping =
    "kind = \"insert\"\nradius_mm = 0.8\ncutting_edge_angle_deg = 95\nminor_edge_angle_deg = 5\n"
    "cutting_edge_mm = 12\nminor_edge_mm = 11\nwiper_mm = 0.6\nlength_mm = 60\n";
const std::string grooving =
    "kind = \"edge\"\nx_mm = [-1.0, -0.8, 1.8, 2.0, 2.0, -1.0]\n"
    "z_mm = [-0.8, -1.0, -1.0, -0.8, 4.0, 4.0]\n"
    "arc_radii_mm = [0, 0.2, 0, 0.2, 0, 0]\nlength_mm = 60\n";

ToolDescription read_tool(const Node& section, InputErrors& input_errors) {
  return read_tools(section, input_errors).front();
}

std::string tool_faults(const std::string& text) {
  InputErrors input_errors;
  read_tool(parse_toml(text, "s.toml"), input_errors);
  return text_of(input_errors);
}

TEST(SceneInsert, IsReadAndWritten) {
  for (const std::string& text :
       {pointed, wiping, grooving, pointed + "actual = { radius_mm = 0.41 }\n",
        grooving + "actual = { x_mm = [-1, 1, 0], z_mm = [-1, -1, 2] }\n"})
    written_again(text, read_tool, tool_to_table);

  const ToolDescription tool =
      read_section(pointed +
                       "[actual]\nradius_mm = 0.41\ncutting_edge_angle_deg = 92.5\n"
                       "centring_height_mm = 0.02\n",
                   read_tool);
  const Nose& nominal = std::get<Nose>(tool.nominal);
  const Nose& actual = std::get<Nose>(tool.actual);
  EXPECT_EQ(nominal.radius, 0.4);
  EXPECT_EQ(actual.radius, 0.41);
  EXPECT_EQ(tool.centring_height, 0.02);
  const Insert& insert = std::get<Insert>(tool.actual_form);
  EXPECT_EQ(insert.major, 92.5 * units::deg);
  EXPECT_EQ(insert.minor, 32 * units::deg);
  EXPECT_EQ(insert.minor_length, 14.0);
  // straight ahead the edge leans by kappa_r
  const Vector2d ahead(-std::sin(93 * units::deg), -std::cos(93 * units::deg));
  EXPECT_NEAR(ahead.dot(cutting::extreme_point(*nominal.profile, ahead)), 0.4, 1e-12);
  EXPECT_EQ(std::get<Nose>(read_section(grooving, read_tool).nominal).radius, 1.0);
}

TEST(SceneInsert, ThatCannotBeIsRefusedWhereItStands) {
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_EQ(tool_faults(pointed), "");
  EXPECT_PRED2(has, tool_faults(with(pointed, "radius_mm = 0.4\n", "")), "radius_mm");
  EXPECT_PRED2(has, tool_faults(with(pointed, "= 0.4", "= 0")), "s.toml:2:13");
  EXPECT_PRED2(has, tool_faults(with(pointed, "= 93", "= 180")), "s.toml:3:");
  EXPECT_PRED2(has, tool_faults(with(pointed, "= 32", "= 100")),
               "s.toml:1:1: expected a valid turning insert");
  EXPECT_PRED2(has, tool_faults(with(pointed, "= 32", "= 100")), "sum of major and minor angle");
  EXPECT_PRED2(has, tool_faults(with(wiping, "= 0.6", "= 0.01")), "would cut the nose");
  EXPECT_PRED2(has, tool_faults(with(pointed, "= 14", "= 0.1")), "nose circle");
  EXPECT_PRED2(has, tool_faults(pointed + "[actual]\nminor_edge_angle_deg = 100\n"), "s.toml:8:");
  EXPECT_PRED2(has, tool_faults(pointed + "[[actual.wave]]\norder = 2\namplitude_um = 1\n"),
               "wave");
  EXPECT_PRED2(has, tool_faults(with(grooving, "-1.0, -0.8, 1.8", "-0.8, 1.8")), "as many");
  EXPECT_PRED2(has, tool_faults(with(grooving, "z_mm", "z_um")), "z_mm");
  EXPECT_PRED2(has, tool_faults(with(grooving, "4.0, 4.0", "4.0, -1.5")), "inward bend");
  EXPECT_PRED2(has, tool_faults(with(grooving, "4.0, 4.0", "4.0, -1.5")), "_mm, entry ");
  EXPECT_PRED2(has, tool_faults(grooving + "[actual]\nx_mm = [-1, 1, 1]\nz_mm = [-1, -1, -1]\n"),
               "expected distinct points for tool.actual.x_mm, entry 2, seen (1, -1) mm twice");
  EXPECT_PRED2(has, tool_faults(grooving + "[actual]\nx_mm = [0, 1, -1]\nz_mm = [2, -1, -1]\n"),
               "expected points in counter-clockwise order, from x to z for tool.actual.x_mm and "
               "z_mm, seen");
  EXPECT_PRED2(has, tool_faults(grooving + "[actual]\nz_mm = [1, 2]\n"), "x_mm");
}

/// What the table of keys says of waves is what a reader takes.
TEST(SceneInsert, TheKeysSayWhichKindHasWaves) {
  const std::vector<Key> keys = keys_at(scene_keys(), "tool.actual");
  const auto wave = std::ranges::find(keys, "wave", &Key::name);
  ASSERT_NE(wave, keys.end());
  const std::string waved = "[[actual.wave]]\norder = 2\namplitude_um = 1\n";
  const std::string nose = "kind = \"nose\"\nradius_mm = 0.4\nlength_mm = 60\n";
  for (const auto& [kind, tool] :
       {std::pair{"nose", nose}, {"insert", pointed}, {"edge", grooving}})
    EXPECT_EQ(tool_faults(tool + waved).empty(),
              wave->sentence.find(std::string("\"") + kind + "\"") != std::string::npos)
        << kind << ": " << wave->sentence;
}

/// A shaft of radius 12.5 turned at 0.25 mm a revolution.
Job shaft(const std::string& tool, double centre, const std::string& more = "") {
  const SceneFolder folder;
  folder.write("p.ngc", fmt::format("G18 G21 G90 G94\nS1000 M3\nG0 X{0} Z32\nG1 Z-2 F250\nG0 "
                                    "X25\nM5\nM30\n",
                                    centre));
  return prepare(read_scene(folder.write(
      "s.toml", fmt::format("machine = \"{0}machines/lathe_zx.toml\"\n{3}[tool]\n{1}[part]\n"
                            "surface = \"cylinder\"\nradius_mm = 12.5\nheight_mm = 30\n"
                            "vertices = 6000\n[program]\nfile = \"p.ngc\"\n{2}",
                            packaged("").string(), tool, more,
                            more.empty() ? ""
                                         : fmt::format("material = \"{}materials/"
                                                       "steel_c45_typical.toml\"\n",
                                                       packaged("").string())))));
}

TEST(SceneInsert, LeavesItsFeedMarksOnAShaft) {
  const Job job = shaft(pointed, 12.9);
  const VectorXd left = cut_error_free(job).surface.residual;
  const double mark = 0.4 - std::sqrt(0.4 * 0.4 - 0.125 * 0.125);
  std::cout << "feed marks from " << left.minCoeff() / units::um << " to "
            << left.maxCoeff() / units::um << " um, closed form " << mark / units::um << " um\n";
  EXPECT_GE(left.minCoeff(), -1e-7);
  EXPECT_LE(left.maxCoeff(), mark + 1e-7);
  EXPECT_GE(left.maxCoeff(), 0.95 * mark);
}

TEST(SceneInsert, WithAWiperLeavesNone) {
  const VectorXd left = cut_error_free(shaft(wiping, 13.3)).surface.residual;
  std::cout << "behind a wiper from " << left.minCoeff() / units::nm << " to "
            << left.maxCoeff() / units::nm << " nm\n";
  EXPECT_LE(left.cwiseAbs().maxCoeff(), 1e-7);
}

TEST(SceneInsert, IsPressedByItsChip) {
  const double depth = 1.5, feed = 0.25, K_tc = 2000, K_te = 30;
  const Job job = shaft(pointed, 12.9,
                        "[cutting]\nblank = \"turned\"\nspacing_mm = 0.01\nprofile = [{ along_mm = "
                        "-6, radius_mm = 14 }, { along_mm = 30, radius_mm = 14 }]\n");
  const Process process = cut(job).process;
  double removed = 0.0;
  const ProcessStep* middle = nullptr;
  for (const ProcessStep& step : process.steps) {
    removed += step.removed;
    if (step.removed > 0.0 && (middle == nullptr || step.time_s < 5.0)) middle = &step;
  }
  const double ring = pi * (14.0 * 14.0 - 12.5 * 12.5);
  EXPECT_GT(removed, 30 * ring);
  EXPECT_LT(removed, 33 * ring);
  ASSERT_NE(middle, nullptr);
  const double tangential = K_tc * feed * depth + K_te * (depth + 0.2);
  std::cout << "removed " << removed << " mm^3, of the shaft " << 30 * ring << "; torque "
            << middle->torque << " N mm, F_t r " << 13.25 * tangential << "\n";
  // a chip measured across the nose counts for more than it is, chip / (2 nose radius) of itself,
  // and a stock that is linear between its nodes adds half of their distance
  const double nose = 0.4 * (1 - std::cos(93 * units::deg));
  const double more = K_tc * (feed / 0.8 * feed * nose + 0.01 * depth);
  EXPECT_GT(middle->torque, 0.98 * 13.25 * tangential);
  EXPECT_LT(middle->torque, 13.25 * (tangential + more));
}

/// Turned deep by a shallow feed, the loads of an edge at an angle to the feed.
Process turned_at(double angle, double edge) {
  const std::string tool = fmt::format(
      "kind = \"insert\"\nradius_mm = 0.4\ncutting_edge_angle_deg = {}\n"
      "minor_edge_angle_deg = 30\ncutting_edge_mm = {}\nminor_edge_mm = 8\nlength_mm = 60\n",
      angle, edge);
  return cut(shaft(tool, 12.9,
                   "[cutting]\nblank = \"turned\"\nspacing_mm = 0.01\nprofile = [{ along_mm = "
                   "-6, radius_mm = 15.5 }, { along_mm = 30, radius_mm = 15.5 }]\n"))
      .process;
}

/// Chip and force of an edge that overhangs, which the turned stock does not, are those of one
/// along the radius.
TEST(SceneInsert, ThatOverhangsIsPressedByAllOfItsChip) {
  const double depth = 3.0, feed = 0.25, K_tc = 2000, K_te = 30, r = 14.0;
  for (const double angle : {80.0, 90.0, 95.0}) {
    const Process process = turned_at(angle, 8.0);
    double torque = 0.0;
    for (const ProcessStep& step : process.steps) torque = std::max(torque, step.torque);
    const double edge = depth / std::sin(angle * units::deg);
    const double wanted = r * (K_tc * feed * depth + K_te * edge);
    std::cout << angle << " deg: torque " << torque << " N mm, closed form " << wanted << "\n";
    EXPECT_NEAR(torque, wanted, 0.08 * wanted);
    EXPECT_TRUE(process_warnings(shaft(pointed, 12.9).scene, process).empty());
  }
}

TEST(SceneInsert, ThatCutsDeeperThanItsEdgeIsWarnedOf) {
  const Process process = turned_at(45.0, 1.0);
  double beyond = 0.0;
  for (const ProcessStep& step : process.steps) beyond = std::max(beyond, step.overhang);
  // an edge of 1 mm at 45 deg ends 0.824 mm above the nose
  EXPECT_NEAR(beyond, 3.0 - 0.4 * (1 - std::sqrt(0.5)) - std::sqrt(0.5), 0.02);
  const std::string text =
      fmt::format("{}", fmt::join(process_warnings(shaft(pointed, 12.9).scene, process), "\n"));
  EXPECT_HAS(text, "beyond the edges of the insert");
}

std::string facing(const std::string& tool, const std::string& part) {
  return fmt::format(
      "machine = \"{}machines/platform_xz.toml\"\n[tool]\n{}[part]\n{}\nturn_deg = [0, 90, 0]\n"
      "vertices = 2000\n[program]\ngenerator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = 20\n"
      "start_beyond_rim_mm = 0.3\n",
      packaged("").string(), tool, part);
}

TEST(SceneInsert, FollowsASpiralWithItsNoseAlone) {
  const SceneFolder folder;
  const std::string disc = "surface = \"disc\"\nradius_mm = 3.0";
  const std::string cone =
      "surface = \"cone\"\nbase_radius_mm = 3.0\nheight_mm = 3.0\nhalf_apex_deg = 45.0";
  const Job face = prepare(read_scene(folder.write("face.toml", facing(pointed, disc))));
  const VectorXd left = cut_error_free(face).surface.residual;
  const double mark = oracles::cusp(0.4, 0.02);
  std::cout << "faced by a nose from " << left.minCoeff() / units::nm << " to "
            << left.maxCoeff() / units::nm << " nm, closed form " << mark / units::nm << " nm\n";
  EXPECT_GE(left.minCoeff(), -1e-7);
  EXPECT_LE(left.maxCoeff(), mark + 1e-7);
  // a cone of 45 deg is touched by what is ahead: the nose before an edge of 93 deg, not of 30
  const Job steep = prepare(read_scene(folder.write("cone.toml", facing(pointed, cone))));
  EXPECT_GE(cut_error_free(steep).surface.residual.minCoeff(), -1e-7);
  const std::string flat = facing(with(pointed, "= 93", "= 30"), cone);
  const std::string said =
      refusal_by([&] { prepare(read_scene(folder.write("flat.toml", flat))); });
  EXPECT_HAS(said, "an insert that touches with its nose");
}

}  // namespace
}  // namespace abbe::sim::insert_tests
