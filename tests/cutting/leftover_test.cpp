#include "cutting/surface/machined_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double spacing = 0.25, half_width = 12.0;

/// A square of squares, at `origin`, along two edges.
void add_plane(Design& design, const Vector3d& origin, const Vector3d& u, const Vector3d& v,
               int along_u, int along_v) {
  const Index first = design.vertices.rows(), row = along_v + 1;
  const Vector3d normal = u.cross(v).normalized();
  design.vertices.conservativeResize(first + (along_u + 1) * row, 3);
  design.normals.conservativeResize(design.vertices.rows(), 3);
  for (int i = 0; i <= along_u; ++i)
    for (int j = 0; j <= along_v; ++j) {
      design.vertices.row(first + i * row + j) = origin + i * u + j * v;
      design.normals.row(first + i * row + j) = normal;
    }
  Index t = design.triangles.rows();
  design.triangles.conservativeResize(t + 2 * along_u * along_v, 3);
  for (int i = 0; i < along_u; ++i)
    for (int j = 0; j < along_v; ++j) {
      const int a = int(first + i * row + j), b = int(a + row);
      design.triangles.row(t++) << a, b, b + 1;
      design.triangles.row(t++) << a, b + 1, a + 1;
    }
}

Design finished(Design design) {
  design.area = vertex_area(design.vertices, design.triangles);
  return design;
}

Design floor_of(double step) {
  Design design;
  const int n = int(2.0 * half_width / step);
  add_plane(design, {-half_width, -half_width, 0.0}, step * Vector3d::UnitX(),
            step * Vector3d::UnitY(), n, n);
  return finished(design);
}

/// Passes of the ball along x at some y, all over the part and beyond.
CutterMotion passes_at(const std::vector<double>& ys) {
  std::vector<Stop> stops;
  for (std::size_t i = 0; i < ys.size(); ++i) {
    const double x = i % 2 == 0 ? 20.0 : -20.0;
    stops.push_back({{-x, ys[i], 0.0}});
    stops.push_back({{x, ys[i], 0.0}});
  }
  return motion_of(stops);
}

std::vector<std::uint8_t> none_of(const Design& design) {
  return std::vector<std::uint8_t>(std::size_t(design.vertices.rows()), 0);
}

/// The least of a convex function over [0, 1], by thirds.
template <typename Function>
double min_of(const Function& of) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
    (of(a) <= of(b) ? high : low) = of(a) <= of(b) ? b : a;
  }
  return std::min({of(0.0), of(1.0), of(0.5 * (low + high))});
}

/// To the nearest place of a triangle, as a convex function of two weights.
double searched_distance(const std::array<Vector3d, 3>& t, const Vector3d& p) {
  return min_of([&](double u) {
    const Vector3d from = t[0] + u * (t[1] - t[0]), to = t[0] + u * (t[2] - t[0]);
    return min_of([&](double v) { return (from + v * (to - from) - p).norm(); });
  });
}

TEST(WallThickness, ComesWithinADistanceAsASearchOverEveryTriangleSays) {
  constexpr unsigned seed = 20261124;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Design design = floor_of(2.0);
  for (Index v = 0; v < design.vertices.rows(); ++v) design.vertices(v, 2) = normal(random);
  const WallThickness part(design);
  double nearest_call = 1e300;
  for (int i = 0; i < 20; ++i) {
    const Vector3d p(10.0 * normal(random), 10.0 * normal(random), 4.0 * normal(random));
    double least = 1e300;
    for (const auto& t : design.triangles.rowwise()) {
      const double longest = 12.0;  // mm, of an edge
      if ((design.vertices.row(t[0]).transpose() - p).norm() > least + longest) continue;
      least = std::min(least, searched_distance({Vector3d(design.vertices.row(t[0])),
                                                 Vector3d(design.vertices.row(t[1])),
                                                 Vector3d(design.vertices.row(t[2]))},
                                                p));
    }
    EXPECT_TRUE(part.comes_within(p, least + 1e-7)) << p.transpose();
    EXPECT_FALSE(part.comes_within(p, least - 1e-7)) << p.transpose();
    nearest_call = std::min(nearest_call, least);
  }
  std::cout << "nearest place " << nearest_call << " mm\n";
}

/// What is left of a single pass is the bottom of the ball, R - sqrt(R^2 - y^2).
TEST(Leftover, TheRunOutOfASinglePassIsAllButItsBottom) {
  for (const double step : {0.1, 0.25, 1.0}) {
    const Design design = floor_of(step);
    const Surface cut = milled_surface(design, ball_mill, passes_at({0.0}));
    const auto found = lead_out_leftover(design, cut, ball_mill.radius, none_of(design));
    int kept = 0;
    double max_kept = 0.0;
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
      const double y = std::abs(design.vertices(i, 1));
      const double left = 5.0 - std::sqrt(25.0 - y * y);
      if (std::abs(left - 1e-3) > 1e-6) {
        EXPECT_EQ(found[std::size_t(i)] != 0, left > 1e-3) << "y " << y;
      }
      if (found[std::size_t(i)]) continue;
      ++kept;
      max_kept = std::max(max_kept, cut.residual[i]);
    }
    std::cout << "vertices every " << step << " mm: " << kept << " kept, up to " << 1e3 * max_kept
              << " um\n";
    EXPECT_GT(kept, 0);
    EXPECT_LE(max_kept, 1e-3);
  }
}

