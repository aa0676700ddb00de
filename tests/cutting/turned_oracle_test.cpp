#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/surface/surface.h"
#include "tests/cutting/random.h"
#include "tests/cutting/turned_parts.h"
#include "tests/oracles/brute_surface.h"

// The reference bounds itself from below as well as from above, so it can be no nearer than its own
// bound; where a ray only grazes the swept body or the band ends, either answer may be right.
namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

oracles::BruteTurning for_oracle(const Nose& nose, const NoseMotion& motion) {
  oracles::BruteTurning turning{nose.radius, {}, motion.spindle_point, motion.spindle_direction};
  for (std::size_t i = 0; i < motion.T_without_spindle.size(); ++i) {
    const Eigen::Isometry3d& T = motion.T_without_spindle[i];
    turning.poses.push_back({T.linear(), T.translation(), motion.spindle[Eigen::Index(i)],
                             motion.time_s[Eigen::Index(i)]});
  }
  return turning;
}

struct Comparison {
  double largest = 0.0;  // mm
  double bound = 0.0;    // mm, the reference's own
  int cut = 0;
  int uncut = 0;
  int disagree = 0;
};

Comparison compare(const Design& design, const Nose& nose, const NoseMotion& motion, double band) {
  SurfaceOptions options;
  options.band = band;
  const Surface surface = turned_surface(design, nose, motion, options);
  const oracles::BruteTurning turning = for_oracle(nose, motion);
  std::vector<oracles::BruteHit> hits(std::size_t(design.vertices.rows()));
  tbb::parallel_for(std::size_t(0), hits.size(), [&](std::size_t i) {
    const auto k = Eigen::Index(i);
    oracles::BruteOptions brute;
    brute.band = band;
    hits[i] =
        oracles::brute_turned({design.vertices.row(k), design.normals.row(k)}, turning, brute);
  });
  Comparison result;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const oracles::BruteHit& hit = hits[i];
    const bool cut = surface.status[i] == VertexStatus::Cut;
    result.bound = std::max(result.bound, hit.bound);
    if (cut != (hit.cut && !hit.begins_removed)) {
      ++result.disagree;
      std::cout << "ray " << i << ": " << (cut ? "cut" : "uncut") << " at "
                << surface.residual[Eigen::Index(i)] << ", reference " << hit.cut << " s " << hit.s
                << " bound " << hit.bound << "\n";
      continue;
    }
    ++(cut ? result.cut : result.uncut);
    if (!cut) continue;
    const double s = surface.residual[Eigen::Index(i)];
    const double off = std::max(s - hit.s, hit.s - hit.bound - s);
    if (off > 1e-9) {
      std::cout << "ray " << i << ": " << s << ", reference " << hit.s << " bound " << hit.bound
                << " times " << surface.cut_time_s[Eigen::Index(i)] << " " << hit.time_s << "\n";
    }
    result.largest = std::max(result.largest, std::abs(s - hit.s));
  }
  return result;
}

/// How wrong a random lathe is.
struct Wrong {
  double height = 0.0;          // mm
  double offset = 0.0;          // mm
  double tilt = 0.0;            // rad, of the rake plane
  double wander = 0.0;          // mm and rad from sample to sample
  double askew = 0.0;           // of the normals, out of the meridian
  double from = 0.6, to = 0.0;  // mm, radius of the nose centre
  double feed = 0.05;           // mm a revolution
  double turns_a_sample = 0.37;
};

NosePath random_path(const Wrong& wrong, OracleRandom& random) {
  NosePath path;
  const Eigen::Matrix3d tilt = random.rotation(wrong.tilt);
  const double height = random.in(-1, 1) * wrong.height;
  const double offset = random.in(-1, 1) * wrong.offset;
  const double turns = (wrong.from - wrong.to) / wrong.feed + 1.0;
  const double angle0 = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += wrong.turns_a_sample * random.in(0.5, 1.5)) {
    const double r = std::max(wrong.to, wrong.from - wrong.feed * turn);
    const Vector3d centre(0.249 - 0.05 * r, height, r + offset);
    path.add(centre + wrong.wander * random.any(), angle0 + two_pi * turn,
             tilt * random.rotation(wrong.wander));
  }
  return path;
}

