#include "sim/scene/read_scene.h"
#include "tests/errors/location_net.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_fingerprint.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// The smallest whole scene: line numbers of the tests below count here.
const std::string small_scene = R"([machine]
code = "w C' b X Y Z A s t"
axis.C = { point_mm = [0, 0, 0] }
axis.X = { travel_mm = [-300, 300] }
axis.Y = {}
axis.Z = {}
axis.A = { point_mm = [0, 0, 200], travel_deg = [-110, 110] }
nose = { at_mm = [0, 0, 50] }
[errors]
EXX_um = 5.0
EC0Y_urad = 30
[tool]
kind = "ball"
radius_mm = 5
flank_length_mm = 20
length_mm = 100
[part]
surface = "disc"
radius_mm = 10
[program]
generator = "raster"
)";

/// Reads the small scene with one part of its text replaced.
Scene read_with(const std::string& old_part, const std::string& new_part) {
  const SceneFolder folder;
  return read_scene(folder.write("s.toml", with(small_scene, old_part, new_part)));
}

/// Faults of the same, each on its line, the folder's name left out.
std::string faults_with(const std::string& old_part, const std::string& new_part) {
  const SceneFolder folder;
  std::string text = faults_of(folder.write("s.toml", with(small_scene, old_part, new_part)));
  const std::string prefix = folder.path().string() + "/";
  for (std::size_t at = text.find(prefix); at != std::string::npos; at = text.find(prefix)) {
    text.erase(at, prefix.size());
  }
  return text;
}

TEST(Scene, SmallSceneIsReadInInternalUnits) {
  const SceneFolder folder;
  const Scene scene = read_scene(folder.write("s.toml", small_scene));
  ASSERT_EQ(scene.machine.joints.size(), 6u);
  EXPECT_EQ(scene.machine.joints[0].name, 'C');
  EXPECT_EQ(scene.machine.joints[0].side, kinematics::Side::Workpiece);
  EXPECT_EQ(scene.machine.joints[4].max, 110 * units::deg);
  EXPECT_EQ(scene.machine.joints[1].min, -300.0);
  EXPECT_EQ(scene.machine.joints[5].motion, kinematics::Motion::Spindle);
  EXPECT_EQ(scene.machine.T_bs.translation(), Vector3d(0, 0, 50));
  ASSERT_EQ(scene.geometric.elements.size(), 2u);
  const auto value = [&](int i) {
    return std::get<errors::Constant>(scene.geometric.elements[std::size_t(i)].curves[0].shape)
        .value;
  };
  EXPECT_EQ(errors::to_string(scene.geometric.elements[0].name), "EXX");
  EXPECT_EQ(value(0), 5.0_um);
  EXPECT_EQ(value(1), 30.0_urad);
  EXPECT_EQ(std::get<cutting::Cutter>(scene.tool.nominal).corner_radius, 5.0);
  EXPECT_EQ(scene.tool.actual_length, 100.0);
  EXPECT_EQ(scene.title, "s");
}

TEST(Scene, AbsurdToolsAndSpeedsAreRefusedWhereTheyStand) {
  EXPECT_EQ(faults_with("radius_mm = 5\n", "radius_mm = 10001\n"),
            "s.toml:14:13: expected tool.radius_mm > 0 and <= 10000, seen 10001");
  EXPECT_EQ(faults_with("flank_length_mm = 20", "flank_length_mm = 1e300"),
            "s.toml:15:19: expected tool.flank_length_mm > 0 and <= 10000, seen 1e+300");
  EXPECT_EQ(faults_with("\"raster\"", "\"raster\"\nspeed_rpm = 1000001"),
            "s.toml:22:13: expected program.speed_rpm > 0 and <= 1000000, seen 1000001");
}

TEST(Scene, AFlankLongerThanItsToolIsRefusedWhereItStands) {
  EXPECT_EQ(faults_with("flank_length_mm = 20", "flank_length_mm = 100.5"),
            "s.toml:15:19: expected at most the length of the tool, 100 mm, for "
            "tool.flank_length_mm, seen 100.5");
  EXPECT_EQ(faults_with("flank_length_mm = 20", "flank_length_mm = 100"), "");
  EXPECT_EQ(faults_with("[part]", "[tool.actual]\nlength_mm = 19\n[part]"),
            "s.toml:18:13: expected at least the length of the flank, 20 mm, for "
            "tool.actual.length_mm, seen 19");
  EXPECT_EQ(faults_with("[part]", "[tool.actual]\nflank_length_mm = 101\n[part]"),
            "s.toml:18:19: expected at most the length of the tool, 100 mm, for "
            "tool.actual.flank_length_mm, seen 101");
  EXPECT_EQ(faults_with("kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20",
                        "kind = \"apt\"\ndiameter_mm = 10\nflank_length_mm = 120"),
            "s.toml:15:19: expected at most the length of the tool, 100 mm, for "
            "tool.flank_length_mm, seen 120");
  EXPECT_EQ(faults_with("flank_length_mm = 20", "flank_length_mm = \"20\""),
            "s.toml:15:19: expected a number for tool.flank_length_mm, seen \"20\"");
}

