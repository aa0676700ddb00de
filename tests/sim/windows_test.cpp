// A job that is run in windows, against the same one held whole.
#include <algorithm>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "sim/cut/judged_surface.h"
#include "sim/cut/sweep.h"
#include "sim/scene/cases.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using cutting::VertexStatus;

constexpr std::size_t held_at_once = 12000;  // samples

/// A dome under a leaning ball end mill, five axes, with errors that depend on the way.
BallRaster leaning_dome(const std::string& sampling = "vertices = 3000") {
  return {.part =
              "surface = \"sphere_cap\"\nradius_mm = 60.0\nrim_radius_mm = 12.0\nat_mm = [40, 25, "
              "80]\n" +
              sampling,
          .step_over = 0.4,
          .step = 0.25,
          .more =
              "[errors]\n"
              "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [3.0, "
              "2.0, 1.0] }\n"
              "EYX = { kind = \"fourier\", period_mm = 20.0, b_um = [2.0] }\n"
              "EZY = { kind = \"backlash\", half_um = 2.0 }\n"
              "EAC = { kind = \"fourier\", period_deg = 360.0, b_urad = [30.0] }\n"};
}

MemoryBudget holding(std::size_t samples) {
  return {[samples](std::size_t, std::size_t) { return samples; }, ""};
}

Job held_whole(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  return sampled(prepare(scene_of(raster, changes)));
}

Job in_windows(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  return sampled(prepare(scene_of(raster, changes), {}, holding(held_at_once)));
}

void same_maps(const cutting::Surface& a, const cutting::Surface& b) {
  ASSERT_EQ(a.status, b.status);
  ASSERT_EQ(a.within.size(), b.within.size());
  for (Eigen::Index i = 0; i < a.residual.size(); ++i) {
    ASSERT_TRUE(a.residual[i] == b.residual[i] || std::isnan(a.residual[i])) << i;
    ASSERT_TRUE(a.cut_time_s[i] == b.cut_time_s[i] || std::isnan(a.cut_time_s[i])) << i;
    ASSERT_EQ(a.cut_line[std::size_t(i)], b.cut_line[std::size_t(i)]) << i;
  }
  for (Eigen::Index i = 0; i < a.within.size(); ++i)
    ASSERT_TRUE(a.within[i] == b.within[i] || std::isnan(a.within[i])) << i;
}

void same_cuts(const Cut& a, const Cut& b) {
  same_maps(a.surface, b.surface);
  EXPECT_NEAR(a.tip_error.rms, b.tip_error.rms, 1e-12 * a.tip_error.rms);
  EXPECT_EQ(a.tip_error.max, b.tip_error.max);
  EXPECT_NEAR(a.direction_error.rms, b.direction_error.rms, 1e-12 * a.direction_error.rms);
  EXPECT_EQ(a.direction_error.max, b.direction_error.max);
  EXPECT_NEAR(a.chord_error.rms, b.chord_error.rms, 0.5 * a.chord_error.rms);
  EXPECT_EQ(a.remaining_point_error, b.remaining_point_error);
  EXPECT_EQ(a.remaining_direction_error, b.remaining_direction_error);
  EXPECT_EQ(a.case_name, b.case_name);
}

TEST(Windows, AreOnlyMadeOfAProgramThatIsNotHeld) {
  const Job job = prepare(scene_of(leaning_dome()), {}, holding(10'000'000));
  EXPECT_FALSE(job.windows);
  const Job none = prepare(scene_of(leaning_dome()), {}, holding(0));
  EXPECT_FALSE(none.windows) << "a memory that holds nothing refuses, and is no reason for windows";
}

TEST(Windows, GiveEveryCaseOfAnyChoiceOfPlacesToTheBit) {
  for (const char* sampling :
       {"vertices = 3000", "vertices = 300\nresolution_um = 0.5\npoints = 6000",
        "vertices = 300\nspacing_mm = 1.0\npoints = 20000"}) {
    SCOPED_TRACE(sampling);
    const Job job = held_whole(leaning_dome(sampling)),
              windowed = in_windows(leaning_dome(sampling));
    ASSERT_TRUE(windowed.windows);
    std::cout << windowed.windows->samples << " samples in " << windowed.windows->all.size()
              << " windows\n";
    EXPECT_GT(windowed.windows->all.size(), 3u);
    EXPECT_EQ(windowed.windows->samples, job.samples.states.size());
    ASSERT_EQ(job.design_w.vertices, windowed.design_w.vertices);
    EXPECT_EQ(job.warnings, windowed.warnings);
    same_cuts(cut_error_free(job), cut_error_free(windowed));
    same_cuts(cut(job), cut(windowed));
    EXPECT_EQ(cut(job).warnings, cut(windowed).warnings);
    for (const char* name : {"perfect-position-ideal", "perfect-iterated-ideal"}) {
      SCOPED_TRACE(name);
      const CaseDescription compensator = parse_case(name);
      same_cuts(cut(job, compensator), cut(windowed, compensator));
    }
  }
}

TEST(Windows, FindTheGougesOfTheWhole) {
  BallRaster deep = leaning_dome();
  deep.more =
      "[errors]\nEZX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = "
      "[0.0, -2000.0] }\n";
  const std::vector<Override> narrow{{"search.band_mm", "0.05"}};
  const Job job = held_whole(deep, narrow), windowed = in_windows(deep, narrow);
  const Cut a = cut(job), b = cut(windowed);
  std::cout << std::ranges::count(a.surface.status, VertexStatus::Gouged) << " vertices gouged\n";
  EXPECT_GT(std::ranges::count(a.surface.status, VertexStatus::Gouged), 100);
  EXPECT_EQ(a.surface.status, b.surface.status);
  EXPECT_EQ(a.warnings, b.warnings);
}

TEST(Windows, HaveTheContactsOfTheWhole) {
  const Job job = held_whole(leaning_dome()), windowed = in_windows(leaning_dome());
  const Sweep one = error_free_sweep(job, surface_options(job, {}));
  const Sweep many = error_free_sweep(windowed, surface_options(windowed, {}));
  const cutting::Surface surface = one.surface(job.design_w);
  const cutting::PassGradients a = one.contacts(job.design_w, surface);
  const cutting::PassGradients b = many.contacts(job.design_w, surface);
  for (Eigen::Index v = 0; v < a.travel.size(); ++v) {
    ASSERT_EQ(std::isnan(a.travel[v]), std::isnan(b.travel[v])) << v;
    if (std::isnan(a.travel[v])) continue;
    EXPECT_EQ(a.travel[v], b.travel[v]) << v;
    if (a.gradient.row(v).allFinite()) EXPECT_EQ(a.gradient.row(v), b.gradient.row(v)) << v;
  }
}

TEST(Windows, AreNotTakenForTheWhole) {
  const Job windowed = in_windows(leaning_dome());
  EXPECT_THROW(job_parts(windowed), std::logic_error);
  EXPECT_THROW(uncompensated_commands(windowed), std::logic_error);
}

}  // namespace
}  // namespace abbe::sim
