#include <nlohmann/json.hpp>
#include "sim/cut/placement.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/odd_scenes.h"
#include "tests/test.h"

namespace abbe::sim {

void write_odd_files(const SceneFolder& folder) {
  const auto nc = [&](const std::string& name, const Passes& passes) {
    folder.write(name, to_nc(passes));
  };
  nc("good.ngc", {});
  folder.write("empty.ngc", "");
  folder.write("end.ngc", "M2\n");
  folder.write("comments.ngc", "(nothing)\n; at all\nM2\n");
  folder.write("dwell.ngc", "G21 G90\nG4 P5\nM2\n");
  folder.write("deleted.ngc", "/G0 X0 Y0 Z0\n/G1 X10 F100\nM2\n");
  folder.write("standing.ngc", "G21 G90 G49\nF100\nG1 Z390\nG1 Z390\nM2\n");
  nc("rapids.ngc", {.feed = "", .cut = "G0"});
  nc("rapids_above.ngc", {.z = 40, .feed = "", .cut = "G0"});
  nc("above.ngc", {.z = 80});
  nc("below.ngc", {.z = -90});
  nc("just_above.ngc", {.z = 2.5});
  nc("half.ngc", {.from = -7, .to = -1});
  nc("one_pass.ngc", {.from = 0, .to = 0});
  nc("wide_steps.ngc", {.step = 3});
  nc("too_deep.ngc", {.z = -3});
  nc("far_too_deep.ngc", {.z = -22});
  nc("deep_in_band.ngc", {.z = -1});
  nc("one_deep.ngc", {.middle = "G0 X0 Y0\nG0 Z5\nG1 Z-6 F100\nG0 Z80\n"});
  nc("one_dip.ngc", {.middle = "G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\nG0 Z80\n"});
  nc("rapid_dip.ngc", {.middle = "G0 X0 Y0\nG0 Z-1\nG0 Z80\n"});
  nc("one_tool.ngc", {.head = "G21 G90 G49\nT7 M6\n"});
  nc("t_alone.ngc", {.head = "G21 G90 G49\nT7\n"});
  nc("m6_alone.ngc", {.head = "G21 G90 G49\nM6\n"});
  nc("two_tools.ngc", {.head = "G21 G90 G49\nT1 M6\n", .middle = "T2 M6\nS9000 M3\n"});
  nc("preselected.ngc", {.head = "G21 G90 G49\nT1 M6\nT2\n", .middle = "M6\nS9000 M3\n"});
  nc("feed_before_tool.ngc", {.middle = "T7 M6\nS9000 M3\n"});
  nc("zero_feed.ngc", {.feed = "F0"});
  nc("negative_feed.ngc", {.feed = "F-100"});
  nc("no_feed.ngc", {.feed = ""});
  nc("inches.ngc", {.head = "G20 G90 G49\n"});
  nc("shrunk.ngc", {.from = -0.25, .to = 0.25, .step = 0.05, .reach = 0.3});
  nc("offset.ngc", {.head = "G21 G90 G49 G55\n"});
  nc("half_way.ngc", {.middle = "M30\n"});
  nc("incremental.ngc", {.head = "G21 G91 G49\n"});
  nc("long_tool.ngc", {.head = "G21 G90\nG43 H2\n"});
  nc("box.ngc", {.from = -12, .to = 12, .step = 1, .reach = 14, .z = 10});
  nc("box_deep.ngc", {.from = -12, .to = 12, .step = 1, .reach = 14, .z = -20});
  nc("wall.ngc", {.from = -12, .to = -2, .step = 1, .reach = 14, .z = -8});
  folder.write("box.obj", box_obj(false));
  folder.write("box_quads.obj", box_obj(true));
  folder.write("box_flipped.obj", box_obj(true, true));
  folder.write("crossed.obj", "v 0 0 0\nv 10 10 0\nv 10 0 0\nv 0 10 0\nf 1 2 3 4\n");
  const auto flat = [](double, double) { return 0.0; };
  folder.write("plate.obj", sheet_obj(1, 5, flat));
  folder.write("plates.obj", sheet_obj(3, 18, flat));
  folder.write("thin.obj", thin_obj());
  folder.write("sheet.obj", sheet_obj(10, 5, flat));
  folder.write("sheet_flipped.obj", sheet_obj(10, 5, flat, true));
  folder.write("dome.obj", sheet_obj(6, 15, dome_height));
  folder.write("fine_dome.obj", sheet_obj(60, 15, dome_height));
  folder.write("step.obj", sheet_obj(12, 6, [](double, double y) { return y > 0.4 ? 12.0 : 0.0; }));
  folder.write("ridge.obj",
               sheet_obj(10, 5, [](double, double y) { return y > 0.0 ? 0.2 * y : 0.0; }));
  folder.write("tilting.toml",
               "name = \"four axes\"\ncode = \"w B' b X Y Z s t\"\n[axis.B]\npoint_mm = [0, 0, 0]\n"
               "travel_deg = [-30, 30]\n[axis.X]\ntravel_mm = [-300, 300]\n[axis.Y]\ntravel_mm = "
               "[-300, 300]\n[axis.Z]\ntravel_mm = [-300, 300]\n[nose]\nat_mm = [0, 0, 100]\n"
               "[home]\nZ_mm = 290\n");
}

namespace {

std::string small_cap(double radius, double rim) {
  return fmt::format(
      "surface = \"sphere_cap\"\nradius_mm = {}\nrim_radius_mm = {}\nvertices = 400\nat_mm = [0, "
      "0, "
      "80]\n",
      radius, rim);
}

std::string raster(const std::string& part, double lead, const std::string& machine,
                   const std::string& more = "") {
  return to_toml(BallRaster{
      .part = part, .step_over = 1.0, .step = 1.0, .lead = lead, .machine = machine, .more = more});
}

/// Four axes: the table tilts about y by up to 30 degrees, nothing else turns.
std::string four_axes(const std::string& part, double lead) {
  return fmt::format(
      "machine = \"tilting.toml\"\ntool = \"{}tools/ball_r5.toml\"\n[part]\n{}[program]\ngenerator "
      "= "
      "\"raster\"\nstep_over_mm = 1\nstep_mm = 1\nlead_deg = {}\n",
      packaged("").string(), part, lead);
}

std::string mesh(const std::string& file, const std::string& more = "") {
  return "file = \"" + file + "\"\nany_size = true\nsampling = \"vertices\"\nrecognise_um = 0\n" +
         more;
}

const std::string open_sheet = "open = true\n";
const std::string nose_tool = "kind = \"nose\"\nradius_mm = 0.4\nlength_mm = 30\n";

/// A face of radius 10 turned by a spiral on the platform.
std::string turned(const std::string& spiral, const std::string& part_more = "") {
  return fmt::format(
      "machine = \"{0}machines/platform_xz.toml\"\ntool = \"{0}tools/diamond_r249um.toml\"\n"
      "[part]\nsurface = \"disc\"\nradius_mm = 10\nturn_deg = [0, 90, 0]\nvertices = "
      "400\n{1}[program]\ngenerator = "
      "\"spiral\"\nspeed_rpm = 150\n{2}",
      packaged("").string(), part_more, spiral);
}

std::string raster_on(const std::string& part, double step_over, const std::string& more = "") {
  return fmt::format(
      "machine = \"{0}machines/gantry_cxyza.toml\"\ntool = \"{0}tools/ball_r5.toml\"\n[part]\n{1}"
      "[program]\ngenerator = \"raster\"\nstep_over_mm = {2}\nstep_mm = {2}\nlead_deg = 20\n{3}",
      packaged("").string(), part, step_over, more);
}

}  // namespace

std::vector<OddScene> odd_scenes() {
  std::vector<OddScene> all;
  const auto flat = [&](const std::string& name, FlatScene scene) {
    all.push_back({name, to_toml(scene)});
  };
  for (const char* program : {"empty",        "end",          "comments",
                              "dwell",        "deleted",      "standing",
                              "rapids",       "rapids_above", "above",
                              "below",        "just_above",   "half",
                              "one_pass",     "too_deep",     "far_too_deep",
                              "deep_in_band", "one_deep",     "one_dip",
                              "rapid_dip",    "one_tool",     "feed_before_tool",
                              "t_alone",      "m6_alone",     "two_tools",
                              "preselected",  "zero_feed",    "negative_feed",
                              "no_feed",      "inches",       "shrunk",
                              "half_way",     "incremental",  "no_such"})
    flat(program, {.program = std::string(program) + ".ngc"});
  flat("offset", {.program = "offset.ngc", .more = "work_offset.G55 = { Z_mm = 50 }\n"});
  flat("long tool", {.program = "long_tool.ngc", .more = "tool_length_mm = { 2 = 30 }\n"});
  const std::string ball = "kind = \"ball\"\nflank_length_mm = 25\nlength_mm = 100\n";
  flat("another tool", {.program = "one_tool.ngc", .tool = ball + "radius_mm = 5\nnumber = 3\n"});
  flat("tiny tool", {.program = "wide_steps.ngc", .tool = ball + "radius_mm = 0.5\n"});
  flat("narrow band", {.program = "wide_steps.ngc", .more = "[search]\nband_mm = 0.05\n"});
  const std::string square =
      "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = 400\n";
  flat("part above", {.part = square + "at_mm = [0, 0, 40]\n"});
  flat("part far above", {.part = square + "at_mm = [0, 0, 450]\n"});
  flat("part beside", {.part = square + "at_mm = [150, 0, 0]\n"});
  flat("part behind", {.part = square + "at_mm = [0, -150, 0]\n"});
  flat("part larger", {.part = "surface = \"rectangle\"\nlength_x_mm = 60\nlength_y_mm = 60\n"
                               "vertices = 400\n"});
  // every vertex of it is buried, which takes 18 ms each
  flat("part upside down",
       {.part = std::string("surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\n") +
                (std::getenv("ABBE_LONG") != nullptr ? "vertices = 400\n" : "vertices = 100\n") +
                "turn_deg = [180, 0, 0]\n"});
  flat("part on edge", {.part = square + "turn_deg = [90, 0, 0]\n"});
  flat("nothing judged", {.part = square + "judged_radius_min_mm = 50\n"});
  flat("box of 12 triangles, its top",
       {.program = "box.ngc", .part = mesh("box.obj", "judged_normal_z = 0.5\n")});
  flat("box of 12 triangles", {.program = "box.ngc", .part = mesh("box_quads.obj")});
  flat("box in inches", {.program = "box.ngc", .part = mesh("box.obj", "unit = \"inch\"\n")});
  flat("box in metres", {.program = "box.ngc", .part = "file = \"box.obj\"\nunit = \"m\"\n"});
  flat("box flipped", {.program = "box.ngc", .part = mesh("box_flipped.obj")});
  flat("below the table", {.program = "box_deep.ngc", .part = mesh("box.obj")});
  flat("plate of four vertices", {.part = mesh("plate.obj", open_sheet)});
  flat("plate of wide triangles", {.part = mesh("plates.obj", open_sheet)});
  flat("gouged thin plate", {.program = "deep_in_band.ngc", .part = mesh("thin.obj")});
  flat("crossed face", {.part = mesh("crossed.obj", open_sheet)});
  flat("sheet not called open", {.part = mesh("sheet.obj")});
  flat("sheet flipped", {.part = mesh("sheet_flipped.obj", open_sheet)});
  flat("margin over all", {.part = mesh("sheet.obj", open_sheet + "judged_margin_mm = 50\n")});
  const auto wall = [&](const std::string& name, const std::string& shank) {
    flat(name,
         {.program = "wall.ngc",
          .tool = "kind = \"flat\"\nradius_mm = 5\nflank_length_mm = 3\nlength_mm = 100\n" + shank,
          .part = mesh("step.obj", open_sheet + "at_mm = [0, 0, -8]\n")});
  };
  wall("shank against a wall", "");
  wall("wide shank against a wall", "shank_radius_mm = 5.5\n");
  flat("a nose on a mill", {.tool = nose_tool});
  const auto add = [&](const std::string& name, const std::string& text) {
    all.push_back({name, text});
  };
  add("lead without an axis for it",
      four_axes(mesh("ridge.obj", open_sheet + "at_mm = [0, 0, 80]\n"), 10));
  add("lead beyond its axis", four_axes(square + "at_mm = [0, 0, 80]\n", 31));
  add("lead into a bowl's wall",
      raster_on("surface = \"revolved\"\nstart_mm = [0, 0]\nprofile = [{ to_mm = [11, 7.2], "
                "arc_radius_mm = -12 }]\nvertices = 400\nat_mm = [0, 0, 80]\n",
                1.0, "tilt_deg = 60\n"));
  add("coarse dome", raster_on(mesh("dome.obj", open_sheet + "at_mm = [0, 0, 80]\n"), 0.5));
  add("coarse dome, tolerance",
      raster_on(mesh("dome.obj", open_sheet + "at_mm = [0, 0, 80]\ntolerance_um = 10\n"), 0.5));
  add("negative overrun", raster_on(small_cap(40, 10), 1.0, "overrun_mm = -1\n"));
  add("no step", raster_on(small_cap(40, 10), 0.0));
  add("turned to half its radius", turned("feed_um_per_rev = 100\nend_radius_mm = 5\n"));
  add("turned beside", turned("feed_um_per_rev = 100\n",
                              "judged_radius_min_mm = "
                              "30\n"));
  return all;
}

std::vector<OddScene> sane_scenes() {
  std::vector<OddScene> all;
  const auto add = [&](const std::string& name, const std::string& text) {
    all.push_back({name, text});
  };
  add("square", to_toml(FlatScene{}));
  add("square, its tool called",
      to_toml(FlatScene{.program = "one_tool.ngc",
                        .tool = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = "
                                "100\nnumber = 7\n"}));
  add("sheet", to_toml(FlatScene{.part = mesh("sheet.obj", open_sheet)}));
  add("fine dome", raster_on(mesh("fine_dome.obj", open_sheet + "at_mm = [0, 0, 80]\n"), 0.5));
  add("cap", raster(small_cap(40, 15), 36, "gantry_cxyza"));
  add("cap on the trunnion", raster(small_cap(40, 15), 20, "trunnion_ca"));
  add("cap, three axes", raster(small_cap(60, 10), 0, "three_axis_table"));
  add("turned face", turned("feed_um_per_rev = 100\n"));
  add("four axes that reach",
      four_axes(
          "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = 400\nat_mm = "
          "[0, 0, 80]\n",
          10));
  add("errors",
      raster(small_cap(40, 15), 36, "gantry_cxyza", "[errors]\nEXX_um = 50\nEC0Y_urad = 90\n"));
  return all;
}

namespace {

/// What `run` says of a scene.
struct Said {
  std::string refusal;
  std::vector<std::string> warnings;
  std::vector<std::string> exceeded_limits;
  cutting::Statistics residual;

