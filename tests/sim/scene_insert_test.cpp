#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/cut/process.h"
#include "sim/report/key_reference.h"
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
  const Eigen::Vector2d ahead(-std::sin(93 * units::deg), -std::cos(93 * units::deg));
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
  const Eigen::VectorXd left = cut_error_free(job).surface.residual;
  const double mark = 0.4 - std::sqrt(0.4 * 0.4 - 0.125 * 0.125);
  std::cout << "feed marks from " << left.minCoeff() / units::um << " to "
            << left.maxCoeff() / units::um << " um, closed form " << mark / units::um << " um\n";
  EXPECT_GE(left.minCoeff(), -1e-7);
  EXPECT_LE(left.maxCoeff(), mark + 1e-7);
  EXPECT_GE(left.maxCoeff(), 0.95 * mark);
}

TEST(SceneInsert, WithAWiperLeavesNone) {
  const Eigen::VectorXd left = cut_error_free(shaft(wiping, 13.3)).surface.residual;
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
  EXPECT_NE(text.find("beyond the edges of the insert"), std::string::npos) << text;
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
  const Eigen::VectorXd left = cut_error_free(face).surface.residual;
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
  EXPECT_NE(said.find("an insert that touches with its nose"), std::string::npos) << said;
}

}  // namespace
}  // namespace abbe::sim::insert_tests
