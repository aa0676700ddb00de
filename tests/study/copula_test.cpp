#include "kinematics/decompositions.h"
#include "sim/study/response_statistics.h"
#include "sim/study/sampling.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

using Kind = Distribution::Kind;

template <typename F>
std::string refusal(F f) {
  return thrown_text<std::invalid_argument>([&] { f(); }, "nothing was refused");
}

TEST(Copula, IndependentInputsAreTheirQuantilesAndNothingElse) {
  const std::vector<Distribution> marginals = {{Kind::Normal, 3, 2},
                                               {Kind::Normal, 3, 2, 0, 4},
                                               {Kind::Uniform, -1, 0.5},
                                               {Kind::Triangular, 0, 1},
                                               {Kind::LogNormal, 1, 0.2}};
  const MatrixXd u = points({Sampling::Random, 5, 3}, 0, 500);
  const std::vector<Correlation> none = {{0, 1, 0.0}};
  const std::vector<Correlation> others = {{0, 3, 0.5}};
  const MatrixXd alone = values(Copula(5, none), marginals, u);
  const MatrixXd beside = values(Copula(5, others), marginals, u);
  for (Index k = 0; k < u.cols(); ++k)
    for (Index i = 0; i < 5; ++i) {
      const double expected = quantile(marginals[std::size_t(i)], u(i, k));
      ASSERT_EQ(alone(i, k), expected);
      if (i != 0 && i != 3) {
        ASSERT_EQ(beside(i, k), expected);
      }
    }
  EXPECT_NEAR((beside.row(0) - alone.row(0)).cwiseAbs().maxCoeff(), 0.0,
              1e-13);  // first of a group
  EXPECT_TRUE(Copula(5, none).groups().empty());
  EXPECT_EQ(Copula(5, others).groups().front().of, (std::vector<int>{0, 3}));
}

/// Largest and root mean square distance of a sample's covariance from the true one, in the
/// standard deviations that it has for normal numbers.
struct Distance {
  double worst = 0.0;
  double rms = 0.0;  ///< about 1; of a few dependent entries hardly less open than the worst
};
Distance distance(const MatrixXd& sample, const MatrixXd& truth) {
  const auto n = double(sample.cols());
  const MatrixXd centred = sample.colwise() - sample.rowwise().mean();
  const MatrixXd seen = centred * centred.transpose() / (n - 1);
  Distance result;
  int count = 0;
  for (Index i = 0; i < truth.rows(); ++i)
    for (Index j = 0; j <= i; ++j) {
      const double band = std::sqrt((truth(i, i) * truth(j, j) + truth(i, j) * truth(i, j)) / n);
      if (band == 0.0) {
        EXPECT_EQ(seen(i, j), 0.0);
        continue;
      }
      const double z = (seen(i, j) - truth(i, j)) / band;
      result.worst = std::max(result.worst, std::abs(z));
      result.rms += z * z;
      ++count;
    }
  result.rms = std::sqrt(result.rms / count);
  return result;
}

