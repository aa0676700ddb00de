#include "cutting/stock/collision.h"
#include "tests/oracles/box_overlap.h"
#include "tests/test.h"

namespace abbe::cutting::collision_tests {
namespace {

using kinematics::Pose;
using kinematics::Screw;

constexpr double sag = 1e-3;  // mm

Pose place(const Vector3d& at, const Vector3d& turn = Vector3d::Zero()) {
  Pose T(kinematics::rotation(turn));
  T.pretranslate(at);
  return T;
}

Body box(double x, double y, double z) { return make_body(box_mesh({x, y, z})); }

ClosedMesh cylinder_mesh(double radius, double length) {
  Eigen::MatrixX2d profile(2, 2);
  profile << radius, -0.5 * length, radius, 0.5 * length;
  return revolved_mesh(profile, sag);
}

/// A motion about an axis through the origin, and along it.
Screw helix(const Pose& start, const Vector3d& axis, double angle, double pitch) {
  // in the frame that moves
  const Vector3d turn = angle * (start.linear().transpose() * axis);
  const Vector3d arm = start.linear().transpose() * start.translation();
  return {start, turn, turn.cross(arm) + pitch * (start.linear().transpose() * axis)};
}

/// Contact not after the true one, and before it by the distance that is contact.
void expect_contact(const Body& a, const Body& b, const Screw& motion, double true_u,
                    double true_speed, double facets = 0.0) {
  const ApproachOptions options;
  const Approach found = approach(a, b, motion, options);
  ASSERT_TRUE(found.contact);
  EXPECT_LE(found.u, true_u + 1e-12);
  EXPECT_LE((true_u - found.u) * true_speed, 1.01 * (options.resolution + facets));
  EXPECT_LE(found.gap.distance, options.resolution);
}

TEST(Collision, TheGapOfParallelFacesIsWhatItIs) {
  std::mt19937 random(1718);
  std::uniform_real_distribution<double> any(-1, 1), length(0.1, 400);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  double worst = 0.0;
  for (int n = 0; n < 300; ++n)
    for (const double g : {1e-6, 1.0, 500.0}) {
      const double below = length(random), above = length(random);
      const Pose all = place(1000 * vector(), 3 * vector());
      const Body a = box(length(random), length(random), below),
                 b = box(length(random), length(random), above);
      const Pose T_b = all * place({0, 0, 0.5 * (below + above) + g}, {0, 0, 3 * any(random)});
      const Gap found = gap(a, all, b, T_b);
      worst = std::max({worst, std::abs(found.distance - g),
                        std::abs((found.on_a - found.on_b).norm() - found.distance)});
    }
  std::cout << "gaps within " << worst << " mm\n";
  EXPECT_LT(worst, 1e-8);
}

TEST(Collision, AThinPlateIsMetAtAnySpeed) {
  for (const double way : {10.0, 1e3, 1e5})
    for (const double thick : {1.0, 0.01, 1e-4}) {
      const Body plate = box(thick, 100, 100), ram = box(2, 2, 2);
      const Screw motion{place({-5, 0, 0}), Vector3d::Zero(), {way, 0, 0}};
      expect_contact(plate, ram, motion, (5.0 - 1.0 - 0.5 * thick) / way, way);
    }
}

TEST(Collision, BallsMeetBoxesAtTheirRadius) {
  const Body ball = make_body(sphere_mesh(5.0, sag)), block = box(40, 40, 40);
  for (const Vector3d& from : {Vector3d(0, 0, 60), Vector3d(60, 0, 0), Vector3d(60, 60, 60)}) {
    const Vector3d corner = from.cwiseMin(20.0), way = -from;
    // the nearest place of the block lies at the corner, and stays there
    double low = 0.0, high = 1.0;
    for (int n = 0; n < 60; ++n) {
      const double u = 0.5 * (low + high);
      ((from + u * way - (from + u * way).cwiseMin(corner)).norm() > 5.0 ? low : high) = u;
    }
    expect_contact(block, ball, {place(from), Vector3d::Zero(), way}, low, way.norm(), sag);
  }
}

TEST(Collision, ABarThatTurnsMeetsAWall) {
  const Body wall = box(400, 1, 400), bar = box(200, 10, 10);
  const Pose start = place({0, -60.5, 0});  // in the frame of the wall
  const double corner = std::hypot(100.0, 5.0), first = std::atan2(5.0, 100.0);
  const Vector3d turn(0, 0, 1.5);
  const double met = (std::asin(60.0 / corner) - first) / 1.5;
  const double speed = 1.5 * std::sqrt(corner * corner - 60.0 * 60.0);
  expect_contact(wall, bar, {start, turn, Vector3d::Zero()}, met, speed);
}

TEST(Collision, ACylinderThatTipsMeetsTheFloor) {
  const double radius = 20.0, length = 120.0, height = 62.0;
  const Body floor = box(500, 500, 1), post = make_body(cylinder_mesh(radius, length));
  const auto lowest = [&](double angle) {
    return height - 0.5 * length * std::cos(angle) - radius * std::sin(angle);
  };
  double low = 0.0, high = 0.3;
  ASSERT_LT(lowest(high), 0.0);
  for (int n = 0; n < 60; ++n) {
    const double angle = 0.5 * (low + high);
    (lowest(angle) > 0.0 ? low : high) = angle;
  }
  const double speed = 0.3 * (radius * std::cos(low) - 0.5 * length * std::sin(low));
  expect_contact(floor, post, {place({0, 0, height + 0.5}), {0.3, 0, 0}, Vector3d::Zero()},
                 low / 0.3, speed, sag);
}

TEST(Collision, ABallOnAHelixMeetsAThinCeiling) {
  const Body ceiling = box(300, 300, 1e-3), ball = make_body(sphere_mesh(4.0, sag));
  const double pitch = 50.0, below = 30.0;
  const Pose start = place({80, 0, -below});
  expect_contact(ceiling, ball, helix(start, Vector3d::UnitZ(), 3.0, pitch),
                 (below - 4.0 - 0.5e-3) / pitch, pitch, sag);
}

TEST(Collision, TheLeastDistanceOfAPassIsFound) {
  // a ball past an edge, at a distance that is known
  constexpr double facets = 1e-2;
  const Body block = box(20, 20, 20), ball = make_body(sphere_mesh(3.0, facets));
  for (const double gap : {0.02, 1.0, 50.0}) {
    const Screw motion{place({-100, 0, 13.0 + gap}), Vector3d::Zero(), {200, 0, 0}};
    const ApproachOptions options;
    const Approach found = approach(block, ball, motion, options);
    EXPECT_FALSE(found.contact);
    EXPECT_LE(found.gap.distance, gap + std::max(options.within, options.share * gap));
    EXPECT_GE(found.gap.distance, gap - facets);
    EXPECT_NEAR(found.gap.on_a.z(), 10.0, 1e-9);
  }
}

TEST(Collision, ComesWithinADistanceNotAfterItDoes) {
  std::mt19937 random(1719);
  std::uniform_real_distribution<double> any(-1, 1), length(0.1, 40);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  constexpr double tolerance = 5e-3;
  constexpr int looks = 2000;
  int within = 0;
  double earliest = 0.0;  // mm
  for (int n = 0; n < 60; ++n) {
    const Body a = box(length(random), length(random), length(random)),
               b = box(length(random), length(random), length(random));
    const Screw motion{place(45 * vector(), vector()), 2 * vector(), 60 * vector()};
    const double distance = std::array{1e-6, 0.3, 2.0, 9.0}[std::size_t(n % 4)];
    const double speed = kinematics::max_speed(motion, b.centre, b.radius);
    const std::optional<double> found = first_time_within(a, b, motion, distance, tolerance);
    if (found) ++within;
    const auto gap_at = [&](double u) {
      return gap(a, Pose::Identity(), b, kinematics::pose_at(motion, u)).distance;
    };
    for (int i = 0; i <= looks && double(i) / looks < found.value_or(1.1); ++i)
      ASSERT_GT(gap_at(double(i) / looks), distance) << "scene " << n;
    if (!found) continue;
    EXPECT_LE(gap_at(*found), distance + tolerance);
    if (*found > 0.0) EXPECT_GE(gap_at(*found), distance - 1e-9);
    earliest = std::max(earliest, gap_at(*found) - distance);
  }
  std::cout << within << " of 60 come within (seed 1719), at most " << earliest << " mm early\n";
  EXPECT_GT(within, 10);
  EXPECT_LT(within, 50);
  // on the way past an edge, and where nothing moves
  const Body block = box(20, 20, 20), ball = make_body(sphere_mesh(3.0, 1e-3));
  const Screw past{place({-100, 0, 13.5}), Vector3d::Zero(), {200, 0, 0}};
  EXPECT_FALSE(first_time_within(block, ball, past, 0.49, tolerance));
  // a ball 3.5 mm over a face and its edge: 1 mm from the edge at x = -10 - sqrt(4^2 - 3.5^2)
  const double u = (100 - 10 - std::sqrt(16 - 3.5 * 3.5)) / 200;
  EXPECT_NEAR(first_time_within(block, ball, past, 1.0, tolerance).value(), u, 1e-4);
  const Screw still{place({0, 0, 14}), Vector3d::Zero(), Vector3d::Zero()};
  EXPECT_EQ(first_time_within(block, ball, still, 1.01, tolerance), 0.0);
  EXPECT_FALSE(first_time_within(block, ball, still, 0.9, tolerance));
  EXPECT_THROW(first_time_within(block, ball, still, 0.9, 0.0), std::invalid_argument);
}

TEST(Collision, RandomBoxesMeetWhenNoAxisPartsThem) {
  const bool thorough = std::getenv("ABBE_LONG") != nullptr;
  const int scenes = thorough ? 1000 : 150;
  constexpr double finest = 1e-3;  // mm of the fastest point, a step of the oracle
  std::mt19937 random(1717);
  std::uniform_real_distribution<double> any(-1, 1), length(0.1, 40);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  const ApproachOptions options;
  int contacts = 0, queries = 0;
  for (int n = 0; n < scenes; ++n) {
    const Vector3d size_a(length(random), length(random), length(random)),
        size_b(length(random), length(random), length(random));
    const Body a = make_body(box_mesh(size_a)), b = make_body(box_mesh(size_b));
    const Screw motion{place(45 * vector(), vector()), 2 * vector(), 60 * vector()};
    const Approach found = approach(a, b, motion, options);
    queries += found.queries;
    const auto overlap = [&](double u, double more) {
      return oracles::boxes_overlap({size_a, Pose::Identity()},
                                    {size_b, kinematics::pose_at(motion, u)}, more);
    };
    // none is missed: a fine step sees no overlap before what was found; thorough runs step by
    // micrometres, others by hundredths
    const double speed = kinematics::max_speed(motion, b.centre, b.radius);
    const double step = (thorough ? finest : 10 * finest) / speed;
    const double until = found.contact ? found.u : 1.0;
    for (double u = 0.0; u < until; u += step)
      ASSERT_FALSE(overlap(u, 0.0)) << "scene " << n << " at " << u << " before " << until;
    if (!found.contact) continue;
    ++contacts;
    // none is invented: what is called contact overlaps once it is thicker by the resolution
    EXPECT_TRUE(overlap(found.u, options.resolution)) << "scene " << n;
  }
  std::cout << contacts << " contacts of " << scenes << " scenes (seed 1717), "
            << double(queries) / scenes << " distances each\n";
  EXPECT_GT(contacts, scenes / 10);
  EXPECT_LT(contacts, scenes - scenes / 10);
}

TEST(Collision, WhatLiesInsideIsNotSeenByTheGap) {
  const Body room = box(100, 100, 100), ball = make_body(sphere_mesh(5.0, sag));
  EXPECT_TRUE(is_inside(room, Pose::Identity(), ball, place({10, 20, 30})));
  EXPECT_TRUE(is_inside(ball, place({10, 20, 30}), room, Pose::Identity()));
  EXPECT_FALSE(is_inside(room, Pose::Identity(), ball, place({48, 0, 0})));  // across the wall
  EXPECT_FALSE(is_inside(room, Pose::Identity(), ball, place({70, 0, 0})));
  EXPECT_NEAR(gap(room, Pose::Identity(), ball, place({10, 0, 0})).distance, 35.0, 2 * sag);
}

double volume(const ClosedMesh& mesh) {
  double six = 0.0;
  for (const auto& t : mesh.triangles.rowwise()) {
    const Vector3d a = mesh.vertices.row(t[0]), b = mesh.vertices.row(t[1]),
                   c = mesh.vertices.row(t[2]);
    six += a.dot(b.cross(c));
  }
  return six / 6;
}

/// Every edge once in each direction.
void expect_closed(const ClosedMesh& mesh) {
  std::map<std::pair<int, int>, int> sides;
  for (const auto& t : mesh.triangles.rowwise())
    for (int k = 0; k < 3; ++k) ++sides[{t[k], t[(k + 1) % 3]}];
  for (const auto& [side, count] : sides) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(sides.contains({side.second, side.first}));
  }
}

TEST(Bodies, AreClosedAndLieAroundWhatTheyStandFor) {
  constexpr double pi = std::numbers::pi;
  const ClosedMesh block = box_mesh({1, 2, 3});
  expect_closed(block);
  EXPECT_NEAR(volume(block), 6.0, 1e-12);
  for (const double radius : {0.5, 5.0, 50.0}) {
    const ClosedMesh ball = sphere_mesh(radius, sag);
    expect_closed(ball);
    const double exact = 4.0 / 3.0 * pi * std::pow(radius, 3);
    EXPECT_GT(volume(ball), exact);
    EXPECT_LT(volume(ball), exact + 4 * pi * radius * radius * sag * 1.01);
    EXPECT_LE(ball.vertices.rowwise().norm().maxCoeff(), radius + 1.001 * sag);
  }
  Eigen::MatrixX2d holder(4, 2);
  holder << 10, 0, 10, 20, 25, 30, 25, 60;
  const ClosedMesh revolved = revolved_mesh(holder, sag);
  expect_closed(revolved);
  const double exact = pi * (100 * 20 + 10.0 / 3 * (100 + 250 + 625) + 625 * 30);
  EXPECT_GT(volume(revolved), exact);
  EXPECT_LT(volume(revolved), exact * (1 + 2.1 * sag / 10));
  Eigen::MatrixX2d ell(6, 2);
  ell << 0, 0, 4, 0, 4, 1, 1, 1, 1, 3, 0, 3;
  const ClosedMesh extruded = extruded_mesh(ell, 2.0);
  expect_closed(extruded);
  EXPECT_NEAR(volume(extruded), 12.0, 1e-12);
}

TEST(Bodies, ThatCannotBeAreRefused) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3d& size : {Vector3d(0, 1, 1), Vector3d(1, -1, 1), Vector3d(1, 1, nan)})
    EXPECT_THROW(box_mesh(size), std::invalid_argument);
  for (const double radius : {0.0, -1.0, nan})
    EXPECT_THROW(sphere_mesh(radius, sag), std::invalid_argument);
  EXPECT_THROW(sphere_mesh(1.0, 0.0), std::invalid_argument);
  Eigen::MatrixX2d profile(3, 2);
  for (const auto& rows : {std::array<double, 6>{1, 0, 1, 0, 1, 5},
                           {1, 0, 2, 5, 1, 4},
                           {0, 0, 0, 1, 0, 2},
                           {1, 0, -1, 1, 1, 2},
                           {1, 0, nan, 1, 1, 2}}) {
    profile << rows[0], rows[1], rows[2], rows[3], rows[4], rows[5];
    EXPECT_THROW(revolved_mesh(profile, sag), std::invalid_argument);
  }
  Eigen::MatrixX2d clockwise(3, 2);
  clockwise << 0, 0, 0, 1, 1, 0;
  EXPECT_THROW(extruded_mesh(clockwise, 1.0), std::invalid_argument);
  EXPECT_THROW(make_body(ClosedMesh{}), std::invalid_argument);
  ClosedMesh wrong = box_mesh({1, 1, 1});
  wrong.triangles(0, 0) = 8;
  EXPECT_THROW(make_body(wrong), std::invalid_argument);
  EXPECT_THROW(approach(box(1, 1, 1), box(1, 1, 1), {}, {.resolution = 0.0}),
               std::invalid_argument);
}

