#include <algorithm>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "sim/study/influence.h"
#include "tests/study/small_studies.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;

cutting::Surface cut(const MadeStudy& made, const Eigen::VectorXd& x) {
  return cut_at(made.study, made.ready, made.ready.job, x).surface;
}

bool both_cut(const cutting::Surface& a, const cutting::Surface& b, Index v) {
  return a.status[std::size_t(v)] == cutting::VertexStatus::Cut &&
         b.status[std::size_t(v)] == cutting::VertexStatus::Cut;
}

/// Whether the pass that makes the surface in the base run still does after a step of an input.
bool stays_first(const InfluenceMap& map, Index input, Index v, double step) {
  const Index first = map.first[std::size_t(v)], last = map.first[std::size_t(v) + 1];
  for (Index r = first + 1; r < last; ++r)
    if (map.distance[r] - map.distance[first] <
        1e-6 + 2.0 * std::abs(step * (map.slope(input, r) - map.slope(input, first))))
      return false;
  return last > first;
}

/// How far a column is from the central difference of full runs.
struct Miss {
  double size = 0.0;      ///< mm per spread, largest entry of the column
  double worst = 0.0;     ///< mm per spread
  double rms = 0.0;       ///< mm per spread
  double compared = 0.0;  ///< share of the vertices at which one pass stays the first
};

Miss miss_of(const MadeStudy& made, Index input) {
  const double spread = spreads(made.study)[input], step = 0.2 * spread;
  Eigen::VectorXd low = centre(made.study), high = low;
  low[input] -= step;
  high[input] += step;
  const cutting::Surface a = cut(made, low), b = cut(made, high);
  const Index n = made.map.design.vertices.rows();
  Miss miss;
  double count = 0.0, square = 0.0;
  for (Index v = 0; v < n; ++v) {
    if (!both_cut(a, b, v) || !stays_first(made.map, input, v, step)) continue;
    const double slope = spread * made.map.slope(input, made.map.first[std::size_t(v)]);
    const double off = slope - spread * (b.residual[v] - a.residual[v]) / (2 * step);
    miss.size = worst_of(miss.size, std::abs(slope));
    miss.worst = worst_of(miss.worst, std::abs(off));
    square += off * off;
    ++count;
  }
  miss.compared = count / double(n);
  miss.rms = std::sqrt(square / count);
  return miss;
}

/// What columns may miss, mm per spread: rms and worst, beside so much of their size.
struct Allowed {
  double rms = 0.0;
  double worst = 0.0;
  double relative = 2e-3;
};

void expect_columns(const MadeStudy& made, const Allowed& allowed) {
  ASSERT_TRUE(is_finite(made.map));
  for (Index i = 0; i < Index(made.study.inputs.size()); ++i) {
    const std::string& name = made.study.inputs[std::size_t(i)].name;
    const Miss miss = miss_of(made, i);
    std::cout << fmt::format(
        "{:40} {:8.4f} um a spread, off by {:.5f} um RMS, {:.5f} at most; {:.1f} % compared\n",
        name, miss.size * 1e3, miss.rms * 1e3, miss.worst * 1e3, 100 * miss.compared);
    EXPECT_GT(miss.size, 1e-6) << name << " does nothing";
    EXPECT_GT(miss.compared, 0.8) << name;
    EXPECT_LT(miss.rms, allowed.rms + allowed.relative * miss.size) << name;
    EXPECT_LT(miss.worst, allowed.worst + 5 * allowed.relative * miss.size) << name;
  }
}

// Moves of 0.5 mm on a radius of 100 mm turn by 5 mrad at each sample: there a difference sees half
// of that of the displacement along the feed, 13 nm of 5 um, and at few vertices. Where the path is
// straight or the tool turns the part, only rounding and the second order of angles is left.
constexpr Allowed on_dome{.rms = 2e-6, .worst = 1.3e-5};
constexpr Allowed off_dome{.rms = 1e-7, .worst = 1e-6};

TEST(InfluenceColumns, OfElementsAndNumbersUnderABallAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({ball_dome(), by_number("EXX scale and guide[1]", -5.43, 1.0) + by_element("EYX") +
                                  by_element("EAX") + by_element("ECC") + by_element("EBS") +
                                  by_element("EC0Y") + by_element("EX0C") + by_element("EA0C") +
                                  by_path("errors.scale", 1, 0.2) +
                                  by_path("errors.EZX.coefficients_um.2", -2.47, 2.0)}),
      on_dome);
}

