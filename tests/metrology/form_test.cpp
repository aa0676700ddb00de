#include "errors/metrology/form.h"
#include "tests/oracles/form_oracle.h"
#include "tests/test.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::MatrixX2d;
using Eigen::MatrixX3d;

template <typename Deviation>
MatrixX2d circle(Index n, double radius, const Vector2d& centre, const Deviation& deviation,
                 double from = 0.0, double to = 2.0 * pi) {
  MatrixX2d p(n, 2);
  for (Index i = 0; i < n; ++i) {
    const double t = from + (to - from) * double(i) / double(n), r = radius + deviation(t);
    p.row(i) << centre.x() + r * std::cos(t), centre.y() + r * std::sin(t);
  }
  return p;
}

TEST(LeastSquaresCircle, OfAnEllipseIsRoundByItsTwoAxes) {
  const MatrixX2d p =
      circle(720, 100.0, {3.0, -7.0}, [](double t) { return 5.0_um * std::cos(2.0 * t); });
  const LeastSquaresCircle c = least_squares_circle(p);
  EXPECT_NEAR(c.circularity, 10.0_um, 1e-12);
  EXPECT_NEAR((c.centre - Vector2d(3.0, -7.0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(c.radius, 100.0, 1e-12);
}

TEST(LeastSquaresCircle, HasNoGradientLeft) {
  SeededRandom random(20250605);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int k = 0; k < 300; ++k) {
    const double radius = std::pow(10.0, 3.0 * unit(random));
    const double noise = radius * std::pow(10.0, -4.0 + 3.0 * unit(random));
    const double arc = k % 3 == 0 ? 2.0 * pi : 0.5 + 2.0 * std::abs(unit(random));
    const Vector2d centre(10.0 * radius * unit(random), 10.0 * radius * unit(random));
    const MatrixX2d p = circle(
        40, radius, centre, [&](double) { return noise * unit(random); }, 0.0,
        k % 3 == 0 || noise < 1e-3 * radius ? arc : 2.0 * pi);
    const LeastSquaresCircle c = least_squares_circle(p);
    Vector3d gradient = Vector3d::Zero();
    for (Index i = 0; i < p.rows(); ++i) {
      const Vector2d d = p.row(i).transpose() - c.centre;
      const double e = d.norm() - c.radius;
      gradient += e * Vector3d(d.x() / d.norm(), d.y() / d.norm(), 1.0) / double(p.rows());
    }
    worst = std::max(worst, gradient.norm() / c.radius);
  }
  std::cout << "gradient left " << worst << " of the radius\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(MinimumZoneCircles, AgreeWithEveryCandidateTried) {
  SeededRandom random(20250606);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0, largest_gap = 0.0;
  int is_proven = 0;
  for (int k = 0; k < 400; ++k) {
    const double noise = 50.0 * std::pow(10.0, -3.0 + 2.0 * unit(random));
    const Index n = 4 + k % 12;
    const MatrixX2d p =
        circle(n, 50.0, {unit(random), unit(random)}, [&](double) { return noise * unit(random); });
    const MinimumZoneCircles c = minimum_zone_circles(p);
    const double brute = oracles::brute_circularity(p, 0.5 * c.inner);
    EXPECT_NEAR(c.outer - c.inner, c.circularity, 1e-13);
    if (!c.is_proven) continue;
    ++is_proven;
    worst = std::max(worst, std::abs(c.circularity - brute) / std::max(brute, 1e-5));
    largest_gap = std::max(largest_gap, c.gap / std::max(brute, 1e-5));
    EXPECT_NEAR(c.circularity, brute, 1e-9 * brute + 5e-13) << "case " << k << ", n " << n;
  }
  std::cout << is_proven << " of 400 proven, off by at most " << worst
            << " of the circularity, gap " << largest_gap << "\n";
  EXPECT_GT(is_proven, 300);
}

TEST(MinimumZoneCircles, AreNeverWiderThanThoseOfLeastSquares) {
  SeededRandom random(20250607);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto start = std::chrono::steady_clock::now();
  const MatrixX2d p = circle(20000, 100.0, {10.0, 5.0}, [&](double t) {
    return 3.0_um * std::cos(3.0 * t) + 1.0_um * std::cos(2.0 * t + 0.3) + 1.0_um * unit(random);
  });
  const MinimumZoneCircles zone = minimum_zone_circles(p);
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double lsq = least_squares_circle(p).circularity;
  std::cout << "20 000 points: zone " << zone.circularity * 1e3 << " um, least squares "
            << lsq * 1e3 << " um, " << s << " s\n";
  EXPECT_LT(zone.circularity, lsq);
  EXPECT_TRUE(zone.is_proven);
  EXPECT_LT(zone.gap, 1e-9 * zone.circularity + 1e-12);
  EXPECT_LT(s, 2.0);
}

TEST(MinimumZoneCircles, OfAShortArcAreNotCalledProven) {
  std::mt19937 random(20250610);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const MatrixX2d p = circle(
      30, 100.0, {0, 0}, [&](double) { return 0.002 * unit(random); }, 0.0, 0.5 * pi);
  const MinimumZoneCircles c = minimum_zone_circles(p);
  EXPECT_FALSE(c.is_proven);
  EXPECT_LE(c.circularity, least_squares_circle(p).circularity);
}

TEST(MinimumZoneCircles, OfAThreeLobedFormIsItsHeight) {
  const MatrixX2d p =
      circle(360, 20.0, {0, 0}, [](double t) { return 2.0_um * std::cos(3.0 * t); });
  const MinimumZoneCircles c = minimum_zone_circles(p);
  EXPECT_NEAR(c.circularity, 4.0_um, 1e-12);
  EXPECT_TRUE(c.is_proven);
}

TEST(Circle, AwkwardPointsHaveAnAnswerOrARefusal) {
  MatrixX2d p(3, 2);
  p << 0, 0, 2, 0, 0, 2;
  EXPECT_NEAR(minimum_zone_circles(p).circularity, 0.0, 1e-14);
  EXPECT_NEAR((least_squares_circle(p).centre - Vector2d(1, 1)).norm(), 0.0, 1e-13);
  p << 0, 0, 1, 1, 2, 2;
  EXPECT_THROW(least_squares_circle(p), std::invalid_argument);
  p << 1, 1, 1, 1, 1, 1;
  EXPECT_THROW(minimum_zone_circles(p), std::invalid_argument);
  p(0, 0) = std::nan("");
  EXPECT_THROW(minimum_zone_circles(p), std::invalid_argument);
  EXPECT_THROW(least_squares_circle(p.topRows(2)), std::invalid_argument);
  const MatrixX2d perfect = circle(100, 1.0, {5, 5}, [](double) { return 0.0; });
  EXPECT_LT(minimum_zone_circles(perfect).circularity, 5e-15);
  MatrixX2d square(4, 2);  // four points of one circle, twice
  square << 1, 0, 0, 1, -1, 0, 0, -1;
  EXPECT_LT(minimum_zone_circles(square).circularity, 1e-15);
  MatrixX2d doubled(8, 2);
  doubled << square, square;
  EXPECT_LT(minimum_zone_circles(doubled).circularity, 1e-15);
}

MatrixX3d scattered(std::mt19937& random, Index n, double thickness) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized();
  MatrixX3d p(n, 3);
  for (Index i = 0; i < n; ++i)
    p.row(i) = turn * Vector3d(100.0 * unit(random), 60.0 * unit(random), thickness * unit(random));
  return p.rowwise() + Eigen::RowVector3d(500.0, -200.0, 30.0);
}

TEST(MinimumZonePlanes, AgreeWithEveryCandidateTried) {
  SeededRandom random(20250608);
  double worst = 0.0;
  int is_proven = 0;
  for (int k = 0; k < 300; ++k) {
    const MatrixX3d p = scattered(random, 4 + k % 12, std::pow(10.0, -4.0 + (k % 30) / 6.0));
    const MinimumZonePlanes planes = minimum_zone_planes(p);
    const double brute = oracles::brute_flatness(p);
    EXPECT_GE(planes.flatness, brute - 1e-11);
    if (!planes.is_proven) continue;
    ++is_proven;
    worst = std::max(worst, std::abs(planes.flatness - brute) / std::max(brute, 1e-4));
    EXPECT_NEAR(planes.flatness, brute, 1e-9 * brute + 5e-12) << "case " << k;
    EXPECT_NEAR(planes.upper - planes.lower, planes.flatness, 1e-12);
  }
  std::cout << is_proven << " of 300 proven, off by at most " << worst << " of the flatness\n";
  EXPECT_GT(is_proven, 250);
}

TEST(MinimumZonePlanes, OfManyPointsAreQuickAndCertain) {
  std::mt19937 random(20250609);
  const auto start = std::chrono::steady_clock::now();
  const MatrixX3d p = scattered(random, 100000, 0.005);
  const MinimumZonePlanes planes = minimum_zone_planes(p);
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << "100 000 points: " << planes.flatness * 1e3 << " um, least squares "
            << least_squares_plane(p).flatness * 1e3 << " um, gap " << planes.gap << " mm, " << s
            << " s\n";
  EXPECT_TRUE(planes.is_proven);
  EXPECT_LT(planes.flatness, least_squares_plane(p).flatness);
  EXPECT_LT(planes.gap, 1e-9 * planes.flatness + 1e-11);
  EXPECT_LT(s, 3.0);
}

template <typename Height>
MatrixX3d plate(int n, const Height& height) {
  MatrixX3d p(n * n, 3);
  for (int i = 0; i < n * n; ++i) {
    const double x = 100.0 * (2.0 * (i % n) / (n - 1) - 1.0);
    const double y = 100.0 * (2.0 * (i / n) / (n - 1) - 1.0);
    p.row(i) << x, y, height(x, y);
  }
  return p;
}

TEST(MinimumZonePlanes, OfFormsThatTieAreTheirHeights) {
  // grids full of points on lines and of equal heights
  const auto saddle = plate(21, [](double x, double y) { return 1e-7 * (x * x - y * y); });
  EXPECT_NEAR(minimum_zone_planes(saddle).flatness, 2.0_um, 1e-12);
  const auto bowl = plate(21, [](double x, double y) { return 1e-7 * (x * x + y * y); });
  EXPECT_NEAR(minimum_zone_planes(bowl).flatness, 2.0_um, 1e-12);
  const auto ridge = plate(21, [](double x, double) { return 1e-5 * std::abs(x); });
  EXPECT_NEAR(minimum_zone_planes(ridge).flatness, 1.0_um, 1e-12);
  const auto twist = plate(21, [](double x, double y) { return 1e-7 * x * y; });
  EXPECT_NEAR(minimum_zone_planes(twist).flatness, 2.0_um, 1e-12);
  const auto chequers = plate(20, [](double x, double y) {
    return (int(std::round((x + y) / 200.0 * 19.0)) % 2 == 0 ? 1.0 : -1.0) * 1e-3;
  });
  const MinimumZonePlanes c = minimum_zone_planes(chequers);
  EXPECT_NEAR(c.flatness, 2.0_um, 1e-12);
  EXPECT_TRUE(c.is_proven);
  std::cout << "gaps " << minimum_zone_planes(saddle).gap << " " << minimum_zone_planes(bowl).gap
            << " " << minimum_zone_planes(ridge).gap << " " << minimum_zone_planes(twist).gap << " "
            << c.gap << " mm\n";
  const auto tilted =
      plate(21, [](double x, double y) { return 0.01 * x - 0.02 * y + 1e-7 * (x * x - y * y); });
  EXPECT_NEAR(minimum_zone_planes(tilted).flatness, 2.0_um * 0.99975, 1e-8);  // cos of the tilt
  const auto flat = plate(11, [](double, double) { return 0.0; });
  EXPECT_LT(minimum_zone_planes(flat).flatness, 1e-13);
}

TEST(MinimumZonePlanes, OfACubeAreItsSides) {
  MatrixX3d cube(8, 3);
  for (int i = 0; i < 8; ++i) cube.row(i) << (i & 1), (i >> 1 & 1), (i >> 2 & 1);
  EXPECT_NEAR(minimum_zone_planes(cube).flatness, 1.0, 1e-12);
}

TEST(Plane, AwkwardPointsHaveAnAnswerOrARefusal) {
  MatrixX3d p(3, 3);
  p << 0, 0, 1, 10, 0, 1, 0, 10, 1;
  EXPECT_NEAR(minimum_zone_planes(p).flatness, 0.0, 1e-14);
  EXPECT_NEAR(least_squares_plane(p).normal.z(), 1.0, 1e-14);
  EXPECT_NEAR(least_squares_plane(p).offset, 1.0, 1e-14);
  p << 0, 0, 0, 1, 1, 1, 2, 2, 2;
  EXPECT_THROW(least_squares_plane(p), std::invalid_argument);
  EXPECT_THROW(minimum_zone_planes(p), std::invalid_argument);
  p.setConstant(4.0);
  EXPECT_THROW(least_squares_plane(p), std::invalid_argument);
  p(1, 1) = std::nan("");
  EXPECT_THROW(minimum_zone_planes(p), std::invalid_argument);
  EXPECT_THROW(minimum_zone_planes(p.topRows(2)), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::metrology