/// A cutter and a shank beside a box: pieces, one of them a point with a skin.
TEST(Collision, PointsOfAGapAreSoFarApartAndOnTheirBodies) {
  constexpr unsigned seed = 1732;
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  Cutter ball, bull;
  ball.radius = ball.corner_radius = 4.9;
  bull.radius = 7.0;
  bull.corner_radius = 1.3;
  const std::array<Body, 2> cutters{make_body(cutter_meshes(ball, sag)),
                                    make_body(cutter_meshes(bull, sag))};
  const Body clamp = box(30.0, 24.0, 110.0);
  const Body round = make_body(sphere_mesh(30.0, 1e-2));  // of enough triangles to be sorted
  int apart = 0;
  for (int k = 0; k < 4000; ++k) {
    const Body& other = k % 2 == 0 ? clamp : round;
    const Body& cutter = cutters[std::size_t(k / 2 % 2)];
    const Pose T_a = place(90.0 * Vector3d(any(random), any(random), any(random)),
                           3.0 * Vector3d(any(random), any(random), any(random))),
               T_b = place(9.0 * Vector3d(any(random), any(random), any(random)),
                           3.0 * Vector3d(any(random), any(random), any(random)));
    const Gap found = gap(cutter, T_a, other, T_b), back = gap(other, T_b, cutter, T_a);
    EXPECT_NEAR(back.distance, found.distance, 1e-9);
    if (!(found.distance > 0.0)) continue;
    ++apart;
    EXPECT_NEAR((found.on_a - found.on_b).norm(), found.distance, 1e-9);
    const Body dot = make_body(ClosedMesh{Points::Zero(1, 3), Triangles::Zero(1, 3), 0.0});
    EXPECT_LT(gap(dot, place(found.on_b), other, T_b).distance, 1e-9);
    EXPECT_LT(gap(dot, place(found.on_a), cutter, T_a).distance, 1e-9);
    // a limit just above it changes nothing
    const Gap limited = gap(cutter, T_a, other, T_b, {0.0, found.distance * (1.0 + 1e-12)});
    EXPECT_NEAR((limited.on_a - limited.on_b).norm(), found.distance, 1e-9);
  }
  EXPECT_GT(apart, 1000);
}

