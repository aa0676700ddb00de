#include <tbb/parallel_for.h>
#include "sim/study/farm.h"
#include "sim/study/response_statistics.h"
#include "sim/study/sampling.h"
#include "tests/study/openturns.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

/// A response of three inputs of the unit interval with its true indices.
struct Known {
  const char* name;
  double (*of)(const VectorXd& u);
  Eigen::Array3d first;
  Eigen::Array3d total;
};

/// Ishigami and Homma 1990 with a = 7, b = 0.1.
double ishigami(const VectorXd& u) {
  const Eigen::ArrayXd x = (2.0 * u.array() - 1.0) * pi;
  return std::sin(x(0)) + 7.0 * std::pow(std::sin(x(1)), 2) +
         0.1 * std::pow(x(2), 4) * std::sin(x(0));
}
Known ishigami_known() {
  const double a = 7.0;
  const double b = 0.1;
  const double v1 = 0.5 * std::pow(1.0 + b * std::pow(pi, 4) / 5.0, 2);
  const double v2 = a * a / 8.0;
  const double v13 = b * b * std::pow(pi, 8) * (1.0 / 18.0 - 1.0 / 50.0);
  const double v = v1 + v2 + v13;
  return {"Ishigami", ishigami, {v1 / v, v2 / v, 0.0}, {(v1 + v13) / v, v2 / v, v13 / v}};
}

double linear(const VectorXd& u) { return 1000.0 + u(0) + 2.0 * u(1) + 3.0 * u(2); }
Known linear_known() {
  const Eigen::Array3d share(1.0 / 14.0, 4.0 / 14.0, 9.0 / 14.0);
  return {"linear", linear, share, share};
}

MatrixXd scaled_responses(double (*f)(const VectorXd&), const Sequence& sequence,
                          Index base_points) {
  const MatrixXd u = points(sequence, 0, base_points);
  MatrixXd result(base_points, u.rows() / 2 + 2);
  for (Index k = 0; k < base_points; ++k)
    for (int column = 0; column < result.cols(); ++column)
      result(k, column) = f(sobol_column(u.col(k), column));
  return result;
}

TEST(SobolIndices, IshigamisAreTheKnownFigures) {
  const Known known = ishigami_known();
  EXPECT_TRUE(known.first.isApprox(Eigen::Array3d(0.3139, 0.4424, 0.0), 1e-4));
  EXPECT_TRUE(known.total.isApprox(Eigen::Array3d(0.5576, 0.4424, 0.2437), 1e-4));
}

TEST(SobolIndices, OfSobolPointsAreWithinTheirBandsAtEverySize) {
  for (const Known& known : {ishigami_known(), linear_known()})
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
      const auto steps =
          index_convergence(scaled_responses(known.of, {Sampling::Sobol, 6, seed}, 16384));
      ASSERT_EQ(steps.base_points.size(), 12u);
      EXPECT_EQ(steps.base_points.front(), 8);
      for (std::size_t s = 3; s < steps.base_points.size(); ++s) {
        for (int i = 0; i < 3; ++i) {
          const SobolIndex& index = steps.indices[s][std::size_t(i)];
          const std::string where = known.name + std::string(" seed ") + std::to_string(seed) +
                                    " input " + std::to_string(i) + " of " +
                                    std::to_string(steps.base_points[s]);
          EXPECT_LE(index.first.low, known.first(i)) << where;
          EXPECT_GE(index.first.high, known.first(i)) << where;
          EXPECT_LE(index.total.low, known.total(i)) << where;
          EXPECT_GE(index.total.high, known.total(i)) << where;
        }
        if (seed != 1) continue;
        const auto& last = steps.indices[s];
        std::cout << known.name << std::setw(6) << steps.base_points[s] << std::setprecision(4);
        for (const SobolIndex& index : last)
          std::cout << "  " << index.first.value << " [" << index.first.low << ", "
                    << index.first.high << "] " << index.total.value << " [" << index.total.low
                    << ", " << index.total.high << "]";
        std::cout << "\n";
      }
    }
}

