// Error motions of the platform's spindle and wrong turning tools against closed forms of what they
// leave on the part. Parts are small and feeds fine; where a closed form says nothing of the feed
// marks, what is left of them lies between 0 and their cusp. Nothing here takes a figure from the
// surface engine; "the error-free map" is only used where an error moves the whole cut along.

#include "cutting/map/form.h"
#include "sim/machine/run_out.h"
#include "sim/scene/read_scene.h"
#include "tests/oracles/closed_forms.h"
#include "tests/sim/scene_fingerprint.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

constexpr double nose_radius = 0.249;     // mm, radius of the diamond
constexpr double floor_of_maps = 0.1_nm;  // promised on a turned part of 25 mm

/// A turned part on the platform as a scene of its own.
struct Turning {
  std::string part;      ///< TOML lines: surface and its sizes
  std::string errors;    ///< TOML lines of [errors]
  double feed = 1.0_um;  ///< mm a revolution
  double end_radius = 0.0;
  std::vector<Override> more = {};
};

Job turning_job(const Turning& turning) {
  const SceneFolder folder;
  const std::string text = fmt::format(
      "machine = \"{0}machines/platform_xz.toml\"\ntool = \"{0}tools/diamond_r249um.toml\"\n"
      "[part]\n{1}\nturn_deg = [0, 90, 0]\nvertices = 4000\n"
      "[program]\ngenerator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = {2}\n"
      "start_beyond_rim_mm = 0.3\nend_radius_mm = {3}\n"
      "[sampling]\nchord_tolerance_nm = 0.05\n[errors]\n{4}\n",
      packaged("").string(), turning.part, turning.feed / units::um, turning.end_radius,
      turning.errors);
  return prepare(read_scene(folder.write("turning.toml", text), turning.more));
}

const std::string disc = "surface = \"disc\"\nradius_mm = 3.0";
/// A cone of 45 degrees.
const std::string cone =
    "surface = \"cone\"\nbase_radius_mm = 3.0\nheight_mm = 3.0\nhalf_apex_deg = 45.0";

/// The side of the spindle line on which the tool stands, along z of the workpiece.
double side_of(const Job& job) {
  return job.T_wt_nominal.front().translation().z() > 0 ? 1.0 : -1.0;
}

/// Spindle command, within a turn, at which the tool passes a vertex: a positive command turns the
/// tool about +x of the workpiece.
double spindle_at(const Job& job, const CutVertex& v) {
  const Vector3d p_w = job.scene.part.T_wm * v.p;
  return std::atan2(-side_of(job) * p_w.y(), side_of(job) * p_w.z());
}

double radius(const CutVertex& v) { return v.p.head<2>().norm(); }

void expect_below_cusp(const std::string& what, const Misfit& m, double cusp) {
  std::cout << what << ": residual less closed form from " << m.least / units::nm << " to "
            << m.most / units::nm << " nm over " << m.vertices << " vertices, cusp "
            << cusp / units::nm << " nm\n";
  EXPECT_GT(m.vertices, 500) << what;
  EXPECT_GT(m.least, -floor_of_maps) << what;
  EXPECT_LT(m.most, cusp + floor_of_maps) << what;
}

// The feed goes across 45 degrees on a cone: passes are feed sqrt 2 apart along it.
double cusp_of(const Turning& turning, bool on_cone = false) {
  return oracles::cusp(nose_radius, turning.feed * (on_cone ? std::sqrt(2.0) : 1.0));
}

// ---- synchronous motion

