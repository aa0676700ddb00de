// Machines without errors, and with one error whose effect on the part is known in closed form.
// Nothing here takes a figure from the engine.

#include "cutting/map/form.h"
#include "sim/cut/tool_poses.h"
#include "sim/loop/compensate.h"
#include "sim/scene/read_scene.h"
#include "tests/oracles/closed_forms.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

std::string cap(double radius, double rim, int vertices) {
  return fmt::format(
      "surface = \"sphere_cap\"\nradius_mm = {}\nrim_radius_mm = {}\nat_mm = [40, 25, "
      "80]\nvertices = {}",
      radius, rim, vertices);
}

TEST(ClosedForm, TurnedCuspIsThatOfTheFeed) {
  const double R = 0.249, f = 0.02, rim = 10.8;
  const Job job = job_of("platform_perfect.toml");
  const Cut cut = cut_error_free(job);
  double most = 0.0;
  for (const CutVertex& v : cut_vertices(job, cut.surface)) {
    const double r = v.p.head<2>().norm();
    if (r >= f && r <= rim - f) most = std::max(most, v.residual);
  }
  std::cout << "turned cusp " << most / units::um << " um, closed form "
            << oracles::cusp(R, f) / units::um << " um\n";
  EXPECT_NEAR(oracles::cusp(R, f), 0.200884_um, 1e-9);
  EXPECT_NEAR(most, oracles::cusp(R, f), 0.1_nm);
}

TEST(ClosedForm, RasterOnAPlaneLeavesTheRidgesOfItsPasses) {
  const double R = 5.0, s = 0.5;
  const Job job =
      job_of(BallRaster{.part = "surface = \"rectangle\"\nlength_x_mm = 12.0\n"
                                "length_y_mm = 10.0\nat_mm = [40, 25, 80]\nvertices = 20000",
                        .step_over = s});
  const Cut cut = cut_error_free(job);
  double most = 0.0;
  const Misfit m = misfit(job, cut.surface, [&](const CutVertex& v) {
    most = std::max(most, v.residual);
    return oracles::cusp(R, 2 * off_grid(v.p.y(), s));
  });
  std::cout << "plane: highest vertex " << most / units::um << " um, cusp "
            << oracles::cusp(R, s) / units::um << " um; " << m.vertices << " vertices within "
            << m.magnitude() / units::nm << " nm of their ridge\n";
  EXPECT_GT(m.vertices, 15000);
  EXPECT_LT(m.magnitude(), 1.0_nm);
  EXPECT_NEAR(most, oracles::cusp(R, s), 1.0_nm);
}

TEST(ClosedForm, RasterOnADomeLeavesTheRidgesOfItsLatitudes) {
  const double R = 5.0, rho = 100.0, s = 0.35, step = 0.01;  // chords of 0.1 nm
  const Job job = job_of(BallRaster{.part = cap(rho, 3.0, 60000), .step_over = s, .step = step});
  const Cut cut = cut_error_free(job);
  double most = 0.0;
  const Misfit m = misfit(job, cut.surface, [&](const CutVertex& v) {
    most = std::max(most, v.residual);
    return oracles::pass_height(R, rho, off_grid(rho * std::asin(v.n.y()), s));
  });
  std::cout << "dome: highest vertex " << most / units::um << " um, cusp "
            << oracles::dome_cusp(R, rho, s) / units::um << " um; " << m.vertices
            << " vertices within " << m.magnitude() / units::nm << " nm of their ridge, chords "
            << oracles::chord_gouge(R, rho, step * (rho + R) / rho) / units::nm << " nm\n";
  EXPECT_GT(m.vertices, 50000);
  EXPECT_LT(m.magnitude(), 1.0_nm);
  EXPECT_NEAR(most, oracles::dome_cusp(R, rho, s), 1.0_nm);
}

/// How deep the chords cut below the middle pass: vertices within 50 um of it, less its own height
/// there (what the depth itself changes with that offset is below 1e-4 of it).
double deepest_chord(const Job& job, double R, double rho) {
  double deepest = 0.0;
  for (const CutVertex& v : cut_vertices(job, cut_error_free(job).surface)) {
    const double offset = rho * std::asin(v.n.y());
    if (std::abs(offset) < 0.05)
      deepest = std::max(deepest, oracles::pass_height(R, rho, offset) - v.residual);
  }
  return deepest;
}

