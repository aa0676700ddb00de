#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/surface/nose_cut.h"
#include "cutting/surface/surface.h"
#include "kinematics/units.h"
#include "tests/cutting/random.h"
#include "tests/cutting/turned_parts.h"
#include "tests/oracles/brute_surface.h"

// The surface of turning inserts against brute force. To the reference an edge is a union of convex
// parts: the polygon of its corners, and of every arc a disc, cut by its chord.
namespace abbe::cutting::insert_tests {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using oracles::BruteTurning;

/// A part of an edge: a disc cut by straight sides.
struct DiscPart {
  Vector2d middle;
  double radius;
  std::vector<BruteTurning::Side> sides;
};

BruteTurning::Side side_through(const Vector2d& a, const Vector2d& b) {
  const Vector2d normal = Vector2d((b - a).y(), -(b - a).x()).normalized();
  return {normal, normal.dot(a)};
}

DiscPart polygon(const std::vector<Vector2d>& corners) {
  DiscPart part{{0, 0}, 1e3, {}};
  for (std::size_t i = 0; i < corners.size(); ++i)
    part.sides.push_back(side_through(corners[i], corners[(i + 1) % corners.size()]));
  return part;
}

struct TestEdge {
  Nose nose;
  std::vector<DiscPart> parts;
};

TestEdge insert_edge(const Insert& insert) {
  const double k = insert.major, m = insert.minor, r = insert.radius;
  const Vector2d ahead(-std::cos(k), std::sin(k)), behind(std::cos(m), std::sin(m));
  const Vector2d a = r * Vector2d(-std::sin(k), -std::cos(k));
  const Vector2d b = r * Vector2d(std::sin(m), -std::cos(m));
  std::vector<Vector2d> corners{a};
  if (insert.wiper > 0.0) {
    corners.emplace_back(0, -r);
    corners.emplace_back(insert.wiper, -r);
  } else {
    corners.push_back(b);
  }
  const Vector2d far_behind = corners.back() + insert.minor_length * behind;
  const Vector2d far_ahead = a + insert.major_length * ahead;
  corners.push_back(far_behind);
  // far_behind + s ahead = far_ahead + t behind
  Eigen::Matrix2d ways;
  ways << ahead, -behind;
  const Vector2d st = ways.inverse() * (far_ahead - far_behind);
  corners.push_back(far_behind + st.x() * ahead);
  corners.push_back(far_ahead);
  return {profile_nose(insert_profile(insert)), {polygon(corners), {{0, 0}, r, {}}}};
}

TestEdge free_edge(const std::vector<OutlinePoint>& points) {
  TestEdge edge{profile_nose(edge_profile_from_points(points)), {}};
  std::vector<Vector2d> corners;
  Vector2d last = points.back().at;
  for (const OutlinePoint& point : points) {
    corners.push_back(point.at);
    if (point.radius > 0.0) {
      const Vector2d chord = point.at - last;
      const double half = 0.5 * chord.norm();
      const Vector2d inward = Vector2d(-chord.y(), chord.x()).normalized();
      const Vector2d middle =
          0.5 * (last + point.at) + std::sqrt(point.radius * point.radius - half * half) * inward;
      edge.parts.push_back({middle, point.radius, {side_through(point.at, last)}});
    }
    last = point.at;
  }
  edge.parts.push_back(polygon(corners));
  return edge;
}

oracles::BruteHit brute(const Ray& ray, const TestEdge& edge, const NoseMotion& motion,
                        double shrunk = 0.0) {
  oracles::BruteHit first;
  for (const DiscPart& part : edge.parts) {
    BruteTurning turning{part.radius - shrunk, {}, motion.spindle_point, motion.spindle_direction};
    turning.sides = part.sides;
    for (BruteTurning::Side& side : turning.sides) side.reach -= shrunk;
    turning.middle = part.middle;
    if (part.radius == 1e3) turning.radius = edge.nose.profile->outer_radius + 1.0;
    for (std::size_t i = 0; i < motion.T_without_spindle.size(); ++i) {
      const Eigen::Isometry3d& T = motion.T_without_spindle[i];
      turning.poses.push_back({T.linear(), T.translation(), motion.spindle[Eigen::Index(i)],
                               motion.time_s[Eigen::Index(i)]});
    }
    const oracles::BruteHit hit = oracles::brute_turned(
        {ray.point, ray.normal}, turning, {.band = ray.band, .tolerance = 2e-7, .most = 400000});
    if (hit.cut && (!first.cut || hit.s < first.s)) first = hit;
  }
  return first;
}

Insert any_insert(Random& random) {
  Insert insert;
  insert.radius = random.decades(-1.2, 0.3);
  insert.major = random.in(20, 110) * units::deg;
  insert.minor = random.in(0, std::min(60.0, 165.0 - insert.major / units::deg)) * units::deg;
  if (random.once_in(3)) insert.minor = 5 * units::deg;
  if (random.once_in(5)) insert.major = 90 * units::deg;
  insert.major_length = insert.radius * random.in(3, 12);
  insert.minor_length = insert.radius * random.in(3, 12);
  return insert;
}

TestEdge any_insert_edge(Random& random, double wiper) {
  for (;;) {
    Insert insert = any_insert(random);
    if (wiper > 0.0) insert.wiper = insert.radius * (std::tan(0.5 * insert.minor) + wiper);
    try {
      return insert_edge(insert);
    } catch (const std::invalid_argument&) {
    }  // too short; another, then
  }
}

/// Points on an ellipse, some of them reached by arcs.
std::vector<OutlinePoint> any_points(Random& random) {
  const int n = 3 + random.below(6);
  const double a = random.in(0.2, 2), b = random.in(0.2, 2), turn = random.in(0, 6);
  const Vector2d off(random.in(-0.1, 0.1) * a, random.in(-0.1, 0.1) * b);
  std::vector<OutlinePoint> points;
  for (int i = 0; i < n; ++i) {
    const double angle = turn + two_pi * (i + random.in(-0.2, 0.2)) / n;
    points.push_back({off + Vector2d(a * std::cos(angle), b * std::sin(angle))});
  }
  return points;
}

TestEdge any_free_edge(Random& random) {
  for (;;) {
    std::vector<OutlinePoint> points = any_points(random);
    const std::vector<OutlinePoint> straight = points;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (random.once_in(2))
        points[i].radius =
            (points[i].at - points[(i + points.size() - 1) % points.size()].at).norm() *
            random.in(0.6, 4);
    for (const auto& one : {points, straight}) {
      try {
        return free_edge(one);
      } catch (const std::invalid_argument&) {
      }  // another, then
    }
  }
}

struct TestCut {
  NosePath path;
  Ray ray;
};

/// Some revolutions and a ray near the edge of one of them, leaning as its normal does or any way.
TestCut any_cut(const TestEdge& edge, double wrong, double turns, Random& random) {
  TestCut cut;
  const double reach = edge.nose.profile->outer_radius;
  const double feed = edge.nose.radius * random.decades(-1.3, 0);
  const double way = random.in(0, two_pi);  // of the feed in (x, r)
  const double from = random.in(0, 4) < 1 ? random.in(0.0, 3 * reach) : random.in(3, 20) * reach;
  const Eigen::Matrix3d tilt = random.rotation(0.1 * wrong);
  const double height = random.some(0.05 * wrong), wander = random.some(1e-3 * wrong);
  const double a_sample = random.in(0, 2) < 1 ? 1.0 : random.decades(-1, 0.5);
  const double angle0 = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += a_sample)
    cut.path.add(Vector3d(feed * turn * std::cos(way), height, from + feed * turn * std::sin(way)) +
                     wander * random.any(),
                 angle0 + two_pi * turn, tilt * random.rotation(wander));
  cut.path.add(cut.path.T_lt.back().translation(), cut.path.spindle.back() + 3.0, tilt);
  const std::size_t near = std::size_t(random.below(int(cut.path.T_lt.size())));
  const EdgePoint at = edge_point(*edge.nose.profile, random.in(0, two_pi));
  const Vector3d centre = cut.path.T_lt[near].translation();
  const double off = random.once_in(3) ? 0.0 : random.in(-0.3, 0.3) * edge.nose.radius;
  const double lean = random.once_in(2) ? 0.0 : random.in(-0.8, 0.8);
  const Vector2d inward = Eigen::Rotation2Dd(lean) * Vector2d(-at.outward);
  MeridianVertex vertex{centre.x() + at.at.x() + off * inward.x(),
                        centre.z() + at.at.y() + off * inward.y(),
                        cut.path.spindle[near] + random.in(-3, 3), inward.x(), inward.y()};
  if (random.once_in(12)) vertex.r = 0.0;
  if (vertex.r < 0.0) vertex.r = -vertex.r, vertex.nr = -vertex.nr;
  const Design design = design_of({vertex});
  const Vector3d askew = random.some(0.3 * wrong) * random.any();
  cut.ray = {design.vertices.row(0), (design.normals.row(0).transpose() + askew).normalized(),
             random.decades(-1, 0)};
  return cut;
}

