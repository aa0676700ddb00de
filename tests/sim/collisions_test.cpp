#include "sim/cut/collisions.h"
#include <nlohmann/json.hpp>
#include "sim/cut/bodies.h"
#include "sim/cut/cut.h"
#include "sim/report/program_report.h"
#include "sim/scene/cases.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// A mesh as an STL of text.
std::string stl_text(const cutting::ClosedMesh& mesh) {
  std::string text = "solid part\n";
  for (const auto& t : mesh.triangles.rowwise()) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (int k = 0; k < 3; ++k)
      text += fmt::format("vertex {} {} {}\n", mesh.vertices(t[k], 0), mesh.vertices(t[k], 1),
                          mesh.vertices(t[k], 2));
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid part\n";
}

/// A plate, x -50 .. 50, y -60 .. 0, up to z 20, with a wall up to z 60 at x 30 .. 50.
cutting::ClosedMesh plate_with_wall() {
  Eigen::MatrixX2d outline(6, 2);
  outline << -50, 0, 50, 0, 50, 60, 30, 60, 30, 20, -50, 20;
  kinematics::Pose T = kinematics::Pose::Identity();
  T.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return cutting::transformed_mesh(cutting::extruded_mesh(outline, 60.0), T);
}

/// What a planted crash changes.
struct PlantedCrash {
  std::string moves;      ///< after the tool stands at x -20, y -30, z 100
  std::string tool = "";  ///< lines of [tool]
  std::string more = "";  ///< sections
  std::vector<Override> changes = {};
};

const char* const holder = "[tool.holder]\nradii_mm = [15, 15, 20]\nheights_mm = [35, 60, 95]\n";

Job planted_job(const PlantedCrash& planted) {
  const SceneFolder folder;
  folder.write("part.stl", stl_text(plate_with_wall()));
  folder.write("part.ngc", "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nG0 X-20 Y-30 Z100 A0 C0\n" +
                               planted.moves + "\nM2\n%\n");
  const std::string scene = fmt::format(
      "machine = \"{}machines/gantry_cxyza.toml\"\n"
      "program = \"part.ngc\"\n"
      "[part]\nfile = \"part.stl\"\nunit = \"mm\"\n"
      "[tool]\nkind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlength_mm = 100\n"
      "{}{}",
      packaged("").string(), planted.tool, planted.more);
  return prepare(read_scene(folder.write("scene.toml", scene), planted.changes));
}

/// Collisions as written, without the time that the search took.
std::string written(const Collisions& collisions) {
  nlohmann::ordered_json json = to_json(collisions);
  EXPECT_EQ(json.erase("seconds"), 1u);
  return json.dump(1);
}

Collisions in_windows(const Job& job, std::mt19937_64& random) {
  const Job windowed = in_random_windows(job, random);
  return collisions(windowed,
                    {[](const Segment& window, std::size_t) { return segment_commands(window); },
                     job.path, windowed.windows->all},
                    "uncompensated");
}

Collisions collisions_of(const PlantedCrash& planted) {
  const Job job = planted_job(planted);
  return collisions(job, uncompensated_commands(job), "uncompensated");
}

std::vector<Collision> contacts_of(const Collisions& all) {
  std::vector<Collision> contacts;
  for (const Collision& one : all.list)
    if (one.contact) contacts.push_back(one);
  return contacts;
}

/// One contact alone, of this pair on this line, so deep.
void expect_one_contact(const PlantedCrash& planted, const std::string& a, const std::string& b,
                        int line, double depth, double x_w) {
  const Collisions all = collisions_of(planted);
  const std::vector<Collision> contacts = contacts_of(all);
  std::cout << to_text(all);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_TRUE((contacts[0].a == a && contacts[0].b == b) ||
              (contacts[0].a == b && contacts[0].b == a))
      << contacts[0].a << " and " << contacts[0].b;
  EXPECT_EQ(contacts[0].first.line, line);
  EXPECT_NEAR(contacts[0].depth, depth, 0.02);
  EXPECT_NEAR(contacts[0].position_w.x(), x_w, 0.05);
  EXPECT_FALSE(is_clear(all));
}

void expect_no_contact(const PlantedCrash& planted) {
  const Collisions all = collisions_of(planted);
  EXPECT_TRUE(is_clear(all)) << to_text(all);
}

TEST(Collisions, TheHolderInTheWallOfThePart) {
  expect_one_contact({"G1 Z20 F1000\nG1 X18", holder}, "holder", "part", 7, 3.0, 30.0);
  expect_no_contact({"G1 Z20 F1000\nG1 X14", holder});
}