TEST(ClosedForm, ChordsGougeADomeAtAFixedToolAxis) {
  const double R = 5.0, rho = 40.0, step = 1.0, L = step * (rho + R) / rho;
  const Job job = job_of(BallRaster{.part = cap(rho, 4.0, 60000),
                                    .step_over = 0.35,
                                    .step = step,
                                    .lead = 0.0,
                                    .machine = "three_axis_table"});
  const double deepest = deepest_chord(job, R, rho);
  std::cout << "chord gouge, fixed axis: " << deepest / units::um << " um, closed form "
            << oracles::chord_gouge(R, rho, L) / units::um << " um\n";
  EXPECT_NEAR(deepest, oracles::chord_gouge(R, rho, L), 1.0_nm);
}

TEST(ClosedForm, ChordsGougeADomeLessWithTheAxisTurningAlong) {
  const double R = 5.0, rho = 40.0, step = 1.0, L = step * (rho + R) / rho;
  for (const double lead : {20.0, 36.0, 60.0}) {
    const Job job = job_of(
        BallRaster{.part = cap(rho, 4.0, 60000), .step_over = 0.35, .step = step, .lead = lead});
    const double deepest = deepest_chord(job, R, rho);
    const double expected = oracles::chord_gouge_turning(R, rho, L, lead * units::deg);
    std::cout << "chord gouge, lead " << lead << " deg: " << deepest / units::um
              << " um, closed form " << expected / units::um << " um\n";
    EXPECT_NEAR(deepest, expected, 1.0_nm) << "lead " << lead;
  }
}

constexpr double path_radius = 50.0;  // mm, radius of the path of the tool's axis
constexpr double mill_radius = 8.0;   // mm, radius of the flat end mill, which works with its flank

/// A ring of 42 mm on the gantry, cut by the program with these errors. The tip stands at
/// Z = 55 at z = -5 below it.
Job ring_job(const SceneFolder& folder, const std::string& errors, const std::string& program) {
  folder.write("ring.ngc", "G21 G90 G94 G17 G49\n" + program + "M2\n");
  const auto scene = folder.write(
      "ring.toml", fmt::format("machine = \"{0}machines/gantry_cxyza.toml\"\n"
                               "tool = \"{0}tools/flat_r8.toml\"\n"
                               "[part]\nsurface = \"cylinder\"\nradius_mm = 42.0\nheight_mm = 1.0\n"
                               "vertices = 3000\n[program]\nfile = \"ring.ngc\"\n[errors]\n{1}",
                               packaged("").string(), errors));
  return prepare(read_scene(scene));
}

std::string words(const Vector2d& p) { return fmt::format("X{} Y{}", p.x(), p.y()); }

std::string by_C(const Vector2d& at) {
  return fmt::format("G0 {}\nG0 Z55\nG1 C360 F3600\nG0 Z300\n", words(at));
}
const std::string by_arcs = "G0 X50 Y0\nG0 Z55\nG3 X50 Y0 I-50 J0 F1000\nG0 Z300\n";

cutting::Circle circle_of(const Job& job, const Cut& cut) {
  const auto vertices = cut_vertices(job, cut.surface);
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(Index(vertices.size()), 2);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    points.row(Index(i)) =
        (vertices[i].p + vertices[i].residual * vertices[i].n).head<2>().transpose();
  return cutting::fit_circle(points);
}

TEST(ClosedForm, RingCutByCAloneHasTheRadiusOfTheOffsetAndIsConcentric) {
  const Vector2d d(16.0_um, 12.0_um);
  for (const Vector2d& at : {Vector2d(50, 0), Vector2d(30, 40), Vector2d(-14, -48)}) {
    const SceneFolder folder;
    const Job job = ring_job(folder, "EX0C_um = 16.0\nEY0C_um = 12.0\n", by_C(at));
    const cutting::Circle circle = circle_of(job, cut(job));
    const double expected = oracles::ring_radius(path_radius, at / path_radius, d) - mill_radius;
    std::cout << "ring by C at " << at.transpose() << ": radius "
              << circle.radius - (path_radius - mill_radius) << " mm off 42, closed form "
              << expected - (path_radius - mill_radius) << "; centre off by "
              << circle.centre.norm() / units::nm << " nm, roundness "
              << circle.roundness / units::nm << " nm\n";
    EXPECT_NEAR(circle.radius, expected, 1.0_nm);
    EXPECT_LT(circle.centre.norm(), 1.0_nm);
    EXPECT_LT(circle.roundness, 1.0_nm);
  }
}

