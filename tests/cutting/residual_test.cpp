#include "cutting/map/residual.h"
#include "cutting/map/areal_filter.h"
#include "cutting/map/form.h"
#include "cutting/part/primitive.h"
#include "cutting/part/remeshing.h"
#include "tests/cutting/map_over.h"
#include "tests/oracles/areal_oracle.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

using kinematics::Deviation;

/// A design that is nothing but weights, and a map over it.
Design of_areas(const VectorXd& area) {
  Design d;
  d.vertices = Points::Zero(area.size(), 3);
  d.normals = Points::Zero(area.size(), 3);
  d.area = area;
  return d;
}

Surface map_of(const VectorXd& residual) {
  Surface s;
  s.residual = residual;
  s.cut_time_s = VectorXd::LinSpaced(residual.size(), 0, 1);
  s.cut_line.assign(static_cast<std::size_t>(residual.size()), 7);
  s.status.assign(static_cast<std::size_t>(residual.size()), VertexStatus::Cut);
  return s;
}

/// The same band for all vertices.
ToleranceBands band(Index n, double lower, double upper) {
  return Eigen::RowVector2d(lower, upper).replicate(n, 1);
}

TEST(Statistics, WithMiddlesAreThoseOfAQuadraticResidualWhateverItsVertices) {
  // the mean of a quadratic is exact, of its square nearly: a wave of cusps along vertices that
  // stand on the crests
  const Design plane = tessellate(RectanglePlane{8.0, 6.0}, {700});
  const auto bowl = [](const Vector3d& p) { return 3.0 + p.x() * p.y() + 2.0 * p.x() * p.x(); };
  Surface s = map_of(VectorXd(plane.vertices.rows()));
  for (Index i = 0; i < plane.vertices.rows(); ++i) s.residual[i] = bowl(plane.vertices.row(i));
  const double exact = 3.0 + 2.0 * 64.0 / 12.0;
  const double straight = *statistics(s, plane).mean;
  s.interior_sample = Surface::InteriorSample::Middle;
  s.within.resize(plane.triangles.rows());
  for (Index t = 0; t < plane.triangles.rows(); ++t) {
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
  Vector3d mean = Vector3d::Zero();
  Matrix3d square = Matrix3d::Zero();
  constexpr int n = 200000;
  for (int t = 0; t < n; ++t) {
    const std::array<double, 3> at = sample_barycentric(Surface::InteriorSample::Random, t);
    const Vector3d p(at[0], at[1], at[2]);
    ASSERT_GE(p.minCoeff(), 0.0);
    ASSERT_NEAR(p.sum(), 1.0, 1e-15);
    mean += p / n;
    square += p * p.transpose() / n;
  }
  // of an even density: means 1/3, squares 1/6, products 1/12; four standard deviations of them
  EXPECT_LT((mean.array() - 1.0 / 3.0).abs().maxCoeff(), 4 * 0.236 / std::sqrt(n));
  const Matrix3d even = (Matrix3d::Ones() + Matrix3d::Identity()) / 12.0;
  EXPECT_LT((square - even).cwiseAbs().maxCoeff(), 4 * 0.2 / std::sqrt(n));
  EXPECT_EQ(sample_barycentric(Surface::InteriorSample::Middle, 7)[1], 1.0 / 3.0);
}

TEST(Statistics, AreThoseComputedByHand) {
  // weights 1 2 3 4, residuals 1 -1 2 0; one uncut and one outside must not count
  Surface s = map_of((VectorXd(6) << 1, -1, 2, 0, nan, nan).finished());
  s.status[4] = VertexStatus::Uncut;
  s.status[5] = VertexStatus::Outside;
  const Statistics t =
      statistics(s, of_areas((VectorXd(6) << 1, 2, 3, 4, 50, 60).finished()), band(6, -1, 1));
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
  Surface s = map_of((VectorXd(4) << 1, -1, nan, nan).finished());
  s.status[2] = s.status[3] = VertexStatus::Gouged;
  s.gouges = {{2, 5.0, false}, {3, 8.0, true}};
  const Statistics t = statistics(s, of_areas(VectorXd::Ones(4)), band(4, -1, 1));
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
  Surface s = map_of(VectorXd::Constant(3, nan));
  s.status.assign(3, VertexStatus::Uncut);
  const Statistics t = statistics(s, of_areas(VectorXd::Ones(3)), band(3, -1, 1));
  EXPECT_FALSE(t.pv || t.rms || t.mean || t.std_dev || t.min || t.max || t.p95_abs || t.lowest);
  EXPECT_EQ(t.conformance->uncut, 100);
  EXPECT_FALSE(t.conformance->passes());
  EXPECT_EQ(t.uncut_vertices, 3);
  const Statistics none = statistics(Surface{}, of_areas(VectorXd()));
  EXPECT_FALSE(none.pv || none.conformance);
  EXPECT_EQ(none.vertices, 0);
}

TEST(Statistics, WithoutAreaLackTheWeightedOnesOnly) {
  const Statistics t = statistics(map_of(VectorXd::Ones(2)), of_areas(VectorXd::Zero(2)));
  EXPECT_EQ(*t.pv, 0.0);
  EXPECT_FALSE(t.rms || t.mean || t.std_dev || t.conformance);
}

TEST(Statistics, OfOneVertexAreItsValue) {
  const Statistics t =
      statistics(map_of(VectorXd::Constant(1, -3e-3)), of_areas(VectorXd::Ones(1)));
  EXPECT_EQ(*t.pv, 0.0);
  EXPECT_EQ(*t.mean, -3e-3);
  EXPECT_EQ(*t.p95_abs, 3e-3);
  EXPECT_EQ(*t.std_dev, 0.0);
}

TEST(Statistics, LoseNothingToALargeOffset) {
  // 1 mm of offset under 1 nm of waviness: a plain sum of squares would drown the waviness
  const int n = 1'000'000;
  VectorXd r(n);
  for (int i = 0; i < n; ++i) r[i] = 1.0 + (i % 2 ? 1e-6 : -1e-6);
  const Statistics t = statistics(map_of(r), of_areas(VectorXd::Constant(n, 0.1)));
  std::cout << "mean - 1 = " << *t.mean - 1.0 << ", std - 1e-6 = " << *t.std_dev - 1e-6 << " mm\n";
  EXPECT_NEAR(*t.mean, 1.0, 3e-16);
  EXPECT_NEAR(*t.std_dev, 1e-6, 1e-16);
}

TEST(Statistics, OfASineAreItsClosedForms) {
  const int n = 20000;
  VectorXd r(n);
  for (int i = 0; i < n; ++i) r[i] = 5e-3 * std::sin(2 * M_PI * i / n);
  const Statistics t = statistics(map_of(r), of_areas(VectorXd::Ones(n)), band(n, -2.5e-3, 2.5e-3));
  EXPECT_NEAR(*t.rms, 5e-3 / std::sqrt(2.0), 1e-17);
  EXPECT_NEAR(*t.mean, 0.0, 1e-17);
  EXPECT_NEAR(*t.p95_abs, 5e-3 * std::sin(0.95 * M_PI / 2), 1e-7);
  EXPECT_NEAR(t.conformance->in, 100.0 / 3.0, 0.02);
  // of one side: a quarter of a turn and half of it below zero and above half the peak
  const Conformance one_sided =
      *statistics(map_of(r), of_areas(VectorXd::Ones(n)), band(n, 0, 2.5e-3)).conformance;
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
      *statistics(map_of(Vector3d(-2, -9, -7)), of_areas(Vector3d(1, 2, 1)), bands).conformance;
  EXPECT_EQ(c.in, 0);  // shares are of what has limits
  EXPECT_EQ(c.under, 100);
  EXPECT_EQ(c.vertex, 2);  // -7 is 3 out of its band, -2 is 2 out of its own
  EXPECT_EQ(c.excess, 3);
  EXPECT_FALSE(c.passes());
}

TEST(Statistics, OfAPlaceOutOfToleranceBetweenGoodVerticesFail) {
  const Design plane = tessellate(RectanglePlane{8.0, 6.0}, {700});
  Surface s = map_of(VectorXd::Zero(plane.vertices.rows()));
  s.interior_sample = Surface::InteriorSample::Middle;
  s.within = VectorXd::Zero(plane.triangles.rows());
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
  EXPECT_THROW(statistics(map_of(VectorXd::Ones(3)), of_areas(VectorXd::Ones(2))),
               std::invalid_argument);
  EXPECT_THROW(statistics(map_of(VectorXd::Constant(2, nan)), of_areas(VectorXd::Ones(2))),
               std::invalid_argument);
}

TEST(Minus, SubtractsWhereBothAreCut) {
  Surface a = map_of((VectorXd(4) << 5, 6, nan, nan).finished());
  Surface b = map_of((VectorXd(4) << 1, nan, 3, nan).finished());
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
  EXPECT_EQ(*statistics(minus(a, a), of_areas(VectorXd::Ones(4))).pv, 0.0);
  EXPECT_THROW(minus(a, map_of(VectorXd::Ones(3))), std::invalid_argument);
}

TEST(Minus, KeepsTheGougesOfBoth) {
  Surface a = map_of((VectorXd(4) << nan, nan, 1, nan).finished());
  Surface b = map_of((VectorXd(4) << 1, nan, nan, nan).finished());
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
  EXPECT_FALSE(statistics(d, of_areas(VectorXd::Ones(4))).pv);
}

Surface blank(const Design& d) {
  const auto n = d.vertices.rows();
  return {VectorXd::Zero(n), VectorXd::Zero(n), std::vector<int>(static_cast<std::size_t>(n), 1),
          std::vector<VertexStatus>(static_cast<std::size_t>(n), VertexStatus::Cut)};
}

/// The map of a surface displaced as a whole: to first order the normal part of the shift.
Surface displaced(const Design& d, const Deviation& D, const Vector3d& point) {
  Surface s = blank(d);
  for (Index i = 0; i < d.vertices.rows(); ++i) {
    const Vector3d p = d.vertices.row(i), n = d.normals.row(i);
    s.residual[i] = n.dot(D.head<3>() + D.tail<3>().cross(p - point));
  }
  return s;
}

Deviation some(double shift, double turn) {
  Deviation D;
  D << shift, -0.7 * shift, 0.4 * shift, turn, -0.6 * turn, 0.8 * turn;
  return D;
}

TEST(Alignment, NoneLeavesTheMapAlone) {
  const Design d = tessellate(SphereCap{50, 30}, {1000});
  const Surface s = displaced(d, some(0.01, 1e-4), Vector3d::Zero());
  const AlignmentResult a = aligned(s, d, {Alignment::None});
  EXPECT_EQ(a.surface.residual, s.residual);
  EXPECT_EQ(a.displacement, Deviation::Zero());
}

TEST(Alignment, OffsetTakesOutATranslationOfADome) {
  const Design d = tessellate(SphereCap{50, 30}, {3000});
  Deviation D = Deviation::Zero();
  D.head<3>() << 0.01, -0.02, 0.03;
  const AlignmentResult a = aligned(displaced(d, D, Vector3d::Zero()), d, {Alignment::Offset});
  std::cout << "left " << a.surface.residual.cwiseAbs().maxCoeff() << " mm\n";
  EXPECT_LT((a.displacement - D).norm(), 1e-15);
  EXPECT_LT(a.surface.residual.cwiseAbs().maxCoeff(), 1e-16);
  EXPECT_EQ(a.rank, 3);
  EXPECT_TRUE(a.undetermined.empty());
}

TEST(Alignment, OffsetOfAFlatIsItsMeanAndXAndYAreNamed) {
  const Design d = tessellate(Disc{10, 0}, {1000});
  Surface s = blank(d);
  for (Index i = 0; i < d.vertices.rows(); ++i) s.residual[i] = 0.005 + 1e-3 * d.vertices(i, 0);
  const AlignmentResult a = aligned(s, d, {Alignment::Offset});
  EXPECT_EQ(a.undetermined, (std::vector<std::string>{"EX", "EY"}));
  EXPECT_NEAR(a.displacement[2], 0.005 + 1e-3 * a.point.x(), 1e-16);
  EXPECT_EQ(a.displacement[0], 0.0);
  EXPECT_NEAR(a.surface.residual.dot(d.area), 0.0, 1e-13);
}

TEST(Alignment, RigidNamesWhatASurfaceCannotTell) {
  const auto names = [](const Primitive& p) {
    const Design d = tessellate(p, {3000});
    auto list = aligned(displaced(d, some(0.01, 1e-4), Vector3d::Zero()), d, {Alignment::Rigid})
                    .undetermined;
    std::sort(list.begin(), list.end());
    return list;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names(RectanglePlane{40, 20}), (Names{"EC", "EX", "EY"}));
  EXPECT_EQ(names(Cylinder{20, 40}), (Names{"EC", "EZ"}));
  EXPECT_EQ(names(Cone{20, 40, 0.3}), (Names{"EC"}));
  EXPECT_EQ(names(Torus{30, 5}), (Names{"EC"}));
  // a sphere turned about its centre: turns about its top go with shifts
  EXPECT_EQ(names(SphereCap{50, 30}), (Names{"EC", "EX+EB", "EY+EA"}));
}

TEST(Alignment, RigidTakesOutAnyDisplacementOfAnySurface) {
  SeededRandom random(5);
  std::normal_distribution<double> normal;
  const std::vector<Primitive> all = {
      RectanglePlane{40, 20}, Disc{10.8, 2},        Cylinder{20, 40}, Cone{20, 40, 0.3},
      SphereCap{50, 30},      SphereCap{125.2, 10}, Torus{30, 5}};
  for (std::size_t k = 0; k < all.size(); ++k) {
    SCOPED_TRACE(k);
    Design d = tessellate(all[k], {2000});
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                     .normalized()
                     .toRotationMatrix();
    T.translation() = 100 * Vector3d(normal(random), normal(random), normal(random));
    d = transformed(d, T);
    const Surface s = displaced(d, some(0.02, 2e-4), Vector3d(10, 20, 30));
    const AlignmentResult a = aligned(s, d, {Alignment::Rigid});
    // what is dropped moves the surface a thousand times less than what is kept, here not at all
    const double left = a.surface.residual.cwiseAbs().maxCoeff();
    std::cout << "surface " << k << ": rank " << a.rank << ", left " << left << " mm of "
              << s.residual.cwiseAbs().maxCoeff() << "\n";
    EXPECT_LT(left, 1e-13);
  }
}

TEST(Alignment, WhatIsLeftIsOrthogonalToEveryDisplacement) {
  const Design d = tessellate(Cone{20, 40, 0.3}, {2000});
  Surface s = blank(d);
  for (Index i = 0; i < d.vertices.rows(); ++i) s.residual[i] = 1e-3 * std::sin(3.0 * i) + 0.01;
  s.status[5] = VertexStatus::Uncut;
  s.residual[5] = std::nan("");
  const AlignmentResult a = aligned(s, d, {Alignment::Rigid});
  EXPECT_TRUE(std::isnan(a.surface.residual[5]));
  for (int c = 0; c < 6; ++c) {
    Deviation D = Deviation::Zero();
    D[c] = 1.0;
    const VectorXd unit = displaced(d, D, a.point).residual;
    double sum = 0.0;
    for (Index i = 0; i < unit.size(); ++i)
      if (i != 5) sum += d.area[i] * unit[i] * a.surface.residual[i];
    EXPECT_NEAR(sum / d.area.sum(), 0.0, 1e-15) << c;
  }
}

TEST(Alignment, HoldsItsBoundOnTheTrueSurface) {
  // a dome really turned by 100 urad and shifted by 20 um, its residual by ray against the sphere
  const double R = 50.0;
  const Design d = tessellate(SphereCap{R, 30}, {3000});
  const Vector3d t(0.02, -0.01, 0.015);
  Surface s = blank(d);
  for (Index i = 0; i < d.vertices.rows(); ++i) {
    const Vector3d n = d.normals.row(i);  // the vertex stands at R n from the centre
    s.residual[i] = n.dot(t) + std::sqrt(R * R - t.squaredNorm() + std::pow(n.dot(t), 2)) - R;
  }
  const double left = aligned(s, d, {Alignment::Offset}).surface.residual.cwiseAbs().maxCoeff();
  std::cout << "left " << left * 1e6 << " nm, bound " << t.squaredNorm() / (2 * R) * 1e6 << " nm\n";
  EXPECT_LT(left, t.squaredNorm() / (2 * R));
}

TEST(Alignment, OfNothingIsNothing) {
  const Design d = tessellate(Disc{10, 0}, {200});
  Surface s = blank(d);
  s.status.assign(s.status.size(), VertexStatus::Uncut);
  EXPECT_EQ(aligned(s, d, {Alignment::Rigid}).rank, 0);
  EXPECT_THROW(aligned(Surface{}, d, {Alignment::Rigid}), std::invalid_argument);
}

template <class Height>
Surface surface_of(const Design& design, const Height& height) {
  return map_over(design, [&](const Vector3d& p, const Vector3d&) { return height(p); });
}

/// Amplitude of the form of a wave over places whose distance from the rim is beyond a cut-off.
template <class Wave, class Inside>
double transmission(const Design& design, const Wave& wave, const Inside& inside, double cutoff) {
  const VectorXd form = gaussian_form(design, surface_of(design, wave), cutoff);
  double product = 0.0, square = 0.0;
  for (Index i = 0; i < form.size(); ++i) {
    const Vector3d p = design.vertices.row(i);
    if (!inside(p)) continue;
    product += form[i] * wave(p);
    square += wave(p) * wave(p);
  }
  return product / square;
}

TEST(GaussianForm, SinesPassAsISO16610Says) {
  const Design plane = tessellate(RectanglePlane{24.0, 24.0}, {150000});
  constexpr double cutoff = 2.5;
  for (const double turned : {0.0, 0.6}) {
    for (const auto& [ratio, expected] : {std::pair(1.0, 0.5), {0.5, 0.0625}, {2.0, 0.8408964}}) {
      const double wave_length = ratio * cutoff;
      const auto wave = [&](const Vector3d& p) {
        return std::sin(2 * pi * (std::cos(turned) * p.x() + std::sin(turned) * p.y()) /
                        wave_length);
      };
      const auto inside = [](const Vector3d& p) { return p.head<2>().cwiseAbs().maxCoeff() < 9.0; };
      const double seen = transmission(plane, wave, inside, cutoff);
      std::cout << "wave of " << ratio << " cut-offs at " << turned << " rad: " << 100 * seen
                << " %\n";
      EXPECT_NEAR(seen, expected, 0.005);
    }
  }
}

TEST(GaussianForm, SinesPassAlikeOnSlopesAndCylinders) {
  constexpr double cutoff = 2.5, radius = 20.0;
  const Design wall = tessellate(Cylinder{radius, 20.0}, {150000});
  const auto along = [&](const Vector3d& p) { return std::sin(2 * pi * p.z() / cutoff); };
  // a whole number of waves around, as near to the cut-off as they come
  const double count = std::round(2 * pi * radius / cutoff);
  const double length = 2 * pi * radius / count;
  const auto around = [&](const Vector3d& p) { return std::sin(count * std::atan2(p.y(), p.x())); };
  const auto inside = [](const Vector3d& p) { return p.z() > 3.0 && p.z() < 17.0; };
  EXPECT_NEAR(transmission(wall, along, inside, cutoff), 0.5, 0.005);
  EXPECT_NEAR(transmission(wall, around, inside, cutoff),
              std::pow(0.5, cutoff * cutoff / (length * length)), 0.005);
}

TEST(GaussianForm, IsTheSumOverAllVerticesWrittenOut) {
  const Design plane = tessellate(RectanglePlane{6.0, 6.0}, {3000});
  constexpr double cutoff = 2.5;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  std::vector<Vector3d> waves;  // of at least half the cut-off, each with its phase
  for (int i = 0; i < 20; ++i)
    waves.emplace_back(8 / cutoff * number(random), 8 / cutoff * number(random),
                       pi * number(random));
  const Surface surface = surface_of(plane, [&](const Vector3d& p) {
    double height = 0.0;
    for (const Vector3d& wave : waves)
      height += 0.05 * std::sin(wave.dot(Vector3d(p.x(), p.y(), 1)));
    return height;
  });
  const VectorXd form = gaussian_form(plane, surface, cutoff);
  const double alpha = std::sqrt(std::log(2.0) / pi);
  double worst = 0.0;
  for (Index i = 0; i < form.size(); i += 37) {
    const Vector3d p = plane.vertices.row(i);
    Matrix3d A = Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    for (Index j = 0; j < form.size(); ++j) {
      const Vector3d d = plane.vertices.row(j).transpose() - p;
      const double x = d.norm() / (alpha * cutoff);
      const double weight = plane.area[j] * std::exp(-pi * x * x);
      const Vector3d basis(1.0, d.x(), d.y());
      A += weight * basis * basis.transpose();
      b += weight * surface.residual[j] * basis;
    }
    worst = std::max(worst, std::abs(form[i] - A.ldlt().solve(b)[0]));
  }
  const double pv = surface.residual.maxCoeff() - surface.residual.minCoeff();
  std::cout << "cells against all vertices: " << 100 * worst / pv << " % of PV\n";
  EXPECT_LT(worst, 0.01 * pv);
}

TEST(GaussianForm, AWaveFinerThanTheVerticesLeavesNoWaveOfItsOwn) {
  const Design plane = tessellate(RectanglePlane{24.0, 24.0}, {30000});
  const double spacing = std::sqrt(2.0 * 24.0 * 24.0 / double(plane.triangles.rows()));
  const auto wave = [&](const Vector3d& p) { return std::sin(2 * pi * p.x() / (0.97 * spacing)); };
  const auto spread = [](const VectorXd& v) {
    return std::sqrt((v.array() - v.mean()).square().mean());
  };
  Surface surface = surface_of(plane, wave);
  const double without_triangle_samples = spread(gaussian_form(plane, surface, 2.5));
  surface.interior_sample = Surface::InteriorSample::Random;
  surface.within.resize(plane.triangles.rows());
  for (Index t = 0; t < plane.triangles.rows(); ++t)
    surface.within[t] =
        wave(value_at_sample(surface.interior_sample, plane.vertices, plane.triangles, t));
  const double at_random = spread(gaussian_form(plane, surface, 2.5));
  std::cout << "wave of RMS 0.707 and " << 0.97 * spacing << " mm at vertices every " << spacing
            << " mm: form " << without_triangle_samples << " RMS, with places at random "
            << at_random << "\n";
  EXPECT_GT(without_triangle_samples, 0.4);
  EXPECT_LT(at_random, 0.15 * without_triangle_samples);
}

TEST(GaussianForm, ASlopePassesWholeToTheRim) {
  const Design plane = tessellate(RectanglePlane{10.0, 8.0}, {20000});
  const auto slope = [](const Vector3d& p) { return 1e-2 * p.x() - 3e-3 * p.y() + 0.1; };
  const Surface surface = surface_of(plane, slope);
  const VectorXd form = gaussian_form(plane, surface, 2.5);
  EXPECT_LT((form - surface.residual).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(GaussianForm, FacesOfASharpEdgeDoNotMix) {
  Design step;  // two squares at a right angle
  step.vertices.resize(6, 3);
  step.vertices << 0, 0, 0, 0, 4, 0, 4, 0, 0, 4, 4, 0, 0, 0, -4, 0, 4, -4;
  step.triangles.resize(4, 3);
  step.triangles << 0, 2, 1, 1, 2, 3, 0, 1, 4, 1, 5, 4;
  step.normals = vertex_normals(step.vertices, step.triangles);
  step.area = vertex_area(step.vertices, step.triangles);
  step.facet_error = VectorXd::Zero(6);
  const Design split = split_at_edges(step, 0.5);
  ASSERT_EQ(split.vertices.rows(), 8);
  const Surface surface = surface_of(split, [](const Vector3d&) { return 0.0; });
  Surface uneven = surface;
  for (Index i = 0; i < 8; ++i) uneven.residual[i] = split.normals(i, 2) > 0.5 ? 1.0 : -1.0;
  const VectorXd form = gaussian_form(split, uneven, 50.0);
  EXPECT_LT((form - uneven.residual).cwiseAbs().maxCoeff(), 1e-9);
}

/// Heights drawn from 0 to 1 at the vertices of a part, and at a place within each triangle.
Surface random_heights(const Design& part, std::mt19937& random) {
  std::uniform_real_distribution<double> height(0.0, 1.0);
  Surface surface = surface_of(part, [&](const Vector3d&) { return height(random); });
  surface.interior_sample = Surface::InteriorSample::Random;
  surface.within.resize(part.triangles.rows());
  for (Index t = 0; t < part.triangles.rows(); ++t) surface.within[t] = height(random);
  return surface;
}

/// What the filter averages.
test::ArealValues values_of(const Design& part, const Surface& surface) {
  const Weights weights = cutting::weights(surface, part);
  test::ArealValues values;
  const auto add = [&](const Vector3d& point, double value, double area) {
    values.point.push_back(point);
    values.value.push_back(value);
    values.area.push_back(std::max(area, 1e-12));
  };
  for (Index i = 0; i < part.vertices.rows(); ++i)
    add(part.vertices.row(i), surface.residual[i], weights.vertex[i]);
  for (Index t = 0; t < surface.within.size(); ++t)
    add(value_at_sample(surface.interior_sample, part.vertices, part.triangles, t),
        surface.within[t], weights.within[t]);
  return values;
}

/// From coarse parts, of which a value carries its own form, to such that thousands do.
TEST(GaussianForm, StaysWithinTheValuesThatItAveragesOfAnyDensity) {
  constexpr unsigned seed = 118;
  std::mt19937 random(seed);
  double worst = 0.0;
  for (const int vertices : {100, 200, 800, 3200, 20000})
    for (const double cutoff : {0.8, 2.5, 8.0})
      for (const Primitive& shape :
           {Primitive(RectanglePlane{60.0, 40.0}), Primitive(Cylinder{12.5, 30.0})}) {
        const Design part = tessellate(shape, {vertices});
        const Surface surface = random_heights(part, random);
        const VectorXd form = gaussian_form(part, surface, cutoff);
        const test::ArealValues values = values_of(part, surface);
        for (Index i = 0; i < form.size(); i += 1 + form.size() / 150) {
          // cells let a value in from two of their sizes further away
          const test::BruteFilter brute =
              test::brute_filter(values, part.vertices.row(i), part.normals.row(i), cutoff,
                                 (0.65 + 4.0 / 12.0) * cutoff);
          worst = std::max({worst, brute.low - form[i], form[i] - brute.high});
        }
        EXPECT_GE(form.minCoeff(), -1e-9);
        EXPECT_LE(form.maxCoeff(), 1.0 + 1e-9);
      }
  std::cout << "seed " << seed << ": the form leaves the range of the values about it by "
            << 100.0 * worst << " % of all at most\n";
  EXPECT_LT(worst, 1e-9);
}

/// Of first order where ten values or more carry it, else their mean: each against sums over all.
TEST(GaussianForm, IsAPlaneOfManyValuesAndTheMeanOfFew) {
  std::mt19937 random(5);
  double off = 0.0;
  int planes = 0, means = 0;
  for (const auto& [vertices, cutoff] :
       {std::pair(400, 8.0), {1500, 8.0}, {6000, 8.0}, {6000, 2.5}}) {
    const Design part = tessellate(RectanglePlane{60.0, 40.0}, {vertices});
    Surface surface = random_heights(part, random);
    const auto slope = [](const Vector3d& p) { return 0.3 * p.x() - 0.1 * p.y(); };
    for (Index i = 0; i < part.vertices.rows(); ++i)
      surface.residual[i] = 0.02 * surface.residual[i] + slope(part.vertices.row(i));
    for (Index t = 0; t < surface.within.size(); ++t)
      surface.within[t] =
          0.02 * surface.within[t] +
          slope(value_at_sample(surface.interior_sample, part.vertices, part.triangles, t));
    const VectorXd form = gaussian_form(part, surface, cutoff);
    const test::ArealValues values = values_of(part, surface);
    for (Index i = 0; i < form.size(); i += 1 + form.size() / 200) {
      const test::BruteFilter brute =
          test::brute_filter(values, part.vertices.row(i), part.normals.row(i), cutoff, cutoff);
      if (std::abs(brute.carried_by - min_filter_values) < 1.0) continue;  // cells decide
      const bool plane = brute.carried_by > min_filter_values;
      (plane ? planes : means) += 1;
      off = std::max(off, std::abs(form[i] - (plane ? brute.plane : brute.mean)));
    }
  }
  std::cout << planes << " planes and " << means << " means within " << off
            << " of sums over all values, which rise by 0.3 a mm\n";
  EXPECT_GT(planes, 100);
  EXPECT_GT(means, 100);
  EXPECT_LT(off, 0.02);
}

TEST(GaussianForm, LeavesOutWhatIsNotCut) {
  const Design plane = tessellate(RectanglePlane{10.0, 8.0}, {2000});
  Surface surface = surface_of(plane, [](const Vector3d&) { return 2.0; });
  surface.status[7] = VertexStatus::Uncut;
  surface.residual[7] = std::nan("");
  const VectorXd form = gaussian_form(plane, surface, 1.0);
  EXPECT_TRUE(std::isnan(form[7]));
  EXPECT_NEAR(form[8], 2.0, 1e-12);
}

}  // namespace
}  // namespace abbe::cutting