TEST(Collisions, IsAsDeepAsWhereTheMotionTurnsBack) {
  // deepest between a short way in and a long way out
  expect_one_contact({"G1 Z20 F1000\nG1 X18\nG1 X-100", holder}, "holder", "part", 7, 3.0, 30.0);
  expect_one_contact({"G1 Z20 F1000\nG1 X17\nG1 X18 Y-30.5\nG1 X-100 Y-31", holder}, "holder",
                     "part", 7, 3.0, 30.0);
}

TEST(Collisions, WhatIsThinnerThanAStepIsDeepOnlyWithinIt) {
  const std::string sheet =
      "[[fixture]]\nname = \"sheet\"\nsize_mm = [0.1, 20, 20]\nat_mm = [-10.3, -30, 40]\n";
  const Job job = planted_job({"G0 Z40\nG0 X10\nG0 Z100", "", sheet, {{"tool.radius_mm", "0.05"}}});
  const std::vector<Collision> met =
      contacts_of(collisions(job, uncompensated_commands(job), "uncompensated"));
  ASSERT_EQ(met.size(), 1u);
  // of 0.1 mm, at looks 1/8 mm apart
  EXPECT_GT(met[0].depth, 0.03);
  EXPECT_LT(met[0].depth, 0.1 + 1e-6);
}

TEST(Collisions, TheShankInAWall) {
  expect_one_contact({"G1 Z20 F1000\nG1 X25", "shank_radius_mm = 8\n"}, "shank", "part", 7, 3.0,
                     30.0);
  expect_no_contact({"G1 Z20 F1000\nG1 X21", "shank_radius_mm = 8\n"});
  // as wide as the cutter, beside a wall that is to be cut
  expect_no_contact({"G1 Z20 F1000\nG1 X25\nG1 Y-40"});
}

TEST(Collisions, ARapidThroughThePart) {
  // half a millimetre into the plate
  expect_one_contact({"G0 Z19.5\nG0 Z100"}, "cutter", "part", 6, 0.5, -20.0);
  expect_no_contact({"G0 Z19.95\nG0 Z100"});
  const Collisions through = collisions_of({"G0 Z40\nG0 X60\nG0 Z100"});
  ASSERT_GE(contacts(through), 1u);
  EXPECT_TRUE(through.list[0].rapid);
  EXPECT_EQ(through.list[0].first.line, 7);
  EXPECT_NEAR(through.list[0].depth, 15.0, 0.02);  // to the side of the wall
}

/// A clamp on the plate, its face at x -30.
const std::string clamp =
    "[[fixture]]\nname = \"clamp\"\nsize_mm = [20, 20, 15]\nat_mm = [-40, -30, 27.5]\n";

/// A blank that stands 20 mm over the wall.
const char* const block =
    "[cutting]\nblank = \"box\"\nlower_mm = [-50, -60, 0]\nupper_mm = [50, 0, 80]\n"
    "spacing_mm = 0.5\n";

TEST(Collisions, ARapidThroughTheStock) {
  // the cutter's tip 10 mm under its skin, over the part
  expect_one_contact({"G0 Z70\nG0 X0\nG0 Z100", "", block}, "cutter", "stock", 6, 10.0, -20.0);
  expect_no_contact({"G0 Z81\nG0 X0\nG0 Z100", "", block});
  // deepest where the motion turns back, between a short way in and a long way out
  const std::vector<Collision> slow = contacts_of(collisions_of({"G0 Z70\nG0 X60 Z81", "", block}));
  ASSERT_GE(slow.size(), 1u);
  EXPECT_NEAR(slow[0].depth, 10.0, 0.02);
  EXPECT_EQ(slow[0].worst.line, 6);
  // where it was cut before there is nothing to meet
  expect_no_contact({"G1 Z70 F500\nG1 X0\nG0 X-20\nG0 Z100", "", block});
}

