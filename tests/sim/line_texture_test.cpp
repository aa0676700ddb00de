#include "sim/report/line_texture.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double not_cut = std::numeric_limits<double>::quiet_NaN();

/// A grid of (n + 1) x (n + 1) vertices over a square about the origin, each cell two triangles, at
/// a height, with a map.
struct SquareMap {
  cutting::Design design;
  Eigen::VectorXd residual, within;
  cutting::Surface::InteriorSample interior_sample = cutting::Surface::InteriorSample::None;

  ProfiledMap map() const { return {design, residual, interior_sample, within}; }
};

using OverPlane = std::function<double(double x, double y)>;

SquareMap square_map(
    double side, int n, const OverPlane& residual,
    const OverPlane& height = [](double, double) { return 0.0; }) {
  SquareMap made;
  made.design.vertices.resize((n + 1) * (n + 1), 3);
  made.residual.resize((n + 1) * (n + 1));
  made.design.triangles.resize(2 * n * n, 3);
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = side * (double(i) / n - 0.5), y = side * (double(j) / n - 0.5);
      made.design.vertices.row(i * (n + 1) + j) = Vector3d(x, y, height(x, y));
      made.residual[i * (n + 1) + j] = residual(x, y);
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      made.design.triangles.row(2 * (i * n + j)) = Eigen::RowVector3i(a, b, b + 1);
      made.design.triangles.row(2 * (i * n + j) + 1) = Eigen::RowVector3i(a, b + 1, a + 1);
    }
  return made;
}

TEST(LineTrace, OfALinearMapIsThatMap) {
  const auto linear = [](double x, double y) { return 0.5 * x - 2.0 * y + 0.25; };
  for (const int n : {6, 7, 40}) {  // with and without vertices on the line
    const SquareMap made = square_map(12.0, n, linear);
    for (const ProfileLine line : {ProfileLine::X, ProfileLine::Y, ProfileLine::Radius}) {
      const auto trace = line_trace(made.map(), line);
      ASSERT_TRUE(trace);
      EXPECT_EQ(trace->segments, 1);
      EXPECT_EQ(trace->omitted_length, 0.0);
      EXPECT_NEAR(trace->s[trace->s.size() - 1], line == ProfileLine::Radius ? 6.0 : 12.0, 1e-12);
      EXPECT_NEAR(trace->along[0], line == ProfileLine::Radius ? 0.0 : -6.0, 1e-12);
      for (Index i = 0; i < trace->s.size(); ++i) {
        const Vector3d p = trace->points.row(i);
        EXPECT_NEAR(p[line == ProfileLine::Y ? 0 : 1], 0.0, 1e-12);
        EXPECT_NEAR(trace->residual[i], linear(p.x(), p.y()), 1e-12);
        EXPECT_NEAR(trace->s[i] - trace->s[0], trace->along[i] - trace->along[0], 1e-12);
      }
    }
  }
}

TEST(LineTrace, GoesAlongTheSurface) {
  const double slope = std::tan(0.6);
  const SquareMap made = square_map(
      10.0, 20, [](double x, double) { return x; }, [&](double x, double) { return slope * x; });
  const auto trace = line_trace(made.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_NEAR(trace->s[trace->s.size() - 1], 10.0 / std::cos(0.6), 1e-12);
}

TEST(LineTrace, TakesTheLongestStretchThatIsCut) {
  const SquareMap made = square_map(
      10.0, 100, [](double x, double) { return std::abs(x + 2.0) < 0.45 ? not_cut : x; });
  const auto trace = line_trace(made.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->segments, 2);
  EXPECT_NEAR(trace->along[0], -1.5, 1e-12);
  EXPECT_NEAR(trace->along[trace->s.size() - 1], 5.0, 1e-12);
  EXPECT_NEAR(trace->omitted_length, 2.5, 1e-12);
  const SquareMap nothing = square_map(10.0, 10, [](double, double) { return not_cut; });
  EXPECT_FALSE(line_trace(nothing.map(), ProfileLine::X));
}

TEST(LineTrace, OfARingBeginsWhereItIsLowest) {
  // a tube about the y axis, closed around
  constexpr int around = 24;
  SquareMap tube;
  tube.design.vertices.resize(2 * around, 3);
  tube.design.triangles.resize(2 * around, 3);
  for (int i = 0; i < around; ++i) {
    const double angle = 2.0 * pi * i / around;
    for (int j = 0; j < 2; ++j)
      tube.design.vertices.row(2 * i + j) =
          Vector3d(3.0 * std::cos(angle), j - 0.5, 3.0 * std::sin(angle));
    const int a = 2 * i, b = 2 * ((i + 1) % around);
    tube.design.triangles.row(2 * i) = Eigen::RowVector3i(a, b, b + 1);
    tube.design.triangles.row(2 * i + 1) = Eigen::RowVector3i(a, b + 1, a + 1);
  }
  tube.residual = tube.design.vertices.col(2);
  const auto trace = line_trace(tube.map(), ProfileLine::X);
  ASSERT_TRUE(trace);
  EXPECT_NEAR(trace->along[0], -3.0, 1e-12);
  EXPECT_NEAR(trace->s[trace->s.size() - 1], around * 6.0 * std::sin(pi / around), 1e-9);
}

/// A wave of 0.5 mm and 1 um across 20 mm, so many cells wide; `seen` within all triangles.
LineTexture wave_texture(int cells, double side, const std::function<double(double)>& seen,
                         const LineTextureOptions& options = {}) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  SquareMap made = square_map(side, cells, [&](double x, double) { return wave(x); });
  if (seen) {
    made.interior_sample = cutting::Surface::InteriorSample::Middle;
    made.within.resize(made.design.triangles.rows());
    for (Index t = 0; t < made.within.size(); ++t) {
      const Vector3d p = cutting::value_at_sample(made.interior_sample, made.design.vertices,
                                                  made.design.triangles, t);
      made.within[t] = seen(p.x());
    }
  }
  return line_texture(*line_trace(made.map(), ProfileLine::X), 2.5, options);
}

