#include "sim/cut/placement.h"
#include "sim/cut/cut.h"
#include "sim/cut/placement_suggestion.h"
#include "tests/sim/odd_scenes.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// The fault of a placement, empty for none.
std::string error_text(const Job& job) {
  const Placement found = placement(job);
  return found.fault ? found.fault->what() : "";
}

bool says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

/// A dome cut by a program of its own, which is then a file.
class Moved : public testing::Test {
 protected:
  Moved() {
    const Job job = job_of(BallRaster{.part = dome, .step_over = 1.0, .step = 1.0});
    folder_.write("p.ngc", job.program_text);
  }
  Job moved(const std::string& more, const std::string& at = "[0, 0, 80]") const {
    std::string text = to_toml(BallRaster{.part = dome, .more = more});
    text.replace(text.find("[0, 0, 80]"), 10, at);
    const std::size_t program = text.find("generator"), end = text.find("lead_deg");
    text.replace(program, text.find('\n', end) - program, "file = \"p.ngc\"");
    return prepare(read_scene(folder_.write("s.toml", text)));
  }
  const std::string dome =
      "surface = \"sphere_cap\"\nradius_mm = 60\nrim_radius_mm = 25\nvertices = 400\nat_mm = [0, "
      "0, "
      "80]\n";
  SceneFolder folder_;
};

TEST_F(Moved, AProgramThatFitsIsNotSpokenOf) {
  const Placement found = placement(moved(""));
  EXPECT_FALSE(found.fault);
  EXPECT_TRUE(found.warnings.empty()) << found.warnings.front();
}

TEST_F(Moved, TheGapOfADomeIsThatOfItsSurfaceNotOfItsBox) {
  // the cap is 5.5 mm high, so the box of a program 15 mm above overlaps nothing only just
  for (const double gap : {4.0, 15.0, 80.0}) {
    const Job job = moved(fmt::format("work_offset.G54 = {{ Z_mm = {} }}\n", gap));
    const std::string text = error_text(job);
    EXPECT_HAS(text, "; with G54 Z = ");
    const auto out = placement_suggestion(job);
    ASSERT_TRUE(out);
    const std::size_t at = out->words.find("Z = ");
    const double z = std::stod(out->words.substr(at + 4));
    std::cout << gap << " mm above: " << out->words << ", " << 100.0 * out->reach.reached_fraction
              << " % within reach\n";
    EXPECT_NEAR(z, 0.0, 0.01) << "the offset at which it was programmed";
    EXPECT_HAS(out->words, fmt::format("(now {:.6g})", gap));
    EXPECT_GT(out->reach.reached_fraction, 0.99);
  }
}

TEST_F(Moved, AProgramBelowIsRaisedUntilItsTipTouches) {
  const auto out = placement_suggestion(moved("work_offset.G54 = { Z_mm = -35 }\n"));
  ASSERT_TRUE(out);
  EXPECT_GT(out->reach.reached_fraction, 0.99);
  EXPECT_NEAR(std::stod(out->words.substr(out->words.find("Z = ") + 4)), 0.0, 0.01) << out->words;
}

TEST_F(Moved, AProgramThatTakesThePartAwayIsWarnedOfWithItsOffset) {
  const Placement found = placement(moved("work_offset.G54 = { Z_mm = -3 }\n"));
  ASSERT_EQ(found.warnings.size(), 1u);
  const std::string& text = found.warnings.front();
  EXPECT_HAS(text, "the program removes 100 % of the judged area more than 2 mm below");
  const std::string words = "; with G54 Z = ";
  ASSERT_TRUE(says(text, words)) << text;
  EXPECT_NEAR(std::stod(text.substr(text.find(words) + words.size())), 0.0, 0.01) << text;
}

