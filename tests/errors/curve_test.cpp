#include "errors/curve.h"
#include "tests/errors/numbers.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

CurveState standing_at(double q, int direction = 0) { return {q, q, direction, 0, false}; }
double value(const Shape& shape, double q, int direction = 0) {
  return value(Curve{shape}, standing_at(q, direction));
}
double slope(const Shape& shape, double q, int direction = 0) {
  return slope(Curve{shape}, standing_at(q, direction));
}

// ---- values against closed forms

TEST(Curve, AConstantIsItself) {
  EXPECT_EQ(value(Constant{4.0_um}, 123.0), 4.0_um);
  EXPECT_EQ(slope(Constant{4.0_um}, 123.0), 0.0);
}

TEST(Curve, APolynomialIsThatOfItsScaledArgument) {
  const Polynomial shape{numbers({1, -2, 0.5, 3}), 100, 50};
  for (const double q : {100.0, 100.0 + 1e-12, 50.0, 150.0, 0.0, 321.0}) {
    const double t = (q - 100) / 50;
    EXPECT_NEAR(value(shape, q), 1 - 2 * t + 0.5 * t * t + 3 * t * t * t,
                1e-12 * (1 + std::abs(t * t * t)));
  }
  EXPECT_EQ(value(Polynomial{}, 7.0), 0.0);
  EXPECT_EQ(slope(Polynomial{}, 7.0), 0.0);
  EXPECT_EQ(slope(Polynomial{numbers({5}), 0, 1}, 7.0), 0.0);
}

TEST(Curve, LegendreMatchesThePrintedPolynomials) {
  for (const double t : {-1.0, -0.5, -1e-12, 0.0, 0.3, 1.0}) {
    const double closed[] = {1, t, (3 * t * t - 1) / 2, (5 * t * t * t - 3 * t) / 2,
                             (35 * t * t * t * t - 30 * t * t + 3) / 8};
    for (int k = 0; k < 5; ++k) {
      VectorXd c = VectorXd::Zero(k + 1);
      c[k] = 2.0;
      EXPECT_NEAR(value(Legendre{c, 10, 200}, 10 + 200 * t), 2 * closed[k], 1e-14) << k << " " << t;
    }
  }
  EXPECT_EQ(value(Legendre{}, 7.0), 0.0);
}

TEST(Curve, FourierIsTheSumOfItsHarmonics) {
  const Fourier screw{numbers({1.0_um, 0.5_um, 0}), numbers({0, 2.0_um, -1.0_um}), 10};
  double worst = 0.0;
  for (const double q : {0.0, 2.5, 5.0, 10.0, -3.3, 487.123}) {
    const double w = 2 * std::numbers::pi * q / 10;
    const double closed = 1.0_um * std::cos(w) + 0.5_um * std::cos(2 * w) +
                          2.0_um * std::sin(2 * w) - 1.0_um * std::sin(3 * w);
    worst = std::max(worst, std::abs(value(screw, q) - closed));
  }
  std::cout << "Fourier off its closed form by at most " << worst << " mm\n";
  EXPECT_LT(worst, 1e-15);
  const Fourier turn{numbers({0}), numbers({3.0_urad}), 2 * std::numbers::pi};
  EXPECT_NEAR(value(turn, 90.0_deg), 3.0_urad, 1e-21);
  EXPECT_EQ(value(Fourier{}, 1.0), 0.0);
}

TEST(Curve, ALinearTableIsExactAtItsRowsAndStraightBetween) {
  const Table table = make_table(numbers({-10, 0, 1, 50}), numbers({0.1, 0.3, -0.7, 0.9}));
  for (int i = 0; i < 4; ++i) EXPECT_EQ(value(table, table.q[i]), table.value[i]);
  EXPECT_NEAR(value(table, -5), 0.2, 1e-16);
  EXPECT_NEAR(value(table, 0.25), 0.05, 1e-16);
  EXPECT_NEAR(value(table, 25.5), 0.1, 1e-15);
  EXPECT_NEAR(slope(table, 0.0), -1.0, 1e-15) << "the piece to the right of a knot";
  EXPECT_NEAR(slope(table, 50), 1.6 / 49, 1e-15) << "the last piece at the last row";
}

