// Datum, control belief, tool, clamping and centring against closed forms of what they do.

#include "sim/cut/placement.h"
#include "sim/scene/read_scene.h"
#include "tests/oracles/closed_forms.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const std::string typical_file = packaged("errors/gantry_typical.toml").string();

/// The gantry goes to a point of the workpiece with A and C at zero, under G43.4 or in axes.
Job going_to(const Vector3d& point_w, const std::string& more, const std::string& head = "") {
  const SceneFolder folder;
  folder.write("go.ngc", fmt::format("G21 G90 G94\nG43.4 H1\nG1 X{} Y{} Z{} A0 C0 F1000\nM2\n",
                                     point_w.x(), point_w.y(), point_w.z()));
  return prepare(read_scene(folder.write(
      "go.toml",
      fmt::format(
          "{1}machine = \"{0}machines/gantry_cxyza.toml\"\ntool = \"{0}tools/ball_r5.toml\"\n"
          "[part]\nsurface = \"disc\"\nradius_mm = 10.0\nvertices = 100\n"
          "[program]\nfile = \"go.ngc\"\n{2}",
          packaged("").string(), head, more))));
}

/// Where the tip really is against where it should be when the program ends.
Vector3d deviation_at_the_end(const Job& job) {
  return tool_in_workpiece(job.truth, uncompensated_commands(job).samples.states.back())
             .translation() -
         job.T_wt_nominal.back().translation();
}

const std::string typical_errors = "errors = \"" + typical_file + "\"\n";

TEST(Datum, IdealBringsTheTipToItsPointExactly) {
  for (const Vector3d& point :
       {Vector3d(40, 25, 80), Vector3d(-120, 60, 20), Vector3d(0, 0, 150)}) {
    const std::string datum = fmt::format("[datum]\nkind = \"ideal\"\npoint_mm = [{}, {}, {}]\n",
                                          point.x(), point.y(), point.z());
    const Vector3d before = deviation_at_the_end(going_to(point, "", typical_errors));
    const Job job = going_to(point, datum, typical_errors);
    ASSERT_LT((job.T_wt_nominal.back().translation() - point).norm(), 1e-9);
    const Vector3d after = deviation_at_the_end(job);
    std::cout << "datum at " << point.transpose() << ": tip off by " << before.norm() / units::um
              << " um without, " << after.norm() << " mm with an ideal datum\n";
    EXPECT_GT(before.norm(), 5.0_um);
    EXPECT_LT(after.norm(), 1e-9);
  }
}

TEST(Datum, TouchOffTakesOutTheComponentsThatItTouched) {
  const Vector3d point(40, 25, 80);
  const std::string at = "point_mm = [40, 25, 80], direction = ";
  const Vector3d before = deviation_at_the_end(going_to(point, "", typical_errors));
  struct Touches {
    std::string list;
    Vector3d seen;
  };
  for (const Touches& touches :
       {Touches{"{ " + at + "[0, 0, 1] }", {0, 0, 1}},
        Touches{"{ " + at + "[1, 0, 0] }, { " + at + "[0, 0, -2] }", {1, 0, 1}},
        Touches{"{ " + at + "[1, 0, 0] }, { " + at + "[0, 1, 0] }, { " + at + "[0, 0, 1] }",
                {1, 1, 1}}}) {
    const Vector3d after = deviation_at_the_end(going_to(
        point, "[datum]\nkind = \"touch_off\"\ntouch = [" + touches.list + "]\n", typical_errors));
    std::cout << "touched along " << touches.seen.transpose() << ": tip off by "
              << after.transpose() / units::um << " um, before " << before.transpose() / units::um
              << " um\n";
    for (int k = 0; k < 3; ++k) {
      // the deviation itself changes by up to 1e-3 of the shift
      EXPECT_NEAR(after[k], touches.seen[k] > 0 ? 0.0 : before[k], 2e-3 * before.norm())
          << "axis " << k;
      EXPECT_GT(std::abs(before[k]), 0.5_um);
    }
  }
}