TEST(Scene, UnknownKeyIsRefusedWithTheNearestKnownOneAndItsPlace) {
  EXPECT_EQ(
      faults_with("flank_length_mm = 20", "flank_lenght_mm = 20"),
      "s.toml:15:1: expected a known key (nearest: tool.flank_length_mm), seen flank_lenght_mm");
  EXPECT_EQ(faults_with("[part]", "[prat]"),
            "s.toml:17:2: expected a known key (nearest: part), seen prat");
  EXPECT_EQ(faults_with("EXX_um", "EXQ_um"),
            "s.toml:10:1: expected a known key (nearest: errors.EXA_um), seen EXQ_um");
}

TEST(Scene, UnitMismatchSaysWhichUnitIsWanted) {
  EXPECT_EQ(faults_with("radius_mm = 5", "radius_um = 5000"),
            "s.toml:14:1: expected tool.radius_mm in mm, seen radius_um in um");
  EXPECT_EQ(
      faults_with("EXX_um = 5.0", "EXX_mm = 5.0"),
      "s.toml:10:1: expected EXX_um for the element EXX, seen EXX_mm, which is EXX_um = 5000");
  EXPECT_EQ(faults_with("EXX_um = 5.0", "EXX_urad = 5.0"),
            "s.toml:10:1: expected EXX_um for the element EXX, seen EXX_urad");
  EXPECT_EQ(faults_with("travel_mm = [-300, 300]", "travel_deg = [-300, 300]"),
            "s.toml:4:12: expected machine.axis.X.travel_mm in mm, seen travel_deg in deg");
}

TEST(Scene, WrongTypesMissingKeysAndBadNumbersAreRefusedWhereTheyStand) {
  EXPECT_EQ(faults_with("radius_mm = 5", "radius_mm = \"5\""),
            "s.toml:14:13: expected a number for tool.radius_mm, seen \"5\"");
  EXPECT_EQ(faults_with("radius_mm = 5", "radius_mm = nan"),
            "s.toml:14:13: expected a finite number for tool.radius_mm, seen nan");
  EXPECT_EQ(faults_with("radius_mm = 5", "radius_mm = -5"),
            "s.toml:14:13: expected tool.radius_mm > 0 and <= 10000, seen -5");
  EXPECT_EQ(faults_with("radius_mm = 5\n", ""),
            "s.toml:12:1: expected a number for tool.radius_mm, seen nothing");
  EXPECT_EQ(faults_with("point_mm = [0, 0, 200]", "point_mm = [0, 200]"),
            "s.toml:7:23: expected an array of 3 numbers for machine.axis.A.point_mm, "
            "seen an array of 2");
  EXPECT_EQ(
      faults_with("[-300, 300]", "[300, -300]"),
      "s.toml:4:24: expected [min, max] with min below max for travel_mm, seen not ascending");
  EXPECT_EQ(
      faults_with("radius_mm = 10", "radius_mm = 10\nvertices = 1e5"),
      "s.toml:20:12: expected an integer from 100 to 50000000 for part.vertices, seen 100000.0");
  EXPECT_EQ(faults_with("kind = \"ball\"", "kind = 2024-05-01"),
            "s.toml:13:8: expected one of \"apt\", \"ball\", \"bull\", \"edge\", \"flat\", "
            "\"form\", \"insert\", \"nose\", \"profile\" for tool.kind, seen 2024-05-01");
  EXPECT_EQ(faults_with("[program]\ngenerator = \"raster\"", "program = 7"),
            "s.toml:20:1: expected a "
            "known key of part, seen program\ns.toml:1:1: expected a table or a file for program, "
            "seen nothing");
}

TEST(Scene, WordsAreRefusedWithTheNearestOne) {
  EXPECT_EQ(
      faults_with("\"raster\"", "\"rastr\""),
      "s.toml:21:13: expected one of \"flank\", \"raster\", \"spiral\" for program.generator, "
      "seen \"rastr\" (nearest: \"raster\")");
}

TEST(Scene, AllFaultsAreToldAtOnce) {
  const SceneFolder folder;
  std::string text = small_scene;
  text = with(text, "radius_mm = 5", "radius_mm = inf");
  text = with(text, "flank_length_mm", "flank_length");
  text = with(text, "EXX_um = 5.0", "EXX_um = true");
  text =
      with(text, "generator = \"raster\"", "generator = \"raster\"\nlead = 5\nfeed_mm_per_min = 0");
  try {
    read_scene(folder.write("s.toml", text));
    FAIL() << "read";
  } catch (const BadScene& bad) {
    EXPECT_EQ(bad.input_errors.size(), 5u) << bad.what();
    const std::string all = bad.what();
    for (const char* place : {":10:10:", ":14:13:", ":15:1:", ":22:1:", ":23:19:"}) {
      EXPECT_HAS(all, std::string("s.toml") + place) << place;
    }
  }
}