TEST(ClosedForm, RingCutByXAndYIsShiftedByTheNegativeOffset) {
  const Vector2d d(16.0_um, 12.0_um);
  const SceneFolder folder;
  const Job job = ring_job(folder, "EX0C_um = 16.0\nEY0C_um = 12.0\n", by_arcs);
  const cutting::Circle circle = circle_of(job, cut(job));
  const Job turned = ring_job(folder, "EX0C_um = 16.0\nEY0C_um = 12.0\n", by_C({50, 0}));
  const double between = (circle.centre - circle_of(turned, cut(turned)).centre).norm();
  std::cout << "ring by X and Y: centre " << circle.centre.transpose() / units::um
            << " um, radius off by " << (circle.radius - (path_radius - mill_radius)) / units::nm
            << " nm; between the centres " << between / units::um << " um\n";
  EXPECT_LT((circle.centre + d).norm(), 1.0_nm);
  EXPECT_NEAR(circle.radius, path_radius - mill_radius, 1.0_nm);
  EXPECT_NEAR(between, d.norm(), 1.0_nm);
}

TEST(ClosedForm, SquarenessMakesARingOvalByRadiusTimesAngle) {
  for (const double S : {100.0, -40.0}) {
    const SceneFolder folder;
    const Job job = ring_job(folder, "EC0Y_urad = " + std::to_string(S) + "\n", by_arcs);
    const cutting::Circle circle = circle_of(job, cut(job));
    const double expected = oracles::squareness_circularity(path_radius, std::abs(S) * units::urad);
    std::cout << "squareness " << S << " urad: circularity " << circle.roundness / units::um
              << " um, closed form " << expected / units::um << " um\n";
    EXPECT_NEAR(circle.roundness, expected, 1.5_nm);  // a second order of 0.5 nm is not in the form
    double long_way = 0.0, short_way = 0.0;  // a larger angle between X and Y: long along x = -y
    for (const CutVertex& v : cut_vertices(job, cut(job).surface)) {
      const double azimuth = std::atan2(v.n.y(), v.n.x());
      if (std::abs(std::remainder(azimuth - 0.75 * pi, pi)) < 0.02) long_way = v.residual;
      if (std::abs(std::remainder(azimuth - 0.25 * pi, pi)) < 0.02) short_way = v.residual;
    }
    EXPECT_GT((long_way - short_way) * S, 0.0);
  }
}

// What errors do between the samples of a program, against a closed form and denser samples.

/// A flat part under straight passes along X, three axes, with errors.
Job passes(const std::string& errors, const std::string& sampling = "") {
  return job_of(BallRaster{.part = "surface = \"rectangle\"\nlength_x_mm = 40.0\n"
                                   "length_y_mm = 10.0\nat_mm = [40, 25, 80]\nvertices = 500",
                           .step_over = 1.0,
                           .step = 1.0,
                           .lead = 0.0,
                           .machine = "three_axis_table",
                           .more = "[errors]\n" + errors + "\n[sampling]\n" + sampling});
}

ChordError looked(const Job& job) { return chord_error(job, uncompensated_commands(job)); }

TEST(ChordError, AWaveIsBentAsItsClosedFormSays) {
  // a wave less the mean of it half a step before and behind: amplitude (1 - cos(pi step / length))
  const double amplitude = 0.8_um;
  for (const double length : {40.0, 10.0, 5.0, 1.7}) {
    for (const double step : {1.0, 0.25}) {
      const Job job = passes(
          fmt::format("EZX = {{ kind = \"fourier\", period_mm = {}, b_um = [0.8] }}", length),
          fmt::format("max_step_mm = {}", step));
      const ChordError found = looked(job);
      const double most = amplitude * std::abs(1.0 - std::cos(std::numbers::pi * step / length));
      std::cout << "wave of " << length << " mm in steps of " << step
                << " mm: " << found.max / units::nm << " nm of " << most / units::nm << " nm\n";
      ASSERT_GT(found.interval_count, 100u);
      EXPECT_LE(found.max, most * (1 + 1e-6) + 1e-3 * units::nm);
      EXPECT_GE(found.max, 0.95 * most);
      EXPECT_NEAR(found.step, step, 1e-3);
      // over all phases
      EXPECT_NEAR(found.rms, most / std::numbers::sqrt2, 0.1 * most);
    }
  }
}