TEST(Datum, TouchesAtTwoPlacesHoldAtTheirOwnPlaces) {
  // z is touched on one side, x on the other: each component is right where it was touched.
  const std::string datum =
      "[datum]\nkind = \"touch_off\"\ntouch = [{ point_mm = [100, 0, 50], direction = [0, 0, 1] }, "
      "{ point_mm = [-100, 0, 50], direction = [1, 0, 0] }]\n";
  const Vector3d right = deviation_at_the_end(going_to({100, 0, 50}, datum, typical_errors));
  const Vector3d left = deviation_at_the_end(going_to({-100, 0, 50}, datum, typical_errors));
  std::cout << "touched z at x = 100: " << right.transpose() / units::um
            << " um; touched x at x = -100: " << left.transpose() / units::um << " um\n";
  EXPECT_LT(std::abs(right.z()), 0.05_um);
  EXPECT_LT(std::abs(left.x()), 0.05_um);
  EXPECT_GT(std::abs(right.x()), 0.5_um);
  EXPECT_GT(std::abs(left.z()), 0.5_um);
}

/// What is said of a touch of the disc on the table, with more in the scene; empty if it is taken.
std::string said_of_touch(const std::string& point, const std::string& direction,
                          const std::string& more = "") {
  const Job job =
      going_to({0, 0, 0}, more + "[datum]\nkind = \"touch_off\"\ntouch = [{ point_mm = " + point +
                              ", direction = " + direction + " }]\n");
  const std::optional<BadInput> error = touch_error(job);
  return error ? error->what() : "";
}

TEST(Datum, ATouchNeedsWhatItTouches) {
  const std::string jaw =
      "[[fixture]]\nname = \"jaw\"\nshape = \"box\"\nsize_mm = [20, 20, 40]\nat_mm = [100, 0, "
      "20]\n";
  const std::string blank =
      "[cutting]\nblank = \"box\"\nlower_mm = [-15, -15, -5]\nupper_mm = [15, 15, 3]\nspacing_mm = "
      "1\n";
  EXPECT_EQ(said_of_touch("[0, 0, 0]", "[0, 0, -1]"), "");
  EXPECT_EQ(said_of_touch("[0, 0, 1.9]", "[0, 0, -2]"), "") << "within the band";
  EXPECT_EQ(said_of_touch("[9, 0, 0]", "[0.8, 0, -1]"), "") << "38.7 degrees";
  EXPECT_EQ(said_of_touch("[100, 0, 0]", "[0, 0, -1]"), "") << "the table";
  EXPECT_EQ(said_of_touch("[110, 0, 30]", "[-1, 0, 0]", jaw), "");
  EXPECT_EQ(said_of_touch("[15, 0, 1]", "[-1, 0, 0]", blank), "");
  for (const auto& [point, direction, says] : std::vector<std::array<std::string, 3>>{
           {"[0, 0, 2.1]", "[0, 0, -1]",
            "a touch in the air: the nearest body is the part, 2.1 mm away"},
           {"[400, 0, 0]", "[0, 0, -1]",
            "a touch in the air: the nearest body is table, 150 mm away"},
           {"[0, 0, 0]", "[1, 0, 0]", "along a face of the part: its direction is 90 degrees"},
           {"[0, 0, 0]", "[0.9, 0, -1]", "its direction is 42 degrees"},
           {"[0, 0, 0]", "[0, 0, 1]", "a touch from inside the part"},
           {"[110, 0, 30]", "[-1, 0, 0]", "a touch in the air"},
           {"[15, 0, 1]", "[-1, 0, 0]", "along a face"}}) {
    const std::string said = said_of_touch(point, direction);
    EXPECT_HAS(said, says) << point << direction;
    EXPECT_HAS(said, "go.toml:11:23: expected a touch of");
  }
}

constexpr double plane_step_over = 0.5;  // mm, step over
constexpr double plane_height = 80.0;    // mm, of the plane above the workpiece frame