TEST(Collisions, TheHolderInTheStockAsItIsThen) {
  const char* const small =
      "[cutting]\nblank = \"box\"\nlower_mm = [-40, -50, 20]\nupper_mm = [0, -10, 80]\n"
      "spacing_mm = 0.5\n";
  const Collisions all = collisions_of({"G1 Z44 F500\nG0 Z100", holder, small});
  ASSERT_EQ(contacts(all), 1u) << to_text(all);
  EXPECT_EQ(all.list[0].a + " " + all.list[0].b, "holder stock");
  EXPECT_EQ(all.list[0].first.line, 6);
  EXPECT_NEAR(all.list[0].depth, 1.0, 0.02);
  EXPECT_NEAR(all.list[0].position_w.z(), 80.0, 0.01);
  EXPECT_LT(std::hypot(all.list[0].position_w.x() + 20.0, all.list[0].position_w.y() + 30.0), 15.1);
  expect_no_contact({"G1 Z46 F500\nG0 Z100", holder, small});
  // deeper after a long way, and most where the motion turns back; coarse dexels, as the face is
  // flat
  const char* const coarse =
      "[cutting]\nblank = \"box\"\nlower_mm = [-40, -50, 20]\nupper_mm = [0, -10, 80]\n"
      "spacing_mm = 1\n";
  const Collisions later =
      collisions_of({"G1 Z44 F500\nG1 X-30 Z43\nG1 X-10 Z41\nG0 Z100", holder, coarse});
  ASSERT_EQ(contacts(later), 3u) << to_text(later);  // and the shank beside what was cut
  EXPECT_EQ(later.list[0].a + " " + later.list[0].b, "holder stock");
  EXPECT_EQ(later.list[0].first.line, 6);
  EXPECT_EQ(later.list[0].worst.line, 8);
  EXPECT_NEAR(later.list[0].depth, 4.0, 0.02);
  // the same plunge into a face that was lowered to z 72 before
  std::string moves = "G0 Z72\n";
  for (int y = -50; y <= -10; y += 4)
    moves += fmt::format("G0 X-48 Y{}\nG1 X8 F2000\nG0 Z90\nG0 X-48\nG0 Z72\n", y);
  moves = "G0 Z90\nG0 X-48 Y-50\n" + moves + "G0 Z90\nG0 X-20 Y-30\n";
  expect_no_contact({moves + "G1 Z44 F500\nG0 Z100", holder, small});
  // and 8 mm deeper it is met again
  const Collisions deep = collisions_of({moves + "G1 Z36 F500\nG0 Z100", holder, small});
  ASSERT_EQ(contacts(deep), 1u) << to_text(deep);
  EXPECT_EQ(deep.list[0].b, "stock");
  // 1 mm and the crests of the ball, 0.417 mm, which the mesh cuts off within its half spacing
  EXPECT_NEAR(deep.list[0].depth, 1.417, 0.25);
  // unless that pair is left out
  expect_no_contact({moves + "G1 Z36 F500\nG0 Z100", holder,
                     small + std::string("[[collision.ignore]]\na = \"holder\"\nb = \"stock\"\n")});
}

// The motion of bodies and the steps of the stock are the same when samples are made again window
// by window; most windows here end within a contact or a step.
TEST(Collisions, InWindowsAreThoseOfTheWhole) {
  constexpr std::uint64_t seed = 41;
  std::mt19937_64 random(seed);
  const char* const coarse =
      "[cutting]\nblank = \"box\"\nlower_mm = [-40, -50, 20]\nupper_mm = [0, -10, 80]\n"
      "spacing_mm = 4\n";
  const std::vector<PlantedCrash> crashes{
      {"G1 Z21 F1000\nG1 X-24.2\nG0 X-24.5\nG0 Z100", "", clamp},
      {"G1 Z60 F500\nG1 X0\nG1 X-20\nG1 Z50\nG1 X0\nG1 Y-29.7\nG1 X-20\nG0 Z100",
       "shank_radius_mm = 5.4\n", coarse},
      {"G1 Z70 F500\nG1 X0\nG4 P1\nG0 X-30 Z66\nG1 Z64\nG1 X-29.8\nG1 X-29.6\nG0 Y-20\nG0 Z100",
       holder, std::string(clamp) + coarse}};
  for (const PlantedCrash& planted : crashes) {
    const Job job = planted_job(planted);
    const Collisions whole = collisions(job, uncompensated_commands(job), "uncompensated");
    const std::string text = written(whole);
    EXPECT_EQ(text, written(in_windows(job, random))) << planted.moves;
    std::cout << contacts(whole) << " contacts, " << whole.list.size() << " events, "
              << whole.queries << " queries\n";
    EXPECT_FALSE(whole.list.empty());
  }
}

TEST(Collisions, TheShankInTheStock) {
  // the flank ends 10 mm under the skin
  expect_one_contact({"G1 Z50 F500\nG1 X0\nG0 Z100", "", block}, "shank", "stock", 7, 10.0,
                     -15.1);  // the core of the shank
  expect_no_contact({"G1 Z61 F500\nG1 X0\nG0 Z100", "", block});
}