TEST_F(Moved, AProgramBesideIsBroughtOverTheMiddle) {
  const Job job = moved("work_offset.G54 = { X_mm = 90, Y_mm = 0, Z_mm = 30 }\n");
  EXPECT_HAS(error_text(job), "mm away from the part, on its +x side; with G54 X = ");
  const auto out = placement_suggestion(job);
  ASSERT_TRUE(out);
  std::cout << out->words << ", " << 100.0 * out->reach.reached_fraction << " %\n";
  EXPECT_GT(out->reach.reached_fraction,
            0.95);  // the middle of its feed, run-ins with it, is 2.6 mm off
}

TEST_F(Moved, WhereTheOffsetLeavesTheTravelThePartIsMovedInstead) {
  const Job job = moved("", "[0, 0, -900]");
  const auto out = placement_suggestion(job);
  ASSERT_TRUE(out);
  EXPECT_HAS(out->words, "with part.at_mm = [0, 0, 80] it fits best");
  EXPECT_GT(out->reach.reached_fraction, 0.9);
}

TEST_F(Moved, APartThatIsCutInPlacesIsWarnedOfWithTheShare) {
  const Job job = moved("work_offset.G54 = { X_mm = 15 }\n");
  const Placement found = placement(job);
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_HAS(found.warnings.front(), "the program comes within 2 mm of ");
  EXPECT_TRUE(
      says(found.warnings.front(),
           "% of the judged area (403 vertices tested): its feed moves take the tip over x "))
      << found.warnings.front();
  // of the same vertices as they are cut
  const cutting::Surface surface = cut_error_free(job).surface;
  double cut = 0.0;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] != cutting::VertexStatus::Uncut) cut += job.design_w.area[Index(i)];
  const double share = cut / job.design_w.area.sum();
  EXPECT_LT(share, 0.9);
  EXPECT_HAS(found.warnings.front(), fmt::format("of {:.3g} %", 100.0 * share))
      << found.warnings.front() << "\n"
      << share;
}

TEST(Placement, TheFeedIsSaidFromWhereItBegins) {
  SceneFolder folder;
  std::string text = "G21 G90 G17 G94 G49\nS10000 M3\n";
  for (int y = -7; y <= 7; ++y) text += fmt::format("G0 X-20 Y{}\nG0 Z0\nG1 X0 F1000\nG0 Z80\n", y);
  folder.write("p.ngc", text + "M30\n");
  const Job job =
      prepare(read_scene(folder.write("s.toml", to_toml(FlatScene{.program = "p.ngc"}))));
  const Placement found = placement(job);
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_TRUE(
      says(found.warnings.front(),
           "its feed moves take the tip over x -20 to 0 mm of -5 to 5, y -7 to 7 mm of -5 to 5"))
      << found.warnings.front();
}

TEST_F(Moved, AProgramOfPositionsAndTimesNamesWhereThePartWouldHaveToStand) {
  std::string rows = "time_s,X_mm,Y_mm,Z_mm,X_mm_per_s,Y_mm_per_s,Z_mm_per_s\n";
  for (int i = 0; i <= 14; ++i) rows += fmt::format("{},{},0,50,1,0,0\n", i, i - 7);
  folder_.write("p.csv", rows);
  const Job job =
      prepare(read_scene(folder_.write("s.toml", to_toml(FlatScene{.program = "p.csv"}))));
  const std::string words = "the lowest cut is 50.0 mm above the part; with part.at_mm = [0, 0, ";
  const std::string text = error_text(job);
  ASSERT_TRUE(says(text, words)) << text;
  EXPECT_NEAR(std::stod(text.substr(text.find(words) + words.size())), 50.0, 0.01) << text;
}

/// On a machine with rotary axes an offset that is stated is a place in the workpiece; without one
/// the program counts from the zero of the axes, with the nose 50 mm above the table.
TEST(Placement, AnOffsetOfAMachineWithRotaryAxesIsAPlace) {
  SceneFolder folder;
  folder.write("p.ngc", to_nc({.z = 80}));
  std::string text = to_toml(FlatScene{.program = "p.ngc"});
  const std::string machine = "three_axis_table";
  text.replace(text.find(machine), machine.size(), "gantry_cxyza");
  const Job above = prepare(read_scene(folder.write("s.toml", text)));
  EXPECT_HAS(error_text(above), "; with G54 Z = 20 it fits best");
  const Job there =
      prepare(read_scene(folder.write("t.toml", text + "work_offset.G54 = { Z_mm = 20 }\n")));
  EXPECT_EQ(error_text(there), "");
}