/// Cusps of 5.6 to 225 um stay where passes lie beside one another, up to the last of them.
TEST(Leftover, CuspsBetweenPassesAreNoRunOut) {
  for (const double step_over : {0.47, 1.0, 3.0}) {
    std::vector<double> ys;
    for (double y = -6.0; y < 6.0; y += step_over) ys.push_back(y);
    const Design design = floor_of(spacing);
    const Surface cut = milled_surface(design, ball_mill, passes_at(ys));
    const auto found = lead_out_leftover(design, cut, ball_mill.radius, none_of(design));
    const double cusp = 5.0 - std::sqrt(25.0 - 0.25 * step_over * step_over);
    double most = 0.0;
    int between = 0, lost = 0;
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      const double y = design.vertices(i, 1);
      if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
      if (!found[std::size_t(i)]) most = std::max(most, cut.residual[i]);
      if (y < ys.front() || y > ys.back()) continue;
      ++between;
      lost += found[std::size_t(i)];
    }
    std::cout << "step over " << step_over << " mm: of " << between << " between the passes "
              << lost << " taken; " << 1e3 * most << " um left, cusps " << 1e3 * cusp << "\n";
    EXPECT_EQ(lost, 0);
    EXPECT_LE(most, cusp + 1e-3);
  }
}

/// At the foot of a wall the ball stops at R from it: floor and wall are left there by closed form.
TEST(Leftover, TheFootOfAWallIsOutOfTheCorner) {
  Design design;
  const int n = int(half_width / spacing);
  add_plane(design, Vector3d::Zero(), spacing * Vector3d::UnitX(), spacing * Vector3d::UnitY(), n,
            n);
  add_plane(design, Vector3d::Zero(), spacing * Vector3d::UnitY(), spacing * Vector3d::UnitZ(), n,
            n);  // looks to +x
  design = finished(design);
  std::vector<Stop> stops;
  for (int i = 0; i <= 60; ++i) {  // passes along y, from the wall on
    const double x = 5.0 + 0.1 * i, y = i % 2 == 0 ? 20.0 : -20.0;
    stops.push_back({{x, -y, 0.0}});
    stops.push_back({{x, y, 0.0}});
  }
  const Surface cut = milled_surface(design, ball_mill, motion_of(stops));
  const WallThickness part(design);
  const auto found = corner_leftover(design, cut, part, ball_mill.radius);
  double kept = 0.0;
  int wrong = 0;
  for (Index i = 0; i < design.vertices.rows(); ++i) {
    if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
    const bool is_wall = design.normals(i, 0) > 0.5;
    const double foot = is_wall ? design.vertices(i, 2) : design.vertices(i, 0);
    if (std::abs(foot - 4.9) > 0.11) wrong += (found[std::size_t(i)] != 0) != (foot < 4.9);
    if (!found[std::size_t(i)] && foot < 10.0) kept = std::max(kept, cut.residual[i]);
  }
  std::cout << "up to " << 1e3 * kept << " um are kept\n";
  EXPECT_EQ(wrong, 0);
  EXPECT_LE(kept, 1.01e-3);
  for (const double radius : {0.0, 1e-9}) {  // a flat end fits everywhere
    const auto sharp = corner_leftover(design, cut, part, radius);
    EXPECT_EQ(std::count(sharp.begin(), sharp.end(), 1), 0);
  }
}

/// A ball fits into a groove of its radius and more, and not into one of less.
TEST(Leftover, AGrooveNarrowerThanTheBallIsOutOfItsReach) {
  for (const double groove : {4.0, 4.85, 5.05, 6.0, 20.0}) {
    Design design;
    constexpr int around = 400, along = 20;
    add_plane(design, Vector3d::Zero(), Vector3d::UnitX(), Vector3d::UnitY(), along, around);
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      const double angle = 3.0 * (design.vertices(i, 1) / around - 0.5);
      design.vertices.row(i) << 0.5 * design.vertices(i, 0), groove * std::sin(angle),
          groove * (1.0 - std::cos(angle));
      design.normals.row(i) << 0.0, -std::sin(angle), std::cos(angle);
    }
    design = finished(design);
    Surface left;
    left.status.assign(std::size_t(design.vertices.rows()), VertexStatus::Cut);
    left.residual = Eigen::VectorXd::Constant(design.vertices.rows(), 0.3);  // an allowance
    const auto found = corner_leftover(design, left, WallThickness(design), 5.0);
    const double share =
        double(std::count(found.begin(), found.end(), 1)) / double(design.vertices.rows());
    std::cout << "groove R " << groove << ": " << 100.0 * share << " % out of reach\n";
    EXPECT_EQ(share > 0.5, groove < 5.0);
    if (groove > 5.0) {
      EXPECT_EQ(share, 0.0);
    }
  }
}

}  // namespace
}  // namespace abbe::cutting
