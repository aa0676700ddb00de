#include <tbb/global_control.h>
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "tests/cutting/largest_difference.h"
#include "tests/cutting/milled_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using Eigen::AngleAxisd;

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
    if (in_slot) worst = std::max(worst, std::abs(surface.residual[Index(i)] + 0.3));
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
      Vector2d down(std::sin(psi) * std::sin(lead), -std::cos(psi));
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
    EXPECT_EQ(std::isnan(surface.residual[Index(i)]), !cut);
    EXPECT_EQ(std::isnan(surface.cut_time_s[Index(i)]), !cut && !gouged);
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
  const Surface uncut =
      milled_surface(design_of({{Vector3d(0, 0, 0)}}), {5, 5, 20}, motion_of(std::vector<Stop>{}));
  EXPECT_EQ(uncut.status[0], VertexStatus::Uncut);
  const Surface empty =
      milled_surface(design_of(std::vector<Site>{}), {5, 5, 20}, motion_of({{Vector3d(0, 0, 0)}}));
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

// What the search of a surface must not lose: moves whose cutter stands in a singular place of the
// ray or of its own frame. A cutter that stands nearly upright, by squareness or a turned head,
// cuts a hollow with its far side. Its depth is first order in the lean, so it is there at every
// lean that a machine has.

/// Across a straight pass along x of a cutter that leans by `lean` along it: the lowest place of
/// its ring at an angle `alpha` from x, and the corner around it. (y, z) mm over the tip.
Vector2d hollow(const Cutter& cutter, double lean, double alpha) {
  const double r = cutter.corner_radius, ring = cutter.radius - r;
  const double flat = std::sin(lean);  // of the ring, seen along x
  Vector2d outward(flat * std::sin(alpha), -std::cos(alpha));
  outward.normalize();
  return Vector2d(ring * std::sin(alpha), r * std::cos(lean) - ring * flat * std::cos(alpha)) +
         r * outward;
}

/// A pass along x from -3 R to 3 R with a sample every `step` mm.
CutterMotion leaning_pass(const Cutter& cutter, double lean, double step, bool there_and_back) {
  const Vector3d axis(std::sin(lean), 0.0, std::cos(lean));
  const double half = 3.0 * cutter.radius;
  const int moves = std::max(1, int(std::lround(2.0 * half / step)));
  std::vector<Stop> stops;
  for (int i = 0; i <= moves; ++i) stops.push_back({{half * (2.0 * i / moves - 1.0), 0, 0}, axis});
  if (there_and_back)
    for (int i = moves; i >= 0; --i) stops.push_back(stops[std::size_t(i)]);
  return motion_of(stops);
}

struct Found {
  double worst = 0.0;  // mm, from the closed form
  double pv = 0.0;     // mm
};

Found against_closed_form(const Cutter& cutter, double lean, double width, double step,
                          bool there_and_back) {
  std::vector<Site> sites;
  std::vector<double> expected;
  const double ring = cutter.radius - cutter.corner_radius;
  for (int k = 0; k < 8; ++k)
    for (int i = -10; i <= 10; ++i) {
      const Vector2d at = hollow(cutter, lean, std::asin(0.5 * width * i / 10 / ring));
      sites.push_back({{(0.0137 + 0.031 * k) * cutter.radius, at.x(), 0.0}});
      expected.push_back(at.y());
    }
  const Surface surface =
      milled_surface(design_of(sites), cutter, leaning_pass(cutter, lean, step, there_and_back));
  Found found;
  for (std::size_t i = 0; i < sites.size(); ++i) {
    const double off = std::abs(surface.residual[Index(i)] - expected[i]);
    if (!std::isnan(found.worst)) found.worst = std::isnan(off) ? off : std::max(found.worst, off);
  }
  found.pv = surface.residual.maxCoeff() - surface.residual.minCoeff();
  return found;
}