TEST(Copula, CovarianceOfCorrelatedDrawsIsWithinTheBandOfItsSample) {
  const std::uint64_t seed = 21;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  // Any covariance of 12 numbers in mixed units, of rank 12, 5 and 1.
  for (const int rank : {12, 5, 1}) {
    MatrixXd root(12, rank);
    const MatrixXd u = points({Sampling::Random, 12, seed}, 0, rank);
    for (Index i = 0; i < 12; ++i)
      for (Index j = 0; j < rank; ++j) root(i, j) = (i % 2 ? 1e-3 : 1e-6) * normal_score(u(i, j));
    root.row(4).setZero();  // zero by convention
    const MatrixXd covariance = root * root.transpose();
    const VectorXd deviation = covariance.diagonal().cwiseSqrt();
    MatrixXd correlation = MatrixXd::Identity(12, 12);
    for (Index i = 0; i < 12; ++i)
      for (Index j = 0; j < 12; ++j)
        if (i != j && deviation(i) * deviation(j) > 0.0)
          correlation(i, j) = covariance(i, j) / deviation(i) / deviation(j);
    const MatrixXd z =
        scores(Copula(correlation), points({Sampling::Random, 12, seed + 1}, 0, 200000));
    const MatrixXd draws = deviation.asDiagonal() * z;
    const Distance from = distance(draws, covariance);
    std::cout << "rank " << rank << ": covariance within " << from.worst << " (rms " << from.rms
              << ") standard deviations\n";
    EXPECT_LT(from.worst, 4.0);
    if (rank == 12) {
      EXPECT_LT(from.rms, 1.6);
    }
    EXPECT_EQ(draws.row(4), Eigen::RowVectorXd::Zero(draws.cols()));
    // What the belief knows exactly the draws know: no part outside the range of the covariance.
    const MatrixXd scaled =
        (deviation.array() > 0).select(deviation.array().inverse(), 0.0).matrix().asDiagonal() *
        root;
    const MatrixXd fitted = scaled * least_squares(scaled, MatrixXd(z.leftCols(100))).x;
    MatrixXd left = z.leftCols(100) - fitted;
    left.row(4).setZero();
    if (rank < 12) {
      EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-7) << "rank " << rank;
    }
  }
}