TEST(InfluenceColumns, OfClampingAndToolUnderABallAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({ball_dome("[setup]\nEX_um = 3\nEA_urad = 20\n"),
                 by_path("setup.EX_um", 3, 5) + by_path("setup.EA_urad", 20, 30) +
                     by_path("setup.EC_urad", 0, 30) + by_path("tool.actual.radius_mm", 5, 0.005) +
                     by_path("tool.actual.length_mm", 100, 0.005)}),
      on_dome);
}

TEST(InfluenceColumns, FollowTheControlAndTheDatumThatItTouchesOff) {
  expect_columns(
      MadeStudy({ball_dome("[control]\ntool_length_mm = 100\n[control.axis.C]\n"
                           "point_mm = [0, 0, 0]\n[datum]\nkind = \"touch_off\"\n"
                           "touch = [{ point_mm = [40, 25, 80], direction = [0, 0, -1] }]\n"),
                 by_element("EYX") + by_element("EC0Y") + by_element("EZS") +
                     by_path("control.tool_length_mm", 100, 0.005) +
                     by_path("control.axis.C.point_mm.0", 0, 0.005) +
                     by_path("tool.actual.length_mm", 100, 0.005) +
                     by_path("datum.touch.0.point_mm.2", 80, 0.5)}),
      on_dome);
}

TEST(InfluenceColumns, UnderABullNoseAreDifferencesOfFullRuns) {
  // a larger cutter moves the contact across the joints of the coarse moves
  const Allowed allowed{.rms = 5e-7, .worst = 1e-5};
  expect_columns(
      MadeStudy({bull_flat(), by_element("EYX") + by_element("EBY") + by_element("EA0Z") +
                                  by_path("tool.actual.radius_mm", 6, 0.005) +
                                  by_path("tool.actual.corner_radius_mm", 1, 0.005)}),
      allowed);
}

TEST(InfluenceColumns, OfAFlankAreDifferencesOfFullRuns) {
  expect_columns(MadeStudy({flank_cone(), by_element("EYX") + by_element("EBY") +
                                              by_element("EB0C") + by_path("setup.EB_urad", 0, 30) +
                                              by_path("tool.actual.radius_mm", 8, 0.005)}),
                 off_dome);
}

TEST(InfluenceColumns, OfATurnedPartAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({turned_cone("[setup]\nEX_um = 3\nEY_um = 2\nEB_urad = 20\n"),
                 by_element("EXX") + by_element("EBX") + by_element("EB0Z") + by_element("EXS") +
                     by_element("EBS") + by_path("setup.EX_um", 3, 3) +
                     by_path("setup.EY_um", 2, 3) + by_path("setup.EB_urad", 20, 30) +
                     by_path("tool.actual.centring_offset_mm", 0, 0.003) +
                     by_path("tool.actual.radius_mm", 0.2495, 0.0005) +
                     by_path("tool.actual.wave.0.amplitude_um", 0.2, 0.05) +
                     by_path("tool.actual.wave.0.phase_deg", 40, 3)}),
      {.rms = 3e-7, .worst = 2e-6});
}

/// Without errors of its own the spindle turns by a quarter of a turn between samples. What the
/// slides do stands still meanwhile, a clamping that is off turns with the part.
TEST(InfluenceColumns, OfAClampingTurnWithThePartBetweenSamples) {
  expect_columns(
      MadeStudy({turned_cone("[setup]\nEX_um = 0\nEY_um = 0\nEZ_um = 0\nEB_urad = 0\n"),
                 by_element("EXX") + by_element("EB0Z") + by_path("setup.EX_um", 0, 3) +
                     by_path("setup.EY_um", 0, 3) + by_path("setup.EZ_um", 0, 3) +
                     by_path("setup.EB_urad", 0, 30),
                 fmt::format("set = {{ errors = \"{}\" }}", file_of("errors/platform_peng.toml"))}),
      {.rms = 3e-7, .worst = 2e-6});
}

TEST(InfluenceColumns, OfHeatAreDifferencesOfFullRuns) {
  const std::string warm = fmt::format(
      "thermal = \"{}\"\nhistory = [{{ duration_min = 30, speed_rpm = 12000, axis_speed_mm_per_min "
      "= {{ X = 8000, Y = 8000, Z = 3000 }} }}]\n",
      file_of("errors/gantry_heat.toml"));
  expect_columns(MadeStudy({ball_dome("", warm),
                            by_path("thermal.scale", 1, 0.2) +
                                by_path("thermal.element.0.offset.1.um_per_K", -1.3, 0.3) +
                                by_path("history.0.speed_rpm", 12000, 500) + by_element("EXX")}),
                 on_dome);
}

