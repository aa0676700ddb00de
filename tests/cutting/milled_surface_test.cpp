#include "cutting/surface/surface.h"

#include <cmath>
#include <iostream>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "kinematics/units.h"
#include "tests/cutting/largest_difference.h"
#include "tests/cutting/milled_parts.h"
#include "tests/kinematics/nan.h"

namespace abbe::cutting {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

const SurfaceOptions wide_band{.band = 5.0, .progress = {}};

#define EXPECT_RESIDUALS(surface, expected, bound)                  \
  do {                                                              \
    const double worst = largest_difference(surface, expected);     \
    std::cout << "  largest difference " << worst * 1e6 << " nm\n"; \
    EXPECT_LE(worst, bound);                                        \
  } while (false)

std::vector<Stop> plane_raster(double pitch, double size) {
  std::vector<Stop> stops;
  const int passes = int(std::lround(size / pitch));
  for (int i = 0; i <= passes; ++i) {
    const double y = i * pitch;
    const double start = i % 2 == 0 ? -10.0 : size + 10.0;
    stops.push_back({Vector3d(start, y, 0)});
    stops.push_back({Vector3d(size - start, y, 0)});
  }
  return stops;
}

TEST(MilledSurface, BallRasterLeavesTheCuspOfItsPitchOnAPlane) {
  const Cutter ball{5, 5, 20};
  const double pitch = 0.5;
  std::vector<Site> sites;
  std::vector<double> expected;
  double highest = 0.0;
  for (int i = 0; i <= 400; ++i) {
    const double y = 1.0 + i * 0.01;
    sites.push_back({Vector3d(3.3, y, 0)});
    const double off = y - pitch * std::round(y / pitch);
    expected.push_back(ball.radius - std::sqrt(25.0 - off * off));
    highest = std::max(highest, expected.back());
  }
  const Surface surface = milled_surface(design_of(sites), ball, motion_of(plane_raster(pitch, 6)));
  EXPECT_RESIDUALS(surface, expected, no_difference);
  EXPECT_NEAR(highest, 5 - std::sqrt(25 - pitch * pitch / 4), 1e-15);
  std::cout << "  cusp " << surface.residual.maxCoeff() * 1e3 << " um\n";
}

TEST(MilledSurface, A500mmPlaneTurnedInSpaceIsTrueToANanometre) {
  const Cutter ball{5, 5, 20};
  const Eigen::Isometry3d T =
      Eigen::Translation3d(310, -420, 150) * AngleAxisd(0.7, Vector3d(1, 2, -0.5).normalized());
  std::vector<Stop> stops = plane_raster(2.0, 500);
  for (Stop& stop : stops) stop = {T * stop.tip, (T.linear() * stop.axis).normalized()};
  std::vector<Site> sites;
  std::vector<double> expected;
  for (int i = 0; i < 4000; ++i) {
    const double y = 0.3 + i * 0.1249;
    const double x = std::fmod(i * 77.7, 500.0);
    sites.push_back({T * Vector3d(x, y, 0), (T.linear() * Vector3d::UnitZ()).normalized()});
    const double off = y - 2.0 * std::round(y / 2.0);
    expected.push_back(5 - std::sqrt(25 - off * off));
  }
  EXPECT_RESIDUALS(milled_surface(design_of(sites), ball, motion_of(stops)), expected, 1e-6);
}

double dome_cusp(double rho, double R, double step) {
  const double half = step / rho / 2;
  const double aside = (rho + R) * std::sin(half);
  return (rho + R) * std::cos(half) - std::sqrt(R * R - aside * aside) - rho;
}

TEST(MilledSurface, StraightPassesLeaveTheConvexCuspOnACylinder) {
  const double rho = 50;
  const double R = 5;
  const double phi = 0.5 / rho;
  std::vector<Stop> stops;
  for (int i = -4; i <= 4; ++i) {
    const Vector3d centre = (rho + R) * Vector3d(0, std::sin(i * phi), std::cos(i * phi));
    const Vector3d tip = centre - R * Vector3d::UnitZ();
    const double ahead = i % 2 == 0 ? 20.0 : -20.0;
    stops.push_back({tip - ahead * Vector3d::UnitX()});
    stops.push_back({tip + ahead * Vector3d::UnitX()});
  }
  std::vector<Site> sites;
  for (int i = -3; i < 3; ++i) {
    const Vector3d normal(0, std::sin((i + 0.5) * phi), std::cos((i + 0.5) * phi));
    sites.push_back({rho * normal + i * Vector3d::UnitX(), normal});
  }
  const Surface surface = milled_surface(design_of(sites), {R, R, 20}, motion_of(stops));
  EXPECT_RESIDUALS(surface, std::vector<double>(6, dome_cusp(rho, R, 0.5)), no_difference);
}

TEST(MilledSurface, PassesOfEqualLatitudeLeaveTheConvexCuspOnADome) {
  const double rho = 50;
  const double R = 5;
  const double phi = 0.5 / rho;
  const double arc = 0.005;  // mm between samples: chords gouge by arc^2 / 8 (rho + R) = 0.06 nm
  std::vector<Stop> stops;
  for (const double latitude : {0.4, 0.4 + phi}) {
    const double step = (latitude > 0.4 ? -1 : 1) * arc / ((rho + R) * std::sin(latitude));
    for (int k = -400; k <= 400; ++k)
      stops.push_back(
          {(rho + R) * Vector3d(std::sin(latitude) * std::cos(k * step),
                                std::sin(latitude) * std::sin(k * step), std::cos(latitude)) -
           R * Vector3d::UnitZ()});
  }
  const double middle = 0.4 + phi / 2;
  const Vector3d normal(std::sin(middle), 0, std::cos(middle));
  const Surface surface =
      milled_surface(design_of({{rho * normal, normal}}), {R, R, 20}, motion_of(stops));
  EXPECT_RESIDUALS(surface, std::vector<double>{dome_cusp(rho, R, 0.5)}, 1e-7);
}

TEST(MilledSurface, ChordsGougeByTheirSagAtAFixedAxis) {
  for (const double arc : {0.1, 1.0, 4.0}) {
    const double rho = 50;
    const double R = 5;
    const double half = arc / (rho + R) / 2;
    std::vector<Stop> stops;
    for (int i = -5; i <= 5; i += 2)
      stops.push_back({(rho + R) * Vector3d(std::sin(i * half), 0, std::cos(i * half)) -
                       R * Vector3d::UnitZ()});
    const Surface surface =
        milled_surface(design_of({{rho * Vector3d::UnitZ()}}), {R, R, 20}, motion_of(stops));
    EXPECT_RESIDUALS(surface, std::vector<double>{-(rho + R) * (1 - std::cos(half))},
                     no_difference);
    EXPECT_NEAR(surface.cut_time_s[0], 2.5, 1e-6);
    EXPECT_EQ(surface.cut_line[0], 30);
  }
}

TEST(MilledSurface, ChordsGougeLessWhereTheAxisTurnsAlong) {
  for (const double lead : {0.0, 0.2, -0.5})
    for (const double arc : {0.1, 1.0, 4.0}) {
      const double rho = 50;
      const double R = 5;
      const double half = arc / (rho + R) / 2;
      std::vector<Stop> stops;
      for (int i = -3; i <= 3; i += 2) {
        const Vector3d centre = (rho + R) * Vector3d(std::sin(i * half), 0, std::cos(i * half));
        const Vector3d axis(std::sin(i * half + lead), 0, std::cos(i * half + lead));
        stops.push_back({centre - R * axis, axis});
      }
      // The tip runs on its chord: in the frame of the middle its place shrinks by cos(half) while
      // the axis keeps, which moves the centre by `inward` and also `aside`.
      const double drop = 1 - std::cos(half);
      const double inward = ((rho + R) - R * std::cos(lead)) * drop;
      const double aside = R * std::abs(std::sin(lead)) * drop;
      const Surface surface =
          milled_surface(design_of({{rho * Vector3d::UnitZ()}}), {R, R, 20}, motion_of(stops));
      // Aside by a, the ball is aside^2 / 2 R higher, and may gain that back elsewhere on the move.
      EXPECT_RESIDUALS(surface, std::vector<double>{-inward}, no_difference + aside * aside / R);
    }
}

TEST(MilledSurface, AFlatEndLeavesAnExactPlaneInItsSlotAndNothingBeside) {
  const Cutter flat{5, 0, 20};
  std::vector<Site> sites;
  for (const double y : {0.0, 1.7, -4.9, 4.999999, 5.000001, -6.0})
    for (const double x : {-10.0, 0.0, 24.999, 25.001}) sites.push_back({Vector3d(x, y, 0)});
  const CutterMotion motion = motion_of({{Vector3d(-20, 0, -0.3)}, {Vector3d(20, 0, -0.3)}});
  const Surface surface = milled_surface(design_of(sites), flat, motion);
  double worst = 0.0;
  for (std::size_t i = 0; i < sites.size(); ++i) {
    const double beyond = std::max(0.0, sites[i].point.x() - 20);
    const bool in_slot = std::hypot(sites[i].point.y(), beyond) < 5;
    EXPECT_EQ(surface.status[i] == VertexStatus::Cut, in_slot) << sites[i].point.transpose();
    if (in_slot) worst = std::max(worst, std::abs(surface.residual[Eigen::Index(i)] + 0.3));
  }
  std::cout << "  flat to " << worst * 1e6 << " nm\n";
  EXPECT_LE(worst, 1e-15);
}

TEST(MilledSurface, ATiltedFlatEndDishesByTheEllipseOfItsRim) {
  for (const double lead : {0.01, 0.1, 0.5}) {
    const double R = 5;
    const Vector3d axis(std::sin(lead), 0, std::cos(lead));
    const double tip_height = R * std::sin(lead);
    std::vector<Site> sites;
    std::vector<double> expected;
    for (int i = -49; i <= 49; ++i) {
      const double y = 0.1 * i;
      sites.push_back({Vector3d(0.37 * (i % 5), y, 0)});
      expected.push_back(tip_height - std::sin(lead) * std::sqrt(R * R - y * y));
    }
    const CutterMotion motion =
        motion_of({{Vector3d(-20, 0, tip_height), axis}, {Vector3d(20, 0, tip_height), axis}});
    const Surface surface = milled_surface(design_of(sites), {R, 0, 20}, motion, wide_band);
    EXPECT_RESIDUALS(surface, expected, no_difference);
  }
}

TEST(MilledSurface, ALeadingBullNoseLeavesTheOffsetOfItsRingsEllipse) {
  for (const double lead : {0.02, 0.17, 0.6}) {
    const double R = 5;
    const double r = 1;
    const double ring = R - r;
    const Vector3d axis(std::sin(lead), 0, std::cos(lead));
    std::vector<Site> sites;
    std::vector<double> expected;
    for (int i = -70; i <= 70; ++i) {
      const double psi = 0.02 * i;
      // Seen along the feed: the ring is an ellipse with half axes ring and ring sin(lead).
      Eigen::Vector2d down(std::sin(psi) * std::sin(lead), -std::cos(psi));
      down.normalize();
      const double y = ring * std::sin(psi) + r * down.x();
      const double z = r * std::cos(lead) - ring * std::sin(lead) * std::cos(psi) + r * down.y();
      sites.push_back({Vector3d(0.1 * i, y, 0)});
      expected.push_back(z);
    }
    const CutterMotion motion =
        motion_of({{Vector3d(-20, 0, 0), axis}, {Vector3d(20, 0, 0), axis}});
    const Surface surface = milled_surface(design_of(sites), {R, r, 20}, motion, wide_band);
    EXPECT_RESIDUALS(surface, expected, no_difference);
  }
}

TEST(MilledSurface, TheFlankCutsAWallUpToItsLength) {
  for (const double corner : {0.0, 1.0, 5.0}) {
    const Vector3d normal = Vector3d::UnitY();
    const CutterMotion motion = motion_of({{Vector3d(-30, 5.1, 0)}, {Vector3d(30, 5.1, 0)}});
    const Surface surface = milled_surface(design_of({{Vector3d(1, 0, 5.5), normal},
                                                      {Vector3d(2, 0, 19.9), normal},
                                                      {Vector3d(3, 0, 20.1), normal},
                                                      {Vector3d(4, 0, -0.1), normal}}),
                                           {5, corner, 20}, motion);
    EXPECT_NEAR(surface.residual[0], 0.1, no_difference);
    EXPECT_NEAR(surface.residual[1], 0.1, no_difference);
    EXPECT_EQ(surface.status[2], VertexStatus::Uncut);
    EXPECT_EQ(surface.status[3], VertexStatus::Uncut);
  }
}

TEST(MilledSurface, AnUndercutIsMadeByTheEndAboveAndByTheSideBelow) {
  const Vector3d down = -Vector3d::UnitZ();
  const CutterMotion upright = motion_of({{Vector3d(-30, 0, -20.2)}, {Vector3d(30, 0, -20.2)}});
  const Design bottom = design_of({{Vector3d(1, 2, 0), down}});
  const Surface by_top = milled_surface(bottom, {5, 1, 20}, upright);
  EXPECT_NEAR(by_top.residual[0], 0.2, 1e-12);

  const Vector3d lying = Vector3d::UnitX();
  const CutterMotion along =
      motion_of({{Vector3d(-30, -8, -5.2), lying}, {Vector3d(-30, 8, -5.2), lying}});
  const std::vector<Site> sites = {{Vector3d(-20, 1, 0), down}, {Vector3d(-25.5, 1, 0), down}};
  const Surface by_flank = milled_surface(design_of(sites), {5, 5, 20}, along);
  EXPECT_NEAR(by_flank.residual[0], 0.2, no_difference);                         // the flank
  EXPECT_NEAR(by_flank.residual[1], 5.2 - std::sqrt(25 - 0.25), no_difference);  // the ball
}

TEST(MilledSurface, APlungeAndAPoseThatStandsStillCutToo) {
  const Cutter bull_nose{5, 1, 20};
  const std::vector<Site> sites = {
      {Vector3d(0, 0, 0)}, {Vector3d(3.9, 0, 0)}, {Vector3d(4.5, 0, 0)}};
  const std::vector<double> expected = {-0.25, -0.25, 0.75 - std::sqrt(0.75)};
  EXPECT_RESIDUALS(milled_surface(design_of(sites), bull_nose,
                                  motion_of({{Vector3d(0, 0, 30)}, {Vector3d(0, 0, -0.25)}})),
                   expected, no_difference);
  const CutterMotion pose = motion_of({{Vector3d(0, 0, -0.25)}});
  EXPECT_RESIDUALS(milled_surface(design_of(sites), bull_nose, pose), expected, no_difference);
  const CutterMotion still = motion_of({{Vector3d(0, 0, -0.25)}, {Vector3d(0, 0, -0.25)}});
  EXPECT_RESIDUALS(milled_surface(design_of(sites), bull_nose, still), expected, no_difference);
}

TEST(MilledSurface, AJumpSweepsAndItsInstantIsTheCommonOne) {
  CutterMotion motion = motion_of({{Vector3d(-30, 0, -0.1)}, {Vector3d(30, 0, -0.1)}});
  motion.time_s.setConstant(7.0);
  const Surface surface = milled_surface(design_of({{Vector3d(2, 0, 0)}}), {5, 5, 20}, motion);
  EXPECT_NEAR(surface.residual[0], -0.1, no_difference);
  EXPECT_EQ(surface.cut_time_s[0], 7.0);
}

TEST(MilledSurface, AxisTurningInPlaceSweepsItsWholeWay) {
  // A flank of radius 1 swings by 140 degrees about its tip; the wall stands where it passes.
  const double swing = 140.0 / 180 * pi;
  const Vector3d from(std::sin(-swing / 2), 0, std::cos(swing / 2));
  const Vector3d to(-from.x(), 0, from.z());
  const Vector3d normal = -Vector3d::UnitZ();
  const CutterMotion motion = motion_of({{Vector3d::Zero(), from}, {Vector3d::Zero(), to}});
  const std::vector<Site> sites = {
      {Vector3d(0, 0, 20), normal}, {Vector3d(3, 0, 20), normal}, {Vector3d(0, 0.5, 20), normal}};
  const Surface surface = milled_surface(design_of(sites), {1, 0, 20}, motion, wide_band);
  // The rim of the top is the farthest from the tip: sqrt(400 + 1 - y^2) in the plane of the swing.
  EXPECT_NEAR(surface.residual[0], 20 - std::sqrt(401.0), 1e-7);
  EXPECT_NEAR(surface.residual[1], 20 - std::sqrt(401.0 - 9), 1e-7);
  EXPECT_NEAR(surface.residual[2], 20 - std::sqrt(400.75), 1e-7);
}

TEST(MilledSurface, StatusTellsMissesBuriedStartsAndVerticesLeftOut) {
  Design design = design_of({{Vector3d(0, 0, 0)},     // cut
                             {Vector3d(0, 20, 0)},    // the tool passes beside
                             {Vector3d(0, 0, 2.5)},   // starts in removed material
                             {Vector3d(0, 0, -2.5)},  // beyond the band
                             {Vector3d(1, 0, 0)},     // not judged
                             {Vector3d(0, 0, 30)}});  // the tool passes wholly below
  design.judged = {1, 1, 1, 1, 0, 1};
  const CutterMotion motion = motion_of({{Vector3d(-30, 0, 0.2)}, {Vector3d(30, 0, 0.2)}});
  const Surface surface = milled_surface(design, {5, 5, 20}, motion);
  const std::vector<VertexStatus> expected = {VertexStatus::Cut,     VertexStatus::Uncut,
                                              VertexStatus::Gouged,  VertexStatus::Uncut,
                                              VertexStatus::Outside, VertexStatus::Gouged};
  EXPECT_EQ(surface.status, expected);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const bool cut = expected[i] == VertexStatus::Cut, gouged = expected[i] == VertexStatus::Gouged;
    EXPECT_EQ(std::isnan(surface.residual[Eigen::Index(i)]), !cut);
    EXPECT_EQ(std::isnan(surface.cut_time_s[Eigen::Index(i)]), !cut && !gouged);
    EXPECT_EQ(surface.cut_line[i], cut || gouged ? 10 : 0);
  }
  ASSERT_EQ(surface.gouges.size(), 2u);
  EXPECT_EQ(surface.gouges[0].vertex, 2);
  EXPECT_NEAR(surface.gouges[0].depth, 2.3, no_difference);  // the ball's lowest point
  EXPECT_FALSE(surface.gouges[0].continues_deeper);
  EXPECT_EQ(surface.gouges[1].vertex, 5);
  EXPECT_EQ(surface.gouges[1].depth, 20.0);  // ten bands, and in the tool there
  EXPECT_TRUE(surface.gouges[1].continues_deeper);
}