/// Passes in several positions of the axes that turn, in words of the axes: an offset moves the
/// feed elsewhere in the workpiece in each of them.
TEST(Placement, AnIndexedProgramHasAnOffsetToo) {
  const auto fault_on = [](const std::string& machine, const std::string& turn, int z,
                           const std::string& more) {
    std::string text = "G21 G90 G17 G94 G49\nS10000 M3\n";
    for (const char* c : {"C0", "C90", "C180"}) {
      text += fmt::format("G0 Z100 {}40 {}\n", turn, c);
      for (int y = -20; y <= 20; y += 2)
        text += fmt::format("G0 X-20 Y{}\nG0 Z{}\nG1 X20 F1000\nG0 Z{}\n", y, z, z + 20);
    }
    SceneFolder folder;
    folder.write("p.ngc", text + "M30\n");
    std::string scene = to_toml(FlatScene{
        .program = "p.ngc",
        .part = "surface = \"sphere_cap\"\nradius_mm = 40\nrim_radius_mm = 30\nvertices = "
                "400\nat_mm = [0, 0, 60]\n",
        .more = more});
    scene.replace(scene.find("three_axis_table"), 16, machine);
    return error_text(prepare(read_scene(folder.write("s.toml", scene))));
  };
  for (const char* machine : {"gantry_cxyza", "trunnion_ca"})
    for (const int z : {40, 80}) {
      const std::string text = fault_on(machine, "A", z, "");
      std::cout << machine << " " << z << ": " << text << "\n";
      EXPECT_TRUE(says(text, "it touches") || says(text, "it fits best")) << text;
    }
  EXPECT_HAS(fault_on("trunnion_cb", "B", 80, ""), "; with ");
}

/// The number behind "X = " in words, 0 where it is not there.
double offset_in(const std::string& words, const char* axis) {
  const std::string name = std::string(" ") + axis + " = ";
  const auto at = words.find(name);
  return at == std::string::npos ? 0.0 : std::stod(words.substr(at + name.size()));
}

/// The wall is milled in steps from the top: the first cut that touches is not the one that fits.
TEST(Placement, TheOffsetOfAMovedWallIsThatAtWhichItWasProgrammed) {
  const auto wall = [](const Vector3d& moved) {
    return job_of("thin_wall.toml", {{"part.vertices", "500"},
                                     {"program.work_offset.G54",
                                      fmt::format("{{ X_mm = {}, Y_mm = {}, Z_mm = {} }}",
                                                  moved.x(), moved.y(), moved.z() - 20.0)}});
  };
  EXPECT_FALSE(placement(wall(Vector3d::Zero())).fault);
  EXPECT_TRUE(placement(wall(Vector3d::Zero())).warnings.empty());
  EXPECT_FALSE(placement_suggestion(wall(Vector3d::Zero()))) << "it fits already";
  // across the wall the cuts tell; along it and up the feed runs over its ends
  for (const Vector3d& moved :
       {Vector3d(0, -30, 0), Vector3d(0, 6, 0), Vector3d(0, -30, 8), Vector3d(45, -12, 0)}) {
    const auto out = placement_suggestion(wall(moved));
    ASSERT_TRUE(out) << moved.transpose();
    std::cout << moved.transpose() << ": " << out->words << ", "
              << 100.0 * out->reach.reached_fraction << " %\n";
    EXPECT_NEAR(offset_in(out->words, "Y"), 0.0, 0.002) << out->words;
    EXPECT_GT(out->reach.reached_fraction, 0.99) << out->words;
    EXPECT_HAS(out->words, "it fits best");
  }
}

