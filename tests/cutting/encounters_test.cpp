#include "cutting/stock/encounters.h"
#include <tbb/global_control.h>
#include "cutting/stock/separation.h"
#include "tests/test.h"

namespace abbe::cutting::encounters_tests {
namespace {

using kinematics::Pose;

Pose at(const Vector3d& place, const Vector3d& turn = Vector3d::Zero()) {
  Pose T(kinematics::rotation(turn));
  T.pretranslate(place);
  return T;
}

Body box(const Vector3d& size) { return make_body(box_mesh(size)); }

/// A carriage that turns about z of the first, which stands still: by `turn` rad, and along x by
/// `way` mm at even steps.
CarrierMotion turning_slide(std::size_t instants, double turn, double way, const Vector3d& start) {
  CarrierMotion motion;
  motion.carriers = 2;
  motion.instants = instants;
  motion.place = [=](std::size_t i, double u, std::span<Pose> T) {
    const double share = (double(i) + u) / double(instants - 1);
    T[0] = Pose::Identity();
    T[1] = Pose(Eigen::AngleAxisd(share * turn, Vector3d::UnitZ())) *
           at(start + share * way * Vector3d::UnitX());
  };
  const double dx = way / double(instants - 1), da = turn / double(instants - 1);
  const double reach = start.norm() + std::abs(way) + 1000.0;
  motion.bulge.assign(instants - 1, (da * da * reach + 2.0 * std::abs(da * dx)) / 8.0);
  for (std::size_t i = 0; i < instants; i += 10) motion.segments.push_back(i);
  return motion;
}

double instant(const Moment& moment) { return double(moment.instant) + moment.u; }

TEST(Encounters, ABoxMeetsAWallWhereItIs) {
  // 0.4 mm a step towards a wall that stands 40 mm away
  const std::vector<CarrierBody> bodies{{box({100, 400, 400}), 0}, {box({20, 20, 20}), 1}};
  const CarrierMotion motion = turning_slide(201, 0.0, -80.0, {100.0, 0.0, 0.0});
  const Encounters found = encounters(bodies, {{0, 1}}, motion);
  ASSERT_EQ(found.list.size(), 1u);
  const double met = 40.0 / 0.4;  // steps
  EXPECT_TRUE(found.list[0].contact);
  EXPECT_LE(instant(found.list[0].moment), met + 1e-9);
  EXPECT_LE((met - instant(found.list[0].moment)) * 0.4, 1.01 * EncounterOptions().resolution);
  EXPECT_NEAR(found.list[0].place.x(), 50.0, 0.01);
  EXPECT_EQ(found.list[0].first_segment, 10u);
  EXPECT_EQ(found.list[0].last_segment, 20u);
  EXPECT_EQ(found.pairs[0].distance, 0.0);
  const Penetration out =
      penetration(bodies[0].body, Pose::Identity(), bodies[1].body, at({20, 0, 0}));
  EXPECT_NEAR(out.depth, 40.0, 2e-3);
  EXPECT_NEAR(out.direction.x(), 1.0, 1e-9);
}

TEST(Encounters, TheDepthOfABallInABoxIsItsWayOut) {
  std::mt19937 random(217);
  std::uniform_real_distribution<double> any(-1, 1);
  const Body plate = box({200, 150, 60}), ball = make_body(sphere_mesh(10.0, 2e-3));
  double worst = 0.0;
  for (int n = 0; n < 12; ++n) {
    const Pose all = at(500.0 * Vector3d(any(random), any(random), any(random)),
                        3.0 * Vector3d(any(random), any(random), any(random)));
    const double depth = 0.01 + 4.0 * std::abs(any(random));
    const Vector3d inside(80.0 * any(random), 55.0 * any(random), 30.0 + 10.0 - depth);
    const Pose T = all * at(inside, Vector3d(any(random), any(random), any(random)));
    worst = std::max(worst, std::abs(penetration(plate, all, ball, T).depth - depth));
  }
  std::cout << "depth within " << worst << " mm\n";
  EXPECT_LT(worst, 3e-3);
}

TEST(Encounters, WhatOverlapsAtTheStartIsSaidAndLeftOut) {
  const std::vector<CarrierBody> bodies{
      {box({100, 100, 100}), 0}, {box({20, 20, 20}), 1}, {box({1, 1, 1}), 1}};
  const CarrierMotion motion = turning_slide(11, 0.1, 5.0, {50.0, 0.0, 0.0});
  const Encounters found = encounters(bodies, {{0, 1}, {0, 2}}, motion);
  EXPECT_TRUE(found.pairs[0].overlaps_at_start);
  EXPECT_TRUE(found.pairs[1].overlaps_at_start);
  const CarrierMotion inside = turning_slide(11, 0.1, 5.0, {0.0, 0.0, 0.0});
  EXPECT_TRUE(encounters(bodies, {{0, 2}}, inside).pairs[0].overlaps_at_start);
}

/// Bodies and motions at random: boxes and cones on two carriages that pass each other.
struct RandomScene {
  std::vector<CarrierBody> bodies;
  std::vector<BodyPair> pairs;
  CarrierMotion motion;
};

RandomScene random_scene(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1), length(2, 60);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  RandomScene scene;
  for (int k = 0; k < 6; ++k) {
    ClosedMesh mesh = box_mesh({length(random), length(random), length(random)});
    if (k % 3 == 2) {
      Eigen::MatrixX2d profile(2, 2);
      profile << 0.3 * length(random), 0.0, 0.3 * length(random), length(random);
      mesh = revolved_mesh(profile, 0.05);
    }
    scene.bodies.push_back(
        {make_body(transformed_mesh(mesh, at(50.0 * vector(), 3.0 * vector()))), k < 3 ? 0 : 1});
  }
  for (int a = 0; a < 3; ++a)
    for (int b = 3; b < 6; ++b) scene.pairs.push_back({a, b});
  scene.motion = turning_slide(200, 2.0 * any(random), 300.0 * any(random), 70.0 * vector());
  return scene;
}

TEST(Encounters, AreThoseOfEveryPairLookedAtEverywhere) {
  constexpr unsigned seed = 2611;
  std::mt19937 random(seed);
  std::size_t contacts = 0, misses = 0, asked = 0, all_asked = 0;
  for (int n = 0; n < 40; ++n) {
    const RandomScene scene = random_scene(random);
    EncounterOptions options;
    options.clearance = 8.0;
    options.chunk = n % 2 == 0 ? 8192 : 37;
    const Encounters quick = encounters(scene.bodies, scene.pairs, scene.motion, options);
    options.accelerated = false;
    const Encounters slow = encounters(scene.bodies, scene.pairs, scene.motion, options);
    asked += quick.queries;
    all_asked += slow.queries;
    ASSERT_EQ(quick.list.size(), slow.list.size()) << "scene " << n << " of seed " << seed;
    for (std::size_t k = 0; k < quick.list.size(); ++k) {
      const Encounter &one = quick.list[k], &other = slow.list[k];
      EXPECT_EQ(one.pair, other.pair);
      EXPECT_EQ(one.contact, other.contact);
      EXPECT_EQ(one.first_segment, other.first_segment);
      EXPECT_EQ(one.last_segment, other.last_segment);
      if (one.contact) {
        EXPECT_NEAR(instant(one.moment), instant(other.moment), 0.02);
      }
      (one.contact ? contacts : misses) += 1;
    }
    for (std::size_t p = 0; p < scene.pairs.size(); ++p) {
      const double low = std::min(quick.pairs[p].distance, slow.pairs[p].distance),
                   high = std::max(quick.pairs[p].distance, slow.pairs[p].distance);
      EXPECT_LE(high, std::max(low / (1.0 - options.share), low + 0.011));
    }
    for (std::size_t s = 0; s < quick.segments.size(); ++s) {
      const double least = quick.segments[s].min_clearance, other = slow.segments[s].min_clearance;
      EXPECT_LE(std::max(least, other), std::max(std::min(least, other) / (1.0 - options.share),
                                                 std::min(least, other) + 0.011))
          << "stretch " << s << " of scene " << n;
    }
  }
  std::cout << contacts << " contacts, " << misses << " near misses; " << asked << " of "
            << all_asked << " distances\n";
  EXPECT_GT(contacts, 10u);
  EXPECT_GT(misses, 5u);
  EXPECT_LT(asked, all_asked / 5);
}

/// Waves of amplitude 1 mm over 60 x 60 mm, an open surface.
ClosedMesh waves(int across) {
  ClosedMesh mesh;
  const auto place = [&](int i) { return 60.0 * i / across - 30.0; };
  mesh.vertices.resize((across + 1) * (across + 1), 3);
  mesh.triangles.resize(2 * across * across, 3);
  for (int j = 0; j <= across; ++j)
    for (int i = 0; i <= across; ++i)
      mesh.vertices.row(j * (across + 1) + i) << place(i), place(j),
          std::sin(0.4 * place(i)) * std::cos(0.3 * place(j));
  for (int j = 0, t = 0; j < across; ++j)
    for (int i = 0; i < across; ++i) {
      const int a = j * (across + 1) + i, b = a + across + 1;
      mesh.triangles.row(t++) << a, a + 1, b + 1;
      mesh.triangles.row(t++) << a, b + 1, b;
    }
  return mesh;
}

/// A cutter that leans and follows the waves at some height above them, dips included.
CarrierMotion along_waves(double height, double radius, double lean, double phase) {
  CarrierMotion motion;
  constexpr std::size_t instants = 600;
  motion.carriers = 2;
  motion.instants = instants;
  motion.place = [=](std::size_t instant, double u, std::span<Pose> T) {
    const double x = -25.0 + 50.0 * (double(instant) + u) / (instants - 1),
                 y = 20.0 * std::sin(0.1 * x + phase);
    const double wave = std::sin(0.4 * x) * std::cos(0.3 * y);
    const double above = 5.0 * std::max(0.0, 1.0 - (double(instant) + u) / 50.0);  // it comes down
    Pose tool = at({x, y, wave + height + above + radius});
    tool.linear() =
        Eigen::AngleAxisd(lean, Vector3d(1.0, 0.4, 0.0).normalized()).toRotationMatrix();
    tool.translation() -= radius * tool.linear().col(2);  // of the tip, the ball stays where it is
    T[0] = Pose::Identity();
    T[1] = tool;
  };
  // curvature of the way over the square of a step
  motion.bulge.assign(instants - 1, 0.2 * std::pow(60.0 / instants, 2) / 8.0);
  for (std::size_t i = 0; i < instants; i += 25) motion.segments.push_back(i);
  return motion;
}

TEST(Encounters, ACutterThatFollowsASurfaceMeetsWhatItMeetsLookedAtEverywhere) {
  constexpr unsigned seed = 2631;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  const Body surface = make_body(waves(60));
  std::size_t contacts = 0, clear = 0, asked = 0, all_asked = 0;
  for (int n = 0; n < 24; ++n) {
    const double radius = 3.0 + any(random), corner = n % 3 == 0 ? 0.5 * radius : radius;
    const double height = n % 2 == 0 ? 0.3 * any(random) : 1.2 + 0.8 * any(random);
    const Body cutter = make_body(cutter_meshes(Cutter{radius, corner, 25}, 0.01));
    const std::vector<CarrierBody> bodies{{surface, 0}, {cutter, 1}};
    const CarrierMotion motion =
        along_waves(height, radius, 0.6 * std::abs(any(random)), 3.0 * any(random));
    EncounterOptions options;
    options.chunk = n % 2 == 0 ? 8192 : 90;
    const Encounters quick = encounters(bodies, {{0, 1, true}}, motion, options);
    options.accelerated = false;
    const Encounters slow = encounters(bodies, {{0, 1, true}}, motion, options);
    asked += quick.queries;
    all_asked += slow.queries;
    const auto met = [](const Encounters& all) {
      std::vector<Encounter> list = all.list;
      std::erase_if(list, [](const Encounter& one) { return !one.contact; });
      return list;
    };
    const std::vector<Encounter> one = met(quick), other = met(slow);
    ASSERT_EQ(one.size(), other.size()) << "cutter " << n << " of seed " << seed;
    EXPECT_EQ(quick.pairs[0].overlaps_at_start, slow.pairs[0].overlaps_at_start);
    for (std::size_t k = 0; k < one.size(); ++k) {
      EXPECT_EQ(one[k].first_segment, other[k].first_segment);
      EXPECT_EQ(one[k].last_segment, other[k].last_segment);
      EXPECT_NEAR(instant(one[k].moment), instant(other[k].moment), 0.05);
    }
    (one.empty() ? clear : contacts) += 1;
  }
  std::cout << contacts << " cutters meet, " << clear << " do not; " << asked << " of " << all_asked
            << " distances\n";
  EXPECT_GT(contacts, 5u);
  EXPECT_GT(clear, 5u);
  EXPECT_LT(asked, all_asked / 5);
}

TEST(Encounters, AreTheSameForAnyNumberOfThreads) {
  std::mt19937 random(99);
  const RandomScene scene = random_scene(random);
  EncounterOptions options;
  options.chunk = 20;
  options.clearance = 5.0;
  const auto with = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return encounters(scene.bodies, scene.pairs, scene.motion, options);
  };
  const Encounters one = with(1), two = with(2);
  EXPECT_EQ(one.queries, two.queries);
  ASSERT_EQ(one.list.size(), two.list.size());
  for (std::size_t k = 0; k < one.list.size(); ++k) {
    EXPECT_EQ(instant(one.list[k].moment), instant(two.list[k].moment));
    EXPECT_EQ(one.list[k].distance, two.list[k].distance);
  }
  for (std::size_t s = 0; s < one.segments.size(); ++s)
    EXPECT_EQ(one.segments[s].min_clearance, two.segments[s].min_clearance);
}