std::string soft_dome(const std::string& compliance, const std::string& more = {}) {
  const std::string material =
      fmt::format("material = \"{}\"\n", file_of("materials/al6082_t6_carbide.toml"));
  return ball_dome(more + "[compliance]\n" + compliance +
                       "[compliance.axis.X]\nstiffness_N_per_um = [20, 20, 20]\n"
                       "turning_stiffness_Nm_per_urad = [1, 1, 1]\n"
                       "[[compliance.mass]]\naxis = \"Z\"\nmass_kg = 110\n"
                       "centre_mm = [0, -60, 260]\n",
                   more.empty() ? "" : material);
}

TEST(InfluenceColumns, UnderWeightAndInertiaAreDifferencesOfFullRuns) {
  expect_columns(MadeStudy({soft_dome("gravity = [0, 0, -1]\ninertia = true\n"),
                            by_path("compliance.scale", 1, 0.2) +
                                by_path("compliance.mass.0.mass_kg", 110, 10) + by_element("EXX")}),
                 on_dome);
}

/// The force follows the depth: of a push into the part the machine gives way to some.
TEST(InfluenceColumns, UnderCuttingForceFollowTheForceThatComplianceItselfChanges) {
  expect_columns(
      MadeStudy({soft_dome("",
                           "[cutting]\nblank = \"offset\"\nallowance_mm = 0.3\nfloor_mm = -5\n"
                           "spacing_mm = 0.25\nflutes = 2\n"),
                 by_path("compliance.scale", 1, 0.2) + by_element("EZS") + by_element("EYX") +
                     by_path("setup.EZ_um", 0, 5)}),
      on_dome);
}

/// Two tools that cut one blank, each a half of a flat and a strip in the middle where they
/// compete.
SmallStudy two_tools(const std::string& inputs, const std::string& top = {},
                     const std::string& more = {}) {
  std::string program = "G21 G90 G17 G94\nG54\n";
  const auto add_passes = [&](int tool, double from, double to, double z) {
    program += fmt::format("T{0} M6\nS9000 M3\nG43 H{0}\n", tool);
    for (double y = from; y <= to + 1e-9; y += 0.5)
      program += fmt::format("G0 X-9 Y{0}\nG0 Z5\nG1 Z{1} F500\nG1 X9 F1000\nG0 Z60\n", y, z);
  };
  add_passes(1, -7, 0.25, 0.0);
  add_passes(2, -0.25, 7, -0.004);
  return {
      fmt::format(
          "machine = \"{0}\"\n{1}"
          "[errors]\nEXX_um = 4\nEZX = {{ kind = \"polynomial\", coefficients_um = [3, 20], "
          "half_range_mm = 100 }}\nEBX_urad = 150\nEAY_urad = -120\n"
          "[[tool]]\nname = \"ball\"\nkind = \"ball\"\nradius_mm = 5\n"
          "flank_length_mm = 25\nlength_mm = 100\nnumber = 1\n"
          "[[tool]]\nname = \"bull\"\nkind = \"bull\"\nradius_mm = 4\ncorner_radius_mm = 1\n"
          "flank_length_mm = 20\nlength_mm = 80\nnumber = 2\n"
          "compliance = {{ stiffness_N_per_um = [10, 10, 100] }}\n"
          "[part]\nsurface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\n"
          "vertices = 400\n[program]\nfile = \"p.ngc\"\nwork_offset.G54 = {{ Z_mm = -100 }}\n{2}",
          file_of("machines/three_axis_table.toml"), top, more),
      inputs, "", 0, program + "M30\n"};
}

TEST(InfluenceColumns, OfSeveralToolsAreDifferencesOfFullRuns) {
  const MadeStudy made(two_tools(by_element("EZX") + by_element("EAY") +
                                 by_path("tool.1.actual.length_mm", 80, 0.005) +
                                 by_path("tool.0.actual.length_mm", 100, 0.005)));
  expect_columns(made, off_dome);
  // The length of a tool acts on its own passes alone.
  const Eigen::ArrayXd bull = effects(made.map).row(2), ball = effects(made.map).row(3);
  EXPECT_GT((bull.abs() > 0.9).count(), 50);
  EXPECT_GT((ball.abs() > 0.9).count(), 50);
  EXPECT_EQ(((bull.abs() > 0.9) != (ball.abs() > 0.9)).count(), bull.size());
  EXPECT_LT(bull.abs().min(ball.abs()).maxCoeff(), 1e-9);
}