struct JudgedCutter {
  const char* name;
  Cutter cutter;
  double width;  // mm judged, of the ring
};
const JudgedCutter judged_cutters[] = {{"flat R10", {10, 0, 30}, 12},
                                       {"flat R40", {40, 0, 60}, 48},
                                       {"bull R6 r1", {6, 1, 25}, 6},
                                       {"bull R0.5 r0.1", {0.5, 0.1, 3}, 0.6},
                                       {"bull R100 r99", {100, 99, 120}, 1.5}};

TEST(UprightCutter, LeavesItsHollowAtEveryLean) {
  for (const JudgedCutter& kind : judged_cutters)
    for (const double lean : {1e-9, 1e-7, 20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 0.01})
      for (const double part : {0.01, 0.1, 1.0, 6.0})
        for (const bool back : {false, true}) {
          const Found found =
              against_closed_form(kind.cutter, lean, kind.width, part * kind.cutter.radius, back);
          EXPECT_LE(found.worst, no_difference)
              << kind.name << ", lean " << lean << ", step " << part << " R, back " << back
              << ": PV " << found.pv * 1e3 << " um";
        }
}

TEST(UprightCutter, PeakToValleyOfAPassIsThatOfTheRing) {
  for (const auto& [kind, lean, pv_um] :
       {std::tuple{judged_cutters[0], 100e-6, 0.200}, std::tuple{judged_cutters[1], 200e-6, 1.600},
        std::tuple{judged_cutters[2], 200e-6, 0.200}})
    for (const double step : {0.05, 0.5, 2.0, 20.0}) {
      const Found found = against_closed_form(kind.cutter, lean, kind.width, step, false);
      std::cout << "  " << kind.name << ", " << lean * 1e6 << " urad, step " << step << " mm: PV "
                << found.pv * 1e3 << " um, closed form " << pv_um << "\n";
      EXPECT_NEAR(found.pv * 1e3, pv_um, 1e-4) << kind.name << ", step " << step;
    }
}

/// Where a small ball touches a plane, the normal runs through its middle and out behind it.
TEST(SmallBall, LeavesThePlaneThatItTouches) {
  const Cutter ball{0.15, 0.15, 2};
  const unsigned seed = 31;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
  for (int plane = 0; plane < 1000; ++plane) {
    const Vector3d n = any().normalized(), x = n.unitOrthogonal();
    const Vector3d axis = (n + 0.2 * x).normalized();
    std::vector<Stop> stops;
    for (int k = 0; k <= 4; ++k) stops.push_back({0.5 * k * x + ball.radius * (n - axis), axis});
    for (const double along : {0.25, 0.75, 1.1, 1.3}) {  // vertices that share nothing
      const Surface surface = milled_surface(design_of({{along * x, n}}), ball, motion_of(stops));
      EXPECT_LE(std::abs(surface.residual[0]), no_difference)
          << "seed " << seed << ", normal " << n.transpose() << ", " << along << " mm along";
    }
  }
}

// The union of a cutter's places by brute force: a point is in it if some place of the axis on a
// fine grid of angles and heights has the point inside the cutter.

/// How far a point at radius r and height z above the tip lies outside a cutter, mm; < 0 inside.
double outside_by(const Cutter& cutter, double r, double z) {
  const double flat = cutter.radius - cutter.corner_radius;
  const double across = std::max(0.0, r - flat);
  const double below = std::max(0.0, cutter.corner_radius - z);
  const bool in_core = across == 0.0 && below == 0.0;
  const double core = in_core ? -1.0 : std::hypot(across, below) - cutter.corner_radius;
  return std::max({core, r - cutter.radius, -z, z - cutter.flank_length});
}

/// The same of the union, at z above the tip at rest.
double outside_union_by(const Cutter& cutter, double radial, double axial, double r, double z) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 720; ++i) {
    const double angle = i * pi / 720;  // the other half mirrors
    const double from_axis = std::hypot(r - radial * std::cos(angle), radial * std::sin(angle));
    for (int k = -20; k <= 20; ++k)
      least = std::min(least, outside_by(cutter, from_axis, z - axial * k / 20));
    if (radial == 0.0) break;
  }
  return least;
}

