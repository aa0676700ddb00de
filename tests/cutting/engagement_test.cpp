#include "cutting/stock/engagement.h"
#include "tests/cutting/stock_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using Eigen::Isometry3d;

/// mm^2 of the engaged surface seen along the feed: what the cut's cross-section is, if the tool
/// has just come into material everywhere it faces the feed.
double cross_section(const Engagement& e) {
  double sum = 0.0;
  for (const EngagedArc& arc : e.arcs) {
    const EdgeSlice& slice = e.slices[std::size_t(arc.slice)];
    sum += slice.length * slice.radius *
           (std::sin(slice.kappa) * (e.feed_t.x() * (std::sin(arc.to) - std::sin(arc.from)) -
                                     e.feed_t.y() * (std::cos(arc.to) - std::cos(arc.from))) -
            std::cos(slice.kappa) * e.feed_t.z() * (arc.to - arc.from));
  }
  return sum;
}

double engaged_length(const Engagement& e) {
  double sum = 0.0;
  for (const EngagedArc& arc : e.arcs)
    sum += e.slices[std::size_t(arc.slice)].length * (arc.to - arc.from);
  return sum;
}

void expect_sound(const Engagement& e) {
  for (const EngagedArc& arc : e.arcs) {
    ASSERT_GE(arc.slice, 0);
    ASSERT_LT(std::size_t(arc.slice), e.slices.size());
    EXPECT_LT(arc.from, arc.to);
    EXPECT_LE(arc.to, arc.from + 2 * pi + 1e-12);
  }
  for (const EdgeSlice& slice : e.slices) {
    EXPECT_GT(slice.length, 0.0);
    EXPECT_TRUE(std::isfinite(slice.height + slice.radius + slice.length + slice.kappa));
  }
}

TEST(Engagement, SlicesMakeUpTheOutline) {
  for (const Cutter& cutter :
       {Cutter{5.0, 0.0, 20.0}, Cutter{5.0, 5.0, 20.0}, Cutter{5.0, 1.2, 20.0},
        Cutter{5.0, 5.0, 5.0}, Cutter{0.1, 0.02, 3.0}}) {
    double length = 0.0, area = 0.0, height = 0.0;
    for (const EdgeSlice& slice : slices(cutter)) {
      length += slice.length;
      area += 2 * pi * slice.radius * slice.length;
      EXPECT_GE(slice.height, height);
      height = slice.height;
      EXPECT_LE(slice.length, 1.0 + 1e-12);
    }
    const double r = cutter.corner_radius, a = cutter.radius - r;
    EXPECT_NEAR(length, a + 0.5 * pi * r + cutter.flank_length - r, 1e-9);
    const double surface = pi * a * a + pi * pi * r * a + 2 * pi * r * r +
                           2 * pi * cutter.radius * (cutter.flank_length - r);
    EXPECT_NEAR(area, surface, 4e-3 * surface);
  }
}

TEST(Engagement, ASlotEngagesTheHalfThatFacesTheFeed) {
  const Stock stock = box({0, 0, 0}, {60, 40, 20}, 0.5);
  const Cutter flat{5.0, 0.0, 10.0};
  for (const double heading : {0.0, 0.7, 2.5, -1.9}) {
    const Vector3d feed(std::cos(heading), std::sin(heading), 0.0);
    const Engagement e = engagement(stock, flat, pose({30, 20, 5}), 3.0 * feed);
    expect_sound(e);
    const double half = std::acos(min_feed_component);
    for (const EngagedArc& arc : e.arcs) {
      EXPECT_NEAR(std::cos(arc.from - (heading - half)), 1.0, 1e-12);
      EXPECT_NEAR(arc.to - arc.from, 2 * half, 1e-9);
      EXPECT_EQ(e.slices[std::size_t(arc.slice)].kappa, pi / 2);
    }
    EXPECT_NEAR(cross_section(e), 2 * 5.0 * 10.0, 0.01);
  }
}