/// Shares of studies whose bands hold the truth, first orders then totals, and mean widths.
struct Coverage {
  Eigen::Array<double, 6, 1> share = Eigen::Array<double, 6, 1>::Zero();
  Eigen::Array<double, 6, 1> width = Eigen::Array<double, 6, 1>::Zero();
};
Coverage coverage(const Known& known, Sampling sampling, Index base_points, int studies) {
  std::vector<Coverage> each(static_cast<std::size_t>(studies));
  tbb::parallel_for(0, studies, [&](int k) {
    const Sequence sequence{sampling, 6, 1000 + std::uint64_t(k)};
    const auto indices = sobol_indices(scaled_responses(known.of, sequence, base_points));
    for (int j = 0; j < 6; ++j) {
      const SobolIndex& index = indices[std::size_t(j % 3)];
      const IntervalEstimate& band = j < 3 ? index.first : index.total;
      const double truth = j < 3 ? known.first(j) : known.total(j - 3);
      each[std::size_t(k)].share(j) = band.low <= truth && truth <= band.high;
      each[std::size_t(k)].width(j) = band.high - band.low;
    }
  });
  Coverage result;
  for (const Coverage& one : each) {
    result.share += one.share / studies;
    result.width += one.width / studies;
  }
  return result;
}

TEST(SobolIndices, BandsHoldTheTruthInSome95OfAHundredStudiesAndShrinkLikeTheRoot) {
  for (const Known& known : {ishigami_known(), linear_known()}) {
    Coverage before;
    for (const Index n : {8, 64, 256, 1024, 4096, 16384}) {
      if (n > 1024 && !std::getenv("ABBE_LONG")) break;
      // The bounds below go by the number of studies.
      const int medium = std::getenv("ABBE_LONG") != nullptr ? 200 : 50;
      const int studies = n <= 64 ? 600 : n <= 1024 ? medium : n <= 4096 ? 80 : 24;
      const Coverage seen = coverage(known, Sampling::Random, n, studies);
      std::cout << known.name << std::setw(6) << n << " base points, " << studies
                << " studies: bands hold " << std::setprecision(3) << seen.share.transpose()
                << ", all " << seen.share.mean() << "; widths " << seen.width.transpose() << "\n";
      if (n == 8) {
        EXPECT_GT(seen.share.minCoeff(), 0.80);
        continue;
      }
      // Three standard deviations of the count below 91 and above 97 %.
      const double spread = 3.0 * std::sqrt(0.95 * 0.05 / studies);
      EXPECT_GT(seen.share.minCoeff(), 0.91 - spread);
      EXPECT_GT(seen.share.mean(), 0.93 - spread / 2);
      EXPECT_LT(seen.share.mean(), 0.97 + spread / 2);
      if (n >= 1024) {
        const double step = std::sqrt(4.0);
        for (int j = 0; j < 6; ++j) EXPECT_NEAR(before.width(j) / seen.width(j), step, 0.15 * step);
      }
      before = seen;
    }
  }
}

TEST(SobolIndices, BandsOfSobolPointsAreOnTheSafeSide) {
  for (const Known& known : {ishigami_known(), linear_known()})
    for (const Index n : {64, 1024}) {
      const Coverage seen = coverage(known, Sampling::Sobol, n, 100);
      std::cout << known.name << std::setw(6) << n << ": bands hold " << seen.share.transpose()
                << "\n";
      EXPECT_GT(seen.share.minCoeff(), 0.97);
    }
}