TEST(ChordError, NothingIsBentWithoutWaves) {
  for (const char* errors :
       {"", "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [3.0, 0.02] }",
        "EZX = { kind = \"backlash\", half_um = 4.0 }"}) {
    const ChordError found = looked(passes(errors));
    EXPECT_GT(found.interval_count, 100u) << errors;
    EXPECT_LT(found.max, 1e-3 * units::nm) << errors;
    EXPECT_TRUE(chord_error_warnings(found, 0.0).empty()) << errors;
  }
}

TEST(ChordError, AWaveThatDividesTheStepsIsSeen) {
  for (const double length : {1.0, 0.5, 0.25, 0.1}) {
    const ChordError found = looked(passes(
        fmt::format("EZX = {{ kind = \"fourier\", period_mm = {}, a_um = [0.8] }}", length)));
    double most = 0.0;
    for (const double share : {0.5, 0.3819660112501051})
      most = std::max(most, 0.8_um * (1.0 - std::cos(2 * pi * share / length)));
    EXPECT_NEAR(found.max, most, 1e-3 * units::nm) << "nothing of it is at the samples";
    EXPECT_GT(found.max, 0.4_um);
    EXPECT_EQ(chord_error_warnings(found, 0.8_um).size(), 1u);
  }
}

TEST(ChordError, TheStepThatIsProposedFollowsThem) {
  const std::string wave = "EZX = { kind = \"fourier\", period_mm = 5.0, b_um = [0.8] }";
  const ChordError coarse = looked(passes(wave));
  ASSERT_GT(coarse.max, 100.0_nm);
  const auto warned = chord_error_warnings(coarse, 1.0_um);
  ASSERT_EQ(warned.size(), 1u);
  const std::string key = "sampling.max_step_mm = ";
  const auto at = warned.front().find(key);
  ASSERT_NE(at, std::string::npos) << warned.front();
  const double step = std::stod(warned.front().substr(at + key.size()));
  const ChordError fine = looked(passes(wave, fmt::format("max_step_mm = {}", step)));
  EXPECT_LT(fine.max, 1.1 * coarse.tolerance);
  ChordError in_place = coarse;
  in_place.step = 0.0;
  const auto without = chord_error_warnings(in_place, 1.0_um);
  ASSERT_EQ(without.size(), 1u);
  EXPECT_EQ(without.front().find(key), std::string::npos) << "no step helps where the tip rests";
  // of a machine that is off by far more it is no matter
  EXPECT_TRUE(chord_error_warnings(coarse, 100.0_um).empty());
}

TEST(ChordError, APerfectBeliefIsWarnedOfWhatItCannotSee) {
  const Job job = passes(
      "EZX = { kind = \"fourier\", period_mm = 5.0, b_um = [0.8] }\n"
      "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [60.0] }");
  const auto bends = [](const Cut& cut) {
    return std::ranges::any_of(cut.warnings, [](const std::string& text) {
      return text.find("bend the path between the samples") != std::string::npos;
    });
  };
  const Cut wrong = cut(job);
  EXPECT_FALSE(bends(wrong)) << "0.15 um of 60 um";
  EXPECT_GT(wrong.chord_error.max, 100.0_nm);
  const Cut corrected = cut(job, compensate(job, parse_case("perfect-iterated-ideal")));
  EXPECT_TRUE(bends(corrected));
  // other intervals are looked at where corrections turn an axis about
  EXPECT_NEAR(corrected.chord_error.max, wrong.chord_error.max, 10.0_nm);
  EXPECT_EQ(cut_error_free(job).chord_error.interval_count, 0u);
}

/// A part that turns carries the errors of its bed round: that is no bend.
TEST(ChordError, APartThatTurnsBendsNothing) {
  const Job job = job_of("platform_plane.toml", {{"part.vertices", "300"}});
  const ChordError found = looked(job);
  std::cout << "platform: " << found.max / units::nm << " nm, RMS " << found.rms / units::nm
            << " nm, line " << found.line << "\n";
  EXPECT_GT(found.interval_count, 100u);
  EXPECT_LT(found.max, 50.0_nm);
}

// The machines are scenes, not code: chains of every kind cut the same part.

struct MachineKind {
  const char* machine;
  const char* slides;
  const char* turns;
  double lead;  ///< deg
};

const MachineKind gantry_kind{"gantry_cxyza", "XYZ", "CA", 25.0};
const MachineKind other_machines[] = {{"trunnion_ca", "XYZ", "CA", 25.0},
                                      {"head_head", "XYZ", "CA", 25.0},
                                      {"three_axis_table", "XYZ", "", 0.0}};

