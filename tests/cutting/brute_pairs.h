#pragma once

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface.h"
#include "tests/cutting/random.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

/// Cutters against brute force in long double: the surface of one move that moves and turns.
namespace abbe::cutting::brute_pairs {

/// Two samples near a ray, both moving and turning by as much as chance has it; now and then a
/// plunge.
struct Pair {
  CutterMotion motion;
  Ray ray;
};

inline Pair any_pair(Random& random, const Cutter& cutter, double band) {
  const double size = cutter.radius;
  CutterMotion motion{Eigen::MatrixX3d(2, 3), Eigen::MatrixX3d(2, 3), Vector2d(0, 1), {1, 1}};
  const Vector3d axis = random.once_in(3) ? Vector3d(Vector3d::UnitZ()) : random.direction();
  const double turn = random.once_in(3) ? 0.0 : random.decades(-9, -1.0);
  const Vector3d along = random.once_in(6)   ? axis
                         : random.once_in(3) ? Vector3d(axis.cross(random.direction()).normalized())
                                             : random.direction();
  const Vector3d step = random.once_in(8) ? Vector3d(Vector3d::Zero())
                                          : Vector3d(size * random.decades(-7, 0.5) * along);
  motion.tip.row(0) = size * random.any();
  motion.tip.row(1) = motion.tip.row(0) + step.transpose();
  motion.axis.row(0) = axis;
  motion.axis.row(1) = turn > 0 ? random.turned_evenly(axis, turn) : axis;
  const double t = random.in(0, 1), height = random.in(-0.1, 1.1) * cutter.flank_length;
  const Vector3d around = axis.cross(random.direction()).normalized();
  const Vector3d place =
      Vector3d(motion.tip.row(0)) + t * step + height * axis + size * random.in(0, 1.3) * around;
  const Vector3d normal = random.once_in(4)   ? Vector3d(random.in(-1, 1) < 0 ? axis : -axis)
                          : random.once_in(4) ? Vector3d(-around)
                                              : random.direction();
  return {motion, {place, normal, band}};
}

inline Design design_of(const Ray& ray) {
  Design design;
  design.vertices = ray.point.transpose();
  design.normals = ray.normal.transpose();
  return design;
}

struct Asked {
  unsigned seed;
  int pairs;
  std::size_t most;  ///< as in BruteOptions
};

/// @param brute  the same cutter for the reference
template <class Brute>
void hold_against_brute_force(const std::string& name, const Cutter& cutter, const Brute& brute,
                              const Asked& asked) {
  constexpr double promise = 1e-6, band = 2.0;  // mm
  Random random(asked.seed);
  int cut = 0, buried = 0, missed = 0, undecided = 0;
  double late = -1e300, early = -1e300;
  for (int n = 0; n < asked.pairs; ++n) {
    const Pair pair = any_pair(random, cutter, band);
    const Surface surface =
        milled_surface(design_of(pair.ray), cutter, pair.motion, {.band = band, .progress = {}});
    const auto pose = [&](int i) {
      return oracles::BrutePose{pair.motion.tip.row(i), pair.motion.axis.row(i), double(i)};
    };
    const oracles::BruteHit hit =
        oracles::brute_milled({pair.ray.point, pair.ray.normal}, brute, {pose(0), pose(1)},
                              {.band = band, .tolerance = 1e-8, .most = asked.most});
    const VertexStatus status = surface.status[0];
    const std::string where =
        name + ", seed " + std::to_string(asked.seed) + ", pair " + std::to_string(n);
    if (hit.bound > promise) {
      ++undecided;
    } else if (hit.begins_removed) {
      ++buried;
      EXPECT_EQ(status, VertexStatus::Gouged) << where;
    } else if (hit.cut) {
      ++cut;
      ASSERT_EQ(status, VertexStatus::Cut) << where << ", brute " << hit.s;
      late = std::max(late, surface.residual[0] - hit.s);
      early = std::max(early, hit.s - hit.bound - surface.residual[0]);
    } else {
      ++missed;
      EXPECT_NE(status, VertexStatus::Cut) << where << ", " << surface.residual[0];
    }
  }
  std::cout << name << ": seed " << asked.seed << ", " << asked.pairs << " pairs, " << cut
            << " cut, " << buried << " begin removed, " << missed << " not cut, " << undecided
            << " undecided by brute force; later by " << 1e6 * late << " nm, earlier by "
            << 1e6 * early << " nm at most\n";
  EXPECT_LT(late, promise) << name;
  EXPECT_LT(early, promise) << name;
  EXPECT_GT(cut, asked.pairs / 10) << name;
  EXPECT_LT(undecided, asked.pairs / 10) << name;
}

}  // namespace abbe::cutting::brute_pairs