TEST(SobolIndices, OpenTurnsAgreesOnTheSameAnswers) {
  const Index n = 1024;
  const MatrixXd answers = scaled_responses(ishigami, {Sampling::Random, 6, 12}, n);
  // A, B and A with one column of B under one another, as they order them
  const auto theirs = oracle::openturns(
      R"(
n = 1024
out = ot.Sample([[v] for v in numbers])
inputs = ot.Sample(len(numbers), 3)
for kind in (ot.MauntzKucherenkoSensitivityAlgorithm, ot.SaltelliSensitivityAlgorithm):
  print(*kind(inputs, out, n).getFirstOrderIndices())
print(*ot.JansenSensitivityAlgorithm(inputs, out, n).getTotalOrderIndices())
)",
      std::vector<double>(answers.data(), answers.data() + answers.size()));
  if (!theirs) GTEST_SKIP() << "OpenTURNS is not installed";
  ASSERT_EQ(theirs->size(), 9u);
  const auto ours = sobol_indices(answers);
  // They divide by the variance of A, we by that of A and B; n - 1 and 2n - 1 are theirs too.
  const auto squares = [](const Eigen::ArrayXd& a) { return (a - a.mean()).square().mean(); };
  const MatrixXd ab = answers.leftCols(2);
  const double variance_a = squares(answers.col(0).array()) * double(n) / double(n - 1);
  const double variance = squares(Eigen::Map<const Eigen::ArrayXd>(ab.data(), ab.size()));
  const VectorXd means = answers.colwise().mean();
  for (int i = 0; i < 3; ++i) {
    const double first = ours[std::size_t(i)].first.value * variance * double(n) / double(n - 1);
    const double total =
        ours[std::size_t(i)].total.value * variance * 2.0 * double(n) / (2.0 * double(n) - 1.0);
    EXPECT_NEAR(total / variance_a, (*theirs)[std::size_t(6 + i)], 1e-13);
    // The mean that is taken off is one of a column or between them, which leaves that much open.
    const double open = std::abs(means(2 + i) - means(0)) * (means.maxCoeff() - means.minCoeff());
    EXPECT_NEAR(first / variance_a, (*theirs)[std::size_t(i)], 1.01 * open / variance_a);
    std::cout << "input " << i << ": first " << first / variance_a << " theirs "
              << (*theirs)[std::size_t(i)] << " (may differ by " << open / variance_a
              << "), total differs by " << total / variance_a - (*theirs)[std::size_t(6 + i)]
              << "\n";
    // Their Saltelli is another estimator of the same thing.
    const IntervalEstimate& band = ours[std::size_t(i)].first;
    EXPECT_NEAR(band.value, (*theirs)[std::size_t(3 + i)], 0.75 * (band.high - band.low));
  }
}

TEST(SobolIndices, ByHandOfEightBasePoints) {
  // B is A turned round; input 0 does everything, input 1 nothing.
  MatrixXd answers(8, 4);
  for (int k = 0; k < 8; ++k) answers.row(k) << k, 7 - k, 7 - k, k;
  const auto indices = sobol_indices(answers);
  // variance 5.25; mean of b (b - a) = 2 * 5.25; mean of (a - b)^2 / 2 = 2 * 5.25
  EXPECT_NEAR(indices[0].first.value, 2.0, 1e-14);
  EXPECT_NEAR(indices[0].total.value, 2.0, 1e-14);
  EXPECT_EQ(indices[1].first.value, 0.0);
  EXPECT_EQ(indices[1].total.value, 0.0);
  EXPECT_EQ(indices[1].total.high, 0.0);
}

TEST(SobolIndices, UnitsAndOffsetsDoNotMatter) {
  const MatrixXd answers = scaled_responses(ishigami, {Sampling::Random, 6, 3}, 128);
  const auto plain = sobol_indices(answers);
  for (const auto& [scale, offset] :
       {std::pair{1e-9, 0.0}, {1e100, 0.0}, {1e-150, 0.0}, {1.0, 1e6}}) {
    const auto other = sobol_indices((scale * answers).array() + offset);
    for (int i = 0; i < 3; ++i) {
      const double off = offset == 0.0 ? 1e-12 : 1e-7;
      EXPECT_NEAR(plain[std::size_t(i)].first.value, other[std::size_t(i)].first.value, off);
      EXPECT_NEAR(plain[std::size_t(i)].first.low, other[std::size_t(i)].first.low, off);
      EXPECT_NEAR(plain[std::size_t(i)].total.high, other[std::size_t(i)].total.high, off);
    }
  }
}

TEST(SobolIndices, AResponseThatDoesNotVaryHasNone) {
  const auto indices = sobol_indices(MatrixXd::Constant(20, 4, 0.1));
  for (const SobolIndex& index : indices)
    for (const IntervalEstimate& band : {index.first, index.total}) {
      EXPECT_EQ(band.value, 0.0);
      EXPECT_EQ(band.low, 0.0);
      EXPECT_EQ(band.high, 0.0);
    }
}

TEST(SobolIndices, BasePointsWithGapsAreLeftOut) {
  const MatrixXd whole = scaled_responses(ishigami, {Sampling::Random, 6, 3}, 40);
  MatrixXd gaps(42, 5);
  gaps << whole.topRows(7), Eigen::RowVectorXd::Constant(5, 1.0), whole.bottomRows(33),
      Eigen::RowVectorXd::Constant(5, 2.0);
  gaps(7, 3) = std::nan("");
  gaps(41, 0) = std::numeric_limits<double>::infinity();
  const auto expected = sobol_indices(whole);
  const auto seen = sobol_indices(gaps);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(seen[i].first.value, expected[i].first.value);
    EXPECT_EQ(seen[i].total.high, expected[i].total.high);
  }
  EXPECT_EQ(index_convergence(gaps).base_points, (std::vector<Index>{10, 20, 40}));
}