  bool is_silent() const { return refusal.empty() && warnings.empty() && exceeded_limits.empty(); }
  std::string text() const {
    std::string all = refusal.empty() ? "" : "refused: " + refusal;
    for (const std::string& warning : warnings) all += (all.empty() ? "" : " | ") + warning;
    return all;
  }
};

Said said_of(const fs::path& file, bool error_free = false) {
  Said said;
  try {
    const Job job = check_placement(prepare(read_scene(file)));
    Cut made = error_free ? cut_error_free(job) : cut(job);
    check_cuts_part(job, made);
    const Verdict verdict = judge(job, std::move(made), nullptr);
    said.warnings = warnings_of(job, verdict.cut);
    said.exceeded_limits = exceeded_limits(job.scene.limits, verdict);
    said.residual = verdict.residual;
  } catch (const BadScene& fault) {
    said.refusal = fault.what();
  } catch (const BadInput& fault) {
    said.refusal = fault.what();
  }
  return said;
}

class NothingVanishes : public testing::Test {
 protected:
  NothingVanishes() { write_odd_files(folder_); }

  Said said(const std::string& name) const {
    for (const OddScene& scene : odd_scenes())
      if (scene.name == name) return said_of(folder_.write("scene.toml", scene.text));
    ADD_FAILURE() << "no scene " << name;
    return {};
  }
  void expect_warning(const std::string& name, const std::string& part) const {
    const Said all = said(name);
    EXPECT_HAS(all.text(), part) << name;
    EXPECT_EQ(all.refusal, "") << name;
  }
  void expect_refusal(const std::string& name, const std::string& part) const {
    const Said all = said(name);
    EXPECT_HAS(all.refusal, part) << name << ": " << all.text();
  }

