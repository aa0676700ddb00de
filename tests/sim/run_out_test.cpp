// Run-out of a milling spindle against the envelope of the enlarged cutter, which is a convex body
// whose support function is written down here, and against hand-computed circles.

#include "sim/machine/run_out.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_fingerprint.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;

constexpr double length = 100.0;  // mm, of the tool
constexpr double flat_step_over = 0.5;

/// A flat under the ball, passes along x at whole multiples of the step-over.
BallRaster flat_under_ball(double lead_deg, const std::string& errors) {
  return {.part =
              "surface = \"rectangle\"\nlength_x_mm = 10.0\nlength_y_mm = 10.0\n"
              "at_mm = [40, 25, 60]\nvertices = 4000",
          .step_over = flat_step_over,
          .lead = lead_deg,
          .more = errors.empty() ? "" : "[errors]\n" + errors};
}

Scene gantry_with(const std::string& errors) { return scene_of(flat_under_ball(0.0, errors)); }

std::string once(const std::string& element, double cosine, double sine) {
  const std::string unit = element[1] <= 'C' ? "urad" : "um";
  return fmt::format(
      "{0} = {{ kind = \"fourier\", period_deg = 360, a_{1} = [{2:.6f}], b_{1} = [{3:.6f}] }}\n",
      element, unit, cosine, sine);
}

/// The axis of the spindle goes round on a circle.
std::string round_and_round(double radius_um) {
  return once("EXS", radius_um, 0) + once("EYS", 0, radius_um);
}

double radial(const Scene& scene) {
  return std::get<cutting::Cutter>(scene.tool.actual).radius -
         std::get<cutting::Cutter>(scene.tool.nominal).radius;
}
double axial(const Scene& scene) { return scene.tool.actual_length - scene.tool.length; }

// ---- what it leaves on a part

/// What a ball whose axis goes round at `radial` leaves of a flat at `across` from its pass, the
/// axis leaning by `lead` in the feed plane: below the middle of the ball the body reaches
/// H(mu) = radius + radial sin(angle to the axis) in the direction mu off the vertical across the
/// feed.
double left_of_flat(double across, double radial, double lead) {
  const auto reach = [&](double mu) {
    const double along = std::cos(mu) * std::cos(lead);
    const double H = ball_radius + radial * std::sqrt(std::max(0.0, 1.0 - along * along));
    return (H - across * std::sin(mu)) / std::cos(mu);
  };
  double low = -0.2, high = 0.2;
  for (int i = 0; i < 200; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (reach(a) < reach(b) ? high : low) = reach(a) < reach(b) ? b : a;
  }
  return ball_radius - reach(0.5 * (low + high));
}

void expect_closed_form(const std::string& what, const Misfit& m) {
  std::cout << what << ": residual less closed form from " << m.least / units::nm << " to "
            << m.most / units::nm << " nm over " << m.vertices << " vertices\n";
  EXPECT_GT(m.vertices, 1000) << what;
  EXPECT_LT(m.magnitude(), 1.0_nm) << what;
}

TEST(SpindleRunOut, RadialOnceATurnCutsAFlatDeeperByItsShareAcrossTheAxis) {
  for (const double lead : {5.0, 36.0, 60.0}) {
    const double a = 4.0_um;
    const Job job = job_of(flat_under_ball(lead, round_and_round(4.0)));
    expect_closed_form(fmt::format("radial 1x of 4 um, lead {} deg", lead),
                       misfit(job, cut(job).surface, [&](const CutVertex& v) {
                         return left_of_flat(off_grid(v.p.y(), flat_step_over), a,
                                             lead * units::deg);
                       }));
    EXPECT_NEAR(left_of_flat(0, a, lead * units::deg), -a * std::sin(lead * units::deg), 1e-9);
  }
}

TEST(SpindleRunOut, AxialOnceATurnLowersAFlatByItsAmplitude) {
  for (const double lead : {0.0, 36.0}) {
    const Job job = job_of(flat_under_ball(lead, once("EZS", 3.0, 0)));
    expect_closed_form(fmt::format("axial 1x of 3 um, lead {} deg", lead),
                       misfit(job, cut(job).surface, [&](const CutVertex& v) {
                         return left_of_flat(off_grid(v.p.y(), flat_step_over), 0,
                                             lead * units::deg) -
                                3.0_um * std::cos(lead * units::deg);
                       }));
  }
}