TEST(Engagement, EntryAngleOnAWallIsExact) {
  // the wall y = 0 through the circle at sin(phi) = wall / R, not on any node
  const Stock stock = box({-30, -20.3, -20}, {30, 0.0, 20}, 0.5);
  const Cutter flat{5.0, 0.0, 10.0};
  double worst = 0.0;
  for (double y = -4.9; y < 4.9; y += 0.0937) {
    const Engagement e = engagement(stock, flat, pose({3, y, 0}), Vector3d::UnitX());
    expect_sound(e);
    ASSERT_FALSE(e.arcs.empty());
    for (const EngagedArc& arc : e.arcs)
      worst = std::max(
          worst, std::abs(arc.to - std::min(std::asin(-y / 5.0), std::acos(min_feed_component))));
  }
  std::cout << "end of an arc at a wall: " << worst << " rad at most\n";
  EXPECT_LT(worst, 1e-6);
}

TEST(Engagement, DepthOfCutIsExactWhateverTheSlices) {
  const Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5);
  const Cutter flat{5.0, 0.0, 12.0};
  double worst = 0.0;
  for (double z = 0.05; z < 11; z += 0.137) {
    const Engagement e = engagement(stock, flat, pose({0, 0, -z}), Vector3d::UnitX());
    expect_sound(e);
    worst = std::max(
        worst, std::abs(cross_section(e) / (10.0 * std::sin(std::acos(min_feed_component))) - z));
  }
  std::cout << "depth of cut: " << worst << " mm off at most\n";
  EXPECT_LT(worst, 1e-6);
}

TEST(Engagement, CrossSectionOfABallGrooveConverges) {
  const double depth = 3.0, w = std::acos(2.0 / 5.0);
  const double exact = 25.0 * (w - std::sin(w) * std::cos(w));
  std::vector<double> errors;
  for (const int slices_per_radius : {6, 12, 24}) {
    EngagementOptions options;
    options.slices_per_radius = slices_per_radius;
    options.angles = 6 * slices_per_radius;
    const Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5);
    const Engagement e =
        engagement(stock, {5.0, 5.0, 20.0}, pose({0, 0, -depth}), Vector3d::UnitX(), options);
    errors.push_back(std::abs(cross_section(e) - exact) / exact);
  }
  std::cout << "ball groove seen along the feed: " << errors[0] << " " << errors[1] << " "
            << errors[2] << " of itself with 6, 12, 24 slices\n";
  EXPECT_LT(errors[1], 5e-3);
  EXPECT_LT(errors[2], 2e-3);
}

TEST(Engagement, WhatTheArcsSweepIsWhatTheMoveRemoves) {
  // one step of a half-immersed cut into stock that was cut up to the step before
  for (const Cutter& cutter :
       {Cutter{5.0, 0.0, 20.0}, Cutter{5.0, 1.5, 20.0}, Cutter{5.0, 5.0, 20.0}}) {
    Stock stock = box({-30, -20, -20}, {30, 1.3, 0.0}, 0.25);
    const double step = 1.0, z = -4.0;
    remove(stock, cutter, {pose({-40, 0, z}), pose({0, 0, z}), 1, false});
    const Engagement e = engagement(stock, cutter, pose({step, 0, z}), Vector3d::UnitX());
    expect_sound(e);
    const double swept = cross_section(e) * step;
    const double removed =
        remove(stock, cutter, {pose({0, 0, z}), pose({step, 0, z}), 2, false}).volume;
    std::cout << "corner " << cutter.corner_radius << ": arcs times step " << swept
              << " mm^3, removed " << removed << " mm^3\n";
    EXPECT_NEAR(swept, removed, 0.05 * removed);
  }
}