TEST(MilledSurface, NothingIsCutWithoutMotionAndNothingToldWithoutVertices) {
  const Surface uncut = milled_surface(design_of({{Vector3d(0, 0, 0)}}), {5, 5, 20}, motion_of({}));
  EXPECT_EQ(uncut.status[0], VertexStatus::Uncut);
  const Surface empty = milled_surface(design_of({}), {5, 5, 20}, motion_of({{Vector3d(0, 0, 0)}}));
  EXPECT_EQ(empty.residual.size(), 0);
}

TEST(MilledSurface, OfEqualCutsTheEarlierMoveIsNamed) {
  const Vector3d left(-30, 0, 0);
  const Vector3d right(30, 0, 0);
  const CutterMotion motion = motion_of({{left}, {right}, {left}, {right}});
  const Surface surface = milled_surface(design_of({{Vector3d(1, 0.3, 0)}}), {5, 0, 20}, motion);
  EXPECT_EQ(surface.cut_line[0], 10);
  EXPECT_LE(surface.cut_time_s[0], 1.0);
}

TEST(MilledSurface, BadArraysAndNumbersAreRefusedByName) {
  const Design design = design_of({{Vector3d(0, 0, 0)}});
  const CutterMotion good = motion_of({{Vector3d(-1, 0, 0)}, {Vector3d(1, 0, 0)}});
  const auto refused = [&](const Design& d, const Cutter& c, const CutterMotion& m, double band) {
    EXPECT_THROW(milled_surface(d, c, m, {.band = band, .progress = {}}), std::invalid_argument);
  };
  for (const Cutter& c : {Cutter{0, 0, 20}, Cutter{nan, 0, 20}, Cutter{5, 6, 20}, Cutter{5, -1, 20},
                          Cutter{5, 5, 4}, Cutter{5, nan, 20}, Cutter{5, 5, nan}, Cutter{5, 0, 0}})
    refused(design, c, good, 2.0);
  for (const double band : {0.0, -1.0, nan}) refused(design, {}, good, band);
  CutterMotion bad = good;
  bad.tip(1, 1) = nan;
  refused(design, {}, bad, 2.0);
  bad = good;
  bad.axis(1, 2) = 0.99;
  refused(design, {}, bad, 2.0);
  bad = good;
  bad.axis.row(1) *= -1;
  refused(design, {}, bad, 2.0);
  bad = good;
  bad.time_s[1] = -1;
  refused(design, {}, bad, 2.0);
  bad = good;
  bad.line.pop_back();
  refused(design, {}, bad, 2.0);
  Design bad_design = design;
  bad_design.normals(0, 2) = nan;
  refused(bad_design, {}, good, 2.0);
  bad_design = design;
  bad_design.judged = {1, 1};
  refused(bad_design, {}, good, 2.0);
}

}  // namespace
}  // namespace abbe::cutting