TEST_F(Moved, TheOffsetOfAMovedDomeIsThatAtWhichItWasProgrammed) {
  for (const Vector3d& by : {Vector3d(0, 0, 30), Vector3d(0, 0, -3), Vector3d(90, 0, 30),
                             Vector3d(15, -20, 5), Vector3d(-12, 4, -6)}) {
    const Job job = moved(fmt::format("work_offset.G54 = {{ X_mm = {}, Y_mm = {}, Z_mm = {} }}\n",
                                      by.x(), by.y(), by.z()));
    const Placement found = placement(job);
    const std::string text = found.fault              ? found.fault->what()
                             : found.warnings.empty() ? ""
                                                      : found.warnings.front();
    std::cout << by.transpose() << ": " << text << "\n";
    ASSERT_TRUE(says(text, "it fits best")) << text;
    for (const auto& [axis, programmed] : {std::pair("X", 0.0), {"Y", 0.0}, {"Z", 0.0}})
      EXPECT_NEAR(offset_in(text.substr(text.find("; with G54")), axis), programmed, 0.05)
          << axis << " of " << text;
  }
}

/// The turned shaft of the library, its program moved across and along the spindle.
TEST(Placement, TheOffsetOfAMovedShaftIsThatAtWhichItWasProgrammed) {
  const auto shaft = [](double x, double z) {
    return job_of("stepped_shaft.toml",
                  {{"part.vertices", "1000"},
                   {"program.work_offset.G54", fmt::format("{{ X_mm = {}, Z_mm = {} }}", x, z)}});
  };
  const Placement fits = placement(shaft(0, 0));
  EXPECT_FALSE(fits.fault);
  EXPECT_TRUE(fits.warnings.empty()) << fits.warnings.front();
  EXPECT_FALSE(placement_suggestion(shaft(0, 0))) << "it fits already";
  for (const auto& [x, z] :
       {std::pair(3.0, 0.0), {-3.0, 0.0}, {7.0, 0.0}, {-1.5, 0.0}, {3.0, 60.0}}) {
    const auto out = placement_suggestion(shaft(x, z));
    ASSERT_TRUE(out) << x << " " << z;
    std::cout << x << " " << z << ": " << out->words << ", " << 100.0 * out->reach.reached_fraction
              << " %\n";
    EXPECT_NEAR(offset_in(out->words, "X"), 0.0, 0.002) << out->words;
    EXPECT_GT(out->reach.reached_fraction, 0.99) << out->words;
    EXPECT_HAS(out->words, "it fits best");
  }
  const Placement deep = placement(shaft(-3, 0));
  ASSERT_EQ(deep.warnings.size(), 1u);
  EXPECT_HAS(deep.warnings.front(), "; with G54 X = 0 (now -3) it fits best");
}

/// A dome is turned by an arc, so that both directions are determined.
TEST(Placement, TheOffsetOfAMovedTurnedDomeIsThatAtWhichItWasProgrammed) {
  SceneFolder folder;
  folder.write("p.ngc",
               "G8 G18 G21 G90 G94\nS1000 M3\nG0 X14.784 Z77.619\nG2 X0 Z83 I-14.784 K-17.619 "
               "F20\nG0 Z120\nM5\nM30\n");
  const auto dome = [&](double x, double z) {
    return prepare(read_scene(folder.write(
        "s.toml",
        fmt::format("machine = \"{}machines/lathe_zx.toml\"\n[tool]\nkind = \"nose\"\nradius_mm = "
                    "3\nlength_mm = 60\n[part]\nsurface = \"sphere_cap\"\nradius_mm = "
                    "20\nrim_radius_mm = 12\nvertices = 500\nat_mm = [0, 0, 80]\n[program]\nfile = "
                    "\"p.ngc\"\nwork_offset.G54 = {{ X_mm = {}, Z_mm = {} }}\n",
                    packaged("").string(), x, z))));
  };
  EXPECT_FALSE(placement(dome(0, 0)).fault);
  EXPECT_TRUE(placement(dome(0, 0)).warnings.empty());
  for (const auto& [x, z] :
       {std::pair(0.0, 30.0), {0.0, -3.0}, {0.0, 5.0}, {4.0, 0.0}, {3.0, 12.0}}) {
    const auto out = placement_suggestion(dome(x, z));
    ASSERT_TRUE(out) << x << " " << z;
    std::cout << x << " " << z << ": " << out->words << ", " << 100.0 * out->reach.reached_fraction
              << " %\n";
    EXPECT_NEAR(offset_in(out->words, "X"), 0.0, 0.05) << out->words;
    EXPECT_NEAR(offset_in(out->words, "Z"), 0.0, 0.05) << out->words;
    EXPECT_HAS(out->words, "it fits best");
  }
}