TEST(SpindleErrors, AxialOnceATurnLeavesACosineAtEveryRadiusOfAFace) {
  const double a = 2.0_um;
  const Turning facing{.part = disc,
                       .errors = "EXS = { kind = \"fourier\", period_deg = 360, a_um = [2.0] }",
                       .end_radius = 1.0};
  const Job job = turning_job(facing);
  const cutting::Surface surface = cut(job).surface;
  expect_below_cusp("axial 1x",
                    misfit(job, surface,
                           [&](const CutVertex& v) {
                             return radius(v) < 1.3 ? std::nan("")
                                                    : -a * std::cos(spindle_at(job, v));
                           }),
                    cusp_of(facing));
  // The whole cut of a meridian moves along: less the error-free map there is no cusp.
  const cutting::Surface still = cut_error_free(job).surface;
  double worst = 0.0;
  const auto moved = cut_vertices(job, surface), before = cut_vertices(job, still);
  ASSERT_EQ(moved.size(), before.size());
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (radius(moved[i]) < 1.3) continue;
    const double expected = -a * std::cos(spindle_at(job, moved[i]));
    worst = std::max(worst, std::abs(moved[i].residual - before[i].residual - expected));
  }
  std::cout << "axial 1x less the error-free map: off by at most " << worst / units::nm << " nm\n";
  EXPECT_LT(worst, floor_of_maps);
}

TEST(SpindleErrors, AxialHarmonicsOfAnyOrderAreSeenAtTheirAngle) {
  const Turning facing{
      .part = disc,
      .errors =
          "EXS = { kind = \"fourier\", period_deg = 360, a_um = [0, 0, 0, 0, 0.3], "
          "b_um = [0, -0.5] }",
      .end_radius = 2.0};
  const Job job = turning_job(facing);
  expect_below_cusp("axial 2x and 5x",
                    misfit(job, cut(job).surface,
                           [&](const CutVertex& v) {
                             const double S = spindle_at(job, v);
                             return radius(v) < 2.3
                                        ? std::nan("")
                                        : -0.3_um * std::cos(5 * S) + 0.5_um * std::sin(2 * S);
                           }),
                    cusp_of(facing));
}

TEST(SpindleErrors, TiltOnceATurnLeavesACosineThatGrowsWithTheRadius) {
  const double b = 40.0_urad;
  const Turning facing{.part = disc,
                       .errors = "EBS = { kind = \"fourier\", period_deg = 360, a_urad = [40.0] }",
                       .end_radius = 1.5};
  const Job job = turning_job(facing);
  const double side = side_of(job);
  expect_below_cusp("tilt 1x about Y",
                    misfit(job, cut(job).surface,
                           [&](const CutVertex& v) {
                             // the exact turn: second order is b^2 r
                             const double tilt = b * std::cos(spindle_at(job, v));
                             return radius(v) < 1.8 ? std::nan("")
                                                    : -side * radius(v) * std::tan(tilt);
                           }),
                    cusp_of(facing));
}

TEST(SpindleErrors, TiltOutOfTheSensitiveDirectionLeavesNothing) {
  const Turning facing{.part = disc,
                       .errors = "ECS = { kind = \"fourier\", period_deg = 360, a_urad = [40.0] }",
                       .end_radius = 1.5};
  const Job job = turning_job(facing);
  expect_below_cusp(
      "tilt 1x about Z",
      misfit(job, cut(job).surface,
             [&](const CutVertex& v) { return radius(v) < 1.8 ? std::nan("") : 0.0; }),
      cusp_of(facing));
}