/// Whether a place is that of the reference to 1 nm, for an edge moved by as little as 0.01 nm.
bool agrees(std::optional<NoseCut> found, const TestCut& cut, const TestEdge& edge,
            const NoseMotion& motion, const oracles::BruteHit& hit) {
  constexpr double nm = 1e-6, moved = 1e-8;
  const double s = found ? found->s : infinity;
  const auto within = [&](const oracles::BruteHit& low, const oracles::BruteHit& high) {
    return s >= (low.cut ? low.s - low.bound - nm : cut.ray.band - nm) &&
           (high.cut && high.s < cut.ray.band - nm ? s <= high.s + nm : true);
  };
  if (within(hit, hit)) return true;
  return within(brute(cut.ray, edge, motion, -moved), brute(cut.ray, edge, motion, moved));
}

template <class AnyEdge>
void expect_as_brute(const char* what, std::uint64_t seed, int pairs, const AnyEdge& any_edge) {
  std::atomic<int> cuts = 0, differ = 0;
  std::vector<double> off(std::size_t(pairs), 0.0);
  tbb::parallel_for(0, pairs, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const TestEdge edge = any_edge(random);
    const TestCut cut = any_cut(edge, i % 3 == 0 ? 0.0 : i % 3 == 1 ? 0.1 : 1.0, 4.0, random);
    const NoseMotion motion = motion_of(cut.path);
    const std::optional<NoseCut> found = NoseCutSearch(edge.nose, motion).first(cut.ray);
    const oracles::BruteHit hit = brute(cut.ray, edge, motion);
    cuts += hit.cut;
    if (!agrees(found, cut, edge, motion, hit)) {
      if (++differ < 10)
        ADD_FAILURE() << what << ", seed " << seed + std::uint64_t(i) << ": "
                      << (found ? found->s : infinity) << ", reference " << hit.cut << " at "
                      << hit.s << " bound " << hit.bound << " of band " << cut.ray.band;
    } else if (found && hit.cut) {
      off[std::size_t(i)] = std::abs(found->s - hit.s);
    }
  });
  std::sort(off.begin(), off.end());
  std::cout << "  " << what << ", seeds " << seed << " and on: " << pairs << " pairs, " << cuts
            << " cut, " << differ << " differ; largest " << off.back() * 1e6 << " nm, of 99% "
            << off[std::size_t(0.99 * pairs)] * 1e6 << " nm\n";
  EXPECT_EQ(differ, 0);
  EXPECT_GT(cuts, pairs / 3);
}