TEST(Scene, SyntaxDuplicatesAndNulAreRefusedWithTheirPlace) {
  EXPECT_TRUE(faults_with("radius_mm = 5", "radius_mm = = 5")
                  .starts_with("s.toml:14:13: expected valid TOML"));
  EXPECT_TRUE(faults_with("radius_mm = 5", "radius_mm = 5\nradius_mm = 6")
                  .starts_with("s.toml:15:13: expected valid TOML, seen cannot redefine"))
      << faults_with("radius_mm = 5", "radius_mm = 5\nradius_mm = 6");
  EXPECT_EQ(faults_with("radius_mm = 5", std::string("radius_mm = \0 5", 15)),
            "s.toml:14:13: expected text, seen a NUL byte");
}

TEST(Scene, CrlfAndByteOrderMarkAreTaken) {
  const SceneFolder folder;
  std::string windows = "\xEF\xBB\xBF";
  for (const char c : small_scene) windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(fingerprint(read_scene(folder.write("a/s.toml", windows))),
            fingerprint(read_scene(folder.write("b/s.toml", small_scene))));
}

TEST(Scene, MissingFilesAreNamedWhereTheyAreAskedFor) {
  const SceneFolder folder;
  const std::string none = faults_of(folder.path() / "none.toml");
  EXPECT_HAS(none, "none.toml: expected a file that can be read, seen no such file");
  const fs::path file = folder.write(
      "s.toml", "tool = \"no.toml\"\nerrors = [\"a.toml\"]\n" +
                    with(small_scene,
                         "[errors]\nEXX_um = 5.0\nEC0Y_urad = 30\n[tool]\nkind = "
                         "\"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlength_mm = 100\n",
                         ""));
  const std::string input_errors = faults_of(file);
  for (const char* expected :
       {"s.toml:1:8: expected a file that can be read, or a library name: library:",
        "s.toml:2:11: expected a file that can be read, or a library name: library:",
        "/no.toml; names are relative", "/a.toml"})
    EXPECT_HAS(input_errors, expected);
  EXPECT_EQ(std::count(input_errors.begin(), input_errors.end(), '\n'), 1) << input_errors;
}

TEST(Scene, FaultsInASubFileNameThatFile) {
  const SceneFolder folder;
  folder.write("t/ball.toml",
               "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlengt_mm = 100\n");
  std::string text = "tool = \"t/ball.toml\"\n" + small_scene;
  text = with(
      text, "[tool]\nkind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlength_mm = 100\n", "");
  const std::string input_errors = faults_of(folder.write("s.toml", text));
  EXPECT_HAS(input_errors,
             "t/ball.toml:4:1: expected a known key (nearest: tool.length_mm), seen lengt_mm");
}

TEST(Scene, TooLargeAndTooDeepTextsAreRefused) {
  const SceneFolder folder;
  const std::string large = faults_of(folder.write("l.toml", std::string((16u << 20) + 1, '#')));
  EXPECT_HAS(large, "expected at most 16 MiB, seen 16777217 bytes");
  const std::string brackets = faults_of(folder.write("b.toml", "x = " + std::string(100000, '[')));
  EXPECT_FALSE(brackets.empty());
  std::string dotted = "a";
  for (int i = 0; i < 200000; ++i) dotted += ".a";
  EXPECT_HAS(faults_of(folder.write("d.toml", dotted + " = 1\n")),
             "a key of at most 100 components");
  std::string nested = "a";
  for (int i = 0; i < 300; ++i) nested += ".a";
  EXPECT_HAS(faults_of(folder.write("n.toml", nested + " = 1\n")), "at most 100 levels");
}

TEST(Scene, ManyFaultsAreCutOffAtTwoHundred) {
  const SceneFolder folder;
  std::string text;
  for (int i = 0; i < 5000; ++i) text += "key_" + std::to_string(i) + " = 1\n";
  try {
    read_scene(folder.write("s.toml", text));
    FAIL();
  } catch (const BadScene& bad) {
    EXPECT_EQ(bad.input_errors.size(), 201u);
  }
}

TEST(Scene, ElementThatTheMachineCannotHaveIsRefusedWhereItStands) {
  EXPECT_HAS(faults_with("EXX_um", "EXB_um"),
             "s.toml:10:1: expected an element that fits the machine");
  EXPECT_HAS(faults_with("EC0Y_urad", "EB0Y_urad"), "s.toml:11:1:");
  EXPECT_EQ(
      faults_with("EC0Y_urad = 30", "C0Y_urad = 30\nEC0Y_urad = 3"),
      "s.toml:12:1: expected each element once (all its curves in one list), seen EC0Y again");
  EXPECT_HAS(faults_with("EC0Y_urad = 30", "EC0Y = { kind = \"backlash\", half_urad = 3 }"),
             "s.toml:11:1:");
}