TEST(Engagement, MovesContinuouslyWithThePose) {
  for (const bool three : {true, false})
    for (const Cutter& cutter :
         {Cutter{5.0, 0.0, 20.0}, Cutter{5.0, 1.5, 20.0}, Cutter{5.0, 5.0, 20.0}}) {
      Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5, three);
      remove(stock, cutter, {pose({-40, 4, -4}), pose({0, 4, -4}), 1, false});
      const Vector3d axis = Vector3d(0.02, -0.03, 1).normalized();
      // a walk of nanometres in a direction that changes everything: no step may jump
      const Vector3d walk(0.4, -0.3, 0.2);
      const Vector3d start(0.43, 1.21, -3.87);
      double steepest = 0.0;
      const auto at = [&](double x) {
        return engaged_length(
            engagement(stock, cutter, pose(start + x * walk, axis), Vector3d::UnitX()));
      };
      const double coarse = std::abs(at(1e-3) - at(0)) / 1e-3;
      double before = at(0);
      for (int i = 1; i <= 200; ++i) {
        const double now = at(1e-6 * i);
        steepest = std::max(steepest, std::abs(now - before) / 1e-6);
        before = now;
      }
      double farther = 0.0;
      before = at(0);
      for (int i = 1; i <= 400; ++i) {
        const double now = at(1e-3 * i);
        farther = std::max(farther, std::abs(now - before));
        before = now;
      }
      std::cout << (three ? "three directions" : "one direction") << ", corner "
                << cutter.corner_radius << ": changes by " << coarse << " per mm, at most "
                << steepest << " over 1 nm steps, and by " << farther
                << " rad mm at most in 0.5 um steps, of " << before << "\n";
      EXPECT_LT(steepest, 60.0);
      EXPECT_LT(farther, 0.06);
    }
}

TEST(Engagement, APlungeEngagesTheWholeBottomAndNoFlank) {
  const Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5);
  for (const Cutter& cutter :
       {Cutter{5.0, 0.0, 20.0}, Cutter{5.0, 1.5, 20.0}, Cutter{5.0, 5.0, 20.0}}) {
    const Engagement e = engagement(stock, cutter, pose({0, 0, -8}), -Vector3d::UnitZ());
    expect_sound(e);
    for (const EngagedArc& arc : e.arcs) {
      EXPECT_NEAR(arc.to - arc.from, 2 * pi, 1e-9);
      EXPECT_LT(e.slices[std::size_t(arc.slice)].kappa, pi / 2);
    }
    EXPECT_NEAR(cross_section(e), pi * 25.0, 4e-3 * pi * 25.0);
    EXPECT_TRUE(engagement(stock, cutter, pose({0, 0, -8}), Vector3d::UnitZ()).arcs.empty());
  }
}

TEST(Engagement, ABottomThatSlidesOnItsFloorIsNotInTheCut) {
  Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5);
  const Cutter flat{5.0, 0.0, 20.0};
  remove(stock, flat, {pose({-40, 0, -3}), pose({0, 0, -3}), 1, false});
  for (const double slope : {0.0, 1e-9, -1e-9, -1e-5}) {
    const Engagement e = engagement(stock, flat, pose({0.5, 0, -3}), Vector3d(1, 0, slope));
    for (const EngagedArc& arc : e.arcs) EXPECT_GT(e.slices[std::size_t(arc.slice)].kappa, 1.0);
    EXPECT_FALSE(e.arcs.empty());
  }
}

TEST(Engagement, InAirAndFarAwayThereIsNone) {
  const Stock stock = box({-30, -20, -20}, {30, 20, 0.0}, 0.5);
  const Cutter flat{5.0, 0.0, 20.0};
  EXPECT_TRUE(engagement(stock, flat, pose({0, 0, 0.001}), Vector3d::UnitX()).arcs.empty());
  EXPECT_TRUE(engagement(stock, flat, pose({0, 1e9, 0}), Vector3d::UnitX()).arcs.empty());
  EXPECT_TRUE(engagement(stock, flat, pose({28, 0, -5}), Vector3d::UnitX()).arcs.size() > 0);
  EXPECT_TRUE(engagement(stock, flat, pose({36, 0, -5}), Vector3d::UnitX()).arcs.empty());
}