TEST(SpindleRunOut, RadialOnceATurnCutsAWallDeeperByItsAmplitude) {
  const SceneFolder folder;
  const std::string scenes = packaged("").string();
  const Job job = prepare(read_scene(folder.write(
      "wall.toml",
      fmt::format("machine = \"{0}machines/gantry_cxyza.toml\"\ntool = \"{0}tools/flat_r8.toml\"\n"
                  "[part]\nsurface = \"cone\"\nbase_radius_mm = 20.0\nheight_mm = 10.0\n"
                  "half_apex_deg = 15.0\nat_mm = [20, 30, 60]\nvertices = 4000\n"
                  "[program]\ngenerator = \"flank\"\ntip_below_mm = 2.0\n[errors]\n{1}",
                  scenes, round_and_round(2.5)))));
  const cutting::Surface still = cut_error_free(job).surface;
  const cutting::Surface wide = cut(job).surface;
  Misfit m;
  for (std::size_t i = 0; i < wide.status.size(); ++i) {
    if (wide.status[i] != cutting::VertexStatus::Cut) continue;
    const Eigen::Index k = Eigen::Index(i);
    const double by = wide.residual[k] - still.residual[k] + 2.5_um;
    m.least = std::min(m.least, by);
    m.most = std::max(m.most, by);
    ++m.vertices;
  }
  expect_closed_form("radial 1x of 2.5 um on a wall, less the error-free map", m);
}

// ---- how much it is

TEST(SpindleRunOut, IsTheFarthestThatTheAxisGoes) {
  const struct {
    std::string errors;
    double radial, axial;  // um
  } cases[] = {
      {round_and_round(2.0), 2.0, 0.0},
      {once("EXS", 3.0, 0) + once("EYS", 0, 1.0), 3.0, 0.0},
      {once("EXS", 3.0, 4.0), 5.0, 0.0},
      {once("EZS", -1.5, 2.0), 0.0, 2.5},
      {round_and_round(2.0) + once("EZS", 1.0, 0), 2.0, 1.0},
      // cos + cos 2x / 2 comes down to -0.75 and up to 1.5
      {"EZS = { kind = \"fourier\", period_deg = 360, a_um = [1.0, 0.5] }\n", 0.0, 0.75},
      {"EZS = { kind = \"fourier\", period_deg = 360, a_um = [1.0, 0.5], negate = true }\n", 0.0,
       1.5},
      // the middle of the ball hangs 95 mm below the nose
      {once("EAS", 10.0, 0) + once("EBS", 0, 10.0), 0.95, 0.0},
      // tilting about y by + moves what hangs below to -x: against EXS
      {once("EXS", 2.0, 0) + once("EBS", 10.0, 0), 2.0 - 0.95, 0.0},
      {once("EXS", 2.0, 0) + once("EBS", -10.0, 0), 2.0 + 0.95, 0.0},
      {once("EYS", 2.0, 0) + once("EAS", 10.0, 0), 2.0 + 0.95, 0.0},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.errors);
    const Scene scene = with_run_out(gantry_with(c.errors));
    EXPECT_NEAR(radial(scene), c.radial * units::um,
                1e-8 * units::um + 2e-9 * c.radial * units::um);
    EXPECT_NEAR(axial(scene), c.axial * units::um, 1e-8 * units::um);
    for (const errors::Element& element : scene.geometric.elements)
      EXPECT_TRUE(element.curves.empty());
  }
}

TEST(SpindleRunOut, ErrorScaleCountsWithItsSign) {
  Scene scene = gantry_with("EZS = { kind = \"fourier\", period_deg = 360, a_um = [1.0, 0.5] }\n" +
                            once("EXS", 2.0, 0));
  scene.error_scale = 2.0;
  EXPECT_NEAR(axial(with_run_out(scene)), 1.5_um, 1e-8 * units::um);
  EXPECT_NEAR(radial(with_run_out(scene)), 4.0_um, 1e-8 * units::um);
  scene.error_scale = -1.0;
  EXPECT_NEAR(axial(with_run_out(scene)), 1.5_um, 1e-8 * units::um);
  EXPECT_NEAR(radial(with_run_out(scene)), 2.0_um, 1e-8 * units::um);
}

TEST(SpindleRunOut, MotionThatDoesNotRepeatEveryTurnIsSeenOverMany) {
  // Twice around and 3/4 of a turn a period: their crests meet within three turns.
  const Scene scene = with_run_out(gantry_with(
      "EZS = [{ kind = \"fourier\", period_deg = 720, a_um = [1.0] },\n"
      "       { kind = \"fourier\", period_deg = 270, a_um = [0, 0], b_um = [0, 0.5] }]\n"));
  double lowest = 0.0;
  for (int i = 0; i < 600000; ++i) {
    const double angle = i * 12 * std::numbers::pi / 600000;  // both repeat in 6 turns
    lowest = std::min(lowest, std::cos(angle / 2) + 0.5 * std::sin(angle * 8 / 3));
  }
  std::cout << "two that meet: " << axial(scene) / units::um << " um, by search " << -lowest
            << "\n";
  EXPECT_NEAR(axial(scene) / units::um, -lowest, 5e-5);
}