TEST(Scene, EveryKindOfCurveIsRead) {
  const Scene scene = read_with("EXX_um = 5.0", R"(EXX = [
  { name = "all", kind = "constant", value_um = 1 },
  { kind = "polynomial", coefficients_um = [1, 2, 3], centre_mm = 10, half_range_mm = 300 },
  { kind = "legendre", coefficients_um = [1, 2], half_range_mm = 300, argument = "carriage", negate = true },
  { kind = "fourier", period_mm = 16, a_um = [0.5], b_um = [0.25, 0.125], scale = 2.0 },
  { kind = "table", q_mm = [-300, 0, 300], value_um = [1, 0, 2], between = "spline", outside = "hold" },
  { kind = "backlash", half_um = 1.5 },
  { kind = "up_down", up = { q_mm = [0, 1], value_um = [0, 1] }, down = { q_mm = [0, 1], value_um = [2, 1] } },
  { kind = "repeatability", sigma_um = 0.3, seed = 7 },
]
EAC = { kind = "fourier", period_deg = 360, a_urad = [10] })");
  // The order is that of the machine: C stands first in its code.
  ASSERT_EQ(scene.geometric.elements.size(), 3u);
  EXPECT_EQ(errors::to_string(scene.geometric.elements[0].name), "EAC");
  EXPECT_EQ(std::get<errors::Fourier>(scene.geometric.elements[0].curves[0].shape).period,
            360 * units::deg);
  const auto& curves = scene.geometric.elements[1].curves;
  ASSERT_EQ(curves.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(curves[i].shape.index(), i);
  EXPECT_EQ(curves[0].name, "all");
  EXPECT_EQ(std::get<errors::Polynomial>(curves[1].shape).c[2], 3 * units::um);
  EXPECT_TRUE(curves[2].negate);
  EXPECT_EQ(curves[2].argument, errors::Argument::Carriage);
  EXPECT_EQ(std::get<errors::Fourier>(curves[3].shape).a.size(), 2);
  EXPECT_EQ(curves[3].scale, 2.0);
  EXPECT_EQ(std::get<errors::Table>(curves[4].shape).outside, errors::TableExtrapolation::Hold);
  EXPECT_EQ(std::get<errors::DirectionalTables>(curves[6].shape).down.value[0], 2 * units::um);
  EXPECT_EQ(std::get<errors::Repeatability>(curves[7].shape).seed, 7u);
}

TEST(Scene, RepeatabilityTakesItsSeedFromTheScene) {
  const SceneFolder folder;
  const auto seed = [&](const std::string& scene_seed) {
    const fs::path file =
        folder.write("s.toml", with(small_scene, "EXX_um = 5.0",
                                    "EXX = { kind = \"repeatability\", sigma_um = 1 }\n"
                                    "EYX = { kind = \"repeatability\", sigma_um = 1 }"));
    const Scene scene = read_scene(file, {{"seed", scene_seed}});
    const auto one = [&](std::size_t i) {
      return std::get<errors::Repeatability>(scene.geometric.elements[i].curves[0].shape).seed;
    };
    EXPECT_NE(one(0), one(1));
    return one(0);
  };
  EXPECT_EQ(seed("1"), seed("1"));
  EXPECT_NE(seed("1"), seed("2"));
}

TEST(Scene, DetrendMovesTheSlopeOfAStraightnessToTheSquareness) {
  // EXY rising by 10 um over 100 mm leans the Y travel by 100 urad towards +X: a turn by -100 urad
  // about Z, since +EC0Y opens the angle between X and Y.
  const Scene scene = read_with("EC0Y_urad = 30", R"(EC0Y_urad = 30
EXY = { kind = "table", q_mm = [0, 50, 100], value_um = [1, 6, 11], detrend = "ends" })");
  const auto& elements = scene.geometric.elements;
  ASSERT_EQ(elements.size(), 3u);
  EXPECT_EQ(errors::to_string(elements[1].name), "EXY");
  EXPECT_LT(std::get<errors::Table>(elements[1].curves[0].shape).value.cwiseAbs().maxCoeff(),
            1e-15);
  EXPECT_EQ(errors::to_string(elements[2].name), "EC0Y");
  double sum = 0.0;
  for (const auto& curve : elements[2].curves) sum += std::get<errors::Constant>(curve.shape).value;
  EXPECT_NEAR(sum, 30.0_urad - 100.0_urad, 1e-15);
  // X is primary: what leans X by 100 urad towards +Y closes the angle to Y just as well.
  const Scene primary = read_with("EC0Y_urad = 30", R"(EC0Y_urad = 30
EYX = { kind = "table", q_mm = [0, 50, 100], value_um = [1, 6, 11], detrend = "ends" })");
  ASSERT_EQ(primary.geometric.elements.size(), 3u);
  EXPECT_EQ(errors::to_string(primary.geometric.elements[2].name), "EC0Y");
  EXPECT_HAS(faults_with(
                 "EXX_um = 5.0",
                 "EXX = { kind = \"table\", q_mm = [0, 9], value_um = [0, 1], detrend = \"lsq\" }"),
             "detrend for a straightness of a slide only, seen EXX");
}

