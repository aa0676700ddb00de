#include "errors/metrology/surface_texture.h"

#include <cmath>
#include <iostream>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "tests/oracles/rippled_wave.h"

namespace abbe::errors::metrology {
namespace {

struct Grid {
  Eigen::MatrixX2d xy;
  Eigen::VectorXd z;
  Eigen::VectorXd weights;
};

/// Cells of a square of side 1, heights at their middles.
template <typename Height>
Grid grid(int n, const Height& height) {
  Grid g{Eigen::MatrixX2d(n * n, 2), Eigen::VectorXd(n * n), Eigen::VectorXd::Ones(n * n)};
  for (int i = 0; i < n * n; ++i) {
    const double x = (i % n + 0.5) / n, y = (i / n + 0.5) / n;
    g.xy.row(i) << x, y;
    g.z[i] = height(x, y);
  }
  return g;
}

ArealParameters of(const Grid& g, ArealReference reference = ArealReference::Plane) {
  return areal(g.xy, g.z, g.weights, {reference});
}

TEST(ArealParameters, OfASineAreItsClosedForms) {
  const double A = 0.003;
  // ten whole waves; what is sampled at 500 points a wave misses 1e-5 of the closed forms
  const Grid g = grid(1000, [&](double x, double) { return A * std::sin(20.0 * pi * x); });
  const ArealParameters a = of(g, ArealReference::None);
  EXPECT_NEAR(a.Sa / (2.0 * A / pi), 1.0, 2e-4);  // midpoint sums of |sin|: (pi/n)^2/6, n = 100
  EXPECT_NEAR(a.Sq / (A / std::sqrt(2.0)), 1.0, 1e-12);
  EXPECT_NEAR(a.Sz / (2.0 * A), 1.0, 5e-4);
  EXPECT_NEAR(*a.Ssk, 0.0, 1e-11);  // rounding of a million terms
  EXPECT_NEAR(*a.Sku, 1.5, 1e-11);
  std::cout << "Sa " << a.Sa / (2.0 * A / pi) - 1.0 << ", Sq " << a.Sq / (A / std::sqrt(2.0)) - 1.0
            << " off, relative\n";
}

TEST(ArealParameters, OfAPublishedSurfaceAreThoseOfSurfalize) {
  const test::RippledWave wave = test::rippled_wave();
  const ArealParameters a =
      areal(wave.xy, wave.z, Eigen::VectorXd::Ones(wave.z.size()), {ArealReference::Mean});
  // tests/test_parameters.py there, which holds these to 1e-6
  EXPECT_NEAR(a.Sa, 0.653132, 1e-6);
  EXPECT_NEAR(a.Sq, 0.745961, 1e-6);
  EXPECT_NEAR(a.Sp, 1.854956, 1e-6);
  EXPECT_NEAR(a.Sv, 1.998661, 1e-6);
  EXPECT_NEAR(a.Sz, 3.853617, 1e-6);
  EXPECT_NEAR(*a.Ssk, -0.08144, 1e-6);
  EXPECT_NEAR(*a.Sku, 1.818014, 1e-6);
  std::cout.precision(9);
  std::cout << "Sa " << a.Sa << ", Sq " << a.Sq << ", Sp " << a.Sp << ", Sv " << a.Sv << ", Ssk "
            << *a.Ssk << ", Sku " << *a.Sku << "\n";
}

TEST(ArealParameters, OfAnEggBoxAreItsClosedForms) {
  const Grid g = grid(400, [](double x, double y) {
    return 0.001 * std::sin(8.0 * pi * x) * std::sin(8.0 * pi * y);
  });
  const ArealParameters a = of(g);
  EXPECT_NEAR(a.Sq, 0.0005, 1e-9);
  EXPECT_NEAR(a.Sa, 0.001 * 4.0 / (pi * pi), 1e-6);
  EXPECT_NEAR(*a.Sku, 2.25, 1e-3);
}

TEST(ArealParameters, OfAParaboloidCutOffAtItsMean) {
  // z = x^2 on (0, 1): mean 1/3, variance 4/45, third moment 16/945
  const Grid g = grid(1000, [](double x, double) { return x * x; });
  const ArealParameters a = of(g, ArealReference::Mean);
  EXPECT_NEAR(a.Sq, std::sqrt(4.0 / 45.0), 1e-6);
  EXPECT_NEAR(*a.Ssk, (16.0 / 945.0) / std::pow(4.0 / 45.0, 1.5), 1e-5);
  EXPECT_NEAR(a.Sp, 2.0 / 3.0, 2e-3);
  EXPECT_NEAR(a.Sv, 1.0 / 3.0, 2e-3);
}

TEST(ArealParameters, APlaneIsNoRoughness) {
  const unsigned seed = 20250604;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Grid g{Eigen::MatrixX2d(5000, 2), Eigen::VectorXd(5000), Eigen::VectorXd(5000)};
  for (int i = 0; i < 5000; ++i) {
    g.xy.row(i) << 1000.0 + 50.0 * unit(random), -2000.0 + 30.0 * unit(random);
    g.weights[i] = 1.0 + unit(random);
    g.z[i] = 0.002 * unit(random);
  }
  const ArealParameters rough = of(g);
  g.z += 0.01 * g.xy.col(0) - 0.003 * g.xy.col(1) + Eigen::VectorXd::Constant(5000, 77.0);
  const ArealParameters tilted = of(g);
  std::cout << "a tilt changes Sq by " << std::abs(tilted.Sq - rough.Sq) << " mm\n";
  EXPECT_NEAR(tilted.Sa, rough.Sa, 1e-13);
  EXPECT_NEAR(tilted.Sq, rough.Sq, 1e-13);
  EXPECT_NEAR(tilted.Sz, rough.Sz, 1e-12);
  EXPECT_NEAR(*tilted.Ssk, *rough.Ssk, 1e-9);
}

TEST(ArealParameters, APointOfTwiceTheAreaCountsTwice) {
  Grid g = grid(3, [](double x, double y) { return x * y * (x - y); });
  g.weights[4] = 2.0;
  Grid twice = g;
  twice.xy.conservativeResize(10, 2);
  twice.xy.row(9) = g.xy.row(4);
  twice.z.conservativeResize(10);
  twice.z[9] = g.z[4];
  twice.weights = Eigen::VectorXd::Ones(10);
  EXPECT_NEAR(of(g).Sq, of(twice).Sq, 1e-15);
  EXPECT_NEAR(*of(g).Sku, *of(twice).Sku, 1e-12);
}

TEST(ArealParameters, AFlatSurfaceHasNoShape) {
  const ArealParameters a = of(grid(4, [](double, double) { return 0.0; }));
  EXPECT_EQ(a.Sq, 0.0);
  EXPECT_FALSE(a.Ssk || a.Sku);
}

TEST(ArealParameters, RefusesWhatIsNoSurface) {
  const Grid good = grid(3, [](double x, double) { return x; });
  Grid g = good;
  g.z[0] = std::nan("");
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.weights[0] = -1.0;
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.weights.setZero();
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.xy.col(1) = 2.0 * g.xy.col(0);
  EXPECT_THROW(of(g), std::invalid_argument);
  EXPECT_NO_THROW(of(g, ArealReference::Mean));
  g.z.conservativeResize(8);
  EXPECT_THROW(of(g), std::invalid_argument);
  EXPECT_THROW(of(Grid{}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::metrology