TEST(SobolIndices, EqualBitsWheneverAskedAndOtherBandsOfAnotherSeed) {
  const MatrixXd answers = scaled_responses(ishigami, {Sampling::Random, 6, 3}, 300);
  const auto one = sobol_indices(answers, 5);
  const auto other = sobol_indices(answers, 6);
  for (int again = 0; again < 5; ++again) {
    std::vector<double> shift(std::size_t(2 * again + 1));  // memory begins elsewhere
    const auto two = sobol_indices(answers, 5);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(one[i].first.value, two[i].first.value);
      EXPECT_EQ(one[i].first.low, two[i].first.low);
      EXPECT_EQ(one[i].total.high, two[i].total.high);
    }
  }
  EXPECT_EQ(one[0].first.value, other[0].first.value);
  EXPECT_NE(one[0].first.low, other[0].first.low);
  EXPECT_NEAR(one[0].first.low, other[0].first.low, 0.1 * (one[0].first.high - one[0].first.low));
}

TEST(SobolIndices, TooFewAnswersAreRefused) {
  EXPECT_THROW(sobol_indices(MatrixXd::Random(7, 4)), std::invalid_argument);
  EXPECT_THROW(sobol_indices(MatrixXd::Random(20, 2)), std::invalid_argument);
  EXPECT_THROW(sobol_indices(MatrixXd(0, 4)), std::invalid_argument);
  EXPECT_THROW(sobol_indices(MatrixXd::Constant(20, 4, std::nan(""))), std::invalid_argument);
  EXPECT_THROW(index_convergence(MatrixXd::Random(7, 4)), std::invalid_argument);
  EXPECT_NO_THROW(sobol_indices(MatrixXd::Random(8, 3)));
}

