#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "cutting/surface/surface.h"
#include "kinematics/units.h"
#include "tests/cutting/brute_pairs.h"
#include "tests/cutting/random.h"
#include "tests/oracles/brute_surface.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace form_cases {

/// The same cutter for both.
struct Form {
  const char* name;
  Cutter cutter;
  oracles::BruteForm brute;
};

/// @param points  after the bottom
Form form(const char* name, double bottom, const std::vector<oracles::BruteForm::Point>& points) {
  std::vector<OutlinePoint> outline{{{bottom, 0.0}}};
  for (const auto& p : points) outline.push_back({{p.x, p.z}, p.radius});
  return {name, form_cutter(outline_from_points(outline)), {bottom, points}};
}

Form apt(const char* name, const AptCutter& cutter) {
  Form made{name, form_cutter(apt_outline(cutter)), {0.0, {}}};
  for (const OutlineSegment& piece : made.cutter.outline->segments) {
    if (piece.to.y() <= 0.0) made.brute.bottom = piece.to.x();
    if (piece.to.y() > 0.0 && piece.to.x() > 0.0 && (piece.to - piece.from).norm() > 1e-9)
      made.brute.points.push_back({piece.to.x(), piece.to.y(), piece.is_arc ? piece.radius : 0.0});
  }
  return made;
}

std::vector<Form> forms() {
  const double lean = 5 * units::deg;
  return {
      apt("taper", {.diameter = 8, .bottom = 0.0, .flank = lean, .height = 15}),
      apt("tapered ball", {.diameter = 6 * (1 - std::sin(lean)) / std::cos(lean),
                           .corner = 3,
                           .radial = 0,
                           .axial = 3,
                           .flank = lean,
                           .height = 15}),
      apt("drill point", {.diameter = 8, .bottom = 31 * units::deg, .height = 15}),
      apt("bull nose", {.diameter = 10, .corner = 1, .radial = 4, .axial = 1, .height = 15}),
      apt("dovetail", {.diameter = 10, .flank = -15 * units::deg, .height = 5}),
      form("barrel", 1.0, {{2.4, 0.5, 2.4}, {2.4, 14.5, 20}}),
      form("oval", 0.5, {{2.0, 1.0, 2.0}, {5.0, 13.0, 85}}),
      form("lens", 0.0, {{3.8, 0.36621945085084, 19.8988}, {4.0, 0.6, 0.4}, {4.0, 12.0}}),
      form("chamfer", 1.0, {{5.0, 4.0}, {5.0, 10.0}}),
  };
}

}  // namespace form_cases

TEST(FormCutter, AgreesWithBruteForceToANanometre) {
  for (const form_cases::Form& form : form_cases::forms())
    brute_pairs::hold_against_brute_force(form.name, form.cutter, form.brute,
                                          {.seed = 1803, .pairs = 150 * longer(70), .most = 20000});
}

TEST(PlainCutter, AgreesWithBruteForceToANanometre) {
  const std::pair<const char*, Cutter> cutters[] = {
      {"ball", {5, 5, 20}},        {"flat", {5, 0, 20}},           {"bull nose", {5, 1, 20}},
      {"all corner", {3, 2.9, 4}}, {"sharp corner", {1, 0.01, 8}}, {"half a ball", {5, 5, 5}}};
  for (const auto& [name, cutter] : cutters)
    brute_pairs::hold_against_brute_force(
        name, cutter,
        oracles::BruteCutter{cutter.radius, cutter.corner_radius, cutter.flank_length},
        {.seed = 1806, .pairs = 150 * longer(70), .most = 20000});
}