TEST(Curve, EveryRowOfAnUnevenTableIsFound) {
  SeededRandom random(7);
  std::uniform_real_distribution<double> exponent(-6, 3);
  VectorXd q(500), y(500);
  double at_q = -300;
  for (int i = 0; i < 500; ++i) {
    q[i] = at_q += std::pow(10.0, exponent(random));
    y[i] = exponent(random);
  }
  const Table table = make_table(q, y);
  for (int i = 0; i < 500; ++i) {
    ASSERT_EQ(value(table, q[i]), y[i]) << i;
    if (i == 0) continue;
    const double middle = 0.5 * (q[i - 1] + q[i]);
    const double t = (middle - q[i - 1]) / (q[i] - q[i - 1]);
    ASSERT_NEAR(value(table, middle), y[i - 1] + t * (y[i] - y[i - 1]), 1e-14) << i;
    ASSERT_NEAR(value(table, std::nextafter(q[i], -1e9)), y[i], 1e-5) << i;
  }
}

// The natural spline through (0, 0), (1, 1), (2, 0) by hand: second derivative -3 in the middle,
// s(x) = 3/2 x - 1/2 x^3 on the first piece, mirrored on the second.
TEST(Curve, TheNaturalSplineOfThreeRowsIsTheOneWorkedOutByHand) {
  const Table table =
      make_table(numbers({0, 1, 2}), numbers({0, 1, 0}), TableInterpolation::Spline);
  for (const double x : {0.0, 0.1, 0.5, 0.9, 1.0}) {
    const double closed = 1.5 * x - 0.5 * x * x * x;
    EXPECT_NEAR(value(table, x), closed, 1e-15);
    EXPECT_NEAR(value(table, 2 - x), closed, 1e-15);
    EXPECT_NEAR(slope(table, x), 1.5 - 1.5 * x * x, 1e-14);
  }
}

TEST(Curve, ASplineBendsNotAtItsEndsIsSmoothAndFollowsASineWithTheFourthPower) {
  const auto worst_of = [](int rows) {
    VectorXd q(rows), y(rows);
    for (int i = 0; i < rows; ++i) {  // sin has no second derivative at 0 and 2 pi, as the spline
      q[i] = 2 * std::numbers::pi * i / (rows - 1);
      y[i] = std::sin(q[i]);
    }
    const Table table = make_table(q, y, TableInterpolation::Spline);
    EXPECT_EQ(table.second[0], 0.0);
    EXPECT_EQ(table.second[rows - 1], 0.0);
    for (int i = 1; i + 1 < rows; ++i)
      EXPECT_NEAR(slope(table, std::nextafter(q[i], 0.0)), slope(table, q[i]), 1e-12);
    double worst = 0.0;
    for (double x = 0; x < 6.28; x += 0.001)
      worst = std::max(worst, std::abs(value(table, x) - std::sin(x)));
    return worst;
  };
  const double coarse = worst_of(21);
  const double fine = worst_of(41);
  std::cout << "spline of a sine: off by " << coarse << " with 21 rows, " << fine << " with 41\n";
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.1);
}

TEST(Curve, ASplineThroughTwoRowsIsALine) {
  const Table table = make_table(numbers({0, 4}), numbers({1, 3}), TableInterpolation::Spline);
  EXPECT_EQ(value(table, 2), 2.0);
  EXPECT_EQ(slope(table, 2), 0.5);
}

// ---- what a table says outside

