// Form cutters in scenes: read, written, cut with, with stock and force, refused.

#include "sim/cut/cut.h"
#include "sim/scene/document.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/scene_fields.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const std::string form_square =
    "[part]\nsurface = \"rectangle\"\nlength_x_mm = 8\nlength_y_mm = 6\nat_mm = [40, 25, 80]\n"
    "vertices = 3000\n";
const std::string cap_r100 =
    "[part]\nsurface = \"sphere_cap\"\nradius_mm = 100\nrim_radius_mm = 3\nvertices = 3000\n"
    "at_mm = [40, 25, 80]\n";

/// A raster under a tool of the scene's own.
std::string raster_with(const std::string& tool, const std::string& part = form_square,
                        const std::string& more = "") {
  return fmt::format(
      "machine = \"{0}machines/gantry_cxyza.toml\"\n[tool]\nlength_mm = 100\n{1}{2}"
      "[program]\ngenerator = \"raster\"\npattern = \"one_way\"\nclearance_mm = 10\noverrun_mm = "
      "1\nstep_over_mm = 0.5\nstep_mm = 0.5\nlead_deg = 30\n{3}",
      packaged("").string(), tool, part, more);
}

Scene form_scene(const std::string& text, const std::vector<Override>& changes = {}) {
  const SceneFolder folder;
  return read_scene(folder.write("form.toml", text), changes);
}

cutting::Surface surface_with(const std::string& tool, const std::string& part = form_square) {
  return cut_error_free(prepare(form_scene(raster_with(tool, part)))).surface;
}

const std::string ball_mill = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\n";
const std::string bull_mill =
    "kind = \"bull\"\nradius_mm = 6\ncorner_radius_mm = 1\nflank_length_mm = 25\n";
const std::string apt_ball =
    "kind = \"apt\"\ndiameter_mm = 10\ncorner_radius_mm = 5\nflank_length_mm = 25\n";
const std::string apt_bull =
    "kind = \"apt\"\ndiameter_mm = 12\ncorner_radius_mm = 1\nflank_length_mm = 25\n";
const std::string tapered_ball =
    "kind = \"apt\"\ncorner_radius_mm = 5\nflank_deg = 5\nflank_length_mm = 25\n";
const std::string barrel_mill =
    "kind = \"form\"\nradii_mm = [1, 2.4, 2.4]\nheights_mm = [0, 0.5, 14.5]\n"
    "arc_radii_mm = [0, 2.4, 20]\n";

const std::string stepped_mill =
    "kind = \"profile\"\nradii_mm = [2, 2, 5, 5]\nheights_mm = [0, 1, 1, 10]\n";
const std::string rounding_mill =
    "kind = \"profile\"\nradii_mm = [2, 5, 5]\nheights_mm = [0, 3, 10]\n"
    "arc_radii_mm = [0, -3, 0]\n";

TEST(FormCutterScene, OfACommonOutlineCutsTheSame) {
  for (const auto& [common, form] : {std::pair{ball_mill, apt_ball}, {bull_mill, apt_bull}})
    for (const std::string& part : {form_square, cap_r100}) {
      const Apart d = apart(surface_with(common, part), surface_with(form, part));
      std::cout << d.vertices << " vertices, " << d.max / units::nm << " nm apart at most\n";
      EXPECT_GT(d.vertices, 2500);
      EXPECT_EQ(d.unlike, 0);
      EXPECT_LT(d.max, 0.1_nm);
    }
}

/// The generated program puts the ball of a tapered ball on the part, whatever is above it.
TEST(FormCutterScene, ATaperedBallCutsWithItsBall) {
  const Apart d = apart(surface_with(ball_mill), surface_with(tapered_ball));
  std::cout << d.vertices << " vertices, " << d.max / units::nm << " nm apart at most\n";
  EXPECT_GT(d.vertices, 2500);
  EXPECT_LT(d.max, 0.1_nm);
}

