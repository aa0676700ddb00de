// What is said of a map whose places within triangles do not stand in their middles.

#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "sim/report/verdict.h"
#include "tests/cutting/map_over.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

/// A cut that leaves a residual of the place, sampled at a place of each triangle at random.
template <class F>
Cut cut_at_random(const Job& job, const F& residual) {
  const cutting::Design& design = job.design_w;
  Cut cut;
  cut.surface =
      cutting::map_over(design, [&](const Vector3d& p, const Vector3d&) { return residual(p); });
  cutting::Surface& surface = cut.surface;
  surface.interior_sample = cutting::Surface::InteriorSample::Random;
  surface.within.resize(design.triangles.rows());
  for (Eigen::Index t = 0; t < surface.within.size(); ++t)
    surface.within[t] = residual(
        cutting::value_at_sample(surface.interior_sample, design.vertices, design.triangles, t));
  return cut;
}

/// In a corner a quarter of the values carry the form; with 4000 vertices that is more than ten of
/// them.
TEST(Verdict, ASlopeHasNoTexture) {
  const Job job = job_of(
      BallRaster{"surface = \"rectangle\"\nlength_x_mm = 20\nlength_y_mm = 20\nat_mm = [0, 0, 80]\n"
                 "vertices = 4000\nsampling = \"vertices\"\n"});
  const auto slope = [](const Vector3d& p) { return 1e-3 * p.x() - 2e-3 * p.y(); };
  const Verdict verdict = judge(job, cut_at_random(job, slope), nullptr);
  ASSERT_TRUE(verdict.texture);
  std::cout << "texture of a slope: Sq " << 1e6 * verdict.texture->Sq << " nm of "
            << 1e6 * *verdict.residual.pv << " nm PV\n";
  EXPECT_LT(verdict.texture->Sq, 1e-6 * *verdict.residual.pv);
}

TEST(Verdict, ThePlaceFurthestOutOfToleranceMayLieWithinATriangle) {
  const Job job = job_of(
      BallRaster{"surface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = [3, 0, 80]\n"
                 "vertices = 500\nsampling = \"vertices\"\ntolerance_um = 10\n"});
  Cut cut = cut_at_random(job, [](const Vector3d&) { return 0.0; });
  cut.surface.within[50] = 0.013;
  const Verdict verdict = judge(job, std::move(cut), nullptr);
  const Vector3d p_w = cutting::value_at_sample(cutting::Surface::InteriorSample::Random,
                                                job.design_w.vertices, job.design_w.triangles, 50);
  ASSERT_TRUE(verdict.worst);
  EXPECT_EQ(verdict.worst->residual, 0.013);
  EXPECT_NEAR((verdict.worst->position_m - (p_w - Vector3d(3, 0, 80))).norm(), 0.0, 1e-12);
  EXPECT_EQ(verdict.worst->line, 1);
  EXPECT_TRUE(tolerance_verdict(verdict.residual.conformance, verdict.worst)
                  .starts_with("FAIL by 3 um at"));
}

TEST(Verdict, ARingOfAConeHasItsRadiusAtTheMiddle) {
  const Job job = job_of(
      BallRaster{"surface = \"cone\"\nbase_radius_mm = 10\nheight_mm = 4\nhalf_apex_deg = 45\n"
                 "at_mm = [0, 0, 80]\nvertices = 300\nsampling = \"vertices\"\n"
                 "[[part.ring]]\nname = \"middle\"\nalong_mm = 2\nwidth_mm = 0.5\n"});
  const Verdict verdict =
      judge(job, cut_at_random(job, [](const Vector3d&) { return 0.0; }), nullptr);
  ASSERT_EQ(verdict.rings.size(), 1u);
  ASSERT_TRUE(verdict.rings[0].radius);
  std::cout << "ring at half height: radius " << *verdict.rings[0].radius << " mm of 8\n";
  // a quarter of the width at most, by where the places of few triangles happen to lie
  EXPECT_NEAR(*verdict.rings[0].radius, 8.0, 0.1);
}

}  // namespace
}  // namespace abbe::sim