TEST(Curve, ATableIsNotContinuedUnlessItSaysSo) {
  const Table strict = make_table(numbers({-10, 10}), numbers({1, 2}));
  for (const double q : {-10 - 1e-9, 10 + 1e-9, 1e300, -std::numeric_limits<double>::infinity(),
                         std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(value(strict, q), std::out_of_range) << q;
    EXPECT_THROW(slope(strict, q), std::out_of_range) << q;
  }
  const std::string said = thrown_text<std::out_of_range>([&] { value(strict, 12.5); });
  EXPECT_EQ(said, "position 12.5 is outside the table (-10 to 10)");
  for (const TableInterpolation between :
       {TableInterpolation::Linear, TableInterpolation::Spline}) {
    const Table held =
        make_table(numbers({-10, 0, 10}), numbers({1, 5, 2}), between, TableExtrapolation::Hold);
    EXPECT_EQ(value(held, -10.5), 1.0);
    EXPECT_EQ(value(held, 1e300), 2.0);
    EXPECT_EQ(slope(held, 10.5), 0.0);
    EXPECT_NE(slope(held, 10.0), 0.0);
    EXPECT_THROW(value(held, std::numeric_limits<double>::quiet_NaN()), std::out_of_range);
  }
}

TEST(Curve, ABadTableIsRefusedWithItsRow) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW(make_table(numbers({}), numbers({})), std::invalid_argument);
  EXPECT_THROW(make_table(numbers({1}), numbers({1})), std::invalid_argument);
  EXPECT_THROW(make_table(numbers({1, 2}), numbers({1})), std::invalid_argument);
  EXPECT_THROW(make_table(numbers({1, nan}), numbers({1, 2})), std::invalid_argument);
  EXPECT_THROW(make_table(numbers({1, 2}), numbers({inf, 2})), std::invalid_argument);
  EXPECT_THROW(make_table(numbers({-1e308, 1e308}), numbers({1, 2})), std::invalid_argument);
  for (const auto& q : {numbers({1, 1}), numbers({2, 1}), numbers({0, -0.0})})
    EXPECT_THROW(make_table(q, numbers({1, 2})), std::invalid_argument);
  const std::string said = thrown_text<std::invalid_argument>([&] {
    make_table(numbers({0, 5, 4}), numbers({1, 2, 3}));
  });
  EXPECT_EQ(said, "row 3: expected a position above 5, seen 4");
}

TEST(Curve, AShapeThatBreaksItsFieldsIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Table good = make_table(numbers({0, 1}), numbers({0, 1}));
  Table spline_by_hand = good;
  spline_by_hand.between = TableInterpolation::Spline;
  const Shape bad[] = {Constant{nan},
                       Polynomial{numbers({nan}), 0, 1},
                       Polynomial{numbers({1}), nan, 1},
                       Polynomial{numbers({1}), 0, 0},
                       Legendre{numbers({1}), 0, -1},
                       Fourier{numbers({1}), numbers({}), 1},
                       Fourier{numbers({1}), numbers({1}), 0},
                       Table{},
                       spline_by_hand,
                       Backlash{nan},
                       DirectionalTables{good, Table{}},
                       Repeatability{-1, 1},
                       Asynchronous{-1, 1},
                       Asynchronous{nan, 1},
                       Asynchronous{1, 1, 0, 20},
                       Asynchronous{1, 1, 3, 3},
                       Asynchronous{1, 1, 3, nan},
                       Asynchronous{1, 1, 3, 20000}};
  for (const Shape& shape : bad)
    EXPECT_THROW(validate(Curve{shape}), std::invalid_argument) << shape.index();
  EXPECT_THROW(validate(Curve{good, "", Argument::Command, false, nan}), std::invalid_argument);
  EXPECT_NO_THROW(validate(Curve{good}));
}

// ---- the way of approach

TEST(Curve, ABacklashFollowsTheWayOfApproach) {
  const Backlash shape{3.0_um};
  EXPECT_EQ(value(shape, 5, +1), 3.0_um);
  EXPECT_EQ(value(shape, 5, -1), -3.0_um);
  EXPECT_EQ(value(shape, 5, 0), 0.0);
  EXPECT_EQ(slope(shape, 5, +1), 0.0);
}