/// A lens that leans by less than its bottom bulges leaves the ridges of that.
TEST(FormCutterScene, ALensLeavesTheRidgesOfItsLargeRadius) {
  constexpr double R = 60.0, step_over = 0.5;
  const double height = R - std::sqrt(R * R - 16.0);
  const std::string tool = fmt::format(
      "kind = \"form\"\nradii_mm = [0, 4, 4]\nheights_mm = [0, {:.12f}, 10]\n"
      "arc_radii_mm = [0, {}, 0]\n",
      height, R);
  const Scene scene = form_scene(with(raster_with(tool), "lead_deg = 30", "lead_deg = 2"));
  const cutting::Surface surface = cut_error_free(prepare(scene)).surface;
  double most = -1.0;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == cutting::VertexStatus::Cut)
      most = std::max(most, surface.residual[Index(i)]);
  const double ridge = R - std::sqrt(R * R - 0.25 * step_over * step_over);
  std::cout << "highest " << most / units::um << " um, ridge " << ridge / units::um << " um\n";
  EXPECT_LT(most, ridge + 0.1_nm);
  EXPECT_GT(most, 0.98 * ridge);
}

TEST(FormCutterScene, IsWrittenAsItWasRead) {
  const std::string actual =
      "[tool.actual]\nflank_deg = 5.01\ncorner_radius_mm = 4.99\nlength_mm = 100.01\n";
  const std::string other = "[tool.actual]\narc_radii_mm = [0, 2.4, 20.1]\n";
  for (const std::string& tool :
       {tapered_ball + actual, barrel_mill + other, apt_bull,
        stepped_mill + "[tool.actual]\nradii_mm = [2, 2, 5.01, 5.01]\n", rounding_mill,
        apt_bull + "corner_offset_mm = 5\ncorner_height_mm = 1\n"}) {
    const Scene scene = form_scene(raster_with(tool));
    const Scene again = scene_from_tree(to_table(scene), "again.toml", {});
    for (auto shape : {&ToolDescription::nominal, &ToolDescription::actual}) {
      const auto& a = std::get<cutting::Cutter>(scene.tool.*shape);
      const auto& b = std::get<cutting::Cutter>(again.tool.*shape);
      ASSERT_TRUE(a.outline && b.outline);
      EXPECT_LT(cutting::max_separation(*a.outline, *b.outline), 1e-12);
    }
  }
  const Scene scene = form_scene(raster_with(tapered_ball + actual));
  EXPECT_GT(cutting::max_separation(*std::get<cutting::Cutter>(scene.tool.nominal).outline,
                                    *std::get<cutting::Cutter>(scene.tool.actual).outline),
            1e-3);
}

TEST(FormCutterScene, ThatCannotBeIsRefusedWhereItStands) {
  const auto refused = [](const std::string& tool, const std::string& part_of_it) {
    const std::string text = refusal_by([&] { form_scene(raster_with(tool)); });
    EXPECT_HAS(text, "form.toml:");
    EXPECT_HAS(text, part_of_it);
  };
  const std::string form = "kind = \"form\"\n";
  refused(form + "radii_mm = [1, 3, 2, 5]\nheights_mm = [0, 1, 3, 8]\n", "inward bend");
  refused(form + "radii_mm = [1, 3, 2, 5]\nheights_mm = [0, 1, 3, 8]\n",
          "kind = \"profile\" allows concave ones");
  refused(stepped_mill + "[tool.wear]\nway_mm = 1000\nradius_um = 3\n", "wear");
  refused(form + "radii_mm = [1, 3]\nheights_mm = [0, 1, 3]\n",
          "form.toml:6:14: expected as many numbers as radii_mm, 2, for tool.heights_mm, seen 3");
  refused(form + "radii_mm = [1, 3]\nheights_mm = [1, 3]\n", "height 0");
  refused(form + "radii_mm = [1, 3]\nheights_mm = [0, 3]\narc_radii_mm = [0, 1]\n",
          "an arc of radius");
  refused(form + "radii_mm = [1, 3]\n", "heights_mm");
  refused(form + "radius_mm = 3\nradii_mm = [1, 3]\nheights_mm = [0, 3]\n", "radius_mm");
  refused(apt_bull + "corner_offset_mm = 5\n", "or neither");
  refused(apt_bull + "corner_offset_mm = 8\ncorner_height_mm = 1\n", "meets the corner");
  refused(apt_bull + "bottom_deg = 95\n", "bottom_deg");
  refused("kind = \"apt\"\nflank_length_mm = 25\n", "diameter_mm");
  refused(apt_bull + "[tool.actual]\ncorner_radius_mm = 30\n", "corner");
  refused(tapered_ball + "[tool.wear]\nway_mm = 1000\nradius_um = 3\n", "wear");
}