/// Circle through a ring of the cone at its own height: a point moved by s along the normal is as a
/// meridian moved by s sqrt 2 across the axis.
cutting::Circle ring_of(const Job& job, const cutting::Surface& surface, double r, double width) {
  std::vector<Vector2d> points;
  for (const CutVertex& v : cut_vertices(job, surface)) {
    if (std::abs(radius(v) - r) > width) continue;
    const double across = v.residual * std::sqrt(2.0) - (radius(v) - r);
    points.push_back((r + across + (radius(v) - r)) * v.p.head<2>().normalized());
  }
  Eigen::Matrix<double, Eigen::Dynamic, 2> rows(Index(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(Index(i)) = points[i].transpose();
  EXPECT_GT(points.size(), 200u);
  return cutting::fit_circle(rows);
}

TEST(SpindleErrors, RadialOnceATurnWithTheSpindleLeavesARoundEccentricPart) {
  const double a = 2.0_um;
  // With S commanded the carriage turns by -S: (cos, -sin) in (y, z) goes round with the part.
  const Turning turning{.part = cone,
                        .errors =
                            "EYS = { kind = \"fourier\", period_deg = 360, a_um = [2.0] }\n"
                            "EZS = { kind = \"fourier\", period_deg = 360, b_um = [-2.0] }",
                        .end_radius = 2.0};
  const Job job = turning_job(turning);
  const cutting::Circle circle = ring_of(job, cut(job).surface, 2.6, 0.3);
  std::cout << "radial 1x with the spindle: eccentric by " << circle.centre.norm() / units::um
            << " um, roundness " << circle.roundness / units::nm << " nm\n";
  const double cusp = std::sqrt(2.0) * cusp_of(turning, true);
  EXPECT_NEAR(circle.centre.norm(), a, floor_of_maps + 0.2 * cusp);
  EXPECT_LT(circle.roundness, cusp + 2 * floor_of_maps);
}

TEST(SpindleErrors, RadialOnceATurnInTheSensitiveDirectionIsEccentricToo) {
  // Against the spindle's turning, or along one line only: the tool sees the same motion along z.
  // To second order the tip describes r + a sin + (3 a^2 / 2r) cos^2 of the azimuth, or without y
  // r + a sin, where the eccentric circle is r + a sin - (a^2 / 2r) cos^2.
  const double a = 2.0_um, r = 2.6;
  for (const std::string y :
       {"EYS = { kind = \"fourier\", period_deg = 360, a_um = [2.0] }\n", ""}) {
    const Turning turning{
        .part = cone,
        .errors = y + "EZS = { kind = \"fourier\", period_deg = 360, b_um = [2.0] }",
        .end_radius = 2.0};
    const Job job = turning_job(turning);
    const cutting::Circle circle = ring_of(job, cut(job).surface, r, 0.3);
    const double second = y.empty() ? a * a / (2 * r) : 2 * a * a / r;
    std::cout << "radial 1x " << (y.empty() ? "along z" : "against the spindle")
              << ": eccentric by " << circle.centre.norm() / units::um << " um, roundness "
              << circle.roundness / units::nm << " nm, second order " << second / units::nm
              << " nm\n";
    const double cusp = std::sqrt(2.0) * cusp_of(turning, true);
    EXPECT_NEAR(circle.centre.norm(), a, floor_of_maps + 0.2 * cusp);
    // the ring is 0.3 mm wide either way, its cusps stand on it
    EXPECT_GT(circle.roundness, 0.85 * second);
    EXPECT_LT(circle.roundness, 1.15 * second + cusp + 2 * floor_of_maps);
  }
}

// ---- asynchronous motion

/// The same job sampled at a stated turn of the spindle.
Job resampled(Job job, double turn) {
  program::SampleOptions options = sample_options(job.scene, job.machine);
  options.max_spindle_turn = turn;
  job.samples = program::sample(job.path, job.machine.nominal, options);
  job.T_wt_nominal.clear();
  for (const kinematics::AxisState& state : job.samples.states)
    job.T_wt_nominal.push_back(job.machine.nominal.tool_in_workpiece(state.q));
  return job;
}

TEST(SpindleErrors, AsynchronousMotionLeavesTheLowestOfItsPasses) {
  const double feed = 20.0_um, rim = 3.0;
  const Turning facing{
      .part = disc,
      .errors = "EXS = { kind = \"asynchronous\", rms_um = 0.3, seed = 5, highest_order = 6 }",
      .feed = feed,
      .end_radius = 2.0};
  Job job = turning_job(facing);
  const errors::Curve& curve = job.scene.geometric.elements.at(0).curves.at(0);
  job = resampled(std::move(job), std::sqrt(8 * 0.05_nm / errors::second_derivative_bound(curve)));
  const Misfit m = misfit(job, cut(job).surface, [&](const CutVertex& v) {
    if (radius(v) < 2.3 || radius(v) > rim - 0.05) return std::nan("");
    double least = std::numeric_limits<double>::infinity();
    for (int turn = 0; turn < 80; ++turn) {  // the spiral starts 0.3 mm beyond the rim
      double S = spindle_at(job, v);
      S += 2 * pi * (turn + (S < 0 ? 1 : 0));
      const double pass = rim + 0.3 - feed * S / (2 * pi), off = radius(v) - pass;
      if (std::abs(off) > 0.1) continue;
      const errors::CurveState state{S, -S, 1, 0, true};
      least = std::min(least, oracles::cusp(nose_radius, 2 * off) - errors::value(curve, state));
    }
    return least;
  });
  std::cout << job.samples.states.size() << " samples\n";
  expect_below_cusp("asynchronous axial motion", m, 0.0);
}

TEST(SpindleErrors, AsynchronousMotionIsReadWithItsSeed) {
  const Turning turning{.part = disc,
                        .errors =
                            "EZS = { kind = \"asynchronous\", rms_um = 0.5 }\n"
                            "EBS = { kind = \"asynchronous\", rms_urad = 2, seed = 9, "
                            "lowest_order = 1, highest_order = 4 }",
                        .feed = 100.0_um};
  const Job job = turning_job(turning);
  const auto& elements = job.scene.geometric.elements;
  ASSERT_EQ(elements.size(), 2u);
  const auto& z = std::get<errors::Asynchronous>(elements[0].curves[0].shape);
  const auto& b = std::get<errors::Asynchronous>(elements[1].curves[0].shape);
  EXPECT_EQ(z.rms, 0.5_um);
  EXPECT_EQ(z.lowest_order, 0.3);
  EXPECT_EQ(z.highest_order, 20.0);
  EXPECT_DOUBLE_EQ(b.rms, 2.0_urad);
  EXPECT_EQ(b.seed, 9u);
  EXPECT_EQ(b.lowest_order, 1.0);
  EXPECT_EQ(b.highest_order, 4.0);
  Turning other = turning;
  other.more = {{"seed", "2"}};
  EXPECT_NE(
      std::get<errors::Asynchronous>(turning_job(other).scene.geometric.elements[0].curves[0].shape)
          .seed,
      z.seed);
}

TEST(SpindleErrors, AsynchronousMotionThatCannotBeIsRefused) {
  const auto input_errors = [](const std::string& errors) -> std::string {
    return thrown_text<std::exception>(
        [&] { turning_job(Turning{.part = disc, .errors = errors, .feed = 100.0_um}); }, "none");
  };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_PRED2(has, input_errors("EZS = { kind = \"asynchronous\" }"), "rms_um");
  EXPECT_PRED2(has, input_errors("EZS = { kind = \"asynchronous\", rms_um = -1 }"), "rms_um");
  EXPECT_PRED2(has,
               input_errors("EZS = { kind = \"asynchronous\", rms_um = 1, lowest_order = 30 }"),
               "highest order");
  EXPECT_PRED2(has, input_errors("EZS = { kind = \"asynchronous\", rms_um = 1, lowest_order = 0 }"),
               "lowest_order");
  EXPECT_PRED2(has, input_errors("EXX = { kind = \"asynchronous\", rms_um = 1 }"),
               "rotary axes only");
}

// ---- the tool

TEST(TurningTool, CentringHeightLeavesMaterialByItsSquareOverTheDiameter) {
  for (const double h : {0.05, -0.05}) {
    const Turning turning{.part = cone,
                          .errors = "",
                          .end_radius = 2.0,
                          .more = {{"tool.actual.centring_height_mm", fmt::format("{}", h)}}};
    const Job job = turning_job(turning);
    const Misfit m = misfit(job, cut(job).surface, [&](const CutVertex& v) {
      const double r = radius(v);
      if (r < 2.3) return std::nan("");
      // The edge at the height h makes the cone g(z) a hyperboloid sqrt(g^2 + h^2). Along the
      // normal of 45 degrees: r + s / sqrt 2 = hypot(r - s / sqrt 2, h), so across the axis it is
      // h^2 / 2r exactly.
      return h * h / (2 * r) / std::sqrt(2.0);
    });
    expect_below_cusp(fmt::format("centring height {} mm on a cone", h), m, cusp_of(turning, true));
  }
}

TEST(TurningTool, CentringHeightLeavesAFlatFaceFlat) {
  const Turning facing{.part = disc,
                       .errors = "",
                       .feed = 2.0_um,
                       .more = {{"tool.actual.centring_height_mm", "0.05"}}};
  const Job job = turning_job(facing);
  expect_below_cusp(
      "centring height on a face",
      misfit(job, cut(job).surface,
             [&](const CutVertex& v) { return radius(v) < 0.06 ? std::nan("") : 0.0; }),
      cusp_of(facing));
}

TEST(TurningTool, NoseOfAnotherRadiusOffsetsEverySurface) {
  for (const double more : {1.0_um, -3.0_um}) {
    for (const std::string& part : {disc, cone}) {
      const Turning turning{
          .part = part,
          .errors = "",
          .end_radius = 2.0,
          .more = {{"tool.actual.radius_mm", fmt::format("{:.6f}", nose_radius + more)}}};
      const Job job = turning_job(turning);
      expect_below_cusp(
          fmt::format("nose larger by {} mm", more),
          misfit(job, cut(job).surface,
                 [&](const CutVertex& v) { return radius(v) < 2.3 ? std::nan("") : -more; }),
          cusp_of(turning, part == cone) * nose_radius / (nose_radius + more));
    }
  }
}

TEST(TurningTool, LongerToolCutsDeeperAlongTheSpindle) {
  const double more = 4.0_um;
  for (const std::string& part : {disc, cone}) {
    const Turning turning{.part = part,
                          .errors = "",
                          .end_radius = 2.0,
                          .more = {{"tool.actual.length_mm", "60.004"}}};
    const Job job = turning_job(turning);
    expect_below_cusp("tool longer by 4 um",
                      misfit(job, cut(job).surface,
                             [&](const CutVertex& v) {
                               return radius(v) < 2.3 ? std::nan("") : -more * v.n.z();
                             }),
                      cusp_of(turning, part == cone));
  }
}

TEST(TurningTool, WavesOfTheNoseAreCopiedOntoASphere) {
  const double A = 0.1_um, rho = 8.0;
  const int order = 12;
  const double phase = 40.0_deg;
  const Turning turning{
      .part = fmt::format("surface = \"sphere_cap\"\nradius_mm = {}\nrim_radius_mm = 4.0", rho),
      .errors = "",
      .more = {{"tool.actual.wave", "[{ order = 12, amplitude_um = 0.1, phase_deg = 40.0 }]"}}};
  const Job job = turning_job(turning);
  const double side = side_of(job);
  const Misfit m = misfit(job, cut(job).surface, [&](const CutVertex& v) {
    const double r = radius(v);
    if (r < 0.3) return std::nan("");
    // The edge touches where its outward direction is against the normal: frame t has x along z
    // and z along x of the workpiece. How far the edge reaches in a direction, with the part that
    // its slope adds.
    const double psi = std::atan2(-v.n.z(), -side * r / rho);
    const double wave = A * std::cos(order * psi + phase);
    const double slope = -order * A * std::sin(order * psi + phase);
    const double bend = -order * order * wave;
    return -(wave + slope * slope / (2 * (nose_radius + wave - bend)));
  });
  // passes lie up to 1 / cos 30 of the feed apart along the sphere
  expect_below_cusp("nose with a wave of order 12", m,
                    oracles::cusp(nose_radius, turning.feed / std::cos(pi / 6)) * 1.2);
}

// Run-out of a milling spindle against the envelope of the enlarged cutter, which is a convex body
// whose support function is written down here, and against hand-computed circles.

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
    const Index k = Index(i);
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
  for (Index i = 0; i < none.residual.size(); ++i)
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
  const std::string said = thrown_text<BadInput>([&] { with_run_out(scene); });
  EXPECT_HAS(said, "EXS: expected a period above 0");
  // What a spindle cannot have is refused as before, though its curves were taken.
  scene = gantry_with(once("EXS", 2.0, 0));
  scene.geometric.elements.at(0).name = {'C', 'S', false};
  EXPECT_THROW(prepare(scene), BadInput);
}

}  // namespace
}  // namespace abbe::sim