TEST(Encounters, NumbersThatDoNotFitAreRefused) {
  const std::vector<CarrierBody> bodies{{box({1, 1, 1}), 0}, {box({1, 1, 1}), 1}};
  const CarrierMotion motion = turning_slide(11, 0.1, 5.0, {50.0, 0.0, 0.0});
  EXPECT_THROW(encounters(bodies, {{0, 2}}, motion), std::invalid_argument);
  EXPECT_THROW(encounters(bodies, {{0, 0}}, motion), std::invalid_argument);
  EXPECT_THROW(encounters({{bodies[0].body, 2}, bodies[1]}, {{0, 1}}, motion),
               std::invalid_argument);
  CarrierMotion other = motion;
  other.segments = {0, 5, 5};
  EXPECT_THROW(encounters(bodies, {{0, 1}}, other), std::invalid_argument);
  other = motion;
  other.bulge.pop_back();
  EXPECT_THROW(encounters(bodies, {{0, 1}}, other), std::invalid_argument);
  EncounterOptions options;
  options.resolution = 0.0;
  EXPECT_THROW(encounters(bodies, {{0, 1}}, motion, options), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::cutting::encounters_tests

namespace abbe::cutting::parting_plane_tests {
namespace {

using kinematics::Pose;

/// Between convex bodies the plane is as far off as they are, and whatever moves then, what is
/// beyond it is no farther than the gap.
TEST(PartingPlane, IsNeverFartherThanTheGap) {
  constexpr unsigned seed = 2641;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1), length(1, 60);
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  const auto pose = [&] {
    Pose T(kinematics::rotation(3.0 * vector()));
    T.pretranslate(80.0 * vector());
    return T;
  };
  double worst = 1.0;
  int parted = 0;
  for (int n = 0; n < 300; ++n) {
    const Body a = n % 2 == 0
                       ? make_body(box_mesh({length(random), length(random), length(random)}))
                       : make_body(sphere_mesh(length(random), 0.2));
    const Body b = make_body(cutter_meshes(Cutter{5, n % 3 == 0 ? 5.0 : 1.0, 40}, 0.01));
    const std::vector<Ball> hull = hull_balls(b);
    const Pose T = pose();
    const Gap here = gap(a, Pose::Identity(), b, T);
    if (here.distance < 1e-3 || is_inside(a, Pose::Identity(), b, T)) continue;
    const PartingPlane plane = parting_plane(a, hull, T, here.on_b - here.on_a);
    const double bound = plane_distance(plane, hull, T);
    EXPECT_LE(bound, here.distance * (1 + 1e-9) + 1e-9);
    worst = std::min(worst, bound / here.distance);
    ++parted;
    for (int k = 0; k < 5; ++k) {
      const Pose moved = pose();
      const double then = gap(a, Pose::Identity(), b, moved).distance;
      EXPECT_LE(plane_distance(plane, hull, moved), then * (1 + 1e-9) + 1e-9) << "seed " << seed;
    }
  }
  std::cout << parted << " pairs, the plane at least at " << worst << " of the gap\n";
  EXPECT_GT(parted, 150);
  EXPECT_GT(worst, 0.9);
}

TEST(PartingPlane, WithoutAHullThereIsNone) {
  const Body a = make_body(box_mesh({1, 1, 1}));
  EXPECT_TRUE(hull_balls(a, 7).empty());
  Pose T = Pose::Identity();
  T.translation() = Vector3d(5, 0, 0);
  EXPECT_EQ(plane_distance(parting_plane(a, {}, T, Vector3d::UnitX()), {}, T), 0.0);
  const std::vector<Ball> hull = hull_balls(a);
  EXPECT_NEAR(plane_distance(parting_plane(a, hull, T, Vector3d(4, 0.4, 0)), hull, T), 4.0, 0.02);
}

}  // namespace
}  // namespace abbe::cutting::parting_plane_tests