TEST(Engagement, BadInputIsRefused) {
  const Stock stock = box({0, 0, 0}, {5, 5, 5}, 0.5);
  const Cutter flat{5.0, 0.0, 20.0};
  EXPECT_THROW(engagement(stock, flat, pose({nan, 0, 0}), Vector3d::UnitX()),
               std::invalid_argument);
  EXPECT_THROW(engagement(stock, flat, pose({0, 0, 0}), Vector3d::Zero()), std::invalid_argument);
  EXPECT_THROW(engagement(stock, flat, pose({0, 0, 0}), {nan, 0, 0}), std::invalid_argument);
  EXPECT_THROW(slices({-1.0, 0.0, 20.0}), std::invalid_argument);
  EXPECT_THROW(slices(flat, {0, 1.0, 60}), std::invalid_argument);
}

// ---- turning ------------------------------------------------------------------------------------

Eigen::Matrix<double, Eigen::Dynamic, 2> profile(
    std::initializer_list<std::pair<double, double>> corners) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> result(Index(corners.size()), 2);
  Index i = 0;
  for (const auto& [x, r] : corners) result.row(i++) << x, r;
  return result;
}

TurnedStock bar(double radius, double length, double spacing) {
  return make_turned_stock(profile({{0, radius}, {length, radius}}), spacing, Vector3d::Zero(),
                           Vector3d::UnitX());
}

/// The middle of the nose at (x along the spindle, r from it); frame t is the workpiece's.
Isometry3d nose_at(double x, double r) { return pose({x, 0, r}); }

TEST(TurnedStock, VolumesAreThoseOfFrustums) {
  EXPECT_NEAR(volume(bar(10, 30, 0.1)), pi * 100 * 30, 1e-9);
  const TurnedStock cone =
      make_turned_stock(profile({{-5, 4}, {7, 10}}), 0.37, {1, 2, 3}, Vector3d(1, 2, 2) / 3.0);
  EXPECT_NEAR(volume(cone), pi / 3 * 12 * (16 + 40 + 100), 1e-9);
  for (const double h : {0.1, 0.01}) {
    const TurnedStock stepped = make_turned_stock(profile({{0, 10}, {20, 10}, {20, 6}, {31, 6}}), h,
                                                  Vector3d::Zero(), Vector3d::UnitX());
    EXPECT_NEAR(volume(stepped), pi * (100 * 20 + 36 * 11), pi * 64 * h);
  }
}

TEST(TurnedStock, BadProfilesAreRefused) {
  const auto make = [](const auto& corners, double h) {
    return make_turned_stock(corners, h, Vector3d::Zero(), Vector3d::UnitX());
  };
  EXPECT_THROW(make(profile({{0, 1}, {2, 1}, {1, 1}}), 0.1), std::invalid_argument);
  EXPECT_THROW(make(profile({{0, 1}, {2, -1}}), 0.1), std::invalid_argument);
  EXPECT_THROW(make(profile({{0, 1}, {2, 1}}), 0.0), std::invalid_argument);
  EXPECT_THROW(make(profile({{0, 1}, {0, 2}}), 0.1), std::invalid_argument);
  EXPECT_THROW(make(profile({{0, 1}}), 0.1), std::invalid_argument);
  EXPECT_THROW(make(profile({{0, 1}, {1e6, 1}}), 1e-4), std::length_error);
  EXPECT_THROW(make_turned_stock(profile({{0, 1}, {2, 1}}), 0.1, Vector3d::Zero(), {1, 1, 0}),
               std::invalid_argument);
}