/// The line of a key of tools that have their kind on line 4, and the column of an entry.
TEST(FormCutterScene, APointThatCannotBeIsRefusedByKeyAndEntry) {
  const auto says = [](const std::string& tool, const std::string& text) {
    const std::string said =
        refusal_by([&] { form_scene(raster_with("kind = \"form\"\n" + tool)); });
    EXPECT_HAS(said, "form.toml:" + text);
  };
  says("radii_mm = [1, 3, 2, 5]\nheights_mm = [0, 1, 3, 8]\n",
       "5:19: expected a convex outline for tool.radii_mm, entry 3, seen an inward bend");
  says("radii_mm = [1, 3]\nheights_mm = [1, 3]\n",
       "6:15: expected the first point at height 0 for tool.heights_mm, entry 1, seen 1 mm");
  says("radii_mm = [1, 3]\nheights_mm = [0, 3]\narc_radii_mm = [0, 1]\n",
       "7:20: expected an arc of radius at least 1.80278 mm to (3, 3) for tool.arc_radii_mm, entry "
       "2, seen 1");
  says("radii_mm = [1, -3]\nheights_mm = [0, 3]\n",
       "5:16: expected finite numbers of at least 0 for tool.radii_mm, entry 2, seen (-3, 3) mm");
  says("radii_mm = [1, 3]\nheights_mm = [0, 3]\narc_radii_mm = [0, -1]\n",
       "7:20: expected finite numbers of at least 0 for tool.arc_radii_mm, entry 2, seen");
  says("radii_mm = [1, 3]\nheights_mm = [0, 0]\n", "6:18: expected");
  says(
      "radii_mm = [1, 3]\nheights_mm = [0, 3]\n[tool.actual]\nradii_mm = [3, 1, 2]\n"
      "heights_mm = [0, 1, 3]\n",
      "8:16: expected a convex outline for tool.actual.radii_mm, entry 2, seen");
}

TEST(FormCutterScene, APointThatAProfileCannotHaveIsRefusedByKeyAndEntry) {
  const auto says = [](const std::string& tool, const std::string& text) {
    const std::string said =
        refusal_by([&] { form_scene(raster_with("kind = \"profile\"\n" + tool)); });
    EXPECT_HAS(said, "form.toml:" + text);
  };
  says("radii_mm = [3, 3, 5, 5]\nheights_mm = [0, 4, 3, 9]\n",
       "6:21: expected a height of at least 4 mm (that of the previous point) for tool.heights_mm, "
       "entry 3, seen 3 mm");
  says("radii_mm = [3, 0, 5]\nheights_mm = [0, 4, 9]\n",
       "5:16: expected a radius above 0 everywhere above the tip for tool.radii_mm, entry 2, seen "
       "0 mm");
  says("radii_mm = [3, 3, 6, 3, 3]\nheights_mm = [0, 4, 4, 4, 9]\n",
       "5:19: expected an outline that does not turn back on itself for tool.radii_mm, entry 3, "
       "seen one that does");
  says("radii_mm = [3, 5]\nheights_mm = [0, 4]\narc_radii_mm = [0, -1]\n",
       "7:20: expected an inward arc with a radius of -2.23607 mm or below to (5, 4) for "
       "tool.arc_radii_mm, entry 2, seen -1");
  says("radii_mm = [3, 5]\nheights_mm = [1, 4]\n",
       "6:15: expected the first point at height 0 for tool.heights_mm, entry 1, seen 1 mm");
}

/// A block milled with stock, force and a tool that bends, by a flat end and by its outline.
Job form_block(const std::string& tool) {
  const SceneFolder folder;
  folder.write("block.ngc",
               "G17 G21 G90 G94\nG49\nS6000 M3\nG0 Z100\nG0 X-30 Y0\nG0 Z78\nG1 X30 F600\n"
               "G0 Z100\nM2\n");
  return prepare(read_scene(folder.write(
      "block.toml",
      fmt::format(
          "machine = \"{0}machines/three_axis_table.toml\"\n"
          "material = \"{0}materials/al7075_t6_carbide.toml\"\n"
          "[tool]\nlength_mm = 80\n{1}"
          "[part]\nsurface = \"rectangle\"\nlength_x_mm = 20\nlength_y_mm = 6\nat_mm = [0, 0, 78]\n"
          "vertices = 400\n"
          "[program]\nfile = \"block.ngc\"\nwork_offset.G54 = {{ Z_mm = -20 }}\n"
          "[cutting]\nblank = \"box\"\nlower_mm = [-20, -20, -18]\nupper_mm = [20, 20, 2]\n"
          "spacing_mm = 0.5\n"
          "[[compliance.tool.section]]\nlength_mm = 40\ndiameter_mm = 8\n"
          "youngs_modulus_GPa = 600\n",
          packaged("").string(), tool))));
}