int pairs() { return 100 * longer(100); }

TEST(InsertSurface, OfANoseWithEdgesIsThatOfBruteForce) {
  expect_as_brute("insert", 801000, pairs(),
                  [](Random& random) { return any_insert_edge(random, 0.0); });
}

TEST(InsertSurface, OfAWiperIsThatOfBruteForce) {
  expect_as_brute("wiper", 802000, pairs(),
                  [](Random& random) { return any_insert_edge(random, random.decades(-2, 0.3)); });
}

TEST(InsertSurface, OfAFreeEdgeIsThatOfBruteForce) {
  expect_as_brute("free edge", 803000, pairs(), any_free_edge);
}

TEST(InsertSurface, OfACircleOfArcsIsThatOfTheNose) {
  const std::uint64_t seed = 804000;
  double worst = 0.0;
  int cuts = 0;
  for (int i = 0; i < 400 * longer(10); ++i) {
    Random random(seed + std::uint64_t(i));
    const double r = random.decades(-1.3, 0.7), turn = random.in(0, two_pi);
    std::vector<OutlinePoint> points;
    for (int k = 0; k < 4; ++k) {
      const double angle = turn + 0.25 * two_pi * (k + random.in(0, 0.5));
      points.push_back({r * Vector2d(std::cos(angle), std::sin(angle)), r});
    }
    const TestEdge edge{profile_nose(edge_profile_from_points(points)), {}};
    EXPECT_NEAR(edge.nose.radius, r, 1e-12);
    const TestCut cut = any_cut(edge, i % 2 == 0 ? 0.0 : 0.5, 4.0, random);
    const NoseMotion motion = motion_of(cut.path);
    const auto found = NoseCutSearch(edge.nose, motion).first(cut.ray);
    const auto round = NoseCutSearch({r, {}}, motion).first(cut.ray);
    ASSERT_EQ(found.has_value(), round.has_value()) << "seed " << seed + std::uint64_t(i);
    if (!found) continue;
    ++cuts;
    worst = std::max(worst, std::abs(found->s - round->s));
    EXPECT_NEAR(found->s, round->s, 1e-9) << "seed " << seed + std::uint64_t(i);
  }
  std::cout << "  seeds " << seed << " and on: " << cuts << " cut, " << worst * 1e6
            << " nm from the round nose at most\n";
}

TEST(InsertSurface, TheTreeLosesNothing) {
  constexpr double no_turn_is_farther = 1e9;  // rad
  constexpr double settled = 1e-8;  // mm: 1e-10 rad of the instant on an askew ray at 50 mm
  const std::uint64_t seed = 805000;
  const int cases = 600 * longer(15);
  std::atomic<int> cut = 0, late = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const TestEdge edge =
        i % 2 == 0 ? any_free_edge(random) : any_insert_edge(random, random.in(-1, 1));
    const TestCut one = any_cut(edge, i % 3 == 0 ? 0.0 : 1.0, random.in(1, 60), random);
    const NoseCutSearch swept(edge.nose, motion_of(one.path));
    const auto found = swept.first(one.ray);
    const auto tried =
        swept.first_in_window(one.ray, found.value_or(NoseCut{}), no_turn_is_farther);
    cut += found.has_value();
    const double s = found ? found->s : one.ray.band;
    if (!tried || tried->s >= s - settled) return;
    if (++late < 10)
      ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ": first cut at " << s
                    << ", of every revolution " << tried->s;
  });
  std::cout << "  seeds " << seed << " and on: " << cases << " rays, " << cut << " cut, " << late
            << " late\n";
  EXPECT_EQ(late, 0);
  EXPECT_GT(cut, cases / 2);
}

}  // namespace
}  // namespace abbe::cutting::insert_tests