struct Compared {
  int inside = 0, outside = 0, only_hull = 0, only_union = 0;
  double deepest = 0.0;  ///< mm, height above the tip to which the hull alone reaches
};

Compared compare(const Cutter& cutter, double radial, double axial) {
  const Cutter hull = with_run_out(cutter, radial, axial);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0, 1);
  Compared found;
  const double grid = 1e-4 * (radial + axial) + axial / 20 + 1e-9;
  for (int i = 0; i < 2000; ++i) {
    const bool at_the_tip = i % 2 == 0;
    const double r = (at_the_tip ? 1.5 * radial + 0.01 : 1.3 * cutter.radius) * unit(random);
    const double z = -1.2 * axial + (at_the_tip ? 0.3 : 1.2 * cutter.flank_length) * unit(random);
    const double in_hull = outside_by(hull, r, z + axial);
    const double in_union = outside_union_by(cutter, radial, axial, r, z);
    if (std::abs(in_hull) < grid || std::abs(in_union) < grid) continue;  // at a skin
    ++(in_hull < 0 ? found.inside : found.outside);
    if (in_hull < 0 && in_union > 0) {
      ++found.only_hull;
      found.deepest = std::max(found.deepest, z);
    }
    if (in_hull > 0 && in_union < 0) ++found.only_union;
  }
  std::cout << "run-out " << radial << " " << axial << " on R " << cutter.radius << " corner "
            << cutter.corner_radius << ": " << found.inside << " in, " << found.outside
            << " out, hull alone " << found.only_hull << " up to " << found.deepest << " mm\n";
  EXPECT_GT(found.inside, 250);
  EXPECT_GT(found.outside, 250);
  EXPECT_EQ(found.only_union, 0);
  return found;
}

TEST(RunOut, IsTheUnionOfThePlacesWhereItSaysSo) {
  EXPECT_EQ(compare({5, 0, 20}, 0.3, 0.0).only_hull, 0);  // a flat end
  EXPECT_EQ(compare({6, 1, 20}, 0.3, 0.0).only_hull, 0);  // a bull nose, flat of 5
  EXPECT_EQ(compare({5, 5, 20}, 0.0, 0.2).only_hull, 0);  // axial alone
  EXPECT_EQ(compare({6, 1, 20}, 0.3, 0.2).only_hull, 0);  // every height at every angle
}

TEST(RunOut, BallLeavesAHollowNoDeeperThanStated) {
  for (const double radial : {0.2, 0.5, 1.0}) {
    const Compared found = compare({5, 5, 20}, radial, 0.0);
    const double stated = radial * radial / (5 + std::sqrt(25 - radial * radial));
    EXPECT_GT(found.only_hull, 0) << radial;
    EXPECT_LE(found.deepest, stated + 1e-4) << radial;
  }
  EXPECT_NEAR(1.0_um * 1.0_um / (5 + std::sqrt(25 - 1.0_um * 1.0_um)), 0.1_nm, 1e-12);
}

TEST(RunOut, SynchronousRunOutEnlargesTheEffectiveRadius) {
  const Cutter larger = with_run_out({8, 1, 25}, 12.0_um, 3.0_um);
  EXPECT_DOUBLE_EQ(larger.radius, 8.012);
  EXPECT_DOUBLE_EQ(larger.corner_radius, 1.0);
  EXPECT_DOUBLE_EQ(larger.flank_length, 25.006);
  const Cutter same = with_run_out({8, 1, 25}, 0.0, 0.0);
  EXPECT_EQ(same.radius, 8.0);
  EXPECT_EQ(same.flank_length, 25.0);
}

TEST(RunOut, AmountsThatCannotBeAreRefusedByName) {
  EXPECT_THROW(with_run_out({}, -1e-3, 0), std::invalid_argument);
  EXPECT_THROW(with_run_out({}, nan, 0), std::invalid_argument);
  const std::string said = thrown_text<std::invalid_argument>([&] { with_run_out({}, 0, -1e-3); });
  EXPECT_EQ(said, "expected axial run-out of at least 0 mm, seen -0.001");
}

}  // namespace
}  // namespace abbe::cutting