TEST(SpindleRunOut, AsynchronousMotionCountsByTheMostOfManyTurns) {
  const auto of_seed = [](int seed) {
    return gantry_with(
        fmt::format("EZS = {{ kind = \"asynchronous\", rms_um = 0.5, seed = {} }}\n", seed));
  };
  double least = 1e9, most = 0.0;
  for (int seed = 1; seed <= 5; ++seed) {
    const double a = axial(with_run_out(of_seed(seed)));
    EXPECT_EQ(a, axial(with_run_out(of_seed(seed))));  // the same bits
    least = std::min(least, a);
    most = std::max(most, a);
    // over ten turns it comes as low nowhere
    const Scene scene = of_seed(seed);
    const errors::Curve& curve = scene.geometric.elements.at(0).curves.at(0);
    for (int i = 0; i < 3000; ++i) {
      const double angle = i * 20 * std::numbers::pi / 3000;
      EXPECT_LT(-errors::value(curve, {angle, angle, 1, 0, false}), 1.002 * a);
    }
  }
  std::cout << "asynchronous of 0.5 um rms: " << least / units::um << " to " << most / units::um
            << " um over five seeds\n";
  EXPECT_GT(least, 3 * 0.5_um);
  EXPECT_LT(most, 6 * 0.5_um);
  EXPECT_GT(most, least);
}

// ---- what it leaves alone

TEST(SpindleRunOut, SceneWithoutSuchCurvesIsTheSameToTheBit) {
  for (const char* name : {"gantry_dome.toml", "gantry_perfect.toml", "platform_plane.toml"}) {
    const Scene scene = read_scene(packaged(name));
    EXPECT_EQ(fingerprint(with_run_out(scene)), fingerprint(scene)) << name;
  }
  const cutting::Surface none = cut(job_of(flat_under_ball(36.0, "EXX_um = 5.0"))).surface;
  const cutting::Surface zero =
      cut(job_of(flat_under_ball(36.0, "EXX_um = 5.0\n" + once("EXS", 0, 0) + once("EBS", 0, 0))))
          .surface;
  ASSERT_EQ(none.residual.size(), zero.residual.size());
  for (Eigen::Index i = 0; i < none.residual.size(); ++i)
    ASSERT_EQ(std::bit_cast<std::uint64_t>(none.residual[i]),
              std::bit_cast<std::uint64_t>(zero.residual[i]));
}

TEST(SpindleRunOut, OtherCurvesOfTheSpindleStay) {
  const Scene scene = with_run_out(gantry_with(
      "EXS = [{ kind = \"constant\", value_um = 7.0 },\n"
      "       { kind = \"fourier\", period_deg = 360, a_um = [2.0] }]\nEBS_urad = 30.0\n"
      "EXC = { kind = \"fourier\", period_deg = 360, a_um = [1.0] }\n"));
  EXPECT_NEAR(radial(scene), 2.0_um, 1e-8 * units::um);
  int curves = 0;
  for (const errors::Element& element : scene.geometric.elements)
    curves += int(element.curves.size());
  EXPECT_EQ(curves, 3);
}

TEST(SpindleRunOut, IsNotSampledAlongTheProgram) {
  const Job still = job_of(flat_under_ball(36.0, ""));
  const Job runs_out = job_of(flat_under_ball(36.0, round_and_round(4.0) + once("EBS", 20, 0)));
  EXPECT_EQ(still.samples.states.size(), runs_out.samples.states.size());
  EXPECT_TRUE(runs_out.truth.geometric.terms.empty());
}

TEST(SpindleRunOut, CurveThatCannotBeIsRefusedByName) {
  Scene scene = gantry_with(once("EXS", 2.0, 0));
  std::get<errors::Fourier>(scene.geometric.elements.at(0).curves.at(0).shape).period = 0.0;
  try {
    with_run_out(scene);
    FAIL();
  } catch (const BadInput& fault) {
    EXPECT_NE(std::string(fault.what()).find("EXS: expected a period above 0"), std::string::npos)
        << fault.what();
  }
  // What a spindle cannot have is refused as before, though its curves were taken.
  scene = gantry_with(once("EXS", 2.0, 0));
  scene.geometric.elements.at(0).name = {'C', 'S', false};
  EXPECT_THROW(prepare(scene), BadInput);
}

}  // namespace
}  // namespace abbe::sim