TEST(Collisions, AShankOfItsOwnRadiusInTheStock) {
  // 0.3 mm into the wall of a slot, above the flank
  const std::string moves =
      "G1 Z60 F500\nG1 X0\nG1 X-20\nG1 Z50\nG1 X0\nG1 Y-29.7\nG1 X-20\nG0 Z100";
  const char* const coarse =
      "[cutting]\nblank = \"box\"\nlower_mm = [-40, -50, 20]\nupper_mm = [10, -10, 80]\n"
      "spacing_mm = 1\n";
  const auto with_shank = [&](const char* tool) { return collisions_of({moves, tool, coarse}); };
  const Collisions as_wide_as_the_cutter = with_shank("");
  EXPECT_EQ(contacts(as_wide_as_the_cutter), 1u);
  const Collisions necked = with_shank("shank_radius_mm = 4\n");
  EXPECT_TRUE(is_clear(necked)) << to_text(necked);
  ASSERT_FALSE(necked.warnings.empty());
  EXPECT_HAS(necked.warnings.back(), "a shank of the cutter radius, 5 mm");
  // wider than its cutter it is met once, by its own radius
  const Collisions wide = with_shank("shank_radius_mm = 5.4\n");
  std::vector<Collision> of_stock = contacts_of(wide);
  std::erase_if(of_stock, [](const Collision& one) { return one.b != "stock"; });
  ASSERT_FALSE(of_stock.empty());
  for (std::size_t i = 1; i < of_stock.size(); ++i)
    EXPECT_GT(of_stock[i].first.time_s, of_stock[i - 1].last.time_s);
  EXPECT_EQ(wide.warnings, as_wide_as_the_cutter.warnings);
  EXPECT_EQ(of_stock.back().last.line, 13);  // until it is drawn out
}

TEST(Collisions, ANearMissBeginsOnAFeedThoughItIsNearestOnARapid) {
  const Collisions near = collisions_of({"G1 Z21 F1000\nG1 X-24.2\nG0 X-24.5\nG0 Z100", "", clamp});
  ASSERT_EQ(near.list.size(), 1u);
  EXPECT_FALSE(near.list[0].rapid);
  EXPECT_EQ(near.list[0].worst.line, 8);
}

TEST(Collisions, TheCutterDeeperInThePartThanAGougeMayBe) {
  expect_one_contact({"G1 Z19 F500\nG1 X-10\nG1 Z100"}, "cutter", "part", 6, 1.0, -20.0);
  expect_no_contact({"G1 Z19 F500\nG1 X-10\nG1 Z100", "", "[collision]\ngouge_mm = 1.01\n"});
}

TEST(Collisions, AClampInTheWay) {
  expect_one_contact({"G1 Z21 F1000\nG1 X-28", "", clamp}, "cutter", "clamp", 7, 3.0, -30.0);
  expect_no_contact({"G1 Z21 F1000\nG1 X-24", "", clamp});
  // a pair that may meet is not looked at
  expect_no_contact({"G1 Z21 F1000\nG1 X-28", "",
                     clamp + "[[collision.ignore]]\na = \"clamp\"\nb = \"cutter\"\n"});
  EXPECT_THROW(collisions_of({"G1 Z90 F1000", "",
                              clamp + "[[collision.ignore]]\na = \"clamb\"\nb = \"cutter\"\n"}),
               BadScene);
}

TEST(Collisions, AFixtureInsideThePartIsWarnedOf) {
  const auto said = [](const char* size, const char* at) {
    const Collisions all = collisions_of(
        {"G1 Z90 F1000", "",
         fmt::format("[[fixture]]\nname = \"clamp\"\nsize_mm = {}\nat_mm = {}\n", size, at)});
    for (const std::string& text : all.warnings)
      if (text.find("clamp is entirely inside the part") != std::string::npos) return true;
    return false;
  };
  EXPECT_TRUE(said("[0.8, 0.8, 1.5]", "[-40, -30, 10]"));
  EXPECT_FALSE(said("[0.8, 0.8, 1.5]", "[-40, -30, 20]"));  // through its skin
  EXPECT_FALSE(said("[20, 20, 15]", "[-40, -30, 27.5]"));
  EXPECT_FALSE(said("[300, 300, 300]", "[0, 0, 0]"));  // around it
}

TEST(Collisions, TheHeadOnTheTableAtAHundredDegrees) {
  const std::vector<Override> low = {{"machine.axis.Z.travel_mm", "[-200, 350]"}};
  const auto down = [&](int z) {
    return PlantedCrash{fmt::format("G49\nG0 Z300\nG0 X0 Y200\nG0 A100\nG1 Z{} F3000\nG0 Z300", z),
                        "", "", low};
  };
  const Collisions all = collisions_of(down(-170));
  std::cout << to_text(all);
  const std::vector<Collision> met = contacts_of(all);
  ASSERT_GE(met.size(), 1u);
  for (const Collision& one : met) {
    EXPECT_TRUE(one.a == "table" || one.b == "table");
    EXPECT_EQ(one.first.line, 10);
    EXPECT_GT(one.depth, 1.0);
  }
  expect_no_contact(down(-50));
}

