#include <nlohmann/json.hpp>
#include "sim/commands/program_commands.h"
#include "sim/compensation/correct.h"
#include "sim/cut/part.h"
#include "sim/files/output.h"
#include "sim/loop/correction_channels.h"
#include "sim/program/program_writers.h"
#include "sim/scene/read_scene.h"
#include "tests/safety/program_run.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

using kinematics::Pose;
using nlohmann::json;
using safety::Folder;
using safety::Ran;
using safety::run;

const std::string finish =
    (safety::source / "tests/golden/cl_five_axis_finish/program.nc").string() + " --dialect cl";

json json_of(const std::string& arguments, const std::string& before = "") {
  const Ran ran =
      safety::shell("(" + before + ABBE_PROGRAM + " program " + arguments + " --json 2>/dev/null)");
  return json::parse(ran.text, nullptr, false);
}

TEST(ProgramCommand, SaysWhatAProgramAsksOfAMachine) {
  const json all = json_of(finish);
  ASSERT_TRUE(all.is_object());
  EXPECT_EQ(all["dialect"], "cl");
  EXPECT_EQ(all["machine"], "gantry CXYZA");
  EXPECT_EQ(all["moves"], 82);
  EXPECT_EQ(all["arcs"]["count"], 7);
  EXPECT_EQ(all["tools"][0]["number"], 1);
  EXPECT_EQ(all["tip_mode_blocks"], 82);
  // from home: Z at 340 mm, the nose 50 mm above the table at zero, the tool 100 mm long
  EXPECT_NEAR(all["extent_mm"]["Z"][1].get<double>(), 290.0, 1e-9);
  // the highest point at feed is the last of the retracts along the tool
  EXPECT_NEAR(all["extent_at_feed_mm"]["Z"][1].get<double>(), 60.9361, 1e-9);
  // A leads by 36 deg; the feed moves come no nearer to the pole than the least lean of the tool
  const double angle = all["singular"]["angle_deg"];
  EXPECT_NEAR(angle, std::abs(all["singular"]["axes"]["A"].get<double>()), 1e-9);
  EXPECT_GT(angle, 20.0);
  EXPECT_GT(all["time_by_axis_limits_s"], 0.0);
  EXPECT_GT(all["axes"]["Z"]["travel_left"], 0.0);
  bool counted = false;
  for (const json& word : all["words"])
    counted = counted || (word["word"] == "GOTO" && word["use"] == "read" && word["count"] == 82);
  EXPECT_TRUE(counted) << all["words"];
  const Ran text = run("program " + finish);
  EXPECT_EQ(text.code, 0) << text.text;
  for (const char* one : {"gantry CXYZA", "82 moves", "travel left", "singular", "T1, called once",
                          "describes a tool of 10 mm with a corner radius of 5 mm"})
    EXPECT_HAS(text.text, one);
}

TEST(ProgramCommand, ConvertsAndReadsWhatItWroteToTheSameFigures) {
  const Folder folder;
  const json was = json_of(finish);
  for (const auto& [format, file, options] : {std::tuple{"cl", "program.cls", ""},
                                              {"nc", "program.ngc", ""},
                                              {"csv", "program.csv", " --dialect cl"},
                                              {"pvt", "program.pvt", ""}}) {
    SCOPED_TRACE(format);
    const std::string out = (folder.path() / format).string();
    const json written = json_of(finish + " --to " + format + " --out " + out);
    ASSERT_TRUE(written.is_object());
    ASSERT_TRUE(fs::exists(fs::path(out) / file));
    const json again = json_of((fs::path(out) / file).string() + options);
    ASSERT_TRUE(again.is_object()) << run("program " + (fs::path(out) / file).string()).text;
    for (const char* axis : {"X", "Y", "Z"})
      for (const int end : {0, 1}) {
        const double a = was["extent_at_feed_mm"][axis][end];
        const double b =
            again[std::string(format) == "pvt" ? "extent_mm" : "extent_at_feed_mm"][axis][end];
        if (std::string(format) != "pvt") {
          EXPECT_NEAR(a, b, 0.011) << axis;
        }
      }
    EXPECT_NEAR(was["time_s"].get<double>(), again["time_s"].get<double>(),
                1e-4 * was["time_s"].get<double>());
  }
}