TEST(TurnedStock, ACylinderTurnedDownLosesPiTimesTheSquaresTimesLength) {
  const double R1 = 12.5, R2 = 12.0, nose_radius = 0.8, feed = 0.1;
  for (const double h : {0.02, 0.01, 0.005}) {
    TurnedStock stock = bar(R1, 30, h);
    const Nose nose{nose_radius, {}};
    double removed = 0.0;
    int turns = 0;
    for (double x = 31; x > -1; x -= feed, ++turns)
      removed +=
          remove(stock, nose, nose_at(x, R2 + nose_radius), nose_at(x - feed, R2 + nose_radius));
    // moving on a line it leaves no cusps at all
    const double exact = pi * (R1 * R1 - R2 * R2) * 30;
    std::cout << "spacing " << h << ": " << removed - exact << " mm^3 of " << exact << "\n";
    EXPECT_NEAR(removed, exact, 1e-8 * exact);
    EXPECT_NEAR(volume(stock), pi * R2 * R2 * 30, 1e-8 * exact);
  }
}

TEST(TurnedStock, AGrooveIsTheNosesOwnShape) {
  std::vector<double> errors;
  for (const double h : {0.04, 0.02, 0.01}) {
    TurnedStock stock = bar(10, 20, h);
    const Nose nose{2.0, {}};
    const double removed = remove(stock, nose, nose_at(10, 14), nose_at(10, 11));
    for (double x = 8.3; x < 11.7; x += 0.1) {
      const auto i = Index(std::round(x / stock.spacing));
      const double at = stock.spacing * double(i) - 10;
      EXPECT_NEAR(stock.radius[i], 11 - std::sqrt(4 - at * at), 1e-9);
    }
    // Pappus: the segment of the circle below r = 10, and its centroid
    const double w = std::acos(1.0 / 2.0), area = 4 * (w - std::sin(w) * std::cos(w));
    const double centroid = 11 - 2.0 / 3.0 * 8 * std::pow(std::sin(w), 3) / area;
    errors.push_back(std::abs(removed - 2 * pi * centroid * area));
  }
  const double order = std::log2(errors.front() / errors.back()) / 2;
  std::cout << "groove: " << errors[0] << " " << errors[1] << " " << errors[2] << " mm^3, order "
            << order << "\n";
  EXPECT_GT(order, 1.4);
}

TEST(TurnedStock, ChipThicknessIsTheDistanceToTheProfileBefore) {
  const double R = 0.8, feed = 0.12, depth = 0.3;
  TurnedStock stock = bar(10, 20, 0.0005);
  const Nose nose{R, {}};
  const double r = 10 - depth + R;
  remove(stock, nose, nose_at(22, r), nose_at(10, r));
  const std::vector<EngagedEdge> edges = engagement(stock, nose, nose_at(10 - feed, r), 400);
  ASSERT_GT(edges.size(), 20u);
  double worst = 0.0, area = 0.0, thickest = 0.0;
  for (const EngagedEdge& edge : edges) {
    // along the ray from the edge to the middle: out of the nose as it stood a feed before, or out
    // of the bar, whichever comes first
    const double x = std::cos(edge.psi), z = std::sin(edge.psi);
    const double to_nose = R - (feed * x + std::sqrt(R * R - feed * feed * z * z));
    const double to_bar = z < 0 ? (10 - (r + R * z)) / -z : std::numeric_limits<double>::infinity();
    worst = std::max(worst, std::abs(edge.chip - std::min(to_nose, to_bar)));
    area += edge.length * edge.chip;
    thickest = std::max(thickest, edge.chip);
  }
  std::cout << "chip thickness " << worst << " mm off at most; area " << area << " mm^2 of "
            << depth * feed << "\n";
  EXPECT_LT(worst, 1e-5);
  EXPECT_NEAR(area, depth * feed, depth * feed * thickest / (2 * R) + 1e-4);
  EXPECT_GT(area, depth * feed);
}