TEST(Collisions, ACompensatedProgramPastTheEndOfTravel) {
  const std::string errors = "[errors]\nEXX_um = -10\n";
  const auto job_to = [&](const char* travel) {
    return planted_job(
        PlantedCrash{"G1 Z20 F1000\nG1 X18", "", errors, {{"machine.axis.X.travel_mm", travel}}});
  };
  const Job at_the_end = job_to("[-300, 18]");
  const CaseDescription perfect = parse_case("perfect-iterated-program");
  const Collisions all =
      collisions(at_the_end, compensate(at_the_end, perfect), "perfect-iterated-program");
  std::cout << to_text(all);
  EXPECT_FALSE(is_clear(all));
  EXPECT_HAS(all.beyond_travel, "X between -300 and 18 mm");
  EXPECT_TRUE(
      is_clear(collisions(at_the_end, uncompensated_commands(at_the_end), "uncompensated")));
  const Job with_room = job_to("[-300, 18.1]");
  EXPECT_TRUE(is_clear(collisions(with_room, compensate(with_room, perfect), "perfect")));
}

TEST(Collisions, WhatOverlapsFromTheStartIsWarnedOf) {
  const Collisions all = collisions_of(
      {"G1 Z90 F1000", "",
       "[[fixture]]\nname = \"post\"\nsize_mm = [20, 20, 700]\nat_mm = [0, 0, 350]\n"});
  EXPECT_TRUE(is_clear(all));
  bool said = false;
  for (const std::string& text : collision_warnings(all))
    said = said || text.find("post and cutter overlap at the start of the program") == 0;
  EXPECT_TRUE(said);
}

TEST(Collisions, ANearMissIsOneOnlyUnderTheClearance) {
  const Collisions near = collisions_of({"G1 Z21 F1000\nG1 X-24.5", "", clamp});
  ASSERT_EQ(near.list.size(), 1u);
  EXPECT_FALSE(near.list[0].contact);
  EXPECT_NEAR(near.list[0].distance, 0.5, 0.03);
  EXPECT_EQ(near.list[0].first.line, 7);
  EXPECT_EQ(near.list[0].worst.line, 7);
  // from where they are 1 mm apart to where they are nearest
  EXPECT_NEAR(near.list[0].worst.time_s - near.list[0].first.time_s, 0.5 / 1000 * 60, 5e-4);
  const Collisions slowly = collisions_of({"G1 Z21 F1000\nG1 X-24.2\nG1 X-24.5", "", clamp});
  ASSERT_EQ(slowly.list.size(), 1u);
  EXPECT_EQ(slowly.list[0].first.line, 7);
  EXPECT_EQ(slowly.list[0].worst.line, 8);
  EXPECT_EQ(slowly.list[0].first.time_s, near.list[0].first.time_s);
  const Collisions far =
      collisions_of({"G1 Z21 F1000\nG1 X-24.5", "", clamp + "[collision]\nclearance_mm = 0.4\n"});
  EXPECT_TRUE(far.list.empty());
}

TEST(Collisions, EveryShapeOfABodyIsMetWhereItIs) {
  struct Shape {
    const char* name;
    const char* keys;
    double x;  // where the cutter at z 21 meets it, mm, of the tip
  };
  // all reach up to x = -30 at the height of the ball's centre, z 26
  const SceneFolder folder;
  Eigen::MatrixX2d outline(4, 2);
  outline << -10, -10, 10, -10, 10, 10, -10, 10;
  const std::string mesh =
      folder.write("cube.stl", stl_text(cutting::extruded_mesh(outline, 15.0))).string();
  const std::vector<Shape> shapes = {
      {"box", "size_mm = [20, 20, 15]\nat_mm = [-40, -30, 27.5]", -25},
      {"cylinder", "radius_mm = 10\nheight_mm = 15\nat_mm = [-40, -30, 20]", -25},
      {"sphere", "radius_mm = 10\nat_mm = [-40, -30, 26]", -25},
      {"cone", "radius_below_mm = 10\nradius_above_mm = 10\nheight_mm = 15\nat_mm = [-40, -30, 20]",
       -25},
      {"revolution",
       "radii_mm = [5, 10, 10, 3]\nheights_mm = [0, 2, 12, 15]\nat_mm = [-40, -30, 20]", -25},
      {"extrusion",
       "x_mm = [-10, 10, 10, -10]\ny_mm = [-10, -10, 10, 10]\nheight_mm = 15\nat_mm = [-40, -30, "
       "20]",
       -25},
  };
  for (const Shape& shape : shapes) {
    const Collisions all =
        collisions_of({"G1 Z21 F1000\nG1 X-28", "",
                       fmt::format("[[fixture]]\nname = \"clamp\"\nshape = \"{}\"\n{}\n",
                                   shape.name, shape.keys)});
    const auto met = contacts_of(all);
    ASSERT_EQ(met.size(), 1u) << shape.name;
    EXPECT_NEAR(met[0].state.q[1], shape.x, 0.02) << shape.name;
    EXPECT_NEAR(met[0].depth, 3.0, 0.03) << shape.name;
  }
  const Collisions all =
      collisions_of({"G1 Z21 F1000\nG1 X-28", "",
                     "[[fixture]]\nname = \"clamp\"\nshape = \"mesh\"\nfile = \"" + mesh +
                         "\"\nat_mm = [-40, -30, 20]\n"});
  ASSERT_EQ(contacts(all), 1u);
  EXPECT_NEAR(all.list[0].depth, 3.0, 0.03);
}