TEST(Curve, UpAndDownHaveTheirOwnTablesAndTheirMeanBefore) {
  const DirectionalTables shape{make_table(numbers({0, 10}), numbers({0, 10.0_um})),
                                make_table(numbers({0, 5, 10}), numbers({4.0_um, 4.0_um, 8.0_um}))};
  EXPECT_NEAR(value(shape, 5, +1), 5.0_um, 1e-18);
  EXPECT_NEAR(value(shape, 5, -1), 4.0_um, 1e-18);
  EXPECT_NEAR(value(shape, 5, 0), 4.5_um, 1e-18);
  EXPECT_NEAR(slope(shape, 7, +1), 1.0_um, 1e-18);
  EXPECT_NEAR(slope(shape, 7, -1), 0.8_um, 1e-18);
  EXPECT_NEAR(slope(shape, 7, 0), 0.9_um, 1e-18);
}

TEST(Curve, OnAPrimedAxisTheCarriagesOwnArgumentAndWayAreTurned) {
  const CurveState state{100.0, -100.0, +1, 0, true};
  Curve line{Polynomial{numbers({0, 2.0_um}), 0, 1}};
  Curve lost{Backlash{3.0_um}};
  EXPECT_NEAR(value(line, state), 200.0_um, 1e-15);
  EXPECT_NEAR(slope(line, state), 2.0_um, 1e-18);
  EXPECT_EQ(value(lost, state), 3.0_um);
  line.argument = lost.argument = Argument::Carriage;
  EXPECT_NEAR(value(line, state), -200.0_um, 1e-15);
  EXPECT_NEAR(slope(line, state), -2.0_um, 1e-18)
      << "per command, also where the argument is the carriage";
  EXPECT_EQ(value(lost, state), -3.0_um) << "the command goes up, the carriage down";
}

TEST(Curve, NegateAndScaleMultiplyValueAndSlope) {
  const Curve curve{Polynomial{numbers({1, 2}), 0, 1}, "", Argument::Command, true, 3.0};
  EXPECT_EQ(value(curve, standing_at(5)), -33.0);
  EXPECT_EQ(slope(curve, standing_at(5)), -6.0);
}

// ---- slope

TEST(Curve, TheSlopeIsTheDifferenceQuotient) {
  SeededRandom random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  VectorXd q(40), y(40);
  for (int i = 0; i < 40; ++i) {
    q[i] = -200 + 10 * i + 3 * unit(random);
    y[i] = 10.0_um * unit(random);
  }
  VectorXd c(7), a(4), b(4);
  for (double& x : c) x = 10.0_um * unit(random);
  for (double& x : a) x = 10.0_um * unit(random);
  for (double& x : b) x = 10.0_um * unit(random);
  const Table linear = make_table(q, y);
  const Table spline = make_table(q, y, TableInterpolation::Spline);
  const Shape shapes[] = {Constant{1},
                          Polynomial{c, 3, 200},
                          Legendre{c, 3, 200},
                          Fourier{a, b, 40},
                          linear,
                          spline,
                          DirectionalTables{linear, spline}};
  double worst = 0.0;
  for (const Shape& shape : shapes) {
    for (int i = 0; i < 500; ++i) {
      const int direction = i % 3 - 1;
      const double x = 180 * unit(random);
      const double h = 1e-4;
      const double knot = (q.array() - x).abs().minCoeff();
      if (knot < 2 * h) continue;  // a linear table has two slopes there
      const double quotient =
          (value(shape, x + h, direction) - value(shape, x - h, direction)) / (2 * h);
      worst = std::max(worst, std::abs(slope(shape, x, direction) - quotient));
    }
  }
  std::cout << "slope off the difference quotient by at most " << worst << " mm/mm\n";
  EXPECT_LT(worst, 1e-11);
}

// ---- detrend

