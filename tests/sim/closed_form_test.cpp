// Machines without errors, and with one error whose effect on the part is known in closed form.
// Nothing here takes a figure from the engine.

#include <cmath>
#include <iostream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cutting/map/form.h"
#include "kinematics/units.h"
#include "sim/scene/read_scene.h"
#include "tests/oracles/closed_forms.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using Eigen::Vector2d;

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
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(Eigen::Index(vertices.size()), 2);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    points.row(Eigen::Index(i)) =
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

}  // namespace
}  // namespace abbe::sim