/// A small dome whose chords (0.1 nm) and turns between points are too short to tell machines
/// apart.
BallRaster dome_on(const MachineKind& kind, const std::string& errors = {}) {
  return {.part =
              "surface = \"sphere_cap\"\nradius_mm = 100.0\nrim_radius_mm = 2.0\n"
              "at_mm = [40, 25, 80]\nvertices = 4000",
          .step_over = 0.4,
          .step = 0.01,
          .lead = kind.lead,
          .machine = kind.machine,
          .more = errors};
}

/// Every element that the machine can have: 20 um and 30 urad, error motions as cubics.
std::string random_errors(const MachineKind& kind, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const std::string linear = "XYZ", all = "XYZABC";
  std::string constants = "[errors]\n", curves;
  const auto size = [&](char direction) { return linear.find(direction) < 3 ? 20.0 : 30.0; };
  const auto suffix = [&](char direction) { return linear.find(direction) < 3 ? "um" : "urad"; };
  const auto constant = [&](const std::string& name) {
    constants +=
        fmt::format("{}_{} = {:.6f}\n", name, suffix(name[1]), size(name[1]) * unit(random));
  };
  for (const char axis : std::string(kind.slides) + kind.turns)
    for (const char direction : all) {
      const double s = size(direction) / 2;
      curves += fmt::format(
          "[errors.E{0}{1}]\nkind = \"polynomial\"\ncoefficients_{2} = "
          "[{3:.6f}, {4:.6f}, {5:.6f}, {6:.6f}]\nhalf_range_{7}\n",
          direction, axis, suffix(direction), s * unit(random), s * unit(random), s * unit(random),
          s * unit(random), linear.find(axis) < 3 ? "mm = 300" : "deg = 180");
    }
  for (const char* name : {"EXS", "EYS", "EZS", "EAS", "EBS", "EC0Y", "EB0Z", "EA0Z"})
    constant(name);
  if (kind.turns[0] != '\0')
    for (const char* name : {"EB0A", "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"})
      constant(name);
  return constants + curves;
}

TEST(ChainScenes, EveryMachineCutsTheMapOfTheGantry) {
  const Cut reference = cut_error_free(job_of(dome_on(gantry_kind)));
  for (const MachineKind& kind : other_machines) {
    const Job job = job_of(dome_on(kind));
    const Apart d = apart(cut_error_free(job).surface, reference.surface);
    std::cout << kind.machine << " against the gantry: rms " << d.rms / units::nm << " nm, max "
              << d.max / units::nm << " nm over " << d.vertices << " vertices, "
              << job.path.motion_blocks << " moves\n";
    EXPECT_GT(d.vertices, 3000) << kind.machine;
    EXPECT_EQ(d.unlike, 0) << kind.machine;
    EXPECT_LT(d.max, 1.0_nm) << kind.machine;
  }
}

TEST(ChainScenes, PerfectIteratedIdealMendsEveryMachine) {
  for (const MachineKind& kind :
       {gantry_kind, other_machines[0], other_machines[1], other_machines[2]}) {
    for (const unsigned seed : {20260401u, 20260402u}) {
      SCOPED_TRACE(testing::Message() << kind.machine << " seed " << seed);
      BallRaster scene = dome_on(kind, random_errors(kind, seed));
      scene.step = 0.2;
      // at home Z stands at the end of its travel, where no correction has room
      const Job job = job_of(scene, {{"machine.home.Z_mm", "280"}});
      const Cut error_free = cut_error_free(job);
      const Apart before = apart(cut(job).surface, error_free.surface);
      const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
      const Apart after = apart(compensated_commands.surface, error_free.surface);
      std::cout << kind.machine << ", seed " << seed << ": uncompensated rms "
                << before.rms / units::um << " um, iterated " << after.rms / units::nm
                << " nm, worst direction left "
                << compensated_commands.remaining_direction_error / units::urad << " urad\n";
      EXPECT_TRUE(compensated_commands.warnings.empty());
      EXPECT_GT(before.rms, 1.0_um);
      EXPECT_GT(after.vertices, 3000);
      EXPECT_EQ(after.unlike, 0);
      EXPECT_LT(after.rms, 1.0_nm);
    }
  }
}

}  // namespace
}  // namespace abbe::sim