Design random_rays(int n, const Wrong& wrong, double r_low, double r_high, OracleRandom& random) {
  std::vector<MeridianVertex> vertices;
  for (int i = 0; i < n; ++i) {
    const double lean = random.in(-0.3, 0.6);
    const double r = random.in(r_low, r_high);
    vertices.push_back(
        {random.in(-0.01, 0.01) - 0.05 * r, r, random.in(-10, 10), std::cos(lean), std::sin(lean)});
  }
  Design design = design_of(vertices);
  for (int i = 0; i < n; ++i) {
    design.normals.row(i) += wrong.askew * random.any().transpose();
    design.normals.row(i).normalize();
  }
  return design;
}

void expect_agreement(const char* what, const Wrong& wrong, unsigned seed, int rays) {
  SCOPED_TRACE(testing::Message() << what << ", seed " << seed);
  OracleRandom random(seed);
  const Nose nose{0.249, {}};
  const NoseMotion motion = motion_of(random_path(wrong, random));
  const Design design = random_rays(rays, wrong, std::max(0.0, wrong.to - 0.1), wrong.from, random);
  const Comparison c = compare(design, nose, motion, 0.2);
  std::cout << what << ", seed " << seed << ": " << c.cut << " cut, " << c.uncut
            << " uncut, largest difference " << c.largest * 1e6 << " nm, reference's bound "
            << c.bound * 1e6 << " nm\n";
  EXPECT_EQ(c.disagree, 0);
  EXPECT_GT(c.cut, rays / 2);
  EXPECT_LE(c.largest, c.bound + 1e-9);
  EXPECT_LE(c.bound, 1e-7);
}

TEST(TurnedOracle, PerfectLatheAgrees) { expect_agreement("perfect", {}, 1, 150); }

TEST(TurnedOracle, HeightTiltAndOffsetAgree) {
  for (const unsigned seed : {2u, 3u, 4u}) {
    expect_agreement("constant deviations",
                     {.height = 0.02, .offset = 0.05, .tilt = 0.05, .from = 4.0, .to = 3.6}, seed,
                     100);
  }
}

TEST(TurnedOracle, WanderingNoseAgrees) {
  for (const unsigned seed : {5u, 6u, 7u}) {
    expect_agreement(
        "wandering",
        {.height = 0.01, .offset = 0.01, .tilt = 0.02, .wander = 1e-3, .from = 7.0, .to = 6.5},
        seed, 100);
  }
}

TEST(TurnedOracle, NormalsOutOfTheMeridianAgree) {
  for (const unsigned seed : {8u, 9u, 10u}) {
    expect_agreement(
        "askew normals",
        {.height = 0.01, .tilt = 0.02, .wander = 1e-4, .askew = 0.5, .from = 3.0, .to = 2.5}, seed,
        100);
  }
}

TEST(TurnedOracle, FineSamplesAgree) {
  expect_agreement("fine samples",
                   {.height = 0.01,
                    .tilt = 0.02,
                    .wander = 1e-5,
                    .askew = 0.1,
                    .from = 3.0,
                    .to = 2.7,
                    .turns_a_sample = 0.01},
                   11, 100);
}

TEST(TurnedOracle, RaysAboutTheAxisAgree) {
  for (const unsigned seed : {12u, 13u, 14u}) {
    expect_agreement("about the axis",
                     {.height = 0.002,
                      .offset = 0.003,
                      .tilt = 0.01,
                      .wander = 1e-5,
                      .askew = 0.02,
                      .from = 0.1},
                     seed, 100);
  }
}

TEST(TurnedOracle, LargeDeviationsAgree) {
  for (const unsigned seed : {15u, 16u, 17u}) {
    expect_agreement("large deviations",
                     {.height = 0.5,
                      .offset = 0.3,
                      .tilt = 0.4,
                      .wander = 0.02,
                      .askew = 0.3,
                      .from = 2.0,
                      .to = 1.5},
                     seed, 100);
  }
}

}  // namespace
}  // namespace abbe::cutting