/// How far the angle between the directions of travel of X and Y is from square, from poses.
double opened(const Scene& scene) {
  const kinematics::Chain chain(scene.machine.joints, scene.machine.T_bw, scene.machine.T_bs);
  const auto machine = errors::net::poses_of(chain, errors::bind(scene.geometric, chain));
  const auto way = [&](char slide) {
    return oracles::direction_of_travel(machine, *chain.find(slide), 70.0);
  };
  return oracles::angle(way('X'), way('Y')) - 90.0_deg;
}

TEST(Scene, DetrendedStraightnessLeavesTheAngleBetweenTheSlidesAsItWas) {
  // With and without detrend the slides make the same angle, on both sides of the machine,
  // whichever carries the other and for both arguments; a sign slip would double the slope.
  for (const char* code :
       {"w X' Y' b Z s t", "w Y' X' b Z s t", "w b X Y Z s t", "w b Y X Z s t"}) {
    for (const char* argument : {"command", "carriage"}) {
      for (const char* negate : {"true", "false"}) {
        const SceneFolder folder;
        const auto scene = [&](const std::string& detrend) {
          return read_scene(folder.write("s.toml", std::string("[machine]\ncode = \"") + code + R"("
axis = { X = {}, Y = {}, Z = {} }
nose.at_mm = [0, 0, 100]
[errors.EXY]
kind = "table"
q_mm = [-100, 0, 100]
value_um = [-20, 0, 20]
argument = ")" + argument + "\"\nnegate = " + negate + detrend +
                                                       R"(
[tool]
kind = "ball"
radius_mm = 5
flank_length_mm = 20
length_mm = 50
[part]
surface = "disc"
radius_mm = 10
[program]
generator = "raster"
)"));
        };
        const Scene plain = scene("");
        const Scene detrended = scene("\ndetrend = \"ends\"");
        ASSERT_EQ(detrended.geometric.elements.size(), 2u);
        EXPECT_NEAR(std::abs(opened(plain)), 200.0_urad, 1e-11) << code << argument;
        EXPECT_NEAR(opened(plain), opened(detrended), 1e-10) << code << argument << negate;
      }
    }
  }
}

TEST(Scene, WholeTableIsBound) {
  const SceneFolder folder;
  folder.write(
      "laser.csv",
      "X EXX EYX EZX EAX EBX ECX\n-300 0 0 0 0 0 0\n0 0.001 0.002 0 0 0 1e-5\n300 0 0 0 0 0 0\n");
  const fs::path file = folder.write(
      "s.toml", with(small_scene, "EXX_um = 5.0",
                     "tables = [{ file = \"laser.csv\", between = \"spline\", name = \"run 3\" }]\n"
                     "measured.X = { at_mm = [0, 0, 300], by = \"tool\" }"));
  const Scene scene = read_scene(file);
  ASSERT_EQ(scene.geometric.elements.size(), 7u);
  EXPECT_EQ(scene.geometric.elements[0].curves[0].name, "run 3");
  EXPECT_EQ(std::get<errors::Table>(scene.geometric.elements[1].curves[0].shape).value[1], 0.002);
  ASSERT_EQ(scene.geometric.measuring_lines.size(), 1u);
  EXPECT_EQ(scene.geometric.measuring_lines[0].by, errors::MeasuredBy::Tool);
  const Scene column = read_scene(folder.write(
      "t.toml", with(small_scene, "EXX_um = 5.0",
                     "EXX = { kind = \"table\", file = \"laser.csv\", column = \"EYX\" }")));
  EXPECT_EQ(std::get<errors::Table>(column.geometric.elements[0].curves[0].shape).value[1], 0.002);
  const std::string none = faults_of(folder.write(
      "u.toml", with(small_scene, "EXX_um = 5.0", "tables = [{ file = \"laser2.csv\" }]")));
  EXPECT_HAS(none, "u.toml:10:");
  folder.write("bad.csv", "X EXX\n0 0\n1 abc\n");
  const std::string bad = faults_of(folder.write(
      "v.toml", with(small_scene, "EXX_um = 5.0", "tables = [{ file = \"bad.csv\" }]")));
  EXPECT_HAS(bad, "bad.csv:3:3:");
}

TEST(Scene, SeveralErrorFilesAddUp) {
  const SceneFolder folder;
  folder.write("e/a.toml", "EXX_um = 1\nEYX_um = 2\n");
  folder.write("e/b.toml", "EXX_um = 4\nscale = 0.5\n");
  const std::string text = "errors = [\"e/a.toml\", \"e/b.toml\", { EXX_um = 8 }]\n" +
                           with(small_scene, "[errors]\nEXX_um = 5.0\nEC0Y_urad = 30\n", "");
  const fs::path file = folder.write("s.toml", text);
  const auto sum = [](const Scene& scene) {
    double total = 0.0;
    for (const auto& curve : scene.geometric.elements[0].curves) {
      total += curve.scale * std::get<errors::Constant>(curve.shape).value;
    }
    return total;
  };
  EXPECT_NEAR(sum(read_scene(file)), 11.0_um, 1e-15);
  EXPECT_NEAR(sum(read_scene(file, {{"errors.scale", "2"}})), 26.0_um, 1e-15);
  EXPECT_NEAR(sum(read_scene(file, {{"errors.2.EXX_um", "9"}})), 12.0_um, 1e-15);
  const Scene resolved = read_scene(folder.write("out/scene.toml", read_scene(file).resolved));
  EXPECT_NEAR(sum(resolved), 11.0_um, 1e-15);
}

TEST(Scene, OverridesChangeValuesByPath) {
  const SceneFolder folder;
  const fs::path file = folder.write("s.toml", small_scene);
  const Scene scene = read_scene(file, {{"tool.radius_mm", "4.9"},
                                        {"errors.scale", "2"},
                                        {"part.vertices", "1000"},
                                        {"alignment", "rigid"},
                                        {"title", "a longer name"},
                                        {"limits.pv_um", "12.5"},
                                        {"setup", "{ EX_um = 3 }"},
                                        {"machine.axis.X.travel_mm", "[-10, 10]"}});
  EXPECT_EQ(std::get<cutting::Cutter>(scene.tool.nominal).radius, 4.9);
  EXPECT_EQ(scene.error_scale, 2.0);
  EXPECT_EQ(scene.part.vertices, 1000);
  EXPECT_EQ(scene.alignment, Alignment::Rigid);
  EXPECT_EQ(scene.title, "a longer name");
  EXPECT_EQ(scene.limits.pv_um, 12.5);
  EXPECT_EQ(scene.setup[0], 3 * units::um);
  EXPECT_EQ(scene.machine.joints[1].max, 10.0);
}

TEST(Scene, OverridesThatMeanNothingAreRefusedByName) {
  const SceneFolder folder;
  const fs::path file = folder.write("s.toml", small_scene);
  const auto input_errors = [&](const std::string& path, const std::string& value) {
    return faults_of(file, {{path, value}});
  };
  EXPECT_EQ(input_errors("tool.radius", "4.9"),
            "--set tool.radius=4.9: expected a known key (nearest: tool.radius_mm), seen radius");
  EXPECT_EQ(input_errors("tol.radius_mm", "4.9"),
            "--set tol.radius_mm=4.9: expected a known key (nearest: tool), seen tol");
  EXPECT_EQ(input_errors("tool.radius_mm", "4.9mm"),
            "--set tool.radius_mm=4.9mm: expected a number for tool.radius_mm, seen \"4.9mm\"");
  EXPECT_EQ(input_errors("tool.radius_mm.x", "4"),
            "--set tool.radius_mm.x=4: expected a path to a value; tool.radius_mm.x has none below "
            "\"radius_mm\", seen 5");
  EXPECT_EQ(input_errors("tool.radius_mm", "[1"),
            "--set tool.radius_mm=[1: expected a TOML value for "
            "tool.radius_mm, seen [1");
  EXPECT_FALSE(input_errors("tool.radius_mm", "4\nlength_mm = 3").empty());
  EXPECT_FALSE(input_errors("", "4").empty());
  EXPECT_FALSE(input_errors("tool..x", "4").empty());
  EXPECT_FALSE(input_errors("tool.radius_mm", "").empty());
}

TEST(Scene, OverridesReachNamedCurvesAndOtherFiles) {
  const SceneFolder folder;
  folder.write("t/big.toml",
               "kind = \"ball\"\nradius_mm = 8\nflank_length_mm = 20\nlength_mm = 90\n");
  const fs::path file =
      folder.write("s.toml", with(small_scene, "EXX_um = 5.0",
                                  "EXX = [{ kind = \"constant\", value_um = 1 }, "
                                  "{ name = \"screw\", kind = \"constant\", value_um = 2 }]"));
  const Scene scene = read_scene(file, {{"errors.EXX.screw.scale", "0"}, {"tool", "t/big.toml"}});
  EXPECT_EQ(scene.geometric.elements[0].curves[0].scale, 1.0);
  EXPECT_EQ(scene.geometric.elements[0].curves[1].scale, 0.0);
  EXPECT_EQ(scene.tool.length, 90.0);
}

TEST(Scene, VariantsAreReadAndTriedAtOnce) {
  const std::string variant =
      "generator = \"raster\"\n[[variant]]\nname = \"warm\"\n"
      "set = { \"errors.scale\" = 2.0, part.vertices = 500, alignment = \"rigid\" }\n";
  const Scene scene = read_with("generator = \"raster\"\n", variant);
  ASSERT_EQ(scene.variants.size(), 1u);
  EXPECT_EQ(scene.variants[0].name, "warm");
  ASSERT_EQ(scene.variants[0].set.size(), 3u);
  EXPECT_EQ(scene.variants[0].set[0], Override("errors.scale", "2.0"));
  const SceneFolder folder;
  const Scene warm =
      read_scene(folder.write("s.toml", with(small_scene, "generator = \"raster\"\n", variant)),
                 scene.variants[0].set);
  EXPECT_EQ(warm.error_scale, 2.0);
  EXPECT_EQ(warm.part.vertices, 500);
  EXPECT_EQ(warm.geometric.elements.size(), 2u);

  EXPECT_EQ(faults_with("generator = \"raster\"\n",
                        with(variant, "\"errors.scale\" = 2.0", "\"errors.scael\" = 2.0")),
            "s.toml:24:26: expected a known key (nearest: errors.scale), seen scael");
  EXPECT_HAS(faults_with("generator = \"raster\"\n", with(variant, "\"warm\"", "\"../warm\"")),
             "s.toml:23:8:");
  EXPECT_HAS(faults_with("generator = \"raster\"\n", with(variant, "\"warm\"", "\"error_free\"")),
             "again");
}

TEST(Scene, PlacesTurnExactlyByRightAngles) {
  const Scene scene =
      read_with("radius_mm = 10\n", "radius_mm = 10\nat_mm = [1, 2, 3]\nturn_deg = [0, 90, 0]\n");
  EXPECT_EQ(scene.part.T_wm.linear() * Vector3d::UnitZ(), Vector3d::UnitX());
  EXPECT_EQ(scene.part.T_wm.translation(), Vector3d(1, 2, 3));
  const Scene tilted = read_with("radius_mm = 10\n", "radius_mm = 10\nturn_deg = [30, 0, 0]\n");
  // By hand: +30 degrees about X carry +y up.
  const Vector3d y = tilted.part.T_wm.linear() * Vector3d::UnitY();
  EXPECT_LT((y - Vector3d(0, std::sqrt(0.75), 0.5)).norm(), 1e-15);
}

TEST(Scene, PartsThatCannotBeAreRefused) {
  EXPECT_HAS(faults_with("surface = \"disc\"\nradius_mm = 10",
                         "surface = \"sphere_cap\"\nradius_mm = 10\nrim_radius_mm = 11"),
             "s.toml:18:11: expected a valid surface");
  EXPECT_HAS(
      faults_with("surface = \"disc\"\nradius_mm = 10",
                  "surface = \"cone\"\nbase_radius_mm = 10\nheight_mm = 11\nhalf_apex_deg = 60"),
      "s.toml:18:11:");
  EXPECT_HAS(faults_with("surface = \"disc\"\nradius_mm = 10", "file = \"none.stl\""), "no file");
}

TEST(Scene, ToolPartAndProgramMustFitEachOther) {
  EXPECT_EQ(faults_with("generator = \"raster\"", "generator = \"flank\""),
            "s.toml:21:13: expected a cone as the part of this generator, seen \"flank\"");
  EXPECT_EQ(faults_with("generator = \"raster\"",
                        "generator = \"spiral\"\nspeed_rpm = 100\nfeed_um_per_rev = 5"),
            "s.toml:21:13: expected a turning tool for this generator, seen \"spiral\"");
  EXPECT_HAS(faults_with("kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20",
                         "kind = \"nose\"\nradius_mm = 5"),
             "expected a milling cutter, or a machine with the spindle S'");
}

TEST(Scene, ToolMayReallyBeOtherThanItIsBelieved) {
  const Scene scene = read_with(
      "length_mm = 100", "length_mm = 100\nactual = { radius_mm = 4.99, length_mm = 100.01 }");
  EXPECT_EQ(std::get<cutting::Cutter>(scene.tool.actual).radius, 4.99);
  EXPECT_EQ(std::get<cutting::Cutter>(scene.tool.actual).corner_radius, 4.99);
  EXPECT_EQ(std::get<cutting::Cutter>(scene.tool.nominal).radius, 5.0);
  EXPECT_EQ(scene.tool.actual_length, 100.01);
}

TEST(Scene, ControlDatumAndProgramTablesAreRead) {
  const Scene scene = read_with("[program]\ngenerator = \"raster\"\n", R"([program]
generator = "raster"
tool_length_mm = { 2 = 80.5 }
work_offset.G55 = { X_mm = 10, C_deg = 90 }
[control]
tool_length_mm = 100.02
axis.C.point_mm = [0.01, 0, 0]
[datum]
kind = "touch_off"
touch = [{ point_mm = [0, 0, 5], direction = [0, 0, -2] }]
time_s = 60
[compare]
cases = ["perfect-iterated-ideal", "perfect-position-program"]
)");
  EXPECT_EQ(scene.program.tool_length.at(2), 80.5);
  EXPECT_EQ(scene.program.work_offset[1][1], 10.0);
  EXPECT_EQ(scene.program.work_offset[1][0], 90 * units::deg);
  EXPECT_EQ(scene.control.tool_length, 100.02);
  ASSERT_EQ(scene.control.joints.size(), 6u);
  EXPECT_EQ(scene.control.joints[0].point_b.x(), 0.01);
  EXPECT_EQ(scene.machine.joints[0].point_b.x(), 0.0);
  ASSERT_EQ(scene.datum.touches.size(), 1u);
  EXPECT_EQ(scene.datum.touches[0].direction_w, -Vector3d::UnitZ());
  EXPECT_EQ(scene.cases[1].channel, CaseDescription::Channel::Program);
}

TEST(Scene, CaseNamesAreReadTokenByToken) {
  const CaseDescription one = parse_case("perfect-decoupled-program");
  EXPECT_EQ(one.strategy, compensation::Strategy::Decoupled);
  EXPECT_EQ(one.channel, CaseDescription::Channel::Program);
  for (const char* bad :
       {"", "perfect", "perfect-iterated", "perfect-iterated-ideal-x", "termal-iterated-ideal",
        "perfect-iteratd-ideal", "perfect-iterated-pulse", "--"}) {
    EXPECT_THROW(parse_case(bad), std::invalid_argument) << bad;
  }
  const std::string said =
      thrown_text<std::invalid_argument>([&] { parse_case("perfect-iterated-pulse"); });
  EXPECT_EQ(said,
            "expected a channel (ideal, program, pulses, open, origin, table, piezo), "
            "seen \"pulse\" (nearest: \"pulses\")");
}

class PackagedScene : public testing::TestWithParam<std::string> {};

TEST_P(PackagedScene, IsReadAndItsResolvedTextGivesTheSameScene) {
  const Scene scene = read_scene(packaged(GetParam()));
  const SceneFolder folder;
  const Scene again = read_scene(folder.write("scene.toml", scene.resolved));
  EXPECT_EQ(fingerprint(scene), fingerprint(again));
  EXPECT_EQ(scene.resolved, again.resolved);
  // With values changed, too.
  const std::vector<Override> overrides{
      {"errors.scale", "0.1"}, {"seed", "12"}, {"tool.length_mm", "99.1"}};
  const Scene changed = read_scene(packaged(GetParam()), overrides);
  EXPECT_NE(fingerprint(changed), fingerprint(scene));
  EXPECT_EQ(fingerprint(read_scene(folder.write("changed.toml", changed.resolved))),
            fingerprint(changed));
}

INSTANTIATE_TEST_SUITE_P(Scenes, PackagedScene, testing::ValuesIn(packaged_scenes()),
                         [](const auto& scene) {
                           return scene.param.substr(0, scene.param.find('.'));
                         });

TEST(Scene, EveryPackagedMachineIsReadInTheOrderOfItsCode) {
  const auto code = [](const std::string& machine) {
    std::string letters;
    for (const auto& joint :
         read_scene(packaged("gantry_perfect.toml"), {{"machine", "machines/" + machine}})
             .machine.joints) {
      letters += joint.name;
    }
    return letters;
  };
  EXPECT_EQ(code("gantry_cxyza.toml"), "CXYZAs");
  EXPECT_EQ(code("trunnion_ca.toml"), "CAYXZs");
  EXPECT_EQ(code("head_head.toml"), "XYZCAs");
  EXPECT_EQ(code("three_axis_table.toml"), "XYZs");
  EXPECT_EQ(code("platform_xz.toml"), "SXZ");
}

TEST(Scene, ResolvedTextKeepsVariantsListsAndTextOfAnyKind) {
  const SceneFolder folder;
  folder.write("t/big.toml",
               "kind = \"ball\"\nradius_mm = 8\nflank_length_mm = 20\nlength_mm = 90\n");
  folder.write("laser.csv", "X EXX\n-300 0\n300 0.001\n");
  std::string text =
      with(small_scene, "EXX_um = 5.0",
           "EXX = [{ kind = \"table\", file = \"laser.csv\" }, "
           "{ name = \"a.b \\\"c\\\" \\u00b5\", kind = \"constant\", value_um = 0.1 }]");
  text =
      "title = \"tab\\there \\\\ \u00b5\"\n" + text +
      "[[variant]]\nname = \"one\"\nset = { \"tool\" = \"t/big.toml\", \"errors.scale\" = 1e-3 }\n"
      "[[variant]]\nname = \"two\"\nset = { part.radius_mm = 11 }\n";
  const Scene scene = read_scene(folder.write("s.toml", text));
  const Scene again = read_scene(folder.write("elsewhere/deep/s.toml", scene.resolved));
  EXPECT_EQ(fingerprint(scene), fingerprint(again));
  EXPECT_EQ(read_scene(folder.path() / "elsewhere/deep/s.toml", again.variants[0].set).tool.length,
            90.0);
}

TEST(Scene, InputsThatOnceBrokeAReaderAreRefusedWithTheirPlace) {
  int tried = 0;
  for (const auto& entry :
       fs::directory_iterator(fs::path(ABBE_SOURCE_DIR) / "tests/corpus/scene")) {
    if (entry.path().extension() != ".toml") continue;
    ++tried;
    const std::string input_errors = faults_of(entry.path());
    EXPECT_HAS(input_errors, "expected ") << entry.path();
    EXPECT_HAS(input_errors, entry.path().filename().string()) << entry.path();
  }
  EXPECT_GE(tried, 8);
}

}  // namespace
}  // namespace abbe::sim