TEST(ProgramCommand, WorkOffsetsAndTheToolShiftWhatTheAxesDo) {
  const Folder folder;
  folder.write("p.ngc", "G21 G90 G94 G54\nG43 H1\nG0 X10 Z60\nG1 X20 F1000\n");
  const std::string file = (folder.path() / "p.ngc").string();
  const json plain = json_of(file);
  const json moved = json_of(file + " --offset \"X=5 Z=10\" --tool-length 80");
  EXPECT_EQ(plain["axes"]["Z"]["from"], 160.0);
  // the nose stands 50 mm above the table with Z at zero
  EXPECT_EQ(moved["axes"]["Z"]["from"], 60.0 + 10.0 - 50.0 + 80.0);
  EXPECT_EQ(moved["axes"]["X"]["to"], 25.0);
  // an offset is a place in the workpiece
  EXPECT_NEAR(moved["extent_at_feed_mm"]["Z"][0].get<double>(), 70.0, 1e-12);
  EXPECT_EQ(run("program " + file + " --offset Q=5").code, 3);
}

TEST(ProgramCommand, TurningProgramsAreReadOnMachinesWhoseWorkpieceSpins) {
  const Folder folder;
  folder.write("turn.nc",
               "O10\nG18 G21 G40 G99\nG50 S2000\nT0101\nG96 S180 M03\nG00 X54. Z12.\n"
               "G01 Z2. F0.2\nX60.\nG00 X80. Z50.\nM30\n");
  const std::string file = (folder.path() / "turn.nc").string();
  const json all = json_of(file + " --machine library:lathe_zx");
  ASSERT_TRUE(all.is_object());
  EXPECT_EQ(all["control"], "turning");
  // 10 mm along at the radius 27 and 3 mm outwards to 30, 0.2 mm a turn at 180 m/min
  const double pi = std::acos(-1.0), f_v = 0.2 * 180e3 / 60;
  const double expected = (10 * 2 * pi * 27 + pi * (30.0 * 30.0 - 27.0 * 27.0)) / f_v;
  EXPECT_NEAR(all["lines_at_feed"]["time_s"].get<double>(), expected, 1e-9);
  EXPECT_NEAR(all["radius_at_feed_mm"][0].get<double>(), 27.0, 1e-9)
      << "whatever the tool's length";
  EXPECT_NEAR(all["radius_at_feed_mm"][1].get<double>(), 30.0, 1e-9);
  EXPECT_EQ(all["axes"]["X"]["to"], 40.0 + 40.0) << "a tool of 100 mm is 40 mm longer than X0";
  const Ran text = run("program " + file + " --machine library:lathe_zx --tip 3 --tool-radius 0.8");
  EXPECT_EQ(text.code, 0) << text.text;
  EXPECT_HAS(text.text, "27.8 .. 30.8 mm from the spindle line");
  for (const std::string& mill : {file + " --machine library:three_axis_table",
                                  file + " --machine library:lathe_zx --control milling"}) {
    const Ran refused = run("program " + mill);
    EXPECT_EQ(refused.code, 3);
    EXPECT_HAS(refused.text, "turn.nc:3:1: expected a program for a milling control");
    EXPECT_EQ(std::count(refused.text.begin(), refused.text.end(), '\n'), 1) << refused.text;
  }
}

TEST(ProgramCommand, LeavingTheTravelEndsWithThreeAndTheFigures) {
  const Folder folder;
  folder.write("far.ngc", "G21 G90 G94\nG0 X280\nG1 X350 F1000\nX-20\n");
  const std::string file = (folder.path() / "far.ngc").string();
  const Ran ran = run("program " + file);
  EXPECT_EQ(ran.code, 3);
  EXPECT_HAS(ran.text, "X exceeds its travel of -300 to 300 mm by 50, on line 3 with 350");
  EXPECT_HAS(ran.text, "time ") << "the figures come all the same";
}