TEST(Detrend, EndsTakesOutTheLineThroughFirstAndLast) {
  const Table table = make_table(numbers({-100, 0, 300}), numbers({1.0_um, 8.0_um, 5.0_um}));
  const DetrendedTable d = detrend(table, Detrend::Ends);
  EXPECT_NEAR(d.slope, 0.01_um, 1e-19);
  EXPECT_NEAR(d.offset, 2.0_um, 1e-17);
  EXPECT_NEAR(d.table.value[0], 0.0, 1e-17);
  EXPECT_NEAR(d.table.value[1], 6.0_um, 1e-17);
  EXPECT_NEAR(d.table.value[2], 0.0, 1e-17);
}

// By hand: q = 0 1 2 3, y = 1 1 2 4: mean 1.5 and 2, sum dq dy = 5, sum dq^2 = 5, line 0.5 + q.
TEST(Detrend, LeastSquaresTakesOutTheFittedLine) {
  const Table table = make_table(numbers({0, 1, 2, 3}), numbers({1, 1, 2, 4}));
  const DetrendedTable d = detrend(table, Detrend::LeastSquares);
  EXPECT_NEAR(d.slope, 1.0, 1e-15);
  EXPECT_NEAR(d.offset, 0.5, 1e-15);
  const VectorXd expected = numbers({0.5, -0.5, -0.5, 0.5});
  EXPECT_LT((d.table.value - expected).norm(), 1e-15);
}

TEST(Detrend, TableAndLineTogetherAreTheTableBefore) {
  const Table table =
      make_table(numbers({-7, 1, 2, 9, 30}), numbers({1, -1, 2, 4, 3}), TableInterpolation::Spline);
  for (const Detrend how : {Detrend::Ends, Detrend::LeastSquares}) {
    const DetrendedTable d = detrend(table, how);
    for (double q = -7; q <= 30; q += 0.37) {
      EXPECT_NEAR(value(d.table, q) + d.slope * q + d.offset, value(table, q), 1e-13);
      EXPECT_NEAR(slope(d.table, q) + d.slope, slope(table, q), 1e-13);
    }
    const DetrendedTable twice = detrend(d.table, how);
    EXPECT_NEAR(twice.slope, 0.0, 1e-15);
  }
}

// ---- chance

TEST(Repeatability, OnlyChanceIsRandom) {
  const Table table = make_table(numbers({0, 1}), numbers({0, 1}));
  EXPECT_TRUE(is_random(Curve{Repeatability{1.0_um, 3}}));
  for (const Shape& shape :
       {Shape(Constant{}), Shape(Polynomial{}), Shape(Legendre{}), Shape(Fourier{}), Shape(table),
        Shape(Backlash{1.0_um}), Shape(DirectionalTables{table, table})})
    EXPECT_FALSE(is_random(Curve{shape})) << shape.index();
}

TEST(Repeatability, OneStrokeHasOneValue) {
  const Curve curve{Repeatability{2.0_um, 5}};
  const double first = value(curve, {0, 0, 1, 4, false});
  EXPECT_EQ(value(curve, {77, 77, -1, 4, false}), first);
  EXPECT_NE(value(curve, {0, 0, 1, 5, false}), first);
  EXPECT_NE(value(Curve{Repeatability{2.0_um, 6}}, {0, 0, 1, 4, false}), first);
  EXPECT_EQ(value(Curve{Repeatability{0.0, 5}}, {0, 0, 1, 4, false}), 0.0);
  EXPECT_EQ(first, 2.0_um * normal_deviate(5, 4));
}

// Worked out a second time outside this program from the description of the hash.
TEST(Repeatability, TheDeviatesAreTheSameBitsForEver) {
  const std::uint64_t all = ~std::uint64_t(0);
  EXPECT_DOUBLE_EQ(normal_deviate(0, 0), -0x1.bd02818d7577cp-1);
  EXPECT_DOUBLE_EQ(normal_deviate(1, 0), -0x1.b350cb18f4a97p+0);
  EXPECT_DOUBLE_EQ(normal_deviate(1, 1), -0x1.44c161953e1c5p-2);
  EXPECT_DOUBLE_EQ(normal_deviate(20240607, 12345), 0x1.199e9579e045fp-4);
  EXPECT_DOUBLE_EQ(normal_deviate(all, all), 0x1.026ab03b540c2p+1);
}