/// The faults of a scene, one a line; empty where it is read.
std::string planted_errors(const PlantedCrash& planted) {
  return thrown_text<BadScene>([&] { planted_job(planted); });
}

TEST(Collisions, ANameThatTwoBodiesHaveIsRefused) {
  const auto fixture = [](const std::string& name) {
    return "[[fixture]]\n" + (name.empty() ? "" : "name = \"" + name + "\"\n") +
           "size_mm = [20, 20, 15]\nat_mm = [-40, -30, 27.5]\n";
  };
  const auto input_errors = [&](const std::string& more) {
    return planted_errors({"G1 Z90 F1000", "", more});
  };
  for (const char* own : {"part", "stock", "cutter", "shank", "holder"}) {
    const std::string text = input_errors(fixture(own));
    EXPECT_HAS(text, fmt::format("scene.toml:12:8: expected a unique name for a fixture, seen "
                                 "\"{0}\", the name of the {0} itself",
                                 own));
  }
  EXPECT_HAS(input_errors(fixture("ram")),
             "seen \"ram\", already the name of a body of the machine");
  EXPECT_HAS(input_errors(fixture("vice") + fixture("vice")), "scene.toml:16:8: ");
  EXPECT_HAS(input_errors(fixture("") + fixture("fixture")), "seen \"fixture\"");
  EXPECT_EQ(input_errors(fixture("vice") + fixture("jaw")), "");
  // without names of their own they are numbered
  EXPECT_EQ(input_errors(fixture("") + fixture("")), "");
  const Job two = planted_job({"G1 Z90 F1000", "", fixture("") + fixture("")});
  std::vector<std::string> names;
  for (const SolidBody& body : segment_bodies(two, two))
    if (body.kind == SolidBody::Kind::Fixture) names.push_back(body.name);
  EXPECT_EQ(names, (std::vector<std::string>{"fixture 1", "fixture 2"}));
  const std::vector<Override> twice = {
      {"machine.body",
       "[{ name = \"ram\", carried_by = \"Z\", size_mm = [1, 1, 1] }, "
       "{ name = \"ram\", size_mm = [1, 1, 1] }]"}};
  EXPECT_HAS(planted_errors({"G1 Z90 F1000", "", "", twice}),
             "expected a unique name for a body of the machine");
}

TEST(Collisions, APairToBeLeftOutMustBeThere) {
  const auto input_errors = [&](const char* a, const char* b) {
    return planted_errors(
        {"G1 Z90 F1000", "", fmt::format("[[collision.ignore]]\na = \"{}\"\nb = \"{}\"\n", a, b)});
  };
  EXPECT_EQ(input_errors("ram", "stock"), "");
  EXPECT_EQ(input_errors("holder", "part"), "");  // of another tool, perhaps
  const std::string text = input_errors("ram", "haulder");
  EXPECT_HAS(text, "scene.toml:13:5: expected the name of a body: table, base, ");
  EXPECT_HAS(input_errors("ram", "ram"), "expected the name of a body other than");
}