TEST(InfluenceColumns, OfSeveralToolsFollowTheForceOfEach) {
  const std::string material =
      fmt::format("material = \"{}\"\n", file_of("materials/al6082_t6_carbide.toml"));
  const std::string blank =
      "[cutting]\nblank = \"box\"\nlower_mm = [-5, -5, -5]\nupper_mm = [5, 5, 0.5]\n"
      "spacing_mm = 0.25\nflutes = 2\n";
  const std::string stiffness = by_path("tool.1.compliance.stiffness_N_per_um.2", 100, 10);
  expect_columns(MadeStudy(two_tools(
                     by_path("compliance.scale", 1, 0.2) + by_element("EZX") + stiffness, material,
                     blank + "[compliance.axis.X]\nstiffness_N_per_um = [60, 60, 60]\n")),
                 on_dome);
  // Only the second tool gives way.
  expect_columns(MadeStudy(two_tools(stiffness + by_element("EZX"), material, blank)), on_dome);
}

TEST(InfluenceColumns, LieBetweenValuesThatTheirInputsMayHave) {
  const MadeStudy made(
      {ball_dome(), by_element("EYX", 0.5, "low = 0.9\nhigh = 3") +
                        by_number("EXX scale and guide[1]", -5.43, 1.0, "low = -5.6") +
                        by_path("tool.actual.radius_mm", 5, 0.0005,
                                "distribution = \"log_normal\"\nlow = 4.998") +
                        by_path("tool.actual.length_mm", 100, 0.005,
                                "distribution = \"uniform\"\nlow = 99.996") +
                        by_path("setup.EA_urad", 0, 30, "low = -5\nhigh = 90")});
  for (Index i = 0; i < Index(made.study.inputs.size()); ++i) {
    const Distribution& d = made.study.inputs[std::size_t(i)].distribution;
    const auto [low, high] = difference_points(made.study, i);
    EXPECT_LT(d.low, low);
    EXPECT_LT(low, high);
    EXPECT_LT(high, d.high);
  }
  expect_columns(made, on_dome);
}

Index named(const Study& study, const std::string& name) {
  const auto found = std::find_if(study.inputs.begin(), study.inputs.end(),
                                  [&](const Input& input) { return input.name == name; });
  return found - study.inputs.begin();
}

/// An input of the control makes every machine's commands its own, so that all columns are
/// differences of poses; without it those of elements come from the Jacobian.
TEST(InfluenceColumns, ByTheJacobianAndByDifferencesOfPosesAgree) {
  const std::string inputs = every("element") + by_path("setup.EX_um", 0, 5);
  const auto differ = [&](const std::string& scene, const std::string& control) {
    const MadeStudy by_jacobian({scene, inputs}), by_poses({scene, inputs + control});
    const Index p = Index(by_jacobian.study.inputs.size());
    double worst = 0.0;
    Index compared = 0;
    EXPECT_TRUE(is_finite(by_jacobian.map) && is_finite(by_poses.map));
    for (Index i = 0; i < p; ++i) {
      const Index k = named(by_poses.study, by_jacobian.study.inputs[std::size_t(i)].name);
      const auto a = by_jacobian.map.slope.row(i), b = by_poses.map.slope.row(k);
      const auto c = by_jacobian.map.shift.row(i), d = by_poses.map.shift.row(k);
      const double size = std::max(a.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff());
      if (size < 1e-6) continue;
      worst = std::max(
          {worst, (a - b).cwiseAbs().maxCoeff() / size, (c - d).cwiseAbs().maxCoeff() / size});
      ++compared;
    }
    std::cout << fmt::format("{} of {} columns differ by at most {:.2e} of their size\n", compared,
                             p, worst);
    EXPECT_GT(2 * compared, p);
    return worst;
  };
  // the Jacobian is that of the machine without errors: their angles, 0.2 mrad in sum on the
  // gantry, turn every column by as much
  const std::string length = by_path("control.tool_length_mm", 100, 0.005);
  const std::string control = "[control]\ntool_length_mm = 100\n";
  EXPECT_LT(differ(ball_dome(control), length), 5e-4);
  EXPECT_LT(differ(bull_flat() + control, length), 5e-4);
  const std::string of_platform = "[control]\ntool_length_mm = 60\n";
  EXPECT_LT(differ(turned_cone(of_platform), by_path("control.tool_length_mm", 60, 0.005)), 1e-5);
}

}  // namespace
}  // namespace abbe::sim::study