TEST(Placement, APartWithTooFewVerticesIsSaidToHaveTooFew) {
  SceneFolder folder;
  folder.write("part.stl",
               "solid part\nfacet normal 0 0 1\nouter loop\nvertex -50 -50 0\nvertex 50 "
               "-50 0\nvertex 50 50 0\nendloop\nendfacet\nfacet normal 0 0 1\nouter "
               "loop\nvertex -50 -50 0\nvertex 50 50 0\nvertex -50 50 0\nendloop\n"
               "endfacet\nendsolid part\n");
  folder.write("p.ngc", to_nc({.z = 0}));
  const auto fault_with = [&](const std::string& sampling) {
    return error_text(prepare(read_scene(folder.write(
        "s.toml", to_toml(FlatScene{
                      .program = "p.ngc",
                      .part = "file = \"part.stl\"\nunit = \"mm\"\nopen = true\n" + sampling})))));
  };
  const std::string text = fault_with("sampling = \"vertices\"\n");
  EXPECT_HAS(text,
             "part.stl: expected at least 10 judged vertices, at most a cutter diameter (10 "
             "mm) apart, seen 4 judged vertices, up to 141.4 mm apart, none of them cut");
  EXPECT_EQ(fault_with(""), "");
}

TEST(Placement, EveryOffsetThatTheProgramUsesIsNamed) {
  SceneFolder folder;
  folder.write("p.ngc", to_nc({.z = 80, .middle = "G55\n"}));
  const Job job = prepare(read_scene(folder.write(
      "s.toml",
      to_toml(FlatScene{.program = "p.ngc", .more = "work_offset.G55 = { Z_mm = 5 }\n"}))));
  // to 5 um: of offsets as good, the one that leaves the least of the rim uncut
  const std::string text = error_text(job);
  EXPECT_NEAR(offset_in(text.substr(text.find("G54")), "Z"), -80.0, 0.005) << text;
  EXPECT_NEAR(offset_in(text.substr(text.find("G55")), "Z"), -75.0, 0.005) << text;
  EXPECT_HAS(text, "(now 5) it fits best");
}