TEST(Collisions, AHolderThatCannotBeIsRefusedAndAnOddOneWarnedOf) {
  const auto with = [](const std::string& heights) {
    return PlantedCrash{"G1 Z90 F1000",
                        "[tool.holder]\nradii_mm = [15, 15, 20]\nheights_mm = " + heights + "\n"};
  };
  EXPECT_HAS(planted_errors(with("[-5, 60, 100]")), "a holder that begins 5 mm below the tip");
  EXPECT_HAS(planted_errors(with("[0, 60, 100]")), "a holder that begins at the tip");
  EXPECT_HAS(planted_errors(with("[60, 35, 100]")), "decreasing heights");
  const auto warned = [&](const std::string& heights, const std::string& words) {
    std::string all;
    for (const std::string& text : planted_job(with(heights)).warnings) all += text + "\n";
    return words.empty() ? all.find("the holder") == std::string::npos
                         : all.find(words) != std::string::npos;
  };
  EXPECT_TRUE(warned("[20, 60, 100]", ""));
  EXPECT_TRUE(warned("[15, 60, 100]",
                     "the holder begins 15 mm above the tip, 5 mm below the upper end of the flank "
                     "(flank_length_mm 20)"));
  EXPECT_TRUE(warned("[35, 60, 120]",
                     "ends 120 mm above the tip, 20 mm beyond the nose of the spindle (length_mm "
                     "100)"));
  EXPECT_TRUE(warned("[35, 60, 95]",
                     "5 mm short of the nose of the spindle (length_mm 100): the gap between them "
                     "is not checked"));
}

TEST(Collisions, BodiesThatCannotBeAreRefused) {
  const auto refused = [](const std::string& fixture) -> std::string {
    try {
      collisions_of({"G1 Z90 F1000", "", "[[fixture]]\nname = \"it\"\n" + fixture});
    } catch (const BadScene& input_errors) {
      return input_errors.input_errors.front().what();
    } catch (const BadInput& fault) {
      return fault.what();
    }
    return "accepted";
  };
  EXPECT_HAS(refused("size_mm = [20, 0, 30]\n"), "sizes above 0");
  EXPECT_HAS(refused("shape = \"sphere\"\nradius_mm = 0\n"), "radius_mm");
  EXPECT_HAS(refused("shape = \"cone\"\nradius_below_mm = 0\nradius_above_mm = 0\nheight_mm = 3\n"),
             "one radius above 0");
  EXPECT_HAS(refused("shape = \"revolution\"\nradii_mm = [3, 4]\nheights_mm = [5, 2]\n"),
             "decreasing heights");
  EXPECT_HAS(refused("shape = \"extrusion\"\nx_mm = [0, 0, 5]\ny_mm = [0, 5, 0]\nheight_mm = 3\n"),
             "counter-clockwise");
  EXPECT_HAS(refused("shape = \"ball\"\nradius_mm = 3\n"), "shape");
  const SceneFolder folder;
  cutting::ClosedMesh open = cutting::box_mesh({10, 10, 10});
  open.triangles.conservativeResize(open.triangles.rows() - 1, 3);
  const std::string file = folder.write("open.stl", stl_text(open)).string();
  EXPECT_HAS(refused("shape = \"mesh\"\nfile = \"" + file + "\"\n"), "closed");
  EXPECT_HAS(refused("shape = \"mesh\"\nfile = \"nothing.stl\"\n"), "nothing.stl");
}

TEST(Collisions, AMeshInMetresIsDoubted) {
  const SceneFolder folder;
  const std::string file =
      folder.write("m.stl", stl_text(cutting::box_mesh({0.3, 0.2, 0.1}))).string();
  const auto warnings = [&](const std::string& unit) {
    return collision_warnings(
        collisions_of({"G1 Z90 F1000", "",
                       "[[fixture]]\nname = \"vice\"\nshape = \"mesh\"\nfile = \"" + file +
                           "\"\nat_mm = [0, 300, 60]\n" + unit}));
  };
  const auto doubted = [](const std::vector<std::string>& texts) {
    for (const std::string& text : texts)
      if (text.find(
              "the mesh of fixture \"vice\", read in mm, is 0.3 x 0.2 x 0.1 mm, less than 1 mm: "
              "set fixture.unit (\"m\" for metres) for another unit, or fixture.any_size = true") !=
          std::string::npos)
        return true;
    return false;
  };
  EXPECT_TRUE(doubted(warnings("")));
  EXPECT_FALSE(doubted(warnings("unit = \"m\"\n")));
  EXPECT_FALSE(doubted(warnings("any_size = true\n")));
}

TEST(Collisions, TheReportHasThemAll) {
  const Collisions all = collisions_of({"G1 Z20 F1000\nG1 X18", holder});
  const nlohmann::ordered_json json = to_json(all);
  EXPECT_EQ(json["contacts"], 1);
  EXPECT_FALSE(json["clear"]);
  EXPECT_EQ(json["events"][0]["first"]["line"], 7);
  EXPECT_EQ(json["blocks"].size(), all.blocks.size());
  for (const auto& block : json["blocks"])
    if (!block[2].is_null()) {
      EXPECT_GE(block[2].get<double>(), 0.0);
    }
  EXPECT_HAS(to_text(all), "holder");
}