TEST(Bodies, InPatchesAreTheSameBody) {
  constexpr unsigned seed = 1731;
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  ClosedMesh mesh = sphere_mesh(20.0, 1e-2);
  Body patches = make_patched_body(mesh, 7.0);
  const Body other = box(6.0, 9.0, 3.0);
  for (int state = 0; state < 4; ++state) {
    const Body whole = make_body(mesh);
    EXPECT_NEAR(patches.radius, whole.radius, 1e-12);
    EXPECT_NEAR(extent(patches, Vector3d::UnitX()), extent(whole, Vector3d::UnitX()), 1e-12);
    int inside = 0;
    for (int k = 0; k < 200; ++k) {
      const Pose T = place(20.0 * Vector3d(any(random), any(random), any(random)),
                           3.0 * Vector3d(any(random), any(random), any(random)));
      const Gap one = gap(patches, Pose::Identity(), other, T),
                same = gap(whole, Pose::Identity(), other, T);
      EXPECT_NEAR(one.distance, same.distance, 1e-9);
      EXPECT_EQ(is_inside(patches, Pose::Identity(), other, T),
                is_inside(whole, Pose::Identity(), other, T));
      inside += is_inside(whole, Pose::Identity(), other, T);
    }
    EXPECT_GT(inside, 20);
    // a dent in one place: the other patches are kept
    for (Index i = 0; i < mesh.vertices.rows(); ++i)
      if (mesh.vertices(i, state % 3) > 15.0) mesh.vertices(i, state % 3) -= 2.0;
    patches = make_patched_body(mesh, 7.0, patches);
  }
  EXPECT_THROW(make_patched_body(mesh, 0.0), std::invalid_argument);
  EXPECT_THROW(make_patched_body({}, 1.0), std::invalid_argument);
}