  SceneFolder folder_;
};

TEST_F(NothingVanishes, EveryOddSceneIsRefusedOrWarnedOf) {
  const std::vector<OddScene> scenes = odd_scenes();
  EXPECT_GE(scenes.size(), 50u);
  for (const OddScene& scene : scenes) {
    const auto start = std::chrono::steady_clock::now();
    const Said said = said_of(folder_.write("scene.toml", scene.text));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_FALSE(said.is_silent()) << scene.name;
    std::cout << fmt::format("{} ({:.2f} s): {}\n", scene.name, took.count(), said.text());
  }
}

TEST_F(NothingVanishes, WhatIsSaidHasFiguresAndLines) {
  expect_refusal("above", "the lowest cut is 80.0 mm above the part");
  expect_refusal("just_above", "the lowest cut is 2.5 mm above the part");
  expect_refusal("part far above",
                 "the highest cut is 425.0 mm below the part");  // 25 mm of flank
  expect_refusal("part beside", "the nearest cut is 133.0 mm away from the part, on its -x side");
  expect_refusal("two_tools",
                 "expected only one tool, T1 of line 2, because the scene has one; describe "
                 "several as one numbered [[tool]] each, seen T2");
  expect_refusal("another tool", "expected T3, which is the scene's tool.number, seen T7");
  expect_warning(
      "box of 12 triangles, its top",
      "the part is judged at only 4 vertices: the results do not include the surface between them");
  expect_warning("half", "judged vertices (20 %) are uncut");
  expect_warning("too_deep",
                 "400 of 400 judged vertices (100 %) are gouged deeper than the band of 2 mm, the "
                 "deepest by 3.000 mm");
  expect_warning("one_tool", "T7 on line 2 is cut with the scene's tool");
  expect_warning("feed_before_tool",
                 "feeds before the first tool call, T7 on line 63: it is cut with");
  expect_warning(
      "plate of four vertices",
      "the part is judged at only 4 vertices: the results do not include the surface between them");
  expect_warning("plate of wide triangles",
                 "neighbouring judged vertices are up to 16.97 mm apart and the cutter is 10 mm in "
                 "diameter: the results miss a gouge between them");
  expect_warning(
      "gouged thin plate",
      "gouged deeper than the band of 2 mm or half the wall thickness where that is less, the "
      "deepest by more than the search depth of 5.000 mm");  // from its narrow sides
  expect_refusal("lead beyond its axis",
                 "expected a program that the machine can run, seen the machine does not reach");
  expect_warning("rapids", "no block of the program feeds");
  expect_warning("lead without an axis for it", "no axis position gives the tool direction");
  expect_warning("shank against a wall", "the shank above the flank (3 mm above the tip)");
  expect_warning("wide shank against a wall",
                 "(3 mm above the tip, radius 5.5 mm) enters the design by more than 0.1 mm at");
  expect_warning("coarse dome, tolerance", "the mesh is too coarse for the tolerance");
  expect_warning("box of 12 triangles", "neighbouring judged vertices are up to 28.28 mm apart");
}

TEST_F(NothingVanishes, OfSaneScenesNothingIsSaid) {
  const std::vector<OddScene> scenes = sane_scenes();
  EXPECT_GE(scenes.size(), 10u);
  for (const OddScene& scene : scenes)
    for (const bool error_free : {false, true}) {
      const Said said = said_of(folder_.write("scene.toml", scene.text), error_free);
      EXPECT_TRUE(said.is_silent()) << scene.name << ": " << said.text();
      EXPECT_GT(said.residual.cut_vertices, 0) << scene.name;
    }
}

}  // namespace
}  // namespace abbe::sim