/// A plane at x = 40, y = 25 under the ball, passes at multiples of the step over from its middle;
/// A stands at the lead and C at a right angle throughout.
BallRaster plane(double lead, const std::string& more = {}) {
  return {.part =
              "surface = \"rectangle\"\nlength_x_mm = 12.0\nlength_y_mm = 10.0\n"
              "at_mm = [40, 25, 80]\nvertices = 5000",
          .step_over = plane_step_over,
          .lead = lead,
          .more = more};
}

double ridge(double y, double radius = ball_radius) {
  return oracles::cusp(radius, 2 * off_grid(y, plane_step_over));
}

void expect_within_nm(const std::string& what, const Misfit& m) {
  std::cout << what << ": " << m.vertices << " vertices within " << m.magnitude() / units::nm
            << " nm of the closed form\n";
  EXPECT_GT(m.vertices, 4000) << what;
  EXPECT_LT(m.magnitude(), 1.0_nm) << what;
}

TEST(ControlBelief, PivotTakenTooHighLowersTheTipByItsVersedSine) {
  const double off = 20.0_um;
  for (const double lead : {15.0, 30.0, 60.0}) {
    const Job job = job_of(plane(lead, "[control]\naxis.A.point_mm = [0, 0, 200.02]\n"));
    const double shift = -off * (1 - std::cos(lead * units::deg));
    std::cout << "pivot 20 um too high, A " << lead << " deg: " << shift / units::um << " um\n";
    expect_within_nm("  map", misfit(job, cut(job).surface,
                                     [&](const CutVertex& v) { return ridge(v.p.y()) + shift; }));
  }
}

TEST(ControlBelief, ToolLengthTakenTooLongLeavesMaterialAlongTheAxis) {
  // H1 is what the control believes: the tip really stands short by 15 um along the tool axis.
  const double off = 15.0_um, lead = 30.0;
  const Job job = job_of(plane(lead, "[control]\ntool_length_mm = 100.015\n"));
  const double shift = off * std::cos(lead * units::deg);
  expect_within_nm(
      "tool length believed 15 um too long",
      misfit(job, cut(job).surface, [&](const CutVertex& v) { return ridge(v.p.y()) + shift; }));
}

TEST(Setup, ClampingMovesThePartUnderTheTool) {
  struct Clamping {
    std::string toml;
    Vector3d d, theta;
  };
  for (const Clamping& c :
       {Clamping{"EZ_um = 12.0", {0, 0, 12.0_um}, {0, 0, 0}},
        Clamping{"EY_um = -30.0", {0, -30.0_um, 0}, {0, 0, 0}},
        Clamping{"EA_urad = 40.0\nEB_urad = -25.0", {0, 0, 0}, {40.0_urad, -25.0_urad, 0}},
        Clamping{"EX_um = 7.0\nEY_um = 9.0\nEZ_um = -11.0\nEA_urad = 20.0\nEB_urad = 15.0\nEC_urad "
                 "= -30.0",
                 {7.0_um, 9.0_um, -11.0_um},
                 {20.0_urad, 15.0_urad, -30.0_urad}}}) {
    const Job job = job_of(plane(36.0, "[setup]\n" + c.toml + "\n"));
    // The part moved by d + theta x p, so in its own frame every centre of the ball moves back.
    const auto expected = [&](const CutVertex& v) {
      double least = 1e9;
      for (int pass = -22; pass <= 22; ++pass) {
        const Vector3d centre(v.p.x(), pass * plane_step_over, ball_radius);
        const Vector3d moved =
            centre - c.d - c.theta.cross(centre + Vector3d(40, 25, plane_height));
        const double across = v.p.y() - moved.y();
        if (std::abs(across) < ball_radius)
          least =
              std::min(least, moved.z() - std::sqrt(ball_radius * ball_radius - across * across));
      }
      return least;
    };
    expect_within_nm("clamping " + c.toml.substr(0, c.toml.find('\n')),
                     misfit(job, cut(job).surface, expected));
  }
}

