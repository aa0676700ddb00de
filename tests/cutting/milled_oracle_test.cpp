#include <cmath>
#include <iostream>
#include <numbers>
#include <string>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/random.h"
#include "tests/oracles/brute_surface.h"

// The reference is proved to lie within its own bound of the truth, so an answer outside [s -
// bound, s] is wrong. The proof is slow where many instants are all but equally deep (a flat face
// on its own plane, a tool that goes there and back); there the bound stays wide. A ray whose
// status hangs on less than 1e-6 mm (an end of the band), or on a proof not finished, may go either
// way: counted apart.
namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

constexpr double agreement = 1e-6;  // mm, 1 nm

struct Motion {
  CutterMotion moves;

  void add(const std::vector<oracles::BrutePose>& poses) {
    const auto n = Eigen::Index(poses.size());
    moves.tip.resize(n, 3);
    moves.axis.resize(n, 3);
    moves.time_s.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const oracles::BrutePose& pose = poses[std::size_t(i)];
      moves.tip.row(i) = pose.tip.transpose();
      moves.axis.row(i) = pose.axis.transpose();
      moves.time_s[i] = pose.time_s;
      moves.line.push_back(10 + int(i));
    }
  }
};

struct Case {
  std::string name;
  Cutter cutter;
  std::vector<oracles::BrutePose> poses;
  std::vector<oracles::Ray> rays;
  double band = 2.0;
  std::size_t most = 50000;  // stretches the reference may look at
};

void expect_agreement(const Case& c) {
  Motion motion;
  motion.add(c.poses);
  Design design;
  design.vertices.resize(Eigen::Index(c.rays.size()), 3);
  design.normals.resize(Eigen::Index(c.rays.size()), 3);
  design.judged.assign(c.rays.size(), 1);
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    design.vertices.row(Eigen::Index(i)) = c.rays[i].origin.transpose();
    design.normals.row(Eigen::Index(i)) = c.rays[i].direction.transpose();
  }
  SurfaceOptions options;
  options.band = c.band;
  const Surface surface = milled_surface(design, c.cutter, motion.moves, options);

  std::vector<oracles::BruteHit> hits(c.rays.size());
  tbb::parallel_for(std::size_t(0), hits.size(), [&](std::size_t i) {
    oracles::BruteOptions brute;
    brute.band = c.band;
    brute.tolerance = 4e-7;
    brute.most = c.most;
    hits[i] = oracles::brute_milled(
        c.rays[i], {c.cutter.radius, c.cutter.corner_radius, c.cutter.flank_length}, c.poses,
        brute);
  });

  double largest = 0.0, bound = 0.0, outside = 0.0;
  int cut = 0, uncut = 0, undecided = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const oracles::BruteHit& hit = hits[i];
    const double s = surface.residual[Eigen::Index(i)];
    const bool is_cut = surface.status[i] == VertexStatus::Cut;
    if (is_cut != (hit.cut && !hit.begins_removed)) {
      const bool at_an_end = (hit.cut && c.band - std::abs(hit.s) < 1e-6 + hit.bound) ||
                             (is_cut && c.band - std::abs(s) < 1e-6) ||
                             (!hit.cut && hit.bound > 0.0);
      ++undecided;
      EXPECT_TRUE(at_an_end) << "ray " << i << ": status " << int(surface.status[i]) << " at " << s
                             << ", reference " << hit.cut << " at " << hit.s << " bound "
                             << hit.bound;
      continue;
    }
    ++(is_cut ? cut : uncut);
    if (!is_cut) continue;
    bound = std::max(bound, hit.bound);
    largest = std::max(largest, std::abs(s - hit.s));
    const double off = std::max({0.0, s - hit.s, hit.s - hit.bound - s});
    outside = std::max(outside, off);
    // The place that the reference found is near the truth long before it can prove so: where its
    // bound is wide, two independent searches must still have found the same.
    EXPECT_LE(std::max(off, std::abs(s - hit.s)), agreement)
        << "ray " << i << ": " << s << " at " << surface.cut_time_s[Eigen::Index(i)]
        << " s, reference " << hit.s << " at " << hit.time_s << " s, bound " << hit.bound << ", q "
        << c.rays[i].origin.transpose() << ", n " << c.rays[i].direction.transpose();
  }
  std::cout << c.name << ": " << cut << " cut, " << uncut << " uncut, " << undecided
            << " undecided; largest difference " << largest * 1e6 << " nm, outside the reference's "
            << "interval by " << outside * 1e6 << " nm, its bound " << bound * 1e6 << " nm\n";
  EXPECT_GT(cut, 0);
  EXPECT_LE(undecided, int(hits.size()) / 20);
}