/// A form with the outline of a ball, a bull nose or a flat end cuts what they cut.
TEST(FormCutter, OfACommonOutlineCutsTheSame) {
  using namespace form_cases;
  Random random(1804);
  double most = 0.0;
  int cut = 0;
  for (int n = 0; n < 3000 * longer(10); ++n) {
    const double R = random.decades(-1, 2), r = R * (n % 3 == 0   ? 1.0
                                                     : n % 3 == 1 ? 0.0
                                                                  : random.in(0, 1));
    const Cutter cutter{R, r, r + R * random.in(0.1, 3)};
    const Cutter form = form_cutter(apt_outline({2 * R, r, R - r, r, 0, 0, cutter.flank_length}));
    const brute_pairs::Pair pair = brute_pairs::any_pair(random, cutter, R);
    const Design design = brute_pairs::design_of(pair.ray);
    SurfaceOptions options;
    options.band = R;
    const Surface one = milled_surface(design, cutter, pair.motion, options);
    const Surface other = milled_surface(design, form, pair.motion, options);
    if (one.status[0] != VertexStatus::Cut && other.status[0] != VertexStatus::Cut) continue;
    ASSERT_EQ(one.status[0], other.status[0]) << "seed 1804, pair " << n;
    ++cut;
    most = std::max(most, std::abs(one.residual[0] - other.residual[0]));
  }
  std::cout << cut << " cut, " << 1e6 * most << " nm apart at most\n";
  EXPECT_LT(most, 5e-8);
  EXPECT_GT(cut, 300);
}

TEST(FormCutter, OutlinesThatAreNoneAreRefused) {
  using Points = std::vector<OutlinePoint>;
  const auto refused = [](const Points& points) {
    EXPECT_THROW(outline_from_points(points), std::invalid_argument);
  };
  refused({});
  refused({{{0, 1}}, {{3, 2}}});                        // begins above the tip
  refused({{{1, 0}}, {{3, 2}}, {{3.5, 6}}, {{6, 7}}});  // hollow
  refused({{{1, 0}}, {{3, 2}}, {{3, 1}}});              // turns back down
  refused({{{1, 0}}, {{1, 5}, 2.0}});                   // an arc too small for its chord
  refused({{{1, 0}}, {{0, 0}}});                        // no height
  refused({{{1, 0}}, {{NAN, 3}}});
  refused({{{1, 0}}, {{3, 0.1}, 3.0}, {{3, 4}}});  // an arc that begins below the tip
  const auto refused_apt = [](const AptCutter& cutter) {
    EXPECT_THROW(apt_outline(cutter), std::invalid_argument);
  };
  refused_apt({.diameter = -1});
  refused_apt({.diameter = 10, .corner = 1, .radial = 7, .axial = 1});  // beside the flank
  refused_apt({.diameter = 10, .flank = -60 * units::deg, .height = 20});
  refused_apt({.diameter = 10, .bottom = 80 * units::deg, .flank = 20 * units::deg});
}

/// The sizes of APT: a corner's tangent points by hand.
TEST(FormCutter, TheCornerOfAptMeetsItsLines) {
  const double b = 10 * units::deg;
  const ToolOutline ball = apt_outline({.diameter = 6 * (1 - std::sin(b)) / std::cos(b),
                                        .corner = 3,
                                        .radial = 0,
                                        .axial = 3,
                                        .flank = b,
                                        .height = 20});
  const auto arc = std::find_if(ball.segments.begin(), ball.segments.end(),
                                [](const OutlineSegment& piece) { return piece.is_arc; });
  EXPECT_NEAR((arc->from - Vector2d(0, 0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((arc->to - Vector2d(3 * std::cos(b), 3 - 3 * std::sin(b))).norm(), 0.0, 1e-6);
  EXPECT_FALSE(ball.is_sharp);
  EXPECT_DOUBLE_EQ(ball.height, 20.0);
  EXPECT_NEAR(support(ball, -1, 0), 0.0, 1e-12);
  EXPECT_NEAR(support(ball, 1, 0), 20.0, 1e-12);
  EXPECT_TRUE(apt_outline({.diameter = 10, .height = 20}).is_sharp);
}

}  // namespace
}  // namespace abbe::cutting