TEST(ProgramCommand, FaultsOfUsageAndInputLeaveNoFiles) {
  const Folder folder;
  folder.write("bad.ngc", "G21\nG12.1 X1\nG1 X1\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  const Ran bad = run("program bad.ngc --to cl --picture --out made", at);
  EXPECT_EQ(bad.code, 3);
  EXPECT_HAS(bad.text, "bad.ngc:2:1: expected a G code");
  EXPECT_FALSE(fs::exists(folder.path() / "made"));
  EXPECT_EQ(run("program none.ngc", at).code, 3);
  EXPECT_EQ(run("program bad.ngc --machine gantri", at).code, 3);
  EXPECT_HAS(run("program bad.ngc --machine gantry_cxyz", at).text, "gantry_cxyza")
      << "the nearest of the library is named";
  EXPECT_EQ(run("program bad.ngc --to dxf", at).code, 2);
  EXPECT_EQ(run("program bad.ngc --tolerance-um 0", at).code, 2);
  EXPECT_EQ(run("program", at).code, 2);
  const Ran skipped = run("program bad.ngc --skip-unknown", at);
  EXPECT_HAS(skipped.text, "no axis words with a code that is skipped");
}

TEST(ProgramCommand, CountsWithTheTablesOfAControl) {
  const Folder folder;
  folder.write("p.ngc", "G21 G90 G94 G55\nT1 M6\nG43 H1\nG0 Z5\nT2 M6\nG43 H2\nG0 Z7\nG49\nM2\n");
  folder.write("t.tbl", "T1 Z80 D10\nT2 Z120.5 D6\n");
  folder.write("o.var", "5221 0\n5243 -250\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  const std::string words = "p.ngc --machine three_axis_table --offsets o.var --unit mm";
  const json all = json_of(words + " --tools t.tbl", at);
  ASSERT_TRUE(all.is_object());
  // the slide stands at offset + length + word, from home at 390 mm
  EXPECT_NEAR(all["axes"]["Z"]["to"].get<double>(), 390.0, 1e-9) << all["axes"]["Z"];
  EXPECT_NEAR(all["axes"]["Z"]["from"].get<double>(), -250 + 80 + 5, 1e-9);
  EXPECT_EQ(all["tool_table"], "t.tbl");
  const Ran text = run("program " + words + " --tools t.tbl", at);
  EXPECT_HAS(text.text, "tools of t.tbl");
  EXPECT_EQ(run("program " + words + " --tools t.tbl --to cl", at).code, 2);
  EXPECT_EQ(run("program " + words + " --offset X=1", at).code, 2);
  folder.write("t.tbl", "T1 Z80 D10\n");
  const Ran missing = run("program " + words + " --tools t.tbl", at);
  EXPECT_EQ(missing.code, 3);
  EXPECT_HAS(missing.text, "p.ngc:5:1: expected a tool of the tool table");
  folder.write("t.tbl", "T1 Z80 Q\n");
  EXPECT_HAS(run("program " + words + " --tools t.tbl", at).text, "t.tbl:1:9: expected");
}

TEST(ProgramCommand, NamesOffsetsAsTheControlDoes) {
  const Folder folder;
  const std::string at = "cd " + folder.path().string() + " && ";
  folder.write("o.var", "5221 0\n5341 7\n5361 8\n");
  folder.write("o.nc", "G21\nG10 L2 P1 X1.\nG10 L20 P2 X2.\n");
  folder.write("o.ufr",
               "%_N_UFR1_INI\n$P_UIFR[5,X,TR]=5\n$P_UIFR[7,X,TR]=7\n"
               "$P_UIFR[20,Z,RT]=5 $P_UIFR[8,X,TR]=8\n$P_UIFR[21,B,TR]=5\n");
  folder.write("o.pr", "BEGIN P .PR MM\nNR  X   ROT\n1   1   0\n7   7   0\n12  5   5\n[END]\n");
  struct Case {
    const char *table, *program, *dialect;
    std::vector<std::string> names, warned;
  };
  const std::string no_zero = "it is zero unless the program sets it";
  const Case cases[] = {
      {"o.var --unit mm",
       "G90 G59.1\nG0 X1\nG59.2\nG0 X2\nG55\nG0 X3\nG53 G0 X0\n",
       "linuxcnc",
       {"G59.1", "G59.2", "G55", "none"},
       {"o.var does not define G55, which the program calls: " + no_zero}},
      {"o.nc",
       "G90 G54\nG0 X1.\nG54.1 P2\nG0 X2.\nG54.1 P3\nG0 X3.\n",
       "fanuc",
       {"G54", "G54.1 P2", "G54.1 P3"},
       {"o.nc does not define G54.1 P3, which the program calls: " + no_zero}},
      {"o.ufr --unit mm",
       "G505 G0 X1\nG507\nG0 X2\nG500\nG0 X3\nG508\nG0 X4\n",
       "siemens",
       {"G505", "G507", "none", "G508"},
       {"o.ufr has nonzero values that are not used: offsets after the sixth that cannot be read "
        "(1)",
        "o.ufr: left out, because they are for axes that this machine does not have: G521"}},
      {"o.pr",
       "BEGIN PGM P MM\nTOOL CALL 1 Z S100\nPRESET SELECT #7\nL X+1 FMAX\n"
       "PRESET SELECT #2\nL X+2 FMAX\nEND PGM P MM\n",
       "heidenhain",
       {"preset 7", "preset 2"},
       {"o.pr has nonzero values that are not used: offsets after the sixth that cannot be read "
        "(1)",
        "o.pr does not define preset 2, which the program calls: " + no_zero}},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.dialect);
    folder.write("p.txt", one.program);
    const std::string words =
        std::string("p.txt --machine gantry_cxyza --dialect ") + one.dialect + " --offsets ";
    const json all = json_of(words + one.table, at);
    ASSERT_TRUE(all.is_object()) << run("program " + words + one.table, at).text;
    std::set<std::string> names;
    for (const auto& [name, blocks] : all["offsets"].items()) names.insert(name);
    EXPECT_EQ(names, std::set<std::string>(one.names.begin(), one.names.end()));
    for (const std::string& text : one.warned) {
      bool found = false;
      for (const json& warning : all["warnings"]) found = found || warning == text;
      EXPECT_TRUE(found) << text << " in " << all["warnings"];
    }
    const Ran said = run("program " + words + one.table, at);
    EXPECT_HAS(said.text, "offsets   as o.");
  }
  // of another control
  folder.write("p.txt", "G90 G54\nG0 X1.\n");
  const json foreign =
      json_of("p.txt --machine gantry_cxyza --dialect fanuc --offsets o.var --unit mm", at);
  bool found = false;
  for (const json& warning : foreign["warnings"])
    found = found || warning == "o.var is a linuxcnc table, but the program is read as fanuc";
  EXPECT_TRUE(found) << foreign["warnings"];
  // what is turned is refused where it is called
  folder.write("p.txt", "G520\nG0 X1\n");
  EXPECT_HAS(
      run("program p.txt --machine gantry_cxyza --dialect siemens --offsets o.ufr --unit mm", at)
          .text,
      "p.txt:1:1: expected G54 to G57, G505 or G506, or an offset from the "
      "control's table (`offsets`): $P_UIFR[20], seen G520");
}

TEST(ProgramCommand, ConvertedToNcNeedsNoOffsetsAgain) {
  const Folder folder;
  const std::string at = "cd " + folder.path().string() + " && ";
  folder.write("p.ngc", "G21 G90 G94 G59.1\nG43 H1\nG0 X1 Y2 Z30\nG1 X4 F100\nM2\n");
  folder.write("o.var", "5341 10\n5342 20\n5343 30\n");
  const std::string machine = " --machine gantry_cxyza";
  for (const std::string& offsets : {std::string(" --offsets o.var --unit mm"), std::string()}) {
    const json before = json_of("p.ngc" + machine + offsets, at);
    ASSERT_TRUE(before.is_object());
    ASSERT_EQ(run("program p.ngc" + machine + offsets + " --to nc --out again", at).code, 0);
    const json after = json_of("again/p.ngc" + machine, at);
    ASSERT_TRUE(after.is_object());
    for (const char* axis : {"X", "Y", "Z"})
      for (const char* end : {"from", "to"})
        EXPECT_NEAR(after["axes"][axis][end].get<double>(), before["axes"][axis][end].get<double>(),
                    1e-5)
            << axis << " " << end << offsets;
  }
}

TEST(ProgramCommand, LongProgramsAreMeteredPieceByPiece) {
  const Folder folder;
  constexpr int moves = 70'001;  // more than two pieces
  std::string text = "G21 G90 G94 G43.4 H1\nG1 X0 Y0 Z0 F1000\n";
  for (int i = 1; i <= moves; ++i) text += i % 2 == 0 ? "X0\n" : "X0.5\n";
  folder.write("long.ngc", text + "M2\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  const std::string words = "long.ngc --machine gantry_cxyza";
  const json all = json_of(words, at);
  ASSERT_TRUE(all.is_object());
  EXPECT_EQ(all["moves"], moves + 1);
  EXPECT_NEAR(all["extent_at_feed_mm"]["X"][1].get<double>(), 0.5, 1e-12);
  EXPECT_EQ(run("program " + words + " --to csv --out table", at).code, 0);
  std::ifstream in(folder.path() / "table" / "long.csv");
  const std::string table{std::istreambuf_iterator<char>(in), {}};
  EXPECT_GE(std::count(table.begin(), table.end(), '\n'), moves + 1);
}

/// Points of a written table that lie on a circle about the origin, in its X and Y columns.
std::vector<std::array<double, 2>> points_on_circle(const fs::path& file, int x_column,
                                                    double radius) {
  std::vector<std::array<double, 2>> points;
  std::ifstream in(file);
  std::string line, cell;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::array<double, 2> point{};
    for (int column = 0; column < x_column; ++column) std::getline(cells, cell, ',');
    for (double& coordinate : point) {
      std::getline(cells, cell, ',');
      coordinate = std::stod(cell);
    }
    if (std::abs(std::hypot(point[0], point[1]) - radius) < 1e-6) points.push_back(point);
  }
  return points;
}

TEST(ProgramCommand, WritesAsManyPointsOfAMoveAsItsToleranceNeeds) {
  constexpr double radius = 60.325, tolerance_um = 1.0;
  constexpr int turns = 300;
  const Folder folder;
  folder.write("turns.ngc", "G21 G90 G17 G94 G54\nG0 X60.325 Y0 Z0\nG2 X60.325 Y0 I-60.325 J0 P" +
                                std::to_string(turns) + " F500\nM2\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  for (const std::string format : {"csv", "pvt"}) {
    SCOPED_TRACE(format);
    const Ran ran = run("program turns.ngc --machine three_axis_table --to " + format +
                            " --tolerance-um 1 --force --out table",
                        at);
    ASSERT_EQ(ran.code, 0) << ran.text;
    const auto points =
        points_on_circle(folder / ("table/turns." + format), format == "pvt" ? 1 : 0, radius);
    ASSERT_GT(points.size(), 100'000u) << "where a limit of points once cut the tolerance";
    double turned = 0.0, worst_um = 0.0;
    for (std::size_t i = 1; i < points.size(); ++i) {
      const auto &a = points[i - 1], &b = points[i];
      turned += std::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
      const double middle = std::hypot(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
      worst_um = std::max(worst_um, 1e3 * (radius - middle));
    }
    std::cout << format << ": " << points.size() << " points, chords off by " << worst_um
              << " um\n";
    EXPECT_NEAR(turned / (2.0 * std::numbers::pi), -turns, 1e-6);
    EXPECT_LE(worst_um, tolerance_um + 1e-3) << "and the rounding of words";
    EXPECT_GT(worst_um, 0.9 * tolerance_um) << "no more points than it needs";
  }
}

#if ABBE_RENDER
TEST(ProgramCommand, DrawsMachineAndPath) {
  const Folder folder;
  const std::string out = (folder.path() / "drawn").string();
  const Ran ran = run("program " + finish + " --picture --out " + out);
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_GT(fs::file_size(fs::path(out) / "path.png"), 10000u);
}
#endif

// Compensated programs written by the program channel and by `abbe rewrite`, held against
// corrections made afresh at every sample of what was written.

/// A program of long lines and arcs on the gantry with its typical errors, just above the part.
fs::path long_moves(const SceneFolder& folder, const std::string& program) {
  const std::string scenes = packaged("").string();
  folder.write("long.ngc", program);
  return folder.write("long.toml", fmt::format("machine = \"{0}machines/gantry_cxyza.toml\"\n"
                                               "errors = \"{0}errors/gantry_typical.toml\"\n"
                                               "tool = \"{0}tools/ball_r5.toml\"\n"
                                               "[part]\nsurface = \"sphere_cap\"\nradius_mm = 100\n"
                                               "rim_radius_mm = 50\nat_mm = [0, 0, 119]\n"
                                               "vertices = 200\n"
                                               "[program]\nfile = \"long.ngc\"\n",
                                               scenes));
}

const std::string tip_program =
    "G21 G94 G43.4 H1\nS8000 M3\nG0 X-80 Y-40 Z120 A20 C0\nG1 X90 Y30 F2000\nG1 X-60 Z140 A35 "
    "C120\n"
    "G17 G3 X60 Y30 I60 J0 A20\nG1 X-60 Y30 F900\nM5\nM30\n";
const std::string axis_program =
    "G21 G94 G49\nG0 X-80 Y-40 Z60 A10\nG1 X90 Y30 F2000\nG93 G1 X-60 Z90 A15 C90 F6\nG94 G17 G2 "
    "X40 Y30 "
    "R70 F1500\nG18 G3 X-20 Z90 R50\nG1 X-120 F900\nM30\n";

const std::vector<Override> fine_words = {{"compensation.word_resolution_mm", "0.000001"},
                                          {"compensation.angle_resolution_deg", "0.000001"}};

std::vector<Override> with_tolerance(std::vector<Override> changes, double um) {
  changes.emplace_back("compensation.path_tolerance_um", fmt::format("{}", um));
  return changes;
}

/// Largest distance, tip or tool at `reach`, between what the axes are commanded and a perfect
/// iterated correction made at that sample, jumps and rapids left out.
double off_corrected(const Job& job, const Commands& commanded, double reach) {
  const Truth truth = without_random_errors(job.truth);
  compensation::CorrectOptions options;
  options.rotary_bound = job.scene.compensation.rotary_bound;
  if (const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal))
    options.functional_height = cutter->corner_radius;
  if (const auto spindle = job.machine.workpiece_spindle)
    options.fixed_joints.set(std::size_t(*spindle));
  double most = 0.0;
  for (std::size_t i = 0; i < commanded.samples.states.size(); ++i) {
    const program::Block& block = commanded.path->blocks[std::size_t(commanded.samples.block[i])];
    if (block.interpolation == program::Interpolation::Rapid) continue;
    const kinematics::AxisState& state = commanded.samples.states[i];
    const auto ideal = compensation::correct(
        job.machine.control, [&](const auto& at) { return tool_in_workpiece(truth, at); },
        commanded.T_wt_nominal[i], state, options);
    const Pose a = job.machine.control.tool_in_workpiece(state.q);
    const Pose b = job.machine.control.tool_in_workpiece(ideal.q);
    const Vector3d tip = a.translation() - b.translation();
    const Vector3d turn = a.linear().col(2) - b.linear().col(2);
    most = std::max({most, tip.norm(), (tip + reach * turn).norm()});
  }
  return most;
}

TEST(RewrittenProgram, KeepsWithinItsToleranceOfTheCorrectedPath) {
  for (const std::string& program : {tip_program, axis_program}) {
    const SceneFolder folder;
    const fs::path file = long_moves(folder, program);
    int blocks = std::numeric_limits<int>::max();
    for (const double um : {0.05, 0.5, 5.0}) {
      const Job job = prepare(read_scene(file, with_tolerance(fine_words, um)));
      const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
      const double reach = sample_options(job.scene, job.machine).reach;
      const double off = off_corrected(job, commanded, reach);
      std::cout << job.path.motion_blocks << " blocks, tolerance " << um << " um: off by at most "
                << off / units::um << " um in " << commanded.path->motion_blocks << " blocks\n";
      // words of a nanometre and 1e-6 deg at 0.5 m, what the samples leave between them
      EXPECT_LE(off, um * units::um + 0.02_um);
      EXPECT_LT(commanded.path->motion_blocks, blocks);
      blocks = commanded.path->motion_blocks;
    }
  }
}

TEST(RewrittenProgram, WithNothingToCorrectIsTheOriginal) {
  for (const std::string& program : {tip_program, axis_program}) {
    const SceneFolder folder;
    std::vector<Override> changes = fine_words;
    changes.emplace_back("errors.scale", "0.0");
    const Job job = prepare(read_scene(long_moves(folder, program), changes));
    const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
    const ProgramChange change = program_change(job, commanded);
    std::cout << job.path.motion_blocks << " blocks became " << commanded.path->motion_blocks
              << ", tip off by " << change.tip.max / units::nm << " nm\n";
    EXPECT_LE(commanded.path->motion_blocks, job.path.motion_blocks + 1);
    EXPECT_LE(commanded.path->arcs.size(),
              job.path.arcs.size() + 1);        // half a circle becomes two arcs
    EXPECT_LE(change.tip.max, 1e-6 + 20.0_nm);  // the tolerance is a word, angles are words too
    EXPECT_EQ(commanded.rewritten_program.find("G43.4") != std::string::npos,
              program.find("G43.4") != std::string::npos);
  }
}

TEST(RewrittenProgram, PvtHasFewerRowsTheMoreItsPathMayDiffer) {
  const std::vector<Override> spiral = {{"program.feed_um_per_rev", "200"},
                                        {"part.vertices", "1000"}};
  std::size_t rows = 0;
  for (const double um : {1.0, 0.1, 0.01, 0.0}) {
    const Job job = job_of("platform_sphere.toml", with_tolerance(spiral, um));
    const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
    const double off = off_corrected(job, commanded, 0.0);
    std::cout << "tolerance " << um << " um: " << commanded.path->blocks.size() << " rows, "
              << commanded.rewritten_program.size() << " bytes, of " << job.path.blocks.size()
              << " rows and " << job.samples.states.size() << " samples, off by at most "
              << off / units::nm << " nm\n";
    EXPECT_LE(off, (um > 0.0 ? um * units::um : 1.0_nm) + 2.0_nm);  // 2 nm: the scene's chords
    EXPECT_GE(commanded.path->blocks.size(), rows);
    EXPECT_LT(10 * commanded.path->blocks.size(), job.samples.states.size());
    rows = commanded.path->blocks.size();
    if (um == 1.0) {
      EXPECT_EQ(rows, job.path.blocks.size());  // those that were there suffice
    }
  }
}

TEST(RewrittenProgram, OfAShaftTurnsNothingButWhereTheToolStands) {
  const Job job = job_of("stepped_shaft.toml", {{"part.vertices", "1000"}});
  const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
  const ProgramChange change = program_change(job, commanded);
  std::cout << job.path.motion_blocks << " blocks became " << commanded.path->motion_blocks
            << ", tip moved by " << change.tip.max / units::um << " um, tool axis by "
            << change.direction.max << " rad\n";
  EXPECT_GT(change.tip.max, 1.0_um);
  EXPECT_LT(change.tip.max, 60.0_um);
  EXPECT_LT(change.direction.max, 1e-9);
}

TEST(RewriteCommand, WritesAProgramThatItsReaderTakesAndSaysWhatItIs) {
  const SceneFolder folder;
  const fs::path file = long_moves(folder, tip_program);
  ProgramRewriteOptions options;
  options.case_name = "perfect-iterated-program";
  options.overrides = {{"compensation.path_tolerance_um", "0.5"}};
  options.out = folder.path() / "made" / "again.ngc";
  const RewriteOutcome done = rewrite(file, options);
  const Job job = prepare(read_scene(file, options.overrides));
  const program::Path path = program::read_nc_file(options.out, nc_options(job.scene, job.machine));
  EXPECT_EQ(int(done.blocks_before), job.path.motion_blocks);
  EXPECT_EQ(int(done.blocks_after), path.motion_blocks);
  EXPECT_EQ(done.bytes, fs::file_size(options.out));
  EXPECT_EQ(done.path_tolerance / units::um, 0.5);
  EXPECT_EQ(done.words->mm, 1e-4);
  const double most = done.correction.tip.max / units::um,
               rms = done.correction.tip.rms / units::um;
  EXPECT_GT(rms, 1.0);
  EXPECT_GT(most, rms);
  EXPECT_LT(most, 200.0);
  // the correction undoes what the uncompensated tool is off
  EXPECT_NEAR(most, cut(job).tip_error.max / units::um, 0.1 * most);
}

TEST(RewriteCommand, OfAProgramThatMissesThePartIsWrittenWithAWarning) {
  const SceneFolder folder;
  ProgramRewriteOptions options;
  options.case_name = "perfect-iterated-program";
  options.overrides = {{"part.at_mm", "[0, 0, 0]"}, {"part.vertices", "2000"}};
  options.out = folder.path() / "in_the_air.ngc";
  const RewriteOutcome done = rewrite(long_moves(folder, tip_program), options);
  ASSERT_EQ(done.warnings.size(), 1u);
  EXPECT_HAS(done.warnings[0], "nothing of the part is cut");
  EXPECT_TRUE(fs::exists(options.out));
}

TEST(RewriteCommand, RefusesWhatItCannotDo) {
  const SceneFolder folder;
  const fs::path file = long_moves(folder, tip_program);
  const auto refused = [&](const ProgramRewriteOptions& options) {
    return refusal_by([&] { rewrite(file, options); });
  };
  ProgramRewriteOptions options;
  options.out = folder.path() / "again.ngc";
  EXPECT_HAS(refused(options), "expected a case with channel program");
  for (const char* name : {"perfect-iterated-ideal", "perfect-iterated-pulses"}) {
    options.case_name = name;
    EXPECT_HAS(refused(options), "channel program") << name;
  }
  for (const char* name : {"perfect-iterated", "wrong-iterated-program", "-", "uncompensated"}) {
    options.case_name = name;
    EXPECT_HAS(refused(options), "expected a case") << name;
  }
  options.case_name = "perfect-iterated-program";
  for (const char* um : {"-1", "nan", "inf", "\"a\""}) {
    options.overrides = {{"compensation.path_tolerance_um", um}};
    EXPECT_NE(refused(options), "") << um;
  }
  for (const char* mm : {"0", "-1", "1e-30", "nan"}) {
    options.overrides = {{"compensation.word_resolution_mm", mm}};
    EXPECT_ANY_THROW(rewrite(file, options)) << mm;
  }
  options.overrides.clear();
  EXPECT_FALSE(fs::exists(options.out));
  for (const fs::path& out : {folder.path() / "long.ngc", folder.path() / "long.toml",
                              folder.path() / "long.ngc" / "below.ngc"}) {
    options.out = out;
    EXPECT_THROW(rewrite(file, options), OutputFailure) << out;
  }
  std::ifstream source(folder.path() / "long.ngc");
  const std::string text{std::istreambuf_iterator<char>(source), {}};
  EXPECT_EQ(text, tip_program);
  options.out = folder.path();  // a folder takes the file
  rewrite(file, options);
  EXPECT_TRUE(fs::exists(folder.path() / "rewritten.ngc"));
}

}  // namespace
}  // namespace abbe::sim