TEST(Tool, BallOfAnotherRadiusTouchesTheTipStill) {
  for (const double more : {10.0_um, -25.0_um}) {
    const double lead = 36.0;
    const Job job =
        job_of(plane(lead), {{"tool.actual.radius_mm", fmt::format("{:.6f}", ball_radius + more)}});
    const double shift = -more * (1 - std::cos(lead * units::deg));
    expect_within_nm(fmt::format("ball larger by {} mm", more),
                     misfit(job, cut(job).surface, [&](const CutVertex& v) {
                       return ridge(v.p.y(), ball_radius + more) + shift;
                     }));
  }
}

TEST(Tool, LongerToolCutsDeeperAlongItsAxis) {
  const double more = 18.0_um;
  for (const double lead : {20.0, 50.0}) {
    const Job job = job_of(plane(lead), {{"tool.actual.length_mm", "100.018"}});
    const double shift = -more * std::cos(lead * units::deg);
    expect_within_nm(
        fmt::format("tool longer by 18 um, lead {} deg", lead),
        misfit(job, cut(job).surface, [&](const CutVertex& v) { return ridge(v.p.y()) + shift; }));
  }
}

/// A tool that stands off by e along the radius, on a part of the platform. What is left of the
/// feed itself lies between 0 and its cusp.
void centring(const std::string& scene, double e, double min_r, double max_r,
              const std::function<double(const CutVertex&, double)>& shift) {
  const double feed = 0.004, cusp = oracles::cusp(0.249, feed);
  const Job job = job_of(scene, {{"errors.scale", "0"},
                                 {"program.feed_um_per_rev", "4"},
                                 {"part.vertices", "4000"},
                                 {"tool.actual.centring_offset_mm", fmt::format("{:.6f}", e)}});
  // the side of the axis on which the tool stands
  const double side = job.T_wt_nominal.front().translation().z() > 0 ? 1.0 : -1.0;
  const int S = job.machine.workpiece_spindle.value();
  ASSERT_EQ(job.samples.states.front().q[S], 0.0);
  const Misfit m = misfit(job, cut(job).surface, [&](const CutVertex& v) {
    const double r = v.p.head<2>().norm();
    return r < min_r || r > max_r ? std::nan("") : shift(v, side * e);
  });
  std::cout << scene << " " << min_r << " to " << max_r << " mm, tool off by " << e
            << " mm: residual less "
            << "closed form from " << m.least / units::nm << " to " << m.most / units::nm
            << " nm over " << m.vertices << " vertices, cusp " << cusp / units::nm << " nm\n";
  EXPECT_GT(m.vertices, 300);
  EXPECT_GT(m.least, -1.0_nm);
  EXPECT_LT(m.most, cusp + 1.0_nm);
}

TEST(Centring, OffsetTiltsASphereInEveryMeridian) {
  const double rho = 125.2;
  for (const double e : {0.01, -0.01, 0.1}) {
    // The circle of the meridian moves out by e: along the axis that is e r / sqrt(rho^2 - r^2) to
    // first order; along the normal, exactly, where the ray from the old centre meets the circle.
    centring("platform_sphere.toml", e, 0.3, 9.6, [&](const CutVertex& v, double moved) {
      const double r = v.p.head<2>().norm(), sine = r / rho, cosine = std::sqrt(1 - sine * sine);
      const double along_normal =
          moved * sine + std::sqrt(rho * rho - moved * moved * cosine * cosine) - rho;
      EXPECT_NEAR(along_normal / cosine, moved * r / std::sqrt(rho * rho - r * r),
                  moved * moved / rho);
      return along_normal;
    });
  }
}

TEST(Centring, OffsetLeavesAPlaneAsItIs) {
  for (const double e : {0.01, -0.01, 0.1})
    centring("platform_plane.toml", e, 0.3, 10.6, [](const CutVertex&, double) { return 0.0; });
}

}  // namespace
}  // namespace abbe::sim