TEST(Copula, FullCorrelationMakesInputsOne) {
  const std::vector<Correlation> pairs = {{0, 1, 1.0}, {0, 2, -1.0}, {1, 2, -1.0}};
  const Copula copula(3, pairs);
  const std::vector<Distribution> marginals(3, {Kind::Normal, 1, 2, -3, 5});  // even about 1
  const MatrixXd drawn = values(copula, marginals, points({Sampling::Sobol, 3, 1}, 0, 1000));
  EXPECT_LT((drawn.row(0) - drawn.row(1)).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_LT((drawn.row(0) + drawn.row(2)).array().abs().maxCoeff() - 2.0, 1e-7);
  EXPECT_NEAR((drawn.row(0) + drawn.row(2)).minCoeff(), 2.0, 1e-7);
}

TEST(Copula, MarginalsStayWhatTheyAreAndRanksCorrelate) {
  const std::uint64_t seed = 4;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const std::vector<Correlation> pairs = {{0, 2, 0.8}, {1, 2, -0.3}};
  const std::vector<Distribution> marginals = {
      {Kind::Normal, 3, 2, 0, 4}, {Kind::Triangular, 0, 1}, {Kind::LogNormal, 1, 0.5, 0.2, 5}};
  const Index n = 100000;
  const MatrixXd drawn =
      values(Copula(3, pairs), marginals, points({Sampling::Random, 3, seed}, 0, n));
  for (Index i = 0; i < 3; ++i) {
    const Distribution& marginal = marginals[std::size_t(i)];
    EXPECT_GE(drawn.row(i).minCoeff(), marginal.low);
    EXPECT_LE(drawn.row(i).maxCoeff(), marginal.high);
    // Kolmogorov's distance, 1 % point 1.63
    VectorXd sorted = drawn.row(i).transpose();
    std::ranges::sort(sorted);
    double distance = 0.0;
    for (Index k = 0; k < n; ++k)
      distance = std::max(
          distance, std::abs(cumulative(marginal, sorted(k)) - (double(k) + 0.5) / double(n)));
    std::cout << "Kolmogorov " << distance * std::sqrt(double(n)) << "\n";
    EXPECT_LT(distance * std::sqrt(double(n)), 1.63);
  }
  // Spearman's of a Gaussian copula: 6/pi asin(rho/2); its band here is about 2/sqrt(n).
  const VectorXd rank = correlations(drawn, drawn.row(2).transpose()).rank;
  EXPECT_NEAR(rank(0), 6 / pi * std::asin(0.4), 3.0 / std::sqrt(double(n)));
  EXPECT_NEAR(rank(1), 6 / pi * std::asin(-0.15), 3.5 / std::sqrt(double(n)));
  EXPECT_NEAR(correlations(drawn, drawn.row(1).transpose()).rank(0), 0.0,
              3.5 / std::sqrt(double(n)));
}

TEST(Copula, ACaseHasTheSameBitsInWhateverCompanyItIsDrawn) {
  std::vector<Correlation> pairs;
  for (int i = 1; i < 9; ++i) pairs.push_back({0, i, 0.3});
  const Copula copula(11, pairs);
  const std::vector<Distribution> marginals(11, {Kind::Normal, 1, 2, -1, 5});
  const Sequence sequence{Sampling::Sobol, 11, 8};
  const MatrixXd whole = values(copula, marginals, points(sequence, 0, 257));
  for (const auto& [first, count] : {std::pair{0, 1}, {1, 1}, {5, 2}, {64, 65}, {250, 7}, {9, 0}}) {
    const MatrixXd u = points(sequence, std::uint64_t(first), count);
    EXPECT_EQ(values(copula, marginals, u), whole.middleCols(first, count)) << first;
  }
}

TEST(Copula, WhatNoNumbersCanBeIsRefusedWithTheWorstEigenvalue) {
  const auto of = [](std::vector<Correlation> pairs) { return refusal([&] { Copula(3, pairs); }); };
  // 1 + 2 rho is an eigenvalue of three equal correlations: -0.4 here.
  EXPECT_EQ(
      of({{0, 1, -0.7}, {0, 2, -0.7}, {1, 2, -0.7}}),
      "these correlations are impossible: the smallest eigenvalue of the correlation matrix is "
      "-0.4, expected at least 0 (multiplying all correlations by 0.714 would suffice)");
  EXPECT_NO_THROW(Copula(3, std::vector<Correlation>{
                                {0, 1, -0.7 * 0.714}, {0, 2, -0.7 * 0.714}, {1, 2, -0.7 * 0.714}}));
  EXPECT_NO_THROW(Copula(3, std::vector<Correlation>{{0, 1, -0.5}, {0, 2, -0.5}, {1, 2, -0.5}}));
  EXPECT_EQ(of({{0, 1, 1.01}}), "a correlation must be from -1 to 1, not 1.01");
  EXPECT_EQ(of({{0, 1, std::nan("")}}), "a correlation must be from -1 to 1, not nan");
  EXPECT_EQ(of({{0, 1, 0.1}, {1, 0, 0.1}}), "inputs 1 and 0 have two correlations");
  EXPECT_HAS(of({{0, 3, 0.1}}), "not 0 and 3");
  EXPECT_HAS(of({{-1, 2, 0.1}}), "not -1 and 2");
  EXPECT_HAS(of({{2, 2, 1}}), "two different inputs");
}

TEST(Copula, MatricesThatAreNoneAreRefused) {
  const auto of = [](const MatrixXd& matrix) { return refusal([&] { Copula copula(matrix); }); };
  MatrixXd matrix = MatrixXd::Identity(3, 3);
  EXPECT_EQ(of(matrix), "nothing was refused");
  EXPECT_EQ(of(matrix.topRows(2)), "a correlation matrix must be square");
  matrix(0, 1) = 0.5;
  EXPECT_EQ(of(matrix), "a correlation matrix must be symmetric");
  matrix(0, 1) = std::nan("");
  EXPECT_EQ(of(matrix), "a correlation is not finite");
  EXPECT_EQ(of(2 * MatrixXd::Identity(2, 2)),
            "a correlation matrix must have ones on its diagonal, not 2");
}

TEST(Copula, NumbersOfInputsThatDifferAreRefused) {
  const MatrixXd u = points({Sampling::Random, 3, 1}, 0, 4);
  EXPECT_THROW(scores(Copula(2), u), std::invalid_argument);
  EXPECT_THROW(values(Copula(3), std::vector<Distribution>(2), u), std::invalid_argument);
  EXPECT_THROW(Copula(-1), std::invalid_argument);
  EXPECT_EQ(scores(Copula(0), MatrixXd(0, 5)).cols(), 5);
}

}  // namespace
}  // namespace abbe::sim::study