TEST(SobolIndices, ColumnsTakeOneInputOfTheOtherHalf) {
  VectorXd u(6);
  u << 0.1, 0.2, 0.3, 0.4, 0.5, 0.6;
  EXPECT_EQ(sobol_column(u, 0), Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(sobol_column(u, 1), Vector3d(0.4, 0.5, 0.6));
  EXPECT_EQ(sobol_column(u, 2), Vector3d(0.4, 0.2, 0.3));
  EXPECT_EQ(sobol_column(u, 4), Vector3d(0.1, 0.2, 0.6));
  EXPECT_THROW(sobol_column(u, 5), std::invalid_argument);
  EXPECT_THROW(sobol_column(u, -1), std::invalid_argument);
  EXPECT_THROW(sobol_column(u.head(5), 0), std::invalid_argument);
}

TEST(SobolIndices, AHundredInputsTakeSeconds) {
  const MatrixXd answers = points({Sampling::Random, 102, 1}, 0, 1024).transpose();
  const auto start = std::chrono::steady_clock::now();
  sobol_indices(answers);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  std::cout << "100 inputs, 1024 base points: " << took.count() << " s\n";
  EXPECT_LT(took.count(), 20.0);
}

MatrixXd normal_inputs(Index inputs, Index cases, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(inputs, cases, [&] { return normal(random); });
}

TEST(MainEffects, SeeWhatIsEvenInItsInputsWhereCorrelationsDoNot) {
  // y = 3 x0^2 + x1^2: variances 18 and 2, so 90 and 10 %
  const MatrixXd x = normal_inputs(4, 4000, 11);
  const VectorXd y = 3.0 * x.row(0).array().square() + x.row(1).array().square();
  const VectorXd effects = main_effects(x, y);
  EXPECT_NEAR(effects[0], 0.9, 0.03);
  EXPECT_NEAR(effects[1], 0.1, 0.03);
  EXPECT_LT(effects[2], main_effect_chance_limit(4000, 4));
  const double correlation = (x.row(0).array() * (y.array() - y.mean()).transpose()).mean() /
                             std::sqrt((y.array() - y.mean()).square().mean());
  EXPECT_LT(std::abs(correlation), 0.1) << "a correlation says that it makes 1 % at most";
}

TEST(MainEffects, AreTheFirstOrderIndicesOfAQuadraticForm) {
  // the mean square of a map: y = (2 x0 + x1)^2 + x2, with an interaction 4 x0 x1
  const auto f = [](const auto& x) { return std::pow(2.0 * x[0] + x[1], 2) + x[2]; };
  const MatrixXd x = normal_inputs(3, 200000, 3);
  VectorXd y(x.cols());
  for (Index i = 0; i < y.size(); ++i) y[i] = f(x.col(i));
  const VectorXd effects = main_effects(x, y);
  // by hand: 4 x0^2 (32), x1^2 (2), 4 x0 x1 (16), x2 (1) of 51
  EXPECT_NEAR(effects[0], 32.0 / 51.0, 0.01);
  EXPECT_NEAR(effects[1], 2.0 / 51.0, 0.01);
  EXPECT_NEAR(effects[2], 1.0 / 51.0, 0.01);
  EXPECT_NEAR(effects.sum(), 35.0 / 51.0, 0.02) << "the rest is their interaction";
}

TEST(MainEffects, OfNothingAreZeroOnTheAverageAndBeyondChanceInOneStudyOfTwenty) {
  int beyond = 0;
  double sum = 0.0;
  constexpr int studies = 1000, inputs = 20, cases = 200;
  for (int k = 0; k < studies; ++k) {
    const MatrixXd x = normal_inputs(inputs + 1, cases, unsigned(1000 + k));
    const VectorXd effects = main_effects(x.topRows(inputs), x.row(inputs).transpose());
    beyond += effects.maxCoeff() > main_effect_chance_limit(cases, inputs);
    sum += effects.mean() / studies;
  }
  // 50 are expected, with a standard deviation of 7
  EXPECT_GT(beyond, 25);
  EXPECT_LT(beyond, 80);
  EXPECT_LT(sum, 0.01);
}

TEST(MainEffects, OfFewCasesOrWithoutVariationAreZero) {
  const MatrixXd x = normal_inputs(2, 9, 1);
  EXPECT_EQ(main_effects(x, x.row(0).transpose()), Vector2d(0, 0));
  EXPECT_EQ(main_effect_chance_limit(9, 2), 1.0);
  MatrixXd many = normal_inputs(2, 50, 1);
  EXPECT_EQ(main_effects(many, VectorXd::Constant(50, 3.0)), Vector2d(0, 0));
  many.row(1).setConstant(2.0);
  const VectorXd effects = main_effects(many, many.row(0).transpose());
  EXPECT_NEAR(effects[0], 1.0, 1e-12);
  EXPECT_EQ(effects[1], 0.0);
  // of two values there is no parabola, and no unit is too small
  for (Index i = 0; i < 50; ++i) many(0, i) = i % 2 ? 1e-150 : -1e-150;
  EXPECT_NEAR(main_effects(many, many.row(0).transpose() * 1e150)[0], 1.0, 1e-12);
}

TEST(Sequence, AnyStretchIsPartOfTheWholeBitForBit) {
  for (const Sampling sampling : {Sampling::Random, Sampling::Sobol}) {
    const Sequence sequence{sampling, 7, 99};
    const MatrixXd whole = points(sequence, 0, 300);
    for (const auto& [first, count] : {std::pair{0, 1},
                                       {1, 1},
                                       {0, 2},
                                       {2, 5},
                                       {64, 64},
                                       {127, 3},
                                       {255, 45},
                                       {299, 1},
                                       {17, 0}})
      EXPECT_EQ(points(sequence, std::uint64_t(first), count), whole.middleCols(first, count))
          << first;
    const std::uint64_t far = 123'456'789'012u;
    EXPECT_EQ(points(sequence, far, 9).rightCols(4), points(sequence, far + 5, 4));
  }
}

TEST(Sequence, CoordinatesAreStrictlyWithinTheUnitInterval) {
  for (const Sampling sampling : {Sampling::Random, Sampling::Sobol})
    for (const std::uint64_t seed : {0ull, 1ull, ~0ull}) {
      const MatrixXd u = points({sampling, 50, seed}, 0, 20000);
      EXPECT_GT(u.minCoeff(), 0.0);
      EXPECT_LT(u.maxCoeff(), 1.0);
      // odd multiples of 2^-53
      EXPECT_TRUE((u.array() * 0x1p52 - 0.5 == (u.array() * 0x1p52 - 0.5).floor()).all());
    }
}

/// Sobol's points from the directions of Joe and Kuo's file new-joe-kuo-6, first ten dimensions, by
/// the definition: the number's Gray code picks the directions.
struct Direction {
  unsigned degree;
  unsigned a;
  std::vector<std::uint64_t> m;
};
std::uint64_t joe_kuo(int dimension, std::uint64_t number) {
  static const std::vector<Direction> table = {{1, 0, {1}},
                                               {2, 1, {1, 3}},
                                               {3, 1, {1, 3, 1}},
                                               {3, 2, {1, 1, 1}},
                                               {4, 1, {1, 1, 3, 3}},
                                               {4, 4, {1, 3, 5, 13}},
                                               {5, 2, {1, 1, 5, 5, 17}},
                                               {5, 4, {1, 1, 5, 5, 5}},
                                               {5, 7, {1, 1, 7, 11, 19}}};
  std::vector<std::uint64_t> m;  // m_k below 2^k
  if (dimension == 0)
    m.assign(64, 1);
  else {
    const Direction& d = table[std::size_t(dimension - 1)];
    m = d.m;
    while (m.size() < 64) {
      const std::size_t k = m.size();
      std::uint64_t next = m[k - d.degree] ^ (m[k - d.degree] << d.degree);
      for (unsigned j = 1; j < d.degree; ++j)
        if ((d.a >> (d.degree - 1 - j)) & 1u) next ^= m[k - j] << j;
      m.push_back(next);
    }
  }
  const std::uint64_t gray = number ^ (number >> 1);
  std::uint64_t x = 0;
  for (unsigned k = 0; k < 64; ++k)
    if ((gray >> k) & 1u) x ^= m[k] << (63 - k);
  return x;
}

std::uint64_t bits(double u) { return std::uint64_t(u * 0x1p52 - 0.5); }

TEST(Sequence, SobolPointsAreJoeAndKuosUpToTheirShift) {
  const MatrixXd first = points({Sampling::Sobol, 10, 5}, 0, 4096);
  const MatrixXd far = points({Sampling::Sobol, 10, 5}, 1'000'000'007, 100);
  for (int d = 0; d < 10; ++d) {
    const std::uint64_t shift = bits(first(d, 0));  // of the origin
    for (Index k = 0; k < first.cols(); ++k)
      ASSERT_EQ(bits(first(d, k)) ^ shift, joe_kuo(d, std::uint64_t(k)) >> 12) << d << " " << k;
    for (Index k = 0; k < far.cols(); ++k)
      ASSERT_EQ(bits(far(d, k)) ^ shift, joe_kuo(d, 1'000'000'007 + std::uint64_t(k)) >> 12);
  }
  // by hand: 1/2, 3/4 or 1/4, ... of the first two dimensions
  EXPECT_EQ(joe_kuo(0, 1), std::uint64_t(1) << 63);
  EXPECT_EQ(joe_kuo(1, 2), std::uint64_t(1) << 62);
  EXPECT_EQ(joe_kuo(0, 2), std::uint64_t(3) << 62);
}

TEST(Sequence, EveryDyadicIntervalHasOneSobolPoint) {
  const int dimensions = 3600;
  for (const std::uint64_t block : {0u, 1u, 5u}) {
    const MatrixXd u = points({Sampling::Sobol, dimensions, 3}, block * 256, 256);
    for (int d = 0; d < dimensions; ++d) {
      std::set<int> cells;
      for (Index k = 0; k < 256; ++k) cells.insert(int(u(d, k) * 256));
      ASSERT_EQ(cells.size(), 256u) << "dimension " << d;
    }
  }
}

TEST(Sequence, SeedsGiveOtherPoints) {
  for (const Sampling sampling : {Sampling::Random, Sampling::Sobol}) {
    const MatrixXd one = points({sampling, 4, 1}, 0, 1000);
    const MatrixXd two = points({sampling, 4, 2}, 0, 1000);
    EXPECT_FALSE((one.array() == two.array()).any());
  }
}

double correlation(const Eigen::ArrayXd& a, const Eigen::ArrayXd& b) {
  return ((a - a.mean()) * (b - b.mean())).mean() /
         std::sqrt((a - a.mean()).square().mean() * (b - b.mean()).square().mean());
}

TEST(Sequence, RandomPointsAreUniformAndUncorrelated) {
  const int n = 100000;
  double worst_cells = 0.0;
  double worst = 0.0;
  for (const std::uint64_t seed : {0ull, 1ull, 2ull, 0xffffffffffffffffull}) {
    const MatrixXd u = points({Sampling::Random, 8, seed}, 0, n);
    const MatrixXd next = points({Sampling::Random, 8, seed + 1}, 0, n);
    for (int d = 0; d < 8; ++d) {
      Eigen::ArrayXd cells = Eigen::ArrayXd::Zero(100);
      for (Index k = 0; k < n; ++k) cells[int(u(d, k) * 100)] += 1.0;
      // chi-square of 99 degrees of freedom, in its own standard deviations
      const double chi = ((cells - n / 100.0).square() / (n / 100.0)).sum();
      worst_cells = std::max(worst_cells, std::abs(chi - 99.0) / std::sqrt(198.0));
      const Eigen::ArrayXd row = u.row(d).transpose();
      const auto look = [&](const Eigen::ArrayXd& a, const Eigen::ArrayXd& b) {
        worst = std::max(worst, std::abs(correlation(a, b)) * std::sqrt(double(a.size())));
      };
      for (int e = 0; e < d; ++e) look(row, u.row(e).transpose().array());
      for (int e = 0; e < 8; ++e) look(row, next.row(e).transpose().array());
      look(row.head(n - 1), row.tail(n - 1));
      look(row.head(n - 64), row.tail(n - 64));
    }
  }
  std::cout << "worst cells " << worst_cells << " and correlation " << worst
            << " standard deviations\n";
  EXPECT_LT(worst_cells, 4.0);  // of 32 looks
  EXPECT_LT(worst, 4.5);        // of 400 looks
}

TEST(Sequence, SobolPointsIntegrateBetterThanRandomOnes) {
  // Mean of a product whose integral is 1; error over seeds at 1024 and 16384 points.
  const auto error = [](Sampling sampling, Index n) {
    double squares = 0.0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const MatrixXd u = points({sampling, 5, seed}, 0, n);
      double sum = 0.0;
      for (Index k = 0; k < n; ++k) sum += (1.0 + 0.5 * (u.col(k).array() - 0.5)).prod();
      squares += std::pow(sum / double(n) - 1.0, 2) / 20.0;
    }
    return std::sqrt(squares);
  };
  const double sobol_1k = error(Sampling::Sobol, 1024);
  const double sobol_16k = error(Sampling::Sobol, 16384);
  const double random_16k = error(Sampling::Random, 16384);
  std::cout << "RMS error: Sobol 1024 " << sobol_1k << ", 16384 " << sobol_16k << "; random 16384 "
            << random_16k << "\n";
  EXPECT_LT(sobol_16k, sobol_1k / 10.0);    // like 1/n
  EXPECT_LT(sobol_16k, random_16k / 30.0);  // and so far ahead
  EXPECT_NEAR(random_16k, std::sqrt((std::pow(1 + 0.25 / 12, 5) - 1) / 16384), random_16k * 0.4);
}

TEST(Sequence, JumpingFarCostsNoMoreThanStartingAtTheBeginning) {
  const auto seconds = [](std::uint64_t first) {
    double least = 1.0;
    for (int i = 0; i < 20; ++i) {
      const auto start = std::chrono::steady_clock::now();
      points({Sampling::Sobol, 200, 1}, first, 64);
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
      least = std::min(least, took.count());
    }
    return least;
  };
  const double near = seconds(0);
  const double far = seconds(987'654'321'987u);
  std::cout << "64 Sobol points of 200 dimensions: " << near * 1e6 << " us at 0, " << far * 1e6
            << " us at 1e12\n";
  EXPECT_LT(far, 10 * near + 1e-3);
}

TEST(Sequence, DimensionsAndNumbersOutOfRangeAreRefused) {
  EXPECT_THROW(points({Sampling::Sobol, 0, 1}, 0, 1), std::invalid_argument);
  EXPECT_THROW(points({Sampling::Sobol, 3601, 1}, 0, 1), std::invalid_argument);
  EXPECT_THROW(points({Sampling::Random, -1, 1}, 0, 1), std::invalid_argument);
  EXPECT_THROW(points({Sampling::Random, 1, 1}, 0, -1), std::invalid_argument);
  EXPECT_THROW(points({Sampling::Random, 1, 1}, ~std::uint64_t(0), 1), std::invalid_argument);
  EXPECT_EQ(points({Sampling::Sobol, 3600, 1}, 0, 0).cols(), 0);
}

}  // namespace
}  // namespace abbe::sim::study