/// An STL of triangles.
std::string stl_of(const std::vector<std::array<Vector3d, 3>>& triangles) {
  std::string text = "solid part\n";
  for (const auto& triangle : triangles) {
    const Vector3d n = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalized();
    text += fmt::format("facet normal {} {} {}\nouter loop\n", n.x(), n.y(), n.z());
    for (const Vector3d& p : triangle)
      text += fmt::format("vertex {} {} {}\n", p.x(), p.y(), p.z());
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid part\n";
}

/// A mesh in the work zero of a three-axis machine.
class MeshUnderProgram : public testing::Test {
 protected:
  Job job(const std::string& tool, const std::string& part, const std::string& program) const {
    folder_.write("p.ngc", "G21 G90 G17 G94\nG54\nT1 M6\nS9000 M3\nG43 H1\n" + program + "M30\n");
    return prepare(read_scene(folder_.write(
        "s.toml",
        fmt::format("machine = \"{}machines/three_axis_table.toml\"\n[tool]\n{}length_mm = 100\n"
                    "number = 1\n[part]\nfile = \"part.stl\"\nunit = \"mm\"\n{}[program]\n"
                    "file = \"p.ngc\"\nwork_offset.G54 = {{ Z_mm = -100 }}\n",
                    packaged("").string(), tool, part))));
  }
  SceneFolder folder_;
};

/// The wall of a hole of R 3 mm, 12 mm deep, that a flat end mill of R 3 mm leaves by four pecks.
TEST_F(MeshUnderProgram, ARapidCutsOnlyWhatTheFeedHasLeft) {
  std::vector<std::array<Vector3d, 3>> wall;
  const auto at = [](int k, double z) {
    return Vector3d(3 * std::cos(units::full_turn * (k % 24) / 24),
                    3 * std::sin(units::full_turn * (k % 24) / 24), z);
  };
  for (int ring = 0; ring < 12; ++ring)
    for (int k = 0; k < 24; ++k) {
      const Vector3d a = at(k, -ring), b = at(k + 1, -ring), c = at(k, -ring - 1),
                     d = at(k + 1, -ring - 1);
      wall.push_back({a, b, c});
      wall.push_back({b, d, c});
    }
  folder_.write("part.stl", stl_of(wall));
  const auto program_warnings = [&](const std::string& program) {
    const Job hole = job("kind = \"flat\"\nradius_mm = 3\nflank_length_mm = 30\n",
                         "open = true\nsampling = \"vertices\"\n", program + "G0 Z60\n");
    std::string text;
    for (const std::string& warning : cut_error_free(hole).warnings) text += warning + "\n";
    return text;
  };
  // Each peck but the first comes down in rapid to 0.5 mm above the bottom so far.
  const auto warnings = [&](int rapid_peck) {
    std::string program = "G0 X0 Y0 Z5\n";
    for (int peck = 1; peck <= 4; ++peck)
      program += fmt::format("G0 Z{}\nG{} Z{} F300\nG0 Z5\n", peck == 1 ? 1.0 : 3.5 - 3 * peck,
                             peck == rapid_peck ? 0 : 1, -3 * peck);
    return program_warnings(program);
  };
  EXPECT_FALSE(says(warnings(0), "rapid")) << warnings(0);
  // Feeds and rapids of a cycle are on one line.
  const std::string cycle = program_warnings("G0 X0 Y0 Z5\nG98 G83 X0 Y0 Z-12 R1 Q3 F300\nG80\n");
  EXPECT_FALSE(says(cycle, "rapid")) << cycle;
  for (int peck = 1; peck <= 4; ++peck)
    EXPECT_TRUE(
        says(warnings(peck), fmt::format("are cut by rapid moves, first line {}", 3 * peck + 5)))
        << warnings(peck);
  EXPECT_TRUE(says(warnings(4), "72 of 312 judged vertices (23.1 %)")) << warnings(4);
}

TEST_F(MeshUnderProgram, APlateThatIsMilledFromAboveIsNotSentElsewhere) {
  std::vector<std::array<Vector3d, 3>> box;
  const auto face = [&](const Vector3d& p, const Vector3d& u, const Vector3d& v) {
    box.push_back({p, p + u, p + u + v});
    box.push_back({p, p + u + v, p + v});
  };
  const Vector3d x = 20 * Vector3d::UnitX(), y = 20 * Vector3d::UnitY(), z = 10 * Vector3d::UnitZ();
  const Vector3d low = -0.5 * (x + y) - z;
  face(low + z, x, y);
  face(low, y, x);
  face(low, x, z);
  face(low + y, z, x);
  face(low, z, y);
  face(low + x, y, z);
  folder_.write("part.stl", stl_of(box));
  std::string program;
  for (double row = -11; row <= 11; ++row)
    program += fmt::format("G0 X-16 Y{0}\nG0 Z5\nG1 Z0 F500\nG1 X16 F1000\nG0 Z60\n", row);
  const Placement found = placement(job("kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 8\n",
                                        "sampling = \"spacing\"\nspacing_mm = 1\n", program));
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_FALSE(says(found.warnings.front(), "; with")) << found.warnings.front();
}

}  // namespace
}  // namespace abbe::sim