TEST(TurnedStock, EngagementMovesContinuouslyWithThePose) {
  const double R = 0.8, feed = 0.04, depth = 0.25, r = 10 - depth + R;
  TurnedStock stock = bar(10, 20, 0.01);
  const Nose nose{R, {}};
  remove(stock, nose, nose_at(22, r), nose_at(10, r));
  const auto force = [&](double continues_deeper) {
    double sum = 0.0;
    for (const EngagedEdge& edge :
         engagement(stock, nose, nose_at(10 - feed, r - continues_deeper)))
      sum += edge.length * (1.0 + 50.0 * edge.chip);
    return sum;
  };
  double steepest = 0.0;
  for (int i = 0; i < 2000; ++i)
    steepest = std::max(steepest, std::abs(force(1e-6 * (i + 1)) - force(1e-6 * i)) / 1e-6);
  std::cout << "slope over 1 nm steps: " << steepest
            << " at most; over 2 um: " << std::abs(force(2e-3) - force(0)) / 2e-3 << "\n";
  EXPECT_LT(steepest, 200.0);
}

TEST(TurnedStock, WavesAndTiltOfTheNoseAreFollowed) {
  TurnedStock stock = bar(10, 20, 0.01);
  const Nose waved{2.0, {{6, 0.01, 0.4}}};
  Isometry3d tilted = nose_at(10, 11.5);
  tilted.linear() = Eigen::AngleAxisd(0.1, Vector3d::UnitY()).toRotationMatrix();
  remove(stock, waved, tilted, tilted);
  // every point of the edge lies on or above the profile
  double closest = 1.0;
  for (double psi = 0; psi < 2 * pi; psi += 0.001) {
    const double rho = 2.0 + 0.01 * std::cos(6 * psi + 0.4);
    const Vector3d p = tilted * Vector3d(rho * std::cos(psi), 0, rho * std::sin(psi));
    const double u = p.x() / stock.spacing;
    const auto i = Index(u);
    const double at = stock.radius[i] + (u - double(i)) * (stock.radius[i + 1] - stock.radius[i]);
    if (p.z() < 10 && p.z() < 11.5) closest = std::min(closest, p.z() - at);
  }
  std::cout << "edge below the profile by " << -closest << " mm at most\n";
  EXPECT_GT(closest, -1e-3);  // chords of the profile between nodes
}

TEST(TurnedStock, AwkwardPosesAreHarmless) {
  TurnedStock stock = bar(10, 20, 0.05);
  const Nose nose{0.8, {}};
  const double before = volume(stock);
  EXPECT_EQ(remove(stock, nose, nose_at(10, 50), nose_at(11, 50)), 0.0);
  EXPECT_EQ(remove(stock, nose, nose_at(-500, 5), nose_at(-400, 5)), 0.0);
  EXPECT_TRUE(engagement(stock, nose, nose_at(10, 50)).empty());
  EXPECT_EQ(volume(stock), before);
  EXPECT_GT(remove(stock, nose, nose_at(10, 10), nose_at(10, 10)), 0.0);
  EXPECT_EQ(remove(stock, nose, nose_at(10, 10), nose_at(10, 10)), 0.0);
  for (const EngagedEdge& edge : engagement(stock, nose, nose_at(5, 5)))  // wholly inside
    EXPECT_TRUE(std::isfinite(edge.chip) && edge.chip <= 0.8 + 1e-12 && edge.chip > 0.0);
  remove(stock, nose, nose_at(21, 0.3), nose_at(-1, -0.3));  // past the middle
  EXPECT_GE(stock.radius.minCoeff(), 0.0);
  EXPECT_TRUE(stock.radius.allFinite());
  EXPECT_THROW(remove(stock, nose, nose_at(nan, 0), nose_at(0, 0)), std::invalid_argument);
  EXPECT_THROW(engagement(stock, nose, nose_at(nan, 0)), std::invalid_argument);
  EXPECT_THROW(engagement(stock, {-1.0, {}}, nose_at(0, 0)), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::cutting
