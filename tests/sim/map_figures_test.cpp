// Figures of one map fit together, on every packaged scene.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>

#include "sim/cut/judged_surface.h"
#include "sim/report/summary.h"
#include "sim/report/verdict.h"
#include "tests/oracles/areal_oracle.h"
#include "tests/sim/packaged_remarks.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// By how much the form leaves the range of the values within reach of the filter, at most, mm.
double beyond_range(const Job& job, const Verdict& verdict) {
  const cutting::Design& design = job.design_w;
  const cutting::Surface& surface = verdict.alignment.surface;
  const double cutoff = job.scene.part.form_cutoff;
  double worst = 0.0;
  test::ArealValues values;
  const auto add = [&](const Vector3d& point, double value) {
    values.point.push_back(point);
    values.value.push_back(value);
    values.area.push_back(1.0);
  };
  for (Index v = 0; v < design.vertices.rows(); ++v)
    if (std::isfinite(surface.residual[v])) add(design.vertices.row(v), surface.residual[v]);
  for (Index t = 0; t < surface.within.size(); ++t)
    if (std::isfinite(surface.within[t]))
      add(cutting::value_at_sample(surface.interior_sample, design.vertices, design.triangles, t),
          surface.within[t]);
  const Index step = 1 + design.vertices.rows() / 100;
  for (Index i = 0; i < design.vertices.rows(); i += step) {
    if (!std::isfinite(verdict.form_map[i])) continue;
    const test::BruteFilter brute =
        test::brute_filter(values, design.vertices.row(i), design.normals.row(i), cutoff, cutoff);
    worst = std::max({worst, brute.low - verdict.form_map[i], verdict.form_map[i] - brute.high});
  }
  return worst;
}

void expect_of_one_row(const cutting::Statistics& s, const std::string& name) {
  if (!s.pv || !s.rms) return;
  const double rounding = 1e-12;
  EXPECT_NEAR(*s.pv, *s.max - *s.min, rounding) << name;
  EXPECT_LE(*s.rms, std::max(std::abs(*s.min), std::abs(*s.max)) + rounding) << name;
  EXPECT_LE(*s.std_dev, 0.5 * *s.pv + rounding) << name;
  EXPECT_GE(*s.mean, *s.min - rounding) << name;
  EXPECT_LE(*s.mean, *s.max + rounding) << name;
  EXPECT_LE(*s.p95_abs, std::max(std::abs(*s.min), std::abs(*s.max)) + rounding) << name;
}

/// That vertices are few is this test's doing.
void expect_only_remarks(const std::string& scene, const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings)
    EXPECT_TRUE(is_remark(scene, warning) ||
                warning.find("too coarse for the machined surface") != std::string::npos ||
                warning.find("neighbouring judged vertices") != std::string::npos)
        << scene << " warns of itself: " << warning;
}

/// The case of a scene with so many vertices; false for one that makes no map.
bool expect_figures_of(const std::string& name, int vertices) {
  const Scene as_is = read_scene(packaged(name));
  if (std::holds_alternative<MeshFile>(as_is.part.shape) && vertices != 500) return false;
  std::vector<Override> few{{"part.sampling", "\"vertices\""}};
  if (!std::holds_alternative<MeshFile>(as_is.part.shape))
    few.push_back({"part.vertices", std::to_string(vertices)});
  const Job job = sampled(prepare(read_scene(packaged(name), few)));
  const Verdict verdict = judge(job, cut_error_free(job), nullptr);
  const std::string what = fmt::format("{}, {} vertices", name, job.design_w.vertices.rows());
  expect_of_one_row(verdict.residual, what);
  if (verdict.form_statistics) expect_of_one_row(*verdict.form_statistics, what + ", form");
  const Summary all = summary(job, verdict);
  if (all.figures.without_triangle_samples)
    expect_of_one_row(*all.figures.without_triangle_samples, what + ", vertices");
  expect_only_remarks(name.substr(0, name.find('.')), all.warnings);
  if (!verdict.residual.pv || !verdict.texture || !verdict.form_statistics) return true;
  const double beyond = beyond_range(job, verdict);
  std::cout << what << ": PV " << 1e3 * *verdict.residual.pv << " um, form "
            << 1e3 * *verdict.form_statistics->pv << ", Sz " << 1e3 * verdict.texture->Sz
            << ", form beyond its values by " << 1e3 * beyond << "\n";
  EXPECT_LE(*verdict.form_statistics->pv, *verdict.residual.pv + 1e-9) << what;
  // A map less its form has at most both their ranges. It comes near: where places at random carry
  // the form, its chance is in the texture.
  EXPECT_LE(verdict.texture->Sz, *verdict.residual.pv + *verdict.form_statistics->pv + 1e-9)
      << what;
  EXPECT_LE(beyond, 1e-9) << what;
  return true;
}

TEST(MapFigures, FormAndTextureLieWithinTheMapOnEveryScene) {
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  int maps = 0;
  for (const std::string& name : packaged_scenes())
    for (const int vertices : is_long ? std::vector{500, 3000, 20000, 100000} : std::vector{500})
      maps += expect_figures_of(name, vertices);
  EXPECT_GT(maps, 15);
}

}  // namespace
}  // namespace abbe::sim
