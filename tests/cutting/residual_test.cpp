#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "cutting/residual.h"
#include "tests/kinematics/nan.h"

namespace abbe::cutting {
namespace {

/// A design that is nothing but weights, and a map over it.
Design weights(const Eigen::VectorXd& area) {
  Design d;
  d.vertices = Points::Zero(area.size(), 3);
  d.normals = Points::Zero(area.size(), 3);
  d.area = area;
  return d;
}

Surface map_of(const Eigen::VectorXd& residual) {
  Surface s;
  s.residual = residual;
  s.cut_time_s = Eigen::VectorXd::LinSpaced(residual.size(), 0, 1);
  s.cut_line.assign(static_cast<std::size_t>(residual.size()), 7);
  s.status.assign(static_cast<std::size_t>(residual.size()), VertexStatus::Cut);
  return s;
}

TEST(Statistics, AreThoseComputedByHand) {
  // weights 1 2 3 4, residuals 1 -1 2 0; one uncut and one outside must not count
  Surface s = map_of((Eigen::VectorXd(6) << 1, -1, 2, 0, nan, nan).finished());
  s.status[4] = VertexStatus::Uncut;
  s.status[5] = VertexStatus::Outside;
  const Statistics t =
      statistics(s, weights((Eigen::VectorXd(6) << 1, 2, 3, 4, 50, 60).finished()), 1.0);
  EXPECT_DOUBLE_EQ(*t.pv, 3);
  EXPECT_DOUBLE_EQ(*t.min, -1);
  EXPECT_DOUBLE_EQ(*t.max, 2);
  EXPECT_DOUBLE_EQ(*t.mean, (1 - 2 + 6) / 10.0);
  EXPECT_DOUBLE_EQ(*t.rms, std::sqrt((1 + 2 + 12) / 10.0));
  EXPECT_DOUBLE_EQ(*t.std_dev, std::sqrt(1.5 - 0.25));
  EXPECT_DOUBLE_EQ(*t.p95_abs, 1 + 0.85);  // ranks 0 1 1 2: 0.95 * 3 = 2.85
  EXPECT_DOUBLE_EQ(*t.in_tolerance_percent, 75);
  EXPECT_EQ(t.vertices, 6);
  EXPECT_EQ(t.cut_vertices, 4);
  EXPECT_EQ(t.uncut_vertices, 1);
  EXPECT_EQ(t.outside_vertices, 1);
}

TEST(Statistics, CountGougesBeyondTheBandAsOutOfTolerance) {
  Surface s = map_of((Eigen::VectorXd(4) << 1, -1, nan, nan).finished());
  s.status[2] = s.status[3] = VertexStatus::Gouged;
  s.gouges = {{2, 5.0, false}, {3, 8.0, true}};
  const Statistics t = statistics(s, weights(Eigen::VectorXd::Ones(4)), 1.0);
  EXPECT_DOUBLE_EQ(*t.pv, 2);
  EXPECT_DOUBLE_EQ(*t.in_tolerance_percent, 50);
  EXPECT_EQ(t.gouged_vertices, 2);
  EXPECT_EQ(t.uncut_vertices + t.outside_vertices, 0);
  ASSERT_TRUE(t.deepest);
  EXPECT_EQ(t.deepest->vertex, 3);
  EXPECT_EQ(t.deepest->depth, 8.0);
  EXPECT_TRUE(t.deepest->deeper);
}

TEST(Statistics, WithoutCutVerticesAreEmpty) {
  Surface s = map_of(Eigen::VectorXd::Constant(3, nan));
  s.status.assign(3, VertexStatus::Uncut);
  const Statistics t = statistics(s, weights(Eigen::VectorXd::Ones(3)), 1.0);
  EXPECT_FALSE(t.pv || t.rms || t.mean || t.std_dev || t.min || t.max || t.p95_abs ||
               t.in_tolerance_percent);
  EXPECT_EQ(t.uncut_vertices, 3);
  const Statistics none = statistics(Surface{}, weights(Eigen::VectorXd()));
  EXPECT_FALSE(none.pv || none.in_tolerance_percent);
  EXPECT_EQ(none.vertices, 0);
}

TEST(Statistics, WithoutAreaLackTheWeightedOnesOnly) {
  const Statistics t =
      statistics(map_of(Eigen::VectorXd::Ones(2)), weights(Eigen::VectorXd::Zero(2)));
  EXPECT_EQ(*t.pv, 0.0);
  EXPECT_FALSE(t.rms || t.mean || t.std_dev || t.in_tolerance_percent);
}

TEST(Statistics, OfOneVertexAreItsValue) {
  const Statistics t =
      statistics(map_of(Eigen::VectorXd::Constant(1, -3e-3)), weights(Eigen::VectorXd::Ones(1)));
  EXPECT_EQ(*t.pv, 0.0);
  EXPECT_EQ(*t.mean, -3e-3);
  EXPECT_EQ(*t.p95_abs, 3e-3);
  EXPECT_EQ(*t.std_dev, 0.0);
}

TEST(Statistics, LoseNothingToALargeOffset) {
  // 1 mm of offset under 1 nm of waviness: a plain sum of squares would drown the waviness
  const int n = 1'000'000;
  Eigen::VectorXd r(n);
  for (int i = 0; i < n; ++i) r[i] = 1.0 + (i % 2 ? 1e-6 : -1e-6);
  const Statistics t = statistics(map_of(r), weights(Eigen::VectorXd::Constant(n, 0.1)));
  std::cout << "mean - 1 = " << *t.mean - 1.0 << ", std - 1e-6 = " << *t.std_dev - 1e-6 << " mm\n";
  EXPECT_NEAR(*t.mean, 1.0, 3e-16);
  EXPECT_NEAR(*t.std_dev, 1e-6, 1e-16);
}

TEST(Statistics, OfASineAreItsClosedForms) {
  const int n = 20000;
  Eigen::VectorXd r(n);
  for (int i = 0; i < n; ++i) r[i] = 5e-3 * std::sin(2 * M_PI * i / n);
  const Statistics t = statistics(map_of(r), weights(Eigen::VectorXd::Ones(n)), 2.5e-3);
  EXPECT_NEAR(*t.rms, 5e-3 / std::sqrt(2.0), 1e-17);
  EXPECT_NEAR(*t.mean, 0.0, 1e-17);
  EXPECT_NEAR(*t.p95_abs, 5e-3 * std::sin(0.95 * M_PI / 2), 1e-7);
  EXPECT_NEAR(*t.in_tolerance_percent, 100.0 / 3.0, 0.02);
}

TEST(Statistics, RefuseWhatDoesNotFit) {
  EXPECT_THROW(statistics(map_of(Eigen::VectorXd::Ones(3)), weights(Eigen::VectorXd::Ones(2))),
               std::invalid_argument);
  EXPECT_THROW(
      statistics(map_of(Eigen::VectorXd::Constant(2, nan)), weights(Eigen::VectorXd::Ones(2))),
      std::invalid_argument);
}

TEST(Minus, SubtractsWhereBothAreCut) {
  Surface a = map_of((Eigen::VectorXd(4) << 5, 6, nan, nan).finished());
  Surface b = map_of((Eigen::VectorXd(4) << 1, nan, 3, nan).finished());
  b.status[1] = VertexStatus::Uncut;
  a.status[2] = VertexStatus::Outside;
  a.status[3] = VertexStatus::Uncut;
  b.status[3] = VertexStatus::Outside;
  const Surface d = minus(a, b);
  EXPECT_EQ(d.residual[0], 4.0);
  EXPECT_EQ(d.cut_line[0], 7);
  for (int i = 1; i < 4; ++i) {
    EXPECT_TRUE(std::isnan(d.residual[i]) && std::isnan(d.cut_time_s[i]));
    EXPECT_EQ(d.cut_line[static_cast<std::size_t>(i)], 0);
  }
  EXPECT_EQ(d.status[1], VertexStatus::Uncut);
  EXPECT_EQ(d.status[2], VertexStatus::Outside);
  EXPECT_EQ(d.status[3], VertexStatus::Outside);
  EXPECT_EQ(*statistics(minus(a, a), weights(Eigen::VectorXd::Ones(4))).pv, 0.0);
  EXPECT_THROW(minus(a, map_of(Eigen::VectorXd::Ones(3))), std::invalid_argument);
}

TEST(Minus, KeepsTheGougesOfBoth) {
  Surface a = map_of((Eigen::VectorXd(4) << nan, nan, 1, nan).finished());
  Surface b = map_of((Eigen::VectorXd(4) << 1, nan, nan, nan).finished());
  a.status[0] = a.status[1] = a.status[3] = VertexStatus::Gouged;
  a.gouges = {{0, 5.0, false}, {1, 6.0, false}, {3, 7.0, false}};
  b.status[1] = b.status[2] = VertexStatus::Gouged;
  b.status[3] = VertexStatus::Outside;
  b.gouges = {{1, 60.0, false}, {2, 8.0, true}};
  b.cut_line[2] = 9;
  const Surface d = minus(a, b);
  const std::vector<VertexStatus> expected = {VertexStatus::Gouged, VertexStatus::Gouged,
                                              VertexStatus::Gouged, VertexStatus::Outside};
  EXPECT_EQ(d.status, expected);
  ASSERT_EQ(d.gouges.size(), 3u);
  EXPECT_EQ(d.gouges[0].depth, 5.0);
  EXPECT_EQ(d.gouges[1].depth, 6.0);
  EXPECT_EQ(d.gouges[2].depth, 8.0);
  EXPECT_EQ(d.cut_line[1], 7);
  EXPECT_EQ(d.cut_line[2], 9);
  EXPECT_FALSE(statistics(d, weights(Eigen::VectorXd::Ones(4))).pv);
}

}  // namespace
}  // namespace abbe::cutting
