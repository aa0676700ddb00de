#include "sim/study/sampling.h"

#include <chrono>
#include <cmath>
#include <iostream>
#include <set>

#include <gtest/gtest.h>

namespace abbe::sim::study {
namespace {

TEST(Sequence, AnyStretchIsPartOfTheWholeBitForBit) {
  for (const Sampling sampling : {Sampling::Random, Sampling::Sobol}) {
    const Sequence sequence{sampling, 7, 99};
    const Eigen::MatrixXd whole = points(sequence, 0, 300);
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
      const Eigen::MatrixXd u = points({sampling, 50, seed}, 0, 20000);
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
  const Eigen::MatrixXd first = points({Sampling::Sobol, 10, 5}, 0, 4096);
  const Eigen::MatrixXd far = points({Sampling::Sobol, 10, 5}, 1'000'000'007, 100);
  for (int d = 0; d < 10; ++d) {
    const std::uint64_t shift = bits(first(d, 0));  // of the origin
    for (Eigen::Index k = 0; k < first.cols(); ++k)
      ASSERT_EQ(bits(first(d, k)) ^ shift, joe_kuo(d, std::uint64_t(k)) >> 12) << d << " " << k;
    for (Eigen::Index k = 0; k < far.cols(); ++k)
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
    const Eigen::MatrixXd u = points({Sampling::Sobol, dimensions, 3}, block * 256, 256);
    for (int d = 0; d < dimensions; ++d) {
      std::set<int> cells;
      for (Eigen::Index k = 0; k < 256; ++k) cells.insert(int(u(d, k) * 256));
      ASSERT_EQ(cells.size(), 256u) << "dimension " << d;
    }
  }
}

TEST(Sequence, SeedsGiveOtherPoints) {
  for (const Sampling sampling : {Sampling::Random, Sampling::Sobol}) {
    const Eigen::MatrixXd one = points({sampling, 4, 1}, 0, 1000);
    const Eigen::MatrixXd two = points({sampling, 4, 2}, 0, 1000);
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
    const Eigen::MatrixXd u = points({Sampling::Random, 8, seed}, 0, n);
    const Eigen::MatrixXd next = points({Sampling::Random, 8, seed + 1}, 0, n);
    for (int d = 0; d < 8; ++d) {
      Eigen::ArrayXd cells = Eigen::ArrayXd::Zero(100);
      for (Eigen::Index k = 0; k < n; ++k) cells[int(u(d, k) * 100)] += 1.0;
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
  const auto error = [](Sampling sampling, Eigen::Index n) {
    double squares = 0.0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const Eigen::MatrixXd u = points({sampling, 5, seed}, 0, n);
      double sum = 0.0;
      for (Eigen::Index k = 0; k < n; ++k) sum += (1.0 + 0.5 * (u.col(k).array() - 0.5)).prod();
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