TEST(FormCutterScene, StockAndForceAreThoseOfTheCommonCutter) {
  const Cut common = cut(form_block("kind = \"flat\"\nradius_mm = 5\nflank_length_mm = 10\n"));
  const Cut form = cut(form_block("kind = \"apt\"\ndiameter_mm = 10\nflank_length_mm = 10\n"));
  ASSERT_EQ(common.process.steps.size(), form.process.steps.size());
  double most = 0.0, apart_by = 0.0, removed = 0.0;
  for (std::size_t i = 0; i < common.process.steps.size(); ++i) {
    const ProcessStep &a = common.process.steps[i], &b = form.process.steps[i];
    most = std::max(most, a.load.tool_wrench_t.head<3>().norm());
    apart_by = std::max(apart_by, (a.load.tool_wrench_t - b.load.tool_wrench_t).head<3>().norm());
    removed += b.removed;
    EXPECT_NEAR(a.removed, b.removed, 1e-6);
  }
  std::cout << "force up to " << most << " N, " << apart_by << " N apart, " << removed << " mm^3\n";
  EXPECT_GT(most, 10.0);
  EXPECT_LT(apart_by, 1e-6 * most);
  EXPECT_LT(apart(common.surface, form.surface).max, 0.1_nm);
}

TEST(FormCutterScene, ATaperBendsAndRemovesWhatItsShapeDoes) {
  const Cut taper =
      cut(form_block("kind = \"apt\"\ndiameter_mm = 8\nflank_deg = 10\nflank_length_mm = 10\n"));
  EXPECT_TRUE(taper.process.crash_lines.empty());
  double removed = 0.0;
  for (const ProcessStep& step : taper.process.steps) removed += step.removed;
  // a slot 2 mm deep whose walls lean by 10 deg
  EXPECT_NEAR(removed, 40 * 2 * (8 + 2 * std::tan(10 * units::deg)), 5.0);
}

/// A slot with a step: the tip is on the part, the shoulder a millimetre above it.
TEST(FormCutterScene, ASteppedToolLeavesASteppedSlot) {
  const Job job = form_block(stepped_mill);
  const cutting::Surface surface = cut_error_free(job).surface;
  int low = 0, high = 0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const auto v = Index(i);
    const double aside =
        std::abs((job.scene.part.T_wm.inverse() * Vector3d(job.design_w.vertices.row(v))).y());
    if (surface.status[i] == cutting::VertexStatus::Outside || std::abs(aside - 2.0) < 1e-3)
      continue;
    ASSERT_EQ(surface.status[i], cutting::VertexStatus::Cut);
    EXPECT_NEAR(surface.residual[v], aside < 2.0 ? 0.0 : 1.0, 1e-7) << aside;
    ++(aside < 2.0 ? low : high);
  }
  EXPECT_GT(low, 100);
  EXPECT_GT(high, 50);
  const Cut whole = cut(job);
  EXPECT_TRUE(whole.process.crash_lines.empty());
  double removed = 0.0, most = 0.0;
  for (const ProcessStep& step : whole.process.steps) {
    removed += step.removed;
    most = std::max(most, step.load.tool_wrench_t.head<3>().norm());
  }
  EXPECT_NEAR(removed, 40 * (4 * 1 + 10 * 1), 5.0);
  EXPECT_GT(most, 10.0);
}

/// It is said by how much chords make the tool larger.
TEST(FormCutterScene, ChordsOfAHollowArcAreWarnedOf) {
  const Job job = form_block(rounding_mill);
  EXPECT_TRUE(std::ranges::any_of(job.warnings, [](const std::string& text) {
    return text.find("are replaced by chords: the tool is larger there by up to") !=
           std::string::npos;
  }));
  EXPECT_TRUE(std::ranges::none_of(form_block(stepped_mill).warnings, [](const std::string& text) {
    return text.find("chords") != std::string::npos;
  }));
}

}  // namespace
}  // namespace abbe::sim