TEST(LineTextureOf, AResolvedWaveAreItsClosedFormsAndNoWarnings) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  const LineTexture t = wave_texture(800, 20.0, wave);
  EXPECT_TRUE(t.warnings.empty()) << t.warnings.front();
  const double A = 1e-3 * (1.0 - std::exp2(-25.0));
  EXPECT_NEAR(t.texture.R.q, A / std::sqrt(2.0), 0.01 * A);
  EXPECT_NEAR(t.texture.R.a, 2.0 * A / pi, 0.01 * A);
  EXPECT_NEAR(t.texture.R.z, 2.0 * A, 0.01 * A);
  EXPECT_NEAR(*t.texture.R.sm, 0.5, 1e-3);
  EXPECT_LT(t.texture.W.q, 0.1 * A);  // of the ends, where the mean line is fitted to one side
  const nlohmann::ordered_json json = to_json(t);
  EXPECT_EQ(json["setting_class"], "Sc4");
  EXPECT_NEAR(json["R"]["Rq_um"].get<double>(), 1e3 * t.texture.R.q, 1e-12);
  EXPECT_EQ(json["evaluation"]["R"]["sections"], 5);
  EXPECT_NEAR(json["evaluation"]["P"]["length_mm"].get<double>(), 20.0, 1e-9);
}

bool warns(const LineTexture& t, const std::string& of) {
  for (const std::string& warning : t.warnings)
    if (warning.find(of) != std::string::npos) return true;
  return false;
}

TEST(LineTextureOf, AMapThatDoesNotResolveItAreWarnedAbout) {
  const auto wave = [](double x) { return 1e-3 * std::sin(2.0 * pi * x / 0.5); };
  EXPECT_TRUE(warns(wave_texture(45, 20.0, wave), "does not resolve the profile"));
  EXPECT_FALSE(resolution_warning(wave_texture(45, 20.0, wave)).empty());
  EXPECT_TRUE(warns(wave_texture(400, 20.0, {}), "it is unknown whether"));
}

TEST(LineTextureOf, AShortLineAreWarnedAbout) {
  EXPECT_TRUE(warns(wave_texture(60, 2.0, {}), "less than one section length of 2.5 mm"));
  EXPECT_TRUE(warns(wave_texture(60, 6.0, {}), "R covers 2 sections of 2.5 mm instead of 5"));
  EXPECT_TRUE(warns(wave_texture(60, 13.0, {}), "less than half of Nic"));
  EXPECT_TRUE(warns(wave_texture(60, 20.0, {}, {.Nic = 0.8, .Nis = 1e-6, .sections = 5}),
                    "Nis is 1 um instead of 0.001 um"));
}

TEST(LineTextureOf, ATableHasARowAPlace) {
  const LineTexture t = wave_texture(60, 20.0, {}, {.Nic = 2.5, .Nis = 0.5, .sections = 5});
  const std::string table = to_csv(t);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + t.texture.primary.z.size());
  EXPECT_TRUE(
      table.starts_with("s_mm,x_mm,y_mm,z_mm,residual_um,primary_um,waviness_um,roughness"));
}

}  // namespace
}  // namespace abbe::sim