TEST(Collision, AGapThatMayBeRoughOrLimitedIsSoMuchOff) {
  std::mt19937 random(4711);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  Eigen::MatrixX2d profile(4, 2);
  profile << 5, 0, 20, 10, 8, 30, 12, 60;
  const Body a = make_body(revolved_mesh(profile, 5e-3)), b = make_body(sphere_mesh(15.0, 5e-3));
  double worst = 0.0;
  for (int n = 0; n < 300; ++n) {
    const Pose T_a = place(100.0 * vector(), 3.0 * vector());
    const Pose T_b = T_a * place(80.0 * vector(), 3.0 * vector());
    const double d = gap(a, T_a, b, T_b).distance;
    const double rough = gap(a, T_a, b, T_b, {0.05}).distance;
    EXPECT_GE(rough, d - 1e-9);
    EXPECT_LE(rough, d * 1.05 + 1e-9);
    worst = std::max(worst, d > 0.0 ? rough / d : 1.0);
    const double most = 40.0 * std::abs(any(random));
    const double limited = gap(a, T_a, b, T_b, {0.0, most}).distance;
    EXPECT_NEAR(limited, std::min(d, most), 1e-9);
  }
  std::cout << "rough distances up to " << worst << " times\n";
}

TEST(Collision, CuttersThatLeanStandAtTheirLowestPoint) {
  std::mt19937 random(515);
  std::uniform_real_distribution<double> any(0, 1);
  const Body floor = box(2000, 2000, 100);
  double worst = 0.0;
  for (int n = 0; n < 300; ++n) {
    Cutter cutter;
    cutter.radius = 0.5 + 20.0 * any(random);
    const double kind = any(random);
    cutter.corner_radius = kind < 0.4   ? cutter.radius
                           : kind < 0.6 ? 0.0
                                        : cutter.radius * any(random);
    cutter.flank_length = cutter.corner_radius + 30.0 * any(random) + 0.1;
    const double lean = 1.5 * any(random), height = 50.0 * any(random);
    const double flat = cutter.radius - cutter.corner_radius, r = cutter.corner_radius;
    // of the ring that the corner rolls around
    const double lowest = r * std::cos(lean) - flat * std::sin(lean) - r;
    const Pose T = place({30.0 * any(random), 0, 50.0 + height - lowest}) *
                   place(Vector3d::Zero(), {0, 0, 6.0 * any(random)}) *
                   place(Vector3d::Zero(), {lean, 0, 0});
    const double found =
        gap(floor, Pose::Identity(), make_body(cutter_meshes(cutter, sag)), T).distance;
    EXPECT_LE(found, height + 1e-9);
    worst = std::max(worst, height - found);
    // the mesh for pictures lies around it, too
    const double drawn =
        gap(floor, Pose::Identity(), make_body(cutter_mesh(cutter, 0.02)), T).distance;
    EXPECT_LE(drawn, height + 1e-9);
    EXPECT_GE(drawn, height - 0.0202);
  }
  std::cout << "cutters within " << worst << " mm\n";
  EXPECT_LE(worst, 1.01 * sag);
}

}  // namespace
}  // namespace abbe::cutting::collision_tests
