#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "cutting/map/residual.h"
#include "cutting/part/primitive.h"
#include "tests/kinematics/nan.h"

namespace abbe::cutting {
namespace {

/// A design that is nothing but weights, and a map over it.
Design of_areas(const Eigen::VectorXd& area) {
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

/// The same band for all vertices.
ToleranceBands band(Eigen::Index n, double lower, double upper) {
  return Eigen::RowVector2d(lower, upper).replicate(n, 1);
}

TEST(Statistics, WithMiddlesAreThoseOfAQuadraticResidualWhateverItsVertices) {
  // the mean of a quadratic is exact, of its square nearly: a wave of cusps along vertices that
  // stand on the crests
  const Design plane = tessellate(RectanglePlane{8.0, 6.0}, {700});
  const auto bowl = [](const Eigen::Vector3d& p) {
    return 3.0 + p.x() * p.y() + 2.0 * p.x() * p.x();
  };
  Surface s = map_of(Eigen::VectorXd(plane.vertices.rows()));
  for (Eigen::Index i = 0; i < plane.vertices.rows(); ++i)
    s.residual[i] = bowl(plane.vertices.row(i));
  const double exact = 3.0 + 2.0 * 64.0 / 12.0;
  const double straight = *statistics(s, plane).mean;
  s.interior_sample = Surface::InteriorSample::Middle;
  s.within.resize(plane.triangles.rows());
  for (Eigen::Index t = 0; t < plane.triangles.rows(); ++t) {
    const auto c = plane.triangles.row(t);
    s.within[t] = bowl(
        (plane.vertices.row(c[0]) + plane.vertices.row(c[1]) + plane.vertices.row(c[2])) / 3.0);
  }
  const Statistics with = statistics(s, plane);
  std::cout << "mean of a bowl: " << straight - exact << " off without middles, "
            << *with.mean - exact << " with them\n";
  EXPECT_GT(straight - exact, 1e-3);
  EXPECT_NEAR(*with.mean, exact, 1e-12);
  EXPECT_NEAR(weights(s, plane).vertex.sum() + weights(s, plane).within.sum(), 48.0, 1e-11);
  s.within.head(100).setConstant(nan);
  EXPECT_NEAR(weights(s, plane).vertex.sum() + weights(s, plane).within.sum(), 48.0, 1e-11);
  EXPECT_EQ(minus(s, s).within.tail(200).cwiseAbs().maxCoeff(), 0.0);
  s.within.resize(3);
  EXPECT_THROW(weights(s, plane), std::invalid_argument);
}

TEST(Statistics, PlacesAtRandomAreEvenOverEveryTriangle) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  constexpr int n = 200000;
  for (int t = 0; t < n; ++t) {
    const std::array<double, 3> at = sample_barycentric(Surface::InteriorSample::Random, t);
    const Eigen::Vector3d p(at[0], at[1], at[2]);
    ASSERT_GE(p.minCoeff(), 0.0);
    ASSERT_NEAR(p.sum(), 1.0, 1e-15);
    mean += p / n;
    square += p * p.transpose() / n;
  }
  // of an even density: means 1/3, squares 1/6, products 1/12; four standard deviations of them
  EXPECT_LT((mean.array() - 1.0 / 3.0).abs().maxCoeff(), 4 * 0.236 / std::sqrt(n));
  const Eigen::Matrix3d even = (Eigen::Matrix3d::Ones() + Eigen::Matrix3d::Identity()) / 12.0;
  EXPECT_LT((square - even).cwiseAbs().maxCoeff(), 4 * 0.2 / std::sqrt(n));
  EXPECT_EQ(sample_barycentric(Surface::InteriorSample::Middle, 7)[1], 1.0 / 3.0);
}

TEST(Statistics, AreThoseComputedByHand) {
  // weights 1 2 3 4, residuals 1 -1 2 0; one uncut and one outside must not count
  Surface s = map_of((Eigen::VectorXd(6) << 1, -1, 2, 0, nan, nan).finished());
  s.status[4] = VertexStatus::Uncut;
  s.status[5] = VertexStatus::Outside;
  const Statistics t = statistics(
      s, of_areas((Eigen::VectorXd(6) << 1, 2, 3, 4, 50, 60).finished()), band(6, -1, 1));
  EXPECT_DOUBLE_EQ(*t.pv, 3);
  EXPECT_DOUBLE_EQ(*t.min, -1);
  EXPECT_DOUBLE_EQ(*t.max, 2);
  EXPECT_DOUBLE_EQ(*t.mean, (1 - 2 + 6) / 10.0);
  EXPECT_DOUBLE_EQ(*t.rms, std::sqrt((1 + 2 + 12) / 10.0));
  EXPECT_DOUBLE_EQ(*t.std_dev, std::sqrt(1.5 - 0.25));
  EXPECT_DOUBLE_EQ(*t.p95_abs, 2);  // up to 1 lie 7 of 10
  ASSERT_TRUE(t.conformance);
  EXPECT_DOUBLE_EQ(t.conformance->in, 700.0 / 60);  // of what is judged, the uncut 50 among it
  EXPECT_DOUBLE_EQ(t.conformance->over, 300.0 / 60);
  EXPECT_EQ(t.conformance->under, 0);
  EXPECT_DOUBLE_EQ(t.conformance->uncut, 5000.0 / 60);
  EXPECT_EQ(t.conformance->vertex, 2);
  EXPECT_EQ(t.conformance->excess, 1);
  EXPECT_EQ(t.lowest->vertex, 1);
  EXPECT_EQ(t.highest->vertex, 2);
  EXPECT_EQ(t.vertices, 6);
  EXPECT_EQ(t.cut_vertices, 4);
  EXPECT_EQ(t.uncut_vertices, 1);
  EXPECT_EQ(t.outside_vertices, 1);
}

TEST(Statistics, CountGougesBeyondTheBandAsOutOfTolerance) {
  Surface s = map_of((Eigen::VectorXd(4) << 1, -1, nan, nan).finished());
  s.status[2] = s.status[3] = VertexStatus::Gouged;
  s.gouges = {{2, 5.0, false}, {3, 8.0, true}};
  const Statistics t = statistics(s, of_areas(Eigen::VectorXd::Ones(4)), band(4, -1, 1));
  EXPECT_DOUBLE_EQ(*t.pv, 2);
  EXPECT_DOUBLE_EQ(t.conformance->in, 50);
  EXPECT_DOUBLE_EQ(t.conformance->under, 50);
  EXPECT_EQ(t.conformance->vertex, 3);
  EXPECT_EQ(t.conformance->excess, 7.0);  // 8 deep at least, 1 is allowed
  EXPECT_TRUE(t.conformance->is_lower_bound);
  EXPECT_EQ(t.gouged_vertices, 2);
  EXPECT_EQ(t.uncut_vertices + t.outside_vertices, 0);
  ASSERT_TRUE(t.deepest);
  EXPECT_EQ(t.deepest->vertex, 3);
  EXPECT_EQ(t.deepest->depth, 8.0);
  EXPECT_TRUE(t.deepest->continues_deeper);
}

TEST(Statistics, WithoutCutVerticesAreEmpty) {
  Surface s = map_of(Eigen::VectorXd::Constant(3, nan));
  s.status.assign(3, VertexStatus::Uncut);
  const Statistics t = statistics(s, of_areas(Eigen::VectorXd::Ones(3)), band(3, -1, 1));
  EXPECT_FALSE(t.pv || t.rms || t.mean || t.std_dev || t.min || t.max || t.p95_abs || t.lowest);
  EXPECT_EQ(t.conformance->uncut, 100);
  EXPECT_FALSE(t.conformance->passes());
  EXPECT_EQ(t.uncut_vertices, 3);
  const Statistics none = statistics(Surface{}, of_areas(Eigen::VectorXd()));
  EXPECT_FALSE(none.pv || none.conformance);
  EXPECT_EQ(none.vertices, 0);
}

TEST(Statistics, WithoutAreaLackTheWeightedOnesOnly) {
  const Statistics t =
      statistics(map_of(Eigen::VectorXd::Ones(2)), of_areas(Eigen::VectorXd::Zero(2)));
  EXPECT_EQ(*t.pv, 0.0);
  EXPECT_FALSE(t.rms || t.mean || t.std_dev || t.conformance);
}

TEST(Statistics, OfOneVertexAreItsValue) {
  const Statistics t =
      statistics(map_of(Eigen::VectorXd::Constant(1, -3e-3)), of_areas(Eigen::VectorXd::Ones(1)));
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
  const Statistics t = statistics(map_of(r), of_areas(Eigen::VectorXd::Constant(n, 0.1)));
  std::cout << "mean - 1 = " << *t.mean - 1.0 << ", std - 1e-6 = " << *t.std_dev - 1e-6 << " mm\n";
  EXPECT_NEAR(*t.mean, 1.0, 3e-16);
  EXPECT_NEAR(*t.std_dev, 1e-6, 1e-16);
}

TEST(Statistics, OfASineAreItsClosedForms) {
  const int n = 20000;
  Eigen::VectorXd r(n);
  for (int i = 0; i < n; ++i) r[i] = 5e-3 * std::sin(2 * M_PI * i / n);
  const Statistics t =
      statistics(map_of(r), of_areas(Eigen::VectorXd::Ones(n)), band(n, -2.5e-3, 2.5e-3));
  EXPECT_NEAR(*t.rms, 5e-3 / std::sqrt(2.0), 1e-17);
  EXPECT_NEAR(*t.mean, 0.0, 1e-17);
  EXPECT_NEAR(*t.p95_abs, 5e-3 * std::sin(0.95 * M_PI / 2), 1e-7);
  EXPECT_NEAR(t.conformance->in, 100.0 / 3.0, 0.02);
  // of one side: a quarter of a turn and half of it below zero and above half the peak
  const Conformance one_sided =
      *statistics(map_of(r), of_areas(Eigen::VectorXd::Ones(n)), band(n, 0, 2.5e-3)).conformance;
  EXPECT_NEAR(one_sided.in, 100.0 / 6.0, 0.02);
  EXPECT_NEAR(one_sided.over, 100.0 / 3.0, 0.02);
  EXPECT_NEAR(one_sided.under, 50.0, 0.02);
  EXPECT_NEAR(one_sided.excess, 5e-3, 1e-9);  // the trough
}

TEST(Statistics, KnowABandForEachVertex) {
  const double inf = std::numeric_limits<double>::infinity();
  ToleranceBands bands(3, 2);
  bands << 0, 1, -inf, inf, -4, 1;
  const Conformance c =
      *statistics(map_of(Eigen::Vector3d(-2, -9, -7)), of_areas(Eigen::Vector3d(1, 2, 1)), bands)
           .conformance;
  EXPECT_EQ(c.in, 0);  // shares are of what has limits
  EXPECT_EQ(c.under, 100);
  EXPECT_EQ(c.vertex, 2);  // -7 is 3 out of its band, -2 is 2 out of its own
  EXPECT_EQ(c.excess, 3);
  EXPECT_FALSE(c.passes());
}

TEST(Statistics, OfAPlaceOutOfToleranceBetweenGoodVerticesFail) {
  const Design plane = tessellate(RectanglePlane{8.0, 6.0}, {700});
  Surface s = map_of(Eigen::VectorXd::Zero(plane.vertices.rows()));
  s.interior_sample = Surface::InteriorSample::Middle;
  s.within = Eigen::VectorXd::Zero(plane.triangles.rows());
  s.within[20] = 3.0;
  s.within[30] = -5.0;
  ToleranceBands bands = band(plane.vertices.rows(), -1, 1);
  const Conformance c = *statistics(s, plane, bands).conformance;
  EXPECT_GT(c.over, 0.0);
  EXPECT_GT(c.under, 0.0);
  EXPECT_FALSE(c.passes());
  EXPECT_EQ(c.out_of_tolerance_count, 2);
  EXPECT_EQ(c.triangle, 30);
  EXPECT_EQ(c.vertex, -1);
  EXPECT_EQ(c.excess, 4.0);
  s.residual[7] = 9.0;
  EXPECT_EQ(statistics(s, plane, bands).conformance->vertex, 7);
  EXPECT_EQ(statistics(s, plane, bands).conformance->triangle, -1);
  s.residual[7] = 0.0;
  // across a border of bands it is not known in which of them a place lies
  bands.row(plane.triangles(20, 1)) << -1, 4;
  bands.row(plane.triangles(30, 2)) << -6, 1;
  EXPECT_TRUE(statistics(s, plane, bands).conformance->passes());
}

TEST(Statistics, RefuseWhatDoesNotFit) {
  EXPECT_THROW(statistics(map_of(Eigen::VectorXd::Ones(3)), of_areas(Eigen::VectorXd::Ones(2))),
               std::invalid_argument);
  EXPECT_THROW(
      statistics(map_of(Eigen::VectorXd::Constant(2, nan)), of_areas(Eigen::VectorXd::Ones(2))),
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
  EXPECT_EQ(*statistics(minus(a, a), of_areas(Eigen::VectorXd::Ones(4))).pv, 0.0);
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
  EXPECT_FALSE(statistics(d, of_areas(Eigen::VectorXd::Ones(4))).pv);
}

}  // namespace
}  // namespace abbe::cutting