struct Moments {
  double mean = 0, variance = 0, skew = 0, kurtosis = 0, ks = 0, lag = 0;
};

Moments moments(const VectorXd& z) {
  const double n = double(z.size());
  Moments m;
  m.mean = z.mean();
  const Eigen::ArrayXd d = z.array() - m.mean;
  m.variance = d.square().sum() / (n - 1);
  m.skew = d.cube().mean() / std::pow(m.variance, 1.5);
  m.kurtosis = d.square().square().mean() / (m.variance * m.variance);
  m.lag = (d.head(z.size() - 1) * d.tail(z.size() - 1)).sum() / d.square().sum();
  VectorXd sorted = z;
  std::sort(sorted.begin(), sorted.end());
  for (Index i = 0; i < z.size(); ++i) {
    const double F = 0.5 * std::erfc(-sorted[i] / std::numbers::sqrt2);
    m.ks = std::max({m.ks, std::abs(F - double(i) / n), std::abs(F - double(i + 1) / n)});
  }
  return m;
}

void expect_standard_normal(const VectorXd& z, const char* what) {
  const double n = double(z.size());
  const Moments m = moments(z);
  std::cout << what << ": mean " << m.mean << ", variance " << m.variance << ", skew " << m.skew
            << ", kurtosis " << m.kurtosis << ", KS sqrt(n) " << m.ks * std::sqrt(n) << ", lag one "
            << m.lag << "\n";
  const double sigmas = 4.0;  // the deviates are fixed, so this either always holds or never
  EXPECT_LT(std::abs(m.mean), sigmas / std::sqrt(n));
  EXPECT_LT(std::abs(m.variance - 1), sigmas * std::sqrt(2 / n));
  EXPECT_LT(std::abs(m.skew), sigmas * std::sqrt(6 / n));
  EXPECT_LT(std::abs(m.kurtosis - 3), sigmas * std::sqrt(24 / n));
  EXPECT_LT(std::abs(m.lag), sigmas / std::sqrt(n));
  EXPECT_LT(m.ks * std::sqrt(n), 1.95) << "Kolmogorov-Smirnov at 0.1 %";
}

TEST(Repeatability, DeviatesAreStandardNormalAlongStrokesAndAcrossSeeds) {
  const int n = 200000;
  VectorXd along(n), across(n);
  for (int i = 0; i < n; ++i) {
    along[i] = normal_deviate(42, std::uint64_t(i));
    across[i] = normal_deviate(std::uint64_t(i), 0);
  }
  expect_standard_normal(along, "strokes of seed 42");
  expect_standard_normal(across, "first strokes of all seeds");
}

// ---- asynchronous motion

constexpr double full_turn = 2 * std::numbers::pi;

/// Mean of value^2 over n turns from the angle zero, 400 to a turn.
double mean_square(const Asynchronous& shape, int turns) {
  double sum = 0.0;
  for (int i = 0; i < 400 * turns; ++i)
    sum += std::pow(value(shape, (i + 0.5) * full_turn / 400), 2);
  return sum / (400.0 * turns);
}

TEST(Asynchronous, IsRandomAndTheSameAtTheSameAngle) {
  const Asynchronous shape{1.0_um, 3};
  EXPECT_TRUE(is_random(Curve{shape}));
  EXPECT_EQ(value(shape, 17.3), value(shape, 17.3));
  EXPECT_EQ(value(shape, 17.3, +1), value(shape, 17.3, -1));
  EXPECT_NE(value(shape, 17.3), value(Asynchronous{1.0_um, 4}, 17.3));
  EXPECT_EQ(value(Asynchronous{0.0, 3}, 17.3), 0.0);
  EXPECT_EQ(value(Asynchronous{}, 17.3), 0.0);
  EXPECT_NEAR(value(Asynchronous{2.0_um, 3}, 1e5), 2 * value(shape, 1e5), 1e-17);
}