const std::vector<std::pair<std::string, Cutter>> named_cutters{
    {"ball", ball_mill}, {"flat", {5.0, 0.0, 20.0}}, {"bull-nose", {5.0, 1.0, 20.0}}};

/// Passes over about z = 0 with an axis that wanders by `spread`.
std::vector<oracles::BrutePose> random_passes(int moves, double length, double spread,
                                              OracleRandom& r) {
  std::vector<oracles::BrutePose> poses;
  Vector3d tip(-6, r.in(-3, 3), r.in(-0.3, 0.3));
  for (int i = 0; i <= moves; ++i) {
    poses.push_back({tip, r.near(Vector3d::UnitZ(), spread), double(i)});
    tip += length * Vector3d(r.in(-0.5, 1), r.in(-1, 1), 0);
    tip.z() = r.in(-0.3, 0.3);
    tip = tip.cwiseMax(Vector3d(-8, -8, -1)).cwiseMin(Vector3d(8, 8, 1));
  }
  return poses;
}

std::vector<oracles::Ray> random_rays(int n, double spread, OracleRandom& r) {
  std::vector<oracles::Ray> rays;
  for (int i = 0; i < n; ++i) {
    rays.push_back(
        {{r.in(-7, 7), r.in(-7, 7), r.in(-0.5, 0.5)}, r.near(Vector3d::UnitZ(), spread)});
  }
  return rays;
}

TEST(MilledOracle, FixedAxisAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 101;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses = random_passes(30, 2.0, 0.0, r);
    expect_agreement({name + ", fixed axis", cutter, poses, random_rays(60, 0.5, r)});
  }
}

TEST(MilledOracle, RandomFiveAxisMotionAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    for (const unsigned seed : {201u, 202u}) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      OracleRandom r(seed);
      std::vector<oracles::BrutePose> poses = random_passes(30, 1.5, 0.4, r);
      expect_agreement({name + ", five axes", cutter, poses, random_rays(40, 0.7, r)});
    }
  }
}

TEST(MilledOracle, LargeRotationsAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 301;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses = random_passes(5, 3.0, 3.0, r);
    expect_agreement({name + ", large rotations", cutter, poses, random_rays(60, 3.0, r)});
  }
}

TEST(MilledOracle, TurningOnTheSpotAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(311);
    const Vector3d tip(0.3, -0.2, 0.1);
    const std::vector<oracles::BrutePose> poses{{tip, Vector3d(0, 0.1, 1).normalized(), 0},
                                                {tip, Vector3d(1, 0, 1).normalized(), 1},
                                                {tip, Vector3d(0, -1, 0.2).normalized(), 2}};
    expect_agreement({name + ", turning on the spot", cutter, poses, random_rays(60, 0.7, r)});
  }
}

// The tool misses the ray at both ends of the move and cuts it in the middle.
TEST(MilledOracle, LongMovesThatMissAtBothEndsAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(321);
    std::vector<oracles::BrutePose> poses;
    for (int i = 0; i < 6; ++i) {
      const double side = i % 2 == 0 ? -60.0 : 60.0;
      poses.push_back(
          {{side, r.in(-5, 5), r.in(-0.5, 0.5)}, r.near(Vector3d::UnitZ(), 0.2), 1.0 * i});
    }
    expect_agreement({name + ", long moves", cutter, poses, random_rays(40, 0.3, r)});
  }
}