/// The smallest clearance of the block on a line, and whose it is.
std::string clearance_on(const Collisions& all, int line) {
  for (const BlockClearance& block : all.blocks) {
    if (block.place.line != line) continue;
    const Clearance& pair = all.clearances.at(std::size_t(block.pair));
    return fmt::format("{} - {} {:.2f}", pair.a, pair.b, block.min_clearance);
  }
  return "no block";
}

/// A blank beside which holder and cutter find room.
const char* const low_block =
    "[cutting]\nblank = \"box\"\nlower_mm = [-40, -50, 20]\nupper_mm = [0, -10, 80]\n"
    "spacing_mm = 0.5\n";

TEST(Collisions, EveryBlockWithAContactHasNoClearance) {
  const Collisions gouge = collisions_of({"G1 Z19 F500\nG1 X-10\nG1 Z100"});
  for (const int line : {6, 7, 8}) EXPECT_EQ(clearance_on(gouge, line), "part - cutter 0.00");
  // one block ends where the next begins
  for (std::size_t i = 1; i < gouge.blocks.size(); ++i)
    EXPECT_EQ(gouge.blocks[i].place.time_s, gouge.blocks[i - 1].end_s);
  const Collisions rapid = collisions_of({"G0 Z70\nG0 X0\nG0 Z100", "", low_block});
  EXPECT_EQ(clearance_on(rapid, 6), "cutter - stock 0.00");
  EXPECT_EQ(clearance_on(rapid, 7), "cutter - stock 0.00");
  EXPECT_NE(clearance_on(rapid, 8), "cutter - stock 0.00");
  const Collisions shank = collisions_of({"G1 Z46 F500\nG1 X-22\nG0 Z100", "", low_block});
  EXPECT_EQ(clearance_on(shank, 7), "shank - stock 0.00");
  const Collisions deep = collisions_of({"G1 Z46 F500\nG1 Z44\nG0 Z100", holder, low_block});
  EXPECT_EQ(clearance_on(deep, 7), "holder - stock 0.00");
  EXPECT_EQ(clearance_on(deep, 8), "holder - stock 0.00");
  // a near miss under 1 mm, 2 % or 0.01 mm less
  const Collisions near = collisions_of({"G1 Z45.5 F500\nG0 Z100", holder, low_block});
  EXPECT_EQ(contacts(near), 0u);
  EXPECT_EQ(clearance_on(near, 6), "holder - stock 0.49");
  EXPECT_EQ(clearance_on(near, 7), "holder - stock 0.49");
}

TEST(Collisions, EveryPairSaysInWhichBlocksItCounts) {
  const auto in_blocks = [](const Collisions& all) {
    std::string text;
    const nlohmann::ordered_json json = to_json(all);
    for (const auto& pair : json["pairs"]) {
      const auto a = pair["a"].get<std::string>(), b = pair["b"].get<std::string>();
      if (b != "stock" && a != "part" && a != "base") continue;
      if (a == "base" && b != "fork") continue;
      text += a + " " + b + " " + pair["in_blocks"].get<std::string>() + "\n";
    }
    return text;
  };
  const std::string text = in_blocks(collisions_of({"G0 Z70\nG0 X0\nG0 Z100", holder, low_block}));
  for (const char* line :
       {"base fork always\n", "part holder always\n", "part cutter where_met\n",
        "holder stock where_near\n", "cutter stock where_met\n", "shank stock where_met\n"})
    EXPECT_HAS(text, line);
}

TEST(Collisions, TheCutterMayBeLeftOutOfTheStock) {
  expect_no_contact({"G0 Z70\nG0 X0\nG0 Z100", "",
                     low_block + std::string("[[collision.ignore]]\na = \"cutter\"\nb = "
                                             "\"stock\"\n")});
}

TEST(Collisions, ARunThatIsToStopCutsNothing) {
  const Job job =
      planted_job({"G1 Z20 F1000\nG1 X18", holder, "[collision]\non = true\nstop = true\n"});
  const std::string text = thrown_text<CollisionStop>([&] { cut(job); });
  EXPECT_HAS(text, "stopped before cutting");
  EXPECT_HAS(text, "collision: part and holder collide, 3 mm deep at line 7, 7.660 s: line 7");
  EXPECT_HAS(text, "abbe check SCENE --collisions");
  const Job on = planted_job({"G1 Z20 F1000\nG1 X18", holder, "[collision]\non = true\n"});
  const Cut made = cut(on);
  ASSERT_TRUE(made.collisions);
  EXPECT_EQ(contacts(*made.collisions), 1u);
}

}  // namespace
}  // namespace abbe::sim