TEST(Asynchronous, MeanSquareIsThatStatedOverLongAngles) {
  for (const std::uint64_t seed : {0, 1, 2, 77}) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    for (const Asynchronous& shape :
         {Asynchronous{2.0_um, seed}, Asynchronous{2.0_um, seed, 5.0, 6.0}}) {
      for (const int turns : {20, 200, 1000}) {
        const double off = mean_square(shape, turns) / (2.0_um * 2.0_um) - 1.0;
        EXPECT_LT(std::abs(off), 200 / (turns * (shape.highest_order - shape.lowest_order)));
        if (turns == 1000)
          std::cout << "asynchronous, orders to " << shape.highest_order << ": mean square off by "
                    << off << " after " << turns << " turns\n";
      }
    }
  }
}

// What repeats every turn would be synchronous: averaged over many turns, every angle of the
// spindle sees nothing of it.
TEST(Asynchronous, MeanOverTurnsVanishesAtEveryAngle) {
  for (const std::uint64_t seed : {5, 6, 7}) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    for (const Asynchronous& shape :
         {Asynchronous{1.0_um, seed}, Asynchronous{1.0_um, seed, 0.9, 1.1},
          Asynchronous{1.0_um, seed, 50, 400}}) {
      double worst = 0.0;
      for (const double angle : {0.0, 1.0, 3.0, 5.5}) {
        double sum = 0.0;
        const int turns = 8000;
        for (int n = 0; n < turns; ++n) sum += value(shape, angle + n * full_turn);
        worst = std::max(worst, std::abs(sum / turns));
      }
      std::cout << "asynchronous " << shape.lowest_order << " to " << shape.highest_order
                << ": synchronous part of 1 um " << worst / units::nm << " nm\n";
      EXPECT_LT(worst, 0.05_um);
    }
  }
}

TEST(Asynchronous, SlopeAndBendAreThoseOfTheValue) {
  const Asynchronous shape{1.0_um, 9};
  const double h = 1e-4;
  double steepest = 0.0, bent = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double q = 0.37 * i - 1000;
    const double up = value(shape, q + h), down = value(shape, q - h), here = value(shape, q);
    steepest = std::max(steepest, std::abs((up - down) / (2 * h) - slope(shape, q)));
    bent = std::max(bent, std::abs(up - 2 * here + down) / (h * h));
  }
  std::cout << "asynchronous: slope off central differences by " << steepest
            << " mm/rad; bends by at most " << bent << ", bound "
            << second_derivative_bound(Curve{shape}) << "\n";
  EXPECT_LT(steepest, 1e-7);
  EXPECT_LE(bent, second_derivative_bound(Curve{shape}));
  EXPECT_GT(bent, 0.3 * second_derivative_bound(Curve{shape}));
}

TEST(Curve, MostBendHoldsWhatLinesBetweenSamplesMiss) {
  const Fourier two{numbers({1.0_um, 0.0}), numbers({0.0, 2.0_um}), full_turn};
  EXPECT_NEAR(second_derivative_bound(Curve{two}), 9.0_um, 1e-15);
  EXPECT_NEAR(second_derivative_bound(Curve{two, "", Argument::Command, true, -2.0}), 18.0_um,
              1e-15);
  EXPECT_EQ(second_derivative_bound(Curve{Polynomial{numbers({0, 0, 5}), 0, 1}}), 0.0);
  const Curve curve{Asynchronous{1.0_um, 11}};
  const double step = std::sqrt(8 * 0.1_nm / second_derivative_bound(curve));
  double missed = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double q = i * step;
    const auto v = [&](double x) { return value(curve, standing_at(x)); };
    missed = std::max(missed, std::abs(v(q + step / 2) - 0.5 * (v(q) + v(q + step))));
  }
  std::cout << "sampled every " << step << " rad: lines miss by " << missed / units::nm << " nm\n";
  EXPECT_LE(missed, 0.1_nm);
}

}  // namespace
}  // namespace abbe::errors