TEST(MilledOracle, FlankOfATiltedCutterAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(331);
    std::vector<oracles::BrutePose> poses;  // along x, the flank faces -y where the wall stands
    for (int i = 0; i <= 8; ++i) {
      poses.push_back(
          {{2.0 * i - 8, 5.0 + r.in(-0.1, 0.1), -8}, r.near(Vector3d::UnitZ(), 0.1), 1.0 * i});
    }
    std::vector<oracles::Ray> rays;
    for (int i = 0; i < 60; ++i) {
      rays.push_back({{r.in(-7, 7), 0, r.in(-7, 7)}, r.near(Vector3d::UnitY(), 0.3)});
    }
    expect_agreement({name + ", flank", cutter, poses, rays});
  }
}

TEST(MilledOracle, AwkwardMovesAgree) {
  const Vector3d z = Vector3d::UnitZ();
  const auto leaning = [](double angle) { return Vector3d(std::sin(angle), 0, std::cos(angle)); };
  const std::vector<std::pair<std::string, std::vector<oracles::BrutePose>>> motions{
      {"zero-length move", {{{0, 0, 0}, z, 0}, {{0, 0, 0}, z, 1}}},
      {"jump at one instant", {{{-3, 0, 0}, z, 0}, {{3, 0, 0.1}, leaning(0.1), 0}}},
      {"move of 1e-12", {{{0, 0, 0}, z, 0}, {{1e-12, 0, 0}, z, 1}}},
      {"turn of 1e-12", {{{-1, 0, 0}, z, 0}, {{1, 0, 0}, leaning(1e-12), 1}}},
      {"plunge along the axis", {{{0, 0, 3}, z, 0}, {{0, 0, -0.5}, z, 1}}},
      {"axis across the normal",
       {{{-6, 0, 3}, leaning(pi / 2), 0}, {{4, 1, 3}, leaning(pi / 2), 1}}},
      {"axis from up to level", {{{-2, 0, 0}, z, 0}, {{2, 0, 2}, leaning(pi / 2), 1}}},
      {"turn past level", {{{0, 0, 1}, leaning(-1.5), 0}, {{0, 0, 1}, leaning(1.5), 1}}},
      {"nearly opposite axes", {{{0, 0, 0}, z, 0}, {{1, 0, 0}, leaning(3.1), 1}}},
      {"there and back", {{{-4, 0, 0}, z, 0}, {{4, 0, 0}, z, 1}, {{-4, 0, 0}, z, 2}}},
  };
  std::vector<oracles::Ray> rays;
  for (const double x : {0.0, 1e-12, -1e-12, 1.0, 4.0, -4.0, 5.0, 4.999999, -5.3}) {
    for (const double y : {0.0, 0.7, -3.0}) {
      rays.push_back({{x, y, 0}, z});
      rays.push_back({{x, y, 0.01}, Vector3d(0.6, 0, 0.8)});
    }
  }
  for (const double y : {-6.0, -5.0, -4.5}) {
    rays.push_back({{0.1, y, 0.7}, Vector3d::UnitY()});
    rays.push_back({{y, 0.1, 0.7}, Vector3d::UnitX()});
  }
  for (const auto& [name, cutter] : named_cutters) {
    for (const auto& [what, poses] : motions) {
      SCOPED_TRACE(name + ", " + what);
      expect_agreement({name + ", " + what, cutter, poses, rays, 2.0, 10000});
    }
  }
}

TEST(MilledOracle, ManySmallMovesAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 401;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses;  // a raster with a lead of 10 degrees on a wavy face
    for (double y = -3; y <= 3; y += 0.5) {
      for (double x = -7; x <= 7; x += 0.5) {
        const double z = 0.2 * std::sin(x / 2) * std::cos(y / 2);
        poses.push_back(
            {{x, y, z}, r.near(Vector3d(0.17, 0, 1).normalized(), 0.02), double(poses.size())});
      }
    }
    expect_agreement({name + ", raster", cutter, poses, random_rays(40, 0.2, r), 1.0});
  }
}

}  // namespace
}  // namespace abbe::cutting
